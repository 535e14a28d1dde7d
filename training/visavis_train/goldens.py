"""Writes what the networks of a bundle compute, stage by stage, for parity tests of the runtime.

    python -m visavis_train.goldens --bundle B.safetensors --out G.safetensors

Everything runs in fp32 from the bundle's file, with every token recomputed at every evaluation (no cache). M idle blocks
take token indices 0 .. M-1; block k of the session is token M + k. The agent stands at the origin facing +Z in the last idle
frame. Block 0 has no block before it, so its user position and voice are absent (flag 0); idle tokens have every modality absent.
Contents (K blocks, T = 4 K frames):
    agent_voice, user_voice  [N] i16, 24 kHz, value / 32768; silence after the end
    user_path [T, 3] world;  gaze [1] target;  eps [K, Dz], eps_idle [M, Dz], as they enter (no temperature)
    idle.mu [M, Dz] encoder mean of the idle clip, idle.latents [M, Dz] standardised
    agent_features, user_features [T, D_a]
    conditioning.user [K, 8] metres, conditioning.flags [K, 4] of branch F (user, agent voice, user voice, gaze)
    x1.{k} [NFE, 3 (U, C, F), Dz] of midpoint 4; latents [K, Dz]
    decoded_frames [n] frame numbers; decoded [n, F] standardised
    roots [T, 3] (x, z, yaw); positions [T, J, 3]; rotations [T, J, 4] (x, y, z, w) world
    latents.midpoint2, latents.midpoint1, latents.clean (midpoint 4, history at least at 0.9 from 0.3 on) [K, Dz], with their own history and user in their own agent frame
    student [K, Dz], student.user [K, 8]: history tau_h z + (1 - tau_h) eps at tau_h = tau_history, new token eps at 0
    encoder.frames [16, F] metres, encoder.mu, encoder.logvar [4, Dz]
A bundle that is told of the activity at rest: rests [K], the blocks in which it is; its user hardly moves.
A bundle that hears the room has three sounds in it, pushed whole at the starts of their blocks, and sensitivity 0.5:
    sounds.{i} [N] pascals at 24 kHz, sounds.places [3, 3], sounds.blocks [3];  and of the main run (midpoint 4)
    hearing.ears [24, 2, 800] of frames 8 to 31, hearing.levels [T, 2], hearing.place [T, 3], hearing.known [T], hearing.features [T, D_s],
    conditioning.sound [K, S], conditioning.heard [K]; with the heads hearing.middle, hearing.left [T, 3] of the frames as decoded
"""
import argparse
from dataclasses import replace

import numpy as np
import torch
from safetensors.torch import save_file

from . import bundle as bundles
from .hearing import ears
from .motion import features as feat, rig
from .nets.flow import Condition, absent, sound_width
from .nets.stream import Reference, branches
from .train.activity import at_rest
from .train.geometry import integrate, to_local

GAZE_TARGET, SENSITIVITY = 0.8, 0.5


def voices(samples, seed):
    """A buzzing, syllable-like test signal as i16."""
    r = np.random.default_rng(seed)
    t = np.arange(samples) / 24000
    pitch = 120 * (1 + seed % 2) * (1 + 0.2 * np.sin(2 * np.pi * 1.7 * t))
    phase = 2 * np.pi * np.cumsum(pitch) / 24000
    tone = sum(np.sin(h * phase) / h for h in range(1, 12))
    level = np.clip(np.sin(2 * np.pi * (3 + seed % 3) * t), 0, 1) ** 2
    wave = 0.2 * tone * level + 0.02 * r.standard_normal(samples) * (0.3 + level)
    return torch.tensor(np.clip(wave * 32767, -32768, 32767).astype(np.int16))


def listen(audio, voice, frames):
    wave = torch.zeros(1, frames * 800)
    wave[0, :len(voice)] = voice[:frames * 800].float() / 32768
    return audio(wave)[0]


