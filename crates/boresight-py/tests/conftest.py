"""What the tests share: the repository's clip, and simulated frames."""

from __future__ import annotations

from pathlib import Path

import pytest

import boresight as bs

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def clip() -> str:
    """An infrared clip of one drone, 302 frames."""
    return str(ROOT / "samples/ir_drone/IR_DRONE_046.mp4")


@pytest.fixture(scope="session")
def drone(clip: str) -> bs.Tracks:
    """The clip's tracks, nothing chosen."""
    return bs.track(clip, progress=False)


@pytest.fixture(scope="session")
def clip_truth() -> str:
    return str(ROOT / "samples/ir_drone/IR_DRONE_046.gt.txt")


@pytest.fixture(scope="session")
def ds2() -> bs.Simulation:
    """50 frames of one target of 9 x 9 px on noise."""
    return bs.simulate("ds2", seed=1)


@pytest.fixture(scope="session")
def band() -> bs.Config:
    """The configuration for ds2."""
    return bs.Config(
        detector__threshold__band={"low": 90, "high": 110},
        detector__cluster__min_area_px=25,
        tracker__acceleration_std_px_per_s2=0.1,
        tracker__max_speed_px_per_s=8.0,
        tracker__coast_s=5.0,
    )
