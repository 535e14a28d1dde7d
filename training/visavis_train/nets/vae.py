"""Causal VAE of motion with interleaved latent tokens, SARAH 3.2 (mirrors src/vae)."""
import torch
from torch import nn

from .layers import EPS, Layer, places

BLOCK = 4


class Stack(nn.Module):
    """Layers over `tokens` tokens a block with a sliding window of whole blocks."""

    def __init__(self, layers, width, heads, mlp, window, tokens):
        super().__init__()
        self.layers = nn.ModuleList(Layer(width, heads, mlp) for _ in range(layers))
        self.ln_f = nn.LayerNorm(width, eps=EPS)
        self.slot = nn.Parameter(torch.randn(tokens, width) * 0.02)
        self.tokens, self.window, self.head_dim = tokens, window, width // heads
        self.made = {}

    def tables(self, blocks, device):
        key = blocks, str(device)
        if key not in self.made:
            index = torch.arange(blocks * self.tokens, device=device)
            self.made[key] = places(index, index // self.tokens, self.window, self.head_dim)
        return self.made[key]

    def run(self, x):
        """x [B, K, tokens, width] -> the same shape."""
        b, k, t, w = x.shape
        place = self.tables(k, x.device)
        x = (x + self.slot).reshape(b, k * t, w)
        for layer in self.layers:
            x = layer(x, place)
        return self.ln_f(x).reshape(b, k, t, w)


class Encoder(Stack):
    def __init__(self, features, latent, layers, width, heads, mlp, window):
        super().__init__(layers, width, heads, mlp, window, BLOCK + 2)
        self.frame = nn.Linear(features, width)
        self.mu_token = nn.Parameter(torch.randn(width) * 0.02)
        self.sigma_token = nn.Parameter(torch.randn(width) * 0.02)
        self.mu = nn.Linear(width, latent)
        self.logvar = nn.Linear(width, latent)

    def forward(self, x):
        """Standardised frames [B, 4 K, F] -> mu, logvar [B, K, Dz]."""
        b, t, _ = x.shape
        with torch.autocast(x.device.type, enabled=False):
            frames = self.frame(x).reshape(b, t // BLOCK, BLOCK, -1)
        ends = torch.stack([self.mu_token, self.sigma_token]).to(frames.dtype).expand(b, t // BLOCK, 2, -1)
        h = self.run(torch.cat([frames, ends], 2))
        return self.mu(h[:, :, BLOCK]), self.logvar(h[:, :, BLOCK + 1])


class Decoder(Stack):
    def __init__(self, features, latent, layers, width, heads, mlp, window):
        super().__init__(layers, width, heads, mlp, window, BLOCK + 1)
        self.latent = nn.Linear(latent, width)
        self.frame_token = nn.Parameter(torch.randn(BLOCK, width) * 0.02)
        self.out = nn.Linear(width, features)

    def enter(self, z):
        """Tokens [B, K, tokens, width] of latents."""
        first = self.latent(z)[:, :, None]
        return torch.cat([first, self.frame_token.to(first.dtype).expand(*z.shape[:2], -1, -1)], 2)

    def leave(self, h):
        """Frames [..., 4, F] of what became of the tokens."""
        with torch.autocast(h.device.type, enabled=False):  # bf16 would round frames by about 0.3 mm
            return self.out(h[..., -BLOCK:, :].float())

    def forward(self, z):
        """Latents as the encoder gives them (not standardised) [B, K, Dz] -> standardised frames [B, 4 K, F]."""
        return self.leave(self.run(self.enter(z))).flatten(1, 2)


class PlainEncoder(Stack):
    """Without interleaved tokens: a causal transformer over frames, whose four results of a block are read together."""

    def __init__(self, features, latent, layers, width, heads, mlp, window):
        super().__init__(layers, width, heads, mlp, window, BLOCK)
        self.frame, self.mu, self.logvar = nn.Linear(features, width), nn.Linear(BLOCK * width, latent), nn.Linear(BLOCK * width, latent)

    def forward(self, x):
        h = self.run(self.frame(x).unflatten(1, (-1, BLOCK))).flatten(2)
        return self.mu(h), self.logvar(h)


class PlainDecoder(Decoder):
    """The same backwards: a latent becomes four tokens by one matrix."""

    def __init__(self, features, latent, layers, width, heads, mlp, window):
        Stack.__init__(self, layers, width, heads, mlp, window, BLOCK)
        self.latent, self.out = nn.Linear(latent, BLOCK * width), nn.Linear(width, features)

    def enter(self, z):
        return self.latent(z).unflatten(-1, (BLOCK, -1))


class Quantiser(nn.Module):
    """A latent as `GROUPS` codes: each quarter of it, normalised, is the nearest of its codebook's vectors. The quarters share no scale, so that no code
    is out of reach."""
    GROUPS = 4

    def __init__(self, latent, codes):
        super().__init__()
        self.books = nn.Parameter(torch.randn(self.GROUPS, codes, latent // self.GROUPS))

    def normalised(self, mu):
        parts = mu.float().unflatten(-1, (self.GROUPS, -1))
        return nn.functional.layer_norm(parts, parts.shape[-1:])

    @torch.no_grad()
    def begin(self, mu):
        """Codebooks of latents [B, K, Dz] of the data."""
        every = self.normalised(mu).flatten(0, 1)
        pick = torch.randint(len(every), (self.books.shape[1],), device=mu.device)
        self.books.copy_(every[pick].transpose(0, 1) + 0.05 * torch.randn_like(self.books))

    @torch.no_grad()
    def codes(self, mu):
        """Numbers [B, K, GROUPS] of the nearest vectors."""
        parts = self.normalised(mu)
        return (self.books.square().sum(-1) - 2 * torch.einsum("bkgd,gnd->bkgn", parts, self.books)).argmin(-1)

    def vectors(self, codes):
        """Latents [B, K, Dz] of codes."""
        return torch.stack([self.books[g][codes[..., g]] for g in range(self.GROUPS)], -2).flatten(-2)

    def forward(self, mu):
        """The nearest latents; gradients go through as if they were `mu`."""
        parts = self.normalised(mu).flatten(-2)
        return parts + (self.vectors(self.codes(mu)) - parts).detach()

    def loss(self, mu):
        """Codes to their latents, and latents, less so, to their codes."""
        parts, near = self.normalised(mu).flatten(-2), self.vectors(self.codes(mu))
        return (near - parts.detach()).square().mean() + 0.25 * (parts - near.detach()).square().mean()


class Vae(nn.Module):
    """`interleaved` False: without latent tokens between the frames. `codes`: latents are codes, of books of so many (a VQ-VAE)."""

    def __init__(self, features, latent=64, layers=4, width=192, heads=4, mlp=4, window_blocks=16, interleaved=True, codes=None):
        super().__init__()
        given = features, latent, layers, width, heads, mlp, window_blocks
        self.encoder = Encoder(*given) if interleaved else PlainEncoder(*given)
        self.decoder = Decoder(*given) if interleaved else PlainDecoder(*given)
        self.quantiser = Quantiser(latent, codes) if codes else None

    def forward(self, x, noise=True, rough=0.0):
        """Reconstruction, mu and logvar. `rough`: latents get white noise too, of up to so many of their deviations, another amount each window."""
        mu, logvar = self.encoder(x)
        if self.quantiser:
            return self.decoder(self.quantiser(mu)).float(), mu, None
        mu, logvar = mu.float(), logvar.float().clamp(-12, 6)
        z = mu + torch.randn_like(mu) * (0.5 * logvar).exp() if noise else mu
        if rough:
            amount = rough * torch.rand(len(mu), 1, 1, device=mu.device)
            z = z + amount * mu.detach().flatten(0, 1).std(0) * torch.randn_like(mu)
        return self.decoder(z).float(), mu, logvar


class Affine(nn.Module):
    """Blocks of frames without a network between: their coordinates along fixed directions, and back. In place of a `Vae`."""

    def __init__(self, features, latent):
        super().__init__()
        self.encoder, self.decoder = BlockIn(features, latent), BlockOut(features, latent)
        self.quantiser = None

    def forward(self, x, noise=False):
        mu, logvar = self.encoder(x)
        return self.decoder(mu), mu, logvar


class BlockIn(nn.Module):
    def __init__(self, features, latent):
        super().__init__()
        self.mu = nn.Linear(BLOCK * features, latent)

    def forward(self, x):
        mu = self.mu(x.unflatten(1, (-1, BLOCK)).flatten(2))
        return mu, torch.full_like(mu, -12.0)


class BlockOut(nn.Module):
    def __init__(self, features, latent):
        super().__init__()
        self.out = nn.Linear(latent, BLOCK * features)

    def forward(self, z):
        return self.out(z).unflatten(-1, (BLOCK, -1)).flatten(1, 2)


def codec(features, size):
    """The network of a checkpoint's `size`: a `Vae`, or an `Affine` where it has nothing but a number of `directions`."""
    return Affine(features, size["directions"]) if "directions" in size else Vae(features, **size)
