"""Over a whole diagnosis and its report nothing of a recording is made twice that one choice of bands has made."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

import pytest

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.effects import Effect, EffectTerm, Member, Signals
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.rigid_body import RigidBody
from scara_ident.motion import motion as motion_module
from scara_ident.motion import position_noise as noise_module
from scara_ident.motion import prepared as prepared_module
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import PreparedData
from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
from scara_ident.report.pictures import diagnosis_pictures
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import held_out_run, virtual_runs

pytestmark = pytest.mark.slow

HIDDEN = "spring:joint1"
Counts = dict[str, Counter[Hashable]]
Run = tuple[Counts, Diagnosis, set[Hashable]]


def states(motion: Motion) -> Hashable:
    return motion.name, motion.q.tobytes(), motion.v.tobytes(), motion.a.tobytes()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A diagnosis of three short recordings and one held out, with its report, how often each thing was made, and twins.

    Twins are the motions with the noise of positions once more on top.
    """
    drawn: list[PreparedData] = []
    counts: Counts = {name: Counter() for name in ("stretches", "filters", "models", "rigid", "candidates")}

    def counted(patch: pytest.MonkeyPatch, owner: Any, name: str, kind: str, key: Callable[..., Hashable]) -> None:
        original = getattr(owner, name)

        def wrapped(*given: Any) -> Any:
            counts[kind].update([key(*given)])
            return original(*given)

        patch.setattr(owner, name, wrapped)

    def columns_of(model: TorqueModel, motion: Motion, *_: Any) -> Hashable:
        effects = tuple((term.effect, term.member) for term in model.terms if isinstance(term, EffectTerm))
        return model.name, effects, states(motion)

    def candidate(effect: Effect, signals: Signals, member: Member) -> Hashable:
        scene = signals.scene
        follows = (scene.value.tobytes(), tuple(scene.armatures.items())) if effect.follows_estimate else None
        return effect, member, follows, states(signals.motion)

    runs, held_out = virtual_runs(HIDDEN, seconds=(5.0, 6.0))[:3], held_out_run(HIDDEN)
    folder: Path = tmp_path_factory.mktemp("report")
    with pytest.MonkeyPatch.context() as patch:
        counted(patch, prepared_module, "stretches", "stretches", lambda recording: recording.name)
        counted(patch, motion_module, "differentiate", "filters", lambda row, rate, cut: (row.tobytes(), rate, cut))
        counted(patch, TorqueModel, "joint_columns", "models", columns_of)
        counted(patch, RigidBody, "fill", "rigid", lambda term, motion, rows: states(motion))
        counted(patch, Effect, "by_joint", "candidates", candidate)
        draw = noise_module._drawn
        patch.setattr(noise_module, "_drawn", lambda *given: drawn.append(draw(*given)) or drawn[-1])
        found = diagnose(load_robot(), runs, validation=[held_out])
        context = DiagnosisContext(found)
        diagnosis_pictures(context)
        diagnosis_report(folder / "report.html", context)
    return counts, found, {states(part.motion) for data in drawn for part in data.stretches}


def test_the_effect_is_found_and_the_report_written(run: Run):
    counts, found, _ = run
    assert [effect.effect for effect in found.effects] == ["spring"]
    assert all(sum(counter.values()) > 3 for counter in counts.values())


def test_recordings_are_cut_once(run: Run):
    assert dict(run[0]["stretches"]) == dict.fromkeys(("F1_1", "F1_2", "F2_1", "F3_1"), 1)


def test_a_joint_is_filtered_once_for_every_cut_off(run: Run):
    assert set(run[0]["filters"].values()) == {1}


def test_columns_of_a_model_are_made_once_in_every_band(run: Run):
    """But for those of twins, which fits and tests make each for themselves: kept, they would double the memory."""
    counts, _, twins = run
    own = {key: count for key, count in counts["models"].items() if isinstance(key, tuple) and key[2] not in twins}
    assert set(own.values()) == {1}
    assert twins and len(own) < len(counts["models"]) and max(counts["models"].values()) <= 4
    # Nobody else makes the rigid body's at recorded states; effects do at states that they shift.
    at = Counter(key[2] for key in own)
    assert {key: counts["rigid"][key] for key in at} == dict(at)


def test_columns_of_a_candidate_are_made_once(run: Run):
    """And once more at every sample, unfiltered, where it is let in: for all candidates that would not fit in memory."""
    counts, found, _ = run
    let_in = {candidate for step in found.search.steps for candidate in step.chosen} | set(found.search.chosen)
    again = {key: count for key, count in counts["candidates"].items() if count > 1}
    assert len(counts["candidates"]) > 100
    assert {(key[0], key[1]) for key in again if isinstance(key, tuple)} <= {
        (item.effect, item.member) for item in let_in
    }
    assert set(again.values()) <= {2}
