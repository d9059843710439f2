//! Explains keys of the configuration from the meanings written beside them: what `boresight config --explain` says.

use super::Config;
use crate::{Error, ErrorKind, Result};

/// The JSON schema of the configuration, with every key's meaning.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Config).to_value()
}

/// What a key or a table means.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// Meaning, unit, range, effect.
    pub meaning: String,
    /// Default, if it has one.
    pub default: Option<String>,
    /// The keys of a table or the choices of an enum, with their meanings.
    pub entries: Vec<(String, String)>,
}

/// Explains a key such as `tracker.gate-probability`, or a table or choice such as `tracker.filter.form`.
/// # Errors
/// A key that does not exist; the error lists what there is at that place.
pub fn explain(key: &str) -> Result<Explanation> {
    let schema = schema();
    let mut at = schema.clone();
    let mut meaning = "The whole configuration.".to_string();
    for (i, part) in key.split('.').enumerate() {
        let children = children(&schema, &at);
        let Some((_, child)) = children.iter().find(|(name, _)| name == part) else {
            if let Some(new) = super::renamed::new_name(key) {
                let e = Error::new(ErrorKind::Config, format!("this key has a new name: `{new}`")).at(key);
                return Err(e.hint(format!("`boresight config --explain {new}`")));
            }
            let known: Vec<_> = children.iter().map(|(name, _)| name.as_str()).collect();
            let near = super::typo::nearest(part, &known).map_or(String::new(), |n| format!("; did you mean `{n}`?"));
            return Err(Error::new(ErrorKind::Config, format!("there is no such key{near}")).at(key).hint(format!(
                "{} holds: {}",
                if i == 0 { "the configuration" } else { "this table" },
                known.join(", ")
            )));
        };
        meaning = describe(&schema, child);
        at = child.clone();
    }
    let default = at.get("default").filter(|d| !d.is_object()).map(ToString::to_string);
    let entries = children(&schema, &at).iter().map(|(name, child)| (name.clone(), describe(&schema, child))).collect();
    Ok(Explanation { meaning, default, entries })
}

/// Follows a reference to its definition.
pub(super) fn resolve<'a>(root: &'a serde_json::Value, at: &'a serde_json::Value) -> &'a serde_json::Value {
    let mut at = at;
    for _ in 0..8 {
        let link = at.get("$ref").and_then(serde_json::Value::as_str);
        let any = at.get("anyOf").and_then(|a| a.as_array()).and_then(|a| a.iter().find(|v| v.get("$ref").is_some()));
        match (link.and_then(|l| root.pointer(l.trim_start_matches('#'))), any) {
            (Some(next), _) | (None, Some(next)) => at = next,
            (None, None) => break,
        }
    }
    at
}

pub(super) fn describe(root: &serde_json::Value, at: &serde_json::Value) -> String {
    let own = at.get("description").or_else(|| resolve(root, at).get("description"));
    own.and_then(serde_json::Value::as_str).unwrap_or("").replace('\n', " ")
}

/// Whether a key takes exactly one of several names.
pub(super) fn is_choice(root: &serde_json::Value, at: &serde_json::Value) -> bool {
    resolve(root, at).get("oneOf").is_some()
}

/// The named parts of a table, or the variants of an enum.
pub(super) fn children(root: &serde_json::Value, at: &serde_json::Value) -> Vec<(String, serde_json::Value)> {
    let mut at = resolve(root, at);
    // A variant of an enum is a table with the variant's name as its only key; what it holds is one level down.
    let mut out = Vec::new();
    if let Some(variants) = at.get("oneOf").and_then(|v| v.as_array()) {
        for variant in variants {
            if let Some(name) = variant.get("const").and_then(|c| c.as_str()) {
                out.push((name.to_string(), variant.clone()));
            }
            for name in variant.get("enum").and_then(|e| e.as_array()).into_iter().flatten().filter_map(|n| n.as_str())
            {
                out.push((name.to_string(), variant.clone()));
            }
            for (name, inner) in variant.get("properties").and_then(|p| p.as_object()).into_iter().flatten() {
                let mut inner = inner.clone();
                if let (Some(object), Some(text)) = (inner.as_object_mut(), variant.get("description")) {
                    object.insert("description".to_string(), text.clone());
                }
                out.push((name.clone(), inner));
            }
        }
        return out;
    }
    if let Some(items) = at.get("items") {
        at = resolve(root, items);
    }
    for (name, child) in at.get("properties").and_then(|p| p.as_object()).into_iter().flatten() {
        out.push((name.clone(), child.clone()));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_has_a_meaning() {
        fn walk(path: &str, depth: usize, bare: &mut Vec<String>) {
            for (name, meaning) in explain(path).unwrap().entries {
                let key = format!("{path}.{name}");
                if meaning.is_empty() {
                    bare.push(key.clone());
                }
                if depth < 4 {
                    walk(&key, depth + 1, bare);
                }
            }
        }
        let mut bare = Vec::new();
        ["input", "detector", "tracker"].iter().for_each(|table| walk(table, 0, &mut bare));
        assert!(bare.is_empty(), "keys without a meaning: {bare:?}");
        assert!(explain("tracker.gate-probability").unwrap().meaning.contains("χ²"));
        assert!(explain("tracker.filter.form").unwrap().entries.iter().any(|(name, _)| name == "kf"));
        assert!(explain("tracker.nonsense").unwrap_err().to_string().contains("coast-s"));
    }
}
