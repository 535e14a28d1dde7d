"""The decoder on roll-outs, the loop that trainers share, processes that train together, bundles taken apart."""
import os
import subprocess
import sys
from pathlib import Path

import torch
from safetensors.torch import load_file

from visavis_train import bundle, checkpoints, export, make_tiny
from visavis_train.motion import rig
from visavis_train.nets.flow import Condition, FlowNet
from visavis_train.nets.vae import Vae
from visavis_train.train import cache, decoder, student, vae


def still_body(frames=32):
    """One pose held: standardised with mean 0 and deviation 1, so metres."""
    x = make_tiny.sway(frames)[:1].repeat(frames, 1)
    x[:, :3] = 0
    low = x[0, 3:].reshape(-1, 12, 3).mean(1)[list(decoder.TOES), 1].min()
    x[:, 3:].view(frames, -1, 3)[..., 1] -= low - 0.02  # toes on the floor
    return x[None].clone()


def test_a_body_that_stands_has_no_slide_and_a_root_that_creeps_does():
    x = still_body()
    size = x.shape[-1]
    zero, one, w = torch.zeros(size), torch.ones(size), vae.channel_weights(size)
    calm = decoder.free_losses(x, x, zero, one, w)
    y = x.clone()
    y[..., 0] = 0.003
    creeping = decoder.free_losses(y, x, zero, one, w)
    assert calm["stay"] == 0 and calm["free_slide"] < 0.01 and calm["jerk"] < 0.01
    assert abs(creeping["free_slide"] / 10 - 0.003) < 5e-4
    assert creeping["stay"] > 0


def test_bones_are_measured_against_the_rig():
    x = still_body()
    size = x.shape[-1]
    zero, one, w = torch.zeros(size), torch.ones(size), vae.channel_weights(size)
    y = x.clone()
    hand = 3 + 36 * rig.INDEX["leftHand"]
    y[..., hand:hand + 36].view(*y.shape[:2], 12, 3)[..., 0] += 0.05
    assert decoder.free_losses(y, x, zero, one, w)["bones"] > decoder.free_losses(x, x, zero, one, w)["bones"]


def test_a_bundle_comes_apart_into_checkpoints_that_load(tmp_path):
    tensors, config = make_tiny.build()
    bundle.write(str(tmp_path / "b.safetensors"), tensors, config)
    parts = checkpoints.split(bundle.read(str(tmp_path / "b.safetensors")))
    assert set(parts) == {"audio", "vae", "flow", "student"}
    state = parts["flow"]
    net = FlowNet(state["latent"], state["audio"], **state["size"])
    net.load_state_dict(state["ema"])
    assert torch.equal(net.input.weight, tensors["flow.input.weight"].float())


TEAM = """
import sys, torch
from visavis_train.train.team import Team
team = Team(2)
net = torch.nn.Linear(1, 1, bias=False)
net.weight.grad = torch.full((1, 1), 2.0 if team.leads else 4.0)
stop = team.average(net, team.leads)
mine = team.gather({team.rank: torch.tensor([team.rank])}, sys.argv[1] + "part")
open(sys.argv[1] + str(team.rank), "w").write(f"{net.weight.grad.item()} {stop} {team.agree(7 + team.rank)} {sorted(mine)}")
team.close()
"""


def test_two_processes_average_gradients_and_agree(tmp_path):
    script = tmp_path / "team.py"
    script.write_text(TEAM)
    here = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    subprocess.run([sys.executable, str(script), str(tmp_path / "out")], check=True, timeout=300, env=here)
    assert [(tmp_path / f"out{r}").read_text() for r in (0, 1)] == ["3.0 True 7 [0, 1]", "3.0 True 7 []"]


def test_the_teacher_is_asked_for_what_gives_the_target():
    asked = student.pairs("1:0.9,0:-0.2,0.5:0.4")
    assert asked == [(0.0, -0.2), (0.5, 0.4), (1.0, 0.9)]
    gaze = torch.tensor([[[0.0] * 4, [0.25] * 4, [1.0] * 4]])
    cond = Condition(torch.ones(1, 3, 8), torch.ones(1, 3, 4), torch.ones(1, 3, 4), gaze, torch.ones(1, 3, 4))
    torch.testing.assert_close(student.calibrated(cond, asked).gaze[0, :, 0], torch.tensor([-0.2, 0.1, 0.9]))
    assert student.calibrated(cond, None) is cond


def test_maps_from_flow_time_are_f16_even_in_an_f32_bundle(tmp_path):
    tensors = {"flow.layers.0.mod.weight": torch.randn(4, 2), "flow.layers.0.fc1.weight": torch.randn(4, 2)}
    bundle.write(str(tmp_path / "b.safetensors"), tensors, {}, narrow=export.NARROW)
    kept = load_file(str(tmp_path / "b.safetensors"))
    assert kept["flow.layers.0.mod.weight"].dtype == torch.float16 and torch.equal(kept["flow.layers.0.fc1.weight"], tensors["flow.layers.0.fc1.weight"])


def test_chunks_encoded_together_equal_the_clip_encoded_at_once():
    net = make_tiny.lively(Vae(7, latent=4, layers=2, width=16, heads=2, mlp=2, window_blocks=3)).eval()
    blocks = cache.CHUNK * (cache.TOGETHER["cpu"] + 2) + 5  # several at a time, a last lot of fewer, a short chunk at the end
    x = torch.randn(4 * blocks, 7)
    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
        whole = net.encoder(x[None])[0][0].float()
    torch.testing.assert_close(cache.encode(net, x), whole, atol=0.05, rtol=0.05)


def test_a_student_starts_from_the_flow_a_checkpoint_or_an_earlier_change(tmp_path):
    kept = {}
    for name, value in (("flow", 1.0), ("student", 1.5), ("other", 7.0)):
        kept[name] = str(tmp_path / f"{name}.pt")
        torch.save({"ema": {"w": torch.tensor([value])}}, kept[name])
    flow = {"w": torch.tensor([3.0])}
    assert student.beginning(flow) is flow
    assert student.beginning(flow, kept["other"])["w"].item() == 7.0
    assert student.beginning(flow, change=(kept["flow"], kept["student"]))["w"].item() == 3.5
