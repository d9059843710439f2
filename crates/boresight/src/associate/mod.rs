//! Which detection belongs to which track: sparse gates in, assignments out; sees only numbers.
