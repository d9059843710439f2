"""Many videos on many machines with Ray: one task a video, results in a shared folder with the manifest of `boresight batch`, or returned.

`track_all` must see the inputs and the output folder under the same names on every machine. A worker that dies costs its video's
attempt: Ray starts the task again, and the driver writes a line of the manifest only for what came back. The tables are the bytes of
`boresight track`, so `boresight batch --verify -o OUTPUT` checks them.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import time
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from . import _boresight
from ._errors import BoresightError, BoresightWarning
from ._keys import assignments
from ._track import track

MANIFEST = "manifest.jsonl"


def track_all(
    inputs: Iterable[str | os.PathLike[str]],
    output: str | os.PathLike[str] | None,
    *,
    max_retries: int = 3,
    num_cpus: float = 1,
    resume: bool = False,
    ray_options: dict[str, Any] | None = None,
    **sets: Any,
) -> list[dict[str, Any]]:
    """Tracks each input in a Ray task of its own; returns the manifest's entries in the inputs' order.

    Args:
        inputs: videos, folders of images or tables of detections, as paths that every machine sees; one that comes twice counts once.
        output: the folder for all results, shared by all machines: `manifest.jsonl` and a folder for each input with `tracks.csv`,
            `mot.txt`, `report.html`, `summary.json` and `config.toml`. `None`: nothing is written, and each entry has its columns
            (as of `Tracks.to_dict`) under `tracks`, its configuration's text under `configuration`.
        max_retries: how often Ray starts a task again whose worker died.
        num_cpus: processors that Ray reserves for a task.
        resume: go on with the manifest in `output`: what is done, with these keys and as its hashes say, stays.
        ray_options: further options of the task, such as `memory` (bytes) or `resources`.
        **sets: keys of the configuration, two underlines for the dot: `tracker__coast_s=1.0`.

    Raises:
        BoresightError: no Ray; a manifest in `output` without `resume`. What fails for one input stands in its entry.
    """
    try:
        import ray
    except ImportError as e:
        raise BoresightError("Ray is not installed", where="boresight.ray", hint="pip install ray") from e
    arguments = ["--no-video", *(f"--set={a}" for a in assignments(dict(sets), None, None))]
    names = list(dict.fromkeys(os.fspath(i) for i in inputs))
    if output is None:
        short = ray.remote(_in_memory).options(max_retries=max_retries, num_cpus=num_cpus, **(ray_options or {}))
        started = [(n, short.remote(n, arguments, sets)) for n in names]
        return [_got(ray, ref, partial(_short, n, arguments)) for n, ref in started]
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    done = _known(folder, resume)
    entries = {n: old for n in names if (old := done.get(n)) and old["arguments"] == arguments and _holds(folder, old)}
    task = ray.remote(_task).options(max_retries=max_retries, num_cpus=num_cpus, **(ray_options or {}))
    waiting = {task.remote(n, str(folder), arguments, sets): n for n in names if n not in entries}
    with open(folder / MANIFEST, "a", encoding="utf-8") as manifest:
        while waiting:
            for ref in ray.wait(list(waiting))[0]:
                name = waiting.pop(ref)
                entry = _got(ray, ref, partial(_entry, name, folder, arguments, time.time()))
                manifest.write(json.dumps(entry) + "\n")
                manifest.flush()
                os.fsync(manifest.fileno())
                entries[name] = entry
    return [entries[n] for n in names]


def track_one(name: str, output: str | os.PathLike[str], arguments: list[str] | None = None, **sets: Any) -> dict[str, Any]:
    """Tracks one input into its folder below `output` and returns its entry; what a task does, for any other scheduler too."""
    began, folder = time.time(), Path(output)
    place = folder / _folder_of(name)
    shutil.rmtree(place, ignore_errors=True)
    reason = None
    try:
        with warnings.catch_warnings():
            # They stand in the summary.
            warnings.simplefilter("ignore", BoresightWarning)
            tracks = track(name, progress=False, **sets)
        place.mkdir(parents=True)
        for file in ("tracks.csv", "mot.txt", "report.html"):
            tracks.write(place / file)
        s = tracks.summary
        told = {"input": name, "frames": s["n_frames"], "duration_s": s["duration_s"], "detections": s["n_detections"]}
        told |= {"confirmed_tracks": s["n_confirmed_tracks"], "most_at_once": s["most_at_once"], "warnings": tracks.warnings}
        (place / "summary.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
        (place / "config.toml").write_text(tracks.config.to_toml(), encoding="utf-8")
    except BoresightError as e:
        reason = str(e)
    return _entry(name, folder, arguments or ["--no-video"], began, reason)


def _got(ray: Any, ref: Any, failed: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    """What a task returned; what `failed` makes of the reason where its worker died in every attempt."""
    try:
        entry: dict[str, Any] = ray.get(ref)
    except ray.exceptions.RayError as e:
        return failed(f"{type(e).__name__}: {e}")
    return entry


def _short(name: str, arguments: list[str], reason: str | None) -> dict[str, Any]:
    """An entry without files."""
    status = "done" if reason is None else "failed"
    return {"input": name, "status": status, "reason": reason, "arguments": arguments, "version": _boresight.__version__}


def _in_memory(name: str, arguments: list[str], sets: dict[str, Any]) -> dict[str, Any]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BoresightWarning)
            tracks = track(name, progress=False, **sets)
    except BoresightError as e:
        return _short(name, arguments, str(e))
    found = {"tracks": tracks.to_dict(), "configuration": tracks.config.to_toml(), "summary": tracks.summary}
    return {**_short(name, arguments, None), **found, "warnings": tracks.warnings}


def _task(name: str, output: str, arguments: list[str], sets: dict[str, Any]) -> dict[str, Any]:
    return track_one(name, output, arguments, **sets)


def _entry(name: str, folder: Path, arguments: list[str], began: float, reason: str | None) -> dict[str, Any]:
    place = folder / _folder_of(name)
    outputs = {str(p.relative_to(place)): _sha256(p) for p in sorted(place.rglob("*")) if p.is_file()}
    has_config = "config.toml" in outputs
    return {
        "input": name,
        "input_sha256": _hash_of_input(name),
        "status": "done" if reason is None else "failed",
        "exit_code": 0 if reason is None else None,
        "reason": reason,
        "folder": place.name,
        "arguments": arguments,
        "given_configuration_sha256": None,
        "configuration": f"{place.name}/config.toml" if has_config else None,
        "configuration_sha256": outputs.get("config.toml"),
        "outputs": outputs,
        "version": _boresight.__version__,
        "cpu_features": _boresight.cpu_features(),
        "seconds": round(time.time() - began, 3),
        "peak_memory_mb": None,
        "ended_unix_ms": int(time.time() * 1000),
    }


def _known(folder: Path, resume: bool) -> dict[str, dict[str, Any]]:
    """The latest entry of each input; a cut last line goes."""
    path = folder / MANIFEST
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    if text and not resume:
        raise BoresightError("there is a batch in this folder already", where=str(path), hint="go on with it: resume=True")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        os.truncate(path, len(whole.encode()))
    return {entry["input"]: entry for entry in map(json.loads, whole.splitlines())}


def _holds(folder: Path, entry: dict[str, Any]) -> bool:
    """Whether an entry is of this version and its input and all outputs are still what they were."""
    if entry["status"] != "done" or entry["version"] != _boresight.__version__:
        return False
    place = folder / entry["folder"]
    files = ((place / name, sha256) for name, sha256 in entry["outputs"].items())
    return _hash_of_input(entry["input"]) == entry["input_sha256"] and all(p.is_file() and _sha256(p) == h for p, h in files)


def _folder_of(name: str) -> str:
    """The name that `boresight batch` gives the folder of an input's results."""
    stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in Path(name).stem[:60])
    return f"{stem}-{hashlib.sha256(name.encode()).hexdigest()[:12]}"


def _hash_of_input(name: str) -> str | None:
    """SHA-256 of a file, of a folder that of the list of its files' hashes."""
    path = Path(name)
    if path.is_dir():
        files = sorted((str(p.relative_to(path)), p) for p in path.rglob("*") if p.is_file())
        return hashlib.sha256("".join(f"{_sha256(p)}  {n}\n" for n, p in files).encode()).hexdigest()
    return _sha256(path) if path.exists() else None


def _sha256(path: Path) -> str:
    hasher = hashlib.sha256()
    with open(path, "rb") as file:
        while chunk := file.read(1 << 20):
            hasher.update(chunk)
    return hasher.hexdigest()
