use super::*;
use proptest::prelude::*;

fn at(x: f32) -> Vec3 {
    Vec3::new(x, 1.6, 2.0)
}

fn track(samples: &[(f32, f64)]) -> HeadTrack {
    let mut track = HeadTrack::new();
    for &(x, time) in samples {
        track.push(at(x), time);
    }
    track
}

fn measured(x: f32) -> UserSample {
    UserSample { presence: Presence::Measured, position: at(x), rotation: None }
}

fn held(x: f32) -> UserSample {
    UserSample { presence: Presence::Held, position: at(x), rotation: None }
}

const ABSENT: UserSample = UserSample { presence: Presence::Absent, position: Vec3::ZERO, rotation: None };

#[test]
fn between_samples_is_linear_and_after_them_held_then_absent() {
    let mut t = track(&[(0.0, 1.0), (1.0, 1.25)]);
    assert_eq!(t.sample(0.99, 9.0), ABSENT);
    assert_eq!(t.sample(1.0, 9.0), measured(0.0));
    assert_eq!(t.sample(1.125, 9.0), measured(0.5));
    assert_eq!(t.sample(1.25, 9.0), measured(1.0));
    assert_eq!(t.sample(1.75, 9.0), held(1.0));
    assert_eq!(t.sample(1.751, 9.0), ABSENT);
    assert_eq!(HeadTrack::new().sample(0.0, 0.0), ABSENT);
    assert_eq!(t.sample(f64::NAN, 9.0), ABSENT);
    assert_eq!(t.sample(1.2, f64::NAN), ABSENT);
}

#[test]
fn gaps_are_held_then_absent() {
    let mut t = track(&[(0.0, 0.0), (1.0, 0.6), (1.5, 0.7)]);
    assert_eq!(t.sample(0.4, 2.0), held(0.0));
    assert_eq!(t.sample(0.55, 2.0), ABSENT);
    assert_eq!(t.sample(0.6, 2.0), measured(1.0));
    assert_eq!(t.stats().teleports, 0);
}

#[test]
fn teleports_are_counted_and_not_walked() {
    let mut t = track(&[(0.0, 0.0), (4.0, 0.1), (4.1, 0.2)]);
    assert_eq!(t.sample(0.05, 1.0), held(0.0));
    assert_eq!(t.sample(0.1, 1.0), measured(4.0));
    assert_eq!(t.sample(0.15, 1.0), UserSample { position: at(4.0).lerp(at(4.1), 0.5), ..measured(0.0) });
    assert_eq!(t.stats(), TrackStats { accepted: 3, teleports: 1, ..Default::default() });
    // 11.9 m/s is running; and 5 mm within 0.1 ms is jitter.
    assert_eq!(track(&[(0.0, 0.0), (0.119, 0.01), (0.124, 0.0101)]).stats().teleports, 0);
    assert_eq!(track(&[(0.0, 0.0), (0.121, 0.01)]).stats().teleports, 1);
}

#[test]
fn bad_samples_are_counted_and_ignored() {
    let mut t = track(&[(0.0, 1.0)]);
    t.push(at(f32::NAN), 1.1);
    t.push(at(f32::NEG_INFINITY), 1.1);
    t.push(at(0.0), f64::NAN);
    t.push(at(0.5), 1.0);
    t.sample(1.0, 1.0);
    t.push(at(0.5), 0.5);
    t.push(at(1_001.0), 1.1);
    t.push(at(f32::MAX), 1.1);
    t.push(at(0.5), 1e9);
    let want = TrackStats { accepted: 1, non_finite: 3, out_of_order: 2, absurd: 3, ..Default::default() };
    assert_eq!(t.stats(), want);
    assert_eq!(t.sample(1.1, 2.0), held(0.0));
    t.reset();
    assert_eq!(t.stats(), TrackStats::default());
    assert_eq!(t.sample(1.0, 2.0), ABSENT);
}

#[test]
fn what_has_not_been_used_is_sorted_and_what_is_late_counted() {
    let mut t = track(&[(0.0, 0.0), (0.5, 0.5), (0.25, 0.25), (0.75, 0.75)]);
    assert_eq!(t.sample(0.375, 0.6), measured(0.375));
    // 0.5 was the last that the answer could know: what follows it is in time, whatever was asked.
    t.push(at(0.625), 0.625);
    t.push(at(0.45), 0.45);
    t.push(at(0.5), 0.5);
    assert_eq!(t.stats(), TrackStats { accepted: 5, out_of_order: 2, ..Default::default() });
    assert_eq!(t.sample(0.5625, 0.75), measured(0.5625));
    // A sample in between takes back a teleport, or makes two.
    let mut t = track(&[(0.0, 0.0), (2.0, 0.2)]);
    assert_eq!(t.stats().teleports, 0);
    t.push(at(9.0), 0.1);
    assert_eq!(t.stats().teleports, 2);
    let mut t = track(&[(0.0, 0.0), (2.0, 0.02), (1.0, 0.01)]);
    t.push(at(2.0), 0.5);
    assert_eq!((t.stats().teleports, t.sample(0.015, 1.0)), (2, held(1.0)));
}

