"""Figures over several seeds."""
import math

from visavis_train.train import seeds


def report(fgd, still):
    lively = {"stillness": still, "hand_spectrum": [0.01, 0.02, 0.03, 0.04, 0.05]}
    return {"rows": [{"name": "single", "all": {"fgd": fgd, "beat": None}, "listens": lively, "talks": None}],
            "idle": [{"name": "real people", "figures": {"stillness": 0.5}}, {"name": "single", "figures": lively}]}


def test_means_and_errors_over_seeds():
    assert seeds.over([1.0, 2.0, None, 3.0]) == (2.0, math.sqrt(2 / 2 / 3))
    assert seeds.over([4.0]) == (4.0, None) and seeds.over([None]) == (None, None)


def test_tables_hold_what_reports_have_and_nothing_else():
    motion, talk, rest = seeds.tables([report(0.05, 0.4), report(0.07, 0.6)])
    assert motion.splitlines() == ["| row | FGD cm² |", "|---|---|", "| single | 600 ± 100 |"]
    assert talk.splitlines()[-1] == "| single, listening | 0.50 ± 0.10 |"
    assert "real people | 0.50 | - |" in rest and "| single | 0.50 ± 0.10 | 10 | 20 | 30 | 40 | 50 |" in rest
