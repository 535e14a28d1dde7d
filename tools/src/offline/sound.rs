//! A sound somewhere, as commands take it: `FILE.wav@x,y,z[:t=SECONDS][:id=N][:db=LEVEL]`.

use super::Wav;
use glam::DVec3;
use std::path::Path;
use visavis::{Error, ErrorKind, Result, SAMPLE_RATE};

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
    /// Number of its source, where one was given.
    pub id: Option<u32>,
}

impl Sound {
    /// Reads `FILE.wav@x,y,z`, metres, with any of `:t=SECONDS` (when it begins, 0), `:id=N` (the
    /// number of its source) and `:db=LEVEL` (the loudest 125 ms are as loud as this 1 m from the
    /// source, dB SPL; without it full scale is 1 pascal).
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another form, numbers that are none, a time below 0 or above
    /// 3600 s, a level outside 0 to 130 dB or of a silent file; those of [`Wav::read`].
    pub fn read(text: &str) -> Result<Self> {
        let Form { file, place, start, id, level } = parse(text)?;
        let path = Path::new(file);
        let mut samples = Wav::read(path)?.to_24k().map_err(|e| e.with_path(path))?;
        if let Some(level) = level {
            let loudest = loudest(&samples);
            if !loudest.is_finite() {
                let message = "the sound is silent, so that no level can be given to it; leave out `:db=`";
                return Err(Error::new(ErrorKind::Argument, message).with_path(path));
            }
            let gain = libm::pow(10.0, (level - loudest) / 20.0) as f32;
            samples.iter_mut().for_each(|s| *s *= gain);
        }
        let name = path.file_stem().map_or_else(|| file.to_owned(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, samples, place, start, id })
    }

    /// When it ends, seconds.
    pub fn end(&self) -> f64 {
        self.start + self.samples.len() as f64 / f64::from(SAMPLE_RATE)
    }
}

/// Level of the loudest 125 ms, dB SPL; of a shorter sound, as if silence followed.
fn loudest(samples: &[f32]) -> f64 {
    const WINDOW: usize = SAMPLE_RATE as usize / 8;
    let (mut sum, mut most) = (0.0, 0.0f64);
    for (i, s) in samples.iter().enumerate() {
        sum += f64::from(*s).powi(2);
        if let Some(gone) = i.checked_sub(WINDOW) {
            sum -= f64::from(samples[gone]).powi(2);
        }
        most = most.max(sum);
    }
    94.0 + 10.0 * libm::log10(most / WINDOW as f64)
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Form<'a> {
    file: &'a str,
    place: DVec3,
    start: f64,
    id: Option<u32>,
    level: Option<f64>,
}

fn parse(text: &str) -> Result<Form<'_>> {
    let bad = |why: &str| {
        let message =
            format!("the sound `{text}` {why}; give FILE.wav@x,y,z, and if you like :t=SECONDS, :id=NUMBER, :db=LEVEL");
        Error::new(ErrorKind::Argument, message)
    };
    let (file, rest) = text.rsplit_once('@').ok_or_else(|| bad("has no place"))?;
    if file.is_empty() {
        return Err(bad("has no file"));
    }
    let mut parts = rest.split(':');
    let numbers: Result<Vec<f64>, _> = parts.next().unwrap_or_default().split(',').map(|n| n.trim().parse()).collect();
    let place: [f64; 3] =
        (numbers.ok()).and_then(|n| n.try_into().ok()).ok_or_else(|| bad("is not at three numbers"))?;
    if !place.iter().all(|v| v.is_finite()) {
        return Err(bad("is at a place that is no number"));
    }
    let mut form = Form { file, place: DVec3::from_array(place), start: 0.0, id: None, level: None };
    for part in parts {
        let (name, value) = part.split_once('=').ok_or_else(|| bad("has something behind its place"))?;
        match name {
            "t" => form.start = value.trim().parse().map_err(|_| bad("begins at no time"))?,
            "id" => form.id = Some(value.trim().parse().map_err(|_| bad("has an id that is no whole number"))?),
            "db" => form.level = Some(value.trim().parse().map_err(|_| bad("has a level that is no number"))?),
            _ => return Err(bad("has something behind its place")),
        }
    }
    if !(0.0..=3600.0).contains(&form.start) {
        return Err(bad("begins before the clip, or never"));
    }
    if form.level.is_some_and(|level| !(0.0..=130.0).contains(&level)) {
        return Err(bad("has a level outside 0 to 130 dB"));
    }
    Ok(form)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_is_read_and_mistakes_are_told() {
        let form = parse("a@b/bang.wav@2.0,0.5,-3:t=6.5").unwrap();
        assert_eq!((form.file, form.place, form.start), ("a@b/bang.wav", DVec3::new(2.0, 0.5, -3.0), 6.5));
        let form = parse("bang.wav@1,1,1:db=88:id=7").unwrap();
        assert_eq!((form.start, form.id, form.level), (0.0, Some(7), Some(88.0)));
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
            "bang.wav@1,1,1:id=-1",
            "bang.wav@1,1,1:db=131",
            "bang.wav@1,1,1:db=NaN",
            "bang.wav@1,1,1:loud=3",
            "bang.wav@1,1,1:",
        ] {
            assert_eq!(parse(bad).unwrap_err().kind(), ErrorKind::Argument, "{bad}");
        }
    }

    #[test]
    fn levels_are_those_of_the_loudest_eighth_of_a_second() {
        let mut samples = vec![0.1; 24_000];
        samples[4_000..7_000].fill(-1.0);
        assert!((loudest(&samples) - 94.0).abs() < 1e-9);
        // Half as long is half the power.
        assert!((loudest(&vec![1.0; 1_500]) - 90.99).abs() < 0.01);
        assert_eq!(loudest(&[0.0; 100]), f64::NEG_INFINITY);
    }
}
