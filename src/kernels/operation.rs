//! What an operation is: its contract, its variants, and which of them this CPU runs.
//!
//! The macro [`operation`] declares one; all that is `unsafe` about calling a function that is
//! compiled for a CPU level is here.

use super::level::{Available, Level};

/// An operation of the networks; [`operation`] implements it.
pub(crate) trait Operation: Sized + 'static {
    /// The name of its folder.
    const NAME: &'static str;
    /// What its variants are called as: an `unsafe fn`, since a level has to be there.
    type Run: Copy + 'static;
    /// What else is to be known of a variant.
    type About: 'static;
    const VARIANTS: Table<Self>;
}

/// Lines of a declaration, and the variants of each: `None` for those of another architecture.
pub(crate) type Table<O> = &'static [&'static [Option<Variant<O>>]];

/// One implementation of an operation and the level that it needs.
pub(crate) struct Variant<O: Operation> {
    level: Level,
    run: O::Run,
    about: O::About,
}

impl<O: Operation> Variant<O> {
    /// # Safety
    /// `run` may be called, with any arguments, on a CPU that has `level`.
    pub(crate) const unsafe fn new(level: Level, run: O::Run, about: O::About) -> Self {
        Self { level, run, about }
    }
}

/// A variant that this CPU can run: `run` calls it.
pub(crate) struct Kernel<O: Operation>(&'static Variant<O>);

impl<O: Operation> Clone for Kernel<O> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<O: Operation> Copy for Kernel<O> {}

impl<O: Operation> Kernel<O> {
    /// The best variant that a level of this CPU includes.
    ///
    /// # Panics
    /// Where an operation has no scalar variant.
    pub(super) fn best(available: Available) -> Self {
        let variant = |level: Level| O::VARIANTS.iter().copied().flatten().flatten().find(|v| v.level == level);
        let usable = Level::ALL.into_iter().rev().filter(|&level| available.level().includes(level));
        Self(usable.into_iter().find_map(variant).expect("every operation has a scalar variant"))
    }

    /// The level of the variant.
    pub(super) fn level(self) -> Level {
        self.0.level
    }

    pub(super) fn about(self) -> &'static O::About {
        &self.0.about
    }

    /// The function itself.
    #[inline]
    pub(super) fn function(self) -> O::Run {
        self.0.run
    }
}

