"""The 22-joint VRM humanoid rig, forward kinematics and rotation helpers.

World: right-handed, Y up, metres; the rest pose is a T-pose facing +Z with left = +X and all
global rotations identity. Quaternions are (x, y, z, w). Shapes are written [T, J, ...].
"""
import numpy as np

FPS = 30
SAMPLE_RATE = 24000
SAMPLES_PER_FRAME = SAMPLE_RATE // FPS

NAMES = [
    "hips", "spine", "chest", "upperChest", "neck", "head",
    "leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand",
    "rightShoulder", "rightUpperArm", "rightLowerArm", "rightHand",
    "leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes",
    "rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes",
]
PARENTS = [-1, 0, 1, 2, 3, 4, 3, 6, 7, 8, 3, 10, 11, 12, 0, 14, 15, 16, 0, 18, 19, 20]
J = len(NAMES)
INDEX = {n: i for i, n in enumerate(NAMES)}
MIRROR = [INDEX[n.replace("left", "@").replace("right", "left").replace("@", "right")] for n in NAMES]

_LEFT_ARM = [(0.030, 0.110, 0.0), (0.140, -0.005, -0.010), (0.270, 0.0, 0.0), (0.250, 0.0, 0.0)]
_LEFT_LEG = [(0.090, -0.040, 0.0), (0.0, -0.410, 0.0), (0.0, -0.395, 0.0), (0.0, -0.055, 0.130)]


def _mirror_x(rows):
    return [(-x, y, z) for x, y, z in rows]


# Rest offset of each joint from its parent [m]; an adult of about 1.70 m (segment lengths close to
# the stature fractions of Drillis & Contini 1966: thigh .245 H, shank .246 H, arm .186 H, forearm .146 H).
OFFSETS = np.array(
    [(0, 0.92, 0), (0, 0.10, -0.010), (0, 0.12, -0.010), (0, 0.13, 0.0), (0, 0.16, -0.010), (0, 0.09, 0.020)]
    + _LEFT_ARM + _mirror_x(_LEFT_ARM) + _LEFT_LEG + _mirror_x(_LEFT_LEG), dtype=np.float64)

EYES = np.array([0.0, 0.06, 0.09])        # midpoint of the eyes in the head joint's frame
HEAD_BACK = np.array([0.0, 0.06, -0.09])  # back of the head, same frame
ANKLE_HEIGHT = 0.075
TOE_HEIGHT = 0.020


def rest_positions():
    """Global joint positions of the rest pose, [J, 3]."""
    p = np.zeros((J, 3))
    for j, parent in enumerate(PARENTS):
        p[j] = OFFSETS[j] + (p[parent] if parent >= 0 else 0)
    return p


# ---- rotations -------------------------------------------------------------------------------

def quat_to_mat(q):
    """[..., 4] xyzw -> [..., 3, 3]."""
    q = np.asarray(q, dtype=np.float64)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(q, -1, 0)
    m = np.empty(q.shape[:-1] + (3, 3))
    m[..., 0, 0] = 1 - 2 * (y * y + z * z)
    m[..., 0, 1] = 2 * (x * y - z * w)
    m[..., 0, 2] = 2 * (x * z + y * w)
    m[..., 1, 0] = 2 * (x * y + z * w)
    m[..., 1, 1] = 1 - 2 * (x * x + z * z)
    m[..., 1, 2] = 2 * (y * z - x * w)
    m[..., 2, 0] = 2 * (x * z - y * w)
    m[..., 2, 1] = 2 * (y * z + x * w)
    m[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return m


def mat_to_quat(m):
    """[..., 3, 3] -> [..., 4] xyzw with w >= 0 (Shepperd 1978, largest of four candidates)."""
    d = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], -1)
    tr = d.sum(-1)
    cand = np.concatenate([1 + 2 * d - tr[..., None], (1 + tr)[..., None]], -1)  # 4 x^2, 4 y^2, 4 z^2, 4 w^2
    best = cand.argmax(-1)
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    p, q_, r = m[..., 1, 0] + m[..., 0, 1], m[..., 2, 0] + m[..., 0, 2], m[..., 2, 1] + m[..., 1, 2]
    rows = [
        np.stack([cand[..., 0], p, q_, a], -1), np.stack([p, cand[..., 1], r, b], -1),
        np.stack([q_, r, cand[..., 2], c], -1), np.stack([a, b, c, cand[..., 3]], -1),
    ]
    q = np.choose(best[..., None], rows)
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return q * np.where(q[..., 3:] < 0, -1.0, 1.0)


