//! The report as text, Markdown and JSON.

use super::figures::{Figures, Row};
use super::{GAZE_TARGETS, Report};
use crate::metrics::{Liveliness, Nods};
use std::fmt::Write;

/// A table: a head and rows of cells.
struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Report {
    /// Pretty-printed JSON with a final newline.
    pub fn to_json(&self) -> String {
        // Only maps with keys that are no strings and failing writers make this fail; there is
        // neither.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// For a terminal: columns aligned.
    pub fn to_text(&self) -> String {
        self.write("", Table::text)
    }

    /// For a model card.
    pub fn to_markdown(&self) -> String {
        self.write("### ", Table::markdown)
    }

    fn write(&self, heading: &str, table: fn(&Table) -> String) -> String {
        let [windows, speaking] = self.windows;
        let mut out = format!(
            "{}: {windows} windows of 13.3 s ({speaking} speaking) of {} clips; Random and NN from {}{}\n",
            self.model,
            self.clips,
            self.bank,
            if self.quick { "; a quick look, too few runs for a judgement" } else { "" }
        );
        let mut part = |title: &str, t: &Table| {
            // Writing to a string does not fail.
            let _ = write!(out, "\n{heading}{title}\n\n{}", table(t));
        };
        part("Motion (speaking / non-speaking in brackets; FGD cm², FGD_acc (m/s²)², wrists m/s)", &self.motion());
        part("Feet, voice, keypoints (support foot mm/s, APE mm, PCK at 10 cm, bones %)", &self.details());
        part(
            "At rest, the user stands and nobody speaks (both hands below 3 cm/s; hands and head relative to the hips, m/s, m/s²; a minute; cm in 30 s; shares of stretches of 10 s that are still above 0.95 and below 0.1 of the time; power of hand speed by octave from 0.2 to 8 Hz, mm/s)",
            &self.at_rest(),
        );
        part(
            "Listening and speaking (likewise; nods a minute while the user speaks / in the pauses / when nobody does)",
            &self.talk(),
        );
        if !self.dials.is_empty() {
            part("Gaze dial: mean score reached", &self.gaze());
        }
        part("Behaviour", &self.behaviour());
        part("Targets", &self.targets());
        out
    }

    fn motion(&self) -> Table {
        let row = |row: &Row| {
            let classes = |value: &dyn Fn(&Figures) -> Option<f64>, digits: usize| {
                let (all, s, ns) = (value(&row.all), value(&row.speaking), value(&row.non_speaking));
                format!("{} ({} / {})", number(all, digits), number(s, digits), number(ns, digits))
            };
            vec![
                row.name.clone(),
                classes(&|f| f.fgd.map(|v| 1e4 * v), 0),
                classes(&|f| f.fgd_acceleration, 1),
                classes(&|f| f.foot_slide, 3),
                classes(&|f| f.wrist_speed, 3),
                number(row.wrist_ratio, 2),
                classes(&|f| f.head_angle, 2),
                classes(&|f| f.seam, 2),
            ]
        };
        Table::new(
            &["row", "FGD", "FGD_acc", "foot slide", "wrist var", "speaking / not", "head angle", "seam"],
            self.rows.iter().map(row),
        )
    }

    fn details(&self) -> Table {
        let row = |row: &Row| {
            let f = &row.all;
            let scaled = |value: Option<f64>, by: f64, digits| number(value.map(|v| by * v), digits);
            vec![
                row.name.clone(),
                scaled(f.support_foot_speed, 1000.0, 1),
                number(f.beat, 3),
                number(f.beat_shuffled, 3),
                scaled(f.ape, 1000.0, 0),
                number(f.pck, 3),
                scaled(f.bone_deviation, 100.0, 2),
                number(f.joint_speed, 3),
            ]
        };
        Table::new(
            &["row", "support foot", "beat", "beat, shuffled voice", "APE", "PCK", "bones", "joints m/s"],
            self.rows.iter().filter(|row| row.gaze_target.is_none()).map(row),
        )
    }

    fn at_rest(&self) -> Table {
        let row = |idle: &super::Idle| {
            let f = &idle.figures;
            let spectrum: Vec<_> = f.hand_spectrum.iter().map(|v| format!("{:.0}", 1000.0 * v)).collect();
            let mut cells = vec![idle.name.clone()];
            cells.extend(lively(f));
            let spells = [f.still_throughout, f.still_never].map(|share| number(share, 2));
            cells.extend([number(f.sway, 1), number(f.still_stretches, 1), spells.join(" / "), spectrum.join(" ")]);
            cells
        };
        let mut head = LIVELY.to_vec();
        head.extend(["sway", "still stretches", "10 s still / never", "spectrum"]);
        Table::new(&head, self.idle.iter().map(row))
    }

    fn talk(&self) -> Table {
        let nod = |n: &Nods| {
            let rates = [n.speaks, n.pauses, n.nobody].map(|v| number(v, 1));
            [rates.join(" / "), number(n.lag, 2)]
        };
        let row = |name: String, f: &Liveliness, nods: [String; 2]| {
            let mut cells = vec![name];
            cells.extend(lively(f));
            cells.extend(nods);
            cells
        };
        let none = || [String::from("-"), String::from("-")];
        let mut rows = vec![row("real people, speaking".into(), &self.real_talk, none())];
        for own in self.rows.iter().filter(|row| row.gaze_target.is_none()) {
            rows.push(row(format!("{}, listening", own.name), &own.listens, nod(&own.nods)));
            rows.push(row(format!("{}, speaking", own.name), &own.talks, none()));
        }
        let mut head = LIVELY.to_vec();
        head.extend(["nods", "lag s"]);
        Table::new(&head, rows)
    }

    fn gaze(&self) -> Table {
        let mut head = vec!["target".to_owned()];
        head.extend(GAZE_TARGETS.iter().map(ToString::to_string));
        let mut rows: Vec<Vec<String>> = Vec::new();
        for dial in &self.dials {
            let reached = dial.reached.iter().map(|g| format!("{g:.2}"));
            rows.push(std::iter::once(dial.sampler.clone()).chain(reached).collect());
        }
        if let Some(dial) = self.dials.first() {
            let windows = dial.windows.iter().map(ToString::to_string);
            rows.push(std::iter::once("corpus' windows within 0.1".to_owned()).chain(windows).collect());
        }
        Table { head, rows }
    }

    fn behaviour(&self) -> Table {
        let mut rows = Vec::new();
        let mut row = |what: &str, value: String| rows.push(vec![what.to_owned(), value]);
        if let Some(r) = &self.reconstruction {
            let text = format!(
                "joints {:.1}, hands {:.1}, feet {:.1}, root after a second {:.1} mm; rotation {:.1} degrees",
                1000.0 * r.joints,
                1000.0 * r.hands,
                1000.0 * r.feet,
                1000.0 * r.root,
                r.rotation
            );
            row("reconstruction", text);
        }
        if let Some(r) = &self.reaction {
            let (staged, truth, model) = (number(r.staged, 2), number(r.truth, 2), number(r.model, 2));
            row("reaction, user jumps 90 degrees", format!("{staged} s, median of {}", r.staged_jumps));
            let text = format!("{model} s, the corpus' agent {truth} s, medians of {}", r.jumps);
            row("reaction, jumps in the clips", text);
        }
        if let Some(f) = &self.follow {
            let gaze = number(f.head_angle, 2);
            let text = format!("{:.1} m from the agent there, {:.1} m back; head angle {gaze}", f.away, f.back);
            row("user walks 6 m away and back", text);
        }
        if let Some(e) = &self.endurance {
            for c in &e.changes {
                let part = |v: f64| 100.0 * v / c.first();
                let error = c.error.map_or(String::new(), |e| format!(", standard error {:.0} %", part(e)));
                let change = part(c.last() - c.first());
                let each: Vec<_> = c.periods.iter().map(|v| format!("{v:.4}")).collect();
                let text = format!("{} ({change:+.0} %{error})", each.join(" "));
                row(&format!("endurance, {}", c.metric), text);
            }
            let text = format!("{} runs of {} x {} s, {:.1} m from the start", e.runs, e.periods, e.period, e.wandered);
            row("endurance", text);
        }
        Table::new(&["what", "value"], rows)
    }

    fn targets(&self) -> Table {
        let row = |v: &super::Verdict| {
            let met = match v.met {
                Some(true) => "met",
                Some(false) => "missed",
                None => "-",
            };
            vec![v.what.clone(), v.target.clone(), v.value.clone(), met.to_owned()]
        };
        Table::new(&["what", "target", "value", ""], self.verdicts.iter().map(row))
    }
}

impl Table {
    fn new(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        Self { head: head.iter().map(|&name| name.to_owned()).collect(), rows: rows.into_iter().collect() }
    }

    fn text(&self) -> String {
        let all = || std::iter::once(&self.head).chain(&self.rows);
        let width = |c: usize| all().map(|row| row[c].chars().count()).max().unwrap_or(0);
        let widths: Vec<_> = (0..self.head.len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let cells: Vec<_> = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
            cells.join("  ").trim_end().to_owned() + "\n"
        };
        all().map(line).collect()
    }

    fn markdown(&self) -> String {
        let line = |row: &Vec<String>| format!("| {} |\n", row.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.head.len()));
        std::iter::once(line(&self.head)).chain([rule]).chain(self.rows.iter().map(line)).collect()
    }
}

/// Columns of [`lively`], after the row's name.
const LIVELY: [&str; 7] =
    ["row", "stillness", "hand speed", "hand acceleration", "head speed", "head acceleration", "rest changes"];

fn lively(f: &Liveliness) -> [String; 6] {
    [
        number(f.stillness, 2),
        number(f.hand_speed, 3),
        number(f.hand_acceleration, 2),
        number(f.head_speed, 3),
        number(f.head_acceleration, 3),
        number(f.rest_changes, 1),
    ]
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |v| format!("{v:.digits$}"))
}
