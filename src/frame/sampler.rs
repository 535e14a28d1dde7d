//! How a block is made.

use crate::error::{Error, ErrorKind, Result};

/// How a block is made: the rule from noise to a latent, and its number of evaluations.
///
/// Every value is a sampler that exists: [`Sampler::midpoint`], [`Sampler::euler`] and
/// [`str::parse`] refuse all others.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Sampler {
    /// Midpoint rule with four steps, the last one taken as two of Euler's: eight network
    /// evaluations. The reference.
    Midpoint4,
    /// Midpoint rule with two steps: four evaluations.
    Midpoint2,
    /// Midpoint rule with one step: two evaluations.
    Midpoint1,
    /// Euler's rule, one evaluation per step.
    Euler(EulerSteps),
    /// The distilled single-step student: one evaluation.
    Single,
}

/// Number of steps of Euler's rule, 1 to 64.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EulerSteps(u8);

impl EulerSteps {
    /// Most steps.
    pub const MAX: u8 = 64;

    /// `steps` steps, or `None` outside 1 to 64.
    pub const fn new(steps: u8) -> Option<Self> {
        if steps >= 1 && steps <= Self::MAX { Some(Self(steps)) } else { None }
    }

    /// The number, 1 to 64.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl Sampler {
    /// The midpoint rule with 1, 2 or 4 steps.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another number.
    pub fn midpoint(steps: u8) -> Result<Self> {
        match steps {
            1 => Ok(Self::Midpoint1),
            2 => Ok(Self::Midpoint2),
            4 => Ok(Self::Midpoint4),
            _ => Err(Error::new(ErrorKind::Argument, format!("midpoint with {steps} steps: it takes 1, 2 or 4"))),
        }
    }

    /// Euler's rule with 1 to 64 steps.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another number.
    pub fn euler(steps: u8) -> Result<Self> {
        let refused = || Error::new(ErrorKind::Argument, format!("Euler with {steps} steps: it takes 1 to 64"));
        EulerSteps::new(steps).map(Self::Euler).ok_or_else(refused)
    }

    /// Steps of the rule: 1, 2 or 4 of the midpoint rule, 1 to 64 of Euler's, 1 of the student.
    pub const fn steps(self) -> u8 {
        match self {
            Self::Midpoint4 => 4,
            Self::Midpoint2 => 2,
            Self::Midpoint1 | Self::Single => 1,
            Self::Euler(steps) => steps.get(),
        }
    }

    /// Whether it is the midpoint rule.
    pub const fn is_midpoint(self) -> bool {
        matches!(self, Self::Midpoint4 | Self::Midpoint2 | Self::Midpoint1)
    }

    /// Evaluations of the flow network that a block takes.
    pub const fn evaluations(self) -> usize {
        let steps = self.steps() as usize;
        if self.is_midpoint() { 2 * steps } else { steps }
    }
}

impl std::fmt::Display for Sampler {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Midpoint4 | Self::Midpoint2 | Self::Midpoint1 => write!(f, "midpoint{}", self.steps()),
            Self::Euler(steps) => write!(f, "euler:{}", steps.get()),
            Self::Single => f.write_str("single"),
        }
    }
}

impl std::str::FromStr for Sampler {
    type Err = Error;

    /// Reads `midpoint4`, `midpoint2`, `midpoint1`, `euler:N` (1 to 64) or `single`.
    fn from_str(s: &str) -> Result<Self> {
        let euler = || Self::euler(s.strip_prefix("euler:")?.parse().ok()?).ok();
        let sampler = match s {
            "midpoint4" => Some(Self::Midpoint4),
            "midpoint2" => Some(Self::Midpoint2),
            "midpoint1" => Some(Self::Midpoint1),
            "single" => Some(Self::Single),
            _ => euler(),
        };
        sampler.ok_or_else(|| {
            let message =
                format!("unknown sampler {s:?}: midpoint4, midpoint2, midpoint1, euler:N (N 1 to 64) or single");
            Error::new(ErrorKind::Argument, message)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_made_can_be_read_and_nothing_else_can_be_made() {
        let midpoint = (0..=u8::MAX).filter_map(|n| Sampler::midpoint(n).ok());
        let euler = (0..=u8::MAX).filter_map(|n| Sampler::euler(n).ok());
        let all: Vec<_> = midpoint.chain(euler).chain([Sampler::Single]).collect();
        assert_eq!(all.len(), 3 + 64 + 1);
        for sampler in all {
            assert_eq!(sampler.to_string().parse::<Sampler>().unwrap(), sampler);
            assert!((1..=64).contains(&sampler.evaluations()));
        }
        for wrong in ["midpoint0", "midpoint3", "midpoint", "euler:0", "euler:65", "euler:", "euler:-1", "", "Single"] {
            assert_eq!(wrong.parse::<Sampler>().unwrap_err().kind(), ErrorKind::Argument, "{wrong}");
        }
    }
}
