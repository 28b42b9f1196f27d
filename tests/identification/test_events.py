"""Events of recordings: found, named with the force on the tool, left out of the fit, and never twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import robust_fit
from scara_ident.identification.events import (
    MAX_SENTENCES,
    Event,
    event_notes,
    find_events,
    left_out,
    same_events,
    without_events,
)
from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, swing
from tests.truth.pushes import pushed

ROBOT = load_robot()
FORCE = np.array([12.0, -9.0, 0.0])
START, STOP = 6.0, 7.2


def runs() -> list[Recording]:
    rng = np.random.default_rng(5)
    return [noisy(swing(ROBOT, f"swing{k}", seed=k, seconds=15.0, rate=250.0), rng, 0.01) for k in range(4)]


def observed(recordings: list[Recording]) -> Observations:
    return observe(build_model(ROBOT, "complete"), prepare(recordings, (8.0, 8.0)))


def test_a_push_is_found_with_its_times_and_force_and_only_that():
    plain = runs()
    observations = observed([pushed(ROBOT, plain[0], FORCE, START, STOP), *plain[1:]])
    (event,) = find_events(observations, robust_fit(observations).value)
    assert (event.recording, event.kind) == ("swing0", "contact")
    assert event.start == pytest.approx(START, abs=0.1)
    assert event.stop == pytest.approx(STOP, abs=0.1)
    assert event.force == pytest.approx(FORCE, abs=0.1 * float(np.linalg.norm(FORCE)))
    assert event.begins[0] <= START <= event.begins[1] < event.begins[0] + 0.3
    assert event.ends[0] <= STOP <= event.ends[1] < event.ends[0] + 0.3
    ends = {"from", "from_within", "to", "to_within"}
    assert set(event.entry) == {"recording", *ends, "joints", "rms", "rms_by_joint", "kind", "force"}
    assert event.sizes[0] == event.rms
    # Where the force acts is not known.
    assert event.sentence(ROBOT).endswith(
        f"{np.linalg.norm(event.force):.3g} N if it acts at the tool; left out of the fit"
    )
    other = observed(plain)
    assert find_events(other, robust_fit(other).value) == ()


def test_the_stretch_is_out_of_rows_and_found_again():
    plain = runs()
    observations = observed([pushed(ROBOT, plain[0], FORCE, START, STOP), *plain[1:]])
    events = find_events(observations, robust_fit(observations).value)
    rest = without_events(observations, events)
    part, whole = rest.data.stretches[0], observations.data.stretches[0]
    inside = (part.stretch.time >= START) & (part.stretch.time <= STOP)
    assert not np.any(part.used[:, inside])
    assert np.array_equal(part.used[:, ~part.left_out], whole.used[:, ~part.left_out])
    # What is shared is not made again, and at rest is only what was.
    assert rest.each[1].joints[0].table is observations.each[1].joints[0].table or np.array_equal(
        rest.each[1].joints[0].table, observations.each[1].joints[0].table
    )
    assert rest.left_out_rest == pytest.approx(observations.left_out_rest, abs=0.03)
    assert same_events(find_events(rest, robust_fit(rest).value), events)
    assert left_out(rest.data, ()).stretches[0].left_out is False


def test_an_event_of_a_later_part_is_later_with_what_is_stated_of_its_ends():
    one = Event("a", 1.0, 2.0, ("joint1",), 1.0, "contact", 3.0, begins=(0.875, 1.125), ends=(1.75, 2.5)).later(10.0)
    assert one == Event("a", 11.0, 12.0, ("joint1",), 1.0, "contact", 3.0, begins=(10.875, 11.125), ends=(11.75, 12.5))
    assert (one.entry["from_within"], one.entry["to_within"]) == ([10.875, 11.125], [11.75, 12.5])
    assert "from 11.00 to 12.00 s, ending between 11.75 and 12.50 s" in one.sentence(ROBOT)
    whole = Event("a", 0.0, 2.0, ("joint1",), 1.0, "unknown")
    assert whole.later(1.0).begins is None
    assert "from_within" not in whole.entry


def test_events_are_the_same_where_most_of_their_time_is():
    one = Event("a", 1.0, 2.0, ("joint1",), 1.0, "contact")
    assert same_events((one,), (replace(one, start=1.2, stop=2.3),))
    assert not same_events((one,), (replace(one, recording="b"),))
    assert not same_events((one,), ())
    assert same_events((), ())


def test_identify_leaves_it_out_and_says_so():
    plain = runs()
    found = identify(ROBOT, [*plain[1:], pushed(ROBOT, plain[0], FORCE, START, STOP)], bands=(8.0, 8.0))
    truth = identify(ROBOT, plain, bands=(8.0, 8.0))
    assert [event.recording for event in found.events] == ["swing0"]
    assert any("swing0: contact from" in note for note in found.notes)
    known = ~truth.estimate.undetermined
    shift = np.abs(found.estimate.value - truth.estimate.value)[known] / truth.estimate.std[known]
    # All that differs is 1.4 s of 60.
    assert shift.max() < 1.0
    assert truth.events == ()


def test_a_repetition_with_the_like_makes_it_the_motions_doing():
    plain = runs()
    again = noisy(replace(swing(ROBOT, "again", seed=0, seconds=15.0, rate=250.0)), np.random.default_rng(9), 0.01)
    both = [pushed(ROBOT, run, FORCE, START, STOP) for run in (plain[0], again)]
    observations = observed([*both, *plain[1:]])
    assert find_events(observations, robust_fit(observations).value) == ()


def test_a_push_does_not_repeat_what_the_model_lacks_in_a_repetition():
    plain = runs()
    again = noisy(swing(ROBOT, "again", seed=0, seconds=15.0, rate=250.0), np.random.default_rng(9), 0.01)
    observations = observed([pushed(ROBOT, plain[0], FORCE, 10.0, 11.2), again, *plain[1:]])
    value = robust_fit(observations).value
    # Viscous friction that is wrong leaves in the repetition what the push leaves on both joints.
    places = [observations.model.names.index(name) for name in ("a11", "a12")]
    value[places] += -0.12, 0.05
    assert [event.recording for event in find_events(observations, value)] == ["swing0"]


def test_each_joint_has_its_own_size_the_largest_first():
    """`0.597 N m on wrist_1_joint and elbow_joint` was said of 16 N m on the elbow."""
    one = Event("a", 1.0, 2.0, ("joint1", "joint2"), 0.597, "push", 3.0, sizes=(0.597, 16.0))
    assert one.sentence(ROBOT).startswith(
        "a: push from 1.00 to 2.00 s, 16 N m on joint2, 0.597 N m on joint1; left out"
    )
    assert one.entry["rms_by_joint"] == {"joint1": 0.597, "joint2": 16.0}
    known = replace(one, sizes=())
    assert ", 0.597 N m on joint1 and joint2; left out" in known.sentence(ROBOT)
    assert "rms_by_joint" not in known.entry


def test_of_a_recording_explained_worse_for_no_known_reason_none_is_given():
    whole = Event("run", 0.0, 12.0, ("joint1",), 0.5, "unknown", held_out=True)
    assert whole.sentence(ROBOT) == "run is explained much worse than the fitted recordings: 0.5 N m on joint1"
    lost = replace(whole, joints=("joint1", "joint2"), sizes=(0.5, 3.0), beyond=("joint2",)).sentence(ROBOT)
    assert lost.endswith("0.5 N m on joint1; more than the torque itself on joint2: the model does not hold there")
    unsure = replace(whole, kind="parameters unsure").sentence(ROBOT)
    assert unsure.startswith("run is explained much worse than the fitted recordings (parameters unsure): ")


def test_of_very_many_events_the_strongest_are_said():
    scores = np.random.default_rng(0).permutation(MAX_SENTENCES + 5)
    events = [
        Event("a", float(k), k + 0.5, ("joint1",), 1.0, "unknown", float(score)) for k, score in enumerate(scores)
    ]
    notes = event_notes(ROBOT, events)
    assert len(notes) == MAX_SENTENCES + 1
    assert notes[:-1] == [event.sentence(ROBOT) for event in events if event.score >= 5.0]
    assert notes[-1] == "5 more events are listed in the result"
    assert event_notes(ROBOT, events[:2]) == [event.sentence(ROBOT) for event in events[:2]]
    assert event_notes(ROBOT, []) == []


def test_an_arm_of_a_single_joint_has_events_too(tmp_path: Path):
    """Pinocchio gives its Jacobian as a vector: it ended in an internal error."""
    urdf = Path(__file__).parents[2] / "urdf" / "scara03.urdf"
    (tmp_path / "robot.yaml").write_text(
        f"urdf: {urdf}\neffort_side: motor\njoints: {{joint1: {{reduction: 100}}}}\nlocked: {{joint2: 0.3}}\n",
        encoding="utf-8",
    )
    robot, rng = load_robot(tmp_path / "robot.yaml"), np.random.default_rng(5)
    plain = [noisy(swing(robot, f"swing{k}", seed=k, seconds=15.0, rate=250.0), rng, 0.01) for k in range(4)]
    assert plain[0].effort is not None
    effort = plain[0].effort.copy()
    effort[0, (plain[0].time > START) & (plain[0].time < STOP)] += 0.3
    observations = observe(
        build_model(robot, "complete"), prepare([replace(plain[0], effort=effort), *plain[1:]], (8.0,))
    )
    (event,) = find_events(observations, robust_fit(observations).value)
    assert (event.recording, event.joints) == ("swing0", ("joint1",))
    assert event.start == pytest.approx(START, abs=0.15)


def test_of_recordings_shorter_than_two_bins_there_is_none():
    whole = swing(ROBOT, "short", seed=1, seconds=2.0, rate=1000.0)
    short = replace(
        whole, time=whole.time[900:970], position=whole.position[:, 900:970], effort=whole.effort[:, 900:970]
    )
    observations = observe(build_model(ROBOT, "basic"), prepare([short], (None, None)))
    assert find_events(observations, robust_fit(observations).value) == ()
