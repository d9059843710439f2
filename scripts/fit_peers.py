"""Positions of the same spots by trackpy, Picasso and SciPy, for `cargo xtask limit positions --python`.

Arguments: folder with frames.npy and truth.csv (frame, x, y), name of the case, read variance, gain, offset, sigma, bound (px an axis).
Prints rows of Markdown: case, method, rms px an axis, of the bound, bias px, found, fits a second.
Needs numpy, scipy, trackpy and picassosr; what is missing is left out. One thread.
"""

import csv
import os
import sys
import time
import warnings

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")
warnings.filterwarnings("ignore")
import numpy as np

folder, case = sys.argv[1], sys.argv[2]
read, gain, offset, sigma, bound = map(float, sys.argv[3:8])
frames = np.load(os.path.join(folder, "frames.npy"))
with open(os.path.join(folder, "truth.csv")) as file:
    truth = np.array([[float(v) for v in row] for row in csv.reader(file)])


def report(name, found, seconds, tried=None):
    """`found`: a position (x, y) or NaN for each row of the truth."""
    tried = len(truth) if tried is None else tried
    e = found[:tried] - truth[:tried, 1:]
    ok = np.isfinite(e).all(axis=1) & (np.hypot(*e.T) < 2)
    rms = np.sqrt(0.5 * (e[ok] ** 2).sum(axis=1).mean())
    quarter = ((truth[:tried, 1] + 0.5) % 1 * 4).astype(int) % 4
    bias = max(abs(e[ok & (quarter == q), 0].mean()) for q in range(4))
    print(f"| {case} | {name} | {rms:.4f} | {rms / bound:.3f} | {bias:.4f} | {100 * ok.mean():.1f} % | {tried / seconds:.2e} |")


def nearest(table):
    """The nearest row (x, y) of each frame's table to each true place."""
    found = np.full((len(truth), 2), np.nan)
    for k in range(len(frames)):
        rows = np.flatnonzero(truth[:, 0] == k)
        xy = table[table["frame"] == k][["x", "y"]].to_numpy()
        if len(xy):
            d = np.linalg.norm(truth[rows, None, 1:] - xy[None], axis=2)
            found[rows] = xy[d.argmin(axis=1)]
    return found


def cut(size=9):
    half, spots, corners = size // 2, [], []
    for k, x, y in truth:
        cx, cy = int(round(x)), int(round(y))
        spots.append(frames[int(k), cy - half : cy + half + 1, cx - half : cx + half + 1])
        corners.append((cx - half, cy - half))
    return np.array(spots, dtype=np.float32), np.array(corners, dtype=float)


def with_trackpy():
    import pandas as pd
    import trackpy as tp

    tp.quiet()
    # The first call compiles.
    tp.locate(frames[0], 9, minmass=0, separation=9, percentile=50, engine="numba")
    start = time.perf_counter()
    tables = [tp.locate(f, 9, minmass=0, separation=9, percentile=50, engine="numba").assign(frame=k) for k, f in enumerate(frames)]
    seconds = time.perf_counter() - start
    table = pd.concat(tables, ignore_index=True)
    report("trackpy `locate`, with finding", nearest(table), seconds)
    few = 200
    guess = pd.DataFrame({"frame": truth[:few, 0].astype(int), "x": np.round(truth[:few, 1]), "y": np.round(truth[:few, 2])})
    guess["signal"], guess["size"], guess["background"] = float(frames.max() - np.median(frames)), sigma, float(np.median(frames))
    start = time.perf_counter()
    fine = tp.refine_leastsq(guess[guess.frame == 0], frames[0], diameter=9, fit_function="gauss", param_mode={"background": "var", "size": "var"})
    seconds = time.perf_counter() - start
    found = np.full((len(truth), 2), np.nan)
    found[fine.index.to_numpy()] = fine[["x", "y"]].to_numpy()
    report("trackpy `refine_leastsq`", found, seconds, len(fine))


def with_picasso():
    from picasso import gaussmle

    spots, corners = cut()
    photons = ((spots - offset) / gain if gain > 0 else spots / read).astype(np.float32)
    gaussmle.gaussmle(photons[:20], 1e-3, 100, method="sigma")
    start = time.perf_counter()
    theta = gaussmle.gaussmle(photons, 1e-3, 100, method="sigma")[0]
    report("Picasso `gaussmle`", theta[:, :2] + corners, time.perf_counter() - start)


def with_scipy(few=400):
    from scipy.optimize import least_squares
    from scipy.special import erf

    spots, corners = cut()
    i = np.arange(9)

    def share(c, s):
        return 0.5 * (erf((i + 0.5 - c) / (s * 2**0.5)) - erf((i - 0.5 - c) / (s * 2**0.5)))

    found = np.full((len(truth), 2), np.nan)
    start = time.perf_counter()
    for k in range(few):
        d = spots[k].astype(float)
        sd = np.sqrt(read + gain * np.maximum(d - offset, gain)) if gain > 0 else read**0.5

        def residual(p):
            return ((p[4] + p[2] * np.outer(share(p[1], p[3]), share(p[0], p[3])) - d) / sd).ravel()

        ground = np.median(d)
        fit = least_squares(residual, [4, 4, (d - ground).sum(), sigma, ground], method="lm")
        found[k] = fit.x[:2]
    report("SciPy `least_squares`, weights from the values", found + corners, time.perf_counter() - start, few)


for run in (with_trackpy, with_picasso, with_scipy):
    try:
        run()
    except ImportError as why:
        print(f"{run.__name__} was left out: {why}", file=sys.stderr)
