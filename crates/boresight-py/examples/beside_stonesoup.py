"""Stone Soup and boresight on the same simulated detections in clutter; prints the table of docs/from-stonesoup.md. Needs stonesoup.

python crates/boresight-py/examples/beside_stonesoup.py
"""

from __future__ import annotations

import datetime
import time
import warnings

import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.functions import gm_reduce_single
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.array import CovarianceMatrix, StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

import boresight as bs

N_SCANS, N_TARGETS, RATE_HZ = 200, 12, 10.0
WIDTH, HEIGHT = 640.0, 512.0
Q, R, P_D, N_CLUTTER, SPEED = 4.0, 1.0, 0.9, 10, 12.0
START = datetime.datetime(2026, 1, 1)


def scene(seed: int) -> tuple[list[np.ndarray], dict[str, np.ndarray]]:
    """Targets with white acceleration (q = 4 px²/s³): positions with noise of 1 px, one in ten missed, ten false ones a scan; N x 2."""
    rng, dt = np.random.default_rng(seed), 1 / RATE_HZ
    at, velocity = rng.uniform([150, 120], [490, 390], (N_TARGETS, 2)), rng.normal(0, SPEED, (N_TARGETS, 2))
    noise = np.linalg.cholesky(Q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
    scans, rows = [], []
    for k in range(N_SCANS):
        step = rng.normal(0, 1, (N_TARGETS, 2, 2)) @ noise.T
        at, velocity = at + velocity * dt + step[:, :, 0], velocity + step[:, :, 1]
        rows += [(k, i, *at[i]) for i in range(N_TARGETS)]
        seen = at[rng.random(N_TARGETS) < P_D]
        clutter = rng.uniform(0, [WIDTH, HEIGHT], (rng.poisson(N_CLUTTER), 2))
        scans.append(np.concatenate([seen + rng.normal(0, np.sqrt(R), seen.shape), clutter]))
    return scans, dict(zip(["frame", "track_id", "x", "y"], np.array(rows).T, strict=True))


def table(rows: list[tuple[int, int, float, float]]) -> dict[str, np.ndarray]:
    return dict(zip(["frame", "track_id", "x", "y"], np.array(rows).T.reshape(4, -1), strict=True))


def stonesoup(scans: list[np.ndarray], joint: bool) -> dict[str, np.ndarray]:
    """Parts as in its tutorials: Kalman filter, nearest neighbours or JPDA, tracks from five detections, deleted after ten misses."""
    model = CombinedLinearGaussianTransitionModel([ConstantVelocity(Q), ConstantVelocity(Q)])
    sensor = LinearGaussian(4, (0, 2), CovarianceMatrix(R * np.eye(2)))
    predictor, updater = KalmanPredictor(model), KalmanUpdater(sensor)
    near = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=4)
    if joint:
        density = N_CLUTTER / (WIDTH * HEIGHT)
        associator = JPDA(PDAHypothesiser(predictor, updater, density, prob_detect=P_D, prob_gate=0.9999))
    else:
        associator = GNNWith2DAssignment(near)
    prior = GaussianState(StateVector([0, 0, 0, 0]), np.diag([0, 4 * SPEED**2, 0, 4 * SPEED**2]))
    deleter = UpdateTimeStepsDeleter(10)
    initiator = MultiMeasurementInitiator(prior, UpdateTimeStepsDeleter(2), GNNWith2DAssignment(near), updater, sensor, min_points=5)
    tracks, numbers, rows = set(), {}, []
    for k, scan in enumerate(scans):
        now = START + datetime.timedelta(seconds=k / RATE_HZ)
        found = {Detection(StateVector(z), timestamp=now, measurement_model=sensor) for z in scan}
        taken = set()
        for track, hypotheses in associator.associate(tracks, found, now).items():
            if joint:
                posteriors, weights = [], []
                for h in hypotheses:
                    posteriors.append(updater.update(h) if h else h.prediction)
                    weights.append(h.probability)
                    if h and h.probability > 0.5:
                        taken.add(h.measurement)
                mean, cov = gm_reduce_single(
                    StateVectors([p.state_vector for p in posteriors]),
                    np.stack([p.covar for p in posteriors], axis=2),
                    np.asarray(weights),
                )
                if any(h and h.probability > 0.1 for h in hypotheses):
                    track.append(GaussianStateUpdate(mean, cov, hypotheses, now))
                else:
                    track.append(max(hypotheses, key=lambda h: h.probability).prediction)
            elif hypotheses:
                track.append(updater.update(hypotheses))
                taken.add(hypotheses.measurement)
            else:
                track.append(hypotheses.prediction)
        tracks -= deleter.delete_tracks(tracks)
        tracks |= initiator.initiate(found - taken, now)
        for track in tracks:
            number = numbers.setdefault(track.id, len(numbers) + 1)
            rows.append((k, number, float(track.state_vector[0]), float(track.state_vector[2])))
    return table(rows)


def ours(scans: list[np.ndarray], config: bs.Config) -> dict[str, np.ndarray]:
    tracker, rows = bs.Tracker(config), []
    for k, scan in enumerate(scans):
        for s in tracker.update(scan, std_px=np.sqrt(R), time_s=k / RATE_HZ).confirmed:
            rows.append((k, s.id, *s.position))
    return table(rows)


def main() -> None:
    warnings.simplefilter("ignore")
    scans, truth = scene(seed=4)
    given = bs.Config(
        associator="global-nearest",
        tracker__acceleration_density_px2_per_s3=Q,
        tracker__max_speed_px_per_s=4 * SPEED,
        tracker__detection_probability=P_D,
        tracker__clutter_density_per_px2=N_CLUTTER / (WIDTH * HEIGHT),
        tracker__coast_s=1.0,
    )
    learnt = bs.Config.for_detections([{"positions": z, "std_px": np.sqrt(R)} for z in scene(seed=5)[0]], rate_hz=RATE_HZ)
    runs = {
        "Stone Soup, global nearest neighbour": lambda: stonesoup(scans, joint=False),
        "Stone Soup, JPDA": lambda: stonesoup(scans, joint=True),
        "boresight, the same numbers, global nearest neighbour": lambda: ours(scans, given),
        "boresight, the same numbers, JPDA": lambda: ours(scans, given.set(associator="jpda")),
        "boresight, learnt from another run": lambda: ours(scans, learnt),
    }
    print(f"| | time a scan | MOTA | IDF1 | switches | ids for {N_TARGETS} targets | error, px |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, run in runs.items():
        began = time.perf_counter()
        result = run()
        spent_us = 1e6 * (time.perf_counter() - began) / N_SCANS
        s = bs.evaluate(truth, result, distance_px=5)
        n = len(np.unique(result["track_id"]))
        print(f"| {name} | {spent_us:.0f} µs | {s['MOTA']:.3f} | {s['IDF1']:.3f} | {s['IDSW']:.0f} | {n} | {s['RMSE']:.2f} |")


if __name__ == "__main__":
    main()
