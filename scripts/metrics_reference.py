"""Makes the references of the evaluation tests: crates/boresight/tests/data/metrics_*.csv

Needs (pip, pinned): trackeval==1.3.0 motmetrics==1.4.0 stonesoup==1.9.1 py-ctcmetrics==1.3.3 scipy==1.17.1 numpy==2.4.6
Run from the repository: python scripts/metrics_reference.py [NAME ..]; kitti needs the test data (BORESIGHT_TEST_DATA).

The scenes are drawn by a small generator that the tests repeat in Rust, number by number; only its answers are stored.
"""
import contextlib
import csv
import io
import math
import sys
import warnings
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

warnings.filterwarnings("ignore")
OUT = Path(__file__).resolve().parent.parent / "crates/boresight/tests/data"
N_SCENES = 1000


class Lcg:
    """x <- 6364136223846793005 x + 1442695040888963407 mod 2^64; a draw below n is (x >> 33) mod n."""

    def __init__(self, seed):
        self.x = (seed * 2654435761 + 1) % 2**64
        for _ in range(3):
            self.next(2)

    def next(self, n):
        self.x = (self.x * 6364136223846793005 + 1442695040888963407) % 2**64
        return (self.x >> 33) % n


def scene(seed):
    """Rows (frame, id, [left, top, width, height]) of truth and result, and the number of frames."""
    r = Lcg(seed)
    kind = seed % 4
    frames = 1 if seed % 25 == 7 else 1 + r.next(12)
    n = 8 + r.next(6) if kind == 3 else r.next(7)
    step = 10 if kind == 0 else 1
    span = 12 if kind == 0 else 100
    scale = (lambda v: v / 7.0) if kind == 2 else (lambda v: float(v))
    x0 = [(r.next(span) * step, r.next(span) * step) for _ in range(n)]
    v = [((r.next(3) - 1) * step, (r.next(3) - 1) * step) for _ in range(n)]
    size = [(20, 40) if kind == 0 else (20 + r.next(20), 30 + r.next(20)) for _ in range(n)]
    owner = list(range(n))
    fresh = 300
    truth, result = [], []
    for f in range(frames):
        if n > 1 and r.next(6) == 0:
            a, b = r.next(n), r.next(n)
            owner[a], owner[b] = owner[b], owner[a]
        if n > 0 and r.next(8) == 0:
            owner[r.next(n)] = fresh
            fresh += 1
        silent = r.next(9) == 0
        for g in range(n):
            if r.next(10) == 0:
                continue
            x, y = x0[g][0] + v[g][0] * f, x0[g][1] + v[g][1] * f
            truth.append((f, g + 1, [scale(x), scale(y), scale(size[g][0]), scale(size[g][1])]))
            hit, dx, dy = r.next(10), (r.next(5) - 2) * step // (2 if kind == 0 else 1), (r.next(5) - 2) * step // (2 if kind == 0 else 1)
            if silent or hit < 2:
                continue
            result.append((f, owner[g], [scale(x + dx), scale(y + dy), scale(size[g][0]), scale(size[g][1])]))
            if r.next(8) == 0:
                result.append((f, 100 + g, [scale(x), scale(y), scale(size[g][0]), scale(size[g][1])]))
        if not silent and r.next(3) == 0:
            result.append((f, 200 + r.next(4), [scale(r.next(span) * step), scale(r.next(span) * step), scale(20), scale(40)]))
    if seed % 37 == 0:
        result = []
    if seed % 41 == 0:
        truth = []
    return truth, result, frames


def by_frame(rows, frames):
    ids = sorted({i for _, i, _ in rows})
    rank = {i: k for k, i in enumerate(ids)}
    i = [np.array([rank[r[1]] for r in rows if r[0] == f], int) for f in range(frames)]
    b = [np.array([r[2] for r in rows if r[0] == f], float).reshape(-1, 4) for f in range(frames)]
    return i, b, len(ids)


