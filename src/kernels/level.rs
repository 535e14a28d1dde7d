//! CPU levels: what they are, which are available, and `VISAVIS_CPU`.

use std::fmt;

use crate::error::{Error, ErrorKind, Result};

/// An instruction set that kernels are written for.
///
/// Every operation has a scalar variant; a level uses, for each operation, the best variant it [includes](Self::includes).
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Level {
    /// Plain Rust, any CPU: the reference.
    Scalar,
    /// aarch64 Advanced SIMD, ARMv8.0.
    Neon,
    /// [`Neon`](Self::Neon) and `sdot`: int8 dot products (Cortex-A55, A76 and later).
    Dotprod,
    /// [`Dotprod`](Self::Dotprod) and `smmla`: int8 matrix products (ARMv8.6: Cortex-X2, A510, A710 and later).
    I8mm,
    /// x86-64 with AVX2, FMA and F16C (Haswell, Zen and later).
    Avx2,
    /// [`Avx2`](Self::Avx2) and AVX-VNNI: 256-bit int8 dot products (Alder Lake, Zen 5 and later).
    AvxVnni,
    /// AVX-512 F, BW, DQ, VL and VNNI (Ice Lake, Zen 4 and later).
    Avx512,
}

impl Level {
    /// Every level of every architecture, weakest first within one architecture.
    pub const ALL: [Level; 7] =
        [Self::Scalar, Self::Neon, Self::Dotprod, Self::I8mm, Self::Avx2, Self::AvxVnni, Self::Avx512];

    /// The name used by `VISAVIS_CPU` and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Neon => "neon",
            Self::Dotprod => "dotprod",
            Self::I8mm => "i8mm",
            Self::Avx2 => "avx2",
            Self::AvxVnni => "avxvnni",
            Self::Avx512 => "avx512",
        }
    }

    /// The level called `name`, if there is one.
    pub fn from_name(name: &str) -> Option<Level> {
        Self::ALL.into_iter().find(|l| l.name() == name)
    }

    /// Whether a CPU of this level can run kernels written for `other`.
    pub fn includes(self, other: Level) -> bool {
        use Level::{Avx2, Avx512, AvxVnni, Dotprod, I8mm, Neon, Scalar};
        self == other
            || other == Scalar
            || matches!((self, other), (Dotprod, Neon) | (I8mm, Neon | Dotprod) | (AvxVnni | Avx512, Avx2))
    }

    /// Whether this CPU can run it.
    pub fn is_available(self) -> bool {
        if self == Self::Scalar {
            return true;
        }
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            let avx2 = has!("avx2") && has!("fma") && has!("f16c");
            match self {
                Self::Avx2 => avx2,
                Self::AvxVnni => avx2 && has!("avxvnni"),
                Self::Avx512 => {
                    avx2 && has!("avx512f")
                        && has!("avx512bw")
                        && has!("avx512dq")
                        && has!("avx512vl")
                        && has!("avx512vnni")
                }
                _ => false,
            }
        }
        #[cfg(target_arch = "aarch64")]
        {
            use std::arch::is_aarch64_feature_detected as has;
            match self {
                Self::Neon => has!("neon"),
                Self::Dotprod => has!("neon") && has!("dotprod"),
                Self::I8mm => has!("neon") && has!("dotprod") && has!("i8mm"),
                _ => false,
            }
        }
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        false
    }

    /// The levels that this CPU can run, weakest first; never empty.
    pub fn available() -> Vec<Level> {
        Self::ALL.into_iter().filter(|l| l.is_available()).collect()
    }

    /// The level to use: what `forced` names (the value of `VISAVIS_CPU`), else the best available.
    pub(crate) fn choose(forced: Option<&str>) -> Result<Level> {
        let available = Self::available();
        let list = || available.iter().map(|l| l.name()).collect::<Vec<_>>().join(", ");
        let Some(name) = forced.map(str::trim).filter(|n| !n.is_empty()) else {
            return Ok(available.last().copied().unwrap_or(Self::Scalar));
        };
        match Self::from_name(name) {
            Some(level) if level.is_available() => Ok(level),
            Some(_) => Err(Error::new(
                ErrorKind::CpuLevel,
                format!("VISAVIS_CPU={name}: this CPU cannot run that level; available here: {}", list()),
            )),
            None => Err(Error::new(
                ErrorKind::CpuLevel,
                format!("VISAVIS_CPU={name}: no such level; available here: {}", list()),
            )),
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for l in Level::ALL {
            assert_eq!(Level::from_name(l.name()), Some(l));
            assert!(l.includes(l) && l.includes(Level::Scalar));
        }
    }

    #[test]
    fn a_level_that_is_missing_is_a_typed_error_that_lists_the_others() {
        let missing = Level::ALL.into_iter().find(|l| !l.is_available()).expect("no CPU has all architectures");
        for name in [missing.name(), "mmx"] {
            let e = Level::choose(Some(name)).unwrap_err();
            assert_eq!(e.kind(), ErrorKind::CpuLevel);
            assert!(e.to_string().contains(name) && e.to_string().contains("scalar"), "{e}");
        }
        assert_eq!(Level::choose(Some("scalar")).unwrap(), Level::Scalar);
        assert_eq!(Level::choose(Some(" ")).unwrap(), Level::choose(None).unwrap());
    }
}
