//! Association cost beside position: what a pair costs because size, intensity, class or box do not fit.
//!
//! Each term is added to d² and is the same in kind: the square of a deviation in standard deviations. Size and
//! intensity compare logarithms (a ratio of two is as far up as down). Overlap costs `weight · (1 − IoU)`, with boxes
//! grown by a buffer for small fast targets (F. Yang et al., "Hard to track objects with irregular motions and similar
//! appearances? Make it easier by buffering the matching space", WACV 2023); GIoU as H. Rezatofighi et al., CVPR 2019.
//! Limits: a detector that gives no boxes or sums must leave those terms out.

use super::appearance::Appearance;
use crate::validate::{check, not_negative, positive};
use crate::{Detection, Extent, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a pair costs beside position; all terms are left out by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct AssociationCostConfig {
    /// Standard deviation of ln(width) and ln(height) from scan to scan, above 0: 0.1 for sharp boxes, 0.3 for noisy ones.
    pub size_log_std: Option<f64>,
    /// Standard deviation of ln(sum of the pixels) from scan to scan, above 0.
    pub intensity_log_std: Option<f64>,
    /// Cost when classes differ, 0 or more; 100 forbids it.
    pub class_cost: Option<f64>,
    /// Box overlap.
    pub overlap: Option<OverlapConfig>,
    /// Whether the two standard deviations are learnt from the pairs made (the given ones start it).
    pub learn: bool,
}

/// Which overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OverlapKind {
    /// Intersection over union, 0..=1.
    #[default]
    Iou,
    /// Generalised: also says how far boxes lie apart, −1..=1.
    Giou,
}

/// Box overlap as a term of association.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct OverlapConfig {
    /// `iou` or `giou`.
    pub kind: OverlapKind,
    /// Cost at no overlap, 0 or more (at full overlap it is 0).
    pub weight: f64,
    /// Pairs that overlap less are not made; 0..1 for `iou`, −1..1 for `giou`.
    pub min_overlap: f64,
    /// Both boxes are grown by this share of their size on each side, 0 or more.
    pub buffer: f64,
}

impl Default for OverlapConfig {
    fn default() -> Self {
        Self { kind: OverlapKind::Iou, weight: 10.0, min_overlap: 0.1, buffer: 0.0 }
    }
}

impl AssociationCostConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if let Some(v) = self.size_log_std {
            positive(at, "size-log-std", v, "0.1 for sharp boxes, 0.3 for noisy ones")?;
        }
        if let Some(v) = self.intensity_log_std {
            positive(at, "intensity-log-std", v, "0.3 suits a steady target")?;
        }
        if let Some(v) = self.class_cost {
            not_negative(at, "class-cost", v, "100 forbids a change of class")?;
        }
        if let Some(o) = &self.overlap {
            let at = format!("{at}.overlap");
            not_negative(&at, "weight", o.weight, "10 weighs as much as a gate")?;
            not_negative(&at, "buffer", o.buffer, "0.3 for small fast boxes")?;
            let low = if o.kind == OverlapKind::Iou { 0.0 } else { -1.0 };
            check(
                o.min_overlap >= low && o.min_overlap < 1.0,
                &at,
                "min-overlap",
                o.min_overlap,
                "an overlap below 1",
                "0.1 is usual",
            )?;
        }
        Ok(())
    }

    /// Whether any term is in use.
    pub fn any(&self) -> bool {
        self.size_log_std.is_some()
            || self.intensity_log_std.is_some()
            || self.class_cost.is_some()
            || self.overlap.is_some()
    }

    /// The most that gated pairs may cost beside position: three standard deviations of each term.
    pub fn budget(&self) -> f64 {
        self.size_log_std.map_or(0.0, |_| 18.0)
            + self.intensity_log_std.map_or(0.0, |_| 9.0)
            + self.class_cost.unwrap_or(0.0).min(50.0)
            + self.overlap.as_ref().map_or(0.0, |o| o.weight)
    }
}

/// The cost with the standard deviations in use now.
#[derive(Clone, Debug)]
pub struct AssociationCost {
    config: AssociationCostConfig,
    /// Variance of the log ratios of size and intensity.
    variance: [f64; 2],
}

/// Share of a new pair in a learnt variance.
const LEARNING: f64 = 0.005;

impl AssociationCost {
    /// Builds the cost.
    pub fn new(config: &AssociationCostConfig) -> Self {
        let square = |v: Option<f64>| v.unwrap_or(1.0).powi(2);
        Self { variance: [square(config.size_log_std), square(config.intensity_log_std)], config: config.clone() }
    }

