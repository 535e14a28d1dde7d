//! What the figures should be, and whether they are.

use super::endurance::{Endurance, Follow};
use super::figures::Row;
use super::reaction::Reaction;
use super::reconstruction::Reconstruction;
use super::{Dial, Report, people};
use serde::Serialize;
use visavis::internals::pose::{DEFECTIVE_HELD, DEFECTIVE_TRIPS_A_MINUTE};

/// A target and where the model stands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// What is measured.
    pub what: String,
    /// What it should be.
    pub target: String,
    /// What it is.
    pub value: String,
    /// Whether the target is met; `None` where there was nothing to measure.
    pub met: Option<bool>,
}

/// How near a gaze score must come to its target, and how many windows of the corpus have such a
/// score before that is asked.
const GAZE_TOLERANCE: f64 = 0.1;
const GAZE_WINDOWS: usize = 3;
/// A user is followed when the agent stands within this distance after a wait, metres: nearer than
/// people who do not talk with each other stand (Hall 1966).
const FOLLOWED: f64 = 2.5;

/// Every target against the report.
pub(super) fn verdicts(report: &Report) -> Vec<Verdict> {
    let mut all = Vec::new();
    all.extend(report.reconstruction.iter().flat_map(reconstruction));
    if let (Some(truth), Some(first)) = (report.row("corpus"), report.models().next()) {
        all.extend(motion(report, truth, first));
    }
    all.extend(at_rest(report));
    for dial in &report.dials {
        all.extend(self::dial(dial));
    }
    if let [teacher, student] = report.dials.as_slice() {
        let apart = teacher.reached.iter().zip(&student.reached).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        all.push(at_most("gaze dial, single step against teacher", "each within 0.1", Some(apart), 0.1));
    }
    all.extend(report.reaction.iter().flat_map(reaction));
    all.extend(report.endurance.iter().flat_map(endurance));
    all.extend(report.follow.iter().flat_map(follow));
    all
}

fn reconstruction(r: &Reconstruction) -> Vec<Verdict> {
    let mm = |what: &str, value: f64, most: f64| {
        let text = format!("{:.1} mm", 1000.0 * value);
        verdict(&format!("VAE, {what}"), format!("at most {most} mm"), text, Some(1000.0 * value <= most))
    };
    vec![
        mm("joints", r.joints, 10.0),
        mm("root after a second", r.root, 10.0),
        mm("hands", r.hands, 25.0),
        verdict(
            "VAE, rotation",
            "at most 3 degrees".into(),
            format!("{:.1} degrees", r.rotation),
            Some(r.rotation <= 3.0),
        ),
    ]
}

/// The reference row against the corpus' own motion and the looked-up one.
fn motion(report: &Report, truth: &Row, row: &Row) -> Vec<Verdict> {
    let name = |what: &str| format!("{what}, {}", row.name);
    let (t, m) = (&truth.all, &row.all);
    let part = |a: Option<f64>, b: Option<f64>| Some(a? / b.filter(|b| b.abs() > 1e-9)?);
    let gaze = m.head_angle.zip(t.head_angle).map(|(a, b)| (a - b).abs());
    let slide = m.foot_slide.zip(t.foot_slide).map(|(a, b)| a - b);
    let wrists = part(m.wrist_speed, t.wrist_speed);
    let ratio = part(row.wrist_ratio, truth.wrist_ratio);
    let beat = part(m.beat, t.beat);
    let chance = m.beat.zip(m.beat_shuffled).map(|(a, b)| a - b);
    let mut all = vec![
        at_most(&name("head angle, gaze off"), "within 0.03 of the corpus", gaze, 0.03),
        between(&name("wrist var"), "0.9 to 1.1 of the corpus", wrists, 0.9, 1.1),
        between(&name("wrist var, speaking / not"), "0.9 to 1.1 of the corpus' ratio", ratio, 0.9, 1.1),
        between(&name("beat"), "at least 0.9 of the corpus", beat, 0.9, f64::INFINITY),
        between(&name("beat above shuffled voice"), "at least 0.05", chance, 0.05, f64::INFINITY),
        at_most(&name("foot slide above the corpus"), "at most 0.01", slide, 0.01),
        at_most(
            &name("support foot"),
            "at most 1.3 x the corpus",
            part(m.support_foot_speed, t.support_foot_speed),
            1.3,
        ),
        at_most(&name("seam"), "at most 1.15", m.seam, 1.15),
    ];
    if let Some(nearest) = report.row("NN") {
        all.push(at_most(&name("FGD"), "at most that of NN", part(m.fgd, nearest.all.fgd), 1.0));
    }
    if let Some(single) = report.row("single").filter(|single| single.name != row.name) {
        all.push(at_most("FGD, single step", &format!("at most 1.1 x {}", row.name), part(single.all.fgd, m.fgd), 1.1));
    }
    all
}