/// Declares an operation: its name, what is computed of what, and its variants.
///
/// ```text
/// operation! {
///     /// What it does with its operands, and what they must hold.
///     Norm = "norm", (fn(x: &[f32], y: &mut [f32]));
///     (Scalar, Neon, Avx2 => scalar::run)
///     (Avx512 => avx512::run)
/// }
/// ```
///
/// A line gives levels and the function that is compiled for each of them: a scalar body, which is
/// `#[inline(always)]` so that it takes on the level's features, or a hand-written function with
/// `#[target_feature]`, of which the compiler checks that the level has what it asks for. `, token`
/// behind the function hands it the level's [token](super::level::token) first; any other
/// expression there is the variant's [`Operation::About`], whose type the first line then names (`,
/// about Type;`).
///
/// The module has a `tests` with a function `cases`, which runs a kernel and records its results:
/// the test declared here holds each variant that this CPU can run against the scalar one.
macro_rules! operation {
    ($(#[$doc:meta])* $name:ident = $label:literal, $signature:tt $(, about $about:ty)?; $($line:tt)+) => {
        $(#[$doc])*
        pub(crate) struct $name;

        impl $crate::kernels::operation::Operation for $name {
            const NAME: &'static str = $label;
            type Run = operation!(@pointer $signature);
            #[allow(unused_parens, reason = "() where nothing is said")]
            type About = ($($about)?);
            const VARIANTS: $crate::kernels::operation::Table<Self> = &[$(operation!(@line $signature $line)),+];
        }

        operation! { @method $name $signature }

        #[cfg(test)]
        mod agreement {
            #[test]
            fn variants_have_the_bits_of_the_reference() {
                crate::kernels::testing::agree::<super::$name>(super::tests::cases);
            }
        }
    };
    (@pointer (fn($($arg:ident: $type:ty),*) $(-> $result:ty)?)) => { unsafe fn($($type),*) $(-> $result)? };
    (@method $name:ident (fn($($arg:ident: $type:ty),*) $(-> $result:ty)?)) => {
        impl $crate::kernels::operation::Kernel<$name> {
            /// Runs the variant.
            #[inline]
            pub(crate) fn run(self, $($arg: $type),*) $(-> $result)? {
                // SAFETY: a `Kernel` exists only for a variant whose level this CPU has.
                unsafe { self.function()($($arg),*) }
            }
        }
    };
    (@line $signature:tt ($($level:ident),+ => $run:path)) => {
        &[$($crate::kernels::level::features!($level, [$crate::kernels::operation::variant] ($level $signature () $run, ()))),+]
    };
    (@line $signature:tt ($($level:ident),+ => $run:path, token)) => {
        &[$($crate::kernels::level::features!(
            $level, [$crate::kernels::operation::variant] ($level $signature ($crate::kernels::level::token::$level::here(),) $run, ())
        )),+]
    };
    (@line $signature:tt ($($level:ident),+ => $run:path, $about:expr)) => {
        &[$($crate::kernels::level::features!($level, [$crate::kernels::operation::variant] ($level $signature () $run, $about))),+]
    };
}

/// One variant, `run` compiled for a level, where the architecture has it.
macro_rules! variant {
    (any [] ($level:ident (fn($($arg:ident: $type:ty),*) $(-> $result:ty)?) () $run:path, $about:expr)) => {{
        fn entry($($arg: $type),*) $(-> $result)? {
            $run($($arg),*)
        }
        let run: unsafe fn($($type),*) $(-> $result)? = entry;
        // SAFETY: a safe function without features.
        Some(unsafe { $crate::kernels::operation::Variant::new($crate::kernels::Level::$level, run, $about) })
    }};
    ("wasm32" [$($feature:tt),*]
     ($level:ident (fn($($arg:ident: $type:ty),*) $(-> $result:ty)?) ($($token:tt)*) $run:path, $about:expr)) => {{
        #[cfg(all(target_arch = "wasm32", $(target_feature = $feature),*))]
        {
            // The whole module is compiled for the level.
            fn entry($($arg: $type),*) $(-> $result)? {
                $run($($token)* $($arg),*)
            }
            let run: unsafe fn($($type),*) $(-> $result)? = entry;
            // SAFETY: a safe function, in a module that would not run without the features.
            Some(unsafe { $crate::kernels::operation::Variant::new($crate::kernels::Level::$level, run, $about) })
        }
        #[cfg(not(all(target_arch = "wasm32", $(target_feature = $feature),*)))]
        None
    }};
    ($arch:tt [$($feature:tt),*]
     ($level:ident (fn($($arg:ident: $type:ty),*) $(-> $result:ty)?) ($($token:tt)*) $run:path, $about:expr)) => {{
        #[cfg(target_arch = $arch)]
        {
            #[target_feature($(enable = $feature),*)]
            fn entry($($arg: $type),*) $(-> $result)? {
                $run($($token)* $($arg),*)
            }
            let run: unsafe fn($($type),*) $(-> $result)? = entry;
            // SAFETY: a safe function whose features are those of the level, from the same list.
            Some(unsafe { $crate::kernels::operation::Variant::new($crate::kernels::Level::$level, run, $about) })
        }
        #[cfg(not(target_arch = $arch))]
        None
    }};
}
pub(crate) use {operation, variant};

#[cfg(test)]
impl<O: Operation> Kernel<O> {
    /// The scalar variant.
    pub(crate) fn reference() -> Self {
        Self::best(Available::new(Level::Scalar).expect("any CPU"))
    }

    /// Every variant that this CPU can run.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let variants = O::VARIANTS.iter().copied().flatten().flatten();
        variants.filter(|variant| variant.level.is_available()).map(Self)
    }
}
