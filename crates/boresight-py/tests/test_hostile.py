"""What is wrong is told by a BoresightError, whatever it is: no panic, no crash."""

from __future__ import annotations

import numpy as np
import pytest

import boresight as bs

FRAMES = np.random.default_rng(0).integers(0, 255, (6, 32, 32), np.uint8)
CV = bs.models.ConstantVelocity(q=1.0)
ROW = {"frame": [0], "id": [0], "x": [1.0], "y": [1.0]}


def update(*args, **kwargs):
    return bs.Tracker("detections-mot").update(*args, **kwargs)


def batch(n=2, **kwargs):
    return bs.filters.Batch(CV, np.zeros((n, 4)), 1.0)


REFUSED = {
    "a rate of zero": lambda: bs.track(FRAMES, rate_hz=0),
    "a rate that is a word": lambda: bs.track(FRAMES, rate_hz="fast"),
    "times that are not finite": lambda: bs.track(FRAMES, times=[np.nan] * 6),
    "times that run back": lambda: bs.track(FRAMES, times=[5, 4, 3, 2, 1, 0], config="known-band"),
    "a frame without dimensions": lambda: bs.track([np.uint8(3)]),
    "no frame at all": lambda: bs.track([None]),
    "words": lambda: bs.track(["a", "b"]),
    "objects": lambda: bs.track([np.array([[object()]])]),
    "frames of two types": lambda: bs.track([FRAMES[0], FRAMES[1].astype(np.uint16)]),
    "bytes as a path": lambda: bs.track(b"flight.mp4"),
    "a folder without images": lambda: bs.track(str(__file__).rsplit("/", 1)[0]),
    "a detector that returns an object": lambda: bs.track(FRAMES, detector=lambda f: object()),
    "a scene without frames": lambda: bs.simulate("ds2", n_frames=0),
    "a scene that is not TOML": lambda: bs.simulate("a\nb"),
    "three dimensions": lambda: update(np.zeros((2, 2, 2))),
    "boxes in one dimension": lambda: update(boxes=[1, 2, 3, 4]),
    "a box inside out": lambda: update(boxes=[[5, 5, 1, 1]]),
    "a box without end": lambda: update(boxes=[[0, 0, np.inf, 1]]),
    "a box of 1e300 px": lambda: update(boxes=[[0, 0, 1e300, 1e300]]),
    "covariances for others": lambda: update(np.zeros((1, 2)), covariances=np.zeros((0, 2, 2))),
    "no deviation": lambda: update([[1, 2]], std_px=0),
    "words as positions": lambda: update([["a", "b"]]),
    "a frame in the far future": lambda: bs.link({"frame": [0, 10**12], "x": [1, 1], "y": [1, 1]}),
    "a memory below zero": lambda: bs.link({"frame": [0, 1], "x": [1, 1], "y": [1, 1]}, memory=-5),
    "linking at no rate": lambda: bs.link({"frame": [0, 1], "x": [1, 1], "y": [1, 1]}, rate_hz=0),
    "no distance": lambda: bs.evaluate(ROW, ROW, distance_px=0),
    "a track twice in a frame": lambda: bs.evaluate({k: v * 2 for k, v in ROW.items()}, ROW, distance_px=1),
    "columns of different lengths": lambda: bs.evaluate({**ROW, "frame": [0, 1]}, ROW, distance_px=1),
    "four thousand million frames": lambda: bs.evaluate({**ROW, "frame": [4 * 10**9]}, ROW, distance_px=1),
    "fewer times than scans": lambda: bs.Config.for_detections([[[1, 2]]] * 3, times=[0, 1]),
    "a filter that is none": lambda: bs.Config(filter="x"),
    "an associator that is none": lambda: bs.Config(associator="x"),
    "a text where a number is wanted": lambda: bs.Config(tracker__coast_s="a\nb=1"),
    "a folder that is not there": lambda: bs.track(FRAMES, config="known-band").write("/no/such/folder/t.csv"),
    "a report that cannot be": lambda: bs.track(FRAMES, config="known-band").report("/no/such/folder/r.html"),
    "a model that is none": lambda: bs.filters.Kf(None, np.zeros(4), 1.0),
    "a mean in two dimensions": lambda: bs.filters.Kf(CV, np.zeros((2, 2)), 1.0),
    "a covariance in three": lambda: bs.filters.Kf(CV, np.zeros(4), np.zeros((2, 4, 4))),
    "variances in a row": lambda: bs.filters.Kf(CV, np.zeros(4), 1.0).correct([1, 2], [1, 2]),
    "covariances for a third track": lambda: bs.filters.Batch(CV, np.zeros((2, 4)), np.zeros((3, 4, 4))),
    "three variances": lambda: batch().step(0.1, np.zeros((2, 2)), np.ones(3)),
    "positions in one dimension": lambda: batch().step(0.1, np.zeros(4), 1.0),
    "a step back": lambda: batch().step(-0.1, np.zeros((2, 2)), 1.0),
}


@pytest.mark.parametrize("case", REFUSED)
def test_it_is_told(case):
    with pytest.raises(bs.BoresightError) as e:
        REFUSED[case]()
    assert str(e.value)


TAKEN = {
    "pixels that are not numbers": lambda: bs.track(np.full((6, 32, 32), np.nan)),
    "one pixel": lambda: bs.track(np.zeros((6, 1, 1), np.uint8)),
    "one row": lambda: bs.track(np.zeros((6, 1, 5000), np.uint8)),
    "one frame": lambda: bs.track(FRAMES[:1]),
    "a masked array": lambda: bs.track([np.ma.array(f) for f in FRAMES], config="known-band"),
    "DLPack alone": lambda: bs.track([Dlpack(f) for f in FRAMES], config="known-band"),
    "a batch of none": lambda: batch(0).step(0.1, np.zeros((0, 2)), 1.0),
    "the same time twice": lambda: bs.track(FRAMES, times=[0] * 6, config="known-band"),
    "a class below zero": lambda: update([[1, 2]], classes=[-3]),
    "a gap of a hundred thousand frames": lambda: bs.link({"frame": [0, 10**5], "x": [1, 1], "y": [1, 1]}),
    "no detections to learn from": lambda: bs.Config.for_detections([None, None]),
    "a time beyond all clocks": lambda: update([[1, 2]], time_s=1e300),
}


class Dlpack:
    """An array that has DLPack and nothing else."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **kwargs):
        return self.array.__dlpack__(**kwargs)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


@pytest.mark.parametrize("case", TAKEN)
def test_it_is_taken(case):
    TAKEN[case]()
