"""`evaluate`: every measure of tracks against a truth."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _boresight
from ._tables import table_of

if TYPE_CHECKING:
    import pandas


class Evaluation(Mapping[str, float]):
    """Measures by name, as `boresight evaluate` prints them: `evaluation["MOTA"]`.

    Attributes:
        units: the unit of each measure; empty for shares and counts.
        better: `higher`, `lower`, or empty.
        notes: remarks, a sentence each.
    """

    def __init__(self, values: dict[str, tuple[float, str, str]], notes: list[str]) -> None:
        self._values = {name: value for name, (value, _, _) in values.items()}
        self.units = {name: unit for name, (_, unit, _) in values.items()}
        self.better = {name: better for name, (_, _, better) in values.items()}
        self.notes = notes

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def to_pandas(self) -> pandas.DataFrame:
        """A row a measure: `value`, `unit`, `better`."""
        import pandas as pd

        columns = {"value": self._values, "unit": self.units, "better": self.better}
        return pd.DataFrame(columns).rename_axis("measure")

    def __repr__(self) -> str:
        lines = [f"{name:24} {value:12.4f} {self.units[name]}".rstrip() for name, value in self.items()]
        return "\n".join(lines + [f"note: {n}" for n in self.notes])

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{v:.4f}</td><td>{html.escape(self.units[k])}</td></tr>" for k, v in self.items())
        notes = "".join(f"<p>{html.escape(n)}</p>" for n in self.notes)
        return f"<table><tr><th>measure</th><th>value</th><th>unit</th></tr>{rows}</table>{notes}"


def evaluate(
    truth: Any,
    result: Any,
    *,
    distance_px: float | None = None,
    min_overlap: float = 0.5,
    cutoff_px: float = 10.0,
    order: float = 2.0,
    rate_hz: float | None = None,
    size_px: tuple[float, float] | None = None,
    all_measures: bool = True,
) -> Evaluation:
    """Judges tracks against a truth: CLEAR, identity, HOTA, OSPA, GOSPA, SIAP, NEES and more.

    Args:
        truth, result: `Tracks`, a path (any table that the command reads), a DataFrame or a dictionary of columns: `frame`,
            `track_id` (or `particle`), `x_px`, `y_px` (or `x`, `y`), and `width_px`, `height_px` for boxes.
        distance_px: match centres up to this distance; without it boxes match by their overlap.
        min_overlap: intersection over union from which boxes match.
        cutoff_px, order: of OSPA and GOSPA.
        rate_hz, size_px: of the frames, for measures an hour and a megapixel.
        all_measures: else CLEAR, identity and HOTA only.

    Raises:
        BoresightError: tables that cannot be read or do not belong together; options out of range.
    """
    values, notes = _boresight.evaluate(
        table_of(truth),
        table_of(result),
        distance_px=distance_px,
        min_overlap=min_overlap,
        cutoff_px=cutoff_px,
        order=order,
        rate_hz=rate_hz,
        size_px=size_px,
        all_measures=all_measures,
    )
    return Evaluation(values, notes)
