"""A body taken up and put down, as often as it is: its columns, its words, and a diagnosis of runs with it."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.effects import Interval, Member, Signals
from scara_ident.effects.catalogue import effects_named
from scara_ident.effects.payload import FreePayloadChange
from scara_ident.effects.payload_intervals import PayloadInIntervals
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.export.result import KEY, rebuild_entry
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.robot.robot import Robot
from tests.effects.intervals import ARM, BANDS, CYCLES, MASS, SECONDS, SINGLE, arms, run, runs, seen

HELD_OUT = {"m7_1": ((1.5, 4.0), (5.5, 8.0))}


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Robot]:
    return arms(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def found(robots: tuple[Robot, Robot]) -> Diagnosis:
    families = effects_named("payload_change", "spring", "offset_drift")
    held_out = [run(robots, 7, HELD_OUT)]
    return diagnose(
        robots[0], runs(robots, CYCLES), model="basic", bands=BANDS, catalogue=families, validation=held_out
    )


def test_columns_are_those_of_a_payload_within_intervals_alone(robots: tuple[Robot, Robot]):
    scene, _ = seen(robots[0], runs(robots, CYCLES))
    motion = next(item for item in scene.columns if item.name == "m1_1")
    signals = Signals(scene, motion)
    always = FreePayloadChange().regressor(signals, Member(None, (-1.0,)))
    both = (Interval(1, 2.0, 4.0), Interval(0, 0.0, SECONDS), Interval(1, 6.0, 7.0, joint=1))
    own = PayloadInIntervals().regressor(signals, Member(None, intervals=both))
    inside = (signals.time > 2.01) & (signals.time < 3.99)
    later = (signals.time > 6.01) & (signals.time < 6.99)
    assert np.allclose(own[:, :, inside], always[:, :, inside])
    assert np.allclose(own[1, :, later], always[1, :, later])
    assert not np.any(own[0, :, later])
    outside = (signals.time < 1.99) | ((signals.time > 4.01) & (signals.time < 5.99)) | (signals.time > 7.01)
    assert not np.any(own[:, :, outside])


def test_few_intervals_are_said_and_many_counted(robots: tuple[Robot, Robot]):
    scene, _ = seen(robots[0], runs(robots, CYCLES))
    family, one = PayloadInIntervals(), Interval(1, 2.0, 4.0, 0.01, 0.01)
    assert family.description(scene, Member(None, intervals=(one,))) == "a payload in m1_1 from 2.00 to 4.00 s"
    assert (
        family.description(scene, Member(None, intervals=(Interval(1, 2.0, SECONDS),)))
        == "a payload in m1_1 from 2.00 s on"
    )
    many = Member(None, intervals=(one, one, one, Interval(0, 1.0, 2.0)))
    assert family.description(scene, many) == "a payload in 4 intervals of m1_1, m0_1"


@pytest.mark.slow
def test_cycles_are_explained_by_one_mass(found: Diagnosis):
    """The verdict was `undecided` and no effect was found."""
    (payload,) = found.effects
    assert payload.effect == "payload_change"
    # Half a minute of motion shows of nothing else that it is not there.
    assert found.verdict in ("explained", "undecided")
    assert found.unexplained is None
    before, after = (
        rms_of(item.value, rows)
        for item, rows in ((found.before, found.validation_before), (found.after, found.validation_after))
    )
    assert after[0] < 0.5 * before[0]
    assert after[1] < 0.5 * before[1]
    for name, truth in (("mass", MASS), ("mx", MASS * ARM), ("time", 1.0), ("until", 3.2)):
        item = payload.parameters[name]
        assert abs(item.value - truth) < 3.0 * item.std < 0.05 * truth
    assert payload.candidate is not None
    truth = [edge for own in CYCLES.values() for span in own for edge in span]
    edges = [edge for item in payload.candidate.member.intervals for edge in (item.start, item.stop)]
    assert edges == pytest.approx(truth, abs=0.02)


@pytest.mark.slow
def test_what_is_taken_up_in_one_run_is_found_with_its_mass_and_instant(robots: tuple[Robot, Robot]):
    """`undecided`, and no candidate that acts in one recording alone."""
    families = effects_named("payload_change", "spring", "offset_drift")
    found = diagnose(
        robots[0], runs(robots, SINGLE, count=4, offset=0.0), model="basic", bands=BANDS, catalogue=families
    )
    assert found.verdict == "explained"
    (payload,) = found.effects
    assert payload.description == "a payload in m2_1 from 4.00 s on"
    for name, truth in (("mass", MASS), ("mx", MASS * ARM), ("time", 4.0)):
        item = payload.parameters[name]
        assert abs(item.value - truth) < 3.0 * item.std < 0.1 * truth
    # Where the recording ends is no instant that was measured.
    assert "until" not in payload.parameters


@pytest.mark.slow
def test_recordings_held_out_have_intervals_of_their_own(found: Diagnosis):
    (payload,) = found.effects
    assert payload.held_out is not None
    assert payload.held_out.size == pytest.approx(1.0, abs=0.1)
    assert any("m7_1: payload_change acts from 1." in note for note in found.notes)


@pytest.mark.slow
def test_the_result_holds_the_intervals(found: Diagnosis):
    entry = diagnosis_dict(found)
    (effect,) = entry["effects"]
    assert [item["recording"] for item in effect["intervals"]] == [name for name, own in CYCLES.items() for _ in own]
    assert effect["intervals"][0]["from"] == pytest.approx(1.0, abs=0.02)
    (term,) = rebuild_entry(found.after, found.training_after, found.validation_after)["effects"]
    assert len(term["intervals"]) == len(effect["intervals"])
    assert entry[KEY]["effects"] == [term]
