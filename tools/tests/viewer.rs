//! The viewer's page for half a minute of a procedural person.

#[path = "../examples/synthetic_person/person.rs"]
mod person;

use visavis::ErrorKind;
use visavis_tools::export::viewer::{Meta, render, write};
use visavis_tools::metrics::Summary;

#[test]
fn half_a_minute_is_below_four_megabytes() {
    let page = render(&person::recording(30.0), &Meta { title: "Person".into(), ..Meta::default() });
    assert!(page.len() < 4_000_000, "{} bytes", page.len());
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    assert!(!page.contains("{{"), "a placeholder is left");
}

#[test]
fn a_recording_without_user_and_voices_makes_a_page() {
    let mut recording = person::recording(1.0);
    recording.user.fill(None);
    (recording.agent_voice, recording.user_voice, recording.gaze_target) = (None, None, None);
    recording.frames.iter_mut().for_each(|frame| frame.gaze = None);
    let page = render(&recording, &Meta::default());
    assert!(page.contains("\"agentVoice\":null") && page.contains("\"gazeTarget\":null"));
}

#[test]
fn the_person_is_measured_as_it_was_made() {
    let summary = Summary::of(&person::recording(20.0));
    // It looks at the user, its bones are rigid, its hands move when it speaks.
    assert!(summary.head_angle.unwrap() > 0.9);
    assert!(summary.bone_deviation.unwrap().max < 1e-3);
    assert!(summary.speaking.unwrap().wrist_speed > summary.non_speaking.unwrap().wrist_speed);
}

#[test]
fn an_unwritable_page_is_an_error_that_names_it() {
    let path = std::env::temp_dir().join("visavis-no-such-folder").join("index.html");
    let error = write(&path, &person::recording(0.2), &Meta::default()).unwrap_err();
    assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(path.as_path())));
}
