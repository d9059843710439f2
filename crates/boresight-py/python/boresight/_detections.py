"""Detections in the forms that detectors have: arrays, dictionaries of arrays, `supervision.Detections`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ._errors import BoresightError
from ._frames import as_array

_NAMES = frozenset({"positions", "covariances", "boxes", "scores", "classes", "std_px", "std_per_side"})


def is_supervision(value: Any) -> bool:
    """Whether it looks like `supervision.Detections`; supervision itself is not needed."""
    return hasattr(value, "xyxy") and hasattr(value, "tracker_id")


def parts(found: Any) -> dict[str, Any]:
    """The arrays in what a detector returned; the keys are those of `Tracker.update`.

    An array N x 2 holds positions, N x 4 boxes as corners, N x 5 boxes and scores, N x 6 boxes, scores and classes.
    """
    if found is None:
        return {"positions": np.empty((0, 2))}
    if is_supervision(found):
        return of_supervision(found)
    if isinstance(found, Mapping):
        unknown = set(found) - _NAMES
        if unknown:
            raise BoresightError(
                f"unknown keys: {', '.join(sorted(map(str, unknown)))}",
                where="detections",
                hint=f"keys: {', '.join(sorted(_NAMES))}",
            )
        return {k: v for k, v in found.items() if v is not None}
    a = as_array(found)
    if a.size == 0:
        return {"positions": np.empty((0, 2))}
    if a.ndim == 2 and a.shape[1] == 2:
        return {"positions": a}
    if a.ndim == 2 and 4 <= a.shape[1] <= 6:
        out: dict[str, Any] = {"boxes": a[:, :4]}
        if a.shape[1] > 4:
            out["scores"] = a[:, 4]
        if a.shape[1] > 5:
            out["classes"] = a[:, 5]
        return out
    raise BoresightError(
        f"an array of shape {a.shape}",
        where="detections",
        hint="N x 2 positions, N x 4 boxes (left, top, right, bottom), N x 5 with scores, N x 6 with classes; or a dictionary",
    )


def of_supervision(found: Any) -> dict[str, Any]:
    """The arrays of `supervision.Detections`; covariances are taken from its `data["covariance"]`, if they are there."""
    out: dict[str, Any] = {"boxes": found.xyxy}
    if found.confidence is not None:
        out["scores"] = found.confidence
    if found.class_id is not None:
        out["classes"] = found.class_id
    covariance = (getattr(found, "data", None) or {}).get("covariance")
    if covariance is not None:
        out["covariances"] = covariance
    return out
