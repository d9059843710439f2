"""Times of the Python interface, each beside what it is compared with; one run, one thread. Prints a table in Markdown.

    python crates/boresight-py/examples/speed.py [--command target/release/boresight]

supervision, and filterpy with scipy, are compared with where they are installed. Seeds are fixed.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import boresight as bs
from boresight import _boresight
from boresight._track import request

N_BOXES, N_SCANS, DT_S = 100, 300, 0.04


def median_of(f: Callable[[], object], times: int = 5) -> float:
    """The median time of a call, s."""
    spent = []
    for _ in range(times):
        began = time.perf_counter()
        f()
        spent.append(time.perf_counter() - began)
    return statistics.median(spent)


def scans(seed: int = 7) -> list[np.ndarray]:
    """Boxes of 100 things that drift over 4000 x 4000 px, with noise of 1 px; each scan N x 4."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(10), np.arange(10)), axis=-1).reshape(-1, 2) * 400.0 + 100
    velocity, size = rng.normal(0, 40, (N_BOXES, 2)), rng.uniform(20, 60, (N_BOXES, 2))
    out = []
    for k in range(N_SCANS):
        centre = grid + velocity * k * DT_S + rng.normal(0, 1, (N_BOXES, 2))
        out.append(np.concatenate([centre - size / 2, centre + size / 2], axis=1))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--command", type=Path)
    args = parser.parse_args()
    rows: list[tuple[str, str]] = []
    updates(rows)
    pandas_rows(rows)
    batch(rows)
    arrays_against_command(rows, args.command)
    print("| what | time |\n| --- | --- |")
    for what, value in rows:
        print(f"| {what} | {value} |")


def updates(rows: list[tuple[str, str]]) -> None:
    data = scans()
    config = bs.Config.preset("detections-mot", tracker__two_stage={"high_score": 0.5, "low_score": 0.0})
    per_scan = 1e6 / N_SCANS
    scores = np.full(N_BOXES, 0.9, np.float32)

    def ours() -> None:
        tracker = bs.Tracker(config)
        for k, boxes in enumerate(data):
            tracker.update(boxes=boxes, scores=scores, time_s=k * DT_S)

    def ours_with_ids() -> None:
        tracker = bs.Tracker(config)
        for k, boxes in enumerate(data):
            states = tracker.update(boxes=boxes, scores=scores, time_s=k * DT_S)
            _ = states.ids, states.positions, states.covariances

    # In turns, so that what else the machine does weighs on both.
    pairs = [(_boresight.time_of_updates(config._native, data, DT_S), median_of(ours, 1)) for _ in range(41)]
    rust, mine = (statistics.median(p[k] for p in pairs) for k in (0, 1))
    ratio = statistics.median(m / r for r, m in pairs)
    rows.append(("the library's own step, 100 boxes", f"{rust * per_scan:.1f} µs"))
    rows.append(("`Tracker.update`, 100 boxes", f"{mine * per_scan:.1f} µs, {ratio:.2f} times"))
    rows.append(("the same, ids, positions and covariances taken", f"{median_of(ours_with_ids) * per_scan:.1f} µs"))
    try:
        import supervision as sv

        sv.ByteTrack  # noqa: B018
    except (ImportError, AttributeError):
        print("no supervision with ByteTrack is installed (0.26 has it): left out", file=sys.stderr)
    else:
        import warnings

        warnings.simplefilter("ignore")
        found = [sv.Detections(xyxy=b.astype(np.float32), confidence=scores, class_id=np.zeros(N_BOXES, int)) for b in data]

        def theirs() -> None:
            tracker = sv.ByteTrack(frame_rate=25)
            for detections in found:
                tracker.update_with_detections(detections)

        def through() -> None:
            tracker = bs.Tracker(config)
            for k, detections in enumerate(found):
                tracker.update(detections, time_s=k * DT_S)

        other, same = median_of(theirs, 3), median_of(through)
        rows.append(("`sv.ByteTrack.update_with_detections`", f"{other * per_scan:.0f} µs, {other / mine:.0f} times ours"))
        rows.append(("`Tracker.update` of `sv.Detections`", f"{same * per_scan:.1f} µs, {other / same:.0f} times faster"))
    try:
        from sort_filterpy import Sort
    except ImportError:
        print("filterpy or scipy is not installed: left out", file=sys.stderr)
    else:

        def sort() -> None:
            tracker = Sort()
            for boxes in data[:60]:
                tracker.update(boxes)

        other = median_of(sort, 3) * N_SCANS / 60
        rows.append(("SORT on filterpy and scipy", f"{other * per_scan:.0f} µs, {other / mine:.0f} times ours"))


