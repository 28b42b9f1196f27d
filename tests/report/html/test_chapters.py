"""What an effect adds and what is its own, and the chapters of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.position import Spring
from scara_ident.report.html.chapters import Chapter, chapters
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque
from tests.report.simulated import swinging, trace_of


def chapter(**changes) -> tuple[Chapter, np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    before, added = random.normal(size=(2, 2, 500))
    first = trace_of(swinging(before))
    effects = (("spring", "joint1", 7.0 * added), ("spring", "joint2", added), ("spring", "joint2", 2.0 * added))
    second = replace(first, residual=before - added, effects=effects)
    made = Chapter(1, "spring", 1, [first], [second], BANDS, "joint2")
    return replace(made, **changes), before, added


def test_what_an_effect_adds_is_what_the_residual_loses():
    made, _, added = chapter()
    np.testing.assert_allclose(made.added[0], added[1], atol=1e-12)


def test_its_own_torque_is_that_of_the_last_of_its_name_on_its_joint():
    made, _, added = chapter()
    np.testing.assert_array_equal(made.own[0], 2.0 * added[1])
    assert chapter(own_joint=None)[0].own is None


def test_what_was_corrected_in_the_data_adds_nothing_to_the_prediction():
    assert chapter(corrected=True)[0].added is None


@pytest.mark.slow
def test_each_chapter_begins_with_what_the_one_before_left():
    runs = with_torque(exact_runs(3)[:4], 1, lambda motion: 0.05 * motion.q[1])
    runs = with_torque(runs, 0, lambda motion: 0.05 * motion.q[0])
    found = chapters(diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(), Stribeck())))
    assert [(effect.effect, effect.joint, made.joint) for effect, made in found] in (
        [("spring", "joint1", 0), ("spring", "joint2", 1)],
        [("spring", "joint2", 1), ("spring", "joint1", 0)],
    )
    (_, one), (_, two) = found
    assert two.before is one.after
    for effect, made in found:
        for before, after in zip(made.before, made.after, strict=True):
            used = before.used[made.joint] & after.used[made.joint]
            assert np.std(after.residual[made.joint, used]) < np.std(before.residual[made.joint, used])
        # A spring of 0.05 N m/rad less what it moves of the rest of the model.
        position = np.concatenate([trace.motion.q[made.joint] for trace in made.after])
        assert np.polyfit(position, np.concatenate(made.own), 1)[0] == pytest.approx(0.05, abs=0.005), effect.effect
