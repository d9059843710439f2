"""`Tracker`: one scan a call, for cameras and loops of your own."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from . import _boresight
from ._config import Config, settled
from ._detections import is_supervision, of_supervision, parts


class Tracker(_boresight.Tracker):
    """Tracks frames or detections as they come.

    One tracker takes either frames (`step`) or detections made elsewhere (`update`). Threads may call it at once; one after the other gets
    in. Arrays are copied before the call lets other threads run, so they may be written to again afterwards.

    Args:
        config: a `Config`, a preset's name, a path, TOML text or a dictionary of keys. Without it the defaults hold; for boxes of an object
            detector take the preset `detections-mot`, for frames `Config.auto(...)` of some that were recorded.
        **sets: keys of the configuration: `tracker__coast_s=1.0`.
    """

    def __new__(cls, config: Any = None, **sets: Any) -> Tracker:
        whole = settled(config) or Config()
        if sets:
            whole = whole.set(**sets)
        return super().__new__(cls, whole._native)

    @property
    def config(self) -> Config:
        """The configuration."""
        return Config._of(self.native_config)

    def update(
        self,
        detections: Any = None,
        *,
        boxes: Any = None,
        covariances: Any = None,
        scores: Any = None,
        classes: Any = None,
        std_px: float | None = None,
        std_per_side: float | None = None,
        time_s: float | None = None,
    ) -> Any:
        """Tracks the detections of one scan; returns the `States` of all tracks after it.

        Args:
            detections: positions N x 2 (px), boxes N x 4 to N x 6, a dictionary, or `supervision.Detections`; then
                `supervision.Detections` come back, see `update_supervision`.
            boxes: N x 4, left, top, right, bottom, px, as object detectors give them (the first pixel begins at 0). With
                `detections` they are only the sizes; alone their centres are the positions.
            covariances: N x 2 x 2, or 2 x 2 for all, px²; else `std_px` and `std_per_side` times the box's side, whichever is
                more (1 px without both).
            scores: N. classes: N, whole numbers from 0.
            time_s: the time of the scan, s, rising; else scans follow at the configuration's rate.

        Raises:
            BoresightError: shapes that do not fit, values that are not finite, a time that runs back; the tracks are then unchanged.
        """
        if detections is not None:
            if is_supervision(detections):
                return self.update_supervision(detections, time_s=time_s)
            if not (isinstance(detections, np.ndarray) and detections.ndim == 2 and detections.shape[1] == 2):
                given = {"covariances": covariances, "scores": scores, "classes": classes}
                given = {k: v for k, v in given.items() if v is not None}
                found = parts(detections)
                if boxes is not None:
                    found["boxes"] = boxes
                std = {"std_px": std_px, "std_per_side": std_per_side}
                return self.update_native(**{**std, **found, **given}, time_s=time_s)
        return self.update_native(detections, boxes, covariances, scores, classes, std_px, std_per_side, time_s)

    def update_supervision(self, detections: Any, *, time_s: float | None = None) -> Any:
        """`supervision.Detections` in and out, in the same order.

        `tracker_id` is the id of the confirmed track that took the detection, -1 for none. `data` gains `position`, `velocity` and
        `covariance` (of the position, px²; NaN for none); a `covariance` that came in with the detections is taken as theirs.
        """
        states = self.update_native(**of_supervision(detections), time_s=time_s)
        places = states.tracks_of_detections()
        taken = places >= 0
        out = copy.copy(detections)
        n = len(places)
        ids = np.full(n, -1, dtype=int)
        position, velocity, covariance = np.full((n, 2), np.nan), np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
        if taken.any():
            at = places[taken]
            ids[taken] = states.ids[at]
            # Back to corners that begin at 0 in the first pixel, as the boxes came in.
            position[taken] = states.positions[at] + 0.5
            velocity[taken] = states.velocities[at]
            covariance[taken] = states.covariances[at]
        out.tracker_id = ids
        out.data = {**(detections.data or {}), "position": position, "velocity": velocity, "covariance": covariance}
        return out