def continuous_quats(q):
    """Flips signs along axis 0 so that neighbouring frames lie in one hemisphere."""
    dot = np.sum(q[1:] * q[:-1], -1)
    sign = np.cumprod(np.where(dot < 0, -1.0, 1.0), axis=0)
    out = q.copy()
    out[1:] *= sign[..., None]
    return out


def rotvec_to_mat(v):
    """Axis times angle [..., 3] -> [..., 3, 3] (Rodrigues)."""
    v = np.asarray(v, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    half = 0.5 * angle
    s = np.where(angle > 1e-8, np.sin(half) / np.maximum(angle, 1e-12), 0.5)
    return quat_to_mat(np.concatenate([v * s, np.cos(half)], -1))


def mat_to_rotvec(m):
    q = mat_to_quat(m)
    n = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(n, q[..., 3:])
    return q[..., :3] * np.where(n > 1e-9, angle / np.maximum(n, 1e-12), 2.0)


def axis_mat(axis, angle):
    """Rotation about a coordinate axis ('x', 'y', 'z') by angle [rad, any shape]."""
    angle = np.asarray(angle, dtype=np.float64)
    v = np.zeros(angle.shape + (3,))
    v[..., "xyz".index(axis)] = angle
    return rotvec_to_mat(v)


def euler_yxz(yaw, pitch, roll):
    """Ry(yaw) Rx(pitch) Rz(roll); positive pitch looks down, positive roll tips the head to the right shoulder's opposite (+X up)."""
    return axis_mat("y", yaw) @ axis_mat("x", pitch) @ axis_mat("z", roll)


def between(a, b):
    """Shortest rotation that takes unit vectors a to b, [..., 3] each."""
    c = np.cross(a, b)
    d = np.sum(a * b, -1, keepdims=True)
    q = np.concatenate([c, 1 + d], -1)
    flip = d[..., 0] < -0.999999
    if np.any(flip):
        q[flip] = (0, 1, 0, 0)
    return quat_to_mat(q)


def unit(v):
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def yaw_of(m):
    """Heading [rad] of the +Z axis of rotation matrices, projected to the floor."""
    return np.arctan2(m[..., 0, 2], m[..., 2, 2])


def wrap(a):
    """Angle to (-pi, pi]."""
    return -((-a + np.pi) % (2 * np.pi) - np.pi)


def polar(a):
    """Nearest rotation (det +1) to matrices [..., 3, 3] (Kabsch: SVD with the sign on the last axis)."""
    u, _, vt = np.linalg.svd(a)
    d = np.sign(np.linalg.det(u @ vt))
    u[..., :, 2] *= d[..., None]
    return u @ vt


# ---- kinematics ------------------------------------------------------------------------------

def fk_global(hips, rot):
    """Joint positions [T, J, 3] from hips positions [T, 3] and *global* rotations [T, J, 3, 3]."""
    p = np.empty(rot.shape[:-2] + (3,))
    p[:, 0] = hips
    for j in range(1, J):
        p[:, j] = p[:, PARENTS[j]] + rot[:, PARENTS[j]] @ OFFSETS[j]
    return p


def local_to_global(local):
    """Local rotation matrices [T, J, 3, 3] -> global ones."""
    g = np.empty_like(local)
    g[:, 0] = local[:, 0]
    for j in range(1, J):
        g[:, j] = g[:, PARENTS[j]] @ local[:, j]
    return g


def global_to_local(rot):
    l = rot.copy()
    for j in range(1, J):
        l[:, j] = np.swapaxes(rot[:, PARENTS[j]], -1, -2) @ rot[:, j]
    return l


def mirror(pos, rot):
    """Left/right mirror image across the X = 0 plane of positions [T, J, 3] and matrices [T, J, 3, 3]."""
    s = np.array([-1.0, 1.0, 1.0])
    return pos[:, MIRROR] * s, rot[:, MIRROR] * (s[:, None] * s[None, :])


def gaze_score(pos, rot, user):
    """SARAH 3.4: g = unit(h_f - h_b) . unit(user - h_b), [T]."""
    h = INDEX["head"]
    front = pos[:, h] + rot[:, h] @ EYES
    back = pos[:, h] + rot[:, h] @ HEAD_BACK
    return np.sum(unit(front - back) * unit(user - back), -1)
