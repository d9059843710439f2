//! Golden vectors of the accuracy bounds (`docs/theory/measures.md`).

use super::{golden, list, num, rows};
use boresight_filters::bounds::{PosteriorBound, RoundedPosterior, no_prior_rmspe};

#[test]
fn the_bounds_are_the_golden_ones() {
    let g = golden("bounds");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        // The golden interval of velocities: 1 ± 0.5 px a scan.
        let mut exact = RoundedPosterior::new(0.5, 1.5).unwrap();
        let r = num(&inp["r"]);
        let mut bound = PosteriorBound::new(num(&inp["p0"]), num(&inp["v0"]), r, num(&inp["q"])).unwrap();
        let n = list(&inp["n"]);
        assert!(rows(&out["exact"]) == n.len() && rows(&out["pcrlb"]) == n.len(), "case {i}: lengths");
        for (k, z) in n.iter().enumerate() {
            let (x, v) = exact.observe(*z).unwrap();
            g.close(i, "exact x", x, num(&out["exact"][k][0]));
            g.close(i, "exact v", v, num(&out["exact"][k][1]));
            let (p, pv) = bound.scan();
            g.close(i, "pcrlb x", p, num(&out["pcrlb"][k][0]));
            g.close(i, "pcrlb v", pv, num(&out["pcrlb"][k][1]));
        }
        g.close(i, "no prior", no_prior_rmspe(n.len(), r), num(&out["rmspe_no_prior"]));
    }
}