def trackeval_scores(truth, result, frames):
    import trackeval
    from trackeval.datasets._base_dataset import _BaseDataset
    gi, gb, ng = by_frame(truth, frames)
    ti, tb, nt = by_frame(result, frames)
    data = {"num_gt_dets": len(truth), "num_tracker_dets": len(result), "num_gt_ids": ng, "num_tracker_ids": nt, "num_timesteps": frames,
            "gt_ids": gi, "tracker_ids": ti, "seq": "s", "similarity_scores": [_BaseDataset._calculate_box_ious(a, b, box_format="xywh") for a, b in zip(gb, tb)]}
    with contextlib.redirect_stdout(io.StringIO()):
        c = trackeval.metrics.CLEAR({"PRINT_CONFIG": False}).eval_sequence(data)
        i = trackeval.metrics.Identity({"PRINT_CONFIG": False}).eval_sequence(data)
        h = trackeval.metrics.HOTA().eval_sequence(data)
    out = {k: c[k] for k in ("CLR_TP", "CLR_FN", "CLR_FP", "IDSW", "MT", "PT", "ML", "Frag", "MOTA", "MOTP", "sMOTA", "MOTAL", "MLR")}
    out |= {k: i[k] for k in ("IDTP", "IDFN", "IDFP", "IDF1")}
    out |= {k: float(np.mean(h[k])) for k in ("HOTA", "DetA", "AssA", "AssRe", "AssPr", "LocA", "OWTA")}
    out |= {"HOTA50": h["HOTA"][9], "AssA80": h["AssA"][15], "HOTA(0)": h["HOTA(0)"], "LocA(0)": h["LocA(0)"]}
    return out


def motmetrics_scores(truth, result, frames):
    import motmetrics as mm
    gi, gb, _ = by_frame(truth, frames)
    ti, tb, _ = by_frame(result, frames)
    acc = mm.MOTAccumulator(auto_id=True)
    for a, x, b, y in zip(gi, gb, ti, tb):
        if len(a) and len(b):
            d = 1 - mm.distances.boxiou(x[:, None], y[None, :])
            d = np.where(d > 0.5, np.nan, d)
        else:
            d = np.empty((0, 0))
        acc.update(a, b, d)
    names = {"num_matches": "mm_matches", "num_switches": "mm_switches", "num_misses": "mm_misses", "num_false_positives": "mm_fp", "num_fragmentations": "mm_frag",
             "mostly_tracked": "mm_mt", "partially_tracked": "mm_pt", "mostly_lost": "mm_ml", "num_transfer": "mm_transfer", "num_ascend": "mm_ascend",
             "num_migrate": "mm_migrate", "mota": "mm_mota", "motp": "mm_motp", "idf1": "mm_idf1"}
    r = mm.metrics.create().compute(acc, metrics=list(names), name="s", return_dataframe=False)
    return {names[k]: float(v) for k, v in r.items() if k in names}


