use super::scalar::body;
use super::{Finish, Sums};

#[target_feature(enable = "neon")]
pub(super) fn run(sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    body(sums, bias, finish, y);
}
