"""`track`: from paths and arrays, errors, the ways out."""

from __future__ import annotations

import json
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import boresight as bs


def test_a_clip_gives_the_drone_and_its_columns(drone):
    assert drone.summary["n_frames"] == 302 and drone.n_tracks >= 1
    d = drone.to_dict()
    assert list(d)[:4] == ["frame", "time_s", "track_id", "status"] and len(d) == 21
    assert {len(v) for v in d.values()} == {len(drone)}
    assert set(d["status"]) <= {"tentative", "confirmed", "coasting"}


def test_every_frame_library_gets_the_same_columns(drone):
    d = drone.to_dict()
    for frame in (drone.to_pandas(), drone.to_polars(), drone.to_arrow().to_pandas()):
        assert list(frame.columns) == list(d)
        for name in ("frame", "x_px", "var_vy_px2_per_s2"):
            np.testing.assert_array_equal(np.asarray(frame[name]), d[name])
    assert list(drone.to_pandas()["status"]) == list(d["status"])
    missing = drone.to_polars()["detection"].null_count()
    assert missing == (d["detection"] < 0).sum()


def test_an_arrow_stream_outlives_the_tracks(ds2, band):
    tracks = bs.track(ds2.frames, times=ds2.times_s, config=band)
    table, x = pa.table(tracks), tracks.to_dict()["x_px"]
    unread = tracks.__arrow_c_stream__()
    del tracks, unread
    np.testing.assert_array_equal(table["x_px"].to_numpy(), x)
    assert pl.DataFrame(table)["x_px"].to_list() == x.tolist()


def test_an_empty_result_has_its_columns_too():
    dark = np.zeros((5, 16, 16), np.uint8)
    tracks = bs.track(dark, config="known-band")
    assert len(tracks) == 0 and len(tracks.to_pandas().columns) == 21
    assert tracks.to_polars().shape == (0, 21) and "Tracks" in repr(tracks)
    assert tracks._repr_html_() and tracks.covariances().shape == (0, 4, 4)


def test_covariances_are_symmetric_and_those_of_the_columns(drone):
    p, d = drone.covariances(), drone.to_dict()
    np.testing.assert_array_equal(p, p.transpose(0, 2, 1))
    np.testing.assert_array_equal(p[:, 2, 2], d["var_y_px2"])
    np.testing.assert_array_equal(p[:, 0, 2], d["cov_x_y_px2"])
    assert (np.linalg.eigvalsh(p) > 0).all()


