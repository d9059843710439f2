"""Every format that `track --also` and `convert` write, read back by a reader that others wrote.

Needs the command, named by the variable BORESIGHT, and a reader a format: `.ci/run` brings them all.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess

import numpy as np
import pytest

ALSO = "geff,trackmate-xml,cvat,mot-zip,napari,mcap,vmti"
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


@pytest.fixture(scope="module")
def annotations(run):
    """Messages of the log by topic: times in ns and what JSON holds."""
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    messages = {}
    with open(run[0] / "tracks.mcap", "rb") as file:
        log = reader.make_reader(file, validate_crcs=True)
        assert log.get_header().library.startswith("boresight ")
        counts = log.get_summary().statistics
        for schema, channel, message in log.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json") and json.loads(schema.data)["title"] == schema.name
            messages.setdefault((channel.topic, schema.name), []).append((message.log_time, json.loads(message.data)))
        # By the index: the second half alone.
        middle = (counts.message_start_time + counts.message_end_time) // 2
        later = sum(1 for _ in log.iter_messages(topics="/tracks", starting_at=middle))
    assert counts.message_count == sum(map(len, messages.values())) and counts.chunk_count > 0
    told = messages["/tracks", "boresight.Tracks"]
    assert later == sum(t >= middle for t, _ in told) and 0 < later < len(told)
    return messages["/annotations", "foxglove.ImageAnnotations"], told


def test_mcap_holds_all_numbers(run, annotations):
    _, rows = run
    told = [(t, m["frame"], track) for t, m in annotations[1] for track in m["tracks"]]
    table = numbers(rows, "frame", "track_id", "vx_px_per_s", "var_x_px2", "cov_x_y_px2", "var_vy_px2_per_s2")
    found = [[f, k["id"], k["vx_px_per_s"], k["covariance"][0], k["position_covariance_px2"][1], k["covariance"][15]] for _, f, k in told]
    np.testing.assert_array_equal(np.array(found), table)
    centres = np.array([[k["x_px"], k["y_px"], k["width_px"]] for _, _, k in told])
    np.testing.assert_allclose(centres, numbers(rows, "x_px", "y_px", "width_px"), rtol=0, atol=1e-9)
    np.testing.assert_allclose([t * 1e-9 for t, _, _ in told], numbers(rows, "time_s")[:, 0], rtol=0, atol=1e-9)
    assert [k["status"] for _, _, k in told] == [r["status"] for r in rows]


def test_mcap_is_what_foxglove_knows(run, annotations):
    pytest.importorskip("foxglove_schemas_protobuf", reason="foxglove-schemas-protobuf is not installed")
    from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
    from google.protobuf.json_format import ParseDict

    def protobuf(value):
        """The same in the JSON of Protocol Buffers, which writes times as text."""
        if isinstance(value, dict) and value.keys() == {"sec", "nsec"}:
            return f"{np.datetime64(value['sec'], 's')}.{value['nsec']:09}Z"
        if isinstance(value, dict):
            return {k: protobuf(v) for k, v in value.items()}
        return [protobuf(v) for v in value] if isinstance(value, list) else value

    _, rows = run
    seen = 0
    for time_ns, message in annotations[0]:
        # A field that Foxglove's schema has not, or of another type, raises.
        drawn = ParseDict(protobuf(message), ImageAnnotations())
        assert drawn.timestamp.ToNanoseconds() == time_ns
        for text, box, ellipse in zip(drawn.texts, drawn.points[::2], drawn.points[1::2], strict=True):
            row = rows[seen]
            x, y, w, h = (float(row[n]) for n in ("x_px", "y_px", "width_px", "height_px"))
            assert text.text == row["track_id"] and box.type == box.LINE_LOOP and len(ellipse.points) == 24
            corners = np.array([[p.x, p.y] for p in box.points])
            np.testing.assert_allclose(corners.min(0), [x - w / 2 + 0.5, y - h / 2 + 0.5], atol=1e-6)
            np.testing.assert_allclose(corners.max(0), [x + w / 2 + 0.5, y + h / 2 + 0.5], atol=1e-6)
            # On its 95 % ellipse a point's squared Mahalanobis distance is that quantile of chi-square.
            cov = np.array([[row["var_x_px2"], row["cov_x_y_px2"]], [row["cov_x_y_px2"], row["var_y_px2"]]], float)
            off = np.array([[p.x, p.y] for p in ellipse.points]) - [x + 0.5, y + 0.5]
            np.testing.assert_allclose(np.einsum("ni,ij,nj->n", off, np.linalg.inv(cov), off), 5.991, rtol=1e-6)
            seen += 1
    assert seen == len(rows)


def test_vmti(run):
    pytest.importorskip("stanag4609", reason="stanag4609 is not installed")
    from stanag4609.st1402 import validate_st1402_metadata_program
    from stanag4609.transport import MetadataStreamDecoder, PESStreamEvent, PMTEvent, TransportDemuxer

    folder, rows = run
    demuxer, decoder, sets, maps = TransportDemuxer(), MetadataStreamDecoder(), [], []
    for event in demuxer.feed((folder / "vmti.ts").read_bytes()) + demuxer.finish():
        if isinstance(event, PMTEvent):
            maps += [i.code for i in validate_st1402_metadata_program(event.table)]
        if isinstance(event, PESStreamEvent):
            sets += decoder.feed(event)
    decoder.finish()
    assert set(maps) == {"motion_imagery_program"}, "all that it lacks is the video"
    times = [s.decoded.value(2).timestamp() for s in sets]
    np.testing.assert_allclose(np.array([s.pts_seconds for s in sets]) - 0.5, np.array(times) - times[0], atol=2e-5)
    found = []
    for time_s, s in zip(times, sets, strict=True):
        vmti = s.decoded.value(74)
        assert (vmti.value(8), vmti.value(9), vmti.value(6)) == (320, 256, len(vmti.targets))
        for t in vmti.targets:
            first, last = t.value(104).first_observation_time.timestamp(), t.value(104).latest_observation_time.timestamp()
            assert first <= time_s <= last or t.value(23) == 4
            assert t.value(1) == t.value(20) + (t.value(19) - 1) * 320
            found.append(
                (time_s, t.target_id, t.value(20), t.value(19), *divmod(t.value(2) - 1, 320), *divmod(t.value(3) - 1, 320), t.value(23))
            )
    found = np.array(found, float)
    table = numbers(rows, "time_s", "track_id", "x_px", "y_px", "width_px", "height_px")
    assert found.shape == (len(table), 9)
    np.testing.assert_allclose(found[:, 0], table[:, 0], rtol=0, atol=1.01e-6)
    np.testing.assert_array_equal(found[:, 1], table[:, 1])
    # Pixels count from 1 and are whole.
    np.testing.assert_allclose(found[:, 2:4] - 1, table[:, 2:4], atol=0.5 + 1e-9)
    top_left, bottom_right = found[:, [5, 4]], found[:, [7, 6]]
    np.testing.assert_allclose(top_left, table[:, 2:4] - 0.5 * (table[:, 4:] - 1), atol=0.5 + 1e-9)
    np.testing.assert_allclose(bottom_right, table[:, 2:4] + 0.5 * (table[:, 4:] - 1), atol=0.5 + 1e-9)
    np.testing.assert_array_equal(found[:, 8] == 4, [r["status"] == "coasting" for r in rows])


def test_vmti_is_a_stream_of_klv_to_ffmpeg(run):
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed")
    line = ["ffprobe", "-v", "error", "-show_entries", "stream=codec_name", "-of", "csv=p=0", run[0] / "vmti.ts"]
    assert "klv" in subprocess.run(line, capture_output=True, text=True, check=True).stdout


@pytest.fixture(scope="module")
def parquet(run):
    """A build without the feature says so."""
    path = run[0] / "tracks.parquet"
    line = [COMMAND, "convert", run[0] / "tracks.csv", path, "--to", "parquet"]
    done = subprocess.run(line, capture_output=True, text=True)
    if "writes no Parquet" in done.stderr:
        pytest.skip("the command is built without the feature parquet")
    assert done.returncode == 0, done.stderr
    return path


@pytest.mark.parametrize("reader", ["pyarrow", "polars"])
def test_parquet(run, parquet, reader):
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


def test_parquet_of_a_batch(clip, parquet, tmp_path):
    polars = pytest.importorskip("polars", reason="polars is not installed")
    boresight("batch", clip, "-o", tmp_path, "--parquet", "-q", "--", "--no-video", "--no-report")
    table = polars.read_parquet(tmp_path / "tracks.parquet")
    same = polars.read_csv(tmp_path / "tracks.csv")
    assert table["input"].unique().to_list() == [clip] and len(table) == len(same)
    np.testing.assert_array_equal(table["vx_px_per_s"], same["vx_px_per_s"])


def test_detections_in_coco_by_another_writer(run, tmp_path):
    dm = pytest.importorskip("datumaro", reason="datumaro is not installed")
    boxes = {k: [(1.5 + k, 2.0, 4.0, 6.25, 0.5 + k / 10), (20.0, 10.0, 3.0, 3.0, 0.75)] for k in range(4)}
    items = [
        dm.DatasetItem(
            id=f"f{k}",
            attributes={"id": k + 1},
            media=dm.Image.from_numpy(np.zeros((20, 30, 3), np.uint8)),
            annotations=[dm.Bbox(*b[:4], label=i, id=2 * k + i + 1, attributes={"score": b[4]}) for i, b in enumerate(boxes[k])],
        )
        for k in boxes
    ]
    dm.Dataset.from_iterable(items, categories=["car", "person"]).export(str(tmp_path / "d"), "coco_instances", save_media=False)
    (table,) = (tmp_path / "d/annotations").glob("*.json")
    boresight("track", table, "-o", tmp_path / "out", "--rate-hz", "10", "--no-report")
    with open(tmp_path / "out/detections.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    want = [(k, x + w / 2 - 0.5, y + h / 2 - 0.5, w, h, s) for k, found in boxes.items() for x, y, w, h, s in found]
    found = numbers(rows, "frame", "x_px", "y_px", "width_px", "height_px", "score")
    np.testing.assert_allclose(found, want, atol=1e-6)
