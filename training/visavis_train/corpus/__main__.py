"""`python -m visavis_train.corpus --data DIR --out DIR --hours 4 --seed 0`"""
import argparse

from .build import build
from .check import report


def main():
    ap = argparse.ArgumentParser(prog="python -m visavis_train.corpus", description="Build the simulated conversation corpus.")
    ap.add_argument("--data", required=True, help="folder with motion/ and speech/ (layout: its README.md)")
    ap.add_argument("--out", required=True, help="folder to write train/, val/ and test/ into; replaced when complete")
    ap.add_argument("--hours", type=float, default=20.0, help="simulated hours of training motion (val, test: 5 %% each, at least 0.25)")
    ap.add_argument("--workers", type=int, default=1, help="processes; the corpus is the same whatever their number")
    ap.add_argument("--seed", type=int, default=0)
    ap.add_argument("--report", action="store_true", help="print statistics of the finished corpus")
    a = ap.parse_args()
    build(a.data, a.out, a.hours, a.seed, workers=a.workers)
    if a.report:
        print(report(a.out))


if __name__ == "__main__":
    main()
