//! Fourier transforms of powers of two in f64, the same bits on every CPU: sums in a fixed order,
//! sines of `libm`. (Crates with SIMD variants round differently from CPU to CPU.)

use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// `re + i im`.
    pub const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    /// `e^(i angle)`.
    pub fn turn(angle: f64) -> Self {
        let (im, re) = libm::sincos(angle);
        Self { re, im }
    }

    /// The conjugate.
    #[must_use]
    pub fn conj(self) -> Self {
        Self { re: self.re, im: -self.im }
    }

    /// Square of the magnitude.
    pub fn power(self) -> f64 {
        self.re * self.re + self.im * self.im
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { re: self.re + o.re, im: self.im + o.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { re: self.re - o.re, im: self.im - o.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self { re: self.re * o.re - self.im * o.im, im: self.re * o.im + self.im * o.re }
    }
}

/// Transforms of one size.
#[derive(Debug)]
pub struct Fft {
    /// `e^(-2 pi i k / n)` of the first half.
    turns: Vec<Complex>,
}

impl Fft {
    /// Of `n` values, a power of two of at least 2.
    ///
    /// # Panics
    /// For another number.
    pub fn new(n: usize) -> Self {
        assert!(n >= 2 && n.is_power_of_two(), "a power of two");
        Self { turns: (0..n / 2).map(|k| Complex::turn(-TAU * k as f64 / n as f64)).collect() }
    }

    /// Values of a transform.
    pub fn size(&self) -> usize {
        2 * self.turns.len()
    }

    /// `X_k = sum_t x_t e^(-2 pi i k t / n)`, in place.
    ///
    /// # Panics
    /// When `x` is not [`Fft::size`] long.
    pub fn forward(&self, x: &mut [Complex]) {
        let n = self.size();
        assert_eq!(x.len(), n, "as many values as the transform has");
        let shift = usize::BITS - n.trailing_zeros();
        for i in 0..n {
            let j = i.reverse_bits() >> shift;
            if i < j {
                x.swap(i, j);
            }
        }
        let mut half = 1;
        while half < n {
            let stride = n / (2 * half);
            for part in x.chunks_exact_mut(2 * half) {
                let (low, high) = part.split_at_mut(half);
                for ((a, b), turn) in low.iter_mut().zip(high).zip(self.turns.iter().step_by(stride)) {
                    let c = *b * *turn;
                    (*a, *b) = (*a + c, *a - c);
                }
            }
            half *= 2;
        }
    }

    /// The inverse of [`Fft::forward`], in place.
    ///
    /// # Panics
    /// As [`Fft::forward`].
    #[cfg(any(test, feature = "internals"))]
    pub fn inverse(&self, x: &mut [Complex]) {
        x.iter_mut().for_each(|v| *v = v.conj());
        self.forward(x);
        let scale = 1.0 / x.len() as f64;
        x.iter_mut().for_each(|v| *v = Complex::new(v.re * scale, -v.im * scale));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_its_definition_and_comes_back() {
        for n in [2usize, 8, 64] {
            let x: Vec<_> = (0..n).map(|i| Complex::new((i * i % 7) as f64 - 3.0, (i % 5) as f64)).collect();
            let mut y = x.clone();
            let fft = Fft::new(n);
            fft.forward(&mut y);
            for (k, y) in y.iter().enumerate() {
                let term = |(t, x): (usize, &Complex)| *x * Complex::turn(-TAU * (k * t % n) as f64 / n as f64);
                let sum = x.iter().enumerate().map(term).fold(Complex::default(), Add::add);
                assert!((*y - sum).power() < 1e-20, "{n} {k}");
            }
            fft.inverse(&mut y);
            assert!(x.iter().zip(&y).all(|(a, b)| (*a - *b).power() < 1e-24), "{n}");
        }
    }
}
