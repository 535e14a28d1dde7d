//! WAV files of any rate, sample format and up to eight channels, read whole as mono `f32`.

use std::io::{Cursor, Read};
use std::path::Path;
use visavis::internals::audio::{check_rate, resample_to_24k};
use visavis::{Error, ErrorKind, Result};

/// Most channels that are mixed down.
const MAX_CHANNELS: u16 = 8;
/// Loudest sample of a float file, full scale 1: as loud as a 32-bit number read without its scale.
/// What is far beyond is no sound, and adding channels or filtering would make infinities of it.
const LOUDEST: f32 = (1u64 << 32) as f32;
/// Longest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// A sound read from a file: mono, at the file's own rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Wav {
    /// Samples, full scale 1.0, finite; the mean over the file's channels.
    pub samples: Vec<f32>,
    /// Sample rate, Hz, 8000 to 192000.
    pub rate: u32,
}

impl Wav {
    /// Reads `path`: PCM of 8, 16, 24 or 32 bits or 32-bit float, one to eight channels (averaged),
    /// 8 to 192 kHz, at most 1 GiB.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when the file cannot be read; [`ErrorKind::Audio`], naming the file, when
    /// it is empty, not WAV, of a format not listed above, cut off (fewer samples than its header
    /// says), or holds NaN, infinity or what is no sound.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = visavis::internals::bounded::read(path, MAX_BYTES)
            .map_err(|e| Error::io("read the sound file", path, e))?;
        Self::parse(&bytes).map_err(|e| e.with_path(path))
    }

    /// As [`Wav::read`], the left and the right channel of a file that has two.
    ///
    /// # Errors
    /// As [`Wav::read`], and for another number of channels.
    pub fn read_pair(path: impl AsRef<Path>) -> Result<[Self; 2]> {
        let path = path.as_ref();
        let bytes = visavis::internals::bounded::read(path, MAX_BYTES)
            .map_err(|e| Error::io("read the sound file", path, e))?;
        Self::parse_pair(&bytes).map_err(|e| e.with_path(path))
    }

    fn parse_pair(bytes: &[u8]) -> Result<[Self; 2]> {
        let (Self { samples, rate }, channels) = Self::parse_as(bytes, true)?;
        if channels != 2 {
            return Err(bad(format!("{channels} channels; ears are a stereo file, the left one first")));
        }
        Ok([0, 1].map(|side| Self { samples: samples.iter().skip(side).step_by(2).copied().collect(), rate }))
    }

    /// As [`Wav::read`], from the bytes of a file.
    ///
    /// # Errors
    /// As [`Wav::read`], without a file name.
    pub fn parse(bytes: &[u8]) -> Result<Self> {
        Self::parse_as(bytes, false).map(|(wav, _)| wav)
    }

    /// With `apart`, the samples of all channels in turn; and how many channels there are.
    fn parse_as(bytes: &[u8], apart: bool) -> Result<(Self, usize)> {
        let chunks = Chunks::find(bytes)?;
        if chunks.data_len > chunks.data.len() {
            return Err(bad(format!(
                "the file is cut off: its header says {} bytes of samples, {} are there; copy or record it again \
                 (a file written to a pipe has no true length: write it to a file instead)",
                chunks.data_len,
                chunks.data.len()
            )));
        }
        let data_len = (chunks.data_len as u32).to_le_bytes();
        // Only `fmt ` and `data`, so that nothing in between can mislead the decoder.
        let head = [&b"RIFF\0\0\0\0WAVE"[..], chunks.format, b"data", &data_len].concat();
        chunks.check_width()?;
        let reader = hound::WavReader::new(Cursor::new(head).chain(chunks.data)).map_err(|e| decode_error(&e))?;
        Self::decode(reader, apart)
    }

    fn decode(mut reader: hound::WavReader<impl Read>, apart: bool) -> Result<(Self, usize)> {
        let spec = reader.spec();
        check_rate(spec.sample_rate)?;
        if spec.channels > MAX_CHANNELS {
            return Err(bad(format!("{} channels; mix it down to at most {MAX_CHANNELS}", spec.channels)));
        }
        if reader.len() == 0 {
            return Err(bad("there are no samples in it; record or convert it again"));
        }
        let channels = usize::from(spec.channels);
        let mixed = if apart { 1 } else { channels };
        let mut samples = Vec::with_capacity(reader.len() as usize / mixed);
        match spec.sample_format {
            hound::SampleFormat::Float => mix(reader.samples::<f32>(), mixed, 1.0, &mut samples)?,
            hound::SampleFormat::Int => {
                let scale = 1.0 / (1u64 << (spec.bits_per_sample - 1)) as f32;
                mix(reader.samples::<i32>().map(|s| s.map(|v| v as f32)), mixed, scale, &mut samples)?;
            }
        }
        Ok((Self { samples, rate: spec.sample_rate }, channels))
    }

    /// Length, seconds.
    pub fn seconds(&self) -> f64 {
        self.samples.len() as f64 / f64::from(self.rate)
    }

    /// The whole sound at 24 kHz, sample `n` at time `n / 24000` s.
    ///
    /// # Errors
    /// As [`resample_to_24k`]; none for a sound from [`Wav::read`].
    pub fn to_24k(&self) -> Result<Vec<f32>> {
        resample_to_24k(&self.samples, self.rate)
    }
}

