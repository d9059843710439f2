//! Words of a command line, as a shell takes them back.

use std::ffi::OsStr;

/// A word, in quotes where a shell would part or change it.
pub fn word(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,@%+".contains(c);
    let is_plain = !word.is_empty() && word.chars().all(plain);
    if is_plain { word.to_string() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// A word that need not be UTF-8, whose other bytes are written `$'\\xff'`, as bash and zsh have it.
pub fn os_word(text: &OsStr) -> String {
    match text.to_str() {
        Some(text) => word(text),
        None => format!("$'{}'", text.as_encoded_bytes().escape_ascii()),
    }
}

/// The command that was given with more options.
pub fn given_with(options: &str) -> String {
    let mut command = String::from("boresight");
    for given in std::env::args_os().skip(1) {
        command.push(' ');
        command.push_str(&os_word(&given));
    }
    format!("{command} {options}")
}

#[cfg(test)]
mod tests {
    use super::word;

    #[test]
    fn a_shell_takes_every_word_as_it_was() {
        assert_eq!(
            ["a/b-1.mp4", "my clip.mp4", "it's", "*.png", ""].map(word),
            ["a/b-1.mp4", "'my clip.mp4'", "'it'\\''s'", "'*.png'", "''"]
        );
    }
}
