//! Latents and pose features have two scales: the networks', and that of metres and radians. Each
//! is a type of its own, and a [`Normaliser`] is the only way between them.

use crate::error::{Error, ErrorKind, Result};

/// Values in the networks' scale: mean 0 and standard deviation 1 in every channel of the training
/// data.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Standardised<B = Vec<f32>>(B);

/// Values as they are: features in metres and radians per frame, latents as the encoder gives them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Metric<B = Vec<f32>>(B);

macro_rules! scale {
    ($name:ident) => {
        impl<B> $name<B> {
            /// Says that `values` are in this scale.
            pub const fn new(values: B) -> Self {
                Self(values)
            }

            /// The values, out of the scale's keeping.
            #[cfg_attr(not(feature = "internals"), allow(dead_code, reason = "of one scale alone"))]
            pub fn into_inner(self) -> B {
                self.0
            }
        }

        impl $name {
            /// `len` zeros.
            pub fn zeros(len: usize) -> Self {
                Self(vec![0.0; len])
            }
        }

        impl<B: AsRef<[f32]>> $name<B> {
            /// The values.
            pub fn values(&self) -> &[f32] {
                self.0.as_ref()
            }

            /// The same, borrowed.
            pub fn view(&self) -> $name<&[f32]> {
                $name(self.0.as_ref())
            }

            /// Vectors `range` of those of `width` channels.
            pub fn part(&self, range: std::ops::Range<usize>, width: usize) -> $name<&[f32]> {
                $name(&self.0.as_ref()[range.start * width..range.end * width])
            }
        }

        impl<B: AsMut<[f32]>> $name<B> {
            /// The values, to be changed.
            pub fn values_mut(&mut self) -> &mut [f32] {
                self.0.as_mut()
            }

            /// The same, borrowed to be changed.
            pub fn view_mut(&mut self) -> $name<&mut [f32]> {
                $name(self.0.as_mut())
            }

            /// Vectors `range` of those of `width` channels, to be changed.
            pub fn part_mut(&mut self, range: std::ops::Range<usize>, width: usize) -> $name<&mut [f32]> {
                $name(&mut self.0.as_mut()[range.start * width..range.end * width])
            }
        }
    };
}

scale!(Standardised);
scale!(Metric);

/// Mean and standard deviation of every channel: the way from one scale to the other.
#[derive(Debug)]
pub struct Normaliser {
    mean: Vec<f32>,
    std: Vec<f32>,
}

impl Normaliser {
    /// Of as many means as standard deviations; `name` stands for it in errors.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] for a standard deviation that is not positive.
    ///
    /// # Panics
    /// When there are not as many of both.
    pub fn new(name: &str, mean: Vec<f32>, std: Vec<f32>) -> Result<Self> {
        assert_eq!(mean.len(), std.len(), "a mean and a standard deviation per channel");
        if let Some(i) = std.iter().position(|s| *s <= 0.0) {
            let message = format!("tensor {name}_std is {} at element {i}; standard deviations are positive", std[i]);
            return Err(Error::new(ErrorKind::BundleInvalid, message));
        }
        Ok(Self { mean, std })
    }

    /// Number of channels.
    pub fn width(&self) -> usize {
        self.mean.len()
    }

    /// `(x - mean) / std`, vector by vector.
    ///
    /// # Panics
    /// When lengths differ.
    pub fn standardise(&self, from: Metric<&[f32]>, mut to: Standardised<&mut [f32]>) {
        self.convert(from.0, to.values_mut(), |x, mean, std| (x - mean) / std);
    }

    /// `x std + mean`, vector by vector.
    ///
    /// # Panics
    /// When lengths differ.
    pub fn restore(&self, from: Standardised<&[f32]>, mut to: Metric<&mut [f32]>) {
        self.convert(from.0, to.values_mut(), |x, mean, std| x * std + mean);
    }

    fn convert(&self, from: &[f32], to: &mut [f32], value: impl Fn(f32, f32, f32) -> f32) {
        assert_eq!(from.len(), to.len(), "as many values in either scale");
        let width = self.width();
        for (from, to) in from.chunks_exact(width).zip(to.chunks_exact_mut(width)) {
            for (((to, x), mean), std) in to.iter_mut().zip(from).zip(&self.mean).zip(&self.std) {
                *to = value(*x, *mean, *std);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back() {
        let normaliser = Normaliser::new("x", vec![1.0, -2.0], vec![0.5, 4.0]).unwrap();
        let metric = Metric::new(vec![1.5, 2.0, 1.0, -2.0]);
        let (mut standardised, mut back) = (Standardised::zeros(4), Metric::zeros(4));
        normaliser.standardise(metric.view(), standardised.view_mut());
        assert_eq!(standardised.values(), [1.0, 1.0, 0.0, 0.0]);
        normaliser.restore(standardised.view(), back.view_mut());
        assert_eq!(back, metric);
        assert_eq!(back.part(1..2, 2).values(), [1.0, -2.0]);
        let refused = Normaliser::new("x", vec![0.0; 2], vec![1.0, 0.0]).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::BundleInvalid);
    }
}
