"""Every format that `track --also` and `convert` write, read back by a reader that others wrote.

Needs the command, named by the variable BORESIGHT, and a reader a format: `.ci/python --formats` brings all of them.
"""

from __future__ import annotations

import csv
import os
import subprocess

import numpy as np
import pytest

ALSO = "geff,trackmate-xml,cvat,mot-zip,napari,parquet"
COMMAND = os.environ.get("BORESIGHT", "")
pytestmark = pytest.mark.skipif(not COMMAND, reason="the variable BORESIGHT names no command")


def boresight(*words):
    return subprocess.run([COMMAND, *map(str, words)], check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def run(clip, tmp_path_factory):
    """The clip's results in all formats, and its confirmed rows."""
    folder = tmp_path_factory.mktemp("run")
    boresight("track", clip, "-o", folder, "--no-video", "--no-report", "--also", ALSO)
    with open(folder / "tracks.csv", encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if r["status"] != "tentative"]
    assert len(rows) > 200
    return folder, rows


def numbers(rows, *names):
    return np.array([[float(r[n]) for n in names] for r in rows])


def test_geff(run):
    pytest.importorskip("geff", reason="geff is not installed")
    folder, rows = run
    from geff.core_io import read_to_memory
    from geff.validate.data import ValidationConfig

    checks = ValidationConfig(graph=True, ellipsoid=True, tracklet=True, lineage=True)
    graph = read_to_memory(str(folder / "tracks.geff"), data_validation=checks)
    about, props = graph["metadata"], graph["node_props"]
    assert about.geff_version == "1.3" and about.ellipsoid == "covariance2d" and [a.name for a in about.axes] == ["t", "y", "x"]
    values = {name: np.asarray(p["values"]) for name, p in props.items()}
    table = numbers(rows, "frame", "y_px", "x_px", "track_id", "time_s", "vx_px_per_s")
    np.testing.assert_array_equal(values["t"], table[:, 0])
    np.testing.assert_allclose(values["y"], table[:, 1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(values["x"], table[:, 2], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(values["track_id"], table[:, 3])
    np.testing.assert_allclose(values["time_s"], table[:, 4], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(values["vx"], table[:, 5])
    cov = numbers(rows, "var_y_px2", "cov_x_y_px2", "cov_x_y_px2", "var_x_px2").reshape(-1, 2, 2)
    np.testing.assert_array_equal(values["covariance2d"], cov)
    assert values["state_covariance"].shape == (len(rows), 4, 4)
    assert len(graph["edge_ids"]) == len(rows) - len({r["track_id"] for r in rows})


def test_geff_of_cells_that_divide(tmp_path):
    geff = pytest.importorskip("geff", reason="geff is not installed")
    table = tmp_path / "cells.csv"
    table.write_text("frame,track_id,x,y,parent\n0,1,3,3,\n1,1,4,4,\n2,2,3,5,1\n2,4,9,9,1\n3,4,9,8,1\n")
    said = boresight("convert", table, tmp_path / "c.geff", "--to", "geff").stderr
    assert "does not hold" not in said
    graph, _ = geff.read(str(tmp_path / "c.geff"), backend="networkx")
    assert sorted(graph.edges) == [(0, 1), (1, 2), (1, 3), (3, 4)]


def test_trackmate(run, tmp_path):
    pytest.importorskip("geff", reason="geff is not installed")
    from geff.convert import from_trackmate_xml_to_geff

    folder, rows = run
    from_trackmate_xml_to_geff(folder / "trackmate.xml", tmp_path / "t.geff")
    import geff

    graph, _ = geff.read(str(tmp_path / "t.geff"), backend="networkx")
    assert graph.number_of_nodes() == len(rows)
    assert graph.number_of_edges() == len(rows) - len({r["track_id"] for r in rows})
    for node, row in zip(sorted(graph.nodes), rows, strict=True):
        data = graph.nodes[node]
        assert data["POSITION_X"] == pytest.approx(float(row["x_px"]), abs=1e-9) and data["FRAME"] == int(row["frame"])
        assert data["POSITION_T"] == pytest.approx(float(row["time_s"]))


def _datumaro(path, kind):
    """Boxes by frame and track as Datumaro reads them."""
    dm = pytest.importorskip("datumaro", reason="datumaro is not installed")
    found = {}
    for item in dm.Dataset.import_from(str(path), kind):
        for box in item.annotations:
            if not box.attributes.get("outside"):
                frame = item.attributes.get("frame")
                found[int(item.id.split("_")[-1]) if frame is None else int(frame), int(box.attributes["track_id"])] = box
    return found


def _same_boxes(found, rows, origin_px):
    """Left, top, width and height, from the corner of the first pixel."""
    want = {(int(r["frame"]), int(r["track_id"])): r for r in rows}
    assert found.keys() == want.keys()
    for key, r in want.items():
        x, y, w, h = (float(r[n]) for n in ("x_px", "y_px", "width_px", "height_px"))
        np.testing.assert_allclose(found[key].get_bbox(), [x - w / 2 + origin_px, y - h / 2 + origin_px, w, h], atol=0.02)


def test_cvat(run, tmp_path):
    folder, rows = run
    (tmp_path / "annotations.xml").write_bytes((folder / "cvat.xml").read_bytes())
    _same_boxes(_datumaro(tmp_path, "cvat"), rows, 0.5)


def test_mot_zip(run, tmp_path):
    import zipfile

    folder, rows = run
    with zipfile.ZipFile(folder / "mot.zip") as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path)
    assert (tmp_path / "gt/labels.txt").read_text() == "object\n"
    found = {(frame - 1, track): box for (frame, track), box in _datumaro(tmp_path, "mot_seq").items()}
    _same_boxes(found, rows, 1.5)


def test_napari(run):
    folder, rows = run
    array = np.load(folder / "napari.npy", allow_pickle=False)
    table = numbers(rows, "track_id", "frame", "y_px", "x_px")
    np.testing.assert_allclose(array, table[np.lexsort((table[:, 1], table[:, 0]))], rtol=0, atol=1e-9)


@pytest.mark.parametrize("reader", ["pyarrow", "polars"])
def test_parquet(run, reader):
    folder, rows = run
    if reader == "pyarrow":
        columns = pytest.importorskip("pyarrow.parquet").read_table(folder / "tracks.parquet").to_pydict()
    else:
        columns = pytest.importorskip("polars").read_parquet(folder / "tracks.parquet").to_dict(as_series=False)
    for name in ("frame", "time_s", "track_id", "vx_px_per_s", "var_x_px2", "cov_vx_y_px2_per_s", "var_vy_px2_per_s2"):
        np.testing.assert_array_equal(columns[name], numbers(rows, name)[:, 0], err_msg=name)
    np.testing.assert_allclose(columns["x_px"], numbers(rows, "x_px")[:, 0], rtol=0, atol=1e-9)
    assert columns["status"] == [r["status"] for r in rows]
    assert columns["detection"] == [int(r["detection"]) if r["detection"] else None for r in rows]


def test_parquet_of_a_batch(clip, tmp_path):
    polars = pytest.importorskip("polars", reason="polars is not installed")
    boresight("batch", clip, "-o", tmp_path, "--parquet", "-q", "--", "--no-video", "--no-report")
    table = polars.read_parquet(tmp_path / "tracks.parquet")
    same = polars.read_csv(tmp_path / "tracks.csv")
    assert table["input"].unique().to_list() == [clip] and len(table) == len(same)
    np.testing.assert_array_equal(table["vx_px_per_s"], same["vx_px_per_s"])
