//! Who speaks when, from a voice's energy.

use super::RATE;
use visavis::internals::frame::FRAME_SAMPLES;

/// Frames quieter than this are not speech, RMS of full scale (-45 dB).
const FLOOR: f64 = 0.005_623;
/// Frames quieter than the voice's loud frames (95th percentile) by this factor are not speech (-30
/// dB).
const BELOW_LOUD: f64 = 0.031_623;
/// Pauses up to twice this long belong to the speech around them, seconds.
const HANGOVER: f64 = 0.2;

/// Root-mean-square level of a 24 kHz mono voice in each of the first `frames` frames, 0 to 1; zero
/// past its end.
pub fn envelope(voice: &[f32], frames: usize) -> Vec<f64> {
    (0..frames)
        .map(|i| {
            let start = (i * FRAME_SAMPLES).min(voice.len());
            let samples = &voice[start..(start + FRAME_SAMPLES).min(voice.len())];
            let energy: f64 = samples.iter().map(|&s| f64::from(s) * f64::from(s)).sum();
            (energy / FRAME_SAMPLES as f64).sqrt()
        })
        .collect()
}

/// Which frames are speech: louder than -45 dB of full scale and than 30 dB below the voice's own
/// loud frames, or within 0.2 s of such a frame.
pub fn speech_frames(voice: &[f32], frames: usize) -> Vec<bool> {
    let levels = envelope(voice, frames);
    let mut sorted = levels.clone();
    sorted.sort_by(f64::total_cmp);
    let loud = sorted.get(frames.saturating_sub(1) * 95 / 100).copied().unwrap_or(0.0);
    let threshold = FLOOR.max(loud * BELOW_LOUD);
    let reach = (HANGOVER * RATE).round() as usize;
    let active = |i: usize| levels[i.saturating_sub(reach)..(i + reach + 1).min(frames)].iter().any(|&l| l > threshold);
    (0..frames).map(active).collect()
}

/// Whether a clip counts as speaking (S) rather than non-speaking (NS): at least half of its frames
/// are speech.
///
/// SARAH 4 classifies clips by the agent's audio energy and leaves the threshold open.
pub fn is_speaking(voice: &[f32], frames: usize) -> bool {
    let speech = speech_frames(voice, frames);
    frames > 0 && 2 * speech.iter().filter(|&&s| s).count() >= frames
}

#[cfg(test)]
mod tests {
    use super::super::testing::close;
    use super::*;

    fn tone(level: f32, seconds: f32) -> Vec<f32> {
        (0..(seconds * 24_000.0) as usize)
            .map(|i| level * ((i % 80) as f32 * std::f32::consts::TAU / 80.0).sin())
            .collect()
    }

    #[test]
    fn a_sine_has_the_level_of_a_sine() {
        let levels = envelope(&tone(0.5, 1.0), 31);
        close(levels[7], 0.5 / 2_f64.sqrt(), 1e-6);
        assert_eq!(levels[30], 0.0);
    }

    #[test]
    fn speech_then_silence() {
        let mut voice = tone(0.3, 1.0);
        voice.extend(tone(0.001, 2.0));
        let speech = speech_frames(&voice, 90);
        // 30 loud frames and a hangover of 6.
        assert_eq!(speech.iter().filter(|&&s| s).count(), 36);
        assert!(speech[..36].iter().all(|&s| s));
        assert!(!is_speaking(&voice, 90));
        assert!(is_speaking(&voice, 60));
    }

    #[test]
    fn hum_beside_a_loud_voice_is_not_speech() {
        let mut voice = tone(0.9, 1.0);
        voice.extend(tone(0.02, 1.0));
        assert!(!speech_frames(&voice, 60)[50]);
        assert!(speech_frames(&tone(0.02, 1.0), 30)[15]);
    }

    #[test]
    fn silence_and_nothing() {
        assert!(!is_speaking(&[0.0; 24_000], 30));
        assert!(!is_speaking(&[], 0));
    }
}
