"""motrics (PyPI 0.3.0, Rust) as a peer in the comparison's measures of long sequences, with metrics.json beside it."""
import numpy as np


class Motrics:
    def load(self, inputs, params):
        import motrics
        self.m, self.frames = motrics, params["frames"]
        self.g, self.t = (self.split(np.load(inputs[k])) for k in ("gt", "tr"))

    def split(self, a):
        c = np.searchsorted(a[:, 0], np.arange(self.frames + 1))
        ids = [a[c[k]:c[k + 1], 1].astype(int).tolist() for k in range(self.frames)]
        return self.m.Frames(ids, [np.ascontiguousarray(a[c[k]:c[k + 1], 2:6]) for k in range(self.frames)])

    def run(self):
        e = self.m.evaluate(self.g, self.t)
        switches = next((getattr(e.clear, n) for n in ("id_switches", "idsw", "num_switches") if hasattr(e.clear, n)), np.nan)
        self.v = [e.clear.mota, e.identity.idf1, e.hota.hota, switches]

    def units(self):
        return float(self.frames)

    def result(self):
        return np.array([self.v], float)
