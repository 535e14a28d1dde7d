"""Film strips of conversations that sounds interrupt: a figure every half second from a second before a sound on, and the ground from above.

    python -m visavis_train.hearing.strip --corpus WORK/hearing --split test --out strip.png [--each 1]
"""
import argparse
import json

import numpy as np

from ..corpus import store
from ..motion import rig
from ..mospa.strip import sheet

BEFORE, LENGTH = 30, 210


def stretch(clip, event):
    """(title, positions, headings, source, onset) of an event, seen from where the agent stood before it, for `mospa.strip.sheet`."""
    first = max(event["onset"] - BEFORE, 0)
    p, r = clip.positions[first:first + LENGTH].astype(float), rig.quat_to_mat(clip.rotations[first:first + LENGTH])
    origin, inv = p[0, 0] * [1, 0, 1], rig.axis_mat("y", -rig.yaw_of(r[0, 0]))
    title = f"{event['kind']}: {event['reaction']} ({clip.meta['genre']})"
    return title, (p - origin) @ inv.T, rig.yaw_of(inv @ r[:, 0]), inv @ (np.array(event["place"]) - origin), event["onset"] - first


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--each", type=int, default=1, help="events of each reaction [1]")
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    rows, counts = [], {}
    for path in store.list_clips(args.corpus, args.split):
        clip = store.load(path, False)
        for event in json.loads(clip.meta["events"]):
            if event["onset"] + LENGTH - BEFORE < len(clip.positions) and counts.get(event["reaction"], 0) < args.each:
                counts[event["reaction"]] = counts.get(event["reaction"], 0) + 1
                rows.append(stretch(clip, event))
    sheet(args.out, sorted(rows, key=lambda r: r[0].split(":")[1]))


if __name__ == "__main__":
    main()
