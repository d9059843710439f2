"""`locate`, `batch` and `link`: what users of trackpy know, with its column names."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _boresight
from ._errors import BoresightError
from ._tables import FRAME, HEIGHT, WIDTH, X, Y, column, needed
from ._track import frames_of, request

if TYPE_CHECKING:
    import pandas


def locate(frame: Any, *, minmass: float | None = None, config: Any = None, **sets: Any) -> pandas.DataFrame:
    """Finds what stands out in one frame; a DataFrame as of `batch`, without `frame`.

    Without `config` the detector is chosen by looking at this frame; for several frames `batch` looks at all of them.
    """
    return batch([frame], minmass=minmass, config=config, **sets).drop(columns="frame")


def batch(
    frames: Any,
    *,
    minmass: float | None = None,
    config: Any = None,
    rate_hz: float | None = None,
    detector: Any = None,
    **sets: Any,
) -> pandas.DataFrame:
    """Finds what stands out in every frame.

    Args:
        frames: a path, an array of frames x rows x columns, or an iterable of arrays.
        minmass: leave out what has a smaller sum of brightness, counts.
        config, detector, **sets: as of `track`; without `config` and `detector` one is chosen by looking at the first frames. No
            diameter is needed.

    Returns:
        A DataFrame with trackpy's columns `y`, `x` (px), `mass` (sum of brightness), `size` (radius of a disc of the same area, px),
        `signal` (brightest value), `ep` (standard deviation of the position, px), `frame`; and `var_x`, `cov_xy`,
        `var_y` (px²), `width`, `height` (px), which `link` makes use of.
    """
    import pandas as pd

    asked = request(config, sets, rate_hz=rate_hz, detector=detector)
    if isinstance(frames, str | os.PathLike):
        found, _ = _boresight.detect_path(os.fspath(frames), asked)
    else:
        found, _ = _boresight.detect_arrays(*frames_of(frames, None), asked)
    df = pd.DataFrame(
        {
            "y": found["y"],
            "x": found["x"],
            "mass": found["sum"],
            "size": np.sqrt(found["area"] / np.pi),
            "signal": found["peak"],
            "ep": np.sqrt((found["var_x"] + found["var_y"]) / 2),
            "frame": found["frame"],
            "var_x": found["var_x"],
            "cov_xy": found["cov_xy"],
            "var_y": found["var_y"],
            "width": found["width"],
            "height": found["height"],
        }
    )
    return df if minmass is None else df[df["mass"] >= minmass].reset_index(drop=True)


def link(
    features: Any,
    search_range: float | None = None,
    memory: int | None = None,
    *,
    config: Any = None,
    rate_hz: float = 25.0,
    **sets: Any,
) -> pandas.DataFrame:
    """Links positions into tracks.

    Args:
        features: a DataFrame with `frame`, `y`, `x` (px); their covariances `var_x`, `cov_xy`, `var_y` or `ep`, if they
            are there, are made use of.
        search_range: the farthest that something moves from one frame to the next, px; learnt from the positions if absent.
        memory: frames for which something may be gone and still be the same; learnt if absent.
        config, rate_hz, **sets: as of `track`.

    Returns:
        A copy with the column `particle`; a position that belongs to no track has one of its own, as in trackpy.
    """
    import pandas as pd

    df = features.copy() if isinstance(features, pd.DataFrame) else pd.DataFrame(features)
    if search_range is not None and not search_range > 0:
        raise BoresightError("expected a distance above 0 px", where=f"search_range = {search_range}", hint="px from frame to frame")
    keys = dict(sets)
    if search_range is not None:
        keys.setdefault("tracker__max_speed_px_per_s", float(search_range) * rate_hz)
    if memory is not None:
        keys.setdefault("tracker__coast_s", (memory + 0.5) / rate_hz)
    frame = needed(df, FRAME, np.int64)
    order = np.argsort(frame, kind="stable")
    rows = _boresight.track_columns(
        frame[order],
        np.stack([needed(df, X)[order], needed(df, Y)[order]], axis=1),
        _covariances(df)[order],
        _sizes(df)[order],
        request(config, keys, rate_hz=rate_hz),
    )
    df["particle"] = _particles(rows.columns_as_arrays(), frame, order)
    return df


def _covariances(df: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    """N x 3, xx, xy, yy, px²; 1 px² where nothing is said."""
    xx, yy = column(df, ("var_x", "var_x_px2")), column(df, ("var_y", "var_y_px2"))
    if xx is not None and yy is not None:
        xy = column(df, ("cov_xy", "cov_x_y_px2"))
        return np.stack([xx, np.zeros_like(xx) if xy is None else xy, yy], axis=1)
    n = len(needed(df, FRAME))
    ep = column(df, ("ep",))
    # trackpy gives NaN, 0 or less where it could not tell the error.
    variance = np.ones(n) if ep is None else np.where(np.isfinite(ep) & (ep > 0), ep, 1.0) ** 2
    return np.stack([variance, np.zeros(n), variance], axis=1)


def _sizes(df: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    width, height = column(df, WIDTH), column(df, HEIGHT)
    if width is None or height is None:
        return np.zeros((len(needed(df, FRAME)), 2))
    return np.stack([width, height], axis=1)


def _particles(c: dict[str, Any], frame: np.ndarray[Any, Any], order: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Each row's track, counted from 0; positions without one are numbered behind the tracks."""
    in_order = frame[order]
    out = np.full(len(frame), -1, dtype=np.int64)
    took = c["detection"] >= 0
    first = np.searchsorted(in_order, c["frame"][took])
    ids, numbers = np.unique(c["track_id"][took], return_inverse=True)
    out[order[first + c["detection"][took]]] = numbers
    alone = out < 0
    out[alone] = len(ids) + np.arange(alone.sum())
    return out
