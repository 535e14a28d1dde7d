//! A spherical head: how much later and how much duller an ear hears what comes from an angle.
//!
//! Delays are Woodworth's (1938), the shadow is the one-pole one-zero filter of Brown and Duda
//! (1998).

use crate::frame::SAMPLE_RATE;
use std::f64::consts::{FRAC_PI_2, PI};

/// Radius of the head, metres.
pub const RADIUS: f64 = 0.0875;
/// Speed of sound, m/s.
pub const SPEED: f64 = 343.0;
/// A nearer source is heard as from here, metres from the head's centre.
pub const NEAREST: f64 = 0.3;
/// Least high-frequency gain of the head's shadow.
const SHADOW: f64 = 0.1;
/// Angle from the ear's axis where that is.
const DARKEST: f64 = 150.0 * PI / 180.0;
/// Samples at 24 kHz in which sound passes a radius, bilinear scale of the shadow's filter.
pub const BEND: f64 = SAMPLE_RATE as f64 * RADIUS / SPEED;

/// By how much the way to an ear is longer than that to the head's centre, radii, for a source at
/// `angle` (radians, 0 to pi) from the ear's axis: -1 to pi / 2.
pub fn around(angle: f64) -> f64 {
    if angle < FRAC_PI_2 { -libm::cos(angle) } else { angle - FRAC_PI_2 }
}

/// High-frequency gain of the shadow at that angle, 0.1 to 2.
pub fn brightness(angle: f64) -> f64 {
    (1.0 + SHADOW / 2.0) + (1.0 - SHADOW / 2.0) * libm::cos(angle / DARKEST * PI)
}
