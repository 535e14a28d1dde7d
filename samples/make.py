#!/usr/bin/env python3
"""Puts the spoken turns on one time line and walks the user around the agent. Called by make.sh."""
import array
import math
import sys
import wave

RATE = 16000
SECONDS = 29.2  # 219 blocks of 4 frames at 30 fps
TRACK_RATE = 90

# (time s, distance m, angle in degrees around the agent: 0 in front of it (+Z), 90 on its left (+X))
WALK = [
    (0.0, 2.0, 0), (5.0, 2.0, 0), (7.0, 1.25, 0), (11.6, 1.2, 0),
    (21.6, 1.3, 270), (25.2, 1.4, 270), (28.6, 3.1, 285), (29.2, 3.1, 285),
]


def mix(dialogue, folder):
    """Voices {speaker: int16 samples}, every turn at its place."""
    voices = {name: array.array("h", bytes(2 * round(SECONDS * RATE))) for name in ("agent", "user")}
    begin = end = 0.0
    turns = [line.split("\t") for line in open(dialogue, encoding="utf-8") if not line.startswith("#")]
    for turn, (speaker, start, text) in enumerate(turns):
        with wave.open(f"{folder}/{turn:02}.wav") as file:
            assert (file.getframerate(), file.getnchannels(), file.getsampwidth()) == (RATE, 1, 2)
            samples = array.array("h", file.readframes(file.getnframes()))
        here = {"+": end, "@": begin}[start[0]] + float(start[1:])
        there = here + len(samples) / RATE
        assert there < SECONDS, f"the dialogue runs past {SECONDS} s: {text}"
        at = round(here * RATE)
        voices[speaker][at:at + len(samples)] = samples
        print(f"{here:6.2f} - {there:5.2f}  {speaker:5}  {text.strip()}")
        if start[0] == "+":
            begin, end = here, there
    return voices


def walk(t):
    """Distance and angle at time t, eased at both ends of every leg."""
    for (t0, r0, a0), (t1, r1, a1) in zip(WALK, WALK[1:]):
        if t <= t1:
            u = (t - t0) / (t1 - t0)
            u = u * u * (3 - 2 * u)
            return r0 + (r1 - r0) * u, math.radians(a0 + (a1 - a0) * u)
    return WALK[-1][1], math.radians(WALK[-1][2])


def head(t):
    """Head position (m): the walk, with the sway of a standing body and the bob of a walking one."""
    r, a = walk(t)
    r1, a1 = walk(t + 0.02)
    speed = math.hypot(r1 - r, r * (a1 - a)) / 0.02
    sway_x = 0.016 * math.sin(2 * math.pi * 0.23 * t) + 0.007 * math.sin(2 * math.pi * 0.61 * t + 1)
    sway_z = 0.013 * math.sin(2 * math.pi * 0.31 * t + 2) + 0.006 * math.sin(2 * math.pi * 0.83 * t)
    bob = 0.02 * min(1, speed / 0.6) * math.sin(2 * math.pi * 1.7 * t)
    y = 1.65 + 0.012 * math.sin(2 * math.pi * 0.11 * t) + bob
    return r * math.sin(a) + sway_x, y, r * math.cos(a) + sway_z


def main():
    dialogue, folder, out = sys.argv[1:]
    for name, samples in mix(dialogue, folder).items():
        with wave.open(f"{out}/{name}.wav", "wb") as file:
            file.setparams((1, 2, RATE, 0, "NONE", None))
            file.writeframes(samples.tobytes())
    with open(f"{out}/user.csv", "w", newline="\n", encoding="ascii") as file:
        file.write("t,x,y,z\n")
        for i in range(round(SECONDS * TRACK_RATE)):
            t = i / TRACK_RATE
            file.write(f"{t:.4f},{','.join(f'{c:.3f}' for c in head(t))}\n")


if __name__ == "__main__":
    main()
