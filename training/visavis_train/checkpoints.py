"""Takes a bundle apart into checkpoints that training goes on from.

    python -m visavis_train.checkpoints --bundle B.safetensors --out runs/start

Writes OUT/{audio,vae,flow,student,hearing}.pt (the last two if the bundle has a student, hears the room), for `--init` of the trainers. Optimiser states are not
in a bundle, so schedules start anew.
"""
import argparse
import os

from . import bundle as bundles
from .train import common


def split(b):
    """Checkpoints {name: state} of an open bundle."""
    width = b.config["audio"]["features"]
    latents = {"latent_mean": b.stat("latent_mean"), "latent_std": b.stat("latent_std")}
    flow = {"size": {k: v for k, v in b.config["flow"].items()}, "latent": b.config["vae"]["latent"], "audio": width}
    both = lambda net: {"net": net.state_dict(), "ema": net.state_dict()}
    if b.hearing is not None:
        flow["sound"] = bundles.sound_features(b.config["hearing"])
    out = {"audio": both(b.audio) | {"spec": b.audio.spec, "features": width},
           "vae": both(b.vae) | {"size": dict(b.config["vae"]), "mean": b.stat("pose_mean"), "std": b.stat("pose_std")},
           "flow": both(b.flow) | flow | latents}
    if b.hearing is not None:
        out["hearing"] = both(b.hearing) | {"spec": b.hearing.spec, "features": b.hearing.out.out_features}
        a = b.appraisal
        out["appraisal"] = both(a) | {"features": b.hearing.out.out_features, "reactions": list(a.reactions), "width": a.width}
    if b.student is not None:
        out["student"] = both(b.student) | flow | latents | b.config["student"]
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle", required=True)
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    for name, state in split(bundles.read(args.bundle)).items():
        common.save(os.path.join(args.out, f"{name}.pt"), **state)
        print(os.path.join(args.out, f"{name}.pt"))


if __name__ == "__main__":
    main()