def test_the_written_configuration_gives_the_identical_table(drone, clip, tmp_path):
    drone.write(tmp_path / "a.csv")
    again = bs.track(clip, config=bs.Config.from_toml(drone.config.to_toml()), progress=False)
    again.write(tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_tables_are_written_and_read_back(drone, tmp_path):
    drone.write(tmp_path / "t.csv")
    # pandas before 3 reads to the same bits only if it is asked to.
    frame = pd.read_csv(tmp_path / "t.csv", float_precision="round_trip")
    np.testing.assert_array_equal(frame["x_px"], drone.to_dict()["x_px"])
    drone.write(tmp_path / "t.parquet")
    assert pl.read_parquet(tmp_path / "t.parquet").shape == (len(drone), 21)
    drone.write(tmp_path / "t.jsonl")
    assert len((tmp_path / "t.jsonl").read_text().splitlines()) == 302
    drone.write(tmp_path / "t.txt")
    assert len((tmp_path / "t.txt").read_text().split("\n")[0].split(",")) == 10
    with pytest.warns(bs.BoresightWarning, match="trackpy does not hold: .*status, .*vx_px_per_s, .*var_x_px2"):
        drone.write(tmp_path / "p.csv", format="trackpy")
    assert {"y", "x", "frame", "particle"} <= set(pd.read_csv(tmp_path / "p.csv").columns)
    with pytest.raises(bs.BoresightError) as e:
        drone.write(tmp_path / "t.xyz")
    assert ".csv" in e.value.hint
    with pytest.raises(bs.BoresightError, match="no such format"):
        drone.write(tmp_path / "t.csv", format="nonsense")


def test_the_report_shows_frames_tracks_and_configuration(drone, tmp_path):
    drone.report(tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text()
    data = json.loads(text.split('id="data">')[1].split("</script>")[0])
    assert data["tracks"] and "data:image/png" in text and "acceleration-density" in text


def test_a_notebook_shows_a_summary_a_picture_and_a_link_to_the_report(ds2, band, tmp_path):
    tracks = bs.track(ds2.frames, times=ds2.times_s, config=band)
    page = tracks._repr_html_()
    assert "<svg" in page and "polyline" in page and "confirmed track" in page and "<a " not in page
    tracks.report(tmp_path / "a & b.html")
    assert f'<a href="{tmp_path}/a%20%26%20b.html"' in tracks._repr_html_()


def test_tracks_are_plotted_if_matplotlib_is_there(drone):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    ax = drone.plot(lw=1)
    assert ax.lines and ax.yaxis_inverted()


def test_arrays_give_what_the_same_frames_in_a_file_give(ds2, band, tmp_path):
    h, w = ds2.frames.shape[1:]
    with open(tmp_path / "f.y4m", "wb") as f:
        f.write(f"YUV4MPEG2 W{w} H{h} F1:1 Cmono\n".encode())
        for frame in ds2.frames:
            f.write(b"FRAME\n" + frame.tobytes())
    from_file = bs.track(tmp_path / "f.y4m", config=band)
    from_arrays = bs.track(ds2.frames, times=ds2.times_s, config=band)
    from_rate = bs.track(iter(ds2.frames), rate_hz=ds2.rate_hz, config=band)
    for other in (from_arrays, from_rate):
        for name, values in from_file.to_dict().items():
            np.testing.assert_array_equal(values, other.to_dict()[name], err_msg=name)


def test_the_automatic_choice_works_on_arrays_generators_and_lists(ds2):
    sources = [ds2.frames, list(ds2.frames), (f for f in ds2.frames)]
    results = [bs.track(s, rate_hz=1.0) for s in sources]
    assert all(r.summary["n_frames"] == 50 and r.config.reasons for r in results)


def test_a_sequence_that_can_only_be_indexed_is_a_source(ds2, band):
    class Lazy:
        def __len__(self):
            return 50

        def __getitem__(self, k):
            if k >= 50:
                raise IndexError
            return ds2.frames[k]

    assert bs.track(Lazy(), rate_hz=1.0, config=band).summary["n_frames"] == 50


@pytest.mark.parametrize(
    "form",
    [
        lambda f: f.astype(np.uint16),
        lambda f: f.astype(">u2"),
        lambda f: f.astype(np.float32),
        lambda f: f.astype(np.float64),
        lambda f: f.astype(np.int32),
        lambda f: np.asfortranarray(f),
        lambda f: np.repeat(np.repeat(f, 2, 0), 3, 1)[::2, ::3],
        lambda f: f[::-1, ::-1].copy()[::-1, ::-1],
        lambda f: _read_only(f),
        lambda f: _unaligned(f.astype(np.uint16)),
        lambda f: f[:, :, None],
        lambda f: f.tolist(),
    ],
)
def test_every_layout_and_type_of_the_same_frames_gives_the_same_tracks(ds2, band, form):
    plain = bs.track(ds2.frames, rate_hz=1.0, config=band).to_dict()
    other = bs.track([form(f) for f in ds2.frames], rate_hz=1.0, config=band).to_dict()
    np.testing.assert_array_equal(plain["track_id"], other["track_id"])
    # Floats have no quantisation noise in their covariance.
    np.testing.assert_allclose(plain["x_px"], other["x_px"], atol=2e-3)


def _read_only(f):
    f = f.copy()
    f.flags.writeable = False
    return f


def _unaligned(f):
    room = np.zeros(f.nbytes + 1, np.uint8)
    out = np.frombuffer(room.data, np.uint16, f.size, offset=1).reshape(f.shape)
    out[...] = f
    assert not out.flags.aligned
    return out


def test_colour_strided_and_with_alpha_is_one_frame(ds2, band):
    rgb = [np.stack([f] * 3, axis=2) for f in ds2.frames]
    bgra = [np.stack([f] * 4, axis=2) for f in ds2.frames]
    a = bs.track(rgb, rate_hz=1.0, config=band).to_dict()
    b = bs.track([f[:, :, ::-1] for f in rgb], rate_hz=1.0, config=band).to_dict()
    c = bs.track(bgra, rate_hz=1.0, config=band).to_dict()
    np.testing.assert_array_equal(a["x_px"], b["x_px"])
    np.testing.assert_array_equal(a["x_px"], c["x_px"])


def test_a_mask_of_booleans_is_tracked():
    frames = np.zeros((20, 40, 40), bool)
    for k in range(20):
        frames[k, 10:16, 5 + k : 11 + k] = True
    tracks = bs.track(frames, rate_hz=25.0, config={"detector.threshold.level.level": 100.0})
    assert tracks.n_tracks == 1
    last = tracks.to_pandas().iloc[-1]
    assert abs(last["x_px"] - (5 + 19 + 2.5)) < 0.3 and abs(last["y_px"] - 12.5) < 0.3


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("no_such_file.mp4", "no such file"),
        (np.zeros((4, 4)), "expected frames x rows x columns"),
        ([np.zeros((4, 4, 7))], "rows x columns x 3"),
        ([np.zeros((4, 4), complex)], "expected numbers"),
        ([np.zeros((0, 4), np.uint8)], "0 pixels|4 x 0"),
        ([object()], "expected numbers|array"),
        ([], "no frames"),
        (17, "a int"),
    ],
)
def test_what_cannot_be_read_is_told(source, words):
    with pytest.raises(bs.BoresightError, match=words) as e:
        bs.track(source)
    assert e.value.kind and e.value.where


