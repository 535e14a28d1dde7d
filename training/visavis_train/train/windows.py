"""Windows of the cache as training batches for the flow: latents and conditioning, with modality dropout."""
from dataclasses import replace

import torch
import torch.nn.functional as F

from ..hearing import ears
from ..mospa.react import REACTIONS
from ..nets.flow import GAZE, USER, Condition
from . import common
from .common import mixed
from .data import Split
from .geometry import to_local

CONTEXT = 8  # frames that an audio encoder in training hears before a window: a quarter of a second, more than it looks back
LOOSE = ("pair", "walk")  # kinds of clips, by their names, whose people dance or wander, whoever is silent
ASIDE = 0.6  # rad off the heading: a user to whom a body turns
SMOOTH = (1, 30, 60, 120)  # frames over which the gaze score is averaged; drawn as often as the window's mean


def smooth(gaze, window):
    """Centred moving mean over `window` frames of [T]; the ends are held."""
    if window <= 1:
        return gaze
    left = window // 2
    padded = F.pad(gaze[None, None], (left, window - 1 - left), mode="replicate")
    return F.avg_pool1d(padded, window, 1)[0, 0]


def aside(cond):
    """Blocks [B, K] at whose start the user is seen more than ASIDE off the heading, 0 or 1."""
    x, z = cond.user[..., -2:].unbind(-1)
    return (torch.atan2(x, z).abs() > ASIDE).float() * cond.flags[..., USER]


