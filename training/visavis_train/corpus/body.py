"""Puts the layers together: feet, pelvis, spine, head and arms -> global joint transforms that obey the rig exactly."""
import numpy as np

from ..motion import rig
from ..motion.contacts import LEGS, SHANK, THIGH, two_bone
from ..motion.rig import INDEX, OFFSETS
from .signals import FPS, delay, follow, gaussian, keyed, smooth_noise

UPPER, FORE = 0.270, 0.250
ARMS = (("leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand"), ("rightShoulder", "rightUpperArm", "rightLowerArm", "rightHand"))


def blend(a, b, w):
    """Normalised-linear blend of rotation matrices [T, 3, 3]; w scalar or [T]."""
    qa, qb = rig.mat_to_quat(a), rig.mat_to_quat(b)
    qb = qb * np.where(np.sum(qa * qb, -1) < 0, -1.0, 1.0)[:, None]
    w = np.broadcast_to(np.asarray(w, float), qa.shape[:1])[:, None]
    return rig.quat_to_mat(qa * (1 - w) + qb * w)


def frame_from(x=None, y=None, z=None):
    """Rotation matrices with given columns; the missing third column is the cross product."""
    if x is None:
        x = np.cross(y, z)
    elif y is None:
        y = np.cross(z, x)
    elif z is None:
        z = np.cross(x, y)
    return np.stack([x, y, z], -1)


def weight_shifts(rng, frames, speed):
    """Slow change of the loaded leg while standing, -1 right .. 1 left [T]; shifts every 4-15 s take about 1 s."""
    times, vals, t = [0], [rng.uniform(-0.6, 0.6)], int(FPS * rng.uniform(2, 8))
    while t < frames:
        n = int(FPS * rng.uniform(0.8, 1.6))
        times += [t, t + n]
        vals += [vals[-1], np.clip(-np.sign(vals[-1]) * rng.uniform(0.1, 1.0) if rng.random() < 0.6 else rng.uniform(-1, 1), -1, 1)]
        t += n + int(FPS * rng.uniform(3, 14))
    still = gaussian((speed < 0.12).astype(float), 8)
    return keyed(frames, times, vals) * still + smooth_noise(rng, frames, 2.5, 0.06)


def pelvis(rng, enc, feet):
    """Hips position [T, 3], yaw [T], rotation [T, 3, 3] from the root path and the feet."""
    frames = len(enc.root)
    fr, ankles = feet.ankles()
    mid_yaw = feet.yaw.mean(1)
    lead = np.clip(enc.yaw - mid_yaw, -0.7, 0.7)
    yaw = gaussian(mid_yaw + 0.55 * lead, 3.5)
    fwd = np.stack([np.sin(yaw), np.cos(yaw)], 1)
    left = np.stack([np.cos(yaw), -np.sin(yaw)], 1)
    spd = gaussian(np.hypot(*gaussian(np.gradient(enc.root, axis=0) * FPS, 3).T), 4)
    mid = gaussian(ankles[:, :, [0, 2]].mean(1), 4.0) + fwd * 0.035
    shift = weight_shifts(rng, frames, spd)
    load = gaussian((feet.load - 0.5) * 2, 4.5)
    width = np.abs(np.sum((ankles[:, 0, [0, 2]] - ankles[:, 1, [0, 2]]) * left, 1))
    lateral = load * 0.5 * gaussian(width, 4) * (0.62 - 0.3 * np.clip(spd, 0, 1)) + shift * 0.036
    xz = gaussian(0.5 * enc.root + 0.5 * mid, 2.5) + left * lateral[:, None]
    for c in (0, 1):
        xz[:, c] += smooth_noise(rng, frames, 1.6, 0.004)
    pitch = 0.02 + 0.05 * np.clip(spd, 0, 1.5) + smooth_noise(rng, frames, 4.0, 0.012)
    roll = 0.055 * shift + 0.05 * load
    # pelvic rotation with the swing leg, about 5 degrees at walking speed (Murray 1964)
    reach = np.sum((ankles[:, 0, [0, 2]] - ankles[:, 1, [0, 2]]) * fwd, 1)
    rot = rig.euler_yxz(yaw - 0.22 * gaussian(np.clip(reach, -0.5, 0.5), 2), pitch, roll)
    hips = np.stack([xz[:, 0], np.zeros(frames), xz[:, 1]], 1)
    height = np.full(frames, 9.0)
    for s, names in enumerate(LEGS):
        off = rot @ OFFSETS[INDEX[names[0]]]
        d = ankles[:, s] - hips - off
        flat2 = d[:, 0] ** 2 + d[:, 2] ** 2
        limit = 0.8022
        h = ankles[:, s, 1] - off[:, 1] + np.sqrt(np.maximum(limit ** 2 - flat2, 0.30))
        height = np.minimum(height, h)
    height = np.minimum(height, 0.925)
    bend = rng.uniform(0.0005, 0.005) + np.abs(smooth_noise(rng, frames, 5.0, 0.002))
    win = np.lib.stride_tricks.sliding_window_view(np.pad(height, 8, mode="edge"), 17).min(1)
    hips[:, 1] = gaussian(win, 2.0) - bend
    return hips, yaw, rot, spd


