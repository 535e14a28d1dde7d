use super::super::voice::INBOX;
use super::{COMMANDS, PIECE};
use crate::audio::tests::{block, noise};
use crate::audio::{Voice, VoiceStats};
use crate::error::ErrorKind;
use crate::frame::BLOCK_SAMPLES;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::{Acquire, Release};

#[test]
fn bad_samples_are_silence_and_loud_ones_clipped() {
    let mut voice = Voice::with_capacity(1.0);
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
    let mut voice = Voice::with_capacity(1.0);
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

/// Sample `i` of a sound of which each sample tells its number: positive, and within the clipping.
fn numbered(i: usize) -> f32 {
    (i % 8_000 + 1) as f32 / 1_024.0
}

/// One thread pushes, one breaks off and mutes, one listens: what is heard is what one of them
/// pushed, in its order, and nobody waits for another. Silence is what was not pushed.
#[test]
fn a_voice_in_three_threads() {
    const PUSHES: usize = 4_000;
    let mut voice = Voice::with_capacity(1.0);
    let (pushing, commanding) = (voice.input().clone(), voice.input().clone());
    let done = AtomicUsize::new(0);
    let mut k = 0;
    let mut listen = |voice: &mut Voice| {
        let (present, sound) = block(voice, k);
        k += 1;
        assert!(present || sound.iter().all(|s| *s == 0.0));
        for (a, b) in sound.iter().zip(&sound[1..]) {
            let step = (b - a) * 1_024.0;
            let cut = *a == 0.0 || *b == 0.0;
            // Sound that was broken off, dropped or muted leaves a step between pieces; within a
            // piece numbers count on.
            assert!(cut || step == 1.0 || (b * 1_024.0 - 1.0) % 100.0 == 0.0, "{a} {b} in block {}", k - 1);
        }
        sound
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for i in 0..PUSHES {
                let sound: Vec<f32> = (i * 100..i * 100 + 100).map(numbered).collect();
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
        while done.load(Acquire) < 2 {
            listen(&mut voice);
        }
    });
    // Whatever the threads left behind, the voice is whole.
    let sound: Vec<f32> = (0..BLOCK_SAMPLES).map(numbered).collect();
    voice.input().clear();
    voice.input().push(&sound, 24_000).unwrap();
    assert_eq!(listen(&mut voice), sound);
}

/// Two threads push at once: what they push is heard, each one's in its order, or counted.
#[test]
fn what_meets_another_thread_is_heard_or_counted() {
    const SAMPLES: usize = 20_000;
    let mut voice = Voice::with_capacity(4.0);
    std::thread::scope(|scope| {
        for sign in [-1.0, 1.0] {
            let input = voice.input().clone();
            scope.spawn(move || {
                let sound: Vec<f32> = (1..=SAMPLES).map(|i| sign * i as f32 / 4_096.0).collect();
                sound.chunks(50).for_each(|piece| input.push(piece, 24_000).unwrap());
            });
        }
    });
    let heard: Vec<f32> = (0..13).flat_map(|k| block(&mut voice, k).1).take_while(|s| *s != 0.0).collect();
    let (stats, mut last) = (voice.stats(), [0.0; 2]);
    assert_eq!((heard.len() + stats.contended_samples as usize, stats.overflow_samples), (2 * SAMPLES, 0));
    for s in heard {
        let last = &mut last[usize::from(s > 0.0)];
        assert!(s.abs() > *last, "{s} after {last}");
        *last = s.abs();
    }
}

/// While another thread has the feed: sound is kept up to the commands' share, then dropped and
/// counted; commands still find room, and stand in their places between the sound.
#[test]
fn what_waits_for_another_thread_is_in_order() {
    let mut voice = Voice::with_capacity(8.0);
    let input = voice.input().clone();
    let feed = input.shared.feed.lock().unwrap();
    let kept = INBOX - COMMANDS;
    let pushed: Vec<f32> = (0..(kept + 3) * PIECE).map(numbered).collect();
    input.push(&pushed[..PIECE], 24_000).unwrap();
    input.clear();
    pushed[PIECE..].chunks(2 * PIECE).for_each(|two| input.push(two, 24_000).unwrap());
    input.finish();
    assert!(!voice.is_present());
    drop(feed);
    input.push(&[0.5; 10], 24_000).unwrap();
    // The first piece was broken off by the command behind it, which took a place too.
    let sound = &pushed[PIECE..(kept - 1) * PIECE];
    let heard: Vec<f32> = (0..40).flat_map(|k| block(&mut voice, k).1).collect();
    assert_eq!(heard[..sound.len()], *sound);
    assert_eq!(heard[sound.len()..][..11], [[0.5; 10].as_slice(), &[0.0]].concat());
    assert_eq!(voice.stats().contended_samples as usize, pushed.len() - PIECE - sound.len());

    // More commands than there are places: the last are dropped, each counted as one.
    let feed = input.shared.feed.lock().unwrap();
    (0..INBOX + 5).for_each(|_| input.set_present(false));
    drop(feed);
    input.set_present(true);
    assert_eq!(voice.stats().contended_samples as usize, pushed.len() - PIECE - sound.len() + 5);
}
