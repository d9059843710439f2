"""Evaluation, simulation, filters, particles."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import boresight as bs


def test_evaluation_takes_paths_tracks_and_frames(drone, clip_truth, tmp_path):
    tracks = drone
    scores = bs.evaluate(clip_truth, tracks, distance_px=10)
    assert scores["MOTA"] > 0.94 and scores["IDF1"] > 0.95 and scores["RMSE"] < 1.3
    tracks.write(tmp_path / "t.csv")
    for other in (tmp_path / "t.csv", tracks.to_pandas(), tracks.to_dict()):
        same = bs.evaluate(clip_truth, other, distance_px=10)
        assert same["MOTA"] == scores["MOTA"] and same["RMSE"] == scores["RMSE"]
    frame = scores.to_pandas()
    assert frame.loc["RMSE", "unit"] == "px" and frame.loc["MOTA", "better"] == "higher" and len(frame) == len(scores)
    assert "MOTA" in repr(scores) and "<table>" in scores._repr_html_()


def test_points_with_the_names_of_trackpy_are_evaluated():
    truth = pd.DataFrame({"frame": [0, 1, 2], "particle": [4, 4, 4], "x": [1.0, 2.0, 3.0], "y": [5.0, 5.0, 5.0]})
    scores = bs.evaluate(truth, truth.assign(x=truth["x"] + 0.5), distance_px=2)
    assert scores["MOTA"] == 1.0 and scores["RMSE"] == pytest.approx(0.5)
    assert len(bs.evaluate(truth, truth, distance_px=2, all_measures=False)) < len(scores)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"frame": [0], "x": [1.0], "y": [1.0]}, "no column 'track_id'"),
        ({"frame": [-1], "id": [0], "x": [1.0], "y": [1.0]}, "frame -1"),
        ({"frame": [0], "id": [0], "x": [np.nan], "y": [1.0]}, "finite"),
        ({"frame": ["a"], "id": [0], "x": [1.0], "y": [1.0]}, "numbers"),
        (7, "a int"),
        ("no_such.csv", "no_such"),
    ],
)
def test_a_table_that_is_none_is_told(table, words):
    with pytest.raises(bs.BoresightError, match=words):
        bs.evaluate(table, table, distance_px=1)


def test_a_scene_is_the_same_for_the_same_seed(ds2):
    again, other = bs.simulate("ds2", seed=1), bs.simulate("ds2", seed=2)
    np.testing.assert_array_equal(ds2.frames, again.frames)
    assert (ds2.frames != other.frames).any()
    assert ds2.frames.shape == (50, 64, 64) and ds2.frames.dtype == np.uint8 and len(ds2.times_s) == 50
    truth = ds2.truth.to_dict()
    assert truth["x_px"][0] == 10.0 and len(truth["frame"]) == 50
    assert "ds2" in bs.scenes() and len(bs.simulate("lms-sines", n_frames=3).frames) == 3
    with pytest.raises(bs.BoresightError) as e:
        bs.simulate("nonsense")
    assert "ds1" in e.value.hint
    with pytest.raises(bs.BoresightError):
        bs.simulate("ds2", seed=-1)


MODELS = [bs.models.ConstantVelocity(q=2.0), bs.models.ConstantAcceleration(q=1.0), bs.models.Singer(std=3.0, tau_s=2.0)]
FORMS = [bs.filters.Kf, bs.filters.Ud, bs.filters.Srif, bs.filters.Information, bs.filters.SquareRoot]


@pytest.mark.parametrize("model", MODELS, ids=lambda m: type(m).__name__)
def test_every_form_gives_the_same_belief(model):
    n = 4 if isinstance(model, bs.models.ConstantVelocity) else 6
    rng = np.random.default_rng(1)
    filters = [form(model, np.zeros(n), 100.0 * np.eye(n)) for form in FORMS]
    for k in range(50):
        z, r = np.array([0.4 * k, 5.0]) + rng.normal(0, 1, 2), np.array([[1.0, 0.3], [0.3, 2.0]])
        for f in filters:
            f.predict(0.04)
            f.correct(z, r)
    for f in filters[1:]:
        np.testing.assert_allclose(f.x, filters[0].x, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(f.P, filters[0].P, rtol=1e-6, atol=1e-8)
    assert filters[0].position.shape == (2,) and filters[0].covariance.shape == (2, 2)
    assert np.isfinite(filters[0].log_likelihood(z, r)) and "Kf" in repr(filters[0])


def kalman_by_numpy(q, dt, zs, r):
    f, h = np.eye(4), np.zeros((2, 4))
    f[0, 1] = f[2, 3] = dt
    h[0, 0] = h[1, 2] = 1
    block = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    noise = np.kron(np.eye(2), block)
    x, p = np.zeros(4), 100 * np.eye(4)
    for z in zs:
        x, p = f @ x, f @ p @ f.T + noise
        s = h @ p @ h.T + r * np.eye(2)
        k = p @ h.T @ np.linalg.inv(s)
        x, p = x + k @ (z - h @ x), (np.eye(4) - k @ h) @ p
    return x, p


def test_a_filter_and_the_batch_agree_with_the_textbook():
    zs = np.random.default_rng(2).normal(0, 1, (40, 2)) + np.arange(40)[:, None]
    x, p = kalman_by_numpy(2.0, 0.1, zs, 0.5)
    kf = bs.filters.Kf(bs.models.ConstantVelocity(q=2.0), np.zeros(4), 100.0)
    batch = bs.filters.Batch(bs.models.ConstantVelocity(q=2.0), np.zeros((11, 4)), 100.0)
    for z in zs:
        kf.predict(0.1)
        kf.correct(z, 0.5)
        assert batch.step(0.1, np.tile(z, (11, 1)), 0.5) == 0
    np.testing.assert_allclose(kf.x, x, rtol=1e-9)
    np.testing.assert_allclose(kf.P, p, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(batch.x, np.tile(x, (11, 1)), rtol=1e-9)
    np.testing.assert_allclose(batch.P[10], p, rtol=1e-9, atol=1e-12)
    assert len(batch) == 11


def test_a_row_of_nan_is_a_missed_scan():
    batch = bs.filters.Batch(bs.models.ConstantVelocity(q=2.0), np.ones((3, 4)), np.eye(4))
    z = np.array([[1.0, 1.0], [np.nan, np.nan], [1.0, 1.0]])
    assert batch.step(1.0, z, [1.0, 2.0]) == 0
    np.testing.assert_allclose(batch.x[1], [2, 1, 2, 1])
    assert batch.P[1, 0, 0] > 2.0 > batch.P[0, 0, 0]


def test_what_a_filter_refuses_is_told():
    model = bs.models.ConstantVelocity(q=2.0)
    for make in (
        lambda: bs.filters.Kf(model, np.zeros(3), np.eye(3)),
        lambda: bs.filters.Kf(model, np.zeros(4), -np.eye(4)),
        lambda: bs.filters.Kf(model, np.full(4, np.nan), np.eye(4)),
        lambda: bs.filters.Kf(bs.models.ConstantVelocity(q=-1.0), np.zeros(4), np.eye(4)),
        lambda: bs.filters.Batch(model, np.zeros((3, 5)), np.eye(4)),
        lambda: bs.filters.Batch(model, np.zeros((3, 4)), np.ones((4, 4)) + np.eye(4)),
        lambda: bs.filters.Batch(model, np.zeros((3, 4)), np.eye(4)).step(0.1, np.zeros((2, 2)), 1.0),
        lambda: bs.filters.Batch(model, np.zeros((3, 4)), np.eye(4)).step(0.1, np.zeros((3, 2)), -1.0),
        lambda: bs.filters.Kf(model, np.zeros(4), np.eye(4)).predict(-1.0),
        lambda: bs.filters.Kf(model, np.zeros(4), np.eye(4)).correct([1, 2, 3], 1.0),
        lambda: bs.filters.Kf(model, np.zeros(4), np.eye(4)).correct([1, np.nan], 1.0),
    ):
        with pytest.raises(bs.BoresightError):
            make()


@pytest.fixture(scope="module")
def particles():
    """Twelve Gaussian spots that drift, 40 frames."""
    rng = np.random.default_rng(5)
    start, velocity = rng.uniform(20, 180, (12, 2)), rng.normal(0, 0.7, (12, 2))
    yy, xx = np.mgrid[:200, :200]
    frames, truth = [], []
    for k in range(40):
        image = rng.normal(20, 2, (200, 200))
        for i, (x, y) in enumerate(start + k * velocity):
            image += 120 * np.exp(-((xx - x) ** 2 + (yy - y) ** 2) / (2 * 1.5**2))
            truth.append((k, i, x, y))
        frames.append(np.clip(image, 0, 255).astype(np.uint8))
    return np.stack(frames), pd.DataFrame(truth, columns=["frame", "particle", "x", "y"])


def test_particles_are_located_and_linked_with_the_names_of_trackpy(particles):
    frames, truth = particles
    found = bs.locate(frames[0])
    assert {"y", "x", "mass", "size", "signal", "ep"} <= set(found.columns) and "frame" not in found
    every = bs.batch(frames)
    assert set(every["frame"]) == set(range(40)) and len(every) > 0.9 * len(truth)
    linked = bs.link(every, search_range=5, memory=3)
    assert linked["particle"].min() == 0 and len(linked) == len(every)
    scores = bs.evaluate(truth, linked, distance_px=3)
    assert scores["MOTA"] > 0.85 and scores["RMSE"] < 0.5, scores
    assert len(bs.batch(frames, minmass=1e9)) == 0


def test_linking_takes_any_order_and_refuses_what_it_cannot_read(particles):
    _, truth = particles
    shuffled = truth.drop(columns="particle").sample(frac=1.0, random_state=1)
    linked = bs.link(shuffled, search_range=4)
    assert (linked.index == shuffled.index).all()
    assert linked.groupby("particle").size().max() > 30
    for bad in (truth.drop(columns="x"), truth.iloc[:0], truth.assign(frame=-1), truth.assign(x=np.nan)):
        with pytest.raises(bs.BoresightError):
            bs.link(bad)
    with pytest.raises(bs.BoresightError):
        bs.link(truth, search_range=-1)
