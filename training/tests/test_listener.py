"""Hands of a listener, by how long ago the agent spoke."""
import numpy as np

from visavis_train.corpus.store import Clip
from visavis_train.train import listener


def test_time_since_the_agent_spoke_begins_with_its_first_word():
    speech = np.zeros(90, bool)
    speech[[30, 31]] = True
    ago = listener.since(speech)
    assert np.isinf(ago[:30]).all() and ago[30] == ago[31] == 0 and np.isclose(ago[61], 1.0)


def test_frames_of_a_listener_are_those_in_which_the_user_alone_speaks():
    frames, still = 300, np.zeros((300, 22, 3))
    clip = Clip(still, None, None, None, None, {"agent_phrases": "[[0.5, 1.0]]", "user_phrases": "[[0.0, 10.0]]"})
    parts = listener.parts(clip)
    assert parts.shape == (4, frames) and not parts[:, 15:31].any() and (parts.sum(0) <= 1).all()
    assert parts[3, 1:15].all() and parts[0, 32:59].all() and parts[1, 65:85].all() and parts[2, 95:145].all() and parts[3, 155:299].all()
    assert not parts[:, [0, 299]].any()
