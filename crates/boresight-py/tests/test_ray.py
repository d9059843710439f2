"""Ray: a worker that is killed in the middle loses nothing, does nothing twice, and changes no byte."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time

import pytest

import boresight as bs
import boresight.ray

N_CLIPS = 40


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """Small simulated clips, as videos in raw YUV4MPEG2."""
    folder = tmp_path_factory.mktemp("clips")
    for seed in range(N_CLIPS):
        frames = bs.simulate("ds2", seed=seed, n_frames=30).frames
        n, height, width = frames.shape
        with open(folder / f"clip{seed:02}.y4m", "wb") as file:
            file.write(f"YUV4MPEG2 W{width} H{height} F10:1 Cmono\n".encode())
            for k in range(n):
                file.write(b"FRAME\n" + frames[k].tobytes())
    return sorted(str(p) for p in folder.iterdir())


def _hashes(entries):
    return {e["input"]: (e["status"], e["outputs"]) for e in entries}


def test_one_process_writes_the_manifest_of_the_command(clips, tmp_path):
    entry = boresight.ray.track_one(clips[0], tmp_path)
    assert entry["status"] == "done" and set(entry["outputs"]) == {"tracks.csv", "mot.txt", "report.html", "summary.json", "config.toml"}
    broken = tmp_path / "broken.y4m"
    broken.write_bytes(b"YUV4MPEG2 W64 H48 F25:1 Cmono\nFRAME\nxx")
    entry = boresight.ray.track_one(str(broken), tmp_path)
    assert entry["status"] == "failed" and "broken.y4m" in entry["reason"] and entry["outputs"] == {}
    command = os.environ.get("BORESIGHT")
    if command:
        # The same keys, the same folder, the same tracks.
        subprocess.run([command, "batch", clips[0], "-o", tmp_path / "c", "-q", "--", "--no-video"], check=True)
        own = json.loads((tmp_path / "c/manifest.jsonl").read_text())
        mine = boresight.ray.track_one(clips[0], tmp_path)
        assert own.keys() == mine.keys() and own["folder"] == mine["folder"] and own["cpu_features"] == mine["cpu_features"]
        assert own["input_sha256"] == mine["input_sha256"] and own["outputs"]["tracks.csv"] == mine["outputs"]["tracks.csv"]


def test_without_ray_the_error_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    with pytest.raises(bs.BoresightError) as e:
        boresight.ray.track_all([], tmp_path)
    assert "pip install ray" in e.value.hint


def test_a_killed_worker_loses_nothing_and_does_nothing_twice(clips, tmp_path):
    ray = pytest.importorskip("ray", reason="ray is not installed: pip install ray")
    alone = [boresight.ray.track_one(c, tmp_path / "alone") for c in clips]
    assert all(e["status"] == "done" for e in alone)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, configure_logging=False)
    try:
        manifest = tmp_path / "shared/manifest.jsonl"
        killed = []

        def kill_a_worker():
            @ray.remote(num_cpus=0)
            def nothing():
                return os.getpid()

            mine = ray.get(nothing.remote())
            deadline = time.time() + 120
            while time.time() < deadline:
                if manifest.exists() and len(manifest.read_text().splitlines()) >= 5:
                    listed = subprocess.run(["ps", "-eo", "pid,args"], capture_output=True, text=True, check=True).stdout
                    # Ray names a worker by what it does.
                    busy = [int(line.split()[0]) for line in listed.splitlines() if "ray::_task" in line]
                    if busy and busy[0] != mine:
                        os.kill(busy[0], signal.SIGKILL)
                        killed.append(busy[0])
                        return
                time.sleep(0.01)

        killer = threading.Thread(target=kill_a_worker)
        killer.start()
        entries = boresight.ray.track_all(clips, tmp_path / "shared", max_retries=3)
        killer.join()
        assert killed, "no worker was killed"
        assert _hashes(entries) == _hashes(alone)
        lines = [json.loads(line)["input"] for line in manifest.read_text().splitlines()]
        assert sorted(lines) == clips, "each once"
        # Going on finds all done; a changed output is made again.
        assert boresight.ray.track_all(clips, tmp_path / "shared", resume=True) == entries
        with pytest.raises(bs.BoresightError, match="already"):
            boresight.ray.track_all(clips, tmp_path / "shared")
        spoilt = tmp_path / "shared" / entries[3]["folder"] / "tracks.csv"
        spoilt.write_text("spoilt")
        with open(manifest, "a") as file:
            file.write('{"input": "cut')
        again = boresight.ray.track_all(clips, tmp_path / "shared", resume=True)
        # Nothing written: the columns come back.
        returned = boresight.ray.track_all([clips[3], str(tmp_path / "gone.y4m")], None)
        here = bs.track(clips[3], progress=False).to_dict()
        assert all((returned[0]["tracks"][name] == values).all() for name, values in here.items())
        assert returned[1]["status"] == "failed" and "gone.y4m" in returned[1]["reason"]
        assert _hashes(again) == _hashes(alone) and len(manifest.read_text().splitlines()) == N_CLIPS + 1
    finally:
        ray.shutdown()
    command = os.environ.get("BORESIGHT")
    if command:
        subprocess.run([command, "batch", "--verify", "-o", tmp_path / "shared"], check=True)
