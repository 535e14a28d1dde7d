//! CPU levels: what they are, what each is compiled for, which are available, and `VISAVIS_CPU`.

use std::fmt;

use crate::error::{Error, ErrorKind, Result};

/// An instruction set that kernels are written for.
///
/// Every operation has a scalar variant; a level uses, for each operation, the best variant that it
/// [includes](Self::includes).
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Level {
    /// Plain Rust, any CPU: the reference.
    Scalar,
    /// aarch64 Advanced SIMD, ARMv8.0.
    Neon,
    /// [`Neon`](Self::Neon) and `sdot`: int8 dot products (Cortex-A55, A76 and later).
    Dotprod,
    /// [`Dotprod`](Self::Dotprod) and `smmla`: int8 matrix products (ARMv8.6: Cortex-X2, A510, A710
    /// and later).
    I8mm,
    /// x86-64 with AVX2, FMA and F16C (Haswell, Zen and later).
    Avx2,
    /// [`Avx2`](Self::Avx2) and AVX-VNNI: 256-bit int8 dot products (Alder Lake, Zen 5 and later).
    AvxVnni,
    /// AVX-512 F, BW, DQ, VL and VNNI (Ice Lake, Zen 4 and later).
    Avx512,
    /// WebAssembly with 128-bit vectors, in modules that are built for them.
    Simd128,
    /// [`Simd128`](Self::Simd128) and relaxed vectors, in modules that are built for them and on
    /// engines where they give our bits.
    Relaxed,
}

/// Architecture and features of a level, handed to the macro `$then` with `$args`: the one list
/// that detection, tokens and variants are made from, so that what is compiled is what is looked
/// for.
macro_rules! features {
    (Scalar, [$($then:tt)+] $args:tt) => { $($then)+! { any [] $args } };
    (Neon, [$($then:tt)+] $args:tt) => { $($then)+! { "aarch64" ["neon"] $args } };
    (Dotprod, [$($then:tt)+] $args:tt) => { $($then)+! { "aarch64" ["neon", "dotprod"] $args } };
    (I8mm, [$($then:tt)+] $args:tt) => { $($then)+! { "aarch64" ["neon", "dotprod", "i8mm"] $args } };
    (Avx2, [$($then:tt)+] $args:tt) => { $($then)+! { "x86_64" ["avx2", "fma", "f16c"] $args } };
    (AvxVnni, [$($then:tt)+] $args:tt) => { $($then)+! { "x86_64" ["avx2", "fma", "f16c", "avxvnni"] $args } };
    (Avx512, [$($then:tt)+] $args:tt) => {
        $($then)+! {
            "x86_64"
            ["avx2", "fma", "f16c", "avx512f", "avx512bw", "avx512dq", "avx512vl", "avx512vnni"]
            $args
        }
    };
    (Simd128, [$($then:tt)+] $args:tt) => { $($then)+! { "wasm32" ["simd128"] $args } };
    (Relaxed, [$($then:tt)+] $args:tt) => { $($then)+! { "wasm32" ["simd128", "relaxed-simd"] $args } };
}
pub(crate) use features;

/// The names of a level's features.
macro_rules! list {
    ($arch:tt [$($feature:tt),*] ()) => { &[$($feature),*] };
}

/// Whether this CPU has a level's features.
macro_rules! detected {
    (any [] ()) => { true };
    ("x86_64" [$($feature:tt),*] ()) => {{
        #[cfg(target_arch = "x86_64")]
        { $(std::arch::is_x86_feature_detected!($feature))&&* }
        #[cfg(not(target_arch = "x86_64"))]
        { false }
    }};
    ("aarch64" [$($feature:tt),*] ()) => {{
        #[cfg(target_arch = "aarch64")]
        { $(std::arch::is_aarch64_feature_detected!($feature))&&* }
        #[cfg(not(target_arch = "aarch64"))]
        { false }
    }};
    ("wasm32" [$($feature:tt),*] ()) => { cfg!(all(target_arch = "wasm32", $(target_feature = $feature),*)) };
}

