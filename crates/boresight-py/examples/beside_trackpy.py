"""trackpy and boresight on the same simulated particles; prints the table of docs/from-trackpy.md. Needs trackpy.

python crates/boresight-py/examples/beside_trackpy.py
"""

from __future__ import annotations

import time
import warnings

import numpy as np
import pandas as pd
import trackpy

import boresight as bs

N_FRAMES, N_PARTICLES, SIDE = 100, 150, 512


def scene(seed: int = 11) -> tuple[np.ndarray, pd.DataFrame]:
    """Spots (sigma 1.5 px, 120 counts above 20, noise of 6) that diffuse, 1.0 px a frame and axis, and their truth."""
    rng = np.random.default_rng(seed)
    at = rng.uniform(10, SIDE - 10, (N_PARTICLES, 2))
    frames, rows = [], []
    for k in range(N_FRAMES):
        image = rng.normal(20, 6, (SIDE, SIDE))
        for i, (x, y) in enumerate(at):
            if 3 <= x < SIDE - 3 and 3 <= y < SIDE - 3:
                x0, x1, y0, y1 = int(max(x - 8, 0)), int(min(x + 9, SIDE)), int(max(y - 8, 0)), int(min(y + 9, SIDE))
                yy, xx = np.mgrid[y0:y1, x0:x1]
                image[y0:y1, x0:x1] += 120 * np.exp(-((xx - x) ** 2 + (yy - y) ** 2) / (2 * 1.5**2))
                rows.append((k, i, x, y))
        frames.append(np.clip(image, 0, 255).astype(np.uint8))
        at = at + rng.normal(0, 1.0, at.shape)
    return np.stack(frames), pd.DataFrame(rows, columns=["frame", "particle", "x", "y"])


def main() -> None:
    warnings.simplefilter("ignore")
    trackpy.quiet()
    frames, truth = scene()
    results = {}
    began = time.perf_counter()
    theirs = trackpy.link(trackpy.batch(frames, diameter=9, minmass=300, processes=1), search_range=6, memory=3)
    theirs = trackpy.filter_stubs(theirs, 5)
    results["trackpy: `batch`, `link`, `filter_stubs`"] = (time.perf_counter() - began, theirs)
    began = time.perf_counter()
    ours = bs.link(bs.batch(frames), search_range=6, memory=3)
    ours = ours[ours.groupby("particle")["frame"].transform("size") >= 5]
    results["boresight: `batch`, `link`, nothing chosen"] = (time.perf_counter() - began, ours)
    began = time.perf_counter()
    tracks = bs.track(frames, progress=False)
    results["boresight: `track`"] = (time.perf_counter() - began, tracks)
    print("| | time | MOTA | IDF1 | switches | error, px |\n| --- | --- | --- | --- | --- | --- |")
    for name, (spent_s, table) in results.items():
        s = bs.evaluate(truth, table, distance_px=3)
        print(f"| {name} | {spent_s:.1f} s | {s['MOTA']:.3f} | {s['IDF1']:.3f} | {s['IDSW']:.0f} | {s['RMSE']:.3f} |")


if __name__ == "__main__":
    main()