def pandas_rows(rows: list[tuple[str, str]]) -> None:
    n_tracks, n_frames = 1000, 1000
    grid = np.stack(np.meshgrid(np.arange(40), np.arange(25)), axis=-1).reshape(-1, 2) * 100.0
    frame = np.repeat(np.arange(n_frames), n_tracks)
    still = np.tile(grid, (n_frames, 1)) + np.random.default_rng(3).normal(0, 0.1, (n_tracks * n_frames, 2))
    cov, size = np.tile([0.01, 0.0, 0.01], (len(frame), 1)), np.zeros((len(frame), 2))
    asked = request(None, {"tracker__max_speed_px_per_s": 100.0}, rate_hz=25.0)
    tracks = bs.Tracks(_boresight.track_columns(frame, still, cov, size, asked))
    assert 990_000 <= len(tracks) <= 1_010_000, len(tracks)
    rows.append(("10⁶ rows to pandas", f"{1e3 * median_of(tracks.to_pandas):.0f} ms"))
    rows.append(("10⁶ rows to polars", f"{1e3 * median_of(tracks.to_polars):.0f} ms"))


def batch(rows: list[tuple[str, str]]) -> None:
    n, q, dt, r = 10_000, 2.0, DT_S, 1.0
    rng = np.random.default_rng(1)
    z = rng.normal(0, 1, (n, 2))
    ours = bs.filters.Batch(bs.models.ConstantVelocity(q=q), np.zeros((n, 4)), 100.0)

    def mine() -> None:
        for _ in range(20):
            ours.step(dt, z, r)

    x, v = np.zeros((2, n)), np.zeros((2, n))
    p00, p01, p11 = np.full((2, n), 100.0), np.zeros((2, n)), np.full((2, n), 100.0)
    zt = np.ascontiguousarray(z.T)

    def soa() -> None:
        for _ in range(20):
            x[...] += dt * v
            moved = p01 + dt * p11
            a = p00 + dt * (p01 + moved) + q * dt**3 / 3
            b = moved + q * dt**2 / 2
            c = p11 + q * dt
            s = 1.0 / (a + r)
            k0, k1, nu = a * s, b * s, zt - x
            x[...] += k0 * nu
            v[...] += k1 * nu
            p00[...], p01[...], p11[...] = a * (1 - k0), b * (1 - k0), c - k1 * b

    a, b = median_of(mine) / 20, median_of(soa) / 20
    assert np.allclose(ours.x[:, 0], x[0]) and np.allclose(ours.P[:, 1, 1], v[0] * 0 + p11[0])
    rows.append(("`filters.Batch.step` of 10 000 tracks", f"{1e6 * a:.0f} µs"))
    rows.append(("the same in NumPy, arrays of states", f"{1e6 * b:.0f} µs, {b / a:.1f} times ours"))


def arrays_against_command(rows: list[tuple[str, str]], command: Path | None) -> None:
    if command is None:
        print("no --command: the comparison with the command is left out", file=sys.stderr)
        return
    frames = np.random.default_rng(2).normal(100, 5, (200, 512, 640)).clip(0, 255).astype(np.uint8)
    for k, image in enumerate(frames):
        image[100:104, 50 + 2 * k : 54 + 2 * k] = 220
    config = bs.Config.auto(frames[:60], rate_hz=25.0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "c.toml").write_text(config.to_toml())
        with open(path / "f.y4m", "wb") as f:
            f.write(b"YUV4MPEG2 W640 H512 F25:1 Cmono\n")
            for image in frames:
                f.write(b"FRAME\n" + image.tobytes())
        line = [command, "track", path / "f.y4m", "--config", path / "c.toml", "-o", path / "o", "--no-video", "--quiet"]
        turns = []
        for _ in range(5):
            theirs = median_of(lambda: subprocess.run([str(w) for w in line], check=True), 1)
            turns.append((theirs, median_of(lambda: bs.track(frames, rate_hz=25.0, config=config, progress=False), 1)))
    theirs, mine = (statistics.median(t[k] for t in turns) for k in (0, 1))
    rows.append(("`boresight track` of 200 frames 640 x 512, no video", f"{1e3 * theirs:.0f} ms"))
    rows.append(("`bs.track` of the same arrays", f"{1e3 * mine:.0f} ms, {mine / theirs:.2f} times"))


if __name__ == "__main__":
    main()
