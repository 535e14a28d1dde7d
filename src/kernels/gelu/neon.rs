use super::scalar::{gelu_body, silu_body};

#[target_feature(enable = "neon")]
pub(super) fn gelu(x: &mut [f32]) {
    gelu_body(x);
}

#[target_feature(enable = "neon")]
pub(super) fn silu(x: &mut [f32]) {
    silu_body(x);
}
