"""Runs other evaluation tools from the same two MOTChallenge tables; one line of a Markdown table each.

Pinned where measured: trackeval==1.3.0 motmetrics==1.4.0 trackers==2.6.1 motrics==0.3.0
python scripts/metrics_peers.py truth.txt result.txt FRAMES
Each tool that this Python has runs in a process of its own: time from the files to CLEAR + identity + HOTA, peak memory.
"""
import multiprocessing
import resource
import sys
import time
import warnings

warnings.filterwarnings("ignore")


def frames_of(path, n):
    import numpy as np
    try:
        import pandas as pd
        a = pd.read_csv(path, header=None, usecols=range(6)).to_numpy(float)
    except ImportError:
        a = np.loadtxt(path, delimiter=",", usecols=range(6))
    a = a[np.argsort(a[:, 0], kind="stable")]
    c = np.searchsorted(a[:, 0], np.arange(1, n + 2))
    return [(a[c[k]:c[k + 1], 1].astype(int), a[c[k]:c[k + 1], 2:6]) for k in range(n)]


def corners(b):
    import numpy as np
    return np.concatenate([b[:, :2], b[:, :2] + b[:, 2:]], 1)


def trackeval(t, r, n):
    import contextlib
    import io

    import numpy as np
    import trackeval as te
    from trackeval.datasets._base_dataset import _BaseDataset
    g, q = frames_of(t, n), frames_of(r, n)
    gu, tu = np.unique(np.concatenate([x[0] for x in g])), np.unique(np.concatenate([x[0] for x in q]))
    d = {"num_gt_dets": sum(len(x[0]) for x in g), "num_tracker_dets": sum(len(x[0]) for x in q), "num_gt_ids": len(gu), "num_tracker_ids": len(tu),
         "num_timesteps": n, "gt_ids": [np.searchsorted(gu, x[0]) for x in g], "tracker_ids": [np.searchsorted(tu, x[0]) for x in q], "seq": "s",
         "similarity_scores": [_BaseDataset._calculate_box_ious(a[1], b[1], box_format="xywh") for a, b in zip(g, q)]}
    with contextlib.redirect_stdout(io.StringIO()):
        c = te.metrics.CLEAR({"PRINT_CONFIG": False}).eval_sequence(d)
        i = te.metrics.Identity({"PRINT_CONFIG": False}).eval_sequence(d)
        h = te.metrics.HOTA().eval_sequence(d)
    return c["MOTA"], i["IDF1"], float(np.mean(h["HOTA"]))


def motmetrics(t, r, n):
    import motmetrics as mm
    import numpy as np
    acc = mm.MOTAccumulator(auto_id=True)
    for (gi, gb), (ti, tb) in zip(frames_of(t, n), frames_of(r, n)):
        d = 1 - mm.distances.boxiou(gb[:, None], tb[None, :]) if len(gi) and len(ti) else np.empty((0, 0))
        acc.update(gi, ti, np.where(d > 0.5, np.nan, d))
    s = mm.metrics.create().compute(acc, metrics=["mota", "idf1"], name="s", return_dataframe=False)
    return float(s["mota"]), float(s["idf1"]), float("nan")


def trackers(t, r, n):
    import numpy as np
    import trackers.eval as te
    g, q = frames_of(t, n), frames_of(r, n)
    gi, ti = [x[0] for x in g], [x[0] for x in q]
    s = [te.box_iou(corners(a[1]), corners(b[1])) for a, b in zip(g, q)]
    c, i, h = te.compute_clear_metrics(gi, ti, s), te.compute_identity_metrics(gi, ti, s), te.compute_hota_metrics(gi, ti, s)
    return c["MOTA"], i["IDF1"], float(np.mean(h["HOTA"]))


def motrics(t, r, n):
    import motrics as m
    from motrics import motchallenge as f
    gi, gb, ti, tb = f.align_frames(f.load_motchallenge(t), f.load_motchallenge(r))
    e = m.evaluate(m.Frames(gi, gb), m.Frames(ti, tb))
    return e.clear.mota, e.identity.idf1, e.hota.hota


def one(name, t, r, n, out):
    begin = time.perf_counter()
    v = globals()[name](t, r, n)
    out.put((time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, v))


def main():
    t, r, n = sys.argv[1], sys.argv[2], int(sys.argv[3])
    for name in ("trackeval", "motmetrics", "trackers", "motrics"):
        try:
            __import__(name)
        except ImportError:
            continue
        best = None
        for _ in range(2):
            q = multiprocessing.Queue()
            p = multiprocessing.Process(target=one, args=(name, t, r, n, q))
            p.start()
            p.join(300)
            if p.is_alive() or p.exitcode:
                p.kill()
                break
            v = q.get()
            best = v if best is None or v[0] < best[0] else best
        if best is None:
            print(f"| {name} | failed or over 300 s | | | | |")
        else:
            print(f"| {name} | {best[0]:.3f} | {best[1]:.0f} | " + " | ".join(f"{x:.6f}" for x in best[2]) + " |")


if __name__ == "__main__":
    main()
