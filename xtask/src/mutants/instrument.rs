//! Mutant schemata: one source text that holds many mutants, each behind `crate::mutant(k)`.
//!
//! Source: R. Untch, A. J. Offutt, M. J. Harrold, "Mutation analysis using mutant schemata", ISSTA 1993.
//! A mutant is one of cargo-mutants' list, found again in the syntax tree by where it begins. Differs from replacing its text: a
//! replaced operator keeps its operands (`a - b * c` with `+` for `*` is `a - (b + c)`, not `a - b + c`).
//! Limits: what stands in a macro, a constant or a `const fn` cannot ask which mutant is on.

use serde::Deserialize;
use std::collections::HashMap;
use std::ops::Range;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// A place, both counted from 1, in characters.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
pub struct Place {
    line: usize,
    column: usize,
}

#[derive(Clone, Debug, Deserialize)]
struct Extent {
    start: Place,
}

/// An entry of `cargo mutants --list --json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Mutant {
    /// Path in the repository.
    pub file: String,
    /// What it does and where, for people.
    pub name: String,
    genre: String,
    replacement: String,
    span: Extent,
}

/// Which bytes of the instrumented text belong to a mutant.
pub type Held = (Range<usize>, usize);

enum Piece {
    Text(String),
    /// A range of the original, with the edits inside it.
    Source(Range<usize>),
    /// Text of one mutant.
    Mutated(usize, Vec<Piece>),
}

struct Edit {
    range: Range<usize>,
    pieces: Vec<Piece>,
}

struct Finder<'a> {
    text: &'a str,
    wanted: HashMap<(Place, &'a str), Vec<(usize, &'a Mutant)>>,
    edits: Vec<Edit>,
}

fn text(s: impl Into<String>) -> Piece {
    Piece::Text(s.into())
}

fn bytes(node: &impl Spanned) -> Range<usize> {
    node.span().byte_range()
}

impl<'a> Finder<'a> {
    fn take(&mut self, at: proc_macro2::Span, genre: &'a str) -> Vec<(usize, &'a Mutant)> {
        let start = at.start();
        self.wanted.remove(&(Place { line: start.line, column: start.column + 1 }, genre)).unwrap_or_default()
    }

    /// `(if mutant(1) { first } else if mutant(2) { second } else { as it was })`.
    fn switch(&mut self, range: Range<usize>, mutants: Vec<(usize, Vec<Piece>)>) {
        if mutants.is_empty() {
            return;
        }
        let mut pieces = vec![text("(")];
        for (k, changed) in mutants {
            let mut one = vec![text(format!("if crate::mutant({k}) {{ "))];
            one.extend(changed);
            pieces.extend([Piece::Mutated(k, one), text(" } else ")]);
        }
        pieces.extend([text("{ "), Piece::Source(range.clone()), text(" })")]);
        self.edits.push(Edit { range, pieces });
    }

    fn body(&mut self, block: &'a syn::Block) {
        let Some(first) = block.stmts.first() else { return };
        let braces = block.brace_token.span;
        let range = braces.open().byte_range().end..braces.close().byte_range().start;
        for (k, m) in self.take(first.span(), "FnValue") {
            let early = text(format!(" if crate::mutant({k}) {{ return {}; }}", m.replacement));
            // It holds the whole body: after an early return of another type (`impl Iterator`) rustc complains of what follows.
            let pieces = vec![Piece::Mutated(k, vec![early, Piece::Source(range.clone())])];
            self.edits.push(Edit { range: range.clone(), pieces });
        }
    }
}

