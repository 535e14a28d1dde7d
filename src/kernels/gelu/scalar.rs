//! The reference: [`math`]'s functions, value by value.

use super::Activation;
use crate::kernels::math;

#[inline(always)]
pub(super) fn run(activation: Activation, x: &mut [f32]) {
    match activation {
        Activation::Gelu => x.iter_mut().for_each(|v| *v = math::gelu(*v)),
        Activation::Silu => x.iter_mut().for_each(|v| *v = math::silu(*v)),
    }
}
