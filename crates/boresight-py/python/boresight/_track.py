"""`track`: the whole way from a path or arrays to tracks."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from . import _boresight
from ._config import Config, settled
from ._errors import BoresightError, BoresightWarning
from ._keys import assignments
from ._progress import bar
from ._tracks import Tracks


def track(
    source: str | os.PathLike[str] | Iterable[Any],
    *,
    rate_hz: float | None = None,
    times: Any = None,
    config: Any = None,
    detector: str | Callable[[np.ndarray[Any, Any]], Any] | None = None,
    filter: str | None = None,
    associator: str | None = None,
    false_tracks_per_hour: float | None = None,
    annotate: str | os.PathLike[str] | None = None,
    progress: bool | Callable[[int, int | None], Any] | None = None,
    **sets: Any,
) -> Tracks:
    """Tracks what moves in an image sequence.

    Args:
        source: a video, a folder or glob of images, an image stack, a table of detections (.csv, .txt), or any iterable of arrays:
            rows x columns of bool, integers or floats, rows x columns x 3 for colour (RGB).
        rate_hz: frames/s of a source without times of its own; 25 if absent.
        times: the time of each frame, s, for arrays; one for each frame, rising.
        config: a `Config`, a preset's name, a path of a TOML file, TOML text, or a dictionary of keys; without it everything is chosen
            by looking at the first frames.
        detector: one of the library's by its word, where it is not to be chosen: `isolated`, `cfar`, `integrate`, `bernoulli`,
            `moving`, `steadied`, `spot`, `local`, `colour`. Or your own `f(pixels) -> detections` in its place, a detector or a
            measurement: positions N x 2 (px), boxes N x 4 (left, top, right, bottom), a dictionary with `positions`, `covariances`
            (N x 2 x 2, px²), `boxes`, `scores`, `classes`, or `supervision.Detections`. Without `config` it runs over all frames
            before the first is tracked.
        filter, associator: short for `tracker__filter` and `tracker__associator`; `boresight config --list filters` lists them.
        false_tracks_per_hour: how many are allowed; fewer take longer to confirm.
        annotate: also write the video with boxes, ids and ellipses drawn in, H.264 in MP4.
        progress: show how far it is (a terminal or a notebook does by itself), or a function of the frames done and all (or `None`).
        **sets: keys of the configuration, two underlines for the dot: `tracker__coast_s=1.0`.

    Raises:
        BoresightError: an input that cannot be read; a key or value that does not exist. Of an input that breaks off `.partial` holds
            the tracks before. What `source` or `detector` raise comes through as it is; Ctrl-C ends the run behind its frame.
    """
    with bar(progress) as tell:
        rows = _rows(
            source,
            times,
            request(
                config,
                {"filter": filter, "associator": associator, **sets},
                rate_hz=rate_hz,
                false_tracks_per_hour=false_tracks_per_hour,
                detector=detector,
                annotate=annotate,
                progress=tell,
            ),
        )
    tracks = Tracks(rows)
    for text in tracks.warnings:
        warnings.warn(text, BoresightWarning, stacklevel=2)
    return tracks


def request(
    config: Any,
    sets: dict[str, Any],
    *,
    rate_hz: float | None = None,
    false_tracks_per_hour: float | None = None,
    detector: Any = None,
    annotate: str | os.PathLike[str] | None = None,
    progress: Any = None,
) -> dict[str, Any]:
    """What the native functions are asked for; `filter` and `associator` among the keys are the short ones."""
    if not (detector is None or isinstance(detector, str) or callable(detector)):
        raise BoresightError(
            f"a {type(detector).__name__}", where="detector", hint="a function from pixels to detections, or a detector's word"
        )
    whole = settled(config)
    keys = dict(sets)
    return {
        "config": None if whole is None else whole._native,
        "sets": assignments(keys, keys.pop("filter", None), keys.pop("associator", None)),
        "rate_hz": _number(rate_hz, "rate_hz"),
        "false_tracks_per_hour": _number(false_tracks_per_hour, "false_tracks_per_hour"),
        "detector": None if isinstance(detector, str) else detector,
        "detector_word": detector if isinstance(detector, str) else None,
        "annotate": annotate,
        "progress": progress,
    }


def _number(value: Any, name: str) -> float | None:
    try:
        return None if value is None else float(value)
    except (TypeError, ValueError) as e:
        raise BoresightError(f"expected a number: {e}", where=name, hint="25.0, for example") from e


def _rows(source: Any, times: Any, asked: dict[str, Any]) -> _boresight.Rows:
    try:
        if isinstance(source, str | os.PathLike):
            if times is not None:
                raise BoresightError("times are for arrays", where="times", hint="a file has its own; rate_hz= says another rate")
            return _boresight.track_path(os.fspath(source), asked)
        return _boresight.track_arrays(*frames_of(source, times), asked)
    except BoresightError as e:
        if isinstance(e.partial, _boresight.Rows):
            e.partial = Tracks(e.partial)
        raise


def frames_of(source: Any, times: Any) -> tuple[Any, int | None, list[float] | None, bool]:
    """The iterable, its length, the times, and whether it can be gone through twice."""
    if isinstance(source, np.ndarray) and source.ndim not in (3, 4):
        raise BoresightError(
            f"an array of shape {source.shape}: expected frames x rows x columns",
            where="source",
            hint="one frame is given as [frame]; bs.locate(frame) finds what is in it",
        )
    if not hasattr(source, "__iter__") and hasattr(source, "__getitem__") and hasattr(source, "__len__"):
        source = [source[k] for k in range(len(source))]
    if not hasattr(source, "__iter__"):
        raise BoresightError(
            f"a {type(source).__name__}",
            where="source",
            hint="give a path, an array of frames x rows x columns, or an iterable of arrays",
        )
    n = len(source) if hasattr(source, "__len__") else None
    seconds = None if times is None else [float(t) for t in np.asarray(times, dtype=float).ravel()]
    if seconds is not None and not np.isfinite(seconds).all():
        raise BoresightError("expected finite times", where="times", hint="seconds, from any zero, rising")
    if seconds is not None and n is not None and len(seconds) != n:
        raise BoresightError(f"{len(seconds)} times for {n} frames", where="times", hint="one for each frame, s")
    twice = isinstance(source, np.ndarray | list | tuple)
    return source, n, seconds, twice


def plan(source: Any, *, rate_hz: float | None, times: Any, **sets: Any) -> Config:
    """What the automatic choice takes for a source; nothing is tracked."""
    allowed, word = sets.pop("false_tracks_per_hour", None), sets.pop("detector", None)
    if not (word is None or isinstance(word, str)):
        raise BoresightError("a function", where="detector", hint="what its detections teach is learnt by Config.for_detections")
    asked = request(None, sets, rate_hz=rate_hz, false_tracks_per_hour=allowed, detector=word)
    if isinstance(source, str | os.PathLike):
        return Config._of(_boresight.choose_for_path(os.fspath(source), asked))
    return Config._of(_boresight.choose_for_arrays(*frames_of(source, times), asked))