impl<'a> Visit<'a> for Finder<'a> {
    fn visit_item_fn(&mut self, i: &'a syn::ItemFn) {
        self.body(&i.block);
        visit::visit_item_fn(self, i);
    }

    fn visit_impl_item_fn(&mut self, i: &'a syn::ImplItemFn) {
        self.body(&i.block);
        visit::visit_impl_item_fn(self, i);
    }

    fn visit_trait_item_fn(&mut self, i: &'a syn::TraitItemFn) {
        if let Some(block) = &i.default {
            self.body(block);
        }
        visit::visit_trait_item_fn(self, i);
    }

    fn visit_expr_binary(&mut self, i: &'a syn::ExprBinary) {
        let (left, right) = (bytes(&i.left), bytes(&i.right));
        let changed = |m: &Mutant| {
            let operator = text(format!(") {} (", m.replacement));
            vec![text("("), Piece::Source(left.clone()), operator, Piece::Source(right.clone()), text(")")]
        };
        let mutants = self.take(i.op.span(), "BinaryOperator").into_iter().map(|(k, m)| (k, changed(m))).collect();
        self.switch(left.start..right.end, mutants);
        visit::visit_expr_binary(self, i);
    }

    fn visit_expr_unary(&mut self, i: &'a syn::ExprUnary) {
        let operand = bytes(&i.expr);
        let mutants = self.take(i.op.span(), "UnaryOperator");
        let mutants = mutants.into_iter().map(|(k, _)| (k, vec![Piece::Source(operand.clone())])).collect();
        self.switch(bytes(&i.op).start..operand.end, mutants);
        visit::visit_expr_unary(self, i);
    }

    fn visit_arm(&mut self, i: &'a syn::Arm) {
        let after = bytes(&i.pat).end;
        for (k, _) in self.take(i.span(), "MatchArm") {
            let never = vec![text(format!(" if !crate::mutant({k})"))];
            self.edits.push(Edit { range: after..after, pieces: vec![Piece::Mutated(k, never)] });
        }
        if let Some((_, guard)) = &i.guard {
            let mutants = self.take(guard.span(), "MatchArmGuard");
            let mutants = mutants.into_iter().map(|(k, m)| (k, vec![text(&m.replacement)])).collect();
            self.switch(bytes(guard), mutants);
        }
        visit::visit_arm(self, i);
    }

    fn visit_expr_struct(&mut self, i: &'a syn::ExprStruct) {
        if let Some(rest) = &i.rest {
            for field in &i.fields {
                let syn::Member::Named(name) = &field.member else { continue };
                let base = &self.text[bytes(rest)];
                let of_base = |(k, _)| (k, vec![text(format!("({base}).{name}"))]);
                let mutants = self.take(field.span(), "StructField").into_iter().map(of_base).collect();
                if field.colon_token.is_some() {
                    self.switch(bytes(&field.expr), mutants);
                }
            }
        }
        visit::visit_expr_struct(self, i);
    }
}

/// Writes out text with edits; `edits` are in the order of their beginning, an outer one before those within it.
struct Writer<'a> {
    text: &'a str,
    edits: &'a [Edit],
    out: String,
    held: Vec<Held>,
}

impl Writer<'_> {
    fn source(&mut self, range: Range<usize>, mut next: usize) {
        let mut at = range.start;
        while let Some(edit) = self.edits.get(next).filter(|e| e.range.start <= range.end) {
            next += 1;
            if edit.range.start < at || edit.range.end > range.end {
                continue;
            }
            self.out.push_str(&self.text[at..edit.range.start]);
            at = edit.range.end;
            self.pieces(&edit.pieces, next);
        }
        self.out.push_str(&self.text[at..range.end]);
    }

    fn pieces(&mut self, pieces: &[Piece], next: usize) {
        for piece in pieces {
            match piece {
                Piece::Text(t) => self.out.push_str(t),
                Piece::Source(range) => self.source(range.clone(), next),
                Piece::Mutated(k, inside) => {
                    let start = self.out.len();
                    self.pieces(inside, next);
                    self.held.push((start..self.out.len(), *k));
                }
            }
        }
    }
}

