//! Explains keys of the configuration from the meanings written beside them: what `boresight config --explain` says.

use super::schema_tree::{children, describe};
use super::whole::schema;
use crate::{Error, ErrorKind, Result};

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
        ["input", "detector", "tracker", "world"].iter().for_each(|table| walk(table, 0, &mut bare));
        assert!(bare.is_empty(), "keys without a meaning: {bare:?}");
        assert!(explain("tracker.gate-probability").unwrap().meaning.contains("χ²"));
        assert!(explain("tracker.filter.form").unwrap().entries.iter().any(|(name, _)| name == "kf"));
        assert!(explain("tracker.nonsense").unwrap_err().to_string().contains("coast-s"));
    }
}
