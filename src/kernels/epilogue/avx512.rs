use super::scalar::body;
use super::{Finish, Sums};

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn run(sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    body(sums, bias, finish, y);
}
