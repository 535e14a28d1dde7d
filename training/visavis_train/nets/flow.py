"""Flow-matching transformer over latents, x1-prediction, SARAH 3.3 (mirrors src/flow)."""
import math
from dataclasses import dataclass, fields, replace

import torch
from torch import nn
import torch.nn.functional as F

from .layers import Layer, band_mask, bias_of, gelu, modulated, places, rotary

USER, AGENT, VOICE, GAZE = range(4)  # order of the presence flags
ACTIVITY = 3  # how active a body at rest is (train/activity.py)


@dataclass
class Condition:
    """Conditioning of K tokens: user [B, K, 8] metres in the agent's frame, agent and voice [B, K, 4 D_a] features
    (the agent's voice and the user's), gaze [B, K, 4], flags [B, K, 4] of presence. For networks that hear the room, sound
    [B, K, S] (`sound_width`) and heard [B, K, 1], its flag; for networks that are told how active a body at rest is, activity
    [B, K, ACTIVITY] and resting [B, K, 1], its flag; else None."""
    user: torch.Tensor
    agent: torch.Tensor
    voice: torch.Tensor
    gaze: torch.Tensor
    flags: torch.Tensor
    sound: torch.Tensor = None
    heard: torch.Tensor = None
    activity: torch.Tensor = None
    resting: torch.Tensor = None

    def map(self, f):
        return Condition(*(None if t is None else f(t) for t in self.parts()))

    def parts(self):
        return [getattr(self, f.name) for f in fields(self)]

    def at(self, tokens):
        """The conditioning of some tokens (a slice)."""
        return self.map(lambda t: t[:, tokens])

    def dropped(self, *which):
        """The same with the flags of some modalities cleared; all of them, sounds too, without arguments. Activity stays: guidance is towards what
        is heard and seen."""
        flags = self.flags.clone()
        flags[..., list(which) or slice(None)] = 0
        return replace(self, flags=flags, heard=self.heard if which or self.heard is None else torch.zeros_like(self.heard))


def cat_conditions(parts, dim=0):
    rows = zip(*(p.parts() for p in parts))
    return Condition(*(None if row[0] is None else torch.cat(row, dim) for row in rows))


def sound_width(features):
    """Width of a token's sound vector: features of what is heard and the level at both ears in four frames, place of the source (known, sine and
    cosine of its bearing, log2 of its distance - 1, height - 1.5), sensitivity."""
    return 4 * features + 4 * 2 + 5 + 1


def absent(batch, tokens, audio_features, device=None, sound_features=0):
    z = lambda *shape: torch.zeros(*shape, device=device)
    sound = (z(batch, tokens, sound_width(sound_features)), z(batch, tokens, 1)) if sound_features else ()
    return Condition(z(batch, tokens, 8), z(batch, tokens, 4 * audio_features), z(batch, tokens, 4 * audio_features),
                     z(batch, tokens, 4), z(batch, tokens, 4), *sound)


def tau_embedding(tau, width):
    """Sinusoids of 1000 tau, half cosines, half sines: tau [...] -> [..., width]."""
    half = width // 2
    freq = torch.exp(-math.log(10000.0) * torch.arange(half, dtype=torch.float32, device=tau.device) / half)
    angle = 1000.0 * tau.float()[..., None] * freq
    return torch.cat([angle.cos(), angle.sin()], -1)