class Session:
    """Runs a session of the bundle over given inputs with one of its samplers."""

    def __init__(self, b, agent, voice, path, eps, eps_idle, steps=4, student=False, clean=None, sounds=(), rests=()):
        m = len(b.idle()) // 4
        net, settings = (b.student, b.config["student"]) if student else (b.flow, b.config["session"])
        reference = Reference(net, settings["guidance"], settings["gaze_guidance"], clean, b.config["session"].get("guided_until"))
        self.idle = b.encode(b.idle()[None])
        self.b, self.sounds, self.sound, self.heard = b, sounds, [], []
        self.width = bundles.sound_features(b.config.get("hearing"))
        none = resting(b, absent(1, m, b.config["audio"]["features"], sound_features=self.width), False)
        reference.push(self.idle, eps_idle[None], branches(none, True))
        root = torch.zeros(1, 3, dtype=torch.float64)
        z, self.user, self.flags, self.x1, self.roots = [self.idle], [], [], [], []
        for k in range(len(eps)):
            block = slice(4 * k, 4 * k + 4)
            user = to_local(root, path[None, block.start - 4:block.start, [0, 2]].double()).float().reshape(1, 1, 8) if k else torch.zeros(1, 1, 8)
            heard = voice[block.start - 4:block.start].reshape(1, 1, -1) if k else torch.zeros(1, 1, 4 * voice.shape[1])
            flags = torch.tensor([[[float(k > 0), 1.0, float(k > 0), 1.0]]])
            sound = self.room(k, decoded if k else None, root) if self.width else ()
            told = Condition(user, agent[block].reshape(1, 1, -1), heard, torch.full((1, 1, 4), GAZE_TARGET), flags, *sound)
            cond = branches(resting(b, told, rests[4 * k]), True)
            e = eps[None, k:k + 1]
            if student:
                new = reference.single(e, cond, settings["tau_history"])
            else:
                new, x1 = reference.sample(e, cond, steps)
                self.x1.append(x1)
            reference.push(new, e, cond)
            z.append(new)
            decoded = b.decode(torch.cat(z, 1))[0, 4 * m:]
            roots = integrate(b.unstandardise(decoded[block])[None, :, :3].double(), root)
            root = roots[:, -1]
            self.user.append(user[0, 0])
            self.flags.append(flags[0, 0])
            self.roots.append(roots[0])
        self.z, self.decoded = torch.cat(z[1:], 1)[0], decoded
        self.user, self.flags, self.roots = torch.stack(self.user), torch.stack(self.flags), torch.cat(self.roots)

    def room(self, k, decoded, root):
        """Sound vector [1, 1, S] of block k, from what was heard through the block before, and its flag [1, 1, 1]."""
        first = min(s.first for s in self.sounds)
        if 4 * k <= first:
            sound, flag = torch.zeros(1, 1, sound_width(self.width)), torch.zeros(1, 1, 1)
        else:
            x = self.b.unstandardise(decoded).numpy()
            positions, quats = feat.from_features(np.concatenate([x[:1], x]))
            self.middle, self.left = ears.centre(positions[1:], rig.quat_to_mat(quats[1:]))
            self.ears = ears.hear([s for s in self.sounds if s.first < 4 * k], self.middle, self.left)
            features = torch.zeros(4 * k, self.width)
            heard = ears.listen(self.b.hearing, ears.squashed(self.ears.ears)[800 * first:])
            features[first:] = self.b.appraisal.behind(heard, torch.tensor(self.ears.levels[first:], dtype=torch.float32), SENSITIVITY)
            self.features = features[:, :self.b.hearing.out.out_features]
            last, f32 = slice(4 * k - 4, 4 * k), lambda a: torch.tensor(a, dtype=torch.float32)
            sound = ears.vector(features[None, last], f32(self.ears.levels[None, last]), f32(self.ears.place[None, 4 * k - 1]),
                                f32(self.ears.known[None, 4 * k - 1]), root, torch.tensor([SENSITIVITY]))[None]
            flag = torch.ones(1, 1, 1)
        self.sound.append(sound[0, 0])
        self.heard.append(flag[0, 0, 0])
        return sound, flag


def resting(b, cond, rests):
    """The condition with the activity of a body at rest, of a bundle that is told of it: there is one level to draw from."""
    if not b.config.get("rest"):
        return cond
    level, shape = torch.tensor(b.config["rest"]["levels"][0]), cond.flags.shape[:2]
    return replace(cond, activity=level.expand(*shape, -1), resting=torch.full((*shape, 1), float(rests)))


