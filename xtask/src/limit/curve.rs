//! The curves of docs/limit.md as SVG: P_D against SNR, and the SNR for P_D 0.9 against the number of frames.

use super::white::Curve;
use std::fmt::Write as _;

const COLOURS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];

/// Both panels.
pub fn svg(curves: &[Curve]) -> String {
    let mut out = String::from(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 760 300' font-family='sans-serif' font-size='12'>\n\
         <rect width='760' height='300' fill='white'/>\n",
    );
    let mut put = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    // SNR 0.25 to 2 in logarithms; P_D 0 to 1.
    let x = |snr: f64| 50.0 + 300.0 * (snr / 0.25).ln() / 8f64.ln();
    let y = |p: f64| 260.0 - 230.0 * p;
    for p in [0.0, 0.25, 0.5, 0.75, 0.9, 1.0] {
        put(format!(
            "<path d='M50 {0:.1}H350' stroke='#ddd'/><text x='44' y='{0:.1}' text-anchor='end' dy='4'>{p}</text>",
            y(p)
        ));
    }
    for snr in [0.25, 0.5, 1.0, 2.0] {
        put(format!("<text x='{:.1}' y='276' text-anchor='middle'>{snr}</text>", x(snr)));
    }
    put("<text x='200' y='294' text-anchor='middle'>peak SNR of a frame; P_D at one false alarm an hour</text>".into());
    for (c, colour) in curves.iter().zip(COLOURS) {
        let points: Vec<_> = c.points.iter().map(|(s, p)| format!("{:.1},{:.1}", x(*s), y(*p))).collect();
        put(format!("<polyline points='{}' fill='none' stroke='{colour}' stroke-width='2'/>", points.join(" ")));
        let last = c.points.last().map_or((1.0, 1.0), |p| *p);
        put(format!(
            "<text x='{:.1}' y='{:.1}' fill='{colour}' dy='-5' text-anchor='middle'>{}</text>",
            x(last.0),
            y(last.1),
            c.frames
        ));
    }
    let fx = |n: f64| 430.0 + 300.0 * (n / 6.0).ln() / (96f64 / 6.0).ln();
    let fy = |snr: f64| 260.0 - 230.0 * (snr / 0.25).ln() / 8f64.ln();
    for snr in [0.25, 0.5, 1.0, 2.0] {
        put(format!(
            "<path d='M430 {0:.1}H730' stroke='#ddd'/><text x='424' y='{0:.1}' text-anchor='end' dy='4'>{snr}</text>",
            fy(snr)
        ));
    }
    for (which, colour, dash) in [(true, "#000", ""), (false, "#888", " stroke-dasharray='5 4'")] {
        let value = |c: &Curve| if which { c.needed } else { c.clairvoyant };
        let points: Vec<_> =
            curves.iter().map(|c| format!("{:.1},{:.1}", fx(f64::from(c.frames)), fy(value(c)))).collect();
        put(format!("<polyline points='{}' fill='none' stroke='{colour}' stroke-width='2'{dash}/>", points.join(" ")));
    }
    for c in curves {
        put(format!("<text x='{:.1}' y='276' text-anchor='middle'>{}</text>", fx(f64::from(c.frames)), c.frames));
    }
    put("<text x='580' y='294' text-anchor='middle'>frames; SNR for P_D 0.9 (dashed: the path is known)</text>".into());
    out.push_str("</svg>\n");
    out
}
