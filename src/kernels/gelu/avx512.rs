use super::scalar::{gelu_body, silu_body};

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn gelu(x: &mut [f32]) {
    gelu_body(x);
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn silu(x: &mut [f32]) {
    silu_body(x);
}