@torch.no_grad()
def compute(b, blocks=20, seed=7):
    torch.manual_seed(seed)
    latent, frames, m = b.config["vae"]["latent"], 4 * blocks, len(b.idle()) // 4
    agent_voice, user_voice = voices(6 * 3200, 2), voices(6 * 3200 - 777, 5)
    t = torch.arange(frames) / 30
    way = 0.2 if b.config.get("rest") else 1.0  # a user who stands, where that counts
    path = torch.stack([1.2 * way * torch.sin(0.8 * t), 1.6 + 0 * t, 1.5 + 0.4 * way * torch.cos(1.1 * t)], -1)
    eps, eps_idle = torch.randn(blocks, latent), torch.randn(m, latent)
    agent, voice = listen(b.audio, agent_voice, frames), listen(b.audio, user_voice, frames)
    sounds = room_sounds() if b.hearing else ()
    spoken = torch.nn.functional.pad(agent_voice, (0, 800 * frames - len(agent_voice))).numpy()
    rests = at_rest(spoken, path.numpy(), frames)
    run = lambda **kw: Session(b, agent, voice, path, eps, eps_idle, sounds=sounds, rests=rests, **kw)
    main = run()
    mu, _ = b.vae.encoder(b.standardise(b.idle()[None]))
    some = torch.tensor([*range(4), *range(frames // 2, frames // 2 + 4), *range(frames - 8, frames)])
    x = b.unstandardise(main.decoded)
    pos, quat = feat.from_features(np.concatenate([x[:1].numpy(), x.numpy()]))
    test = torch.cat([x[-8:], b.idle()[:8]])
    enc_mu, enc_logvar = b.vae.encoder(b.standardise(test[None]))
    out = {
        "agent_voice": agent_voice, "user_voice": user_voice, "user_path": path, "gaze": torch.tensor([GAZE_TARGET]),
        "eps": eps, "eps_idle": eps_idle, "idle.mu": mu[0], "idle.latents": main.idle[0], "agent_features": agent, "user_features": voice,
        "conditioning.user": main.user, "conditioning.flags": main.flags, "latents": main.z,
        "decoded_frames": some.int(), "decoded": main.decoded[some], "roots": main.roots.float(),
        "positions": torch.tensor(pos[1:]).float(), "rotations": torch.tensor(quat[1:]).float(),
        "latents.midpoint2": run(steps=2).z, "latents.midpoint1": run(steps=1).z,
        "latents.clean": run(clean=(0.9, 0.3)).z, "encoder.frames": test, "encoder.mu": enc_mu[0], "encoder.logvar": enc_logvar[0],
    }
    out |= {f"x1.{k}": x1 for k, x1 in enumerate(main.x1)}
    if b.student is not None:
        s = run(student=True)
        out |= {"student": s.z, "student.user": s.user}
    return out | heard_by(main, sounds) | ({"rests": torch.tensor(rests[::4]).int()} if b.config.get("rest") else {})


def room_sounds():
    """A burst close by, a buzz on the other side at the same time, and a quiet tone later."""
    r, t = np.random.default_rng(3), np.arange(9000) / 24000
    burst = r.standard_normal(5000) * np.exp(-np.arange(5000) / 900)
    buzz = 0.5 * np.sign(np.sin(2 * np.pi * 180 * t))
    tone = 0.02 * np.sin(2 * np.pi * 700 * t[:6000])
    at = lambda block, wave, *place: ears.Source(4 * block, wave.astype(np.float32), np.array(place))
    return [at(2, burst, 1.2, 1.5, -1.0), at(3, buzz, -2.5, 0.4, 2.0), at(15, tone, 0.3, 1.7, 4.0)]


def heard_by(session, sounds):
    """What the main run heard of `sounds`; nothing of a bundle without hearing."""
    if not sounds:
        return {}
    f32 = lambda a: torch.tensor(np.ascontiguousarray(a), dtype=torch.float32)
    h = session.ears
    out = {f"sounds.{i}": f32(s.wave) for i, s in enumerate(sounds)}
    return out | {"sounds.places": f32(np.stack([s.place for s in sounds])), "sounds.blocks": torch.tensor([s.first // 4 for s in sounds]).int(),
                  "hearing.ears": f32(h.ears.reshape(2, -1, 800).transpose(1, 0, 2)[8:32]), "hearing.levels": f32(h.levels), "hearing.place": f32(h.place),
                  "hearing.known": f32(h.known), "hearing.features": session.features, "hearing.middle": f32(session.middle),
                  "hearing.left": f32(session.left), "conditioning.sound": torch.stack(session.sound), "conditioning.heard": torch.stack(session.heard)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--blocks", type=int, default=20)
    args = parser.parse_args()
    out = compute(bundles.read(args.bundle), args.blocks)
    bad = [k for k, v in out.items() if not torch.isfinite(v.float()).all()]
    if bad:
        raise SystemExit(f"not finite: {', '.join(bad)}")
    save_file({k: v.contiguous() for k, v in out.items()}, args.out, metadata={"blocks": str(args.blocks)})
    for name in ("agent_features", "latents", "decoded", "positions"):
        print(f"{name}: {tuple(out[name].shape)}, rms {out[name].float().square().mean().sqrt():.3f}")


if __name__ == "__main__":
    main()
