"""Channels that are not what the mapping says: opposite signs, exchanged joints, and none of it where all is well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from scara_ident.diagnosis import diagnose
from scara_ident.errors import EstimationError, RecordingError
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import observe
from scara_ident.identification import channel_check
from scara_ident.identification.channel_check import channel_faults
from scara_ident.identification.channel_comparison import friction_pushes, relative
from scara_ident.identification.channel_fault import ChannelFault
from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.paper import OJD, OJK
from scara_ident.recording.recording import Recording
from scara_ident.report.identification import sentences
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import sampled, simulate, virtual_arm
from tests.arms import PLANAR_2R, Link, noisy, recorded_torque, recording, sines, swing, write_urdf
from tests.identification import turned_arm

BANDS = (10.0, 10.0)


@pytest.fixture(scope="module")
def recordings() -> tuple[Recording, ...]:
    arm = virtual_arm()
    return tuple(
        simulate(arm, sampled(name, arm.robot, law.motion, 12.0), seed=4, rate=500.0).recording
        for name, law in (("OJD", OJD), ("OJK", OJK))
    )


def turned(recording: Recording, *, effort: tuple[int, ...] = (), position: tuple[int, ...] = ()) -> Recording:
    assert recording.effort is not None
    force, angle = recording.effort.copy(), recording.position.copy()
    force[list(effort)] *= -1.0
    angle[list(position)] *= -1.0
    return replace(recording, effort=force, position=angle, velocity=None, acceleration=None)


def exchanged(recording: Recording, *signals: str) -> Recording:
    new = {signal: getattr(recording, signal)[::-1].copy() for signal in signals}
    return replace(recording, **new)


def faults_of(recordings: list[Recording]) -> tuple[ChannelFault, ...]:
    return channel_faults(observe(build_model(virtual_arm().robot, "complete"), prepare(recordings, BANDS)))


def found(recordings: list[Recording]) -> list[tuple[str, tuple[str, ...], bool]]:
    return [(fault.signal, fault.joints, fault.exchanged) for fault in faults_of(recordings)]


@pytest.mark.slow
def test_nothing_is_said_of_channels_that_are_right(recordings: tuple[Recording, ...]) -> None:
    assert found(list(recordings)) == []


@pytest.mark.parametrize("joint", [0, 1])
def test_an_effort_of_opposite_sign(recordings: tuple[Recording, ...], joint: int) -> None:
    wrong = [turned(item, effort=(joint,)) for item in recordings]
    assert found(wrong) == [("effort", (f"joint{joint + 1}",), False)]


def test_a_position_of_opposite_sign(recordings: tuple[Recording, ...]) -> None:
    assert found([turned(item, position=(1,)) for item in recordings]) == [("position", ("joint2",), False)]


def test_an_axis_of_opposite_sign(recordings: tuple[Recording, ...]) -> None:
    # To turn joint 1 round or joint 2 is the same for an arm that may be seen in a mirror.
    faults = found([turned(item, effort=(1,), position=(1,)) for item in recordings])
    assert [(signal, swap) for signal, _, swap in faults] == [("effort and position", False)]


def test_all_efforts_of_opposite_sign(recordings: tuple[Recording, ...]) -> None:
    assert found([turned(item, effort=(0, 1)) for item in recordings]) == [("effort", ("joint1", "joint2"), False)]


@pytest.mark.parametrize("seconds", [20.0, 2.0])
def test_all_efforts_of_opposite_sign_where_friction_shows_on_one_joint(tmp_path: Path, seconds: float) -> None:
    """As of a robot that reports what its links do to the drives: gravity is the URDF's the other way round."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    rng, time = np.random.default_rng(1), np.arange(round(200.0 * seconds)) / 200.0
    q, v, a = sines(rng, time, 2)
    bodies = recorded_torque(robot, q, v, a, ((0.0,) * 5,) * 2)
    friction = np.array([[1.0], [0.0]]) * np.sign(v)
    model = build_model(robot, "basic")
    # The last: gravity of another direction, as of an arm that hangs where the URDF has it stand.
    for effort, said in ((bodies + friction, []), (-bodies - friction, [("j1", "j2")]), (friction - bodies, [])):
        run = noisy(recording(robot, "run_1", time, q, effort), rng, 0.02)
        assert [fault.joints for fault in channel_faults(observe(model, prepare([run], (8.0, 8.0))))] == said


# An upright axis and two that lie.
ARM = (
    Link(axis=(0.0, 0.0, 1.0), mass=4.0, com=(0.05, 0.0, 0.1)),
    *(replace(link, xyz=(0.0, 0.0, 0.3) if k == 0 else link.xyz) for k, link in enumerate(PLANAR_2R)),
)


