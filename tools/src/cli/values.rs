//! Values that several commands take.

use clap::Args;

/// A gaze target, or `off`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaze(pub Option<f32>);

/// Guidance weights, as several commands take them.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct GuidanceArgs {
    /// Guidance weight, 0 to 20 (1 is none) [default: the model's]
    #[arg(long, value_name = "W", value_parser = weight, allow_negative_numbers = true)]
    pub guidance: Option<f32>,
    /// Gaze guidance weight, 0 to 20 [default: the model's]
    #[arg(long, value_name = "W", value_parser = weight, allow_negative_numbers = true)]
    pub gaze_guidance: Option<f32>,
}

pub(super) fn gaze(text: &str) -> Result<Gaze, String> {
    if text == "off" {
        return Ok(Gaze(None));
    }
    number(text, -1.0, 1.0).map(|g| Gaze(Some(g))).map_err(|e| format!("{e}, or off"))
}

pub(super) fn sensitivity(text: &str) -> Result<f32, String> {
    match text {
        "dull" => Ok(-1.0),
        "neutral" => Ok(0.0),
        "sensitive" => Ok(1.0),
        _ => number(text, -1.5, 1.5).map_err(|e| format!("{e}, or dull, neutral, sensitive")),
    }
}

fn weight(text: &str) -> Result<f32, String> {
    number(text, 0.0, 20.0)
}

pub(super) fn temperature(text: &str) -> Result<f32, String> {
    number(text, 0.0, 2.0)
}

pub(super) fn flow_time(text: &str) -> Result<f32, String> {
    number(text, 0.0, 1.0)
}

pub(super) fn number(text: &str, low: f32, high: f32) -> Result<f32, String> {
    match text.parse() {
        Ok(value) if (low..=high).contains(&value) => Ok(value),
        _ => Err(format!("it is a number from {low} to {high}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused() {
        for bad in ["-1.1", "1.1", "NaN", "on", ""] {
            assert!(gaze(bad).is_err(), "{bad}");
        }
        assert_eq!((gaze("off"), gaze("-1")), (Ok(Gaze(None)), Ok(Gaze(Some(-1.0)))));
        assert_eq!(
            ["dull", "neutral", "sensitive", "-1.5"].map(|text| sensitivity(text).unwrap()),
            [-1.0, 0.0, 1.0, -1.5]
        );
        assert!(sensitivity("1.6").is_err() && sensitivity("loud").is_err());
        assert!(weight("20.5").is_err() && weight("inf").is_err());
    }
}