    /// What the pair of a track at (`x`, `y`) and a detection costs beside position; infinite if it must not be made.
    pub fn cost(&self, x: f64, y: f64, appearance: &Appearance, d: &Detection) -> f64 {
        let c = &self.config;
        let mut cost = 0.0;
        if c.size_log_std.is_some() {
            let [w, h] = appearance.size;
            cost +=
                (log_ratio(d.extent.width_px, w).powi(2) + log_ratio(d.extent.height_px, h).powi(2)) / self.variance[0];
        }
        if c.intensity_log_std.is_some() {
            cost += log_ratio(d.sum, appearance.sum).powi(2) / self.variance[1];
        }
        if let (Some(price), Some(a), Some(b)) = (c.class_cost, appearance.class, d.class)
            && a != b
        {
            cost += price;
        }
        if let Some(o) = &c.overlap {
            let [w, h] = appearance.size;
            let own = Extent { left_px: x - 0.5 * w, top_px: y - 0.5 * h, width_px: w, height_px: h };
            let (a, b) = (grown(&own, o.buffer), grown(&d.extent, o.buffer));
            let overlap = if o.kind == OverlapKind::Iou { iou(&a, &b) } else { giou(&a, &b) };
            if overlap < o.min_overlap {
                return f64::INFINITY;
            }
            cost += o.weight * (1.0 - overlap);
        }
        cost
    }

    /// Learns from a pair that was made.
    pub fn learn(&mut self, appearance: &Appearance, d: &Detection) {
        if self.config.learn {
            let size = 0.5
                * (log_ratio(d.extent.width_px, appearance.size[0]).powi(2)
                    + log_ratio(d.extent.height_px, appearance.size[1]).powi(2));
            let sum = log_ratio(d.sum, appearance.sum).powi(2);
            for (v, new) in self.variance.iter_mut().zip([size, sum]) {
                *v = (*v + LEARNING * (new - *v)).clamp(1e-4, 4.0);
            }
        }
    }
}

fn log_ratio(a: f64, b: f64) -> f64 {
    // Nothing is known of a size of zero: no cost.
    if a > 0.0 && b > 0.0 { (a / b).ln() } else { 0.0 }
}

fn grown(e: &Extent, by: f64) -> Extent {
    Extent {
        left_px: e.left_px - by * e.width_px,
        top_px: e.top_px - by * e.height_px,
        width_px: e.width_px * (1.0 + 2.0 * by),
        height_px: e.height_px * (1.0 + 2.0 * by),
    }
}

fn sides(e: &Extent) -> [f64; 4] {
    [e.left_px, e.top_px, e.left_px + e.width_px, e.top_px + e.height_px]
}

fn shared_and_all(a: &Extent, b: &Extent) -> (f64, f64) {
    let ([al, at, ar, ab], [bl, bt, br, bb]) = (sides(a), sides(b));
    let shared = (ar.min(br) - al.max(bl)).max(0.0) * (ab.min(bb) - at.max(bt)).max(0.0);
    (shared, a.width_px * a.height_px + b.width_px * b.height_px - shared)
}

/// Intersection over union of two boxes, 0..=1; 0 if both are empty.
pub fn iou(a: &Extent, b: &Extent) -> f64 {
    let (shared, all) = shared_and_all(a, b);
    if all > 0.0 { shared / all } else { 0.0 }
}

