"""One estimate of a model with effects: the same number and the same standard deviation wherever a parameter is told."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from scara_ident.arrays import Array
from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.fitting.effect_parameters import physical_parameters
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed_at_every_sample
from scara_ident.effects import EffectTerm, Member, effects_named
from scara_ident.effects.drift import WarmUp
from scara_ident.effects.measurement import shifted
from scara_ident.estimation import wls
from scara_ident.estimation.information import weighted
from scara_ident.estimation.observations import observe
from scara_ident.export.identified_model import identified_model
from scara_ident.export.result import read_identified
from scara_ident.export.saved_estimate import load_estimate
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, recorded_torque, recording, sines
from tests.diagnosis.made import BANDS, complete, exact_runs, held_out_run, virtual_runs

EFFECT = "torque_sensor_nonlinearity"


@lru_cache(maxsize=1)
def bent() -> Diagnosis:
    """An effect whose torque is the cube of what all parameters predict."""
    runs, held_out = virtual_runs(f"{EFFECT}:joint1"), held_out_run(f"{EFFECT}:joint1")
    return diagnose(load_robot(), runs, validation=[held_out], bands=BANDS, catalogue=effects_named(EFFECT))


@pytest.mark.slow
def test_an_effect_is_determined_by_one_number_and_one_standard_deviation() -> None:
    """Its coefficient among the parameters was that of another least squares, and surer than its size."""
    content = diagnosis_dict(bent())
    (effect,) = content["effects"]
    own = content["parameters"][-1]
    told = effect["parameters"][own["name"]]
    assert (own["value"], own["std"]) == (told["value"], told["std"])


@pytest.mark.slow
def test_what_is_predicted_follows_from_the_parameters_that_are_determined() -> None:
    """The columns of its term are made anew of the estimate, on training and held out, and so are the errors."""
    found = bent()
    (term,) = [term for term in found.after.model.terms if isinstance(term, EffectTerm)]
    base = len(found.before.value)
    assert np.array_equal(term.scene.value, found.after.value[:base])
    for rows in (found.training_after, found.validation_after):
        for part, raws in zip(rows.data.stretches, [raw for each in rows.raw for raw in each], strict=True):
            columns = found.after.model.joint_columns(part.motion)
            assert all(np.allclose(raw, own, atol=1e-9) for raw, own in zip(raws, columns, strict=True))


@pytest.mark.slow
def test_its_rows_are_fitted_best_by_its_parameters(tmp_path: Path) -> None:
    """A URDF is fitted to them, and its friction again: held columns alone would lead elsewhere."""
    found = bent()
    after, size = found.after, found.after.std
    held = weighted(found.training_after.by_joint, after.weights).solve().value
    assert np.max(np.abs(held - after.value) / size) > 0.1
    found.save(tmp_path / "diagnosis.json")
    for model in (identified_model(found), read_identified(tmp_path / "diagnosis.json", load_robot())):
        assert np.max(np.abs(model.information.solve().value - after.value) / size) < 1e-6
        assert np.array_equal(model.value, after.value)
    saved = load_estimate(tmp_path / "diagnosis.json", load_robot())
    assert np.max(np.abs(saved.information.solve().value - after.value) / size) < 1e-6
    # What is left of them is what was.
    left = weighted(found.training_after.by_joint, after.weights).residual_sum(held)
    assert after.information.residual_sum(after.value) == pytest.approx(left, rel=1e-9)


def test_what_was_taken_out_of_the_data_leaves_all_parameters_where_they_are() -> None:
    runs = [shifted(run, -0.008) for run in exact_runs()]
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("time_delay"))
    alone = wls(found.training_after)
    assert [item.effect for item in found.effects] == ["time_delay"]
    assert np.array_equal(found.after.value, alone.value)
    assert found.after.followed is None
    assert not np.allclose(found.after.covariance, alone.covariance, rtol=1e-3)


def warming(draws: int) -> Array:
    """Friction of the first joint, of a gear that warms up: value and std, with columns held and as told, (draws, 2, 2)."""
    robot, friction, time = (
        load_robot(),
        [(0.6, 0.3, 0.0, 0.0, 0.0), (0.2, 0.1, 0.0, 0.0, 0.0)],
        np.arange(1500) / 125.0,
    )
    runs, noise, found = [], np.array([0.02, 0.01]), []
    for k in range(3):
        q, v, a = sines(np.random.default_rng(60 + k), time, 2)
        torque, bare = (recorded_torque(robot, q, v, a, each) for each in (friction, [(0.0,) * 5] * 2))
        torque[0] += 0.6 * np.exp(-time / 6.0) * (torque - bare)[0]
        runs.append(recording(robot, f"t{k}_1", time, q, torque))
    ready, place = prepare(runs, BANDS), complete().names.index("a01")
    for k in range(draws):
        rng = np.random.default_rng([9, k])
        parts = [own.with_effort_of(noisy(run, rng, noise)) for own, run in zip(ready.recordings, runs, strict=True)]
        seen = observe(complete(), PreparedData(tuple(parts), ready.bands))
        scene, chosen = scene_of(seen.model, wls(seen).value, seen), Candidate(WarmUp(), Member(0, (6.0,)))
        step = tune(SelectionStep(scene, CandidateColumns(seen), (chosen,), 1.0 / noise, 10, CRITERIA))
        linear = physical_parameters(step).linear
        assert linear is not None
        each = (wls(observed_at_every_sample(step)), linear)
        found.append([(item.value[place], np.sqrt(item.covariance[place, place])) for item in each])
    return np.array(found)


@pytest.mark.slow
def test_friction_is_as_unsure_as_what_multiplies_it_leaves_it() -> None:
    """It scattered by over twice what was told of it."""
    held, told = warming(24).transpose(1, 2, 0)
    assert np.std(held[0]) > 1.5 * np.median(held[1])
    assert np.std(told[0]) == pytest.approx(np.median(told[1]), rel=0.35)
    assert np.mean(np.abs(told[0] - 0.6) < 2.0 * told[1]) > 0.85