def assemble(rng, enc, feet, head, arms):
    """Global positions [T, 22, 3] and rotations [T, 22, 3, 3]. `head`: (yaw, pitch, roll) wanted of the head, world."""
    frames = len(enc.root)
    hips, yaw, hip_rot, spd = pelvis(rng, enc, feet)
    g = np.empty((frames, rig.J, 3, 3))
    g[:, 0] = hip_rot
    # torso: follows the head late and in part (head first, torso next, feet last)
    hy, hp, hr = head
    rel = np.clip(rig.wrap(hy - yaw), -1.4, 1.4)
    torso = follow(np.clip(0.42 * delay(rel, 3), -0.6, 0.6), 5.5, 2.5, 20.0)
    breath = 2 * np.pi * np.cumsum(0.24 + smooth_noise(rng, frames, 6, 0.02)) / FPS
    slouch = rng.uniform(-0.02, 0.07)
    effort = gaussian(np.clip(arms.active.max(0), 0, 1), 10)
    pitch = 0.5 * slouch + 0.12 * gaussian(hp, 6) + 0.02 * spd + smooth_noise(rng, frames, 3.5, 0.015) - 0.008 * np.sin(breath) \
        + effort * smooth_noise(rng, frames, 1.4, 0.022)
    hip_roll = gaussian(np.arcsin(np.clip(hip_rot[:, 1, 0], -1, 1)), 2)
    roll = -0.35 * hip_roll + smooth_noise(rng, frames, 4.0, 0.012) + effort * smooth_noise(rng, frames, 1.6, 0.018)
    # shoulders counter-rotate to the pelvis in walking
    reach = np.sum((feet.toe[:, 0] - feet.toe[:, 1]) * np.stack([np.sin(yaw), 0 * yaw, np.cos(yaw)], 1), 1)
    counter = 0.16 * gaussian(np.clip(reach, -0.5, 0.5), 2)
    chest = rig.euler_yxz(yaw + torso + counter + effort * smooth_noise(rng, frames, 1.8, 0.03), pitch, roll)
    up = INDEX["upperChest"]
    g[:, 1] = blend(hip_rot, chest, 0.33)
    g[:, 2] = blend(hip_rot, chest, 0.68)
    g[:, up] = chest
    head_rel = np.clip(rig.wrap(hy - yaw - torso), -1.15, 1.15)
    g[:, 5] = rig.euler_yxz(yaw + torso + head_rel, hp, hr)
    g[:, 4] = blend(chest, g[:, 5], 0.45)
    _legs(g, hips, hip_rot, feet)
    _arms(rng, g, hips, yaw, feet, arms, spd, breath)
    return rig.fk_global(hips, g), g


