"""Puts the layers together: feet, pelvis, spine, head and arms -> global joint transforms that obey the rig exactly."""
import numpy as np

from ..motion import rig
from ..motion.contacts import LEGS, SHANK, THIGH, two_bone
from ..motion.rig import INDEX, OFFSETS
from .rest import ARMS, FLEX, SPINE, between, legs_height
from .signals import FPS, delay, follow, gaussian, smooth_noise

UPPER, FORE = 0.270, 0.250


def frame_from(x=None, y=None, z=None):
    """Rotation matrices with given columns; the missing third column is the cross product."""
    if x is None:
        x = np.cross(y, z)
    elif y is None:
        y = np.cross(z, x)
    elif z is None:
        z = np.cross(x, y)
    return np.stack([x, y, z], -1)


def standing(enc, feet):
    """How much of the rest layers shows [T], 0..1: all of it while the body stands, none of it on the way."""
    spd = np.hypot(*gaussian(np.gradient(enc.root, axis=0) * FPS, 3).T)
    stepping = (feet.swing > 0).any(1) | (spd > 0.12)
    return gaussian(1.0 - gaussian(stepping.astype(float), 5), 8)


def pelvis(enc, feet, rest):
    """Hips position [T, 3], yaw [T], rotation [T, 3, 3] and speed [T] from the root path, the feet and the rest layers."""
    frames = len(enc.root)
    fr, ankles = feet.ankles()
    mid_yaw = feet.yaw.mean(1)
    lead = np.clip(enc.yaw - mid_yaw, -0.7, 0.7)
    yaw = gaussian(mid_yaw + 0.55 * lead, 3.5)
    fwd = np.stack([np.sin(yaw), np.cos(yaw)], 1)
    left = np.stack([np.cos(yaw), -np.sin(yaw)], 1)
    spd = gaussian(np.hypot(*gaussian(np.gradient(enc.root, axis=0) * FPS, 3).T), 4)
    still = standing(enc, feet)[:, None]
    middle = gaussian(ankles[:, :, [0, 2]].mean(1), 4.0)
    load = gaussian((feet.load - 0.5) * 2, 4.5)
    width = np.abs(np.sum((ankles[:, 0, [0, 2]] - ankles[:, 1, [0, 2]]) * left, 1))
    lateral = load * 0.5 * gaussian(width, 4) * (0.62 - 0.3 * np.clip(spd, 0, 1))
    walk = gaussian(0.5 * enc.root + 0.5 * (middle + fwd * 0.035), 2.5)
    stand = middle + left * rest.hips[:, :1] + fwd * rest.hips[:, 1:2]
    xz = walk * (1 - still) + stand * still + left * lateral[:, None]
    # pelvic rotation with the swing leg, about 5 degrees at walking speed (Murray 1964)
    reach = np.sum((ankles[:, 0, [0, 2]] - ankles[:, 1, [0, 2]]) * fwd, 1)
    rot = rig.euler_yxz(yaw - 0.22 * gaussian(np.clip(reach, -0.5, 0.5), 2), 0.02 + 0.05 * np.clip(spd, 0, 1.5), 0.05 * load) \
        @ rig.rotvec_to_mat(rest.pelvis * still)
    hips = np.stack([xz[:, 0], np.zeros(frames), xz[:, 1]], 1)
    height = np.minimum(legs_height(xz, rot, ankles), 0.925)
    win = np.lib.stride_tricks.sliding_window_view(np.pad(height, 8, mode="edge"), 17).min(1)
    hips[:, 1] = gaussian(win, 2.0) - 0.002 - rest.hips[:, 2] * still[:, 0]
    return hips, yaw, rot, spd, still


