"""Filters by hand: `Kf`, `Ud`, `Srif`, `Information`, `SquareRoot` for one target, `Batch` for many at once.

All forms give the same numbers; they differ in what rounding does to them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _boresight
from ._errors import BoresightError
from ._frames import numbers
from .models import ConstantAcceleration, ConstantVelocity, Model, Singer

__all__ = ["Batch", "Information", "Kf", "SquareRoot", "Srif", "Ud"]


def _covariance(r: Any, n: int, name: str) -> np.ndarray[Any, Any]:
    """n x n from a matrix, or from one variance for all."""
    a = numbers(r, name)
    if a.ndim == 0:
        return np.diag(np.full(n, float(a)))
    if a.shape[-2:] != (n, n):
        raise BoresightError(f"shape {a.shape}: expected {n} x {n}, or one variance", where=name, hint="np.diag makes one of variances")
    return a


def _vector(x: Any, name: str) -> np.ndarray[Any, Any]:
    a = numbers(x, name)
    if a.ndim != 1:
        raise BoresightError(f"shape {a.shape}: expected a row of numbers", where=name, hint="numpy.ravel makes one")
    return a


class _Filter(_boresight.Filter):
    _form = ""

    def __new__(cls, model: Model, x: Any, P: Any) -> _Filter:
        if not isinstance(model, ConstantVelocity | ConstantAcceleration | Singer):
            raise BoresightError(f"a {type(model).__name__}", where="model", hint="boresight.models has them")
        mean = _vector(x, "x")
        cov = _covariance(P, len(mean), "P")
        if cov.ndim != 2:
            raise BoresightError(f"shape {cov.shape}: expected one matrix", where="P", hint="Batch takes many")
        return super().__new__(cls, cls._form, model._name, model._parameters(), mean, cov)

    def correct(self, z: Any, R: Any) -> None:
        """Corrects the belief by a measured position `z` (x, y) with covariance `R`: 2 x 2, or one variance for both axes (px²)."""
        self.correct_native(_vector(z, "z"), _covariance(R, 2, "R"))

    def log_likelihood(self, z: Any, R: Any) -> float:
        """The log of the density (per px²) of a measurement before it is used."""
        return self.log_likelihood_native(_vector(z, "z"), _covariance(R, 2, "R"))

    def __repr__(self) -> str:
        return f"<boresight.filters.{type(self).__name__} at {np.array2string(self.x, precision=3)}>"


class Kf(_Filter):
    """Kalman filter in covariance form, Joseph update.

    Args:
        model: the motion, from `boresight.models`.
        x: the first mean, in the order of the model's states.
        P: its covariance, n x n, or one variance for all states.
    """

    _form = "kf"


class Ud(_Filter):
    """The same on U-D factors (Bierman, Thornton): the covariance cannot lose its sign. Arguments as of `Kf`."""

    _form = "ud"


class Srif(_Filter):
    """The same as square-root information filter (Bierman), by Householder reflections. Arguments as of `Kf`."""

    _form = "srif"


class Information(_Filter):
    """The same in information form. Arguments as of `Kf`."""

    _form = "information"


class SquareRoot(_Filter):
    """The same on a square root of the covariance (Potter). Arguments as of `Kf`."""

    _form = "square-root"


class Batch(_boresight.Batch):
    """Many constant-velocity tracks at once, each with uncorrelated axes; the whole batch in one call.

    Args:
        model: a `ConstantVelocity`.
        x: N x 4, `[x, vx, y, vy]` of each track.
        P: 4 x 4 for all, N x 4 x 4, or one variance for all states; nothing but zeros between x and y.
    """

    def __new__(cls, model: ConstantVelocity, x: Any, P: Any) -> Batch:
        cov = _covariance(P, 4, "P")
        return super().__new__(cls, model.q, np.atleast_2d(numbers(x, "x")), cov.reshape(-1, 16))

    def step(self, dt_s: float, z: Any, r: Any) -> int:
        """Predicts all tracks by `dt_s` and corrects each by its position; returns how many packs of 8 were refused.

        Args:
            z: N x 2, px; a row with NaN is a missed scan.
            r: variance of the positions, px²: one, one for each axis (2), or N x 2.

        A pack in which a value is not finite is left as it was.
        """
        if not (isinstance(z, np.ndarray) and z.dtype == np.float64 and z.flags.c_contiguous):
            z = numbers(z, "z")
        variance = numbers(r, "r")
        if z.ndim != 2 or variance.shape not in {(), (2,), z.shape}:
            raise BoresightError(
                f"positions of shape {z.shape}, variances of shape {variance.shape}",
                where="step",
                hint=f"z is {len(self)} x 2; r one number, two, or as z",
            )
        if variance.ndim < 2:
            variance = np.broadcast_to(variance, (1, 2))
        return self.step_native(dt_s, z, np.ascontiguousarray(variance))
