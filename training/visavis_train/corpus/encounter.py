"""The user's head path and the agent's root path, simulated together, as the user moves relative to the agent.

Proxemics: the agent keeps a preferred distance in the social/personal zone, about 1.2-2.0 m (Hall 1966), with a dead band;
it turns its body when the user is off its front by more than a threshold, after the head (Sciutti et al. 2011; the
order gaze, torso, feet of Hollands et al. 2004).
"""
from dataclasses import dataclass

import numpy as np

from ..motion.rig import wrap
from .signals import FPS, minjerk, smooth_noise


@dataclass
class Encounter:
    """user [T, 3] head, root [T, 2] (x, z), yaw [T] wanted heading path of the agent, speed [T]."""
    user: np.ndarray
    root: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray
    events: list


def _around(center, angle, r):
    return center + r * np.array([np.sin(angle), np.cos(angle)])


def _segment(rng, kind, user, agent, height, real_paths):
    """Next stretch of the user's path: floor [n, 2] and head height [n], from `user` (x, z) with the agent at `agent`."""
    d = user - agent
    dist = np.hypot(*d)
    ang = np.arctan2(d[0], d[1])
    n = int(FPS * rng.uniform(2.5, 8))
    y = np.full(n, height)
    stay = np.repeat(user[None], n, 0)
    if kind == "stand":
        return stay, y
    if kind in ("approach", "leave", "pace", "walk"):
        v = rng.uniform(0.4, 1.4)
        if kind == "approach":
            goal = _around(agent, ang + rng.normal(0, 0.15), rng.uniform(0.75, 1.5))
        elif kind == "leave":
            goal = _around(agent, ang + rng.normal(0, 0.5), dist + rng.uniform(1.0, 6.0))
        elif kind == "pace":
            goal = _around(agent, ang + rng.choice([-1, 1]) * rng.uniform(0.3, 1.2) / max(dist, 0.8), dist)
        else:
            goal = _around(agent, rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 3.5))
            side = goal - user                      # do not walk through the agent: bend the path round
            rel = agent - user
            along = np.clip(side @ rel / max(side @ side, 1e-6), 0, 1)
            if np.hypot(*(rel - along * side)) < 0.8:
                kind = "circle"
        if kind != "circle":
            length = np.hypot(*(goal - user))
            m = max(12, int(FPS * 1.6 * length / v))
            n = m + int(FPS * rng.uniform(0.5, 3))
            u = minjerk(np.arange(n) / m)[:, None]
            path = user + (goal - user) * u
            bob = 0.015 * np.sin(2 * np.pi * 1.8 * np.arange(n) / FPS) * np.clip(np.arange(n) < m, 0, 1)
            return path, height + bob
    if kind == "circle":
        sweep = rng.choice([-1, 1]) * rng.uniform(0.8, 4.5)
        r1 = np.clip(dist + rng.normal(0, 0.3), 0.9, 4.0)
        v = rng.uniform(0.4, 1.2)
        m = max(15, int(FPS * 1.6 * abs(sweep) * max(r1, dist) / v))
        n = m + int(FPS * rng.uniform(0.5, 2))
        u = minjerk(np.arange(n) / m)
        a, r = ang + sweep * u, dist + (r1 - dist) * u
        return agent + r[:, None] * np.stack([np.sin(a), np.cos(a)], 1), np.full(n, height)
    if kind == "crouch":
        low = height - rng.uniform(0.3, 0.75)
        t = np.arange(n) / FPS
        y = height + (low - height) * (minjerk(t / 0.9) - minjerk((t - n / FPS + 1.0) / 0.9))
        return stay, y
    if kind == "jump":
        r = dist if rng.random() < 0.6 else rng.uniform(0.9, 3.5)
        a = ang + rng.choice([-1, 1]) * (np.pi / 2 if rng.random() < 0.5 else rng.uniform(0.4, np.pi))
        return np.repeat(_around(agent, a, r)[None], n, 0), y
    if kind == "real" and real_paths:
        p = real_paths[rng.integers(len(real_paths))]
        n = min(len(p), int(FPS * rng.uniform(5, 14)))
        at = int(rng.integers(0, len(p) - n + 1))
        seg = p[at: at + n]
        a = rng.uniform(-np.pi, np.pi)
        c, s = np.cos(a), np.sin(a)
        rel = (seg[:, [0, 2]] - seg[0, [0, 2]]) @ np.array([[c, s], [-s, c]])
        return user + rel, height + (seg[:, 1] - seg[0, 1])
    return stay, y


_KINDS = ["stand", "approach", "leave", "pace", "walk", "circle", "crouch", "jump", "real"]