/// Returns the text of a file with all its mutants (numbers beside them), where each stands in it, and those not found.
///
/// # Errors
/// If the text is not Rust.
pub fn instrument(text: &str, mutants: &[(usize, &Mutant)]) -> anyhow::Result<(String, Vec<Held>, Vec<usize>)> {
    let mut wanted = HashMap::<_, Vec<_>>::new();
    for &(k, m) in mutants {
        wanted.entry((m.span.start, m.genre.as_str())).or_default().push((k, m));
    }
    let file = syn::parse_file(text)?;
    let mut finder = Finder { text, wanted, edits: Vec::new() };
    finder.visit_file(&file);
    let Finder { wanted, mut edits, .. } = finder;
    edits.sort_by_key(|e| (e.range.start, std::cmp::Reverse(e.range.end)));
    let mut writer = Writer { text, edits: &edits, out: String::new(), held: Vec::new() };
    writer.source(0..text.len(), 0);
    let lost = wanted.into_values().flatten().map(|(k, _)| k).collect();
    Ok((writer.out, writer.held, lost))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants of a text: genre, the text where it begins (its first occurrence), replacement.
    fn mutants(of: &str, what: &[(&str, &str, &str)]) -> Vec<Mutant> {
        let one = |&(genre, begin, replacement): &(&str, &str, &str)| {
            let before = &of[..of.find(begin).unwrap()];
            let line = before.matches('\n').count() + 1;
            let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
            let span = Extent { start: Place { line, column } };
            Mutant {
                file: String::new(),
                name: String::new(),
                genre: genre.into(),
                replacement: replacement.into(),
                span,
            }
        };
        what.iter().map(one).collect()
    }

    fn instrumented(of: &str, what: &[(&str, &str, &str)]) -> (String, Vec<Held>, Vec<usize>) {
        let mutants = mutants(of, what);
        instrument(of, &mutants.iter().enumerate().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn each_kind_of_mutant_stands_behind_its_number() {
        let of = "fn é(a: i32) -> i32 {\n    match -a {\n        1 => a,\n        2 if a > 3 => 4,\n        _ => S { x: a, ..d }.x,\n    }\n}\n";
        let (text, held, lost) = instrumented(
            of,
            &[
                ("FnValue", "match", "7"),
                ("UnaryOperator", "-a", ""),
                ("MatchArm", "1 =>", ""),
                ("MatchArmGuard", "a > 3", "true"),
                ("StructField", "x: a", ""),
            ],
        );
        let want = "fn é(a: i32) -> i32 { if crate::mutant(0) { return 7; }\n    match (if crate::mutant(1) { a } else { -a }) {\n        \
             1 if !crate::mutant(2) => a,\n        2 if (if crate::mutant(3) { true } else { a > 3 }) => 4,\n        \
             _ => S { x: (if crate::mutant(4) { (d).x } else { a }), ..d }.x,\n    }\n}\n";
        assert_eq!(text, want);
        assert!(lost.is_empty());
        let of_3 = held.iter().find(|(_, k)| *k == 3).unwrap();
        assert_eq!(&text[of_3.0.clone()], "if crate::mutant(3) { true");
    }

    #[test]
    fn mutants_within_a_mutant_stand_on_both_sides() {
        let of = "fn f() { let x = a * b + c; }";
        let (text, _, lost) = instrumented(
            of,
            &[("BinaryOperator", "* b", "/"), ("BinaryOperator", "+", "-"), ("BinaryOperator", "+", "*")],
        );
        let inner = "(if crate::mutant(0) { (a) / (b) } else { a * b })";
        let want = format!(
            "fn f() {{ let x = (if crate::mutant(1) {{ ({inner}) - (c) }} else if crate::mutant(2) {{ ({inner}) * (c) }} else {{ {inner} + c }}); }}"
        );
        assert_eq!((text, lost), (want, vec![]));
    }

    #[test]
    fn a_mutant_of_another_text_is_said() {
        assert_eq!(instrumented("fn f() { a }", &[("BinaryOperator", "a", "+")]).2, [0]);
    }
}
