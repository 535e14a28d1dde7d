use super::*;
use crate::offline::Wav;
use visavis::Sampler;

fn golden(name: &str) -> Arc<Engine> {
    Engine::load(format!("{}/../tests/goldens/{name}.safetensors", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn tiny() -> Arc<Engine> {
    golden("tiny")
}

fn voices() -> Voices {
    let voice = |hz: f32| (0..48_000).map(|i| 0.3 * (i as f32 * hz).sin() * (i as f32 * 3e-4).sin()).collect();
    Voices::new(voice(0.05), voice(0.08)).unwrap()
}

/// Nine minutes of the tiny model: everything is driven and everything is measured. Its weights are
/// random, so its motion and what the guard makes of it say nothing; that drift is judged as it
/// should be is tested apart.
#[test]
fn a_short_soak_measures_everything() {
    let soak = Soak { hours: 0.15, from_hour: 24.0, seed: 3, sampler: Sampler::Midpoint2 };
    let mut told = Vec::new();
    let report = soak.run(&tiny(), &voices(), None, &mut |hours| told.push(hours)).unwrap();
    assert_eq!((report.blocks, report.cycles.len()), (4050, 3));
    assert!(told.len() > 60 && told.windows(2).all(|w| w[0] < w[1]));
    assert!(report.cycles.iter().all(|w| w.all().iter().all(|(_, v)| v.is_some_and(f64::is_finite))), "{report:?}");
    let hours = report.hours_apart;
    assert!(hours.period_frames_that_differ == 0 && hours.hours_later[0] > 0.0, "{hours:?}");
    let passed = |name: &str| report.verdicts.iter().any(|v| v.name == name && v.passed);
    assert!(passed("period") && passed("precision"), "{hours:?}");
    let names: Vec<_> = report.verdicts.iter().map(|v| v.name.as_str()).collect();
    assert!(names.ends_with(&["period", "precision", "switches", "guard"]), "{names:?}");
    assert!(serde_json::to_string(&report).unwrap().contains("\"verdicts\""));
}

/// What is drawn by the hour, gaze and activity at rest, is no difference that the hour makes.
#[test]
fn what_is_drawn_is_left_out_of_what_the_hour_changes() {
    let silence = Voices::new(vec![0.0; 48_000], vec![0.0; 48_000]).unwrap();
    let hours = Hours::measure(&golden("rest"), &silence, Sampler::Midpoint1).unwrap();
    assert_eq!(hours.period_frames_that_differ, 0, "{hours:?}");
}

/// The model that is shipped, on the sample conversation, up and down the ladder: 40 switches, the
/// same on every computer.
#[test]
fn the_shipped_model_hides_its_switches() {
    let file = |name: &str| format!("{}/../{name}", env!("CARGO_MANIFEST_DIR"));
    let voice = |name: &str| Wav::parse(&std::fs::read(file(name)).unwrap()).unwrap().to_24k().unwrap();
    let voices = Voices::new(voice("samples/agent.wav").to_vec(), voice("samples/user.wav").to_vec()).unwrap();
    let engine = Engine::load(file("models/visavis-room-i8.safetensors")).unwrap();
    let seam = switches::measure(&engine, &voices, 40).unwrap().unwrap();
    assert!(seam > 0.3 && seam <= judge::SWITCH_SEAM, "seam metric {seam} where the sampler changes");
}

#[test]
fn hours_out_of_range_are_refused() {
    for (hours, from_hour) in [(0.0, 0.0), (f64::NAN, 0.0), (1e9, 0.0), (1.0, -1.0), (1.0, f64::INFINITY)] {
        let soak = Soak { hours, from_hour, seed: 0, sampler: Sampler::Single };
        let e = soak.run(&tiny(), &voices(), None, &mut |_| {}).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Argument);
    }
    assert!(Voices::new(Vec::new(), vec![0.0]).is_err() && Voices::new(vec![f32::NAN], vec![0.0]).is_err());
}

#[test]
fn drift_growth_and_allocations_fail() {
    let soak = Soak { hours: 1.0, from_hour: 0.0, seed: 0, sampler: Sampler::Single };
    let stats = tiny().session(SessionOptions::default()).unwrap().stats();
    let figures = |wrist: f64, support: f64| Figures {
        wrist_speed: Some(wrist),
        support_foot_speed: Some(support),
        ..Figures::default()
    };
    let fine = Hours { hours_later: [1e-5, 1e-4], day_later: [1.4e-5, 2e-2], ..Hours::default() };
    let with = |last: Figures, allocations: u64, hours: Hours| {
        let first = figures(0.5, 0.001);
        let measured = judge::Measured {
            blocks: 1,
            seconds: 1.0,
            stats,
            cycles: vec![first, first, last, last],
            memory: judge::Memory::default(),
            allocations: Some(allocations),
            hours,
            switches: Some(1.2),
        };
        judge::report(&soak, measured).passed()
    };
    let passed = |last: Figures, allocations: u64| with(last, allocations, fine);
    assert!(passed(figures(0.56, 0.003), 0), "12 %, and 10 % of 2 cm/s");
    assert!(!passed(figures(0.58, 0.001), 0), "16 %");
    assert!(!passed(figures(0.5, 0.0045), 0), "17 % of 2 cm/s");
    assert!(!passed(figures(0.5, 0.001), 1), "an allocation");
    let hours = |hours: Hours| with(figures(0.5, 0.001), 0, hours);
    let centimetre = [0.01, 0.02];
    assert!(!hours(Hours { day_later: centimetre, hours_later: centimetre, ..fine }), "a centimetre after a day");
    assert!(!hours(Hours { day_later: [1.6e-5, 2e-2], ..fine }), "a day changes more than the first hours");
    assert!(!hours(Hours { period_frames_that_differ: 1, ..fine }), "a bit after a period");
}
