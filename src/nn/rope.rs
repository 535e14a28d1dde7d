//! Rotary position phases (Su et al. 2021), half-split pairing: channel `i` turns with channel `i + head_dim / 2`.

/// Frequencies of one head width.
#[derive(Debug, Clone)]
pub struct Rope {
    frequencies: Vec<f64>,
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
    /// Frequencies `10000^(-2i / head_dim)`, `i` below `head_dim / 2`.
    pub fn new(head_dim: usize) -> Self {
        let frequencies = (0..head_dim / 2).map(|i| libm::pow(10_000.0, -2.0 * i as f64 / head_dim as f64)).collect();
        Self { frequencies }
    }

    /// Room for the phases of `rows` rows.
    pub fn phases(&self, rows: usize) -> Phases {
        let n = rows * self.frequencies.len();
        Phases { cos: vec![0.0; n], sin: vec![0.0; n] }
    }

    /// Fills row `row` of `phases` with the phases of token `position`.
    ///
    /// The angle is formed in f64 (error below 1e-9 rad for positions below 2^22, days of motion); f32 would lose a
    /// milliradian after four hours.
    pub fn fill(&self, phases: &mut Phases, row: usize, position: u64) {
        let half = self.frequencies.len();
        let (cos, sin) = (&mut phases.cos[row * half..][..half], &mut phases.sin[row * half..][..half]);
        for ((c, s), f) in cos.iter_mut().zip(sin).zip(&self.frequencies) {
            let angle = position as f64 * f;
            (*s, *c) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_stay_precise_after_a_day() {
        let rope = Rope::new(64);
        let mut phases = rope.phases(2);
        let day = 30 * 3600 * 24 / 4 * 5;
        rope.fill(&mut phases, 0, day);
        rope.fill(&mut phases, 1, day + 1);
        let (c0, s0, c1, s1) = (phases.cos[0], phases.sin[0], phases.cos[32], phases.sin[32]);
        let (cos, sin) = (f64::from(c0 * c1 + s0 * s1), f64::from(s1 * c0 - c1 * s0));
        assert!((cos - 1f64.cos()).abs() < 1e-6, "relative phase of neighbours is one radian, cosine {cos}");
        assert!((sin - 1f64.sin()).abs() < 1e-6, "relative phase of neighbours is one radian, sine {sin}");
    }
}
