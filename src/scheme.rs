//! How weights are stored.

use serde::{Deserialize, Serialize};
use std::fmt;

/// How the numbers of a weight matrix are stored, and computed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// Group-wise int4, int8 or int16 activations.
    I4,
    /// Per-channel int8, int8 or int16 activations.
    I8,
    /// Half floats, float activations and sums.
    F16,
    /// Floats: the reference.
    F32,
}

impl fmt::Display for Scheme {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Scheme::I4 => "i4",
            Scheme::I8 => "i8",
            Scheme::F16 => "f16",
            Scheme::F32 => "f32",
        })
    }
}

impl std::str::FromStr for Scheme {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = [Scheme::F32, Scheme::F16, Scheme::I8, Scheme::I4];
        all.into_iter().find(|s| s.to_string() == text).ok_or_else(|| "it is f32, f16, i8 or i4".to_owned())
    }
}