def assemble(rng, enc, feet, head, arms, rest):
    """Global positions [T, 22, 3] and rotations [T, 22, 3, 3]. `head`: (yaw, pitch, roll) wanted of the head, world."""
    frames = len(enc.root)
    hips, yaw, hip_rot, spd, still = pelvis(enc, feet, rest)
    g = np.empty((frames, rig.J, 3, 3))
    g[:, 0] = hip_rot
    # torso: follows the head late, in part and only where it turns far (head first, torso next, feet last)
    hy, hp, hr = head
    rel = np.clip(rig.wrap(hy - yaw), -1.4, 1.4)
    slow = gaussian(rel, 12)
    far = np.sign(slow) * np.maximum(np.abs(slow) - 0.2, 0)
    torso = follow(np.clip(0.48 * delay(far, 3), -0.6, 0.6), 5.5, 2.5, 20.0)
    slouch = rng.uniform(-0.02, 0.07)
    effort = gaussian(np.clip(arms.active.max(0), 0, 1), 10)
    pitch = 0.5 * slouch + 0.06 * gaussian(hp, 6) + 0.02 * spd + effort * smooth_noise(rng, frames, 1.4, 0.022)
    roll = effort * smooth_noise(rng, frames, 1.6, 0.018)
    # shoulders counter-rotate to the pelvis in walking
    reach = np.sum((feet.toe[:, 0] - feet.toe[:, 1]) * np.stack([np.sin(yaw), 0 * yaw, np.cos(yaw)], 1), 1)
    counter = 0.16 * gaussian(np.clip(reach, -0.5, 0.5), 2)
    chest = rig.euler_yxz(yaw + torso + counter + effort * smooth_noise(rng, frames, 1.8, 0.03), pitch, roll) @ rig.rotvec_to_mat(rest.chest * still)
    up = INDEX["upperChest"]
    g[:, up] = chest
    head_rel = np.clip(rig.wrap(hy - yaw - torso), -1.15, 1.15)
    g[:, 5] = rig.euler_yxz(yaw + torso + head_rel, hp, hr)
    for k, (joint, below, above, share) in enumerate(SPINE):
        g[:, INDEX[joint]] = between(g[:, INDEX[below]], g[:, INDEX[above]], share) @ rig.rotvec_to_mat(rest.spine[:, k] * still)
    _legs(g, hips, hip_rot, feet)
    _arms(rng, g, hips, yaw, feet, arms, spd, rest)
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
        g[:, INDEX[toes]] = between(flat, foot_rot[:, s], 0.15)


def _arms(rng, g, hips, yaw, feet, arms, spd, rest):
    frames = len(hips)
    chest = g[:, INDEX["upperChest"]]
    fwd = np.stack([np.sin(yaw), 0 * yaw, np.cos(yaw)], 1)
    swing_gain = rng.uniform(0.30, 0.65) * np.clip(gaussian(spd, 6) / 0.5, 0, 1)
    for s, (collar, upper, lower, hand) in enumerate(ARMS):
        polar = np.array([1.0 if s == 0 else -1.0, 1, 1])
        wrist = arms.wrist[s].copy()
        hanging = np.clip((-wrist[:, 1] - 0.36) / 0.1, 0, 1)
        other = feet.toe[:, 1 - s] - feet.toe[:, s]
        swing = gaussian(np.clip(0.5 * np.sum(other * fwd, 1), -0.35, 0.35), 2) * swing_gain * hanging
        wrist[:, 2] += swing + 0.03 * hanging * np.clip(spd, 0, 1)
        lift = gaussian(0.20 * np.clip((wrist[:, 1] + 0.30) / 0.45, 0, 1) - 0.02, 1)[:, None] * [0.0, 0.0, 1.0]
        k = gaussian(arms.active[s], 2)[:, None]
        own = (rest.shoulder[:, s] * (1 - k) + lift * k) * (1 if s == 0 else np.array([1, -1, -1]))
        pose_arm(g, s, chest, own, wrist * polar, arms.elbow[s] * polar, arms.twist[s], FLEX + k[:, 0] * gaussian(smooth_noise(rng, frames, 1.5, 0.05), 1))


def pose_arm(g, side, chest, collar, wrist, elbow, twist, flex):
    """Sets one arm in the global rotations g [T, 22, 3, 3]. `collar`: rotation vector [T, 3] of the collar bone; `wrist` and
    `elbow` [T, 3] in the chest's frame, from the shoulder joint; `twist`, `flex` [T] of the hand."""
    upper, lower, hand = (INDEX[n] for n in ARMS[side][1:])
    sg = 1.0 if side == 0 else -1.0
    g[:, INDEX[ARMS[side][0]]] = chest @ rig.rotvec_to_mat(collar)
    wrist = wrist * np.minimum(1, 0.512 / np.linalg.norm(wrist, axis=1, keepdims=True))
    up, lo, n = two_bone(np.zeros_like(wrist), wrist, elbow, UPPER, FORE)
    up, lo, n = (np.einsum("tab,tb->ta", chest, v) for v in (up, lo, n))
    y = rig.unit(-n * sg)                      # rest: left arm +X bends towards +Z about -Y
    g[:, upper] = frame_from(x=sg * up, y=y)
    fore = frame_from(x=sg * lo, y=y)
    g[:, lower] = fore @ rig.axis_mat("x", 0.5 * twist)
    g[:, hand] = fore @ rig.axis_mat("x", twist) @ rig.axis_mat("z", -sg * flex)
