//! Text for HTML, JSON inside HTML, and base 64.

use maud::{Markup, PreEscaped, html};
use std::fmt::Write;

/// The head of a page: its title, the style of all pages, and further style of its own.
pub(super) fn head(title: &str, style: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="generator" content=(concat!("boresight ", env!("CARGO_PKG_VERSION")));
            title { (title) }
            style { (PreEscaped(include_str!("page.css"))) (PreEscaped(style)) }
        }
    }
}

/// The text without control characters, which have no place in HTML; line ends and tabs stay.
pub(super) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' && c != '\t' { '\u{fffd}' } else { c }).collect()
}

/// A number with about `digits` significant digits; what is not finite is `null`.
pub(super) fn short(v: f64, digits: i32) -> String {
    let mut text = String::new();
    push_json(&mut text, v, digits);
    text
}

/// Appends a number with about `digits` significant digits as JSON; what is not finite becomes `null`.
pub(super) fn push_json(out: &mut String, v: f64, digits: i32) {
    if !v.is_finite() {
        out.push_str("null");
        return;
    }
    if v == 0.0 {
        out.push('0');
        return;
    }
    let magnitude = v.abs().log10().floor() as i32;
    let decimals = digits - 1 - magnitude;
    // Writing to a String cannot fail.
    let _ = if !(-2..=12).contains(&decimals) {
        write!(out, "{v:.*e}", (digits - 1).max(0) as usize)
    } else {
        let start = out.len();
        let written = write!(out, "{v:.*}", decimals.max(0) as usize);
        if out[start..].contains('.') {
            let kept = out[start..].trim_end_matches('0').trim_end_matches('.').len();
            out.truncate(start + kept);
        }
        written
    };
}

/// Appends a JSON array of numbers.
pub(super) fn push_array(out: &mut String, values: impl Iterator<Item = f64>, digits: i32) {
    out.push('[');
    for (i, v) in values.enumerate() {
        if i > 0 {
            out.push(',');
        }
        push_json(out, v, digits);
    }
    out.push(']');
}

/// Writes bytes in base 64 (RFC 4648, section 4).
pub(super) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let at = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= group.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_agrees_with_the_rfc() {
        // RFC 4648, section 10
        for (text, want) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(text.as_bytes()), want);
        }
    }

    #[test]
    fn numbers_keep_their_digits_and_no_zeros() {
        let text = |v, d| {
            let mut s = String::new();
            push_json(&mut s, v, d);
            s
        };
        assert_eq!(text(1234.5678, 6), "1234.57");
        assert_eq!(text(100.0, 4), "100");
        assert_eq!(text(1_234_567.0, 4), "1.235e6");
        assert_eq!(text(-0.000012345, 3), "-0.0000123");
        assert_eq!(text(1e-30, 3), "1.00e-30");
        assert_eq!(text(f64::NAN, 3), "null");
    }

    #[test]
    fn markup_in_text_stays_text() {
        let evil = printable("<img src='x' onerror=\"a&b\">\u{0}");
        let shown = maud::html! { b title=(evil) { (evil) } }.into_string();
        let safe = "&lt;img src='x' onerror=&quot;a&amp;b&quot;&gt;\u{fffd}";
        assert_eq!(shown, format!("<b title=\"{safe}\">{safe}</b>"));
    }
}
