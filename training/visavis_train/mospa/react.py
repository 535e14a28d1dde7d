"""Reactions to a sound: which one a class and a sensitivity call for, and the body that makes it.

Standing, turning, stepping, flinching and covering the ears are composed as the conversation corpus is (real people at rest, real swings of feet); runs
and dances are real takes joined to it. Times: the eyes and head turn to a sound 0.2 to 0.35 s after its onset, the trunk later (Goossens and Van
Opstal 1997; Hollands et al. 2004), a startle begins within 0.1 s (Brown et al. 1991), choosing what to do takes 0.3 to 0.8 s (Hick 1952; Luce 1986).
"""
from dataclasses import dataclass

import numpy as np

from ..corpus import attention, body, encounter, feet, real, rest
from ..corpus.gestures import Arms, elbow_of
from ..corpus.signals import FPS, gaussian, keyed, minjerk
from ..motion import rig

FRAMES = 240
REACTIONS = ("stay", "look", "approach", "flinch", "cover", "run", "dance")
GENRES = ("dull", "neutral", "sensitive")
TURNS = ("look", "approach")                     # those that end facing the source
# class: reaction of a dull, a neutral and a sensitive person, after the paper's tables A4 to A8
TABLE = {
    "dog_bark": ("look", "look", "flinch"), "baby_cry": ("look", "approach", "approach"), "person_sneeze": ("stay", "look", "flinch"),
    "rooster": ("stay", "look", "look"), "rain": ("stay", "look", "look"), "sea_waves": ("stay", "look", "approach"),
    "clock_tick": ("stay", "stay", "look"), "helicopter": ("look", "look", "cover"), "chainsaw": ("look", "flinch", "cover"),
    "fire_crackling": ("look", "flinch", "run"), "alarm": ("look", "cover", "run"), "shot": ("flinch", "run", "run"), "glass": ("look", "flinch", "flinch"),
    "phone": ("look", "approach", "approach"), "knock": ("look", "approach", "approach"), "music": ("look", "dance", "dance"),
    "speech": ("look", "approach", "approach"), "crowd": ("look", "flinch", "cover"), "silence": ("stay", "stay", "stay"),
}
PACE = {"dull": 1.5, "neutral": 1.0, "sensitive": 0.8}                         # of times
TURN = {"dull": (3.2, 2.4), "neutral": (4.0, 3.4), "sensitive": (4.6, 4.2)}    # stiffness [1/s] and greatest speed [rad/s] of the trunk's turn


@dataclass
class Moves:
    """What a split may draw on: people at rest, swings of feet, runs and dances [(name, positions, rotations)]."""
    rests: rest.Library
    swings: object
    runs: list
    dances: list


RUNS = {"train": ["accad_female1/Female1_C05_WalkToRun", "accad_female1/Female1_C03_Run", "accad_female1/Female1_C04_RunToWalk1"]
        + [f"cmu_walk/35_{n}" for n in range(17, 27)], "val": ["cmu_walk/08_09"], "test": ["cmu_walk/02_03"]}
OTHERS = ("02_", "08_")                          # runners of val and test: not among the swings of train


def load(data, split):
    """The motion of a split; people at rest and runners are in one split only, dances are split by take (they have one pair of dancers)."""
    import os
    from ..motion.retarget import load_take
    takes = [(p, r) for name, p, r in real.walk_takes(data, split) if split != "train" or not name.startswith(OTHERS)]
    runs = []
    for name in RUNS[split]:
        path = os.path.join(data, "motion", name)
        t = load_take(path + (".npz" if "accad" in name else ".bvh"), name.split("/")[1])
        p, r = t.positions, t.rotations
        if name.endswith("WalkToRun"):
            fast = np.hypot(*np.gradient(p[:, 0][:, [0, 2]], axis=0).T) * FPS > 1.1
            p, r = p[fast.argmax():], r[fast.argmax():]
        runs += [(name, p, r), (name, *rig.mirror(p, r))]
    dances = [("cmu_two_person/" + n, p, r) for n, p, r, _, _ in real.two_person(data, split, 7.0)]
    library = real.swings.gather(takes + [(p, r) for _, p, r in real.accad_walks(data, split)])
    return Moves(rest.load(data, split), library, runs, dances)


def bump(at, rise, hold, fall):
    """0 to 1 and back [T], frames."""
    return keyed(FRAMES, [0, at, at + rise, at + rise + hold, at + rise + hold + fall], np.array([0.0, 0, 1, 1, 0]))