/// Averages interleaved channels and scales.
fn mix(
    values: impl Iterator<Item = hound::Result<f32>>,
    channels: usize,
    scale: f32,
    out: &mut Vec<f32>,
) -> Result<()> {
    let scale = scale / channels as f32;
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        let value = value.map_err(|e| decode_error(&e))?;
        if !value.is_finite() {
            return Err(bad(format!("sample {} is not a finite number; export the sound again", out.len())));
        }
        if value.abs() > LOUDEST {
            return Err(bad(format!(
                "sample {} is {value:e} where full scale is 1; export the sound again",
                out.len()
            )));
        }
        sum += value;
        count += 1;
        if count == channels {
            out.push(sum * scale);
            (sum, count) = (0.0, 0);
        }
    }
    Ok(())
}

/// The two chunks of a WAV file that matter.
struct Chunks<'a> {
    /// `fmt ` with its header.
    format: &'a [u8],
    /// What there is of `data`.
    data: &'a [u8],
    /// What the header says there is of `data`, bytes.
    data_len: usize,
}

impl<'a> Chunks<'a> {
    /// Refuses an extensible format (`0xFFFE`) that claims more valid bits than its samples have,
    /// or none.
    fn check_width(&self) -> Result<()> {
        let field = |at: usize| self.format.get(8 + at..10 + at).map_or(0, |b| u16::from_le_bytes([b[0], b[1]]));
        let (kind, container, valid) = (field(0), field(14), field(18));
        if kind == 0xFFFE && self.format.len() >= 28 && (valid == 0 || valid > container.min(32)) {
            return Err(bad(format!(
                "its header says that {valid} bits of {container} are valid; convert it to 16-bit PCM, for example with \
                 `sox in.wav -b 16 out.wav`"
            )));
        }
        Ok(())
    }

    fn find(bytes: &'a [u8]) -> Result<Self> {
        if bytes.is_empty() {
            return Err(bad("the file is empty; record or convert it again"));
        }
        if bytes.len() < 12 || &bytes[..4] != b"RIFF" || &bytes[8..12] != b"WAVE" {
            return Err(bad("not a WAV file; convert it, for example with `sox in.mp3 out.wav`"));
        }
        let mut rest = &bytes[12..];
        let mut format = None;
        while rest.len() >= 8 {
            let len = u32::from_le_bytes([rest[4], rest[5], rest[6], rest[7]]) as usize;
            let body = &rest[8..];
            match &rest[..4] {
                b"data" => {
                    let format = format.ok_or_else(|| bad("no format chunk before its samples; convert it again"))?;
                    return Ok(Self { format, data: &body[..len.min(body.len())], data_len: len });
                }
                b"fmt " if len <= body.len() => format = Some(&rest[..8 + len]),
                _ => {}
            }
            // Chunks are padded to even length.
            rest = body.get(len + (len & 1)..).unwrap_or_default();
        }
        Err(bad("the file is cut off before its samples; copy or record it again"))
    }
}

