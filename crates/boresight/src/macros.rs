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

/// Compiles a function whose loops the compiler turns into vectors once for each vector width, and takes the widest that the
/// machine has. The body stays a function of its own, so that the compiler knows that its arguments do not overlap.
macro_rules! widest {
    ($(#[$meta:meta])* $vis:vis fn $name:ident $(<$($generic:ident: $bound:path),+>)?
        ($($arg:ident: $of:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$meta])*
        $vis fn $name $(<$($generic: $bound),+>)? ($($arg: $of),*) $(-> $out)? {
            #[inline(always)]
            fn each_width $(<$($generic: $bound),+>)? ($($arg: $of),*) $(-> $out)? $body
            fearless_simd::dispatch!(fearless_simd::Level::new(), _simd => each_width($($arg),*))
        }
    };
}
