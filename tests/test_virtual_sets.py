"""Random sets of recordings: the same for the same seed, within limits, and under the conditions that are asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.errors import UsageError
from scara_ident.recording.recording import read_recordings
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import virtual_arm
from tests.arms import Link, ur5, write_urdf

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def sets(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return pytest.importorskip("virtual_sets", reason="benchmarks are not part of an installed package")


def small(sets: ModuleType, **asked: object) -> object:
    return sets.Asked(**{"rate": 250.0, "recordings": 2, "motions": 1, "duration": (5.0, 5.5), **asked})


def test_a_gripper_is_left_out_but_of_a_robot_that_is_one(sets: ModuleType) -> None:
    assert sets.arm_joints(load_robot("panda")) == [f"panda_joint{k}" for k in range(1, 8)]
    assert len(sets.arm_joints(load_robot("finger_edu"))) == 3


@pytest.mark.parametrize("kind", ["fourier", "points", "sweep"])
@pytest.mark.parametrize("name", ["ur5", "panda", "scara03"])
def test_motions_keep_all_limits_and_are_their_own_derivatives(sets: ModuleType, kind: str, name: str) -> None:
    import virtual_motions

    arm = virtual_arm(None if name == "scara03" else load_robot(name))
    robot = arm.robot
    motion = virtual_motions.random_motion("M", arm, kind, 8.0, np.random.default_rng(4))
    assert np.all(motion.position >= robot.lower[:, None])
    assert np.all(motion.position <= robot.upper[:, None])
    assert np.all(np.abs(motion.velocity) <= robot.velocity_limit[:, None])
    assert np.all(np.ptp(motion.position, axis=1) > 0.03 * np.minimum(robot.upper - robot.lower, 3.0))
    for ends in (motion.velocity[:, [0, -1]], motion.acceleration[:, [0, -1]]):
        np.testing.assert_allclose(ends, 0.0, atol=1e-9)
    # Trapezoidal sums: their error is h^2 / 12 times the range of what comes next.
    for value, slope in ((motion.position, motion.velocity), (motion.velocity, motion.acceleration)):
        step = np.diff(motion.time) * 0.5 * (slope[:, 1:] + slope[:, :-1])
        np.testing.assert_allclose(value[:, 1:] - value[:, :1], np.cumsum(step, axis=1), atol=2e-4)


def test_an_arm_of_one_joint_has_every_effect_that_needs_no_other(sets: ModuleType, tmp_path: Path) -> None:
    """A pair with a torque scale, and one alone, ended the run, as a tilt of a lift did, whose torque has nothing of it."""
    lift = Link("prismatic", axis=(0.0, 0.0, 1.0), mass=2.0)
    path = str(write_urdf(tmp_path / "lift.urdf", [lift]))
    arm = virtual_arm(load_robot(path))
    for kind in sorted(set(sets.KINDS)):
        for seed in range(8 if kind in sets.SEVERAL else 1):
            draw = np.random.default_rng(seed)
            if kind in sets.OF_TWO_JOINTS:
                with pytest.raises(UsageError, match="has one joint; it needs two"):
                    sets.pick_effects(kind, arm, draw)
            else:
                effects, _ = sets.pick_effects(kind, arm, draw)
                assert not {effect.name for effect in effects} & {*sets.OF_TWO_JOINTS}
    import attribution_truth

    tilted = sets.simulate_set("base_tilt", 3, path, tmp_path / "set", small(sets))
    result = diagnose(tilted.robot, tilted.training, validation=tilted.held_out, catalogue=())
    assert attribution_truth.true_model_error(result, tilted) is None
    assert attribution_truth.one_set("torque_gain_mismatch", 3, path, small(sets), 60).endswith("it needs two")


def test_a_set_is_the_same_for_the_same_seed_and_is_read_as_it_was_made(sets: ModuleType, tmp_path: Path) -> None:
    asked = small(sets, varied=True)
    one, same = (sets.simulate_set("pair", 17, "ur5", tmp_path / name, asked) for name in ("one", "same"))
    other = sets.simulate_set("pair", 18, "ur5", tmp_path / "other", asked)
    assert one.truth() == same.truth()
    np.testing.assert_array_equal(one.training[0].effort, same.training[0].effort)
    assert one.truth()["effects"] != other.truth()["effects"]
    sets.write_set(one, tmp_path / "one")
    described = tmp_path / "one" / "robot.yaml"
    robot = load_robot(described)
    read = read_recordings([tmp_path / "one" / "train"], robot)
    assert [item.name for item in read] == sorted(item.name for item in one.training)
    np.testing.assert_allclose(read[0].effort, one.training[0].effort, atol=1e-9)
    told = json.loads((tmp_path / "one" / "truth.json").read_text(encoding="utf-8"))
    assert [run["recording"] for run in told["runs"]] == [item.name for item in (*one.training, *one.held_out)]


def test_what_is_asked_for_leaves_the_other_draws_as_they_are(sets: ModuleType, tmp_path: Path) -> None:
    drawn = sets.simulate_set("none", 5, "scara03", tmp_path, small(sets, bits=20))
    coarse = sets.simulate_set("none", 5, "scara03", tmp_path, small(sets, bits=17))
    for name in ("bodies", "rotor_inertia", "friction"):
        np.testing.assert_array_equal(getattr(drawn.arm, name), getattr(coarse.arm, name))
    assert replace(drawn.conditions, bits=17) == coarse.conditions
    np.testing.assert_allclose(drawn.arm.encoder_resolution, 2 * np.pi / 2**20)
    np.testing.assert_allclose(coarse.arm.encoder_resolution, 2 * np.pi / 2**17)


def test_a_stated_rotor_is_the_arms_and_one_that_is_not_is_unknown(sets: ModuleType, tmp_path: Path) -> None:
    stated = sets.simulate_set("none", 5, "panda", tmp_path / "a", small(sets, stated=True, recordings=1))
    silent = sets.simulate_set("none", 5, "panda", tmp_path / "b", small(sets, stated=False, recordings=1))
    np.testing.assert_array_equal(stated.robot.rotor_inertia, stated.arm.rotor_inertia)
    assert np.all(silent.robot.rotor_inertia == 0.0)
    assert stated.robot.joints == silent.robot.joints == tuple(f"panda_joint{k}" for k in range(1, 8))
    np.testing.assert_array_equal(silent.robot.reduction, 1.0)


def test_runs_differ_only_where_they_are_said_to(sets: ModuleType, tmp_path: Path) -> None:
    varied = sets.simulate_set("none", 5, "scara03", tmp_path, small(sets, varied=True)).truth()
    steady = sets.simulate_set("none", 5, "scara03", tmp_path, small(sets, varied=False)).truth()
    assert all(run["friction"] == [1.0, 1.0] and run["delay"] == 0.0 for run in steady["runs"])
    size = varied["conditions"]["variation"]
    for run in varied["runs"]:
        assert np.all(np.abs(np.array(run["friction"]) - 1.0) <= size["friction"])
        assert np.all(np.abs(np.array(run["torque_scale"]) - 1.0) <= size["scale"])
        assert 0.0 <= run["delay"] <= size["delay"]


@pytest.mark.parametrize("robot", ["scara03", "ur5"])
def test_events_change_no_other_draw_and_are_reported(sets: ModuleType, tmp_path: Path, robot: str) -> None:
    plain, met = (
        sets.simulate_set("none", 7, robot, tmp_path / str(events), small(sets, recordings=3, events=events))
        for events in (False, True)
    )
    was = met.truth()
    events = was.pop("events")
    assert was == plain.truth()
    assert events
    touched = {event["recording"] for event in events}
    for one, other in zip((*plain.training, *plain.held_out), (*met.training, *met.held_out), strict=True):
        assert (one.name in touched) != np.array_equal(one.effort, other.effort)
    for event in events:
        (recording,) = [each for each in (*met.training, *met.held_out) if each.name == event["recording"]]
        (before,) = [each for each in (*plain.training, *plain.held_out) if each.name == event["recording"]]
        assert 0.0 <= event["from"] < event["to"] <= recording.time[-1]
        changed = np.abs(recording.effort - before.effort)
        first = recording.time[np.flatnonzero(changed.max(axis=0) > 0.0)[0]]
        assert first >= min(each["from"] for each in events if each["recording"] == recording.name) - 0.01
        assert max(event["rms"].values()) > 0.0
        if event["kind"] == "push":
            assert 5.0 <= event["parameters"]["force"] <= 30.0


def test_the_torque_of_an_event_is_what_the_closed_loop_gives(sets: ModuleType, tmp_path: Path) -> None:
    import virtual_events

    from scara_ident.simulation import ideal, simulate
    from tests.simulation.made import left_over, swing

    arm = ideal(virtual_arm(ur5()))
    rng = np.random.default_rng(5)
    motion = swing(arm.robot, 4.0, 0.2)
    kinds = set()
    for events in virtual_events.draw_events(rng, arm, [motion] * 6):
        for effect in events:
            if effect.name in kinds:
                continue
            kinds.add(effect.name)
            result = simulate(arm, motion, effects=[effect])
            told = virtual_events.event_truth(arm, effect, result, "swing")
            time = result.recording.time
            inside = (time >= told["from"]) & (time <= told["to"])
            extra = left_over(arm, result.true)[:, inside]
            rms = np.sqrt(np.nanmean(extra**2, axis=1))
            # The edges of a push are counted with its full force.
            np.testing.assert_allclose(list(told["rms"].values()), rms, rtol=0.15, atol=0.05)
    assert "push" in kinds


def test_an_arm_that_its_controller_shakes_gets_a_slower_one(sets: ModuleType) -> None:
    import virtual_motions

    arm = virtual_arm(load_robot("panda"))
    motion = virtual_motions.random_motion("M", arm, "sweep", 4.0, np.random.default_rng(4))
    tried = []

    def record(arm: object) -> str:
        tried.append(arm.controller.derivative[0])
        virtual_motions.refuse_shaking(motion, (1.5 if len(tried) > 2 else 40.0) * motion.acceleration)
        return "recorded"

    held, recorded = sets.under_control(arm, record)
    assert recorded == "recorded"
    assert tried == pytest.approx([arm.controller.derivative[0] * sets.SLOWER**k for k in range(3)])
    assert held.controller.derivative[0] == tried[-1]


def test_positions_scatter_by_whole_steps_where_that_is_asked_for(sets: ModuleType, tmp_path: Path) -> None:
    plain, noisy = (
        sets.simulate_set("none", 21, "scara03", tmp_path, small(sets, bits=16, scatter=scatter))
        for scatter in (0.0, 1.5)
    )
    resolution = plain.arm.encoder_resolution[:, None]
    for one, other in zip(plain.training, noisy.training, strict=True):
        np.testing.assert_array_equal(one.effort, other.effort)
        steps = (other.position - one.position) / resolution
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
        # Rounding adds a twelfth.
        assert np.std(np.rint(steps)) == pytest.approx(np.sqrt(1.5**2 + 1.0 / 12.0), rel=0.05)
    assert noisy.truth()["conditions"]["scatter"] == 1.5
