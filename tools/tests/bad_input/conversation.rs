//! Voices and paths that are not usable, as `generate` reads them.

use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind};
use visavis_tools::offline::Conversation;
use visavis_tools::offline::UserPath;
use visavis_tools::offline::Wav;

/// A file that lives as long as the test needs it.
struct Given(PathBuf);

impl Given {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("given-{}-{name}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for Given {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn sound(samples: usize) -> Vec<u8> {
    let mut bytes = b"RIFF\0\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x80\x3e\0\0\0\x7d\0\0\x02\0\x10\0data".to_vec();
    bytes.extend(((2 * samples) as u32).to_le_bytes());
    bytes.extend((0..samples).flat_map(|i| ((i % 100) as i16 * 50).to_le_bytes()));
    bytes
}

/// Reads a file as each of the two voices.
fn voice_error(name: &str, bytes: &[u8]) -> Error {
    let file = Given::new(name, bytes);
    let as_user = Conversation::read(None, Some(&file.0), None).unwrap_err();
    let as_agent = Conversation::read(Some(&file.0), None, None).unwrap_err();
    assert_eq!(as_user.kind(), as_agent.kind());
    assert_eq!(as_agent.path(), Some(file.0.as_path()), "{as_agent}");
    as_agent
}

fn path_error(name: &str, text: &[u8]) -> Error {
    let file = Given::new(name, text);
    let e = Conversation::read(None, None, Some(&file.0)).unwrap_err();
    assert_eq!(e.path(), Some(file.0.as_path()), "{e}");
    e
}

#[test]
fn sounds_that_are_not_usable_are_named() {
    for (name, bytes, part) in [
        ("empty.wav", Vec::new(), "empty"),
        ("silent.wav", sound(0), "no samples"),
        ("text.wav", b"this is not a sound at all".to_vec(), "not a WAV"),
        ("song.mp3", [&b"ID3\x04"[..], &[0; 2000]].concat(), "not a WAV"),
        ("header.wav", sound(500)[..40].to_vec(), "cut off"),
        ("cut.wav", sound(500)[..700].to_vec(), "cut off"),
    ] {
        let e = voice_error(name, &bytes);
        assert_eq!(e.kind(), ErrorKind::Audio, "{e}");
        assert!(e.to_string().contains(part), "{name}: {e}");
    }
    let e = Conversation::read(Some("no/such.wav".as_ref()), None, None).unwrap_err();
    assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(Path::new("no/such.wav"))));
}

#[test]
fn a_sound_flipped_anywhere_is_an_error_or_finite() {
    let bytes = sound(300);
    for (at, bit) in (0..44 * 8).map(|i| (i / 8, i % 8)).chain((44..bytes.len()).step_by(13).map(|at| (at, 7))) {
        let mut bytes = bytes.clone();
        bytes[at] ^= 1 << bit;
        match Wav::parse(&bytes).and_then(|wav| wav.to_24k()) {
            Ok(samples) => assert!(samples.iter().all(|s| s.is_finite()), "byte {at}, bit {bit}"),
            Err(e) => assert_eq!(e.kind(), ErrorKind::Audio, "byte {at}, bit {bit}: {e}"),
        }
    }
}

#[test]
fn paths_that_are_not_usable_are_named_with_their_line() {
    for (name, text, part) in [
        ("empty.csv", "", "empty"),
        ("headless.csv", "0,0,1.6,2\n1,0,1.6,2\n", "line 1"),
        ("header.csv", "t,x,y,z\n", "no positions"),
        ("text.csv", "t,x,y,z\n0,0,1.6,2\n1,left,1.6,2\n", "line 3"),
        ("nan.csv", "t,x,y,z\n0,0,1.6,2\n1,0,nan,2\n", "line 3"),
        ("hole.csv", "t,x,y,z\n0,0,1.6,2\n1,0,,2\n", "line 3"),
        ("short.csv", "t,x,y,z\n0,0,1.6\n", "line 2"),
        ("unsorted.csv", "t,x,y,z\n0,0,1.6,2\n2,0,1.6,2\n1,0,1.6,2\n", "line 4"),
        ("twice.csv", "t,x,y,z\n0,0,1.6,2\n1,0,1.6,2\n1,0,1.6,2\n", "line 4"),
        ("far.csv", "t,x,y,z\n0,0,1.6,20000\n", "line 2"),
        ("past.csv", "t,x,y,z\n-2,0,1.6,2\n-1,0,1.6,2\n", "no length"),
    ] {
        let e = path_error(name, text.as_bytes());
        assert_eq!(e.kind(), ErrorKind::UserPath, "{e}");
        assert!(e.to_string().contains(part), "{name}: {e}");
    }
    assert_eq!(path_error("binary.csv", &[0xff, 0xfe, 0x00, 0x80]).kind(), ErrorKind::UserPath);
    let e = path_error("clock.csv", b"t,x,y,z\n1763692800.0,0,1.6,2\n1763692830.0,0,1.6,2\n");
    assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("clock"), "{e}");
}

#[test]
fn a_path_with_gaps_is_usable_and_keeps_its_gaps() {
    let file = Given::new("gaps.csv", b"t,x,y,z\n0,0,1.6,2\n0.4,0,1.6,2\n3,0,1.6,2\n3.4,0,1.6,2\n");
    let talk = Conversation::read(None, None, Some(&file.0)).unwrap();
    assert_eq!(talk.frames(), 102);
    let known = |t: f64| talk.path().and_then(|p: &UserPath| p.at(t)).is_some();
    assert!(known(0.2) && !known(1.5) && known(3.2));
}
