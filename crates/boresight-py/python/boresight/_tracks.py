"""`Tracks`: the result of a run, and the ways out of it."""

from __future__ import annotations

import html
import os
import warnings as python_warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from . import _boresight
from ._config import Config
from ._errors import BoresightError, BoresightWarning

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow

_FORMAT_OF_ENDING = {
    ".csv": "csv",
    ".txt": "mot",
    ".jsonl": "jsonl",
    ".parquet": "parquet",
    ".html": "report",
    ".geff": "geff",
    ".npy": "napari",
    ".zip": "mot-zip",
    ".mcap": "mcap",
    ".ts": "vmti",
}


class Tracks:
    """The tracks of a run: a row for each track and frame, with the whole covariance.

    Columns are those of tracks.csv: `frame` from 0, `time_s`, `track_id` from 1, `status`, the state (`x_px`, `y_px`, `vx_px_per_s`,
    `vy_px_per_s`), the upper triangle of its covariance, the box's size, `detection` (the number of the detection taken
    among those of its frame; -1 or missing: none). Pixels count from the centre of the top-left pixel.
    """

    def __init__(self, rows: _boresight.Rows) -> None:
        self._rows = rows
        self._report: str | None = None

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._rows)

    @property
    def n_tracks(self) -> int:
        """Number of tracks that were confirmed at some time."""
        return int(self._rows.summary["n_confirmed_tracks"])

    @property
    def summary(self) -> dict[str, Any]:
        """`n_frames`, `duration_s`, `n_detections`, `n_confirmed_tracks`, `most_at_once`, `mean_nis`."""
        return self._rows.summary

    @property
    def config(self) -> Config:
        """The configuration; given back it gives the identical tracks."""
        return Config._of(self._rows.config)

    @property
    def warnings(self) -> list[str]:
        """What was lost of the input, or made up, a sentence each."""
        return self._rows.warnings

    def to_dict(self) -> dict[str, np.ndarray[Any, Any]]:
        """The columns as arrays of the number of rows, each the caller's own."""
        columns = self._rows.columns_as_arrays()
        columns["status"] = np.array(_boresight.Rows.STATUS)[columns["status"]]
        return columns

    def covariances(self) -> np.ndarray[Any, Any]:
        """The covariances of `[x, vx, y, vy]`, rows x 4 x 4 (px, px/s)."""
        columns = list(self._rows.columns_as_arrays().values())[8:18]
        out = np.empty((len(self), 4, 4))
        upper = [(i, j) for i in range(4) for j in range(i, 4)]
        for (i, j), values in zip(upper, columns, strict=True):
            out[:, i, j] = out[:, j, i] = values
        return out

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a DataFrame; `status` is a categorical."""
        import pandas as pd

        columns: dict[str, Any] = dict(self._rows.columns_as_arrays())
        words = list(_boresight.Rows.STATUS)
        columns["status"] = pd.Categorical.from_codes(columns["status"], categories=words)
        return pd.DataFrame(columns, copy=False)

    def to_polars(self) -> polars.DataFrame:
        """The columns as a polars frame."""
        import polars as pl

        return pl.DataFrame(self)

    def to_arrow(self) -> pyarrow.Table:
        """The columns as an Arrow table, without a copy."""
        import pyarrow as pa

        return pa.table(self)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The columns for any reader of Arrow's C stream, without a copy."""
        return self._rows.__arrow_c_stream__(requested_schema)

    def write(self, path: str | os.PathLike[str], format: str | None = None) -> None:
        """Writes the table; without `format` the ending says which.

        `csv` (the command's tracks.csv, byte by byte), `mot` (.txt), `jsonl`, `parquet` (needs pyarrow), `geff` (a folder), `napari`
        (.npy), `mot-zip` (.zip), `mcap`, `vmti` (.ts), and by name `cvat`, `trackmate-xml`, `kitti`, `trackpy`, `trackmate`, `btrack`,
        `ultrack`. `csv`, `jsonl` and `parquet` hold tentative rows too; `trackpy` holds measured rows only. What a format cannot hold is
        said as a warning.
        """
        chosen = format or _FORMAT_OF_ENDING.get(Path(path).suffix.lower())
        if chosen == "report":
            self.report(path)
            return
        if chosen == "parquet":
            import pyarrow.parquet as pq

            pq.write_table(self.to_arrow(), os.fspath(path))
            return
        if chosen is None:
            raise BoresightError(
                f"no format has the ending {Path(path).suffix!r}",
                where=os.fspath(path),
                hint=f"endings: {', '.join(_FORMAT_OF_ENDING)}; or say format=",
            )
        dropped = self._rows.write(os.fspath(path), chosen)
        if dropped:
            python_warnings.warn(f"{chosen} does not hold: {', '.join(dropped)}", BoresightWarning, stacklevel=2)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Writes the report: one HTML file that opens offline."""
        self._rows.report(os.fspath(path))
        self._report = os.fspath(path)

    def plot(self, ax: Any = None, **line: Any) -> Any:
        """Draws the confirmed tracks with matplotlib; y points down as in the image. Returns the axes."""
        if ax is None:
            import matplotlib.pyplot as plt

            ax = plt.gca()
        for x, y in self._paths(len(self)):
            ax.plot(x, y, **line)
        ax.set_aspect("equal")
        ax.set(xlabel="x, px", ylabel="y, px")
        if not ax.yaxis_inverted():
            ax.invert_yaxis()
        return ax

    def _paths(self, most: int) -> list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]:
        """The longest confirmed tracks, at most so many, as x and y."""
        c = self._rows.columns_as_arrays()
        kept = c["status"] != 0
        ids, x, y = c["track_id"][kept], c["x_px"][kept], c["y_px"][kept]
        order = np.argsort(ids, kind="stable")
        ids, x, y = ids[order], x[order], y[order]
        ends = np.flatnonzero(np.diff(ids)) + 1
        paths = list(zip(np.split(x, ends), np.split(y, ends), strict=True)) if len(ids) else []
        return sorted(paths, key=lambda p: -len(p[0]))[:most]

    def __repr__(self) -> str:
        s = self.summary
        nis = "" if s["mean_nis"] is None else f", mean NIS {s['mean_nis']:.2f} (2 if the uncertainty is honest)"
        return (
            f"<boresight.Tracks of {self._rows.label}: {s['n_confirmed_tracks']} confirmed tracks in {s['n_frames']} frames "
            f"({s['duration_s']:.1f} s), {s['n_detections']} detections{nis}>"
        )

    def _repr_html_(self) -> str:
        """The summary, a picture of the 50 longest tracks, and a link to the report if it is written, for a notebook."""
        paths = self._paths(50)
        drawn = ""
        if paths:
            x, y = (np.concatenate([p[k] for p in paths]) for k in (0, 1))
            left, top = x.min() - 5, y.min() - 5
            width, height = max(x.max() + 5 - left, 1.0), max(y.max() + 5 - top, 1.0)
            lines = []
            for k, (px, py) in enumerate(paths):
                step = max(1, len(px) // 400)
                points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px[::step], py[::step], strict=True))
                colour = f"hsl({137 * k % 360} 70% 45%)"
                lines.append(
                    f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5" vector-effect="non-scaling-stroke"/>'
                )
            drawn = (
                f'<svg viewBox="{left:.1f} {top:.1f} {width:.1f} {height:.1f}" style="max-width:32em;max-height:24em;'
                f'border:1px solid #8888" role="img" aria-label="paths of the tracks">{"".join(lines)}</svg>'
            )
        said = "".join(f"<li>{html.escape(w)}</li>" for w in self.warnings)
        said = f"<ul>{said}</ul>" if said else ""
        linked = "<p><code>tracks.report('report.html')</code> writes the report.</p>"
        if self._report is not None:
            linked = f'<p><a href="{html.escape(quote(self._report))}" target="_blank">{html.escape(self._report)}</a></p>'
        return f"<div><p>{html.escape(repr(self).strip('<>'))}</p>{drawn}{said}{linked}</div>"
