"""The state of held-out recordings: told by their first part only, and errors of the rest."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import CandidateColumns
from scara_ident.diagnosis.held_out.states import FIRST_PART, held_out_states
from scara_ident.diagnosis.selection.search import Search, SearchTask, search
from scara_ident.diagnosis.testing.selection_step import observed_at_every_sample
from scara_ident.effects.payload import PayloadOfRecordings
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.observations import observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.effects.test_payload import made

BANDS = (8.0, 8.0)


def runs(*masses: float, first: int = 0) -> list[Recording]:
    return [made(load_robot(), first + k, f"r_{first + k}", mass) for k, mass in enumerate(masses)]


@lru_cache
def found() -> tuple[Search, Estimate]:
    """A search that found a payload in two of four recordings, and its estimate."""
    observations = observe(build_model(load_robot()), prepare(runs(0.0, 1.5, 0.0, 1.5), BANDS))
    result = search(SearchTask(observations.model, (PayloadOfRecordings(),)), CandidateColumns(observations))
    return result, wls(observed_at_every_sample(result.step))


def test_a_payload_is_recognised_by_the_first_part_and_errors_are_of_the_rest():
    result, after = found()
    (effect,) = result.chosen
    assert effect.effect.description(result.scene, effect.member) == "a payload in r_1, r_3 and not in the others"
    held = prepare(runs(1.5, 0.0, first=10), BANDS)
    states = held_out_states(result, after, held)
    (now,) = states.chosen
    assert now.effect.description(states.scene, now.member) == "a payload in r_1, r_3, r_10 and not in the others"
    # A gear transmits it in these recordings too.
    assert [item.member for item in result.scene.link_torques] == [effect.member]
    assert [item.member for item in states.scene.link_torques] == [now.member]
    assert states.scene.link_torques[0].value == result.scene.link_torques[0].value
    for part, whole in zip(states.data.recordings, held.recordings, strict=True):
        length = np.ptp(whole.recording.time)
        assert part.recording.time[0] - whole.recording.time[0] == pytest.approx(FIRST_PART * length, abs=0.01)
        assert part.recording.time[-1] == whole.recording.time[-1]
    assert states.scene.start["r_10"] == held.recordings[0].recording.time[0]
    assert "r_11: its first third shows no effect" in states.notes[1]


def test_the_rest_of_a_recording_does_not_say_what_it_carries():
    result, after = found()
    (run,) = runs(0.0, first=20)
    late = run.time > run.time[0] + 0.4 * np.ptp(run.time)
    other = made(load_robot(), 20, "r_20", 1.5)
    mixed = replace(run, effort=np.where(late, other.effort, run.effort))
    states = held_out_states(result, after, prepare([mixed], BANDS))
    assert states.chosen == result.chosen


def test_without_such_an_effect_held_out_recordings_stay_whole():
    result, after = found()
    bare = replace(result, step=replace(result.step, chosen=()))
    held = prepare(runs(0.0, first=10), BANDS)
    states = held_out_states(bare, after, held)
    assert states.data is held
    assert states.notes == ()
