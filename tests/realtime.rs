//! A running session computes blocks without allocating: proved with an allocator that counts.
//!
//! One test in one binary, without the test harness: its threads allocate too, as when it tells
//! that a test takes long.

mod common;

use common::{Inputs, dram, dram_in, hearing, hearing_in, tiny, tiny_in};
use glam::{Quat, Vec3};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use visavis::internals::kernels::Scheme;
use visavis::internals::session::Anchoring;
use visavis::replay::Hold;
use visavis::{Budget, Engine, Governor, Sampler, Session, SessionOptions, Speaker};

/// The system's allocator, counting what is asked of it while `WATCH` is set.
struct Counting;

static WATCH: AtomicBool = AtomicBool::new(false);
static CALLS: AtomicU64 = AtomicU64::new(0);

fn count() {
    if WATCH.load(Ordering::Relaxed) {
        CALLS.fetch_add(1, Ordering::Relaxed);
    }
}

// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract.
#[allow(unsafe_code, reason = "a global allocator is unsafe by nature")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        count();
        // SAFETY: `ptr` came from `System` with this layout.
        unsafe { System.dealloc(ptr, layout) }
    }

    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: `ptr` came from `System` with this layout; the caller keeps the contract of
        // `realloc`.
        unsafe { System.realloc(ptr, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> u64 {
    CALLS.store(0, Ordering::SeqCst);
    WATCH.store(true, Ordering::SeqCst);
    work();
    WATCH.store(false, Ordering::SeqCst);
    CALLS.load(Ordering::SeqCst)
}

/// A thread that pushes into a session and sets what it goes by, as trackers, microphones and user
/// interfaces do.
struct Beside {
    rounds: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Beside {
    /// Starts it; the first pushes have been made when it returns.
    fn start(session: &Session) -> Self {
        let voices = [Speaker::Agent, Speaker::User].map(|speaker| session.voice_input(speaker));
        let (head, controls, now) = (session.head_input(), session.controls(), session.next_due());
        let (rounds, stop) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (counting, stopped) = (Arc::clone(&rounds), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            let sound = [0.1; 480];
            for round in 0u32.. {
                voices.iter().for_each(|voice| voice.push(&sound, 48_000).unwrap());
                match round % 16 {
                    3 => voices[0].finish(),
                    7 => voices[0].clear(),
                    11 => voices[1].set_present(round % 32 > 16),
                    _ => head.push(Vec3::new(0.0, 1.6, 2.0), now + f64::from(round) * 0.01),
                }
                controls.set_gaze((round % 2 > 0).then_some(0.5)).unwrap();
                controls.set_guidance(1.3, 2.5).unwrap();
                controls.set_sampler([Sampler::Single, Sampler::Midpoint4][round as usize % 2]).unwrap();
                counting.fetch_add(1, Ordering::Release);
                if stopped.load(Ordering::Acquire) {
                    return;
                }
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        let beside = Self { rounds, stop, thread };
        while beside.rounds() == 0 {
            std::thread::yield_now();
        }
        beside
    }

    fn rounds(&self) -> u64 {
        self.rounds.load(Ordering::Acquire)
    }

    fn end(self) {
        self.stop.store(true, Ordering::Release);
        self.thread.join().unwrap();
    }
}

/// Every sampler, one and two threads, gaze on and off, sampler changes with their catching up,
/// re-anchoring, the governor, voices of a rate that is resampled, weights of every scheme: after
/// the first push of each voice, neither pushing nor computing allocates; nor does another thread
/// that pushes and sets meanwhile.
fn a_running_session_does_not_allocate() {
    assert!(allocations(|| drop(std::hint::black_box(vec![1u8]))) > 0, "the allocator counts");
    let inputs = Inputs::circling(20.0, 48_000);
    let flow = [tiny(), tiny_in(Scheme::F16), tiny_in(Scheme::I8), tiny_in(Scheme::I4)];
    let engines: Vec<_> = flow.into_iter().chain([dram("lstm"), dram_in("tcn", Scheme::I8)]).collect();
    for (engine, threads) in engines.iter().flat_map(|e| [(e, 1), (e, 2)]) {
        let options = SessionOptions { threads, diagnostics: Anchoring::Every(10).into(), ..Default::default() };
        let mut session = engine.session(options).unwrap();
        let per_block = 6400;
        let (mut agent, mut user) = (inputs.agent.chunks(per_block), inputs.user.chunks(per_block));
        let mut path = inputs.path.iter().peekable();
        session.push_agent_audio(agent.next().unwrap(), inputs.rate).unwrap();
        session.push_user_audio(user.next().unwrap(), inputs.rate).unwrap();

        let samplers =
            [Sampler::Midpoint4, Sampler::Single, Sampler::Midpoint1, Sampler::euler(8).unwrap(), Sampler::Midpoint2];
        let calls = allocations(|| {
            for block in 0..100 {
                session.set_sampler(samplers[block / 7 % samplers.len()]).unwrap();
                session.set_gaze((block % 5 > 1).then_some(0.5)).unwrap();
                let now = session.next_due();
                while let Some((time, position)) = path.next_if(|(time, _)| *time <= now) {
                    session.push_user_pose(*position, (block > 50).then_some(Quat::IDENTITY), *time).unwrap();
                }
                if let (Some(a), Some(u)) = (agent.next(), user.next()) {
                    session.push_agent_audio(a, inputs.rate).unwrap();
                    session.push_user_audio(u, inputs.rate).unwrap();
                }
                std::hint::black_box(session.poll(now).unwrap().unwrap());
            }
        });
        assert_eq!(calls, 0, "allocations with {threads} threads");
        let flow = engine.kind() == "sarah";
        assert!(!flow || session.stats().anchorings > 0, "re-anchoring was among what ran");

        let beside = Beside::start(&session);
        let calls = allocations(|| {
            let until = beside.rounds() + 20;
            for block in 0.. {
                if block >= 60 && beside.rounds() >= until {
                    break;
                }
                std::hint::black_box(session.poll(session.next_due()).unwrap().unwrap());
            }
        });
        assert_eq!(calls, 0, "allocations beside a thread that pushes, with {threads} threads");
        beside.end();
        session.set_gaze(None).unwrap();

        // The governor with all it does: down the ladder, holding, rehearsing, catching up, and its
        // record of that.
        session.set_sampler(Sampler::Midpoint4).unwrap();
        session.set_governor(Governor::Budget(Budget::default())).unwrap();
        let calls = allocations(|| {
            for block in 0..300 {
                std::hint::black_box(session.poll(session.next_due()).unwrap().unwrap());
                let holds = session.decisions().last().unwrap().plan.hold != Hold::No;
                let ms = if holds {
                    0.5
                } else if (60..100).contains(&block) {
                    150.0
                } else {
                    14.0
                };
                session.report_block_time(ms).unwrap();
            }
        });
        assert_eq!(calls, 0, "allocations under the governor with {threads} threads");
        let stats = session.stats().governor;
        assert!(stats.held_blocks > 0 && (!flow || stats.catch_up_passes > 0), "{stats:?}");
    }
    falling_back_does_not_allocate(&engines, &inputs);
    hearing_does_not_allocate();
    // Sessions stepped together, some of which share passes.
    for (engine, threads) in engines.iter().flat_map(|e| [(e, 1), (e, 2)]) {
        let mut team = engine.team(threads).unwrap();
        let mut sessions: Vec<_> = (0..5)
            .map(|seed| {
                let gaze = (seed == 1).then_some(0.5);
                let options =
                    SessionOptions { seed, gaze, diagnostics: Anchoring::Every(10).into(), ..Default::default() };
                let mut session = engine.session(options).unwrap();
                // Of some, both voices are heard, of some, one.
                let second = inputs.rate as usize;
                session.push_agent_audio(&inputs.agent[..6 * second], inputs.rate).unwrap();
                if seed % 2 == 0 {
                    session.push_user_audio(&inputs.user[..6 * second], inputs.rate).unwrap();
                }
                session
            })
            .collect();
        let mut due: Vec<_> = sessions.iter_mut().map(|session| (session, 0.0)).collect();
        team.step(&mut due).unwrap();
        let calls = allocations(|| {
            for block in 1..40 {
                due.iter_mut().for_each(|(session, now)| *now = session.next_due());
                due[4].0.set_sampler([Sampler::Midpoint4, Sampler::Single][block / 7 % 2]).unwrap();
                assert_eq!(team.step(&mut due).unwrap(), 5);
            }
        });
        assert_eq!(calls, 0, "allocations of a team of {threads} threads");
        assert!(team.shared_blocks() > 40);
    }
}

/// Sixteen sounds at once, some of a rate that is resampled, sources that come and go, a
/// seventeenth, ends, and a host's ears, alone and in a team: after each slot has had a sound of each rate, neither
/// pushing nor computing allocates.
fn hearing_does_not_allocate() {
    let sound: Vec<f32> = (0..6_400).map(|i| 0.3 * (i as f32 * 0.05).sin()).collect();
    for (engine, threads) in [(hearing(), 1), (hearing_in(Scheme::I8), 2)] {
        let mut session = engine.session(SessionOptions { threads, ..Default::default() }).unwrap();
        let mut team = engine.team(1).unwrap();
        let place = |id: u32| Vec3::new((id as f32).sin() * 2.0, 1.5, (id as f32).cos() * 3.0);
        let mut blocks = |session: &mut Session, count: u32, ids: u32| {
            for block in 0..count {
                for id in 0..ids {
                    let rate = [24_000, 48_000][id as usize % 2];
                    let samples = &sound[..rate as usize / 24_000 * 3_200];
                    session.push_sound(id, samples, rate, place(id + block)).unwrap();
                }
                if block % 9 == 8 {
                    session.end_sound(block % 16).unwrap();
                    session.end_ears().unwrap();
                }
                if ids > 0 {
                    session.push_ears(&sound, &sound, 48_000).unwrap();
                }
                // For a while there are none, and some end.
                let now = session.next_due();
                if block % 3 == 0 {
                    team.step(&mut [(&mut *session, now)]).unwrap();
                } else {
                    std::hint::black_box(session.poll(now).unwrap().unwrap());
                }
            }
        };
        blocks(&mut session, 2, 20);
        let calls = allocations(|| {
            blocks(&mut session, 30, 16);
            blocks(&mut session, 10, 0);
            blocks(&mut session, 30, 20);
        });
        assert_eq!(calls, 0, "allocations of a session that hears, with {threads} threads");
        let stats = session.stats().inputs.sounds;
        assert!(stats.started > 16 && stats.refused + stats.replaced > 0, "{stats:?}");
    }
}

/// Down to the fallback, holding where that is late as well, and back, alone and in a team.
fn falling_back_does_not_allocate(engines: &[Arc<Engine>], inputs: &Inputs) {
    let (flow, light) = engines.split_at(4);
    for (engine, light) in flow.iter().flat_map(|engine| light.iter().map(move |light| (engine, light))) {
        let governor = Governor::Budget(Budget::default());
        let mut session = engine.session(SessionOptions { governor, ..Default::default() }).unwrap();
        session.set_fallback(light).unwrap();
        session.push_agent_audio(&inputs.agent, inputs.rate).unwrap();
        session.push_user_audio(&inputs.user, inputs.rate).unwrap();
        session.poll(0.0).unwrap();
        let mut team = engine.team(1).unwrap();
        let calls = allocations(|| {
            for block in 0..300 {
                let now = session.next_due();
                if block % 2 == 0 {
                    team.step(&mut [(&mut session, now)]).unwrap();
                } else {
                    std::hint::black_box(session.poll(now).unwrap().unwrap());
                }
                let ms = match session.decisions().last().unwrap().plan.hold {
                    Hold::No if (60..100).contains(&block) => 150.0,
                    Hold::Fallback if (60..70).contains(&block) => 150.0,
                    Hold::No => 14.0,
                    _ => 0.5,
                };
                session.report_block_time(ms).unwrap();
            }
        });
        assert_eq!(calls, 0, "allocations of a session with a fallback");
        let stats = session.stats().governor;
        assert!(stats.fallback_blocks > 0 && stats.held_blocks > 0, "{stats:?}");
    }
}

/// Runs the test unless the arguments name others, as the harness does.
fn main() {
    const NAME: &str = "a_running_session_does_not_allocate";
    let names: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let wanted = names.is_empty() || names.iter().any(|name| NAME.contains(name.as_str()));
    if wanted {
        a_running_session_does_not_allocate();
        println!("test {NAME} ... ok");
    }
    println!("\ntest result: ok. {} passed; 0 failed\n", u8::from(wanted));
}
