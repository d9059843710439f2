"""Motion models of `boresight.filters`, both axes alike."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ConstantVelocity:
    """Constant velocity driven by white acceleration of density `q` (px²/s³). States `[x, vx, y, vy]` (px, px/s)."""

    q: float

    _name = "constant-velocity"

    def _parameters(self) -> list[float]:
        return [self.q]


@dataclass(frozen=True)
class ConstantAcceleration:
    """Constant acceleration driven by white jerk of density `q` (px²/s⁵). States `[x, vx, ax, y, vy, ay]`."""

    q: float

    _name = "constant-acceleration"

    def _parameters(self) -> list[float]:
        return [self.q]


@dataclass(frozen=True)
class Singer:
    """Acceleration of standard deviation `std` (px/s²) that lasts for about `tau_s` seconds. States `[x, vx, ax, y, vy, ay]`."""

    std: float
    tau_s: float

    _name = "singer"

    def _parameters(self) -> list[float]:
        return [self.std, self.tau_s]


Model = ConstantVelocity | ConstantAcceleration | Singer