#[test]
fn rotations_go_with_their_positions() {
    let mut t = HeadTrack::new();
    let turned = |angle: f32| Quat::from_rotation_y(angle);
    t.push_pose(at(0.0), Some(turned(0.0)), 0.0);
    t.push_pose(at(0.0), Some(-turned(0.2) * 1.5), 0.1);
    t.push(at(0.0), 0.2);
    let angle = |sample: UserSample| sample.rotation.map(|r| 2.0 * libm::atan2f(r.y, r.w));
    assert!((angle(t.sample(0.05, 1.0)).unwrap() - 0.1).abs() < 1e-4, "the shorter way, of unit length");
    assert!(t.sample(0.1, 1.0).rotation.unwrap().is_normalized());
    assert_eq!([0.15, 0.2, 0.6].map(|time| t.sample(time, 1.0).rotation), [None; 3]);
    t.push_pose(at(0.0), Some(Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)), 1.1);
    t.push_pose(at(0.0), Some(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)), 1.1);
    assert_eq!(t.stats(), TrackStats { accepted: 3, non_finite: 1, absurd: 1, ..Default::default() });
}

#[test]
fn a_full_track_keeps_the_newest() {
    let mut t = HeadTrack::with_capacity(16);
    for i in 0..40 {
        t.push(at(i as f32 * 0.01), f64::from(i) * 0.01);
        if i < 20 {
            t.sample(f64::from(i) * 0.01, f64::from(i) * 0.01);
        }
    }
    // Samples 0 to 18 made room after they had been passed; 19 to 23 had not.
    assert_eq!(t.stats().overwritten, 5);
    assert_eq!(t.sample(0.39, 1.0), measured(0.39));
    assert_eq!(t.sample(0.23, 1.0), ABSENT);
    t.push(at(0.2), 0.2);
    assert_eq!((t.stats().accepted, t.stats().out_of_order), (40, 1));
    let mut t = HeadTrack::with_capacity(2);
    [0.3, 0.2, 0.1].into_iter().for_each(|time| t.push(at(time as f32), time));
    assert_eq!(t.stats(), TrackStats { accepted: 2, overwritten: 1, ..Default::default() });
    assert_eq!(t.sample(0.25, 1.0), measured(0.25));
}

#[test]
fn a_block_is_four_frames() {
    let samples: Vec<_> = (0..90).map(|i| (i as f32 / 90.0, f64::from(i) / 90.0)).collect();
    let mut t = track(&samples);
    let mut out = [ABSENT; 4];
    t.block(10, 0.5, &mut out);
    for (i, sample) in out.iter().enumerate() {
        assert_eq!(sample.presence, Presence::Measured);
        assert!((sample.position.x - (10 + i) as f32 / 30.0).abs() < 1e-6);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Nothing that is later than `now` has a say, and pushing ahead changes nothing.
    #[test]
    fn causal(
        steps in prop::collection::vec((0.001f64..0.8, -3f32..3.0), 1..60),
        asks in prop::collection::vec((0f64..30.0, 0f64..30.0), 1..20),
    ) {
        let mut time = 0.0;
        let samples: Vec<_> = steps.iter().map(|&(dt, x)| { time += dt; (x, time) }).collect();
        let mut all = track(&samples);
        for (ask, now) in asks {
            let past: Vec<_> = samples.iter().copied().filter(|s| s.1 <= now).collect();
            prop_assert_eq!(all.sample(ask, now), track(&past).sample(ask, now));
        }
    }

    /// Before anything is asked, the order of samples of different times does not matter.
    #[test]
    fn sorted_by_time(
        steps in prop::collection::vec((0.001f64..0.3, -3f32..3.0), 1..60),
        keys in prop::collection::vec(any::<u32>(), 60),
        asks in prop::collection::vec(0f64..10.0, 1..20),
    ) {
        let mut time = 0.0;
        let samples: Vec<_> = steps.iter().map(|&(dt, x)| { time += dt; (x, time) }).collect();
        let mut order: Vec<usize> = (0..samples.len()).collect();
        order.sort_by_key(|i| keys[*i]);
        let shuffled: Vec<_> = order.iter().map(|i| samples[*i]).collect();
        let (mut a, mut b) = (track(&samples), track(&shuffled));
        prop_assert_eq!(a.stats(), b.stats());
        for ask in asks {
            prop_assert_eq!(a.sample(ask, ask), b.sample(ask, ask));
        }
    }

    /// Whatever comes in, answers are finite and never further out than what was accepted.
    #[test]
    fn answers_are_sane(
        pushes in prop::collection::vec((any::<[f32; 3]>(), any::<f64>()), 0..40),
        small in prop::collection::vec(([-5f32..5.0, -5f32..5.0, -5f32..5.0], 0f64..4.0), 0..40),
        ask in 0f64..5.0,
    ) {
        let mut t = HeadTrack::with_capacity(20);
        for (p, time) in pushes.into_iter().chain(small) {
            t.push(Vec3::from(p), time);
        }
        let s = t.sample(ask, ask);
        prop_assert!(s.position.is_finite() && s.position.length() <= MAX_DISTANCE + 0.1);
    }
}