def lightly_braked(folder: Path, gain: float, gravity: float = -9.81) -> tuple[Robot, Recording]:
    """Return an arm and a recording of sensors at its links, which see no friction."""
    robot = load_robot(write_urdf(folder / "arm.urdf", ARM))
    true = load_robot(write_urdf(folder / "true.urdf", ARM))
    true.model.gravity.linear = np.array([0.0, 0.0, gravity])
    rng, time = np.random.default_rng(5), np.arange(4000) / 200.0
    q, v, a = sines(rng, time, 3)
    effort = gain * recorded_torque(true, q, v, a, ((0.0,) * 5,) * 3)
    return robot, noisy(recording(robot, "run_1", time, q, effort), rng, 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_an_effort_of_opposite_sign_shows_where_friction_is_slight(tmp_path: Path, joint: int) -> None:
    """By what is left unexplained alone, in a band that the wrong sign has left narrow too."""
    robot, run = lightly_braked(tmp_path, 1.0)
    wrong, model = turned(run, effort=(joint,)), build_model(robot, "basic")
    for bands in ((8.0,) * 3, tuple(0.8 if j == joint else 8.0 for j in range(3))):
        seen = observe(model, prepare([wrong], bands))
        assert not np.any(friction_pushes(weighted_value(seen.by_joint), seen))
        (fault,) = channel_faults(seen)
        assert (fault.signal, fault.joints, fault.exchanged) == ("effort", (robot.joints[joint],), False)
        assert fault.mended < 0.1 < fault.error
    with pytest.raises(RecordingError, match=f"negate effort_gain of {robot.joints[joint]} in"):
        diagnose(robot, [wrong], model="basic")
    found = identify(robot, [wrong], model="basic")
    assert [fault.joints for fault in found.channels] == [(robot.joints[joint],)]
    assert not any("ravity" in said.split("determine a common scale")[0] for said in sentences(found))


def test_all_efforts_of_opposite_sign_are_recognised_by_gravity_and_inertia(tmp_path: Path) -> None:
    robot, run = lightly_braked(tmp_path, -1.0)
    with pytest.raises(RecordingError, match=r"negate effort_gain of all .*\(effort_gain: -1"):
        diagnose(robot, [run], model="basic")
    for method in ("wls", "consistent"):
        try:
            (fault,) = identify(robot, [run], model="basic", method=method).channels
        except EstimationError as error:
            # Not what the solver says of an arm that cannot exist.
            assert method == "consistent"
            assert "effort_gain: -1" in str(error)
        else:
            assert fault.by_bodies
            assert fault.joints == robot.joints


@pytest.mark.parametrize(("gain", "gravity"), [(1.0, -9.81), (1.0, 9.81), (1.0, 0.0), (0.3, -9.81), (-1.0, 9.81)])
def test_nothing_is_said_of_gravity_that_is_elsewhere(tmp_path: Path, gain: float, gravity: float) -> None:
    """Nor of an arm that hangs, whose inertia is the right way round, nor of one that hangs with efforts of opposite sign."""
    robot, run = lightly_braked(tmp_path, gain, gravity)
    assert channel_faults(observe(build_model(robot, "basic"), prepare([run], (8.0,) * 3))) == ()


@pytest.mark.parametrize("signals", [("effort",), ("position",), ("effort", "position")])
def test_exchanged_joints(recordings: tuple[Recording, ...], signals: tuple[str, ...]) -> None:
    faults = found([exchanged(item, *signals) for item in recordings])
    assert faults == [(" and ".join(signals), ("joint1", "joint2"), True)]


def test_an_exchange_shows_where_one_torque_is_large_beside_the_other(tmp_path: Path) -> None:
    """The shoulder that carries all is explained at once by the other's motion, to a quarter."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [PLANAR_2R[0], replace(PLANAR_2R[1], mass=0.3)]))
    runs = [noisy(swing(robot, f"s{seed}_1", seed, 12.0, 200.0), np.random.default_rng(seed), 0.02) for seed in (1, 2)]
    seen = observe(build_model(robot, "basic"), prepare([exchanged(run, "effort") for run in runs], (8.0, 8.0)))
    errors = relative(weighted_value(seen.by_joint), seen)
    assert np.min(errors) < 0.3 < np.max(errors)
    assert [(fault.signal, fault.exchanged) for fault in channel_faults(seen)] == [("effort", True)]


def test_two_faults_at_once(recordings: tuple[Recording, ...]) -> None:
    faults = found([turned(exchanged(item, "effort"), effort=(0,)) for item in recordings])
    assert len(faults) == 2
    assert ("effort", ("joint1", "joint2"), True) in faults


def test_diagnose_refuses_and_identify_says_it(
    recordings: tuple[Recording, ...], caplog: pytest.LogCaptureFixture
) -> None:
    wrong = [turned(item, effort=(1,)) for item in recordings]
    robot = virtual_arm().robot
    with pytest.raises(RecordingError, match=r"negate effort_gain of joint2 in robot\.yaml") as caught:
        diagnose(robot, wrong)
    assert "\n" not in str(caught.value)
    with caplog.at_level("WARNING", logger="scara_ident"):
        result = identify(robot, wrong)
    assert [fault.joints for fault in result.channels] == [("joint2",)]
    # Who calls from Python is told as of notes; where it is printed see `tests/report/test_doubts.py`.
    assert str(result.channels[0]) in caplog.messages


@pytest.mark.slow
@pytest.mark.parametrize("signals", [("effort",), ("position",), ("effort", "position")])
def test_both_refuse_exchanged_joints(recordings: tuple[Recording, ...], signals: tuple[str, ...]) -> None:
    wrong = [exchanged(item, *signals) for item in recordings]
    for ask in (identify, diagnose):
        with pytest.raises(RecordingError, match=r"joint1 and joint2 look exchanged.*; exchange their columns"):
            ask(virtual_arm().robot, wrong)


def wandering(recording: Recording, share: float, seed: int) -> Recording:
    """Six seconds with efforts that wander by a share of their scatter within a second or so."""
    assert recording.effort is not None
    kept = 3000
    steps = np.random.default_rng(seed).standard_normal(recording.effort.shape)
    effort = (
        recording.effort + share * np.std(recording.effort, axis=1, keepdims=True) * np.cumsum(steps, axis=1) / 30.0
    )
    return replace(
        recording,
        time=recording.time[:kept],
        position=recording.position[:, :kept],
        effort=effort[:, :kept],
        velocity=None,
        acceleration=None,
    )


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_fits_that_interpolate_are_not_compared(recordings: tuple[Recording, ...], share: float) -> None:
    """Ten rows a joint for nine parameters of its own: one reading or another always fits far better, by chance."""
    model = build_model(virtual_arm().robot, "complete")
    for seed in range(6):
        item = wandering(recordings[seed % 2], share, seed)
        seen = observe(model, prepare([item], (1.0, 1.0)))
        assert seen.joints[0].table.shape[1] < 12
        assert channel_faults(seen) == ()


def test_an_exchange_shows_in_a_short_recording_of_enough_rows(recordings: tuple[Recording, ...]) -> None:
    short = wandering(exchanged(recordings[1], "effort"), 0.0, 0)
    faults = channel_faults(observe(build_model(virtual_arm().robot, "complete"), prepare([short], (6.0, 6.0))))
    assert [(fault.signal, fault.exchanged) for fault in faults] == [("effort", True)]


@pytest.mark.parametrize("signals", [("effort",), ("position",)])
def test_an_exchange_shows_in_a_band_that_it_left_narrow(
    recordings: tuple[Recording, ...], signals: tuple[str, ...]
) -> None:
    """A few rows a parameter in the chosen band, which `identify` takes joint by joint."""
    wrong = [wandering(exchanged(item, *signals), 0.0, 0) for item in recordings]
    faults = channel_faults(observe(build_model(virtual_arm().robot, "complete"), prepare(wrong, (1.0, 1.0))))
    assert [(fault.signal, fault.exchanged) for fault in faults] == [(" and ".join(signals), True)]


@pytest.mark.slow
def test_readings_that_leave_as_much_of_few_rows_are_not_observed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing reads a spring away; of the readings of an arm that is explained so badly nearly every one was observed."""
    robot = turned_arm.arm()
    sprung = turned_arm.seen(robot, turned_arm.runs(robot, (0,) * 4, added=np.array([8.0, 8.0, 0.0, 0.0])))
    asked: list[str] = []
    for name in ("observed_as", "observed_exchanged"):
        own = getattr(channel_check, name)
        monkeypatch.setattr(channel_check, name, lambda *given, own=own: asked.append("") or own(*given))
    assert channel_faults(sprung) == ()
    few = len(asked)
    monkeypatch.setattr(channel_check, "FEW_LESS", np.inf)
    assert channel_faults(sprung) == ()
    assert 2 * few < len(asked) - few


def test_readings_are_fitted_on_one_blas_thread(
    recordings: tuple[Recording, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[int] = []

    def asked(*_: object) -> tuple[ChannelFault, ...]:
        used.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        return ()

    monkeypatch.setattr(channel_check, "_faults", asked)
    assert faults_of(list(recordings)) == ()
    assert set(used) == {1}


def test_the_share_left_is_what_it_says(recordings: tuple[Recording, ...]) -> None:
    (fault,) = faults_of([exchanged(item, "effort") for item in recordings])
    assert fault.mended < 0.05 < 0.3 < fault.error
    assert f"{100 * fault.mended:.2g} %" in str(fault)
    assert np.isfinite(fault.error)
