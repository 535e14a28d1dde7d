//! The reference: [`math`]'s functions, value by value; variants are the same bodies, compiled for their level.

use crate::kernels::math;

pub(super) fn gelu(x: &mut [f32]) {
    gelu_body(x);
}

pub(super) fn silu(x: &mut [f32]) {
    silu_body(x);
}

#[inline(always)]
pub(super) fn gelu_body(x: &mut [f32]) {
    for v in x {
        *v = math::gelu(*v);
    }
}

#[inline(always)]
pub(super) fn silu_body(x: &mut [f32]) {
    for v in x {
        *v = math::silu(*v);
    }
}