/// Evaluates [`features`] with the level that `$level` is.
macro_rules! each_level {
    ($level:expr, $then:ident) => {
        match $level {
            Level::Scalar => features!(Scalar, [$then]()),
            Level::Neon => features!(Neon, [$then]()),
            Level::Dotprod => features!(Dotprod, [$then]()),
            Level::I8mm => features!(I8mm, [$then]()),
            Level::Avx2 => features!(Avx2, [$then]()),
            Level::AvxVnni => features!(AvxVnni, [$then]()),
            Level::Avx512 => features!(Avx512, [$then]()),
            Level::Simd128 => features!(Simd128, [$then]()),
            Level::Relaxed => features!(Relaxed, [$then]()),
        }
    };
}

impl Level {
    /// Every level of every architecture, weakest first within one architecture.
    pub const ALL: [Level; 9] = [
        Self::Scalar,
        Self::Neon,
        Self::Dotprod,
        Self::I8mm,
        Self::Avx2,
        Self::AvxVnni,
        Self::Avx512,
        Self::Simd128,
        Self::Relaxed,
    ];

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
            Self::Simd128 => "simd128",
            Self::Relaxed => "relaxed",
        }
    }

    /// The level called `name`, if there is one.
    pub fn from_name(name: &str) -> Option<Level> {
        Self::ALL.into_iter().find(|l| l.name() == name)
    }

    fn features(self) -> &'static [&'static str] {
        each_level!(self, list)
    }

    /// Whether a CPU of this level can run kernels written for `other`.
    pub fn includes(self, other: Level) -> bool {
        other.features().iter().all(|feature| self.features().contains(feature))
    }

    /// Whether this CPU can run it.
    pub fn is_available(self) -> bool {
        // What relaxed instructions do is the engine's choice.
        #[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
        if self == Self::Relaxed {
            return is_fused();
        }
        each_level!(self, detected)
    }

    /// The levels that this CPU can run, weakest first; never empty.
    pub fn available() -> Vec<Level> {
        Self::ALL.into_iter().filter(|l| l.is_available()).collect()
    }

    /// The level to use: what `forced` names (the value of `VISAVIS_CPU`), else the best available.
    pub(crate) fn choose(forced: Option<&str>) -> Result<Available> {
        let Some(name) = forced.map(str::trim).filter(|n| !n.is_empty()) else {
            return Ok(Available(Self::available().last().copied().unwrap_or(Self::Scalar)));
        };
        let reason = match Self::from_name(name).map(Available::new) {
            Some(Some(available)) => return Ok(available),
            Some(None) => "this CPU cannot run that level",
            None => "no such level",
        };
        Err(missing(&format!("VISAVIS_CPU={name}: {reason}")))
    }
}

/// Whether `relaxed_madd` rounds once here. An engine computes it in one way as long as it runs.
#[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
fn is_fused() -> bool {
    use std::arch::wasm32::*;
    use std::hint::black_box;
    // (1 + e)(1 - e) - 1 = -e^2, which is lost if the product is rounded to 1 first.
    let e = f32x4_splat(black_box(f32::EPSILON));
    let one = f32x4_splat(black_box(1.0));
    let found = f32x4_relaxed_madd(f32x4_add(one, e), f32x4_sub(one, e), f32x4_neg(one));
    i32x4_all_true(f32x4_eq(found, f32x4_neg(f32x4_mul(e, e))))
}

