"""SORT as its paper describes it (Bewley et al., 2016), on filterpy's Kalman filter and scipy's assignment: what ours is timed beside."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter
from scipy.optimize import linear_sum_assignment


def state_of(box: np.ndarray) -> np.ndarray:
    """Centre, area, aspect of a box left, top, right, bottom."""
    w, h = box[2] - box[0], box[3] - box[1]
    return np.array([box[0] + w / 2, box[1] + h / 2, w * h, w / h])


def box_of(x: np.ndarray) -> np.ndarray:
    cx, cy, area, aspect = x[:4].ravel()
    w = np.sqrt(max(area * aspect, 1e-9))
    h = area / w
    return np.array([cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2])


def overlaps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Intersection over union of every box of `a` with every one of `b`."""
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    inside = np.clip(high - low, 0, None).prod(axis=2)
    area_a, area_b = ((c[:, 2:] - c[:, :2]).prod(axis=1) for c in (a, b))
    return inside / (area_a[:, None] + area_b[None, :] - inside)


class Track:
    n = 0

    def __init__(self, box: np.ndarray) -> None:
        f = self.filter = KalmanFilter(dim_x=7, dim_z=4)
        f.F, f.H = np.eye(7), np.eye(4, 7)
        f.F[0, 4] = f.F[1, 5] = f.F[2, 6] = 1
        f.R[2:, 2:] *= 10
        f.P[4:, 4:] *= 1000
        f.P *= 10
        f.Q[-1, -1] *= 0.01
        f.Q[4:, 4:] *= 0.01
        f.x[:4, 0] = state_of(box)
        self.missed = self.hits = 0
        Track.n += 1
        self.id = Track.n


class Sort:
    def __init__(self, max_age: int = 1, min_hits: int = 3, min_overlap: float = 0.3) -> None:
        self.max_age, self.min_hits, self.min_overlap = max_age, min_hits, min_overlap
        self.tracks: list[Track] = []
        self.n_scans = 0

    def update(self, boxes: np.ndarray) -> np.ndarray:
        """Rows of left, top, right, bottom, id."""
        self.n_scans += 1
        for t in self.tracks:
            t.filter.predict()
            t.missed += 1
        free = set(range(len(boxes)))
        if self.tracks and len(boxes):
            table = overlaps(np.array([box_of(t.filter.x) for t in self.tracks]), boxes)
            for i, j in zip(*linear_sum_assignment(-table), strict=True):
                if table[i, j] >= self.min_overlap:
                    t = self.tracks[i]
                    t.filter.update(state_of(boxes[j]))
                    t.missed, t.hits = 0, t.hits + 1
                    free.discard(int(j))
        self.tracks += [Track(boxes[j]) for j in sorted(free)]
        self.tracks = [t for t in self.tracks if t.missed <= self.max_age]
        shown = [t for t in self.tracks if t.missed == 0 and (t.hits >= self.min_hits or self.n_scans <= self.min_hits)]
        return np.array([[*box_of(t.filter.x), t.id] for t in shown]).reshape(-1, 5)
