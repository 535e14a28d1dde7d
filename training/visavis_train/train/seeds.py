"""Figures of one bundle over the reports of several seeds: mean and standard error of the mean.

    for s in 0 1 2 3; do visavis eval --model B --clips DIR --sampler midpoint4 single --motion-only --seed $s --json $s.json; done
    python -m visavis_train.train.seeds 0.json 1.json 2.json 3.json

Printed as Markdown: motion of the conversations' windows, listening and speaking, and at rest. What no report has is left out.
"""
import argparse
import json
import math

MOTION = (("FGD cm²", "all.fgd", 1e4, 0), ("FGD, speaking", "speaking.fgd", 1e4, 0), ("foot slide", "all.foot_slide", 1, 3), ("support foot mm/s", "all.support_foot_speed", 1e3, 1),
          ("wrists m/s", "all.wrist_speed", 1, 3), ("speaking / not", "wrist_ratio", 1, 2), ("beat", "all.beat", 1, 3), ("shuffled", "all.beat_shuffled", 1, 3),
          ("head angle", "all.head_angle", 1, 3), ("seam", "all.seam", 1, 2))
LIVELY = (("both hands still", "stillness", 1, 2), ("hand m/s", "hand_speed", 1, 3), ("hand m/s²", "hand_acceleration", 1, 2), ("head m/s", "head_speed", 1, 3),
          ("head m/s²", "head_acceleration", 1, 3), ("rest changes a minute", "rest_changes", 1, 1), ("sway cm", "sway", 1, 1), ("still stretches s", "still_stretches", 1, 1),
          ("10 s still throughout", "still_throughout", 1, 2), ("10 s never still", "still_never", 1, 2))
OCTAVES = tuple((f"octave {i + 1} mm/s", f"hand_spectrum.{i}", 1e3, 0) for i in range(5))


def value(row, path):
    """The number at "a.b.0" of a report's row, or None."""
    for key in path.split("."):
        if row is None:
            return None
        row = row[int(key)] if isinstance(row, list) else row.get(key)
    return row


def over(values):
    """Mean and standard error of the mean of the values that there are; the error of fewer than two is None, the mean of none too."""
    values = [v for v in values if v is not None]
    if not values:
        return None, None
    mean = sum(values) / len(values)
    return mean, math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1) / len(values)) if len(values) > 1 else None


def cell(values, scale, digits):
    """"mean ± error" of the values times `scale`; an error that is 0 is none."""
    mean, error = over(values)
    if mean is None:
        return "-"
    text = f"{mean * scale:.{digits}f}"
    return f"{text} ± {error * scale:.{digits}f}" if error else text


def table(rows, columns):
    """Markdown of rows {name: [a report's row, ...]}."""
    columns = [c for c in columns if any(value(r, c[1]) is not None for rs in rows.values() for r in rs)]
    lines = ["| row | " + " | ".join(c[0] for c in columns) + " |", "|" + "---|" * (len(columns) + 1)]
    for name, of in rows.items():
        lines.append(f"| {name} | " + " | ".join(cell([value(r, path) for r in of], scale, digits) for _, path, scale, digits in columns) + " |")
    return "\n".join(lines)


def gathered(reports, part, name="name"):
    """{name: [that row of each report]} of the reports' list `part`."""
    out = {}
    for report in reports:
        for row in report[part]:
            out.setdefault(row[name], []).append(row)
    return out


def tables(reports):
    """The three tables of reports."""
    rows = gathered(reports, "rows")
    talk = {f"{name}, {what}": [r[key] for r in of if r.get(key)] for name, of in rows.items() for what, key in (("listening", "listens"), ("speaking", "talks"))}
    nods = [(f"nods, {what}", f"nods.{key}", 1, 1) for what, key in (("user speaks", "speaks"), ("pauses", "pauses"), ("nobody", "nobody"))]
    idle = {name: [r["figures"] for r in of] for name, of in gathered(reports, "idle").items()}
    return [table(rows, MOTION), table({k: v for k, v in talk.items() if v}, (*LIVELY, *nods)), table(idle, (*LIVELY, *OCTAVES))]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("reports", nargs="+", help="what `visavis eval --json` wrote")
    args = parser.parse_args()
    reports = []
    for path in args.reports:
        with open(path) as f:
            reports.append(json.load(f))
    print("\n\n".join(tables(reports)))


if __name__ == "__main__":
    main()
