//! Writes the viewer's page for a procedural person: `cargo run -p visavis-tools --example
//! synthetic_person -- out.html`.

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
    match viewer::write(&path, &person::recording(30.0), &meta) {
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
