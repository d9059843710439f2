"""SORT on filterpy, ByteTrack of supervision and boresight on the same simulated boxes; prints the table of docs/from-sort.md.

Needs filterpy and scipy; ByteTrack is left out where supervision does not have it (0.26 has it).

python crates/boresight-py/examples/beside_sort.py              people turn round within a second
python crates/boresight-py/examples/beside_sort.py --bounce     they bounce off the edges at once, which constant velocity does not hold
python crates/boresight-py/examples/beside_sort.py --seed 6     another scene (4 if absent); learnt is from that of the next seed
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
from sort_filterpy import Sort

import boresight as bs

N_SCANS, N_PEOPLE, RATE_HZ = 500, 25, 25.0


def scene(seed: int = 4, bounce: bool = False) -> tuple[list[np.ndarray], dict[str, np.ndarray]]:
    """People who walk through 1280 x 720 px: boxes with noise, one in ten is missed, one false box a scan; N x 5 with scores."""
    rng = np.random.default_rng(seed)
    at, height = rng.uniform([0, 150], [1280, 600], (N_PEOPLE, 2)), rng.uniform(80, 200, N_PEOPLE)
    velocity = rng.normal(0, [60, 15], (N_PEOPLE, 2))
    scans, rows = [], []
    for k in range(N_SCANS):
        velocity += rng.normal(0, 4, velocity.shape)
        if bounce:
            velocity = np.where(at < [0, 150], np.abs(velocity), np.where(at > [1280, 600], -np.abs(velocity), velocity))
        else:
            # Who comes near an edge turns round within a second.
            velocity += 150 / RATE_HZ * ((at < [100, 200]).astype(float) - (at > [1180, 560]))
        at += velocity / RATE_HZ
        half = np.stack([0.2 * height, 0.5 * height], axis=1)
        rows += [(k, i, *at[i], *(2 * half[i])) for i in range(N_PEOPLE)]
        seen = rng.random(N_PEOPLE) > 0.1
        centre = at[seen] + rng.normal(0, 0.02, (seen.sum(), 2)) * height[seen, None]
        half = half[seen] * rng.normal(1, 0.03, (seen.sum(), 1))
        boxes = np.concatenate([centre - half, centre + half, rng.uniform(0.6, 1.0, (seen.sum(), 1))], axis=1)
        false = rng.uniform([0, 150], [1280, 600], (1, 2))
        low = np.hstack([np.subtract(false, (20, 50)), np.add(false, (20, 50)), rng.uniform(0.3, 0.7, (1, 1))])
        scans.append(np.concatenate([boxes, low]))
    names = ["frame", "track_id", "x", "y", "width", "height"]
    columns = dict(zip(names, np.array(rows).T, strict=True))
    # The truth in the pixels of the results: corners begin at 0 in the first pixel, positions at its centre.
    columns["x"], columns["y"] = columns["x"] - 0.5, columns["y"] - 0.5
    return scans, columns


def table(rows: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of frame, id, left, top, right, bottom as columns."""
    a = np.concatenate(rows)
    w, h = a[:, 4] - a[:, 2], a[:, 5] - a[:, 3]
    return {
        "frame": a[:, 0],
        "track_id": a[:, 1],
        "x": a[:, 2] + w / 2 - 0.5,
        "y": a[:, 3] + h / 2 - 0.5,
        "width": w,
        "height": h,
    }


def with_frame(k: int, ids: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    return np.concatenate([np.full((len(ids), 1), k), ids.reshape(-1, 1), boxes], axis=1)


def sort(scans: list[np.ndarray]) -> dict[str, np.ndarray]:
    tracker, rows = Sort(max_age=10), []
    for k, boxes in enumerate(scans):
        found = tracker.update(boxes[:, :4])
        rows.append(with_frame(k, found[:, 4], found[:, :4]))
    return table(rows)


def bytetrack(scans: list[np.ndarray]) -> dict[str, np.ndarray]:
    import supervision as sv

    tracker, rows = sv.ByteTrack(frame_rate=int(RATE_HZ)), []
    for k, b in enumerate(scans):
        found = sv.Detections(b[:, :4].astype(np.float32), confidence=b[:, 4].astype(np.float32), class_id=np.zeros(len(b), int))
        out = tracker.update_with_detections(found)
        rows.append(with_frame(k, out.tracker_id, out.xyxy))
    return table(rows)


def ours(scans: list[np.ndarray], config: bs.Config) -> dict[str, np.ndarray]:
    tracker, rows = bs.Tracker(config), []
    for k, b in enumerate(scans):
        states = tracker.update(b, time_s=k / RATE_HZ)
        shown = np.array([s == "confirmed" for s in states.statuses], bool)
        rows.append(with_frame(k, states.ids[shown], states.boxes[shown]))
    return table(rows)


def main() -> None:
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bounce", action="store_true")
    parser.add_argument("--seed", type=int, default=4)
    args = parser.parse_args()
    scans, truth = scene(args.seed, args.bounce)
    print("| | time a scan | MOTA | IDF1 | switches | ids for 25 people |\n| --- | --- | --- | --- | --- | --- |")
    # Learnt from other people than those that are tracked.
    config = bs.Config.for_detections(scene(args.seed + 1, args.bounce)[0], rate_hz=RATE_HZ)
    runs = {
        "SORT on filterpy": sort,
        "supervision's ByteTrack": bytetrack,
        "boresight, learnt from another run": lambda s: ours(s, config),
        'boresight, learnt, then `filter="imm"`': lambda s: ours(s, config.set(filter="imm")),
        "boresight, preset `detections-mot`": lambda s: ours(s, bs.Config.preset("detections-mot")),
    }
    for name, run in runs.items():
        began = time.perf_counter()
        try:
            result = run(scans)
        except (ImportError, AttributeError) as e:
            print(f"| {name} | left out: {e} | | | | |")
            continue
        spent_us = 1e6 * (time.perf_counter() - began) / N_SCANS
        s = bs.evaluate(truth, result)
        n = len(np.unique(result["track_id"]))
        print(f"| {name} | {spent_us:.0f} µs | {s['MOTA']:.3f} | {s['IDF1']:.3f} | {s['IDSW']:.0f} | {n} |")


if __name__ == "__main__":
    main()
