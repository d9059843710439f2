//! The words and signs of a Rust source, as far as imports need them.

/// Words and signs of a source, without comments; a string keeps its text only inside an attribute (`#[serde(with = "path")]`).
pub fn tokens(text: &str) -> Vec<String> {
    let c: Vec<char> = text.chars().collect();
    let word = |ch: char| ch.is_alphanumeric() || ch == '_';
    let (mut out, mut i) = (Vec::<String>::new(), 0);
    let mut attribute_depth = 0usize;
    while i < c.len() {
        let rest = |n: usize| c.get(i + n).copied().unwrap_or('\0');
        match c[i] {
            '/' if rest(1) == '/' => i += c[i..].iter().take_while(|x| **x != '\n').count(),
            '/' if rest(1) == '*' => {
                let mut depth = 0;
                loop {
                    match (c.get(i), c.get(i + 1)) {
                        (Some('/'), Some('*')) => (depth, i) = (depth + 1, i + 2),
                        (Some('*'), Some('/')) => (depth, i) = (depth - 1, i + 2),
                        (None, _) => break,
                        _ => i += 1,
                    }
                    if depth == 0 {
                        break;
                    }
                }
            }
            '"' => {
                let from = i + 1;
                i = from;
                while i < c.len() && c[i] != '"' {
                    i += if c[i] == '\\' { 2 } else { 1 };
                }
                if attribute_depth > 0 {
                    let inner: String = c[from..i.min(c.len())].iter().collect();
                    out.push("\"".into()); // no path runs from before the string into it
                    out.extend(tokens(&inner));
                }
                out.push("\"".into());
                i += 1;
            }
            'r' | 'b' if raw_hashes(&c[i..]).is_some() && !(i > 0 && word(c[i - 1])) => {
                let (start, hashes) = raw_hashes(&c[i..]).unwrap();
                i += start;
                while i < c.len() && !(c[i] == '"' && (1..=hashes).all(|k| c.get(i + k) == Some(&'#'))) {
                    i += 1;
                }
                i += 1 + hashes;
                out.push("\"".into());
            }
            '\'' if rest(1) == '\\' => {
                i += 3;
                i += c[i.min(c.len())..].iter().take_while(|x| **x != '\'').count() + 1;
            }
            '\'' if rest(2) == '\'' => i += 3,
            ch if word(ch) => {
                let n = c[i..].iter().take_while(|x| word(**x)).count();
                out.push(c[i..i + n].iter().collect());
                i += n;
            }
            ':' if rest(1) == ':' => {
                out.push("::".into());
                i += 2;
            }
            ch => {
                let opens = ch == '[' && matches!(out.last().map(String::as_str), Some("#" | "!"));
                if ch == '[' && (opens || attribute_depth > 0) {
                    attribute_depth += 1;
                } else if ch == ']' && attribute_depth > 0 {
                    attribute_depth -= 1;
                }
                if !ch.is_whitespace() {
                    out.push(ch.to_string());
                }
                i += 1;
            }
        }
    }
    out
}

/// Where the text of a raw string begins and how many `#` close it.
fn raw_hashes(c: &[char]) -> Option<(usize, usize)> {
    let r = c.iter().take(2).position(|x| *x == 'r')?;
    let hashes = c[r + 1..].iter().take_while(|x| **x == '#').count();
    (c.get(r + 1 + hashes) == Some(&'"')).then_some((r + 2 + hashes, hashes))
}

/// The tokens without items that stand only in tests.
pub fn without_tests(t: &[String]) -> Vec<String> {
    let starts = |i: usize, what: &[&str]| what.iter().enumerate().all(|(k, w)| t.get(i + k).is_some_and(|x| x == w));
    let (mut out, mut i) = (Vec::new(), 0);
    while i < t.len() {
        if starts(i, &["#", "[", "cfg", "(", "test", ")", "]"]) {
            i += 7;
            let mut depth = 0;
            while i < t.len() {
                match t[i].as_str() {
                    "{" => depth += 1,
                    "}" => depth -= 1,
                    _ => {}
                }
                i += 1;
                if depth == 0 && (t[i - 1] == ";" || t[i - 1] == "}") {
                    break;
                }
            }
        } else {
            out.push(t[i].clone());
            i += 1;
        }
    }
    out
}
