"""One useless recording is left out and named; without any that is of use there is an error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.errors import RecordingError
from scara_ident.estimation.observations import kept_rows, observe
from scara_ident.identification.compare import compare
from scara_ident.identification.identify import identify, known_information
from scara_ident.identification.usable import check_rows, data_notes, usable_data, with_rows, without_copies
from scara_ident.manners import several
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.audit.samples import Finding
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import recorded_torque, recording, sines

FRICTION = ((2.0, 1.0, 0.0, 0.0, 0.1), (1.0, 0.5, 0.0, 0.0, -0.1))
RATE = 200.0


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def moving(robot: Robot, name: str, seed: int, seconds: float = 12.0) -> Recording:
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    q, v, a = sines(rng, time, robot.n)
    torque = recorded_torque(robot, q, v, a, FRICTION)
    return recording(robot, name, time, q, torque + 0.01 * rng.standard_normal(torque.shape))


def useless(robot: Robot) -> dict[str, Recording]:
    whole = moving(robot, "bad_1", 5)
    still = np.tile(np.array([[0.3], [-0.2]]), (1, len(whole.time)))
    noise = 1e-5 * np.random.default_rng(0).standard_normal(still.shape)
    part = slice(0, 60)
    return {
        "no effort was recorded": replace(whole, effort=None),
        "no four samples in a row": cut(whole, slice(0, 3)),
        "0 independent rows remain": replace(whole, position=still + noise),
        "independent rows remain without the ends": cut(whole, part),
    }


def cut(whole: Recording, part: slice) -> Recording:
    assert whole.effort is not None
    return replace(whole, time=whole.time[part], position=whole.position[:, part], effort=whole.effort[:, part])


KINDS = (
    "no effort was recorded",
    "no four samples in a row",
    "0 independent rows remain",
    "independent rows remain without the ends",
)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_useless_recording_is_left_out_with_a_note(robot: Robot, kind: str):
    good, bad = [moving(robot, "a_1", 1), moving(robot, "b_1", 2)], useless(robot)[kind]
    expected = identify(robot, good, model="basic", bands=(4.0, 4.0), validation=[moving(robot, "c_1", 3)])
    found = identify(robot, [bad, *good], model="basic", bands=(4.0, 4.0), validation=[moving(robot, "c_1", 3)])
    np.testing.assert_allclose(found.estimate.value, expected.estimate.value, rtol=1e-9)
    assert [item.name for item in found.training.each] == ["a_1", "b_1"]
    (note,) = [note for note in found.notes if kind in note]
    assert note.startswith("bad_1: ")
    assert note.endswith("left out")

    held = identify(robot, good, model="basic", bands=(4.0, 4.0), validation=[bad, moving(robot, "c_1", 3)])
    assert list(held.validation_errors()) == ["c_1"]
    assert any(kind in note for note in held.notes)
    # Nothing is left of what somebody asked for: it was a note, and the result said that nothing had been held out.
    for work in (identify, diagnose):
        with pytest.raises(RecordingError, match=kind):
            work(robot, good, model="basic", bands=(4.0, 4.0), validation=[bad])


@pytest.mark.parametrize("kind", KINDS[:3])
def test_bands_are_chosen_beside_a_useless_recording(robot: Robot, kind: str):
    found = identify(robot, [useless(robot)[kind], moving(robot, "a_1", 1)], model="basic")
    assert [item.name for item in found.training.each] == ["a_1"]
    assert max(error.relative for error in found.training_errors()["a_1"] if error and error.relative) < 0.1


def test_one_at_rest_is_seen_in_a_band_so_wide_that_positions_are_not_filtered(robot: Robot):
    still = prepare([useless(robot)["0 independent rows remain"]], (40.0, 40.0))
    assert kept_rows(still.recordings[0]) == 0


def test_without_any_of_use_there_is_an_error(robot: Robot):
    for kind in KINDS[:2]:
        with pytest.raises(RecordingError, match=kind):
            identify(robot, [useless(robot)[kind]], model="basic")
    with pytest.raises(RecordingError, match="none of 1200 samples can be used"):
        identify(robot, [useless(robot)[KINDS[2]]], model="basic")


def test_fewer_rows_than_parameters_are_refused(robot: Robot):
    """A band of 0.3 Hz over 12 s: they would be met exactly."""
    with pytest.raises(RecordingError, match="independent rows within the bands for 11 parameters; record longer"):
        identify(robot, [moving(robot, "a_1", 1)], model="basic", bands=(0.3, 0.3))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_command_leaves_it_out(robot: Robot, kind: str):
    good, bad = [moving(robot, "a_1", 1), moving(robot, "b_1", 2)], useless(robot)[kind]
    one, bands = (moving(robot, "c_1", 3),), (4.0, 4.0)

    expected = compare(robot, good, model="basic", bands=bands)
    found = compare(robot, [bad, *good], model="basic", bands=bands)
    assert [item.name for item in found.trajectories] == ["a", "b"]
    np.testing.assert_allclose(found.errors, expected.errors, rtol=1e-9)
    assert [note.endswith("left out") for note in found.notes if kind in note] == [True]

    settled = diagnose(robot, good, model="basic", bands=bands, validation=one, catalogue=())
    other = replace(bad, position=bad.position + 1e-6)
    again = diagnose(robot, [bad, *good], model="basic", bands=bands, validation=[other, *one], catalogue=())
    np.testing.assert_allclose(again.after.value, settled.after.value, rtol=1e-9)
    assert [item.name for item in again.validation_after.each] == ["c_1"]
    assert all(note.endswith("left out") for note in again.notes if kind in note)
    assert any(kind in note for note in again.notes)

    information = known_information(build_model(robot, "basic"), [bad, *good], RATE)
    if kind != KINDS[3]:  # in the bands that are chosen, that one has rows
        assert information.rows == known_information(build_model(robot, "basic"), good, RATE).rows


def test_a_short_run_among_good_ones_is_left_out(robot: Robot):
    """In the bands that the good ones ask for, nothing of it is left between its ends."""
    good = [moving(robot, "a_1", 1), moving(robot, "b_1", 2)]
    short = cut(moving(robot, "s_1", 3), slice(0, 150))
    for bands in ((2.0, 2.0), (None, 2.0), None):
        found = identify(robot, [short, *good], model="basic", bands=bands)
        names = [item.name for item in found.training.each]
        assert names == (["s_1", "a_1", "b_1"] if bands is None else ["a_1", "b_1"])


def test_a_trajectory_that_is_too_short_alone_is_not_compared(robot: Robot):
    good = [moving(robot, "a_1", 1), moving(robot, "b_1", 2)]
    short = cut(moving(robot, "s_1", 3), slice(0, 200))
    found = compare(robot, [*good, short], model="basic", bands=(3.0, 3.0))
    assert [item.name for item in found.trajectories] == ["a", "b"]
    assert found.notes[-1].startswith("s_1: ")
    with pytest.raises(RecordingError, match=r"at least two trajectories, found 1.*s_1: .* left out"):
        compare(robot, [good[0], short], model="basic", bands=(3.0, 3.0))


def test_the_parts(robot: Robot):
    bad, good = useless(robot)["no effort was recorded"], moving(robot, "a_1", 1)
    data, notes = usable_data([bad, good])
    assert (len(data.recordings), len(notes)) == (1, 1)
    assert usable_data([])[0].recordings == ()
    with pytest.raises(RecordingError, match="no effort was recorded"):
        usable_data([bad])
    assert with_rows(data, robot, needed=True)[0] is data
    short = prepare([cut(good, slice(0, 60))], (2.0, 2.0))
    assert with_rows(short, robot, needed=True)[0] is short
    assert with_rows(short, robot, needed=False)[0].recordings == ()
    check_rows(observe(build_model(robot, "basic"), prepare([good], (4.0, 4.0))))


def velocity_notes(items: list[Recording]) -> list[str]:
    return [note for note in data_notes(prepare(items)) if "recorded velocity" in note]


def test_velocities_that_lag_by_about_as_much_are_one_line(robot: Robot):
    """By rounded numbers 6.4 and 6.5 ms were thirteen lines of one filter."""
    items = []
    for seed, lags in enumerate([(6.4e-3, 6.5e-3), (6.5e-3, 6.4e-3), (7.2e-3, 6.4e-3)]):
        item = moving(robot, f"run_{seed + 1}", seed)
        speed = np.gradient(item.position, item.time, axis=1)
        late = [np.interp(item.time - lag, item.time, own) for lag, own in zip(lags, speed, strict=True)]
        items.append(replace(item, velocity=np.array(late)))
    # The last recording's first joint alone lags otherwise, but as a filter does.
    (said,) = velocity_notes(items)
    names = "run_1, run_2, run_3: recorded velocity of joint1, joint2 is not used: it lags the position by "
    assert said == f"{names}6.4 to 7.2 ms, like the output of a filter"
    # Another joint of its own is another line.
    assert items[0].velocity is not None
    alone = replace(items[0], velocity=np.array([items[0].velocity[0], np.gradient(items[0].position[1], 1.0 / RATE)]))
    assert len(velocity_notes([alone, *items[1:]])) == 2


def test_a_recording_given_twice_counts_once(robot: Robot):
    """A copy made every standard deviation smaller by the root of two, and nothing said so."""
    first, second = moving(robot, "A_1", 1), moving(robot, "B_1", 2)
    copy = replace(first, name="A_2")
    once, twice = (
        identify(robot, given, bands=(20.0, 20.0)) for given in ([first, second], [first, second, copy, first])
    )
    np.testing.assert_array_equal(twice.estimate.value, once.estimate.value)
    np.testing.assert_array_equal(twice.estimate.std, once.estimate.std)
    assert "A_2: 100% of its samples are those of A_1; left out" in twice.notes
    assert [item.name for item in twice.training.data.recordings] == ["A_1", "B_1"]


def test_a_recording_that_holds_some_of_another_is_only_named(robot: Robot):
    first, second = moving(robot, "A_1", 1), moving(robot, "B_1", 2)
    both = {
        name: np.concatenate([getattr(second, name), getattr(first, name)[:, :600]], axis=1)
        for name in ("position", "effort")
    }
    longer = replace(second, time=np.arange(both["position"].shape[1]) / RATE, **both)
    kept, notes = without_copies([first, longer])
    assert kept == [first, longer]
    # Of 3000 windows those over the seam are nobody's.
    assert notes == ["B_1: 19% of its samples are those of A_1, so these samples count twice; give each recording once"]


def test_a_remark_on_many_recordings_is_one_line_with_the_numbers_of_the_first(robot: Robot):
    """Eight logs of a jittery recorder had twenty-four notes before the verdict."""

    def said(count: int, *messages: str) -> list[str]:
        items = [
            replace(
                moving(robot, f"run_{k + 1}", k),
                findings=tuple(Finding("jitter", text.format(k + 3)) for text in messages),
            )
            for k in range(count)
        ]
        return [note for note in data_notes(prepare(items)) if "stamps" in note]

    other = "joint1.effort has no stamps in {} rows"
    few = said(3, other)
    assert few == [f"run_{k + 1}: joint1.effort has no stamps in {k + 3} rows" for k in range(3)]
    assert said(5, other) == ["run_1 and 4 more recordings: joint1.effort has no stamps in 3 rows; numbers of run_1"]
    # Another joint is another remark, and what all have alike is said as it is.
    both = said(5, other, other.replace("joint1", "joint2"))
    assert len(both) == 2 and "joint2.effort" in both[1]
    assert said(5, "no stamps in 7 rows") == ["run_1 and 4 more recordings: no stamps in 7 rows"]


def test_a_remark_on_many_joints_is_one_line(robot: Robot):
    """Six joints and ten recordings whose angles are held within one turn had sixty notes before the verdict."""
    text = "{}.position jumps by a whole turn {}, first in row {}: unwrapped"

    def said(runs: int, joints: int) -> list[str]:
        items = []
        for k in range(runs):
            found = [
                Finding("wrapped", text.format(f"j{j}", several(k + 1, "time"), 7 * j), k + 1, joint=f"j{j}")
                for j in range(1, 1 + joints)
            ]
            items.append(replace(moving(robot, f"run_{k}", k), findings=tuple(found)))
        return [note for note in data_notes(prepare(items)) if "turn" in note]

    first = "j1.position jumps by a whole turn 1 time, first in row 7: unwrapped"
    assert said(10, 6) == [f"run_0 and 9 more recordings: {first}; so j2, j3, j4 and 2 more; numbers of j1 in run_0"]
    assert said(1, 6) == [f"run_0: {first}; so j2, j3, j4 and 2 more; numbers of j1 in run_0"]
    assert said(10, 1) == [f"run_0 and 9 more recordings: {first}; numbers of run_0"]
    # Few are said with the numbers of each.
    assert len(said(1, 3)) == 3


def test_many_recordings_without_rows_are_left_out_in_one_line(robot: Robot):
    """Thirty-six of a hundred short logs had a paragraph each before the verdict."""
    still = np.tile(np.array([[0.3], [-0.2]]), (1, 2400))
    noise = 1e-5 * np.random.default_rng(0).standard_normal((5, *still.shape))
    many = [replace(moving(robot, f"still_{k}", 5 + k), position=still + noise[k]) for k in range(5)]
    found = identify(robot, [*many, moving(robot, "a_1", 1)], model="basic", bands=(4.0, 4.0))
    (note,) = [note for note in found.notes if "independent rows remain" in note]
    assert note.startswith("still_0 and 4 more recordings: 0 independent rows") and note.endswith("left out")
