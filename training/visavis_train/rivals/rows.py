"""The rows that are compared.

    reference   the flow model as it is: VAE with interleaved tokens, flow over its latents
    positions   frames are joint positions, without rotations
    angles      frames are rotations relative to the parent joint, as most take them
    no-vae      the flow works on blocks of frames themselves (along principal directions)
    plain       the VAE is causal, but has no tokens between the frames
    gaze-1      the reference, sampled without gaze guidance (a weight of 1)
    mdm, a2p    offline diffusion over whole windows (`offline.py`)
    show        a VQ-VAE and a transformer over its codes (`show.py`)
"""
FLOWS = ("reference", "positions", "angles", "no-vae", "plain")
VAES = {"reference": [], "positions": ["--form", "positions"], "angles": ["--form", "angles"], "plain": ["--plain"], "show": ["--plain", "--codes", "256"]}
OFFLINE = ("mdm", "a2p")
TRAINED = (*FLOWS, *OFFLINE, "show")
ROWS = (*TRAINED, "gaze-1")


def beside(out, what):
    """Path of what belongs to a row's checkpoint: `runs/mdm.pt`, "vae.pt" -> `runs/mdm-vae.pt`."""
    return out.removesuffix(".pt") + "-" + what
