"""Efforts without their sign, and those that have one sign since the joint is loaded from one side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.errors import RecordingError
from scara_ident.estimation.observations import Observations, observe
from scara_ident.identification import magnitude_check
from scara_ident.identification.channel_check import channel_faults
from scara_ident.identification.identify import identify
from scara_ident.identification.magnitude_check import signed_fits, unsigned_efforts
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, SWING_FRICTION, noisy, recorded_torque, recording, swing, write_urdf

# An upright axis, whose effort is friction and inertia, and one whose link hangs and swings to both sides.
ARM = (replace(PLANAR_2R[0], axis=(0.0, 0.0, 1.0)), replace(PLANAR_2R[1], com=(0.0, 0.0, -0.12)))


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return load_robot(write_urdf(tmp_path / "arm.urdf", ARM))


def runs(robot: Robot) -> list[Recording]:
    return [noisy(swing(robot, f"s{seed}_1", seed, 12.0, 200.0), np.random.default_rng(seed), 0.02) for seed in (1, 2)]


def unsigned(run: Recording, *joints: int, sign: float = 1.0) -> Recording:
    assert run.effort is not None
    effort = run.effort.copy()
    effort[list(joints)] = sign * np.abs(effort[list(joints)])
    return replace(run, effort=effort)


def seen(robot: Robot, recordings: list[Recording]) -> Observations:
    return observe(build_model(robot, "complete"), prepare(recordings, (8.0, 8.0)))


@pytest.mark.parametrize(("joints", "sign"), [((0,), 1.0), ((1,), 1.0), ((0, 1), 1.0), ((0,), -1.0)])
def test_magnitudes_are_reported_by_joint(robot: Robot, joints: tuple[int, ...], sign: float) -> None:
    (fault,) = channel_faults(seen(robot, [unsigned(run, *joints, sign=sign) for run in runs(robot)]))
    assert fault.unsigned
    assert fault.joints == tuple(robot.joints[j] for j in joints)
    assert "log the effort with its sign" in str(fault)


def test_nothing_is_said_of_efforts_with_signs(robot: Robot) -> None:
    observations = seen(robot, runs(robot))
    assert signed_fits(observations) == {}
    assert channel_faults(observations) == ()


@pytest.mark.parametrize("load", [1.0, 0.0])
def test_one_sign_of_a_load_is_no_magnitude(robot: Robot, load: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A weight, or an offset, keeps the effort's sign; friction shows where the joint turns round."""
    loaded = []
    for run in runs(robot):
        assert run.effort is not None
        # To zero at the least, or far from it.
        effort = (
            run.effort - np.min(run.effort, axis=1, keepdims=True) + load * np.ptp(run.effort, axis=1, keepdims=True)
        )
        loaded.append(replace(run, effort=effort))
    # One recording's offset each: of two, what they differ by would be left.
    for run in loaded:
        observations = seen(robot, [run])
        # What is explained is not searched; were it, signs would explain it no better.
        assert signed_fits(observations) == {}
        with monkeypatch.context() as patched:
            patched.setattr(magnitude_check, "MIN_UNEXPLAINED", 0.0)
            assert list(signed_fits(observations)) == [0, 1]
            assert channel_faults(observations) == ()


def test_magnitudes_are_reported_where_they_leave_no_band(robot: Robot) -> None:
    """`identify` went on where no motion explained the torque at any frequency, at 0.6 Hz and with few rows."""
    wrong = [unsigned(run, 0) for run in runs(robot)]
    narrow = observe(build_model(robot, "basic"), prepare(wrong, (0.3, 0.3)))
    (fault,) = channel_faults(narrow)
    assert fault.unsigned
    assert fault.joints == ("j1",)
    # A second of them says nothing, and is not refused.
    short = [
        replace(run, time=run.time[:200], position=run.position[:, :200], effort=run.effort[:, :200]) for run in wrong
    ]
    assert not any(item.unsigned for item in channel_faults(seen(robot, short[:1])))


def standing(robot: Robot, seed: int, pushed: float) -> Recording:
    """Eight seconds of an arm that moves for two of them and sways a little, and that is pushed four times, N m."""
    rng, time = np.random.default_rng(seed), np.arange(800) / 100.0
    stroke = np.sin(np.pi * np.clip(time - 3.0, 0.0, 2.0)) ** 3
    q = np.array([[0.5], [0.8]]) * stroke + 4e-4 * np.sin(2.0 * np.pi * np.array([[3.1], [2.3]]) * time)
    v = np.gradient(q, 0.01, axis=1)
    effort = recorded_torque(robot, q, v, np.gradient(v, 0.01, axis=1), SWING_FRICTION)
    for _ in range(4):
        size = pushed * rng.standard_normal((2, 1))
        effort += size * np.exp(-0.5 * ((time - rng.uniform(0.0, 8.0)) / rng.uniform(0.1, 0.8)) ** 2)
    return recording(robot, "s_1", time, q, effort)


@pytest.mark.parametrize("seed", [11, 27])
def test_signs_that_few_samples_are_fitted_with_are_not_believed(robot: Robot, seed: int) -> None:
    """Signs and parameters met pushes of a joint that is loaded from one side: 60 % less was left of the fit, and it was refused."""
    run = standing(robot, seed, 1.5)
    assert run.effort is not None
    load = 1.001 * np.min(run.effort, axis=1, keepdims=True)
    observations = seen_basic(robot, replace(run, effort=run.effort - load))
    assert any(tried.left < 0.5 * tried.plain for tried in signed_fits(observations).values())
    assert unsigned_efforts(observations) == {}
    # What moves for as short a time and has no sign is told.
    (fault,) = channel_faults(seen_basic(robot, unsigned(standing(robot, seed, 0.0), 0, 1)))
    assert fault.unsigned
    assert fault.mended < 0.1 < fault.error


def seen_basic(robot: Robot, run: Recording) -> Observations:
    return observe(build_model(robot, "basic"), prepare([run], (8.0, 8.0)))


def test_an_offset_is_no_friction_without_its_sign(robot: Robot) -> None:
    """Of a model without offset, of which the friction's magnitude takes its place."""
    still = [replace(run, effort=np.full_like(run.effort, 2.0)) for run in runs(robot) if run.effort is not None]
    observations = observe(build_model(robot, "reduced"), prepare(still, (8.0, 8.0)))
    assert signed_fits(observations)[0].left < 0.1
    assert unsigned_efforts(observations) == {}


def test_both_refuse_magnitudes(robot: Robot) -> None:
    wrong = [unsigned(run, 0) for run in runs(robot)]
    for ask in (identify, diagnose):
        with pytest.raises(RecordingError, match=r"effort of j1 seems to be logged without its sign") as caught:
            ask(robot, wrong)
        assert "\n" not in str(caught.value)
