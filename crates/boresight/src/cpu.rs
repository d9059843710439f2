//! What this machine's processor can do beyond its architecture, for records of where a result was made.

/// The processor's architecture and the vector instructions it has, in a fixed order: `["x86_64", "avx2", ..]`.
pub fn cpu_features() -> Vec<&'static str> {
    let mut all = vec![std::env::consts::ARCH];
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        macro_rules! has {
            ($($name:tt)*) => { $(if std::arch::is_x86_feature_detected!($name) { all.push($name); })* };
        }
        has!("sse2" "sse4.1" "sse4.2" "avx" "avx2" "fma" "avx512f" "avx512bw" "avx512vl");
    }
    #[cfg(target_arch = "aarch64")]
    {
        macro_rules! has {
            ($($name:tt)*) => { $(if std::arch::is_aarch64_feature_detected!($name) { all.push($name); })* };
        }
        has!("neon" "fp16" "dotprod" "sve");
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_architecture_comes_first() {
        assert_eq!(cpu_features()[0], std::env::consts::ARCH);
        assert_eq!(cpu_features(), cpu_features());
    }
}
