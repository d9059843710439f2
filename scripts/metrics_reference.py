"""Makes the references of the evaluation tests: crates/boresight/tests/data/metrics_*.csv

Needs (pip, pinned): trackeval==1.3.0 motmetrics==1.4.0 stonesoup==1.9.1 scipy==1.17.1 numpy==2.4.6
Run from the repository: python scripts/metrics_reference.py

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


def text(v):
    v = float(v)
    return "" if math.isnan(v) else str(v) if math.isinf(v) else str(int(v)) if v == int(v) else f"{v:.12g}"


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    for name, score in (("trackeval", trackeval_scores), ("motmetrics", motmetrics_scores), ("stonesoup", stonesoup_scores)):
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


if __name__ == "__main__":
    main()