/// The error of a level that cannot be used, with those that can.
pub(super) fn missing(reason: &str) -> Error {
    let list = Level::available().iter().map(|l| l.name()).collect::<Vec<_>>().join(", ");
    Error::new(ErrorKind::CpuLevel, format!("{reason}; available here: {list}"))
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A level that this CPU was found to have: the proof that a [`Kernel`](super::operation::Kernel)
/// rests on, which only this file can make.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Available(Level);

impl Available {
    /// `level`, if this CPU can run it.
    pub(crate) fn new(level: Level) -> Option<Self> {
        level.is_available().then_some(Self(level))
    }

    pub(crate) fn level(self) -> Level {
        self.0
    }
}

/// Proofs by the compiler: a token is made where code is compiled for its level, and nowhere else.
pub(crate) mod token {
    macro_rules! token {
        ("wasm32" [$($feature:tt),*] ($level:ident)) => {
            /// Proof that this module has the level of this name.
            #[cfg(all(target_arch = "wasm32", $(target_feature = $feature),*))]
            #[derive(Clone, Copy)]
            pub(crate) struct $level(());

            #[cfg(all(target_arch = "wasm32", $(target_feature = $feature),*))]
            impl $level {
                /// The whole module is compiled for the level.
                #[inline(always)]
                pub(crate) fn here() -> Self {
                    Self(())
                }
            }
        };
        ($arch:tt [$($feature:tt),*] ($level:ident)) => {
            /// Proof that the CPU that runs this has the level of this name.
            #[cfg(target_arch = $arch)]
            #[derive(Clone, Copy)]
            pub(crate) struct $level(());

            #[cfg(target_arch = $arch)]
            impl $level {
                /// Safe to call in functions that are compiled for the level alone.
                #[inline]
                #[target_feature($(enable = $feature),*)]
                pub(crate) fn here() -> Self {
                    Self(())
                }
            }
        };
    }

    features!(Neon, [token](Neon));
    features!(Avx2, [token](Avx2));
    features!(Avx512, [token](Avx512));
    features!(Simd128, [token](Simd128));
    features!(Relaxed, [token](Relaxed));
}

/// Methods of a token, compiled for its level: `for LEVEL: fn name(self, ...) { ... }`. Their
/// bodies call the level's intrinsics, and functions compiled for it, without `unsafe`.
#[allow(unused_macros, reason = "as below")]
macro_rules! compiled {
    (for $level:ident: $($functions:tt)*) => { $crate::kernels::level::features!($level, [$crate::kernels::level::compile] ($level $($functions)*)); };
}
#[allow(unused_macros, reason = "as below")]
macro_rules! compile {
    ($arch:tt $features:tt
     ($level:ident $(fn $name:ident(self $(, $arg:ident: $type:ty)*) $(-> $result:ty)? $body:block)*)) => {
        $($crate::kernels::level::compile! { @one $features $level fn $name ($($arg: $type),*) ($($result)?) $body })*
    };
    (@one [$($feature:tt),*] $level:ident fn $name:ident ($($arg:ident: $type:ty),*) ($($result:ty)?) $body:block) => {
        #[inline(always)]
        fn $name(self $(, $arg: $type)*) $(-> $result)? {
            #[inline]
            #[target_feature($(enable = $feature),*)]
            fn compiled($($arg: $type),*) $(-> $result)? $body
            let _: $crate::kernels::level::token::$level = self;
            // SAFETY: `self` is a token of the level, whose features these are, so the CPU has
            // them.
            unsafe { compiled($($arg),*) }
        }
    };
}
#[allow(unused_imports, reason = "an architecture without vectors of 16 floats uses neither")]
pub(crate) use {compile, compiled};

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
    fn levels_include_those_they_are_built_on() {
        use Level::{Avx2, Avx512, AvxVnni, Dotprod, I8mm, Neon, Relaxed, Simd128};
        let included =
            [(Dotprod, Neon), (I8mm, Neon), (I8mm, Dotprod), (AvxVnni, Avx2), (Avx512, Avx2), (Relaxed, Simd128)];
        for (a, b) in Level::ALL.into_iter().flat_map(|a| Level::ALL.map(|b| (a, b))) {
            let expected = a == b || b == Level::Scalar || included.contains(&(a, b));
            assert_eq!(a.includes(b), expected, "{a} and {b}");
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
        let chosen = |forced| Level::choose(forced).unwrap().level();
        assert_eq!(chosen(Some("scalar")), Level::Scalar);
        assert_eq!(chosen(Some(" ")), chosen(None));
    }
}