def stonesoup_scores(truth, result, frames):
    """Mean over the frames that hold anything of OSPA, GOSPA and its parts, of the left-top corners; SIAP of the nearest-truth associations."""
    from stonesoup.measures import Euclidean
    from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
    from stonesoup.metricgenerator.tracktotruthmetrics import SIAPMetrics
    from stonesoup.metricgenerator.manager import MultiManager
    from stonesoup.types.association import AssociationSet, TimeRangeAssociation
    from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
    from stonesoup.types.state import State
    from stonesoup.types.time import TimeRange
    from stonesoup.types.track import Track
    t0 = datetime(2026, 1, 1)
    out = {}
    for name, p, c in (("1", 1, 30.0), ("2", 2, 12.0), ("3", 3, 20.0)):
        o, g = OSPAMetric(p=p, c=c, measure=Euclidean()), GOSPAMetric(p=p, c=c, measure=Euclidean())
        sums = np.zeros(5)
        used = 0
        for f in range(frames):
            mk = lambda rows: [State(np.array([[b[0]], [b[1]]]), timestamp=t0) for k, _, b in rows if k == f]
            a, b = mk(result), mk(truth)
            if not a and not b:
                continue
            used += 1
            ospa = o.compute_OSPA_distance(a, b).value
            gm = g.compute_gospa_metric(a, b)[0].value
            sums += [ospa, gm["distance"], gm["localisation"], gm["missed"], gm["false"]]
        for k, v in zip(("ospa", "gospa", "loc", "missed", "false"), sums):
            out[f"{k}{name}"] = v / max(used, 1)
    tracks, truths = {}, {}
    for rows, store, path, state in ((truth, truths, GroundTruthPath, GroundTruthState), (result, tracks, Track, State)):
        for f, i, b in rows:
            store.setdefault(i, path([])).append(state(np.array([[b[0]], [b[1]], [b[2]], [b[3]]]), timestamp=t0 + timedelta(seconds=f)))
    runs = {}
    near = {}
    for f, i, b in result:
        best = None
        for k, j, q in truth:
            if k == f:
                d = math.hypot(b[0] - q[0], b[1] - q[1])
                if d <= 15.0 and (best is None or d < best[0]):
                    best = (d, j)
        if best:
            near[(f, i)] = best[1]
    assocs = []
    for i in sorted(tracks):
        fs = sorted(f for f, k in near if k == i)
        begin = None
        for n, f in enumerate(fs):
            if begin is None:
                begin = f
            go_on = n + 1 < len(fs) and fs[n + 1] == f + 1 and near[(fs[n + 1], i)] == near[(f, i)]
            if not go_on:
                # Stone Soup knows no time range of a single instant.
                if f > begin:
                    assocs.append(TimeRangeAssociation({tracks[i], truths[near[(f, i)]]}, time_range=TimeRange(t0 + timedelta(seconds=begin), t0 + timedelta(seconds=f))))
                begin = None
    if truth and result and len({f for f, _, _ in truth + result}) > 1:
        m = MultiManager([])
        m.add_data({"groundtruth_paths": set(truths.values()), "tracks": set(tracks.values())})
        m.association_set = AssociationSet(set(assocs))
        s = SIAPMetrics(position_measure=Euclidean((0, 1)), velocity_measure=Euclidean((2, 3)))
        r = s.compute_metric(m)
        for k, v in zip(("siap_c", "siap_a", "siap_s", "siap_pa", "siap_va", "siap_r", "siap_ls"), r):
            out[k] = float(v.value)
    else:
        out |= {k: float("nan") for k in ("siap_c", "siap_a", "siap_s", "siap_pa", "siap_va", "siap_r", "siap_ls")}
    return out