def _legs(g, hips, hip_rot, feet):
    foot_rot, ankles = feet.ankles()
    for s, (upper, lower, foot, toes) in enumerate(LEGS):
        start = hips + hip_rot @ OFFSETS[INDEX[upper]]
        hip_yaw = rig.yaw_of(hip_rot)
        knee_yaw = hip_yaw + np.clip(0.5 * rig.wrap(feet.yaw[:, s] - hip_yaw), -0.6, 0.6)
        knee = np.stack([np.sin(knee_yaw), 0 * knee_yaw, np.cos(knee_yaw)], 1)
        a, b, n = two_bone(start, ankles[:, s], knee, THIGH, SHANK)
        x = rig.unit(n)                        # rest: bones along -Y, knee along +Z: Z x -Y = +X
        g[:, INDEX[upper]] = frame_from(x=x, y=-a)
        g[:, INDEX[lower]] = frame_from(x=x, y=-b)
        g[:, INDEX[foot]] = foot_rot[:, s]
        flat = rig.axis_mat("y", feet.yaw[:, s]) @ rig.axis_mat("x", np.where(feet.swing[:, s] > 0, 0.6, 0.0) * feet.pitch[:, s])
        g[:, INDEX[toes]] = blend(flat, foot_rot[:, s], 0.15)


def _arms(rng, g, hips, yaw, feet, arms, spd, breath):
    frames = len(hips)
    chest = g[:, INDEX["upperChest"]]
    fwd = np.stack([np.sin(yaw), 0 * yaw, np.cos(yaw)], 1)
    swing_gain = rng.uniform(0.30, 0.65) * np.clip(gaussian(spd, 6) / 0.5, 0, 1)
    for s, (shoulder, upper, lower, hand) in enumerate(ARMS):
        sign = np.array([1.0 if s == 0 else -1.0, 1, 1])
        sg = sign[0]
        wrist = arms.wrist[s].copy()
        hanging = np.clip((-wrist[:, 1] - 0.36) / 0.1, 0, 1)
        other = feet.toe[:, 1 - s] - feet.toe[:, s]
        swing = gaussian(np.clip(0.5 * np.sum(other * fwd, 1), -0.35, 0.35), 2) * swing_gain * hanging
        wrist[:, 2] += swing + 0.03 * hanging * np.clip(spd, 0, 1)
        r = np.linalg.norm(wrist, axis=1, keepdims=True)
        wrist *= np.minimum(1, 0.507 / r)
        lift = 0.20 * np.clip((wrist[:, 1] + 0.30) / 0.45, 0, 1) + 0.010 * np.sin(breath) - 0.02
        g[:, INDEX[shoulder]] = chest @ rig.axis_mat("z", sg * gaussian(lift, 1))
        # elbow: behind a hanging arm, turned with the arm by the shortest rotation, then out by the swivel angle
        zero = np.zeros(frames)
        out = arms.swivel[s] + 0.7 * np.clip((0.05 - wrist[:, 0]) / 0.15, 0, 1)   # across the body: elbow clear of the trunk
        back = np.stack([np.sin(out), zero, -np.cos(out)], 1)
        down = np.stack([zero, zero - 1, zero], 1)
        pole = np.einsum("tab,tb->ta", rig.between(down, rig.unit(wrist)), back)
        up, lo, n = two_bone(np.zeros((frames, 3)), wrist * sign, pole * sign, UPPER, FORE)
        up, lo, n = (np.einsum("tab,tb->ta", chest, v) for v in (up, lo, n))
        y = -n * sg                            # rest: left arm +X bends towards +Z about -Y
        g[:, INDEX[upper]] = frame_from(x=sg * up, y=rig.unit(y))
        fore = frame_from(x=sg * lo, y=rig.unit(y))
        tw = arms.twist[s]
        g[:, INDEX[lower]] = fore @ rig.axis_mat("x", 0.5 * tw)
        flex = gaussian(0.10 + smooth_noise(rng, frames, 1.5, 0.05), 1)
        g[:, INDEX[hand]] = fore @ rig.axis_mat("x", tw) @ rig.axis_mat("z", -sg * flex)
