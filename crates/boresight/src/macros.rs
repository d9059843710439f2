//! Small macros of the crate.

/// `Debug` for types that hold a trait object, a file or a thread: their name is all there is to show.
macro_rules! opaque_debug {
    ($name:ident $(<$generic:ident $(: $bound:path)?>)?) => {
        impl$(<$generic $(: $bound)?>)? std::fmt::Debug for $name$(<$generic>)? {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.debug_struct(stringify!($name)).finish_non_exhaustive()
            }
        }
    };
}
