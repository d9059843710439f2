//! How good are tracks: image, state, consistency, set and multi-object measures; sees only records.
