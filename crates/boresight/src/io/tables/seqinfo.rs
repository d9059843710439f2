//! The rate of a MOTChallenge sequence, from the `seqinfo.ini` beside the table or one folder up.

use std::path::Path;

/// Returns `frameRate` of the sequence that a table belongs to, frames/s.
pub(crate) fn rate_beside(table: &Path) -> Option<f64> {
    let folder = table.parent()?;
    [folder.join("seqinfo.ini"), folder.join("../seqinfo.ini")].iter().find_map(|path| {
        let is_small = path.metadata().ok()?.len() < 1 << 16;
        is_small.then(|| rate_of(&std::fs::read_to_string(path).ok()?)).flatten()
    })
}

fn rate_of(ini: &str) -> Option<f64> {
    ini.lines().find_map(|line| {
        let (key, value) = line.split_once('=')?;
        let rate: f64 = if key.trim() == "frameRate" { value.trim().parse().ok()? } else { return None };
        crate::time::check_rate(rate).is_ok().then_some(rate)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_found_whatever_the_spacing() {
        assert_eq!(rate_of("[Sequence]\r\nname=A\r\nframeRate = 14\r\n"), Some(14.0));
        assert_eq!((rate_of("frameRate=0"), rate_of("frameRate=1e300")), (None, None));
        assert_eq!(rate_of(""), None);
    }
}
