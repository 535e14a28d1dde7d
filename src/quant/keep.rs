//! Patterns of layer names that stay floats.

use super::layers::{Layer, default_scheme};
use super::{Options, argument};
use crate::error::Result;
use crate::kernels::Scheme;
use std::collections::BTreeMap;
use std::str::FromStr;

/// Layers that stay floats: `PATTERN` (f16) or `PATTERN=f32`; `*` in a pattern stands for any
/// characters, none included.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keep {
    pattern: String,
    scheme: Scheme,
}

impl FromStr for Keep {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (pattern, scheme) = match text.rsplit_once('=') {
            None => (text, Scheme::F16),
            Some((pattern, "f16")) => (pattern, Scheme::F16),
            Some((pattern, "f32")) => (pattern, Scheme::F32),
            Some(_) => return Err("it is PATTERN, PATTERN=f16 or PATTERN=f32".to_owned()),
        };
        if pattern.is_empty() {
            return Err("the pattern is empty; `*` stands for any characters".to_owned());
        }
        Ok(Self { pattern: pattern.to_owned(), scheme })
    }
}

impl Keep {
    /// Whether layer `name` is meant; a pattern that ends in `.weight` names the layer's tensor.
    pub fn fits(&self, name: &str) -> bool {
        fits(self.pattern.strip_suffix(".weight").unwrap_or(&self.pattern).as_bytes(), name.as_bytes())
    }
}

/// Glob with `*` alone; backtracks to the last star, so it takes at most pattern times name steps.
fn fits(pattern: &[u8], name: &[u8]) -> bool {
    let (mut p, mut n, mut star) = (0, 0, None);
    while n < name.len() {
        if pattern.get(p) == Some(&b'*') {
            star = Some((p, n));
            p += 1;
        } else if pattern.get(p) == Some(&name[n]) {
            (p, n) = (p + 1, n + 1);
        } else if let Some((at, from)) = star {
            star = Some((at, from + 1));
            (p, n) = (at + 1, from + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|&c| c == b'*')
}

/// The scheme of each layer. A layer of f16 that is kept at f32 stays f16: there is nothing to
/// gain.
pub(super) fn apply(options: &Options<'_>, layers: &[Layer]) -> Result<BTreeMap<String, Scheme>> {
    for k in options.keep {
        if !layers.iter().any(|layer| k.fits(&layer.name)) {
            return Err(argument(format!(
                "no layer fits the pattern `{}`; `visavis inspect FILE --json` lists them all",
                k.pattern
            )));
        }
    }
    let scheme = |layer: &Layer| {
        let stored = layer.weights.scheme();
        let kept = options.keep.iter().rev().find(|k| k.fits(&layer.name)).map(|k| k.scheme);
        let wanted = match kept {
            Some(scheme) => scheme,
            None if options.scheme != Scheme::F16 && layer.elements() < options.smallest => stored,
            None => default_scheme(&layer.name, layer.elements(), options.scheme),
        };
        wanted.min(stored)
    };
    Ok(layers.iter().map(|layer| (layer.name.clone(), scheme(layer))).collect())
}
