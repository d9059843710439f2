"""`Tracker`: one scan a call; supervision in and out."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import boresight as bs


def test_step_gives_what_track_gives(ds2, band):
    tracks = bs.track(ds2.frames, times=ds2.times_s, config=band).to_dict()
    tracker, rows = bs.Tracker(band), []
    for frame, t in zip(ds2.frames, ds2.times_s, strict=True):
        states = tracker.step(frame, time_s=t)
        rows += [(states.frame, s.id, *s.state[[0, 2]]) for s in states]
    np.testing.assert_array_equal(np.array(rows), np.stack([tracks["frame"], tracks["track_id"], tracks["x_px"], tracks["y_px"]], axis=1))


def two_targets(n=30, dt=0.1):
    rng = np.random.default_rng(3)
    for k in range(n):
        t = k * dt
        truth = np.array([[10 + 20 * t, 50.0], [200 - 30 * t, 80 + 5 * t]])
        yield t, truth, truth + rng.normal(0, 0.5, truth.shape)


@pytest.fixture
def config():
    return bs.Config(tracker__acceleration_density_px2_per_s3=1.0, tracker__max_speed_px_per_s=100.0, tracker__confirmation={"m-of-n": {}})


def test_positions_with_covariances_are_tracked(config):
    tracker = bs.Tracker(config)
    for t, where, z in two_targets():
        states, truth = tracker.update(z, covariances=0.25 * np.eye(2), time_s=t), where
    found = states.confirmed
    assert len(found) == 2 and sorted(found.ids) == sorted(s.id for s in found)
    for s in found:
        error = truth - s.position
        nearest = error[np.argmin((error**2).sum(1))]
        assert nearest @ np.linalg.solve(s.covariance, nearest) < 16
        assert s.status == "confirmed" and s.is_confirmed and s.state.shape == (4,) and s.state_covariance.shape == (4, 4)
        assert s.velocity.shape == (2,) and s.nis >= 0 and s.detection in (0, 1) and 0 <= s.score <= 1
    assert found.positions.shape == (2, 2) and found.covariances.shape == (2, 2, 2) and found.boxes.shape == (2, 4)
    assert found.velocities.shape == (2, 2) and found.state_covariances.shape == (2, 4, 4) and found.statuses == ["confirmed"] * 2
    assert repr(states[0]) in repr(states) and states[-1].id == states[len(states) - 1].id
    with pytest.raises(IndexError):
        states[99]


def test_boxes_are_corners_and_come_back_as_corners(config):
    tracker = bs.Tracker(config)
    for k in range(10):
        boxes = np.array([[10.0 + k, 20, 30 + k, 60]])
        states = tracker.update(boxes=boxes, time_s=0.1 * k, std_px=0.5)
    # The centre of a box from 19 to 39 is 29; the first pixel's centre is 0 in ours and 0.5 in corners.
    assert abs(states.confirmed[0].position[0] - 28.5) < 0.5
    np.testing.assert_allclose(states.confirmed[0].box, boxes[0], atol=0.7)
    same = bs.Tracker(config)
    for k in range(10):
        again = same.update(np.array([[10.0 + k, 20, 30 + k, 60, 1.0, 0]]), time_s=0.1 * k, std_px=0.5)
    np.testing.assert_array_equal(again.positions, states.positions)


def test_scans_without_time_follow_at_the_rate_of_the_configuration(config):
    tracker = bs.Tracker(config.set(input__rate_hz=10.0))
    for _, _, z in two_targets(5):
        states = tracker.update(z)
    assert states.time_s == pytest.approx(0.4) and states.frame == 4


def test_a_scan_that_is_refused_leaves_the_tracks(config):
    tracker = bs.Tracker(config)
    for t, _, z in two_targets(10):
        before = tracker.update(z, time_s=t)
    for bad, words in [
        ({"detections": z, "time_s": 0.0}, "time"),
        ({"detections": np.full((1, 2), np.nan), "time_s": 5.0}, "finite"),
        ({"detections": z, "time_s": float("nan")}, "finite"),
        ({"detections": z, "covariances": np.eye(3), "time_s": 5.0}, "2 x 2"),
        ({"detections": z, "covariances": -np.eye(2), "time_s": 5.0}, "positive"),
        ({"detections": z, "scores": [1.0], "time_s": 5.0}, "scores"),
        ({"boxes": np.zeros((2, 3)), "time_s": 5.0}, "N x 4"),
        ({"time_s": 5.0}, "neither positions nor boxes"),
        ({"detections": "text", "time_s": 5.0}, "shape|numbers"),
    ]:
        with pytest.raises(bs.BoresightError, match=words):
            tracker.update(**bad)
    after = tracker.update(z, time_s=1.0)
    assert list(after.ids[:2]) == list(before.ids[:2])
    tracker.reset()
    assert tracker.update(z, time_s=0.0).frame == 0


def test_an_empty_scan_is_a_scan(config):
    tracker = bs.Tracker(config)
    for empty in ([], np.empty((0, 2)), np.empty((0, 5)), None, {"positions": []}):
        assert len(tracker.update(empty if empty is not None else [])) == 0


class Detections:
    """What supervision's own class is to us."""

    def __init__(self, xyxy, confidence=None, class_id=None, data=None):
        self.xyxy, self.confidence, self.class_id, self.data = xyxy, confidence, class_id, data or {}
        self.tracker_id = None


@pytest.mark.parametrize("real", [False, True])
def test_supervision_in_and_out(config, real):
    make = pytest.importorskip("supervision").Detections if real else Detections
    tracker = bs.Tracker(config)
    for t, _, z in two_targets():
        boxes = np.concatenate([z - 5, z + 5], axis=1).astype(np.float32)
        found = make(xyxy=boxes, confidence=np.array([0.9, 0.8], np.float32), class_id=np.array([1, 2]))
        out = tracker.update(found, time_s=t)
    assert out is not found and found.tracker_id is None
    assert sorted(out.tracker_id) == [1, 2] and out.data["covariance"].shape == (2, 2, 2)
    np.testing.assert_allclose(out.data["position"], z, atol=1.5)
    lone = make(xyxy=np.array([[500, 500, 510, 510.0]]), data={"covariance": np.eye(2)[None]})
    assert list(tracker.update(lone, time_s=t + 0.1).tracker_id) == [-1]


def test_threads_may_call_one_tracker_at_once(ds2, band):
    tracker, failures = bs.Tracker(band), []

    def work():
        for frame in ds2.frames[:20]:
            try:
                tracker.step(frame)
            except Exception as e:
                failures.append(e)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert not failures and tracker.step(ds2.frames[0]).frame == 80


def test_a_frame_of_another_type_is_refused(ds2, band):
    tracker = bs.Tracker(band)
    tracker.step(ds2.frames[0])
    with pytest.raises(bs.BoresightError, match="Gray16"):
        tracker.step(ds2.frames[1].astype(np.uint16))
    assert tracker.config == band


def test_a_configuration_is_learnt_from_recorded_detections():
    scans = [np.concatenate([z - 5, z + 5, np.full((2, 1), 0.9)], axis=1) for _, _, z in two_targets(60)]
    config = bs.Config.for_detections(scans, rate_hz=10.0)
    assert config.reasons
    tracker = bs.Tracker(config)
    for k, boxes in enumerate(scans):
        states = tracker.update(boxes, time_s=0.1 * k)
    assert len(states.confirmed) == 2
    with pytest.raises(bs.BoresightError):
        bs.Config.for_detections([np.zeros((2, 3))])
