use super::Head;
use super::scalar::body;

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn f16(head: &Head<'_, half::f16>, q: &[f32], out: &mut [f32]) {
    body(head, q, out, half::f16::to_f32);
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn f32(head: &Head<'_, f32>, q: &[f32], out: &mut [f32]) {
    body(head, q, out, |v| v);
}
