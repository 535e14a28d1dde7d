//! A sound somewhere, as the command takes it: `FILE.wav@x,y,z[:t=SECONDS]`.

use crate::offline::Wav;
use glam::DVec3;
use std::path::Path;
use visavis::internals::audio::ears::check_place;
use visavis::{Error, ErrorKind, Result};

/// A sound somewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Sound {
    /// What it is called.
    pub name: String,
    /// Samples at 24 kHz, pascals as they are at 1 m.
    pub samples: Vec<f32>,
    /// Where, metres.
    pub place: DVec3,
    /// When it begins, seconds.
    pub start: f64,
}

impl Sound {
    /// Reads `FILE.wav@x,y,z[:t=SECONDS]`.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another form, numbers that are none, a time below 0 or above 3600
    /// s, a place that cannot be; those of [`Wav::read`].
    pub fn read(text: &str) -> Result<Self> {
        let (file, place, start) = parse(text)?;
        let path = Path::new(file);
        let samples = Wav::read(path)?.to_24k().map_err(|e| e.with_path(path))?;
        let name = path.file_stem().map_or_else(|| file.to_owned(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, samples, place, start })
    }
}

/// File, place and start.
fn parse(text: &str) -> Result<(&str, DVec3, f64)> {
    let bad = |why: &str| {
        Error::new(
            ErrorKind::Argument,
            format!("the sound `{text}` {why}; give FILE.wav@x,y,z or FILE.wav@x,y,z:t=SECONDS"),
        )
    };
    let (file, rest) = text.rsplit_once('@').ok_or_else(|| bad("has no place"))?;
    if file.is_empty() {
        return Err(bad("has no file"));
    }
    let (place, start) = match rest.split_once(":t=") {
        Some((place, start)) => (place, start.trim().parse::<f64>().map_err(|_| bad("begins at no time"))?),
        None => (rest, 0.0),
    };
    if !(0.0..=3600.0).contains(&start) {
        return Err(bad("begins before the clip, or never"));
    }
    let numbers: Result<Vec<f64>, _> = place.split(',').map(|n| n.trim().parse::<f64>()).collect();
    let place: [f64; 3] =
        (numbers.ok()).and_then(|n| n.try_into().ok()).ok_or_else(|| bad("is not at three numbers"))?;
    check_place(place)?;
    Ok((file, DVec3::from_array(place), start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn place_and_time_are_read_and_mistakes_are_told() {
        let (file, place, start) = parse("a@b/bang.wav@2.0,0.5,-3:t=6.5").unwrap();
        assert_eq!((file, place, start), ("a@b/bang.wav", DVec3::new(2.0, 0.5, -3.0), 6.5));
        assert_eq!(parse("bang.wav@1,1,1").unwrap().2, 0.0);
        for bad in [
            "bang.wav",
            "@1,1,1",
            "bang.wav@1,1",
            "bang.wav@1,1,1,1",
            "bang.wav@NaN,1,1",
            "bang.wav@1,inf,1",
            "bang.wav@a,1,1",
            "bang.wav@1,1,1:t=",
            "bang.wav@1,1,1:t=-1",
            "bang.wav@1,1,1:t=NaN",
            "bang.wav@0,1.6,0.05",
            "bang.wav@200,1,1",
        ] {
            assert_eq!(parse(bad).unwrap_err().kind(), ErrorKind::Argument, "{bad}");
        }
    }
}
