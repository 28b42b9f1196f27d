"""An estimate in a file comes back bit by bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident import Estimate, identify, load_estimate, load_robot
from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from tests.results import Results


def assert_same(one: Estimate, other: Estimate):
    assert type(one) is type(other)
    for name in ("value", "covariance", "undetermined", "weights", "std"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.information.rows == other.information.rows
    np.testing.assert_array_equal(one.information.factor, other.information.factor)
    assert (one.method, one.std_kind) == (other.method, other.std_kind)
    states = np.random.default_rng(1).standard_normal((3, 5, one.model.robot.n))
    np.testing.assert_array_equal(one.predict(*states), other.predict(*states))


@pytest.mark.slow
def test_parameters_covariance_and_factor_come_back(results: Results, tmp_path: Path):
    path = tmp_path / "identification.json"
    results.identification.save(path)
    assert_same(results.identification.estimate, load_estimate(path, results.robot))
    # The file is the one that the command writes, with the estimate beside.
    content = json.loads(path.read_text())
    assert content["parameters"][0]["name"] == "P_d1"
    assert content["physically_consistent"] is not None


@pytest.mark.slow
def test_an_arm_that_can_exist_comes_back_with_its_bodies(results: Results, tmp_path: Path):
    results.consistent.estimate.save(tmp_path / "estimate.json")
    found = load_estimate(tmp_path / "estimate.json", results.robot)
    assert isinstance(found, ConsistentEstimate)
    assert_same(results.consistent.estimate, found)
    assert found.standard.tolist() == results.consistent.estimate.standard.tolist()
    assert (found.active, found.shapes) == (results.consistent.estimate.active, results.consistent.estimate.shapes)


def test_what_the_data_leave_open_stays_open(results: Results, tmp_path: Path):
    run = results.runs[0].recording
    still = replace(run, position=np.stack([run.position[0], np.zeros_like(run.time)]))
    found = identify(results.robot, [still], bands=[20.0, 20.0])
    assert np.isinf(found.estimate.std).any()
    found.save(tmp_path / "a.json")
    assert_same(found.estimate, load_estimate(tmp_path / "a.json", results.robot))


def test_a_file_that_is_none_or_of_another_robot_is_refused(results: Results, tmp_path: Path):
    path = tmp_path / "identification.json"
    with pytest.raises(UsageError, match=r"identification\.json: cannot be read: No such file"):
        load_estimate(path, results.robot)
    for text in ("{", "[]", "3", '{"parameters": []}', '{"estimate": 3}'):
        path.write_text(text)
        with pytest.raises(UsageError, match=r"no estimate in it; give the .*json that identify or diagnose wrote"):
            load_estimate(path, results.robot)
    results.identification.save(path)
    with pytest.raises(UsageError, match="of scara03 with the joints joint1, joint2"):
        load_estimate(path, load_robot("ur5"))
    content = json.loads(path.read_text())
    content["estimate"]["value"].pop()
    path.write_text(json.dumps(content))
    with pytest.raises(UsageError, match=r"its estimate is incomplete .*; save it again"):
        load_estimate(path, results.robot)