def test_a_wrong_key_value_or_time_is_told(ds2, band):
    with pytest.raises(bs.BoresightError, match="gate-probability") as e:
        bs.track(ds2.frames, config=band, tracker__gate_probability=1.2)
    assert e.value.kind == "config" and "0.99" in e.value.hint
    with pytest.raises(bs.BoresightError, match="there is no such argument"):
        bs.track(ds2.frames, coast_s=1)
    with pytest.raises(bs.BoresightError, match="3 times for 50 frames"):
        bs.track(ds2.frames, times=[0, 1, 2])
    with pytest.raises(bs.BoresightError, match="3 times for more frames"):
        bs.track(iter(ds2.frames), times=[0, 1, 2], config=band)
    with pytest.raises(bs.BoresightError):
        bs.track(ds2.frames, rate_hz=float("nan"), config=band)
    with pytest.raises(bs.BoresightError, match="a object"):
        bs.track(ds2.frames, config=object())


def test_a_frame_of_another_size_leaves_the_tracks_before_it(ds2, band):
    frames = [*ds2.frames[:20], np.zeros((5, 5), np.uint8)]
    with pytest.raises(bs.BoresightError, match="64 x 64") as e:
        bs.track(frames, rate_hz=1.0, config=band)
    assert isinstance(e.value.partial, bs.Tracks) and e.value.partial.summary["n_frames"] == 20


def test_an_exception_of_the_users_iterator_comes_through(ds2, band):
    def frames():
        yield from ds2.frames[:10]
        raise KeyError("the camera is gone")

    with pytest.raises(KeyError, match="the camera is gone"):
        bs.track(frames(), rate_hz=1.0, config=band)


def test_an_error_survives_a_pool_of_processes():
    e = pickle.loads(pickle.dumps(bs.BoresightError("what", kind="damaged", where="here", hint="mend")))
    assert (str(e), e.kind, e.where, e.hint) == ("what", "damaged", "here", "mend")


def test_a_detector_in_python_is_a_stage(ds2):
    def brightest(frame):
        blurred = sum(np.roll(frame.astype(float), (dy, dx), (0, 1)) for dy in range(-4, 5) for dx in range(-4, 5))
        y, x = np.unravel_index(np.argmax(blurred), blurred.shape)
        return {"positions": [[x, y]], "covariances": np.eye(2)}

    tracks = bs.track(ds2.frames, times=ds2.times_s, detector=brightest)
    assert tracks.n_tracks == 1
    streamed = bs.track(iter(ds2.frames), rate_hz=1.0, detector=brightest, config=tracks.config)
    assert streamed.n_tracks == 1
    scores = bs.evaluate(ds2.truth, tracks, distance_px=5)
    assert scores["RMSE"] < 2.0


