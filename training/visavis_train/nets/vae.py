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

    def forward(self, z):
        """Latents as the encoder gives them (not standardised) [B, K, Dz] -> standardised frames [B, 4 K, F]."""
        b, k, _ = z.shape
        first = self.latent(z)[:, :, None]
        h = self.run(torch.cat([first, self.frame_token.to(first.dtype).expand(b, k, -1, -1)], 2))
        with torch.autocast(z.device.type, enabled=False):  # bf16 would round frames by about 0.3 mm
            return self.out(h[:, :, 1:].float()).reshape(b, k * BLOCK, -1)


class Vae(nn.Module):
    def __init__(self, features, latent=64, layers=4, width=192, heads=4, mlp=4, window_blocks=16):
        super().__init__()
        self.encoder = Encoder(features, latent, layers, width, heads, mlp, window_blocks)
        self.decoder = Decoder(features, latent, layers, width, heads, mlp, window_blocks)

    def forward(self, x, noise=True, rough=0.0):
        """Reconstruction, mu and logvar. `rough`: latents get white noise too, of up to so many of their deviations, another amount each window."""
        mu, logvar = self.encoder(x)
        mu, logvar = mu.float(), logvar.float().clamp(-12, 6)
        z = mu + torch.randn_like(mu) * (0.5 * logvar).exp() if noise else mu
        if rough:
            amount = rough * torch.rand(len(mu), 1, 1, device=mu.device)
            z = z + amount * mu.detach().flatten(0, 1).std(0) * torch.randn_like(mu)
        return self.decoder(z).float(), mu, logvar
