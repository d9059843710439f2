//! Who imports whom among the files of a crate, read from the text of its sources.
//!
//! A file imports another if its code, outside tests, names an item that the other defines: by `use`, or by a path in the code. A path is followed
//! through modules and `use` lines to the file that defines the item, so a `mod.rs` that only declares and re-exports is never an end.
//! A name that a module of the crate does not show is taken for one that a macro makes there. Limits: items reached by a method call are not
//! seen; names inside a function count as names of its module.

use super::tokens::{tokens, without_tests};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module: its file and the names in it.
#[derive(Default)]
struct Module {
    file: PathBuf,
    items: BTreeSet<String>,
    /// name -> path of the `use` that brings it.
    uses: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    /// Names brought by `pub use`; they count only if the file also uses them.
    passed_on: BTreeSet<String>,
    /// Paths in the code.
    paths: Vec<Vec<String>>,
    /// Whether a macro of the crate may make items here.
    macros: bool,
    /// Single words in the code, outside `use`.
    words: BTreeSet<String>,
}

/// The modules of one crate by their path (`[]` is the root).
pub struct Crate {
    modules: BTreeMap<Vec<String>, Module>,
}

impl Crate {
    /// Reads a crate from its root file on; `read` gives a file's text.
    pub fn read(root: &Path, read: &dyn Fn(&Path) -> Option<String>) -> Self {
        let mut all = Self { modules: BTreeMap::new() };
        all.file(root, root.parent().unwrap(), Vec::new(), read);
        all
    }

    fn file(&mut self, file: &Path, dir: &Path, path: Vec<String>, read: &dyn Fn(&Path) -> Option<String>) {
        let text = read(file).unwrap_or_else(|| panic!("no file {}", file.display()));
        let t = without_tests(&tokens(&text));
        let mut declared = Vec::new();
        self.module(&t, file, &path, &mut declared);
        for child in declared {
            let name = child.last().unwrap().clone();
            let folder = child[path.len()..].iter().fold(dir.to_path_buf(), |d, n| d.join(n));
            let flat = folder.with_file_name(format!("{name}.rs"));
            let nested = folder.join("mod.rs");
            let file = if read(&flat).is_some() { flat } else { nested };
            self.file(&file, &folder, child, read);
        }
    }

    /// Notes what the tokens of one module, in a file or in braces, define and use.
    fn module(&mut self, t: &[String], file: &Path, path: &[String], declared: &mut Vec<Vec<String>>) {
        let mut m = Module { file: file.to_path_buf(), ..Module::default() };
        let mut i = 0;
        while i < t.len() {
            let next = t.get(i + 1).cloned().unwrap_or_default();
            let named = next.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_');
            match t[i].as_str() {
                "mod" if named => {
                    let child = [path, &[next]].concat();
                    if t.get(i + 2).is_some_and(|x| x == "{") {
                        let end = closing(t, i + 2);
                        self.module(&t[i + 3..end], file, &child, declared);
                        i = end + 1;
                    } else {
                        declared.push(child);
                        i += 3;
                    }
                }
                "use"
                    if !matches!(t.get(i.wrapping_sub(1)).map(String::as_str), Some("+" | "::" | "."))
                        && next != "<" =>
                {
                    let end = i + t[i..].iter().position(|x| x == ";").unwrap_or(t.len() - i);
                    let before = &t[i.saturating_sub(6)..i];
                    let public = before.last().is_some_and(|x| x == "pub")
                        || (before.last().is_some_and(|x| x == ")") && before.iter().any(|x| x == "pub"));
                    let mut found = Vec::new();
                    use_tree(&t[i + 1..end], &[], &mut found);
                    for (name, target) in found {
                        if name == "*" {
                            m.globs.push(target);
                        } else {
                            if public {
                                m.passed_on.insert(name.clone());
                            }
                            m.uses.insert(name, target);
                        }
                    }
                    i = end + 1;
                }
                "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union" if named => {
                    m.items.insert(next.clone());
                    i += 2;
                }
                "macro_rules" => {
                    m.items.insert(t.get(i + 2).cloned().unwrap_or_default());
                    i += 3;
                }
                w if w.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_') => {
                    let mut segments = vec![w.to_string()];
                    let mut j = i + 1;
                    while t.get(j).is_some_and(|x| x == "::")
                        && t.get(j + 1).is_some_and(|x| x.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_'))
                    {
                        segments.push(t[j + 1].clone());
                        j += 2;
                    }
                    m.macros |=
                        t.get(j).is_some_and(|x| x == "!") && t.get(j + 1).is_some_and(|x| x == "(" || x == "{");
                    m.words.insert(w.to_string());
                    if segments.len() > 1 && !(i > 0 && (t[i - 1] == "::" || t[i - 1] == ".")) {
                        m.paths.push(segments);
                    }
                    i = j;
                }
                _ => i += 1,
            }
        }
        self.modules.insert(path.to_vec(), m);
    }

