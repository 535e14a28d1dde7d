//! Rotary position phases (Su et al. 2021), half-split pairing: channel `i` turns with channel `i +
//! head_dim / 2`.

use std::f64::consts::TAU;

/// Tokens after which all phases come again, a power of two. Of the flow network's, which has one a
/// block: 26 days.
pub const PERIOD: u64 = 1 << 24;

/// Frequencies of one head width, whole turns in [`PERIOD`] tokens.
///
/// `10000^(-2i / head_dim)` rad a token is rounded to a multiple of `2 pi / PERIOD`, by at most
/// 1.9e-7 rad. Two tokens of a window of 100 differ by it in their phase by 2e-5 rad at most, less
/// than keys of 11 bits resolve. For that the phase of token `t` is a function of `t mod PERIOD`
/// that is computed in whole numbers: no token is too late to be exact, and a session does to the
/// bit what it did a period before.
#[derive(Debug, Clone)]
pub struct Rope {
    turns: Vec<u64>,
}

/// Cosines and sines of some rows, `rows x head_dim / 2` each.
#[derive(Debug, Clone)]
pub struct Phases {
    /// Cosines.
    pub cos: Vec<f32>,
    /// Sines.
    pub sin: Vec<f32>,
}

impl Rope {
    /// Frequencies of channels `i` below `head_dim / 2`.
    pub fn new(head_dim: usize) -> Self {
        let frequency = |i: usize| libm::pow(10_000.0, -2.0 * i as f64 / head_dim as f64);
        let turns = |i: usize| libm::round(frequency(i) * PERIOD as f64 / TAU) as u64;
        Self { turns: (0..head_dim / 2).map(turns).collect() }
    }

    /// Room for the phases of `rows` rows.
    pub fn phases(&self, rows: usize) -> Phases {
        let n = rows * self.turns.len();
        Phases { cos: vec![0.0; n], sin: vec![0.0; n] }
    }

    /// Fills row `row` of `phases` with the phases of token `position`.
    pub fn fill(&self, phases: &mut Phases, row: usize, position: u64) {
        let half = self.turns.len();
        let (cos, sin) = (&mut phases.cos[row * half..][..half], &mut phases.sin[row * half..][..half]);
        for ((c, s), turns) in cos.iter_mut().zip(sin).zip(&self.turns) {
            // A product that wraps at 2^64 has the right remainder: PERIOD divides 2^64.
            let part = turns.wrapping_mul(position) % PERIOD;
            let angle = TAU * (part as f64 / PERIOD as f64);
            (*s, *c) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rope: &Rope, position: u64) -> Phases {
        let mut phases = rope.phases(1);
        rope.fill(&mut phases, 0, position);
        phases
    }

    #[test]
    fn a_window_turns_as_it_should() {
        for head_dim in [8, 64, 256] {
            let rope = Rope::new(head_dim);
            for position in [0, 1, 7, 100] {
                let phases = of(&rope, position);
                for i in 0..head_dim / 2 {
                    let angle = position as f64 * libm::pow(10_000.0, -2.0 * i as f64 / head_dim as f64);
                    let (cos, sin) = (f64::from(phases.cos[i]), f64::from(phases.sin[i]));
                    assert!((cos - angle.cos()).abs() < 2e-5 && (sin - angle.sin()).abs() < 2e-5, "{head_dim}, {i}");
                }
            }
        }
    }

    /// What attention sees of two tokens is the difference of their phases.
    #[test]
    fn a_day_later_neighbours_are_as_far_apart() {
        let rope = Rope::new(64);
        let day = 30 * 3600 * 24 / 4 * 5;
        for far in [day, 30 * day, u64::MAX - 101] {
            let (a, b, near) = (of(&rope, far), of(&rope, far + 100), of(&rope, 100));
            for i in 0..32 {
                let [c0, s0, c1, s1] = [a.cos[i], a.sin[i], b.cos[i], b.sin[i]].map(f64::from);
                assert!((c0 * c1 + s0 * s1 - f64::from(near.cos[i])).abs() < 2e-7, "cosine of channel {i} at {far}");
                assert!((s1 * c0 - c1 * s0 - f64::from(near.sin[i])).abs() < 2e-7, "sine of channel {i} at {far}");
            }
        }
    }

    #[test]
    fn a_period_later_all_bits_come_again() {
        let rope = Rope::new(64);
        for position in [0, 1, 12_345, 3 * PERIOD + 7] {
            let (a, b) = (of(&rope, position), of(&rope, position + 5 * PERIOD));
            assert!(a.cos == b.cos && a.sin == b.sin);
            assert_ne!(a.cos, of(&rope, position + PERIOD / 2 + 1).cos);
        }
    }
}
