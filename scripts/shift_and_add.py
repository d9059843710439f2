"""Shift and add in NumPy: pixel-velocity sums a second, for `cargo xtask limit --python`."""

import time

import numpy as np

print("| frame | frames | dtype | pixel-velocity sums a second |")
print("| --- | --- | --- | --- |")
for (width, height), frames in [((640, 512), 16), ((256, 256), 64)]:
    for dtype in (np.float32, np.int16):
        rng = np.random.default_rng(1)
        cube = (20 * rng.standard_normal((frames, height, width))).astype(dtype)
        best = np.full((height, width), np.iinfo(np.int16).min, dtype)
        n = 40
        start = time.perf_counter()
        for v in range(n):
            vx, vy = 0.05 * (v % 7 - 3), 0.05 * (v // 7 - 3)
            total = np.zeros((height, width), dtype)
            for t in range(frames):
                dx, dy = round(vx * t), round(vy * t)
                y0, y1, x0, x1 = max(0, -dy), height - max(0, dy), max(0, -dx), width - max(0, dx)
                total[y0:y1, x0:x1] += cube[t, y0 + dy : y1 + dy, x0 + dx : x1 + dx]
            np.maximum(best, total, out=best)
        rate = n * width * height / (time.perf_counter() - start)
        print(f"| {width} x {height} | {frames} | {dtype.__name__} | {rate:.2e} |")
