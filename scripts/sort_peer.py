"""SORT (PyPI `sort-tracker-py`, max_age 1, min_hits 3, IoU 0.3, as its authors run it) on MOTChallenge detections.

    python scripts/sort_peer.py DET.txt OUT.txt [LEAST_SCORE]

Writes MOTChallenge text for `cargo run --release -p xtask -- mot-table --sort DIR`. Detections below LEAST_SCORE are left out
(SORT itself looks at no scores).
"""
import sys

import numpy as np
from sort_tracker.sort import Sort

det = np.loadtxt(sys.argv[1], delimiter=",", ndmin=2)
least = float(sys.argv[3]) if len(sys.argv) > 3 else -np.inf
det = det[det[:, 6] >= least]
tracker = Sort(max_age=1, min_hits=3, iou_threshold=0.3)
with open(sys.argv[2], "w") as out:
    for frame in range(1, int(det[:, 0].max()) + 1):
        d = det[det[:, 0] == frame]
        boxes = np.column_stack([d[:, 2], d[:, 3], d[:, 2] + d[:, 4], d[:, 3] + d[:, 5], d[:, 6]])
        for r in np.asarray(tracker.update(boxes if len(boxes) else np.empty((0, 5)))):
            print(f"{frame},{int(r[-1])},{r[0]:.2f},{r[1]:.2f},{r[2] - r[0]:.2f},{r[3] - r[1]:.2f},1,-1,-1,-1", file=out)
