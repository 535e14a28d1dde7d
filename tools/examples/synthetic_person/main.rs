//! Writes the viewer's page for a procedural person: `cargo run -p visavis-tools --example
//! synthetic_person -- out.html [mixed]`. `mixed`: the frames from 10 to 20 s tell whom the joints
//! follow, as where a session had stepped down to the featherweight tier.

mod person;

use std::process::ExitCode;
use visavis_tools::export::viewer::{self, Meta};

fn main() -> ExitCode {
    let path = std::env::args().nth(1).unwrap_or_else(|| "synthetic.html".to_owned());
    let meta = Meta {
        title: "Visavis".to_owned(),
        subtitle: "A procedural person turns to a user who walks around it".to_owned(),
        facts: vec![
            ("Motion".to_owned(), "procedural, no model".to_owned()),
            ("Voices".to_owned(), "synthetic syllables".to_owned()),
        ],
        method: None,
        live: None,
    };
    let mut recording = person::recording(30.0);
    if std::env::args().nth(2).is_some_and(|word| word == "mixed") {
        let joints = recording.rig.len();
        for frame in &mut recording.frames[300..600] {
            let share = |j: usize| 0.5 + 0.5 * ((0.7 * frame.time + 0.4 * j as f64).sin() as f32);
            frame.dyadic = (0..joints).map(share).collect();
        }
    }
    match viewer::write(&path, &recording, &meta) {
        Ok(()) => {
            println!("{path}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
