//! One table of the tracks of all inputs: the rows of each `tracks.csv` behind the name of its input.

use super::manifest::{Entry, Status};
use boresight::io::{AtomicFile, TRACKS_HEADER};
use boresight::{Error, ErrorKind, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;

/// Writes `tracks.csv` of the entries that are done, in their order; the file appears whole. Returns the number of rows.
/// # Errors
/// A table that is gone or another one than this version writes; a file that cannot be written.
pub fn write(dir: &Path, entries: &[Entry]) -> Result<u64> {
    let mut file = AtomicFile::create(dir.join("tracks.csv"))?;
    let part = file.part_path().to_path_buf();
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").at(part.display()).because(e);
    let mut out = BufWriter::with_capacity(1 << 20, &mut file);
    writeln!(out, "input,{TRACKS_HEADER}").map_err(failed)?;
    let mut n_rows = 0;
    for entry in entries.iter().filter(|e| e.status == Status::Done && e.outputs.contains_key("tracks.csv")) {
        let path = dir.join(&entry.folder).join("tracks.csv");
        let unread =
            |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(path.display()).because(e);
        let mut lines = BufReader::with_capacity(1 << 20, File::open(&path).map_err(unread)?);
        let name = quoted(&entry.input);
        let mut line = Vec::new();
        lines.read_until(b'\n', &mut line).map_err(unread)?;
        if line.trim_ascii_end() != TRACKS_HEADER.as_bytes() {
            return Err(Error::new(ErrorKind::Damaged, "has another header than this version writes")
                .at(path.display())
                .hint("run its input again: remove its folder and use --resume"));
        }
        loop {
            line.clear();
            if lines.read_until(b'\n', &mut line).map_err(unread)? == 0 {
                break;
            }
            out.write_all(name.as_bytes()).and_then(|()| out.write_all(&line)).map_err(failed)?;
            n_rows += 1;
        }
    }
    out.flush().map_err(failed)?;
    drop(out);
    file.finish()?;
    Ok(n_rows)
}

/// Writes the same rows as `tracks.parquet`; the file appears whole.
/// # Errors
/// As [`write`].
#[cfg(feature = "parquet")]
pub fn write_parquet(dir: &Path, entries: &[Entry]) -> Result<u64> {
    use boresight::io::tracks::{ReadOptions, read, write_parquet};
    let done = entries.iter().filter(|e| e.status == Status::Done && e.outputs.contains_key("tracks.csv"));
    let tables = done.map(|e| {
        let path = dir.join(&e.folder).join("tracks.csv");
        Ok((e.input.clone(), read(&path, None, ReadOptions::default(), true)?.table))
    });
    write_parquet(dir.join("tracks.parquet"), tables)
}

/// A name as the first cell of a row, with its comma.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r', ';', '#', ' ']) {
        format!("\"{}\",", name.replace('"', "\"\""))
    } else {
        format!("{name},")
    }
}

#[cfg(test)]
mod tests {
    use super::super::manifest::tests::entry;
    use super::*;

    #[test]
    fn rows_stand_behind_their_inputs_and_names_are_quoted() {
        let dir = tempfile::tempdir().unwrap();
        let mut entries = [entry("b", 2), entry("a", 1), entry("none", 3)];
        for e in &mut entries[..2] {
            e.outputs.insert("tracks.csv".into(), String::new());
            std::fs::create_dir(dir.path().join(&e.folder)).unwrap();
            let text = format!("{TRACKS_HEADER}\n0,0,{}\n", e.input);
            std::fs::write(dir.path().join(&e.folder).join("tracks.csv"), text).unwrap();
        }
        entries[1].input = "a, \"x\"".into();
        assert_eq!(write(dir.path(), &entries).unwrap(), 2);
        let text = std::fs::read_to_string(dir.path().join("tracks.csv")).unwrap();
        assert_eq!(text, format!("input,{TRACKS_HEADER}\nb,0,0,b\n\"a, \"\"x\"\"\",0,0,a\n"));
    }
}