/// Generalised intersection over union, −1..=1.
pub fn giou(a: &Extent, b: &Extent) -> f64 {
    let ([al, at, ar, ab], [bl, bt, br, bb]) = (sides(a), sides(b));
    let (shared, all) = shared_and_all(a, b);
    let hull = (ar.max(br) - al.min(bl)) * (ab.max(bb) - at.min(bt));
    if all > 0.0 && hull > 0.0 { shared / all - (hull - all) / hull } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClassId;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn overlap_of_two_boxes_follows_the_definitions() {
        let a = Extent { left_px: 0.0, top_px: 0.0, width_px: 2.0, height_px: 2.0 };
        let b = Extent { left_px: 1.0, top_px: 1.0, width_px: 2.0, height_px: 2.0 };
        // Shared 1, union 7, hull 9.
        assert!((iou(&a, &b) - 1.0 / 7.0).abs() < 1e-15);
        assert!((giou(&a, &b) - (1.0 / 7.0 - 2.0 / 9.0)).abs() < 1e-15);
        assert_eq!(iou(&Extent::default(), &Extent::default()), 0.0);
    }

    /// A track of 8 x 4 px, sum 100, class 1.
    fn seen() -> Appearance {
        Appearance { size: [8.0, 4.0], sum: 100.0, class: Some(ClassId(1)) }
    }

    fn detection(width_px: f64, height_px: f64, sum: f64) -> Detection {
        let extent = Extent::around(Vector2::new(50.0, 20.0), width_px, height_px);
        let d = Detection::at(Vector2::new(50.0, 20.0), Matrix2::identity()).with_extent(extent);
        Detection { sum, class: Some(ClassId(1)), ..d }
    }

    /// What a pair of that track where the detection is costs by one term.
    fn cost(config: AssociationCostConfig, d: &Detection) -> f64 {
        AssociationCost::new(&config).cost(50.0, 20.0, &seen(), d)
    }

    #[test]
    fn each_term_is_the_square_of_its_deviations_and_they_add() {
        let size = AssociationCostConfig { size_log_std: Some(0.2), ..Default::default() };
        let intensity = AssociationCostConfig { intensity_log_std: Some(0.5), ..Default::default() };
        let class = AssociationCostConfig { class_cost: Some(7.0), ..Default::default() };
        let (twice, e) = (2f64.ln() / 0.2, std::f64::consts::E);
        // Twice as wide and a quarter as high: one and two doublings.
        assert!((cost(size.clone(), &detection(16.0, 1.0, 100.0)) - 5.0 * twice * twice).abs() < 1e-9);
        assert_eq!(cost(size.clone(), &detection(0.0, 4.0, 100.0)), 0.0, "nothing is known of a size of zero");
        assert!((cost(intensity.clone(), &detection(8.0, 4.0, 100.0 * e)) - 4.0).abs() < 1e-9, "two deviations");
        let other = Detection { class: Some(ClassId(2)), ..detection(8.0, 4.0, 100.0) };
        assert_eq!((cost(class.clone(), &other), cost(class.clone(), &detection(8.0, 4.0, 100.0))), (7.0, 0.0));
        assert_eq!(cost(class.clone(), &Detection { class: None, ..other }), 0.0);
        let all = AssociationCostConfig {
            size_log_std: size.size_log_std,
            intensity_log_std: intensity.intensity_log_std,
            class_cost: class.class_cost,
            overlap: Some(OverlapConfig { weight: 6.0, ..OverlapConfig::default() }),
            learn: false,
        };
        // Twice as wide, e times as bright, another class, half of the union shared.
        let d = Detection { class: Some(ClassId(2)), ..detection(16.0, 4.0, 100.0 * e) };
        assert!((cost(all.clone(), &d) - (twice * twice + 4.0 + 7.0 + 6.0 * 0.5)).abs() < 1e-9);
        // Three deviations of both sides and of the sum, the prices as they are.
        assert_eq!(all.budget(), 18.0 + 9.0 + 7.0 + 6.0);
        assert_eq!(AssociationCostConfig { class_cost: Some(80.0), ..all }.budget(), 18.0 + 9.0 + 50.0 + 6.0);
        assert_eq!(AssociationCostConfig::default().budget(), 0.0);
    }

    #[test]
    fn overlap_is_of_boxes_grown_on_each_side_and_too_little_forbids_the_pair() {
        let overlap = |buffer: f64, min_overlap: f64| AssociationCostConfig {
            overlap: Some(OverlapConfig { kind: OverlapKind::Iou, weight: 10.0, min_overlap, buffer }),
            ..Default::default()
        };
        // 8 x 4 px six px further right: 2 of 14 px are shared; grown by half on each side 16 px wide, 10 of 22.
        let at = |buffer, min| {
            AssociationCost::new(&overlap(buffer, min)).cost(44.0, 20.0, &seen(), &detection(8.0, 4.0, 1.0))
        };
        assert!((at(0.0, 0.0) - 10.0 * (1.0 - 2.0 / 14.0)).abs() < 1e-12);
        assert!((at(0.5, 0.0) - 10.0 * (1.0 - 10.0 / 22.0)).abs() < 1e-12);
        assert_eq!((at(0.0, 0.2), at(0.5, 0.2).is_finite()), (f64::INFINITY, true));
        // 4 px wide in place of 8: 36 to 52 px and 46 to 54 px, 6 of 18.
        let thin = AssociationCost::new(&overlap(0.5, 0.0)).cost(44.0, 20.0, &seen(), &detection(4.0, 4.0, 1.0));
        assert!((thin - 10.0 * (1.0 - 6.0 / 18.0)).abs() < 1e-12);
        // Above each other by 3 px of 4: grown by a quarter 6 px high, 3 of 9.
        let below = AssociationCost::new(&overlap(0.25, 0.0)).cost(50.0, 17.0, &seen(), &detection(8.0, 4.0, 1.0));
        assert!((below - 10.0 * (1.0 - 3.0 / 9.0)).abs() < 1e-12);
        // 2 px high in place of 4: 14 to 20 px and 18.5 to 21.5 px, 1.5 of 7.5.
        let flat = AssociationCost::new(&overlap(0.25, 0.0)).cost(50.0, 17.0, &seen(), &detection(8.0, 2.0, 1.0));
        assert!((flat - 10.0 * (1.0 - 1.5 / 7.5)).abs() < 1e-12);
    }

    #[test]
    fn what_is_learnt_moves_by_its_share_towards_the_pair_that_was_made() {
        let config = AssociationCostConfig {
            size_log_std: Some(0.2),
            intensity_log_std: Some(0.5),
            learn: true,
            ..Default::default()
        };
        let mut cost = AssociationCost::new(&config);
        cost.learn(&seen(), &detection(16.0, 4.0, 400.0));
        let ln2 = 2f64.ln();
        // The mean of both sides' squares, one doubling and none; two doublings of the sum.
        assert!((cost.variance[0] - (0.04 + 0.005 * (0.5 * ln2 * ln2 - 0.04))).abs() < 1e-12);
        assert!((cost.variance[1] - (0.25 + 0.005 * (4.0 * ln2 * ln2 - 0.25))).abs() < 1e-12);
        let mut given = AssociationCost::new(&AssociationCostConfig { learn: false, ..config });
        given.learn(&seen(), &detection(16.0, 4.0, 400.0));
        assert_eq!(given.variance, [0.2f64.powi(2), 0.25]);
    }
}