def test_a_detector_is_asked_for_by_its_word(ds2, clip):
    rng = np.random.default_rng(2)
    yy, xx = np.mgrid[:96, :96]
    at = rng.uniform(10, 60, (8, 2))
    spots = [sum(120 * np.exp(-((xx - x - k) ** 2 + (yy - y) ** 2) / 4.5) for x, y in at) for k in range(20)]
    frames = [(20 + s + rng.normal(0, 2, s.shape)).clip(0, 255).astype(np.uint8) for s in spots]
    tracks = bs.track(frames, rate_hz=10.0, detector="spot")
    assert "[detector.threshold.spot]" in tracks.config.to_toml() and 6 <= tracks.n_tracks <= 8
    assert "[detector.threshold.cfar]" in bs.Config.auto(ds2.frames, rate_hz=1.0, detector="cfar").to_toml()
    for wrong, words in (("spots", "no such detector"), (5, "a int")):
        with pytest.raises(bs.BoresightError, match=words) as e:
            bs.track(ds2.frames, detector=wrong)
        assert e.value.hint
    with pytest.raises(bs.BoresightError, match="stands in it"):
        bs.track(clip, detector="spot", config="known-band")


def test_what_a_detector_raises_or_returns_wrongly_is_told(ds2):
    def broken(frame):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        bs.track(ds2.frames, detector=broken)
    with pytest.raises(bs.BoresightError, match="unknown keys: boxs"):
        bs.track(ds2.frames, detector=lambda f: {"boxs": []})
    with pytest.raises(bs.BoresightError, match="shape"):
        bs.track(ds2.frames, detector=lambda f: np.zeros((2, 3)))
    nothing = bs.track(ds2.frames, detector=lambda f: None, config="detections-mot")
    assert len(nothing) == 0


def test_progress_is_told_and_a_function_of_the_users_can_end_the_run(clip):
    seen = []
    bs.track(clip, config="small-infrared-targets", progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (302, 302)

    def enough(done, total):
        raise StopIteration("enough")

    with pytest.raises(StopIteration):
        bs.track(clip, config="small-infrared-targets", progress=enough)


def test_the_interpreter_is_free_while_a_run_goes_on(clip, drone):
    ticks = 0
    done = threading.Event()

    def work():
        bs.track(clip, config=drone.config, progress=False)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        ticks += 1
        time.sleep(0.001)
    thread.join()
    assert ticks > 100


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent as on Unix")
@pytest.mark.parametrize("source", ["path", "arrays"])
def test_ctrl_c_ends_a_run(clip, source):
    code = f"""
        import itertools, sys, numpy as np, boresight as bs
        frames = (np.random.default_rng(k % 50).integers(0, 255, (400, 400), np.uint8) for k in itertools.count())
        print("begun", flush=True)
        try:
            for _ in range(100):
                bs.track({clip!r} if {source!r} == "path" else frames, progress=False)
        except KeyboardInterrupt:
            sys.exit(42)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"begun\n"
    time.sleep(0.7)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=20) == 42


def test_a_table_of_detections_is_a_source(drone, clip, tmp_path):
    rows = bs.batch(clip, config=drone.config)
    table = rows.rename(columns={"x": "x_px", "y": "y_px", "var_x": "var_x_px2", "cov_xy": "cov_xy_px2", "var_y": "var_y_px2"})
    table[["frame", "x_px", "y_px"]].to_csv(tmp_path / "d.csv", index=False)
    tracks = bs.track(tmp_path / "d.csv", rate_hz=30.0)
    assert tracks.n_tracks >= 1 and Path(tmp_path / "d.csv").name in repr(tracks)


def test_the_annotated_video_is_written(ds2, band, tmp_path):
    bs.track(ds2.frames, times=ds2.times_s, config=band, annotate=tmp_path / "a.mp4")
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"


def test_what_is_lost_is_a_python_warning(ds2, band, tmp_path):
    h, w = ds2.frames.shape[1:]
    frames = b"".join(b"FRAME\n" + f.tobytes() for f in ds2.frames)
    (tmp_path / "cut.y4m").write_bytes(f"YUV4MPEG2 W{w} H{h} F1:1 Cmono\n".encode() + frames[:-100])
    with pytest.warns(bs.BoresightWarning, match="cut.y4m|frame"):
        tracks = bs.track(tmp_path / "cut.y4m", config=band)
    assert tracks.warnings and tracks.summary["n_frames"] == 49
