"""filterpy's Kalman filter and boresight's on the same measurements; prints the table of docs/from-filterpy.md. Needs filterpy.

python crates/boresight-py/examples/beside_filterpy.py
"""

from __future__ import annotations

import time

import numpy as np
from filterpy.kalman import KalmanFilter

import boresight as bs

N, DT, Q, R = 5000, 0.04, 2.0, 0.25


def theirs(zs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    f = KalmanFilter(dim_x=4, dim_z=2)
    f.F = np.kron(np.eye(2), [[1, DT], [0, 1]])
    f.H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    f.Q = np.kron(np.eye(2), Q * np.array([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]]))
    f.R, f.P, f.x = R * np.eye(2), 100 * np.eye(4), np.zeros((4, 1))
    for z in zs:
        f.predict()
        f.update(z)
    return f.x.ravel(), f.P


def ours(form: type, zs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    f = form(bs.models.ConstantVelocity(q=Q), np.zeros(4), 100.0)
    r = R * np.eye(2)
    for z in zs:
        f.predict(DT)
        f.correct(z, r)
    return f.x, f.P


def batch(zs: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and covariance of the first of 10 000 alike, and the time of each, µs."""
    f = bs.filters.Batch(bs.models.ConstantVelocity(q=Q), np.zeros((10_000, 4)), 100.0)
    many = [np.repeat(z[None], 10_000, axis=0) for z in zs[:100]]
    began = time.perf_counter()
    for z in many:
        f.step(DT, z, R)
    return f.x[0], f.P[0], 1e6 * (time.perf_counter() - began) / len(many) / 10_000


def main() -> None:
    zs = np.cumsum(np.random.default_rng(6).normal(0, 0.3, (N, 2)), axis=0)
    print("| | time of predict and correct | farthest from filterpy, state | covariance |\n| --- | --- | --- | --- |")
    x, p = theirs(zs[:10])
    began = time.perf_counter()
    x, p = theirs(zs)
    print(f"| `filterpy.kalman.KalmanFilter` | {1e6 * (time.perf_counter() - began) / N:.1f} µs | | |")
    for form in (bs.filters.Kf, bs.filters.Ud, bs.filters.Srif):
        began = time.perf_counter()
        mine, cov = ours(form, zs)
        spent = 1e6 * (time.perf_counter() - began) / N
        print(f"| `bs.filters.{form.__name__}` | {spent:.1f} µs | {abs(mine - x).max():.0e} | {abs(cov - p).max():.0e} |")
    (x, p), (mine, cov, each_us) = theirs(zs[:100]), batch(zs)
    print(f"| `bs.filters.Batch`, of 10 000, each | {each_us:.4f} µs | {abs(mine - x).max():.0e} | {abs(cov - p).max():.0e} |")


if __name__ == "__main__":
    main()
