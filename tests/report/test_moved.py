"""How effects moved the model's own parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.model.urdf_values import urdf_values
from scara_ident.report.diagnosis_words import sentences
from scara_ident.report.moved import AWAY_SHARE, away_from_urdf, moved


def with_one_at(result: Diagnosis, before: float, after: float) -> tuple[Diagnosis, str]:
    """Return a diagnosis with the largest of its bodies at so many times the URDF's value, and its name."""
    model = result.before.model
    stated = urdf_values(model)
    k = int(np.nanargmax(np.abs(stated)))
    old, new = result.before.value.copy(), result.after.value.copy()
    old[: len(stated)] = np.where(np.isfinite(stated), stated, old)
    new[: len(stated)] = old
    old[k], new[k] = before * stated[k], after * stated[k]
    changed = replace(result, before=replace(result.before, value=old), after=replace(result.after, value=new))
    return changed, model.names[k]


def test_what_moved_is_listed_with_its_values(result: Diagnosis):
    changed, name = with_one_at(result, 1.1, 1.5)
    (item,) = (each for each in moved(changed) if each["name"] == name)
    k = changed.before.model.names.index(name)
    assert item["after"] / item["urdf"] == 1.5
    assert item["in_std"] == (changed.after.value[k] - changed.before.value[k]) / changed.after.std[k]


def test_bodies_that_leave_the_urdf_for_an_effect_are_reported_and_those_that_come_nearer_are_not(result: Diagnosis):
    changed, name = with_one_at(result, 1.1, 1.5)
    said = away_from_urdf(changed)
    assert said is not None
    assert f"{name} from " in said
    assert said in sentences(changed)
    for before, after in ((1.5, 1.1), (0.7, 1.25), (1.01, 1.01 + 0.9 * AWAY_SHARE)):
        assert away_from_urdf(with_one_at(result, before, after)[0]) is None


def test_without_effects_nothing_moved(result: Diagnosis):
    changed, _ = with_one_at(replace(result, effects=()), 1.1, 1.5)
    assert moved(changed) == []
    assert away_from_urdf(changed) is None