def simulate(rng, frames, bias, mobility, real_paths=(), restless=(6, 20), urge=None):
    """Runs user and agent together.

    `bias` [T]: wanted body heading away from the user's direction [rad]; `mobility` -0.15..1: how much the user moves about;
    `real_paths`: head paths [n, 3] of real people of the same split; `restless`: seconds from one step of its own accord
    to the next; `urge(t, root, yaw)`: what draws the agent away from the user, as (floor place or None, heading or None,
    greatest speed), or None. Returns an Encounter.
    """
    dt = 1.0 / FPS
    weights = np.array([1.0, 0.7, 0.9, 0.7, 0.5, 0.6, 0.25, 0.4, 0.35])
    weights[1:] *= 0.25 + 1.5 * mobility
    weights[0] *= 2.2 - 1.9 * mobility
    weights /= weights.sum()
    height = rng.uniform(1.45, 1.80)
    first = rng.normal(0, 0.25) if rng.random() < 0.75 else rng.uniform(-np.pi, np.pi)
    user = _around(np.zeros(2), first, rng.uniform(1.1, 2.3) if rng.random() < 0.85 else rng.uniform(2.3, 6.0))
    prefer = rng.uniform(1.2, 1.9)
    lag = int(rng.uniform(7, 11))                      # user seen this many frames ago by the body
    p, v = np.zeros(2), np.zeros(2)
    yaw, w = 0.0, 0.0
    moving, turning = False, abs(first) > 0.7
    threshold, hold = rng.uniform(0.25, 0.6), 0
    slack = rng.uniform(0.3, 0.55)
    brisk = rng.uniform(0.8, 1.3)
    fidget, shift_pos, shift_yaw = int(FPS * rng.uniform(*restless)), np.zeros(2), 0.0
    U, H, P, Y, V, events = [], [], [], [], [], []
    while len(U) < frames:
        kind = _KINDS[rng.choice(len(_KINDS), p=weights)] if U else "stand"
        path, ys = _segment(rng, kind, user, p, height, real_paths)
        events.append((len(U), kind))
        user = path[-1]
        for k in range(len(path)):
            t = len(U)
            if t >= frames:
                break
            U.append(path[k])
            H.append(ys[k])
            seen = U[max(0, t - lag)]
            d = seen - p
            dist = max(np.hypot(*d), 1e-3)
            fidget -= 1
            if fidget <= 0:                            # a restless step or re-orientation now and then
                fidget = int(FPS * rng.uniform(*restless))
                shift_yaw = rng.normal(0, 0.12)
                shift_pos = rng.normal(0, 0.07, 2)
                turning = turning or rng.random() < 0.5
                moving = moving or rng.random() < 0.35
                prefer = np.clip(prefer + rng.normal(0, 0.12), 1.1, 2.0)
            err = seen - d / dist * prefer + shift_pos - p
            far = np.hypot(*err)
            if not moving and abs(dist - prefer) > slack:
                hold += 1
                if hold > 6:
                    moving, hold = True, 0
            else:
                hold = 0
            if moving and far < 0.08 and np.hypot(*v) < 0.15:
                moving = False
                slack = rng.uniform(0.3, 0.55)
            drawn = urge(t, p, yaw) if urge else None
            if drawn and drawn[0] is not None:
                err = drawn[0] - p
                far = np.hypot(*err)
                ahead = np.cos(np.arctan2(err[0], err[1]) - yaw)
                want = err / max(far, 1e-6) * min(drawn[2] * (1.0 if ahead > 0.5 else 0.6), 1.6 * far)
                moving = False
            elif moving:
                ahead = np.cos(np.arctan2(err[0], err[1]) - yaw)
                top = brisk * (1.0 if ahead > 0.5 else 0.55)
                if ahead < 0.2 and far > 1.0:
                    top = 0.75
                want = err / max(far, 1e-6) * min(top, 1.5 * far)
                if far > 0.8 and dist > prefer and ahead < 0.3:  # turn before walking off
                    want *= 0.35
            else:
                want = np.zeros(2)
            a = 4.0 * (want - v)
            mag = np.hypot(*a)
            a *= min(1.0, 2.2 / max(mag, 1e-6))
            v = v + a * dt
            p = p + v * dt
            face = np.arctan2(d[0], d[1])
            goal = face + (bias[t] + shift_yaw) * (0.3 if moving and far > 0.8 else 1.0)
            if drawn and drawn[1] is not None:
                goal, turning = drawn[1], True
            e = wrap(goal - yaw)
            if not turning and (abs(e) > threshold or (moving and abs(e) > 0.12)):
                turning = True
            if turning and abs(e) < 0.06 and abs(w) < 0.15 and not moving:
                turning = False
                threshold = rng.uniform(0.22, 0.6)
            stiff, most = (4.2, 3.4) if drawn else (3.6, 2.6)
            acc = stiff ** 2 * e - 2 * stiff * w if turning else -5.0 * w
            w = np.clip(w + np.clip(acc, -20 if drawn else -14, 20 if drawn else 14) * dt, -most, most)
            yaw = yaw + w * dt
            P.append(p.copy()), Y.append(yaw), V.append(np.hypot(*v))
    user3 = np.stack([np.array(U)[:, 0], np.array(H), np.array(U)[:, 1]], 1)
    for c, amp in ((0, 0.012), (1, 0.004), (2, 0.012)):   # postural sway of a standing head
        user3[:, c] += smooth_noise(rng, frames, 1.3, amp) + smooth_noise(rng, frames, 4.0, amp)
    return Encounter(user3, np.array(P), np.array(Y), np.array(V), events)