def trajectory_scores(truth, result, frames):
    """Trajectory GOSPA (linear programming metric) as the paper writes it, of the left-top corners, by scipy's HiGHS."""
    from scipy.optimize import linprog
    from scipy.sparse import coo_matrix
    ti, ri = sorted({i for _, i, _ in truth}), sorted({i for _, i, _ in result})
    n, m = len(ti), len(ri)
    at = lambda rows: {(f, i): b[:2] for f, i, b in rows}
    a, b = at(truth), at(result)
    out = {}
    for name, p, c, g in (("a", 1, 20.0, 2.0), ("b", 2, 30.0, 9.0), ("c", 2, 12.0, 40.0)):
        half = c**p / 2
        # Unknowns in frame k: W[i, j] of (n + 1) x (m + 1), the last row and column are the dummies; then e[i, j] >= |change|.
        nw = (n + 1) * (m + 1)
        w = lambda k, i, j: k * nw + i * (m + 1) + j
        e = lambda k, i, j: frames * nw + k * n * m + i * m + j
        cost = np.zeros(frames * nw + (frames - 1) * n * m)
        eq, eqb, ub = [], [], []
        for k in range(frames):
            for i in range(n + 1):
                for j in range(m + 1):
                    x = a.get((k, ti[i])) if i < n else None
                    y = b.get((k, ri[j])) if j < m else None
                    if x is not None and y is not None:
                        cost[w(k, i, j)] = min(math.hypot(x[0] - y[0], x[1] - y[1]), c) ** p
                    elif x is not None or y is not None:
                        cost[w(k, i, j)] = half
            for i in range(n):
                eq.append([(w(k, i, j), 1) for j in range(m + 1)])
            for j in range(m):
                eq.append([(w(k, i, j), 1) for i in range(n + 1)])
            if k + 1 < frames:
                for i in range(n):
                    for j in range(m):
                        cost[e(k, i, j)] = g**p / 2
                        ub.append([(w(k + 1, i, j), 1), (w(k, i, j), -1), (e(k, i, j), -1)])
                        ub.append([(w(k + 1, i, j), -1), (w(k, i, j), 1), (e(k, i, j), -1)])
        if not eq:
            out[f"tgospa_{name}"] = 0.0
            continue
        mat = lambda rows: coo_matrix(([v for r in rows for _, v in r], ([q for q, r in enumerate(rows) for _ in r], [c_ for r in rows for c_, _ in r])), (len(rows), len(cost))).tocsr()
        r = linprog(cost, mat(ub) if ub else None, np.zeros(len(ub)) if ub else None, mat(eq), np.ones(len(eq)), method="highs-ds")
        assert r.status == 0, r.message
        out[f"tgospa_{name}"] = max(r.fun, 0.0) ** (1 / p)
    return out


def centre_scores(truth, result, frames):
    """TrackEval with the similarity of centres, 0 from 40 px on."""
    import trackeval
    from trackeval.datasets._base_dataset import _BaseDataset
    gi, gb, ng = by_frame(truth, frames)
    ti, tb, nt = by_frame(result, frames)
    centres = lambda b: b[:, :2] + b[:, 2:] / 2
    data = {"num_gt_dets": len(truth), "num_tracker_dets": len(result), "num_gt_ids": ng, "num_tracker_ids": nt, "num_timesteps": frames,
            "gt_ids": gi, "tracker_ids": ti, "seq": "s",
            "similarity_scores": [_BaseDataset._calculate_euclidean_similarity(centres(a), centres(b), zero_distance=40.0) for a, b in zip(gb, tb)]}
    with contextlib.redirect_stdout(io.StringIO()):
        c = trackeval.metrics.CLEAR({"PRINT_CONFIG": False}).eval_sequence(data)
        i = trackeval.metrics.Identity({"PRINT_CONFIG": False}).eval_sequence(data)
        h = trackeval.metrics.HOTA().eval_sequence(data)
    return {"CLR_TP": c["CLR_TP"], "IDSW": c["IDSW"], "Frag": c["Frag"], "MOTA": c["MOTA"], "MOTP": c["MOTP"], "IDF1": i["IDF1"],
            "HOTA": float(np.mean(h["HOTA"])), "DetA": float(np.mean(h["DetA"])), "AssA": float(np.mean(h["AssA"])), "LocA": float(np.mean(h["LocA"]))}


