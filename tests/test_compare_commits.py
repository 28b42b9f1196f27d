"""What the comparison of two commits calls a difference."""

import copy
import math
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def compare(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in ("checkouts", "compare_commits"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return pytest.importorskip("compare_commits", reason="benchmarks are not part of an installed package")


IDENTIFIED = {
    "parameters": [
        {"name": "P_d1", "joint": "joint1", "value": 16.0, "std": 0.02, "meaning": "inertia"},
        {"name": "P_d3", "joint": "joint2", "value": 1e-6, "std": 0.02, "meaning": "moment"},
    ],
    "condition": 1.5e6,
    "errors": {"training": {"OJD_1": {"joint1": {"rms": 0.02, "relative": None}}}},
}
DIAGNOSED = {
    "verdict": "explained",
    "effects": [
        {
            "effect": "spring",
            "joint": "joint1",
            "p_value": 1e-285,
            "parameters": {"stiffness": {"value": 0.1, "std": 0.01}},
        }
    ],
    "noise_floor": {"joint1": 0.021},
}


def found(compare, old, new):
    runs = [{"status": 0, "output": result, "errors": ""} for result in (old, new)]
    return {item["what"]: item["relative"] for item in compare.differences("command", *runs)}


def test_what_is_only_new_or_only_worded_otherwise_is_no_difference(compare):
    new = copy.deepcopy(IDENTIFIED) | {"links": []}
    new["parameters"][0]["meaning"] = "another word"
    new["parameters"][0]["note"] = 3.0
    new["parameters"].reverse()
    assert found(compare, IDENTIFIED, new) == {}


def test_a_parameter_near_zero_is_measured_by_its_standard_deviation(compare):
    new = copy.deepcopy(IDENTIFIED)
    new["parameters"][1]["value"] += 1e-10
    assert found(compare, IDENTIFIED, new) == {}
    new["parameters"][1]["value"] += 2e-9
    what = "parameters[P_d3/joint2].value"
    assert found(compare, IDENTIFIED, new) == {what: pytest.approx(2.1e-9 / 0.02)}


def test_other_figures_are_measured_by_themselves(compare):
    new = copy.deepcopy(IDENTIFIED)
    new["errors"]["training"]["OJD_1"]["joint1"] = {"rms": 0.02 * (1 + 1e-7), "relative": 0.3}
    change = found(compare, IDENTIFIED, new)
    assert change == {
        "errors.training.OJD_1.joint1.rms": pytest.approx(1e-7, rel=1e-6),
        "errors.training.OJD_1.joint1.relative": math.inf,
    }


def test_an_effect_that_came_or_went_is_one_difference(compare):
    new = copy.deepcopy(DIAGNOSED)
    new["effects"][0]["joint"] = "joint2"
    assert set(found(compare, DIAGNOSED, new)) == {"effects[spring/joint1]", "effects[spring/joint2]"}


def test_verdict_status_and_missing_keys_are_differences(compare):
    new = copy.deepcopy(DIAGNOSED) | {"verdict": "unexplained"}
    del new["noise_floor"]
    assert set(found(compare, DIAGNOSED, new)) == {"verdict", "noise_floor.joint1"}
    failed = {"status": 1, "output": None, "errors": "no recordings\n"}
    worked = {"status": 0, "output": DIAGNOSED, "errors": ""}
    (difference,) = compare.differences("command", worked, failed)
    assert (difference["what"], difference["new"]) == ("exit status", "1 no recordings")


def test_how_sure_an_effect_is_counts_by_its_power_of_ten(compare):
    new = copy.deepcopy(DIAGNOSED)
    new["effects"][0]["p_value"] *= 1 + 1e-7
    assert found(compare, DIAGNOSED, new) == {}
    new["effects"][0]["p_value"] *= 10
    assert list(found(compare, DIAGNOSED, new)) == ["effects[spring/joint1].p_value (log10)"]


def test_errors_held_out_are_compared_joint_by_joint(compare):
    old = {
        "status": 0,
        "output": IDENTIFIED | {"errors": {"validation": {"F": {"a": {"rms": 0.2}, "b": {"rms": 0.1}}}}},
    }
    new = {
        "status": 0,
        "output": IDENTIFIED | {"errors": {"validation": {"F": {"a": {"rms": 0.1}, "b": {"rms": 0.1}}}}},
    }
    assert compare.held_out_ratios(old, new) == [0.5, 1.0]
    assert compare.held_out_ratios(old, {"status": 1, "output": None}) == []


def test_what_is_no_checkout_is_not_run_as_what_is_installed(compare, tmp_path):
    with pytest.raises(SystemExit, match="no checkout"):
        compare.run(tmp_path, ["--version"])
