"""Sizes of all networks. `base` is the shipped one's, `paper` SARAH's (its audio encoder is a frozen one of others; ours stays small)."""
from ..nets.audio import BASE_LAYERS


def convolutions(*channels):
    """Layers with the base encoder's kernels and strides and other channels."""
    return [(i, o, k, s, r) for (i, o), (_, _, k, s, r) in zip(zip((1, *channels), channels), BASE_LAYERS)]


SIZES = {
    "base": {
        "audio": dict(layers=BASE_LAYERS, features=64),
        "vae": dict(latent=64, layers=4, width=192, heads=4, mlp=4, window_blocks=16),
        "flow": dict(layers=4, width=256, heads=4, mlp=4, tau_width=128, window_blocks=48, embed_latent=128, embed_user=64, embed_voice=96,
                     embed_gaze=16, user_scale=2.0)},
    "mid": {
        "audio": dict(layers=convolutions(32, 64, 128, 192, 320, 320, 320), features=96),
        "vae": dict(latent=64, layers=4, width=256, heads=4, mlp=4, window_blocks=16),
        "flow": dict(layers=6, width=512, heads=8, mlp=4, tau_width=128, window_blocks=48, embed_latent=256, embed_user=64, embed_voice=192,
                     embed_gaze=32, user_scale=2.0)},
    "paper": {
        "audio": dict(layers=convolutions(32, 64, 128, 192, 320, 320, 320), features=96),
        "vae": dict(latent=256, layers=9, width=256, heads=4, mlp=4, window_blocks=16),
        "flow": dict(layers=4, width=1024, heads=4, mlp=4, tau_width=256, window_blocks=48, embed_latent=512, embed_user=128, embed_voice=256,
                     embed_gaze=32, user_scale=2.0)},
}
