"""`Config`: everything that decides what a run gives."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from . import _boresight
from ._errors import BoresightError
from ._keys import assignments


class Config:
    """The whole configuration of a run: how frames are read, how they become detections, how those become tracks.

    Keys are set by keyword, two underlines for the dot: `Config(tracker__coast_s=1.0, filter="ud")`. What each means stands in
    docs/config.md. A configuration is complete: the same one on the same frames gives the same bits.
    """

    def __init__(self, *, filter: str | None = None, associator: str | None = None, **sets: Any) -> None:
        self._native = _boresight.Config(assignments(sets, filter, associator))

    @classmethod
    def _of(cls, native: _boresight.Config) -> Config:
        self = cls.__new__(cls)
        self._native = native
        return self

    @classmethod
    def auto(cls, source: Any, *, rate_hz: float | None = None, times: Any = None, **sets: Any) -> Config:
        """What the automatic choice takes for a path or frames, looked at up to its first 400 frames; `.reasons` says why.

        `detector=` asks for a detector by its word, as of `track`; `false_tracks_per_hour=` for how many are allowed.
        """
        from ._track import plan

        return plan(source, rate_hz=rate_hz, times=times, **sets)

    @classmethod
    def for_detections(cls, scans: Iterable[Any], *, rate_hz: float | None = None, times: Any = None, **sets: Any) -> Config:
        """What is learnt from recorded detections, for a `Tracker` that gets more of their kind: noise, motion, scores, clutter.

        Args:
            scans: for each scan what `Tracker.update` takes: positions, boxes with scores, a dictionary, `supervision.Detections`; some
                hundred scans teach enough.
            rate_hz, times: scans/s, or the time of each, s.
        """
        from ._track import request

        seconds = None if times is None else [float(t) for t in times]
        return cls._of(_boresight.choose_for_scans(list(scans), seconds, request(None, sets, rate_hz=rate_hz)))

    @classmethod
    def preset(cls, name: str, **sets: Any) -> Config:
        """A ready configuration by name; `Config.presets()` lists them."""
        return cls._of(_boresight.Config.preset(name)).set(**sets)

    @staticmethod
    def presets() -> list[str]:
        """The names of the ready configurations."""
        return _boresight.Config.presets()

    @classmethod
    def from_toml(cls, source: str | os.PathLike[str]) -> Config:
        """From a file, or from TOML text (anything with a line break or `=`)."""
        if isinstance(source, str) and ("\n" in source or "=" in source or not source.strip()):
            return cls._of(_boresight.Config.from_toml(source, "text"))
        return cls._of(_boresight.Config.from_file(os.fspath(source)))

    def set(self, *, filter: str | None = None, associator: str | None = None, **sets: Any) -> Config:
        """The configuration with keys changed; this one stays as it is."""
        return self._of(self._native.with_sets(assignments(sets, filter, associator)))

    def to_toml(self) -> str:
        """The configuration as it stands in a file; the command takes it with `--config`."""
        return self._native.to_toml()

    @property
    def reasons(self) -> list[str]:
        """Why it is what it is, a sentence each; empty if it was given."""
        return self._native.reasons

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Config) and self.to_toml() == other.to_toml()

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __repr__(self) -> str:
        return f"boresight.Config.from_toml('''\n{self.to_toml()}''')"

    def __getstate__(self) -> str:
        return self.to_toml()

    def __setstate__(self, text: str) -> None:
        self._native = _boresight.Config.from_toml(text, "pickle")


def settled(config: Any) -> Config | None:
    """A configuration from what a user gives: one, a preset's name, a path, TOML text, a dictionary of keys."""
    if config is None or isinstance(config, Config):
        return config
    if isinstance(config, dict):
        return Config(**{k.replace(".", "__").replace("-", "_"): v for k, v in config.items()})
    if isinstance(config, str) and config in Config.presets():
        return Config.preset(config)
    if isinstance(config, str | os.PathLike):
        return Config.from_toml(config)
    raise BoresightError(
        f"a {type(config).__name__}",
        where="config",
        hint="give a Config, a preset's name, a path, TOML text, or a dictionary of keys",
    )