class FlowNet(nn.Module):
    def __init__(self, latent=64, audio_features=64, layers=4, width=256, heads=4, mlp=4, tau_width=128, window_blocks=48,
                 embed_latent=128, embed_user=64, embed_voice=64, embed_gaze=16, user_scale=2.0, sound_features=0, embed_sound=64, embed_activity=0):
        """`sound_features`: features of what is heard in the room, 0 for a network that hears none; `embed_activity`: hidden width of what embeds
        the activity at rest, 0 for a network that is not told of it."""
        super().__init__()
        self.window, self.head_dim, self.heads, self.user_scale = window_blocks, width // heads, heads, user_scale
        self.tau_width, self.width = tau_width, width
        self.embed_latent = nn.Linear(latent, embed_latent)
        self.embed_user = nn.ModuleDict({"0": nn.Linear(8, embed_user), "2": nn.Linear(embed_user, embed_user)})
        self.embed_agent = nn.Linear(4 * audio_features, embed_voice)
        self.embed_voice = nn.Linear(4 * audio_features, embed_voice)
        self.embed_gaze = nn.Linear(4, embed_gaze)
        self.input = nn.Linear(embed_latent + embed_user + 2 * embed_voice + embed_gaze + 4, width)
        self.sound_features = sound_features
        if sound_features:
            self.embed_sound = nn.ModuleDict({"0": nn.Linear(sound_width(sound_features), embed_sound), "2": nn.Linear(embed_sound, embed_sound)})
            self.input_sound = nn.Linear(embed_sound + 1, width, bias=False)
            nn.init.zeros_(self.input_sound.weight)
        self.embed_activity = nn.ModuleDict({"0": nn.Linear(ACTIVITY, embed_activity), "2": nn.Linear(embed_activity, width)}) if embed_activity else None
        if embed_activity:
            nn.init.zeros_(self.embed_activity["2"].weight)
            nn.init.zeros_(self.embed_activity["2"].bias)
        self.tau = nn.ModuleDict({"0": nn.Linear(tau_width, tau_width), "2": nn.Linear(tau_width, tau_width)})
        self.layers = nn.ModuleList(Layer(width, heads, mlp, tau_width) for _ in range(layers))
        self.final = nn.ModuleDict({"mod": nn.Linear(tau_width, 2 * width), "out": nn.Linear(width, latent)})
        nn.init.zeros_(self.final["mod"].weight)
        nn.init.zeros_(self.final["mod"].bias)
        self.made = {}

    def tau_vector(self, tau):
        """tau [B, 1 or T] -> c [B, 1 or T, tau_width]."""
        return self.tau["2"](F.silu(self.tau["0"](tau_embedding(tau, self.tau_width))))

    def conditioning(self, cond):
        """Everything of the input but the latent: [B, T, ...] concatenated embeddings, each times its flag, then the flags; of networks that hear the
        room that of sounds and its flag behind them."""
        flag = [cond.flags[..., i:i + 1] for i in range(4)]
        user = self.embed_user["2"](gelu(self.embed_user["0"](cond.user / self.user_scale)))
        out = [user * flag[USER], self.embed_agent(cond.agent) * flag[AGENT], self.embed_voice(cond.voice) * flag[VOICE],
               self.embed_gaze(cond.gaze) * flag[GAZE], cond.flags]
        if self.sound_features:
            if cond.sound is None:
                out.append(torch.zeros(*cond.flags.shape[:-1], self.input_sound.in_features, device=cond.flags.device))
            else:
                out += [self.embed_sound["2"](gelu(self.embed_sound["0"](cond.sound))) * cond.heard, cond.heard]
        if self.embed_activity:
            rest = torch.zeros(*cond.flags.shape[:-1], self.width, device=cond.flags.device)
            out.append(rest if cond.activity is None else self.embed_activity["2"](gelu(self.embed_activity["0"](cond.activity))) * cond.resting)
        return torch.cat(out, -1)

    def tokens(self, z, conditioning):
        """Input of the layers; what sounds and activity say is added to that of the rest."""
        conditioning = conditioning.to(z.dtype)
        sound, rest = self.input_sound.in_features if self.sound_features else 0, self.width if self.embed_activity else 0
        usual, sound, rest = conditioning.split([conditioning.shape[-1] - sound - rest, sound, rest], -1)
        x = self.input(torch.cat([self.embed_latent(z), usual], -1))
        x = x + self.input_sound(sound) if self.sound_features else x
        return x + rest if self.embed_activity else x

    def finish(self, x, c):
        shift, scale = self.final["mod"](F.silu(c)).chunk(2, -1)
        return self.final["out"](modulated(x, shift, scale))

    def tables(self, count, device):
        """Rotary tables and bias of `count` tokens in a row."""
        key = count, str(device)
        if key not in self.made:
            index = torch.arange(count, device=device)
            self.made[key] = places(index, index, self.window, self.head_dim)
        return self.made[key]

    def pair_tables(self, count, device):
        """The same for `forward_pair`: `count` history tokens, then `count` current ones of the same positions."""
        key = -count, str(device)
        if key not in self.made:
            index, one = torch.arange(count, device=device), torch.eye(count, dtype=torch.bool, device=device)
            cos, sin = rotary(index, self.head_dim)
            band = band_mask(index, self.window)
            mask = torch.cat([torch.cat([band, torch.zeros_like(band)], 1), torch.cat([band & ~one, one], 1)], 0)
            self.made[key] = torch.cat([cos, cos]), torch.cat([sin, sin]), bias_of(mask)
        return self.made[key]

    def run(self, z, tau, conditioning, place, pasts=None):
        """Rows z [B, R, Dz] at flow times tau [B, 1 or R] -> x1 [B, R, Dz]; `pasts`: a `Past` for each layer, in streaming."""
        c = self.tau_vector(tau)
        x = self.tokens(z, conditioning)
        for layer, past in zip(self.layers, pasts or [None] * len(self.layers)):
            x = layer(x, place, c, past)
        return self.finish(x, c).float()

    def forward(self, z, tau, cond):
        """z [B, T, Dz] at flow times tau [B, 1 or T] -> x1 [B, T, Dz]; token i attends to i - window + 1 .. i."""
        return self.run(z, tau, self.conditioning(cond), self.tables(z.shape[1], z.device))

    def forward_pair(self, history, tau_history, z, tau, cond):
        """x1 of every token at its own flow time over a history at another: history, z [B, T, Dz]; taus [B, 1 or T].

        Row i of the result sees history tokens before i and itself at `tau`: all T blocks of a roll-out at once."""
        b, t, _ = z.shape
        taus = torch.cat([tau_history.expand(b, t), tau.expand(b, t)], 1)
        conditioning = self.conditioning(cond)
        return self.run(torch.cat([history, z], 1), taus, torch.cat([conditioning, conditioning], 1), self.pair_tables(t, z.device))[:, t:]