def walk(goals, stiff, most, push=2.4):
    """Root [T, 2], heading [T] and speed [T] of a body that is wanted at and towards: `goals` [(from frame, place [2] or None, heading or None, top speed)]."""
    p, v, yaw, w, dt = np.zeros(2), np.zeros(2), 0.0, 0.0, 1 / FPS
    place, heading, top = np.zeros(2), 0.0, 0.0
    goals, out = list(goals), []
    for t in range(FRAMES):
        while goals and t >= goals[0][0]:
            _, a, b, top = goals.pop(0)
            place, heading = place if a is None else a, heading if b is None else b
        d = place - p
        far = np.hypot(*d)
        facing = np.cos(np.arctan2(d[0], d[1]) - yaw)
        speed = min(top, 1.6 * far) * (1.0 if facing > 0.5 else 0.45 if far > 1.2 else 0.8)
        a = 4.0 * (d / max(far, 1e-6) * speed - v)
        v = v + a * min(1.0, push / max(np.hypot(*a), 1e-6)) * dt
        p = p + v * dt
        e = rig.wrap(heading - yaw)
        w = np.clip(w + np.clip(stiff ** 2 * e - 2 * stiff * w, -26, 26) * dt, -most, most)
        yaw += w * dt
        out.append((*p, yaw, np.hypot(*v)))
    out = np.array(out)
    return out[:, :2], out[:, 2], out[:, 3]


def compose(rng, moves, goals, gaze, nod, own, wrist_goal, genre):
    """A body from its root's goals, what it looks at [T, 3], head pitch added [T], its layers at rest and where wrists go: (share [T], place [3]) or None."""
    root, yaw, speed = walk(goals, *TURN[genre])
    enc = encounter.Encounter(gaze, root, yaw, speed, [])
    steps = feet.plan(rng, root, yaw, moves.swings)
    wrist, elbow = own.wrist.transpose(1, 0, 2).copy(), own.elbow.transpose(1, 0, 2).copy()
    active = np.zeros((2, FRAMES))
    if wrist_goal is not None:
        share, place = wrist_goal
        for side in (0, 1):
            late = np.roll(share, 2 * side) if rng.random() < 0.5 else share
            k = late[:, None]
            goal = np.tile(place + rng.normal(0, 0.015, 3), (FRAMES, 1))
            wrist[side] = wrist[side] * (1 - k) + goal * k + np.sin(np.pi * k) * [0.05, 0, 0.10]
            elbow[side] = rig.unit(elbow[side] * (1 - k) + elbow_of(goal, np.full(FRAMES, 0.9)) * k)
            active[side] = late
    arms = Arms(wrist, elbow, np.full((2, FRAMES), rest.TWIST), active)
    eye = np.stack([root[:, 0], np.full(FRAMES, 1.56), root[:, 1]], 1)
    calm = 0.35 * body.standing(enc, steps)[:, None] * own.head
    head_yaw, pitch, roll = attention.head_angles(rng, eye, gaze, np.zeros((FRAMES, 2)), yaw, calm)
    return body.assemble(rng, enc, steps, (head_yaw, pitch + nod, roll), arms, own)


def join(parts, blend):
    """Takes one behind the other (`real.chain`), feet locked again, cut to length."""
    p, r = real.chain(parts, blend)
    return p[:FRAMES], r[:FRAMES]


