"""Tables of positions from whatever holds columns: DataFrames, dictionaries of arrays, `Tracks`, files."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from . import _boresight
from ._errors import BoresightError
from ._tracks import Tracks

# The names by which columns go, ours first; then trackpy, TrackMate, napari, MOTChallenge's words.
FRAME = ("frame", "t", "FRAME")
ID = ("track_id", "particle", "id", "TRACK_ID", "tracker_id")
X = ("x_px", "x", "POSITION_X", "cx")
Y = ("y_px", "y", "POSITION_Y", "cy")
WIDTH = ("width_px", "width", "w")
HEIGHT = ("height_px", "height", "h")
LEFT = ("left", "bb_left", "left_px")
TOP = ("top", "bb_top", "top_px")


def names_of(table: Any) -> list[str]:
    """The names of a table's columns."""
    return [str(c) for c in (table.columns if hasattr(table, "columns") else table.keys())]


def column(table: Any, names: tuple[str, ...], kind: Any = np.float64) -> np.ndarray[Any, Any] | None:
    """The first of these columns that the table has."""
    have = set(names_of(table))
    for name in names:
        if name in have:
            try:
                return np.ascontiguousarray(np.asarray(table[name]), dtype=kind)
            except (TypeError, ValueError) as e:
                raise BoresightError(f"expected numbers: {e}", where=f"column {name}", hint="drop rows without a value") from e
    return None


def needed(table: Any, names: tuple[str, ...], kind: Any = np.float64) -> np.ndarray[Any, Any]:
    """As `column`, where it must be there."""
    found = column(table, names, kind)
    if found is None:
        raise BoresightError(
            f"no column {names[0]!r} (or {', '.join(names[1:])})",
            where=f"columns {', '.join(names_of(table))}",
            hint="rename yours: df.rename(columns={...})",
        )
    return found


def _one_length(*columns: np.ndarray[Any, Any] | None) -> None:
    if len({len(c) for c in columns if c is not None}) > 1:
        raise BoresightError("columns of different lengths", where="table", hint="one row for each track and frame")


def table_of(source: Any, tentative: bool = False) -> _boresight.Table:
    """A table of tracks; rows that a run calls tentative are left out."""
    if isinstance(source, _boresight.Table):
        return source
    if isinstance(source, Tracks):
        return _boresight.Table.from_rows(source._rows, tentative)
    if isinstance(source, str | os.PathLike):
        return _boresight.Table.from_path(os.fspath(source), tentative)
    if not (hasattr(source, "columns") or hasattr(source, "keys")):
        raise BoresightError(
            f"a {type(source).__name__}", where="table", hint="give Tracks, a path, a DataFrame or a dictionary of columns"
        )
    frame, ids = needed(source, FRAME, np.int64), needed(source, ID, np.int64)
    width, height = column(source, WIDTH), column(source, HEIGHT)
    points = width is None or height is None or not (width.any() or height.any())
    if width is None or height is None:
        width = height = np.zeros(len(frame))
    left, top = column(source, LEFT), column(source, TOP)
    _one_length(frame, ids, width, height, left, top)
    if left is None or top is None:
        x, y = needed(source, X), needed(source, Y)
        _one_length(frame, x, y)
        left, top = x - 0.5 * width, y - 0.5 * height
    boxes = np.stack([left, top, width, height], axis=1)
    states = np.full((len(frame), 5), np.nan)
    for k, names in enumerate((("vx_px_per_s",), ("vy_px_per_s",), ("var_x_px2",), ("cov_x_y_px2",), ("var_y_px2",))):
        found = column(source, names)
        if found is not None:
            states[:, k] = found
    kept = np.ones(len(frame), dtype=bool)
    if "status" in names_of(source) and not tentative:
        kept = np.asarray(source["status"]).astype(str) != "tentative"
    return _boresight.Table.from_columns(
        frame[kept], ids[kept], np.ascontiguousarray(boxes[kept]), np.ascontiguousarray(states[kept]), points
    )
