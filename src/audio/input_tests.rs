use crate::audio::tests::{block, noise};
use crate::audio::{Voice, VoiceStats};
use crate::error::ErrorKind;
use crate::frame::BLOCK_SAMPLES;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::{Acquire, Release};

#[test]
fn bad_samples_are_silence_and_loud_ones_clipped() {
    let mut voice = Voice::with_capacity(1);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let e = voice.input().push(&[0.1, bad, 0.2], 24_000).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Audio);
        assert!(e.to_string().starts_with("1 of 3 "), "{e}");
    }
    voice.input().push(&[0.1, f32::MAX, -9.0, 8.0], 24_000).unwrap();
    assert!(voice.input().push(&[0.1; 7], 1).is_err());
    let heard = [0.1, 0.0, 0.2, 0.1, 0.0, 0.2, 0.1, 0.0, 0.2, 0.1, 8.0, -8.0, 8.0, 0.0];
    assert_eq!(block(&mut voice, 0).1[..14], heard);
    let want = VoiceStats { clipped_samples: 2, non_finite_samples: 3, bad_rate_samples: 7, ..voice.stats() };
    assert_eq!((voice.stats(), want.underrun_samples), (want, 3_187));
}

#[test]
fn what_is_broken_off_is_room_at_once() {
    let mut voice = Voice::with_capacity(1);
    voice.input().push(&noise(1, 24_000), 24_000).unwrap();
    let first = block(&mut voice, 0).1;
    assert_eq!(first, noise(1, 24_000)[..3_200]);
    voice.input().clear();
    voice.input().push(&noise(2, 24_000), 24_000).unwrap();
    assert_eq!(voice.stats().overflow_samples, 0);
    assert_eq!(block(&mut voice, 1).1, noise(2, 24_000)[..3_200]);
    // Broken off after the look, before the block: silence, and what follows is not lost.
    voice.look();
    voice.input().clear();
    voice.input().push(&[0.5; 24_000], 24_000).unwrap();
    let mut out = [9.0; BLOCK_SAMPLES];
    assert!(voice.take_block(2, &mut out).unwrap() && out == [0.0; BLOCK_SAMPLES]);
    assert_eq!(block(&mut voice, 3).1, [0.5; 3_200]);
}

/// One thread pushes, one breaks off and mutes, one listens: what is heard is what one of them
/// pushed, in its order, and nobody waits for another. A sample tells its number; silence is what
/// was not pushed.
#[test]
fn a_voice_in_three_threads() {
    const PUSHES: usize = 4_000;
    let mut voice = Voice::with_capacity(1);
    let (pushing, commanding) = (voice.input().clone(), voice.input().clone());
    let done = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for i in 0..PUSHES {
                let sound: Vec<f32> = (0..100).map(|n| ((i * 100 + n) % 8_000 + 1) as f32 / 1_024.0).collect();
                pushing.push(&sound, 24_000).unwrap();
                if i % 16 == 0 {
                    std::thread::yield_now();
                }
            }
            done.fetch_add(1, Release);
        });
        scope.spawn(|| {
            for i in 0..PUSHES {
                match i % 97 {
                    0 => commanding.clear(),
                    1 => commanding.set_present(false),
                    2 => commanding.finish(),
                    _ => std::thread::yield_now(),
                }
            }
            done.fetch_add(1, Release);
        });
        let (mut k, mut heard) = (0, 0u64);
        while done.load(Acquire) < 2 {
            let (present, sound) = block(&mut voice, k);
            assert!(present || sound.iter().all(|s| *s == 0.0));
            heard += sound.iter().filter(|s| **s != 0.0).count() as u64;
            for (a, b) in sound.iter().zip(&sound[1..]) {
                let step = (b - a) * 1_024.0;
                let cut = *a == 0.0 || *b == 0.0;
                // Sound that was broken off, dropped or muted leaves a step between pieces; within
                // a piece numbers count on.
                assert!(cut || step == 1.0 || (b * 1_024.0 - 1.0) % 100.0 == 0.0, "{a} {b} in block {k}");
            }
            k += 1;
        }
        assert!(heard > 0);
    });
    assert_eq!(voice.stats().contended_samples, 0);
}

/// While one thread has the feed, another's sound and commands wait in order, and are heard.
#[test]
fn what_meets_another_thread_is_kept() {
    let mut voice = Voice::with_capacity(4);
    let sound = noise(4, 20_000);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            let (input, sound) = (voice.input().clone(), &sound);
            scope.spawn(move || sound.chunks(50).for_each(|piece| input.push(piece, 24_000).unwrap()));
        }
    });
    let heard: Vec<f32> = (0..13).flat_map(|k| block(&mut voice, k).1).take_while(|s| *s != 0.0).collect();
    assert_eq!((heard.len() as u64, voice.stats().contended_samples), (40_000, 0));
    // Each thread's sound is in order: a sample is the next of one of the two.
    let mut ends = vec![(0, 0)];
    for s in heard {
        let mut next: Vec<(usize, usize)> = Vec::new();
        for (a, b) in ends {
            next.extend((sound.get(a) == Some(&s)).then_some((a + 1, b)));
            next.extend((sound.get(b) == Some(&s)).then_some((a, b + 1)));
        }
        next.iter_mut().for_each(|(a, b)| (*a, *b) = (*a.max(b), *a.min(b)));
        next.sort_unstable();
        next.dedup();
        assert!(!next.is_empty(), "out of order");
        ends = next;
    }
}