def kitti_result(labels, detections, seed):
    """A result for KITTI labels: shaken truths, some lost or renamed, and the detections as tracks of 20 frames."""
    r = Lcg(seed)
    out = []
    for line in labels:
        f = line.split()
        if f[2] == "DontCare" or r.next(10) == 0:
            continue
        box = [math.floor(float(v)) + r.next(9) - 4 for v in f[6:10]]
        name = "Car" if f[2] in ("Car", "Van", "Truck") else "Pedestrian"
        out.append((int(f[0]), int(f[1]) + (100 if int(f[0]) % 40 > 30 else 0), name, box))
    n = {}
    for line in detections:
        f = line.split(",")
        k = n[f[0]] = n.get(f[0], 0) + 1
        out.append((int(f[0]), 1000 + 20 * (int(f[0]) // 20) + k, "Car" if f[1] == "2" else "Pedestrian", [math.floor(float(v)) for v in f[2:6]]))
    return [f"{f} {i} {name} 0 0 0 {b[0]} {b[1]} {b[2]} {b[3]} 1 1 1 0 0 0 0 1" for f, i, name, b in out]


def kitti_scores():
    """TrackEval's KITTI kit on the two labelled sequences of the test data."""
    import os
    import tempfile
    import trackeval
    data = Path(os.environ.get("BORESIGHT_TEST_DATA", OUT.parents[3] / "../shared/data")) / "kitti_ab3dmot"
    for seq in ("0006", "0012"):
        labels = (data / f"{seq}_label.txt").read_text().splitlines()
        detections = [l for c in ("Car", "Pedestrian") for l in (data / f"{seq}_det_{c}.txt").read_text().splitlines()]
        n = 1 + max(int(l.split()[0]) for l in labels)
        with tempfile.TemporaryDirectory() as d:
            d = Path(d)
            (d / "gt/label_02").mkdir(parents=True)
            (d / "t/mine/data").mkdir(parents=True)
            (d / "gt/evaluate_tracking.seqmap.training").write_text(f"{seq} empty 000000 {n:06d}\n")
            (d / f"gt/label_02/{seq}.txt").write_text("\n".join(labels) + "\n")
            (d / f"t/mine/data/{seq}.txt").write_text("\n".join(kitti_result(labels, detections, int(seq))) + "\n")
            with contextlib.redirect_stdout(io.StringIO()):
                kit = trackeval.datasets.Kitti2DBox({"GT_FOLDER": str(d / "gt"), "TRACKERS_FOLDER": str(d / "t"), "PRINT_CONFIG": False})
                raw = kit.get_raw_seq_data("mine", seq)
                for cls in ("car", "pedestrian"):
                    x = kit.get_preprocessed_seq_data(raw, cls)
                    c = trackeval.metrics.CLEAR({"PRINT_CONFIG": False}).eval_sequence(x)
                    i = trackeval.metrics.Identity({"PRINT_CONFIG": False}).eval_sequence(x)
                    h = trackeval.metrics.HOTA().eval_sequence(x)
                    yield {"sequence": seq, "class": cls, **{k: c[k] for k in ("CLR_TP", "CLR_FN", "CLR_FP", "IDSW", "Frag", "MT", "ML", "MOTA", "MOTP")},
                           **{k: i[k] for k in ("IDTP", "IDF1")}, **{k: float(np.mean(h[k])) for k in ("HOTA", "DetA", "AssA", "LocA")}}


SIDE = 24


def cell_scene(seed):
    """Cells on a grid of 4 x 4 places: (label, begin, end, parent, boxes (x, y, w, h)) of truth and result, and the number of frames."""
    r = Lcg(seed)
    frames = 2 + r.next(4)
    truth, busy = [], set()
    label = 1
    for place in range(16):
        if place in busy or r.next(3) == 0:
            continue
        w, h = 3 + r.next(3), 3 + r.next(3)
        begin = r.next(frames)
        end = begin + r.next(frames - begin)
        truth.append((label, begin, end, 0, [(6 * (place % 4), 6 * (place // 4), w, h)]))
        parent = label
        label += 1
        if end + 1 < frames and place % 4 < 2 and r.next(2) == 0:
            for k in (1, 2):
                busy.add(place + k)
                truth.append((label, end + 1, end + 1 + r.next(frames - end - 1), parent, [(6 * ((place + k) % 4), 6 * (place // 4), 4, 4)]))
                label += 1
    result, name, label, merged = [], {}, 50, set()
    for k, (t, begin, end, parent, boxes) in enumerate(truth):
        what = r.next(8)
        dx, dy = r.next(3) - 1, r.next(3) - 1
        x, y, w, h = boxes[0]
        box = (max(x + dx, 0), max(y + dy, 0), w, h)
        if t in merged or what == 0:
            continue
        if what == 1 and end > begin:
            middle = begin + r.next(end - begin)
            result.append((label, begin, middle, name.get(parent, 0), [box]))
            result.append((label + 1, middle + 1, end, label if r.next(2) == 0 else 0, [box]))
            name[t] = label + 1
            label += 2
            continue
        own = [box]
        if what == 2 and k + 1 < len(truth) and truth[k + 1][1:3] == (begin, end):
            own.append(truth[k + 1][4][0])
            merged.add(truth[k + 1][0])
        result.append((label, begin, end, name.get(parent, 0) if r.next(4) > 0 else 0, own))
        name[t] = label
        label += 1
    if r.next(2) == 0:
        result.append((label, 0, 0, 0, [(21, 21, 2, 2)]))
    return truth, result, frames


def cell_images(cells, frames):
    out = np.zeros((frames, SIDE, SIDE), np.uint16)
    for label, begin, end, _, boxes in cells:
        for x, y, w, h in boxes:
            out[begin:end + 1, y:y + h, x:x + w] = label
    return out


def cell_scores():
    """py-ctcmetrics on small folders."""
    import tempfile
    import tifffile
    from ctc_metrics.scripts.evaluate import evaluate_sequence
    for seed in range(200):
        truth, result, frames = cell_scene(seed)
        if not truth or not result:
            continue
        with tempfile.TemporaryDirectory() as d:
            d = Path(d)
            (d / "GT/TRA").mkdir(parents=True)
            (d / "GT/SEG").mkdir(parents=True)
            (d / "RES").mkdir()
            # Later cells are drawn over earlier ones; a label that vanishes would make the folder invalid.
            a, b = cell_images(truth, frames), cell_images(result, frames)
            lines = lambda cells: "".join(f"{l} {s} {e} {p}\n" for l, s, e, p, _ in cells)
            if any(not (b[f] == l).any() for l, s, e, _, _ in result for f in range(s, e + 1)):
                continue
            (d / "GT/TRA/man_track.txt").write_text(lines(truth))
            (d / "RES/res_track.txt").write_text(lines(result))
            for f in range(frames):
                tifffile.imwrite(d / f"GT/TRA/man_track{f:03d}.tif", a[f])
                tifffile.imwrite(d / f"RES/mask{f:03d}.tif", b[f])
            with contextlib.redirect_stdout(io.StringIO()):
                s = evaluate_sequence(str(d / "RES"), str(d / "GT"), ["DET", "TRA"], 1)
            assert s["DET"] is not None and s["TRA"] is not None, seed
            yield {"seed": seed, "det": s["DET"], "tra": s["TRA"]}


def text(v):
    v = float(v)
    return "" if math.isnan(v) else str(v) if math.isinf(v) else str(int(v)) if v == int(v) else f"{v:.12g}"


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    for name, score in (("trackeval", trackeval_scores), ("motmetrics", motmetrics_scores), ("stonesoup", stonesoup_scores), ("trajectory", trajectory_scores), ("centre", centre_scores)):
        if len(sys.argv) > 1 and name not in sys.argv[1:]:
            continue
        with open(OUT / f"metrics_{name}.csv", "w", newline="") as f:
            w = None
            for seed in range(N_SCENES):
                row = score(*scene(seed))
                if w is None:
                    w = csv.writer(f, lineterminator="\n")
                    w.writerow(["seed", *row])
                w.writerow([seed, *(text(v) for v in row.values())])


def tables():
    """References that are not one row a random scene."""
    for name, rows in (("kitti", kitti_scores), ("cells", cell_scores)):
        if len(sys.argv) > 1 and name not in sys.argv[1:]:
            continue
        rows = list(rows())
        with open(OUT / f"metrics_{name}.csv", "w", newline="") as f:
            w = csv.writer(f, lineterminator="\n")
            w.writerow(rows[0])
            for row in rows:
                w.writerow([v if isinstance(v, str) else text(v) for v in row.values()])


if __name__ == "__main__":
    main()
    tables()
