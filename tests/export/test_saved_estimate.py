"""The estimate of a result file, of an identification and of a diagnosis, is the one that was saved."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scara_ident import load_estimate, load_robot
from scara_ident.errors import ScaraIdentError
from tests.results import Results


@pytest.mark.slow
def test_a_diagnosis_gives_its_estimate_with_the_effects_found(results: Results, tmp_path: Path):
    after, path = results.diagnosis.after, tmp_path / "diagnosis.json"
    results.diagnosis.save(path)
    found = load_estimate(path, results.robot)
    assert found.model.names == after.model.names
    assert len(found.value) > len(results.identification.estimate.value)
    for name in ("value", "undetermined", "weights", "std"):
        np.testing.assert_array_equal(getattr(found, name), getattr(after, name))
    # The file has the upper triangle alone, and the two are the same but for rounding.
    assert np.abs(found.covariance - after.covariance).max() < 1e-12 * np.abs(after.covariance).max()
    assert (found.method, found.std_kind) == (after.method, after.std_kind)
    size = np.linalg.norm(after.information.factor)
    gram, expected = (each.information.factor.T @ each.information.factor for each in (found, after))
    assert np.abs(gram - expected).max() < 1e-9 * size**2
    states = np.random.default_rng(1).standard_normal((3, 5, results.robot.n))
    np.testing.assert_array_equal(found.predict(*states), after.predict(*states))


def test_an_identification_gives_its_own(results: Results, tmp_path: Path):
    results.identification.save(tmp_path / "identification.json")
    found = load_estimate(tmp_path / "identification.json", results.robot)
    np.testing.assert_array_equal(found.covariance, results.identification.estimate.covariance)


def test_a_diagnosis_of_another_robot_or_without_its_model_is_refused(results: Results, tmp_path: Path):
    path = tmp_path / "diagnosis.json"
    results.diagnosis.save(path)
    with pytest.raises(ScaraIdentError, match="its parameters are not those of"):
        load_estimate(path, load_robot("ur5"))
    content = json.loads(path.read_text())
    del content["parameters"]
    path.write_text(json.dumps(content))
    with pytest.raises(ScaraIdentError, match="holds no model"):
        load_estimate(path, results.robot)