    /// The file that defines what `path` names in `module`; none for other crates, locals, and modules as such.
    fn defined_in(&self, module: &[String], path: &[String], depth: usize) -> Option<&Path> {
        if depth > 24 {
            return None;
        }
        let (mut at, mut k) = (module.to_vec(), 0);
        loop {
            match path.get(k).map(String::as_str) {
                Some("crate") => at.clear(),
                Some("self") => {}
                Some("super") => drop(at.pop()),
                _ => break,
            }
            k += 1;
        }
        while let Some(name) = path.get(k) {
            let m = self.modules.get(&at)?;
            let child = [at.as_slice(), std::slice::from_ref(name)].concat();
            if m.items.contains(name) {
                return Some(&m.file);
            }
            if self.modules.contains_key(&child) {
                (at, k) = (child, k + 1);
                continue;
            }
            if let Some(target) = m.uses.get(name) {
                if target.first() == Some(name) && target.len() == 1 {
                    return None; // a foreign crate under its own name
                }
                let full = [target.as_slice(), &path[k + 1..]].concat();
                return self.defined_in(&at, &full, depth + 1);
            }
            let by_glob = m.globs.iter().find_map(|glob| {
                let full = [glob.as_slice(), &path[k..]].concat();
                (glob.first().is_some_and(|g| matches!(g.as_str(), "crate" | "self" | "super")))
                    .then(|| self.defined_in(&at, &full, depth + 1))
                    .flatten()
            });
            // Reached by a path through the crate and not shown: a macro makes it.
            return by_glob.or_else(|| (at != module && m.macros).then_some(m.file.as_path()));
        }
        None
    }

    /// file -> files that it imports.
    pub fn imports(&self) -> BTreeMap<PathBuf, BTreeSet<PathBuf>> {
        let mut edges: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
        for (path, m) in &self.modules {
            let from = edges.entry(m.file.clone()).or_default();
            let by_use = m.uses.iter().filter(|(name, _)| !m.passed_on.contains(*name) || m.words.contains(*name));
            let by_glob = m.globs.iter().filter(|_| !m.words.is_empty()).flat_map(|glob| {
                m.words.iter().map(|w| [glob.as_slice(), std::slice::from_ref(w)].concat()).collect::<Vec<_>>()
            });
            for target in by_use.map(|(_, target)| target.clone()).chain(by_glob).chain(m.paths.iter().cloned()) {
                if let Some(file) = self.defined_in(path, &target, 0)
                    && file != m.file
                {
                    from.insert(file.to_path_buf());
                }
            }
        }
        edges
    }
}

/// Index of the brace that closes the one at `open`.
fn closing(t: &[String], open: usize) -> usize {
    let mut depth = 0;
    for (k, x) in t.iter().enumerate().skip(open) {
        match x.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return k;
        }
    }
    t.len()
}

/// Name and path of everything that a `use` brings; a glob has the name `*`.
fn use_tree(t: &[String], prefix: &[String], out: &mut Vec<(String, Vec<String>)>) {
    let (mut path, mut i) = (prefix.to_vec(), 0);
    while i < t.len() {
        match t[i].as_str() {
            "::" => {}
            "*" => return out.push(("*".into(), path)),
            "{" => {
                let end = closing(t, i);
                let (mut from, mut depth) = (i + 1, 0);
                for k in i + 1..=end.min(t.len() - 1) {
                    match t[k].as_str() {
                        "{" => depth += 1,
                        "}" if k < end => depth -= 1,
                        _ => {}
                    }
                    if depth == 0 && (t[k] == "," || k == end) {
                        if k > from {
                            use_tree(&t[from..k], &path, out);
                        }
                        from = k + 1;
                    }
                }
                return;
            }
            "as" => return out.push((t.get(i + 1).cloned().unwrap_or_default(), path)),
            "self" if path.len() > prefix.len() || !prefix.is_empty() => {}
            name => path.push(name.to_string()),
        }
        i += 1;
    }
    if let Some(name) = path.last().cloned() {
        out.push((name, path));
    }
}