class Windows:
    """Random windows of `blocks` blocks from a cache file, on `device`. With `audio`, an encoder in training, the first `live` windows of a batch
    (or all) take their features from `voices` [N, 2, 800] i16, with gradients; the others take the cached ones."""

    def __init__(self, cache, blocks, drop=0.05, drop_all=0.1, drop_gaze=0.35, prefix=0.1, jitter=True, device="cpu", audio=None, voices=None, live=None, sounds=1.0, away=0.0, quiet=0.0):
        """`sounds`: how much more often clips in which sounds are heard are drawn than their length says; `away`: share of windows in which the user is
        not seen, all along or until or from some block; `quiet`: share of windows of clips that lack a voice in which it is heard to be silent, but of people who dance or
        wander: silence would be taken for a call to dance."""
        state = common.load(cache, mmap=True)
        self.blocks, self.device = blocks, torch.device(device)
        self.drop, self.drop_all, self.drop_gaze, self.prefix, self.jitter = drop, drop_all, drop_gaze, prefix, jitter
        self.audio, self.live, self.voices, self.away, self.quiet = audio, live, voices, away, quiet
        for name in ("z", "roots", "user", "agent", "voice", "still"):
            setattr(self, name, state[name].to(self.device))
        self.mean, self.std, self.starts, self.has = state["latent_mean"], state["latent_std"], state["starts"], state["has"].float()
        self.segments = state["segments"][state["segments"][:, 3] >= blocks]
        if not len(self.segments):
            raise SystemExit(f"{cache} has no clip of {blocks} blocks ({blocks * 4 / 30:.1f} s)")
        self.weights = self.segments[:, 3].float()
        self.composed = torch.tensor([not name.startswith(LOOSE) for name in state["names"]])
        self.sound_features = state["sound"].shape[1] if "sound" in state else 0
        if self.sound_features:
            for name in ("sound", "levels", "source", "known", "hears", "sensitivity", "silence"):
                setattr(self, name, state[name].to(self.device))
            self.weights = self.weights * torch.where(state["hears"][self.segments[:, 0]], sounds, 1.0)
        spans = list(zip(self.starts[:-1].tolist(), self.starts[1:].tolist()))
        self.gaze = torch.stack([torch.cat([smooth(state["gaze"][a:b], w) for a, b in spans]) for w in SMOOTH]).to(self.device)

    @property
    def audio_features(self):
        return self.agent.shape[1]

    def draw(self, size):
        """Places of `size` windows: rows of `segments` and their first blocks, on the CPU."""
        segment = self.segments[torch.multinomial(self.weights, size, replacement=True)]
        at = (torch.rand(size, dtype=torch.float64) * (segment[:, 3] - self.blocks + 1)).long()
        return segment, at

    def frames(self, segment, at):
        """Frames [B, 4 + 4 K] of the windows, beginning with the block before them."""
        return ((segment[:, 1] + 4 * at)[:, None] + torch.arange(-4, 4 * self.blocks)).to(self.device)

    def read(self, segment, at):
        """Latents [B, K, Dz] and all that is known beside them; block k's user is seen in block k - 1, from that block's last frame."""
        n, b, frames = self.blocks, len(at), self.frames(segment, at)
        z = self.z[((segment[:, 2] + at)[:, None] + torch.arange(n)).to(self.device)]
        before, now = frames[:, :-4], frames[:, 4:]
        user = to_local(self.roots[before[:, 3::4]], self.user[before][..., [0, 2]].double().unflatten(1, (n, 4))).float()
        kind = torch.randint(0, 2 * len(SMOOTH), (b,)) if self.jitter else torch.full((b,), 2)
        kind = kind.to(self.device)[:, None]
        gaze = torch.where(kind >= len(SMOOTH), self.gaze[0][now].mean(1, keepdim=True), self.gaze[kind % len(SMOOTH), now])
        flags = torch.ones(b, n, 4, device=self.device)
        silent = (torch.rand(b, 2) < self.quiet) & self.composed[segment[:, 0], None]
        has = torch.maximum(self.has[segment[:, 0]], silent.float())
        flags[..., 1:3] = has.to(self.device)[:, None]
        room = self.room(segment, frames, self.roots[before[:, 3::4]]) if self.sound_features else ()
        together = lambda x: x.float().reshape(b, n, -1)
        return z, Condition(user.flatten(2), together(self.agent[now]), together(self.voice[before]), gaze.reshape(b, n, 4), flags, *room)

    def room(self, segment, frames, roots):
        """Sound vectors [B, K, S] and their flags [B, K, 1] of the K blocks behind frames [B, 4 + 4 K] (or 4 K), for an agent at roots [B, K, 3] when
        they begin. Clips without sounds have silence and no flag."""
        b, k = roots.shape[:2]
        before, hears = frames[:, :4 * k].reshape(b * k, 4), self.hears[segment[:, 0]].repeat_interleave(k)
        features = torch.where(hears[:, None, None], self.sound[before].float(), self.silence)
        levels = torch.where(hears[:, None, None], self.levels[before], self.levels.new_tensor(ears.SILENT))
        sound = ears.vector(features, levels, self.source[before[:, 3]], self.known[before[:, 3]] & hears, roots.reshape(b * k, 3),
                            self.sensitivity[segment[:, 0]].repeat_interleave(k))
        return sound.unflatten(0, (b, k)), hears.float().reshape(b, k, 1)

    def overheard(self, sound, heard, segment):
        """Flags [B, K, 1] as sessions have them: in half of the windows sounds are absent until the first; half of the others hear silence, at any
        sensitivity. Where sounds are heard the modality is never left out by itself: the body would seem to react to nothing."""
        b, coin, hears = len(sound), torch.rand(len(sound), 1, 1, device=sound.device) < 0.5, self.hears[segment[:, 0]].reshape(-1, 1, 1)
        levels = sound[..., 4 * self.sound_features:4 * self.sound_features + 8]
        begun = ((levels > ears.SILENT + 0.1).any(-1, keepdim=True) | (sound[..., -6:-5] > 0)).cumsum(1) > 0
        any_genre = torch.randint(-1, 2, (b, 1), device=sound.device).to(sound.dtype)
        sound = torch.cat([sound[..., :-1], torch.where(hears, sound[..., -1:], any_genre[:, None])], -1)
        return sound, torch.where(hears, (begun | coin).float(), coin.expand(heard.shape).float())

    def stillness(self, segment, at):
        """Share of each block's frames [B, K] in which both hands are still."""
        return self.still[self.frames(segment, at)[:, 4:]].float().unflatten(1, (self.blocks, 4)).mean(-1)

    def called(self, cond):
        """How much what is heard in each block [B, K] calls for a reaction, 0 to 1."""
        if not self.sound_features:
            return torch.zeros(cond.flags.shape[:2], device=self.device)
        return ears.called(cond.sound, self.sound_features, len(REACTIONS)) * cond.heard[..., 0]

    def hear(self, segment, at):
        """Agent's and user's features [B, K, 4 D_a] each, straight from the voices."""
        frames, first = self.frames(segment, at), self.starts[segment[:, 0]].to(self.device)[:, None]
        earlier = frames[:, :1] - torch.arange(CONTEXT, 0, -1, device=self.device)
        every = torch.cat([earlier, frames], 1)
        kept = (every >= first)[..., None]
        both = self.voices[every.clamp(min=0).to(self.voices.device)].to(self.device)
        waves = torch.stack([(both[:, 4:, 0] * kept[:, 4:]), (both[:, :-4, 1] * kept[:, :-4])]).float() / 32768
        with mixed(self.device):
            heard = self.audio(waves.flatten(2).flatten(0, 1))[:, CONTEXT:].float().reshape(2, len(at), self.blocks, -1)
        return heard[0], heard[1]

    def seen(self, size):
        """Flags [B, K, 1] of a user who is away in the share `away` of windows: in two thirds of these all along, in the others until or from some block."""
        if not self.away:
            return torch.ones(size, self.blocks, 1, device=self.device)
        at, kind = torch.randint(1, self.blocks, (size, 1)), torch.randint(0, 6, (size, 1))
        k = torch.arange(self.blocks)[None]
        there = torch.where(kind == 0, k >= at, (kind == 1) & (k < at))
        return (there | (torch.rand(size, 1) >= self.away)).float()[..., None].to(self.device)

    def batch(self, size, place=None):
        """Latents [B, K, Dz] and their Condition with some modalities dropped; at places drawn here, or at `place`."""
        place = place or self.draw(size)
        z, cond = self.read(*place)
        user, agent, voice = cond.user, cond.agent, cond.voice
        if self.audio is not None:
            live = min(self.live or size, size)
            heard = self.hear(*(p[:live] for p in place))
            agent, voice = torch.cat([heard[0], agent[live:]]), torch.cat([heard[1], voice[live:]])
        n, device = self.blocks, self.device
        if self.jitter:
            normal = lambda *shape: torch.randn(*shape, device=device)
            turn = normal(size, 1, 1) * 0.02 + normal(size, n, 1) * 0.02
            shift = normal(size, 1, 1, 2) * 0.02 + normal(size, n, 1, 2) * 0.01
            c, s, user = turn.cos(), turn.sin(), user.unflatten(2, (4, 2))
            user = (torch.stack([c * user[..., 0] + s * user[..., 1], c * user[..., 1] - s * user[..., 0]], -1) + shift).flatten(2)
        keep = (torch.rand(size, 1, 4) >= self.drop).float()
        keep[..., GAZE] = (torch.rand(size, 1) >= self.drop_gaze).float()
        every = (torch.rand(size, 1, 1) >= self.drop_all).float()
        keep = keep * every
        start = torch.where(torch.rand(size, 1) < self.prefix, torch.randint(1, n, (size, 1)), torch.zeros(size, 1, dtype=torch.long))
        keep = keep * (torch.arange(n)[None] >= start).float()[..., None]
        sound, heard = cond.sound, cond.heard
        if self.sound_features:
            if self.jitter:
                sound, heard = self.overheard(sound, heard, place[0])
            heard = heard * (every * (torch.arange(n)[None] >= start).float()[..., None]).to(device)
        flags = cond.flags * keep.to(device)
        flags[..., USER:USER + 1] *= self.seen(size)
        return z, replace(cond, user=user, agent=agent, voice=voice, flags=flags, sound=sound, heard=heard)


def voices_of(corpus, split, device="cpu", workers=1):
    """All voices of a split [N, 2, 800] i16: 6.9 GB for 20 hours, on the CPU mapped from a file that is made when first asked for."""
    return Split(corpus, split, voices=True, workers=workers).voices.to(device)
