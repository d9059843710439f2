//! The formats of other programs that `track --also` writes beside its own tables, made of the finished `tracks.csv`.

use super::convert::of_trackpy;
use super::export_files::FORMATS;
use super::run_folder::RunFolder;
use crate::console::say;
use boresight::io::tracks::{Dialect, Format, ReadOptions, read, write_path};
use boresight::{Error, Result};
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Takes the name of a format, for the name of its file.
pub fn file_name() -> impl TypedValueParser<Value = &'static str> {
    PossibleValuesParser::new(FORMATS.map(|(format, _)| format.name())).try_map(|name| {
        let of_name = FORMATS.iter().find(|(f, _)| f.name() == name);
        let is_built = |format| cfg!(feature = "parquet") || !matches!(format, Format::Parquet);
        match of_name {
            Some((format, file)) if is_built(*format) => Ok(*file),
            Some(_) => {
                Err("this build writes no Parquet: cargo install --path crates/boresight-cli --features parquet")
            }
            None => Err("no such format"),
        }
    })
}

/// Writes the files among `names` and says what they cannot hold; what could not be written is returned. `size_px`: width and height of the frames.
pub fn write(folder: &RunFolder, names: &[&'static str], size_px: Option<[u32; 2]>, quiet: bool) -> Vec<Error> {
    if names.is_empty() {
        return Vec::new();
    }
    let options = ReadOptions { keep_extra: true, ..ReadOptions::default() };
    let mut file = match read(&folder.path("tracks.csv"), None, options, false) {
        Ok(file) => file,
        Err(e) => return vec![e],
    };
    file.table.size_px = size_px;
    let one = |&(format, name): &(Format, &str)| -> Result<()> {
        let dropped = match format {
            Format::Named(Dialect::Trackpy) => {
                let table = of_trackpy(file.table.clone(), &folder.path("tracks.csv"), false, quiet);
                write_path(&table, format, Some(&folder.path(name)))?
            }
            _ => write_path(&file.table, format, Some(&folder.path(name)))?,
        };
        if !dropped.is_empty() && !quiet {
            say!("note: {} does not hold: {}", format.name(), dropped.join(", "));
        }
        Ok(())
    };
    FORMATS.iter().filter(|(_, name)| names.contains(name)).filter_map(|f| one(f).err()).collect()
}
