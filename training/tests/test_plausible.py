"""Every fault that a clip must not have is found, and a sound clip has none."""
import numpy as np
import pytest

from visavis_train import make_tiny
from visavis_train.corpus import plausible
from visavis_train.motion import features, rig


@pytest.fixture
def body():
    x = make_tiny.sway(120)
    x[1:, 1] = 0.01
    positions, quats = features.from_features(x.numpy().astype(np.float64))
    rotations = rig.quat_to_mat(quats)
    return rig.fk_global(positions[:, 0], rotations) + [0, 0.2, 0], rotations


def test_a_calm_body_has_no_fault(body):
    assert plausible.faults(*body, plausible.SIMULATED) == []


@pytest.mark.parametrize("fault,change", [
    ("speed", lambda p, r: p.__setitem__(slice(60, None), p[60:] + [0.5, 0, 0])),
    ("acceleration", lambda p, r: p.__setitem__(60, p[60] + [0.15, 0, 0])),
    ("foot below the floor", lambda p, r: p.__isub__([0, 0.5, 0])),
    ("bone length", lambda p, r: p.__setitem__((slice(None), rig.INDEX["leftHand"]), p[:, rig.INDEX["leftHand"]] + [0.01, 0, 0])),
    ("rotation not orthogonal", lambda p, r: r.__imul__(1.01)),
    ("not finite", lambda p, r: p.__setitem__((3, 4, 1), np.nan)),
    ("arm in the trunk", lambda p, r: p.__setitem__((slice(None), rig.INDEX["leftHand"]), p[:, 0] + r[:, 0] @ np.array([0, 0.05, 0]))),
])
def test_faults_are_named(body, fault, change):
    p, r = (a.copy() for a in body)
    change(p, r)
    assert fault in plausible.faults(p, r, plausible.SIMULATED)
