//! Ways through a JSON schema as `schemars` writes it: references, choices, the parts of a table, what is said of a key.

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
