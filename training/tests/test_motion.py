"""Rig, features, BVH reader, retargeting and foot locking on data made here."""
import numpy as np
import pytest

from visavis_train.motion import bvh, contacts, features, retarget, rig

SKELETON = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Arm
  {
    OFFSET 2 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 1 0 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.05
0 1 0 0 0 0 0 0 0
1 1 0 90 0 0 90 0 0
"""


def random_motion(t=40, seed=0):
    """Joint transforms [T, J, ...] of smooth random local rotations and a root that wanders and turns."""
    rng = np.random.default_rng(seed)
    v = np.cumsum(rng.standard_normal((t, rig.J, 3)) * 0.05, axis=0)
    local = rig.rotvec_to_mat(v)
    local[:, 0] = rig.euler_yxz(np.linspace(0, 7, t), 0.1 * v[:, 0, 0], 0.1 * v[:, 0, 1])
    hips = np.stack([np.linspace(0, 2, t), np.full(t, 0.9), np.sin(np.linspace(0, 3, t))], 1)
    g = rig.local_to_global(local)
    return rig.fk_global(hips, g), g


def test_icosahedron_is_isotropic():
    assert np.allclose(features.ICO.T @ features.ICO, 4 * np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.norm(features.ICO, axis=1), 1)
    phi = (1 + 5 ** 0.5) / 2
    assert np.allclose(features.ICO[0] * np.sqrt(1 + phi * phi), (0, 1, phi))


def test_features_round_trip():
    p, g = random_motion()
    q = rig.mat_to_quat(g)
    x = features.to_features(p, q)
    assert x.shape == (40, features.F) and np.all(x[0, :3] == 0)
    p2, q2 = features.from_features(x, p[0, 0, [0, 2]], rig.yaw_of(g[:1, 0])[0])
    assert np.abs(p2 - p).max() < 1e-5
    assert np.abs(rig.quat_to_mat(q2) - g).max() < 1e-5


def test_features_do_not_depend_on_the_place_in_the_world():
    p, g = random_motion()
    turn = rig.axis_mat("y", np.array(1.1))
    moved = features.to_features(p @ turn.T + [3, 0, -2], rig.mat_to_quat(turn @ g))
    assert np.abs(moved - features.to_features(p, rig.mat_to_quat(g))).max() < 1e-9


def test_quaternions_and_polar():
    rng = np.random.default_rng(1)
    m = rig.rotvec_to_mat(rng.uniform(-3, 3, (500, 3)))
    assert np.allclose(rig.quat_to_mat(rig.mat_to_quat(m)), m, atol=1e-9)
    assert np.allclose(rig.rotvec_to_mat(rig.mat_to_rotvec(m)), m, atol=1e-7)
    noisy = rig.polar(m + 0.01 * rng.standard_normal(m.shape))
    assert np.allclose(np.linalg.det(noisy), 1) and np.abs(noisy - m).max() < 0.05
    assert np.allclose(rig.wrap(np.array([np.pi, -np.pi, 3 * np.pi])), np.pi)


def test_fk_keeps_bone_lengths_and_rest_stands_on_the_floor():
    p, _ = random_motion()
    for j, parent in enumerate(rig.PARENTS):
        if parent >= 0:
            length = np.linalg.norm(p[:, j] - p[:, parent], axis=1)
            assert np.allclose(length, np.linalg.norm(rig.OFFSETS[j]), atol=1e-12)
    rest = rig.rest_positions()
    assert rest[rig.INDEX["leftHand"], 0] > 0 > rest[rig.INDEX["rightHand"], 0]
    assert rest[:, 1].min() == pytest.approx(rig.TOE_HEIGHT)
    assert rest[rig.INDEX["leftFoot"], 1] == pytest.approx(rig.ANKLE_HEIGHT)


def test_mirror_is_its_own_inverse_and_keeps_the_rig():
    p, g = random_motion()
    mp, mg = rig.mirror(p, g)
    assert np.allclose(rig.fk_global(mp[:, 0], mg), mp, atol=1e-9)
    back = rig.mirror(mp, mg)
    assert np.allclose(back[0], p) and np.allclose(back[1], g)


def test_gaze_score_of_a_head_that_faces_the_user():
    p = rig.rest_positions()[None]
    g = np.broadcast_to(np.eye(3), (1, rig.J, 3, 3))
    eye = p[:, rig.INDEX["head"], 1] + rig.EYES[1]
    assert rig.gaze_score(p, g, np.array([[0, eye[0], 2.0]]))[0] == pytest.approx(1, abs=1e-9)
    assert rig.gaze_score(p, g, np.array([[0, eye[0], -2.0]]))[0] < -0.9


def test_bvh_channel_order_and_fk():
    clip = bvh.parse_bvh(SKELETON)
    assert clip.skeleton.names == ["Hips", "Arm", "Arm_end"] and clip.dt == 0.05
    pos, _ = clip.fk()
    assert np.allclose(pos[0], [[0, 1, 0], [2, 1, 0], [3, 1, 0]])
    assert np.allclose(pos[1], [[1, 1, 0], [1, 3, 0], [0, 3, 0]])


@pytest.mark.parametrize("text", ["hello", SKELETON.replace("Frames: 2", "Frames: 5"), SKELETON.replace("}\nMOTION", "MOTION")])
def test_bvh_errors_are_typed(text):
    with pytest.raises(bvh.MotionFormatError):
        bvh.parse_bvh(text)


def test_expmap_columns_are_checked(tmp_path):
    sk = bvh.parse_bvh(SKELETON).skeleton
    f = tmp_path / "a.txt"
    f.write_text(",".join(["0"] * 5) + ",-1.5707963267948966" + ",0" * 6)
    clip = bvh.read_expmap(str(f), sk)
    assert np.allclose(clip.local[0, 0] @ [1, 0, 0], [0, 1, 0], atol=1e-9)
    f.write_text("0,0,0,1")
    with pytest.raises(bvh.MotionFormatError):
        bvh.read_expmap(str(f), sk)


def cmu_like_clip(t=8):
    """A skeleton with CMU names, legs splayed in its zero pose and straightened by the T-pose first row, then a raised left arm."""
    rest = rig.rest_positions() / retarget.CMU_UNIT
    table = retarget.MAPS["cmu31"]
    names, parents = [table[n] for n in rig.NAMES], rig.PARENTS
    offsets = np.array([rest[j] - (rest[p] if p >= 0 else 0) for j, p in enumerate(parents)])
    offsets[0] = 0
    local = np.broadcast_to(np.eye(3), (t, rig.J, 3, 3)).copy()
    for side, sign in (("left", 1), ("right", -1)):
        splay = rig.axis_mat("z", np.array(sign * 0.35))
        for n in ("LowerLeg", "Foot"):
            offsets[rig.INDEX[side + n]] = splay @ offsets[rig.INDEX[side + n]]
        local[:, rig.INDEX[side + "UpperLeg"]] = splay.T
        local[:, rig.INDEX[side + "Foot"]] = splay
    local[1:, rig.INDEX["leftUpperArm"]] = rig.axis_mat("z", np.array(np.pi / 2))
    sk = bvh.Skeleton(names, list(parents), offsets, [[] for _ in names])
    root = np.tile(rest[0], (t, 1))
    return bvh.Clip(sk, root, local, 1 / 30)


def test_retarget_takes_the_first_row_as_the_rest_pose():
    take = retarget.retarget(cmu_like_clip(), 1 / 30, retarget.CMU_UNIT)
    p = take.positions[2]
    I = rig.INDEX
    assert np.allclose(p[I["leftFoot"]] - p[I["leftUpperLeg"]], [0, -0.805, 0], atol=2e-3)
    assert np.allclose(p[I["leftHand"]] - p[I["leftUpperArm"]], [0, 0.52, 0], atol=2e-3)
    assert np.allclose(p[I["rightHand"]] - p[I["rightUpperArm"]], [-0.52, 0, 0], atol=2e-3)
    assert p[I["leftFoot"], 1] == pytest.approx(rig.ANKLE_HEIGHT, abs=2e-3)


def test_lock_feet_stills_a_creeping_foot_and_keeps_the_rig():
    t = 60
    g = np.broadcast_to(np.eye(3), (t, rig.J, 3, 3)).copy()
    hips = np.tile([0, 0.90, 0.0], (t, 1))
    hips[:, 2] += np.linspace(0, 0.05, t)                 # the whole body creeps 5 cm in 2 s
    p = rig.fk_global(hips, g)
    p2, g2 = contacts.lock_feet(p, g)
    toes = p2[:, [rig.INDEX["leftToes"], rig.INDEX["rightToes"]]]
    assert np.abs(np.diff(p[:, rig.INDEX["leftToes"], 2])).max() > 5e-4
    assert np.abs(np.diff(toes, axis=0)).max() < 1e-6
    assert np.allclose(rig.fk_global(p2[:, 0], g2), p2)
    assert np.allclose(toes[..., 1], rig.TOE_HEIGHT)