/// Groups of two files or more, each of which imports every other by some way.
pub fn cycles(edges: &BTreeMap<PathBuf, BTreeSet<PathBuf>>) -> Vec<Vec<PathBuf>> {
    let reach = |from: &PathBuf| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(f) = open.pop() {
            for to in edges.get(&f).into_iter().flatten() {
                if seen.insert(to.clone()) {
                    open.push(to.clone());
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&PathBuf, BTreeSet<PathBuf>> = edges.keys().map(|f| (f, reach(f))).collect();
    let mut found: BTreeSet<Vec<PathBuf>> = BTreeSet::new();
    for (f, to) in &reached {
        if to.contains(*f) {
            found.insert(to.iter().filter(|g| reached.get(g).is_some_and(|back| back.contains(*f))).cloned().collect());
        }
    }
    found.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let read = |p: &Path| files.iter().find(|f| Path::new(f.0) == p).map(|f| f.1.to_string());
        let found = cycles(&Crate::read(Path::new("src/lib.rs"), &read).imports());
        let name = |p: &PathBuf| p.strip_prefix("src").unwrap().to_str().unwrap().to_string();
        found.iter().map(|c| c.iter().map(name).collect()).collect()
    }

    #[test]
    fn two_files_that_use_each_other_are_a_cycle() {
        let lib = ("src/lib.rs", "mod a; mod b;");
        let a = ("src/a.rs", "use crate::b::B; pub struct A;");
        for b in
            ["use super::a::A; pub struct B;", "pub struct B(crate::a::A);", "use crate::{a::{A as X}}; pub struct B;"]
        {
            assert_eq!(cycles_of(&[lib, a, ("src/b.rs", b)]), [["a.rs", "b.rs"]], "{b}");
        }
        for b in [
            "pub struct B;",
            "pub struct B; // crate::a::A",
            "pub struct B; const S: &str = \"crate::a::A\";",
            "pub struct B; #[cfg(test)] mod tests { use crate::a::A; }",
        ] {
            assert!(cycles_of(&[lib, a, ("src/b.rs", b)]).is_empty(), "{b}");
        }
        let by_name = "pub struct B { #[serde(with = \"crate::a::A\")] x: u8 }";
        assert_eq!(cycles_of(&[lib, a, ("src/b.rs", by_name)]).len(), 1);
    }

    #[test]
    fn a_re_export_leads_to_the_file_that_defines_the_item() {
        let tree = |parent: &'static str, x: &'static str| {
            [
                ("src/lib.rs", "pub mod room; pub use room::X;"),
                ("src/room/mod.rs", parent),
                ("src/room/x.rs", x),
                ("src/room/y.rs", "use super::X; pub struct Y;"),
            ]
        };
        // Only declared and passed on: no node.
        assert!(cycles_of(&tree("mod x; mod y; pub use x::X; pub use y::Y;", "pub struct X;")).is_empty());
        // Through two re-exports.
        let back = "use crate::room::Y; pub struct X;";
        assert_eq!(cycles_of(&tree("mod x; mod y; pub use x::X; pub use y::Y;", back)), [["room/x.rs", "room/y.rs"]]);
        // The parent defines what its child uses, and uses its child: by `use`, by a path, by a re-exported name.
        let child = "use super::P; pub struct X;";
        for parent in [
            "mod x; mod y; use x::X; pub struct P;",
            "mod x; mod y; pub use self::x::X; pub struct P; fn f(_: X) {}",
            "mod x; mod y; pub use x::X; pub struct P; fn f() { x::g() }",
        ] {
            let child = if parent.contains("x::g") { "use super::P; pub struct X; pub fn g() {}" } else { child };
            assert_eq!(cycles_of(&tree(parent, child)), [["room/mod.rs", "room/x.rs"]], "{parent}");
        }
        assert!(cycles_of(&tree("mod x; mod y; pub use x::X; pub struct P;", child)).is_empty());
    }

    #[test]
    fn what_a_macro_makes_is_where_the_macro_is_called() {
        let made = ("src/a.rs", "use crate::b::B; make!(one, u8);");
        for user in
            ["use crate::a; pub struct B; fn f() { a::one() }", "pub struct B; use super::a::one; fn f() { one() }"]
        {
            let files = [("src/lib.rs", "mod a; mod b;"), made, ("src/b.rs", user)];
            assert_eq!(cycles_of(&files), [["a.rs", "b.rs"]], "{user}");
        }
    }

    #[test]
    fn a_cycle_of_three_and_one_through_a_glob_are_seen() {
        let three = [
            ("src/lib.rs", "mod a; mod b; mod c; mod free;"),
            ("src/a.rs", "pub fn a() { super::b::b() }"),
            ("src/b.rs", "use super::c; pub fn b() { c::c() }"),
            ("src/c.rs", "use crate::a::*; pub fn c() { a() }"),
            ("src/free.rs", "use crate::a::a; fn f() { a() }"),
        ];
        assert_eq!(cycles_of(&three), [["a.rs", "b.rs", "c.rs"]]);
    }
}