fn decode_error(e: &hound::Error) -> Error {
    let advice = "convert it to 16-bit PCM, for example with `sox in.wav -b 16 out.wav`";
    match e {
        hound::Error::IoError(_) => bad("the file is cut off within its header; copy or record it again"),
        hound::Error::FormatError(what) => bad(format!("not a usable WAV file ({what}); {advice}")),
        _ => bad(format!("samples are compressed or of an unusual width; {advice}")),
    }
}

fn bad(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::Audio, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hound::{SampleFormat, WavSpec, WavWriter};

    fn file(channels: u16, rate: u32, bits: u16, format: SampleFormat, samples: &[f32]) -> Vec<u8> {
        let spec = WavSpec { channels, sample_rate: rate, bits_per_sample: bits, sample_format: format };
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = WavWriter::new(&mut bytes, spec).unwrap();
        for &s in samples {
            match format {
                SampleFormat::Float => writer.write_sample(s).unwrap(),
                SampleFormat::Int => {
                    writer.write_sample((f64::from(s) * f64::from(1u32 << (bits - 1))) as i32).unwrap();
                }
            }
        }
        writer.finalize().unwrap();
        bytes.into_inner()
    }

    fn refused(bytes: &[u8], part: &str) {
        let e = Wav::parse(bytes).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Audio);
        assert!(e.to_string().contains(part), "{e}");
    }

    #[test]
    fn ears_are_two_channels() {
        let stereo = file(2, 48_000, 32, SampleFormat::Float, &SAMPLES);
        let [left, right] = Wav::parse_pair(&stereo).unwrap();
        assert_eq!((left.samples, left.rate), (vec![0.0, -0.5, -1.0, 0.125], 48_000));
        assert_eq!(right.samples, [0.5, 0.25, 0.75, -0.875]);
        for channels in [1, 4] {
            let other = file(channels, 24_000, 16, SampleFormat::Int, &SAMPLES);
            assert_eq!(Wav::parse_pair(&other).unwrap_err().kind(), ErrorKind::Audio);
        }
    }

    const SAMPLES: [f32; 8] = [0.0, 0.5, -0.5, 0.25, -1.0, 0.75, 0.125, -0.875];

    #[test]
    fn every_format_gives_the_same_samples() {
        for (bits, format) in [
            (8, SampleFormat::Int),
            (16, SampleFormat::Int),
            (24, SampleFormat::Int),
            (32, SampleFormat::Int),
            (32, SampleFormat::Float),
        ] {
            let wav = Wav::parse(&file(1, 22_050, bits, format, &SAMPLES)).unwrap();
            assert_eq!((wav.rate, &wav.samples[..]), (22_050, &SAMPLES[..]), "{bits} {format:?}");
        }
    }

    #[test]
    fn channels_are_averaged() {
        let wav = Wav::parse(&file(2, 48_000, 16, SampleFormat::Int, &SAMPLES)).unwrap();
        assert_eq!(wav.samples, [0.25, -0.125, -0.125, -0.375]);
        let wav = Wav::parse(&file(8, 48_000, 32, SampleFormat::Float, &SAMPLES)).unwrap();
        assert_eq!(wav.samples, [SAMPLES.iter().sum::<f32>() / 8.0]);
        refused(&file(9, 48_000, 16, SampleFormat::Int, &[0.0; 9]), "9 channels");
    }

    #[test]
    fn odd_chunks_between_header_and_samples_are_skipped() {
        let bytes = file(1, 16_000, 16, SampleFormat::Int, &SAMPLES);
        let at = bytes.windows(4).position(|w| w == b"data").unwrap();
        let odd = [&bytes[..at], b"LIST\x05\0\0\0abcde\0", &bytes[at..]].concat();
        assert_eq!(Wav::parse(&odd).unwrap().samples, SAMPLES);
    }

    #[test]
    fn what_is_not_usable_is_said() {
        refused(b"", "empty");
        refused(b"ID3 something else entirely", "not a WAV");
        refused(&file(1, 16_000, 16, SampleFormat::Int, &[]), "no samples");
        refused(&file(1, 7_999, 16, SampleFormat::Int, &SAMPLES), "7999 Hz");
        refused(&file(1, 192_001, 16, SampleFormat::Int, &SAMPLES), "192001 Hz");
        refused(&file(1, 16_000, 32, SampleFormat::Float, &[0.0, f32::NAN]), "sample 1");
        refused(&file(1, 16_000, 32, SampleFormat::Float, &[f32::INFINITY]), "sample 0");
        refused(&file(1, 16_000, 32, SampleFormat::Float, &[0.0, -3e38]), "sample 1 is -3e38");
        let mut zero = file(1, 16_000, 16, SampleFormat::Int, &SAMPLES);
        zero[24..32].fill(0);
        refused(&zero, "0 Hz");
        let mut compressed = file(1, 16_000, 16, SampleFormat::Int, &SAMPLES);
        compressed[20] = 0x55;
        refused(&compressed, "compressed");
    }

    #[test]
    fn more_valid_bits_than_bits_are_refused() {
        let format = |bits: u16, valid: u16| {
            let mut bytes = b"RIFF\0\0\0\0WAVEfmt \x28\0\0\0\xfe\xff\x01\0\x80\xbb\0\0\0\x77\x01\0".to_vec();
            bytes.extend((bits / 8).to_le_bytes());
            bytes.extend(bits.to_le_bytes());
            bytes.extend(22u16.to_le_bytes());
            bytes.extend(valid.to_le_bytes());
            bytes.extend([4, 0, 0, 0]);
            bytes.extend(b"\x01\0\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71data\x08\0\0\0\0\x40\0\xc0\0\x20\0\xe0");
            bytes
        };
        assert_eq!(Wav::parse(&format(16, 16)).unwrap().samples, [0.5, -0.5, 0.25, -0.25]);
        for (bits, valid) in [(16, 0), (16, 17), (16, 40), (16, 65_496), (32, 33), (24, 64)] {
            refused(&format(bits, valid), "bits of");
        }
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let bytes = file(1, 16_000, 16, SampleFormat::Int, &SAMPLES);
        for len in 0..bytes.len() {
            let e = Wav::parse(&bytes[..len]).unwrap_err();
            assert_eq!(e.kind(), ErrorKind::Audio);
        }
        refused(&bytes[..bytes.len() - 1], "cut off");
        refused(&bytes[..40], "cut off before");
    }

    #[test]
    fn the_loudest_stay_finite() {
        for channels in [1, 8] {
            let bytes =
                file(channels, 48_000, 32, SampleFormat::Float, &[LOUDEST, -LOUDEST, LOUDEST, LOUDEST].repeat(20));
            let wav = Wav::parse(&bytes).unwrap();
            assert!(wav.samples.iter().chain(&wav.to_24k().unwrap()).all(|s| s.is_finite()));
        }
    }

    #[test]
    fn errors_name_the_file() {
        let e = Wav::read("no/such.wav").unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(Path::new("no/such.wav"))));
        let e = Wav::read("Cargo.toml").unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Audio, Some(Path::new("Cargo.toml"))));
    }
}