/// The samplers that sessions use, at rest, against real people.
fn at_rest(report: &Report) -> Vec<Verdict> {
    let row = |name: &str| report.idle.iter().find(|idle| idle.name == name);
    let (Some(real), Some(first)) = (row("real people"), report.models().next()) else { return Vec::new() };
    let single = report.row("single").filter(|single| single.name != first.name);
    let mut all = Vec::new();
    let both = |model: &Row| [row(&model.name), row(&people::alone(&model.name))];
    for own in std::iter::once(first).chain(single).flat_map(both).flatten() {
        let (r, m) = (&real.figures, &own.figures);
        for (what, real, value) in [
            ("stillness", r.stillness, m.stillness),
            ("hand speed", r.hand_speed, m.hand_speed),
            ("rest changes", r.rest_changes, m.rest_changes),
            ("head speed", r.head_speed, m.head_speed),
        ] {
            let part = value.zip(real).map(|(value, real)| value / real);
            let what = format!("at rest, {what}, {}", own.name);
            all.push(between(&what, "0.75 to 1.25 of real people's", part, 0.75, 1.25));
        }
    }
    all
}

fn dial(dial: &Dial) -> Vec<Verdict> {
    let name = |what: &str| format!("gaze dial, {}: {what}", dial.sampler);
    let monotone = dial.reached.windows(2).all(|w| w[1] > w[0]);
    let reached: Vec<_> = dial.reached.iter().map(|g| format!("{g:.2}")).collect();
    let span = dial.reached.last().zip(dial.reached.first()).map(|(a, b)| a - b);
    let checked = || dial.targets.iter().zip(&dial.reached).zip(&dial.windows).filter(|(_, n)| **n >= GAZE_WINDOWS);
    let worst = checked().map(|((t, g), _)| (f64::from(*t) - g).abs()).reduce(f64::max);
    vec![
        verdict(&name("monotone"), "yes".into(), reached.join(" "), Some(monotone)),
        between(&name("span"), "at least 0.5", span, 0.5, f64::INFINITY),
        at_most(&name("furthest from its target where the corpus has data"), "at most 0.1", worst, GAZE_TOLERANCE),
    ]
}

fn reaction(r: &Reaction) -> Vec<Verdict> {
    let apart = r.model.zip(r.truth).map(|(a, b)| (a - b).abs());
    vec![
        at_most("reaction time, median", "at most 0.8 s", r.staged, 0.8),
        at_most("reaction time, to the corpus' agent", "within 0.2 s", apart, 0.2),
    ]
}

fn endurance(e: &Endurance) -> Vec<Verdict> {
    let worst: Vec<_> = e.changes.iter().filter(|c| !c.within(0.15)).map(|c| c.metric).collect();
    let within = worst.is_empty();
    let seconds = e.period * e.periods;
    let bones = e.changes.iter().find(|c| c.metric == "bone deviation");
    let bones = bones.and_then(|c| c.periods.iter().copied().reduce(f64::max));
    vec![
        verdict(
            &format!("endurance, {seconds} s: every {} s against the first", e.period),
            "every metric within 15 %".into(),
            if within { "all within".into() } else { format!("not {}", worst.join(", ")) },
            Some(within),
        ),
        verdict("endurance: no NaN", "none".into(), if e.finite { "none" } else { "some" }.into(), Some(e.finite)),
        verdict(
            "endurance: plausibility guard",
            format!("at most {DEFECTIVE_TRIPS_A_MINUTE} trip a minute and {} % of frames held", 100.0 * DEFECTIVE_HELD),
            format!(
                "{:.2} trips a minute, {:.1} % held{}",
                e.trips_a_minute,
                100.0 * e.held,
                if e.defective { ": this bundle is defective" } else { "" }
            ),
            Some(!e.defective),
        ),
        at_most("endurance: bone lengths before fitting", "within 0.015 on average", bones, 0.015),
    ]
}

fn follow(f: &Follow) -> Vec<Verdict> {
    let text = format!("{:.1} m away, {:.1} m back", f.away, f.back);
    let met = f.away <= FOLLOWED && f.back <= FOLLOWED;
    vec![verdict("a user who walks 6 m away and back", format!("followed to within {FOLLOWED} m"), text, Some(met))]
}

fn at_most(what: &str, target: &str, value: Option<f64>, most: f64) -> Verdict {
    between(what, target, value, f64::NEG_INFINITY, most)
}

fn between(what: &str, target: &str, value: Option<f64>, least: f64, most: f64) -> Verdict {
    let text = value.map_or_else(|| "nothing to measure".into(), |v| format!("{v:.3}"));
    verdict(what, target.into(), text, value.map(|v| (least..=most).contains(&v)))
}

fn verdict(what: &str, target: String, value: String, met: Option<bool>) -> Verdict {
    Verdict { what: what.into(), target, value, met }
}
