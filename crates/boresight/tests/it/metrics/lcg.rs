//! The random numbers of the reference scripts: a linear congruential generator that is the same in Python.

/// The generator of the scripts: a draw below n is the state shifted right by 33, modulo n.
pub struct Lcg(u64);

impl Lcg {
    pub fn new(seed: u64) -> Self {
        let mut l = Self(seed.wrapping_mul(2654435761).wrapping_add(1));
        for _ in 0..3 {
            l.next(2);
        }
        l
    }
    pub fn next(&mut self, n: u64) -> i64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % n) as i64
    }
}
