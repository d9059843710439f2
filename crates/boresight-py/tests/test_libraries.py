"""Frames from the libraries that people have them from: each gives the tracks of the same frames as a NumPy stack.

`.ci/python --formats` brings the libraries; torch is tested where it happens to be installed.
"""

from __future__ import annotations

import numpy as np
import pytest

import boresight as bs


@pytest.fixture(scope="module")
def stack(ds2):
    return ds2.frames


def same(stack, band, source, **options):
    want = bs.track(stack, rate_hz=1.0, config=band).to_dict()
    got = bs.track(source, rate_hz=1.0, config=band, **options).to_dict()
    assert len(want["x_px"]) > 20
    for name, values in want.items():
        np.testing.assert_array_equal(values, got[name], err_msg=name)


def test_tifffile_reads_mapped_memory_and_pages(stack, band, tmp_path):
    tifffile = pytest.importorskip("tifffile")
    path = tmp_path / "s.tif"
    tifffile.imwrite(path, stack, photometric="minisblack")
    same(stack, band, tifffile.memmap(path, mode="r"))
    with tifffile.TiffFile(path) as file:
        same(stack, band, (page.asarray() for page in file.pages))
    same(stack, band, path)


def test_imageio_iterates(stack, band, tmp_path):
    imageio = pytest.importorskip("imageio.v3")
    path = tmp_path / "s.tif"
    imageio.imwrite(path, stack)
    same(stack, band, imageio.imread(path))
    same(stack, band, imageio.imiter(path, plugin="pillow"))


def test_pims_is_a_sequence(stack, band, tmp_path):
    pims = pytest.importorskip("pims")
    imageio = pytest.importorskip("imageio.v3")
    for k, frame in enumerate(stack):
        imageio.imwrite(tmp_path / f"f{k:03}.png", frame)
    frames = pims.ImageSequence(str(tmp_path / "*.png"))
    same(stack, band, frames)
    tracker = bs.Tracker(band)
    assert tracker.step(frames[0], time_s=0.0).frame == 0


def test_dask_is_computed_frame_by_frame(stack, band):
    dask = pytest.importorskip("dask.array")
    same(stack, band, dask.from_array(stack, chunks=(10, -1, -1)))


def test_opencv_gives_blue_green_red(stack, band, clip):
    cv2 = pytest.importorskip("cv2")
    video, frames = cv2.VideoCapture(clip), []
    while len(frames) < 60:
        ok, frame = video.read()
        assert ok
        frames.append(frame)
    tracks = bs.track([f[:, :, ::-1] for f in frames], rate_hz=30.0)
    grey = bs.track([cv2.cvtColor(f, cv2.COLOR_BGR2GRAY) for f in frames], rate_hz=30.0)
    assert tracks.n_tracks == grey.n_tracks == 1
    same(stack, band, [cv2.merge([f, f, f])[:, :, 0] for f in stack])


def test_torch_on_the_processor(stack, band):
    torch = pytest.importorskip("torch")
    same(stack, band, torch.from_numpy(stack.copy()))
    same(stack, band, torch.from_numpy(stack.copy()).transpose(1, 2).contiguous().transpose(1, 2))


def test_a_bar_of_tqdm_shows_how_far_it_is(clip, capsys):
    pytest.importorskip("tqdm")
    bs.track(clip, config="small-infrared-targets", progress=True)
    assert "302" in capsys.readouterr().err
