"""Writes what a bundle of kind `dram` computes, frame by frame, for parity tests of the runtime.

    python -m visavis_train.dram.goldens --bundle B.safetensors --out G.safetensors

The agent stands at the origin facing +Z in the last idle frame; nothing is corrected afterwards (no stance, no bridge). K blocks, T = 4 K frames:
    agent_voice, user_voice [N] i16, 24 kHz, value / 32768; silence after the end
    user_path [T, 3] world; user_rotation [T, 4] (x, y, z, w) world; gaze [1] target
    agent_features, user_features [T, A]
    user_rows [T, U]; m, d, delta [T, D]; poses [T, D] standardised, orthonormal; dyadic [T, J]
    roots [T, 3] (x, z, yaw); positions [T, J, 3], rotations [T, J, 4] world
    absent.poses [T, D]: no voices, no user, no gaze target; position.poses [T, D]: no rotation and no gaze target
"""
import argparse

import numpy as np
import torch
from safetensors.torch import save_file

from ..goldens import GAZE_TARGET, listen, voices
from ..motion import rig
from . import bundle, nets, pose, roll
from .data import frame_rows


class Session:
    """Runs a session of the bundle. flags: agent's voice, user's voice, head, its rotation, gaze score."""

    def __init__(self, b, agent, voice, path, rotation, gaze, flags):
        net, idle = b.net, b.idle
        p = roll.standardise(net, idle)[None]
        before = torch.cat([p[:, :1], p[:, :-2]], 1)
        width = agent.shape[1] + 1
        nothing = lambda n: nets.Heard(torch.zeros(1, n, width), torch.zeros(1, n, nets.USER), torch.zeros(1, n, width))
        state = net(p[:, :-1], before, nothing(p.shape[1] - 1), net.state(1))[2]
        run = roll.Run(net, b.layout, p[:, -1], p[:, -2], state, torch.zeros(1, 3, dtype=torch.float64))
        forward = torch.tensor(rig.quat_to_mat(rotation.numpy())[..., 2], dtype=torch.float32)
        f = torch.tensor(flags)
        self.rows, self.m, self.d, self.delta, self.poses, self.roots, self.y = [], [], [], [], [], [], []
        hooks = [net.monadic.register_forward_hook(lambda _m, _i, out: self.m.append(out[0][0, 0])),
                 net.dyadic.register_forward_hook(lambda _m, _i, out: self.d.append(out[0][0, 0]))]
        for t in range(len(path)):
            heard = nothing(1)
            heard.agent = nets.voice(agent[None, t:t + 1], f[None, None, :1])
            known = torch.stack([f[2], f[2] * f[3], f[4]])
            if t < nets.DELAY:
                known = known * torch.tensor([0.0, 0.0, 1.0])
                heard.user = frame_rows(run.root, path[:1], forward[:1], torch.tensor([gaze]), known[None])[:, None]
            else:
                then = slice(t - nets.DELAY, t - nets.DELAY + 1)
                heard.user = frame_rows(run.root, path[then], forward[then], torch.tensor([gaze]), known[None])[:, None]
                heard.voice = nets.voice(voice[None, then], f[None, None, 1:2])
            y, delta = run.step(heard)
            self.rows.append(heard.user[0, 0])
            self.delta.append(delta[0])
            self.poses.append(run.p[0])
            self.roots.append(run.root[0])
            self.y.append(y[0])
        for h in hooks:
            h.remove()
        for name in ("rows", "m", "d", "delta", "poses", "roots", "y"):
            setattr(self, name, torch.stack(getattr(self, name)))


def world(y, roots):
    """Joint positions [T, J, 3] and quaternions [T, J, 4] in the world."""
    p, r = pose.kinematics(y[:, pose.LEAD:].double().unflatten(-1, (-1, 6)), y[:, 3].double())
    turned = rig.axis_mat("y", roots[:, 2].numpy())[:, None]
    base = np.stack([roots[:, 0], np.zeros(len(roots)), roots[:, 1]], -1)[:, None]
    return np.einsum("tjab,tjb->tja", np.broadcast_to(turned, r.shape), p.numpy()) + base, rig.mat_to_quat(turned @ r.numpy())


@torch.no_grad()
def compute(b, blocks, seed=7):
    torch.manual_seed(seed)
    frames = 4 * blocks
    t = torch.arange(frames) / 30
    agent_voice, user_voice = voices(int(24000 * (frames / 30 - 0.21)), seed), voices(int(24000 * (frames / 30 - 0.4)), seed + 1)
    path = torch.stack([1.2 * torch.sin(0.8 * t), 1.62 + 0.05 * torch.sin(2.1 * t), 1.5 + 0.5 * torch.cos(0.5 * t)], -1)
    turned = rig.euler_yxz((3.0 + 0.5 * torch.sin(0.9 * t)).numpy(), (0.2 * torch.sin(6 * t)).numpy(), (0.1 * torch.cos(t)).numpy())
    rotation = torch.tensor(rig.continuous_quats(rig.mat_to_quat(turned)), dtype=torch.float32)
    agent, voice = listen(b.audio, agent_voice, frames), listen(b.audio, user_voice, frames)
    run = lambda *flags: Session(b, agent, voice, path, rotation, GAZE_TARGET, [float(v) for v in flags])
    s = run(1, 1, 1, 1, 1)
    positions, rotations = world(s.y, s.roots)
    return {"agent_voice": agent_voice, "user_voice": user_voice, "user_path": path, "user_rotation": rotation, "gaze": torch.tensor([GAZE_TARGET]),
            "agent_features": agent, "user_features": voice, "user_rows": s.rows, "m": s.m, "d": s.d, "delta": s.delta, "poses": s.poses,
            "dyadic": b.layout.per_joint(s.delta), "roots": s.roots.float(), "positions": torch.tensor(positions).float(),
            "rotations": torch.tensor(rotations).float(), "absent.poses": run(0, 0, 0, 0, 0).poses, "position.poses": run(1, 1, 1, 0, 0).poses}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--blocks", type=int, default=12)
    args = parser.parse_args()
    save_file({k: v.contiguous() for k, v in compute(bundle.read(args.bundle), args.blocks).items()}, args.out)


if __name__ == "__main__":
    main()
