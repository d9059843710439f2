"""`simulate`: frames of a scene whose truth is known."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _boresight
from ._errors import BoresightError
from ._tracks import Tracks


@dataclass(frozen=True)
class Simulation:
    """Frames and their truth.

    Attributes:
        frames: n x rows x columns.
        times_s: the time of each frame, s.
        truth: where the targets are, as `Tracks`.
        rate_hz: frames/s.
    """

    frames: np.ndarray[Any, Any]
    times_s: np.ndarray[Any, Any]
    truth: Tracks
    rate_hz: float


def scenes() -> dict[str, str]:
    """The scenes that have a name, each with what it shows."""
    return dict(_boresight.scenes())


def simulate(scene: str | os.PathLike[str] = "ds2", *, seed: int = 1, run: int = 0, n_frames: int | None = None) -> Simulation:
    """Makes the frames of a scene: by name (`scenes()`), from a TOML file, or from TOML text. The same seed gives the same bits.

    Raises:
        BoresightError: a name that is none, a scene that does not hold together.
    """
    name, text = os.fspath(scene), None
    if "\n" in name:
        name, text = "scene", name
    elif Path(name).is_file():
        text = Path(name).read_text(encoding="utf-8")
    for what, value in (("seed", seed), ("run", run), ("n_frames", n_frames)):
        if value is not None and not 0 <= value < 2**64:
            raise BoresightError("expected a number from 0 to 2**64 - 1", where=f"{what} = {value}")
    frames, times, truth, rate_hz = _boresight.simulate(name, text, seed, run, n_frames)
    if not frames:
        raise BoresightError("the scene has no frames", where=f"n_frames = {n_frames}", hint="at least 1")
    return Simulation(np.stack(frames), np.array(times), Tracks(truth), rate_hz)
