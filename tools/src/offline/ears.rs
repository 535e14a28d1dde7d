//! What two microphones hear, as commands take it: `STEREO.wav[:t=SECONDS]`.

use super::Wav;
use std::path::Path;
use visavis::{Error, ErrorKind, Result, SAMPLE_RATE};

/// What the agent's ears hear.
#[derive(Debug, Clone, PartialEq)]
pub struct Ears {
    /// What it is called.
    pub name: String,
    /// Samples of the left and of the right ear at 24 kHz, pascals.
    pub samples: [Vec<f32>; 2],
    /// When it begins, seconds.
    pub start: f64,
}

impl Ears {
    /// Reads `STEREO.wav`, left channel first, full scale 1 pascal, with `:t=SECONDS` when it
    /// begins (0).
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a time below 0 or above 3600 s, those of [`Wav::read_pair`].
    pub fn read(text: &str) -> Result<Self> {
        let (file, start) = parse(text)?;
        let path = Path::new(file);
        let [left, right] = Wav::read_pair(path)?.map(|ear| ear.to_24k().map_err(|e| e.with_path(path)));
        let name = path.file_stem().map_or_else(|| file.to_owned(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, samples: [left?, right?], start })
    }

    /// When it ends, seconds.
    pub fn end(&self) -> f64 {
        self.start + self.samples[0].len() as f64 / f64::from(SAMPLE_RATE)
    }
}

fn parse(text: &str) -> Result<(&str, f64)> {
    let bad = |why: &str| {
        let message = format!("the ears `{text}` {why}; give STEREO.wav, and if you like :t=SECONDS");
        Error::new(ErrorKind::Argument, message)
    };
    let (file, start) = match text.rsplit_once(":t=") {
        Some((file, start)) => (file, start.trim().parse().map_err(|_| bad("begin at no time"))?),
        None => (text, 0.0),
    };
    if file.is_empty() {
        return Err(bad("have no file"));
    }
    if !(0.0..=3600.0).contains(&start) {
        return Err(bad("begin before the clip, or never"));
    }
    Ok((file, start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_is_read_and_mistakes_are_told() {
        assert_eq!(parse("a:b/ears.wav").unwrap(), ("a:b/ears.wav", 0.0));
        assert_eq!(parse("ears.wav:t=2.5").unwrap(), ("ears.wav", 2.5));
        for bad in ["", ":t=1", "ears.wav:t=", "ears.wav:t=-1", "ears.wav:t=NaN", "ears.wav:t=3601"] {
            assert_eq!(parse(bad).unwrap_err().kind(), ErrorKind::Argument, "{bad}");
        }
    }
}