def perform(rng, moves, reaction, genre, source, onset):
    """Positions [240, 22, 3], rotations [240, 22, 3, 3] of a reaction to a source [3] heard from frame `onset` on, seconds from the
    onset to the reaction's beginning, and the names of recordings. The body stands at the origin facing +Z at first."""
    pace = PACE[genre]
    bearing = np.arctan2(source[0], source[2])
    flat = np.array([source[0], source[2]])
    far = max(np.hypot(*flat), 1e-6)
    towards, wait = flat / far, lambda a, b: rng.uniform(a, b) * pace
    own, _, used = rest.compose(rng, moves.rests, FRAMES)
    # where the eyes are before and without a sound: ahead, a little aside now and then
    aside = gaussian(np.repeat(rng.normal(0, 0.25, FRAMES // 40 + 1), 40)[:FRAMES], 6)
    gaze = np.stack([3 * np.sin(aside), np.full(FRAMES, rng.uniform(1.3, 1.6)), 3 * np.cos(aside)], 1)
    nod, goals, wrists, begin, parts = np.zeros(FRAMES), [], None, 0.0, []
    # `attention.head_angles` follows what is looked at 0.17 to 0.27 s late
    seen = wait(0.02, 0.12)
    look = int(onset + FPS * seen)
    here = np.tile(source, (FRAMES, 1))
    trunk = look + int(FPS * wait(0.25, 0.40))
    if reaction in ("look", "approach"):
        gaze[look:], begin = here[look:], seen + 0.2
        goals = [(trunk, None, bearing, 0.8)]
        if reaction == "approach" and far > 1.4:
            goals.append((trunk + int(FPS * wait(0.3, 0.8)), towards * (far - rng.uniform(0.8, 1.2)), bearing, {"dull": 0.9, "neutral": 1.15, "sensitive": 1.4}[genre]))
    elif reaction == "flinch":
        begin = rng.uniform(0.07, 0.11)
        start = int(onset + FPS * begin)
        size = {"dull": 0.7, "neutral": 0.9, "sensitive": 1.15}[genre] * rng.uniform(0.85, 1.15)
        duck = size * bump(start, 5, 6, 22)
        own.chest[:, 0] += 0.30 * duck
        own.hips[:, 2] += 0.07 * duck
        own.shoulder[:, :, 2] += 0.25 * duck[:, None]
        nod += 0.40 * duck
        wrists = (np.clip(size, 0, 1) * bump(start + 1, 6, 10, 26), np.array([-0.02, -0.16, 0.30]))
        gaze[start + 10:] = here[start + 10:]
        back = start + int(FPS * wait(0.30, 0.45))
        goals = [(back, -towards * rng.uniform(0.7, 1.1) * size, bearing, 1.1)]
    elif reaction == "cover":
        begin = wait(0.35, 0.55)
        start = int(onset + FPS * begin)
        gaze[look:start + 4] = here[look:start + 4]
        share = keyed(FRAMES, [0, start, start + int(13 * pace), FRAMES + 60], np.array([0.0, 0, 1, 1]))
        away = -towards
        gaze[start + 4:] = np.array([3 * away[0], 0.9, 3 * away[1]]) if abs(bearing) > 1.2 else np.array([0, 0.7, 1.6])
        own.chest[:, 0] += 0.22 * share
        nod += 0.20 * share
        wrists = (share, np.array([-0.055, 0.165, 0.055]))
        turn = rng.choice([-1, 1]) * 0.3 if abs(bearing) > 1.2 else bearing + np.pi * np.sign(rng.standard_normal()) * 0.8
        goals = [(start + 4, away * rng.uniform(0.2, 0.6), turn if genre == "sensitive" else None, 0.9)]
        if genre == "sensitive":
            gaze[start + 4:] = np.array([3 * np.sin(turn), 0.8, 3 * np.cos(turn)])
    elif reaction == "run":
        begin = wait(0.3, 0.5)
        start = int(onset + FPS * begin)
        flee = bearing + np.pi + rng.normal(0, 0.2)
        out = np.array([np.sin(flee), np.cos(flee)])
        if genre != "sensitive":
            gaze[look:start] = here[look:start]
        duck = bump(int(onset + 3), 5, 4, 14)
        own.hips[:, 2] += 0.04 * duck
        nod += 0.25 * duck
        gaze[start:] = np.array([20 * out[0], 1.5, 20 * out[1]])
        goals = [(start, out * 20, flee, 1.7)]
    elif reaction == "dance":
        begin = wait(0.8, 1.6)
        gaze[look:look + 40] = here[look:look + 40]
    p, r = compose(rng, moves, goals, gaze, nod, own, wrists, genre)
    if reaction == "run":
        off = np.abs(rig.wrap(rig.yaw_of(r[:, 0]) - flee))
        speed = np.hypot(*gaussian(np.gradient(p[:, 0][:, [0, 2]], axis=0), 3).T) * FPS
        ready = np.flatnonzero((off < 0.35) & (speed > 1.0) & (np.arange(FRAMES) > start))
        if len(ready):
            parts = [(p[:ready[0]], r[:ready[0]])]
            first = [x for x in moves.runs if x[0].endswith("WalkToRun")]
            take = (first or moves.runs)[rng.integers(len(first or moves.runs))]
            while sum(len(x) for x, _ in parts) < FRAMES + 90:
                parts.append(take[1:])
                used.append(take[0])
                steady = [x for x in moves.runs if not x[0].endswith(("WalkToRun", "ToWalk1"))]
                take = steady[rng.integers(len(steady))]
            p, r = join(parts, 12)
    elif reaction == "dance":
        start = int(onset + FPS * begin)
        name, q, s = moves.dances[rng.integers(len(moves.dances))]
        at = int(rng.integers(0, max(1, len(q) - 2 * FRAMES)))
        used.append(name)
        p, r = join([(p[:start], r[:start]), (q[at:at + 2 * FRAMES], s[at:at + 2 * FRAMES])], 18)
    return p, r, begin, used
