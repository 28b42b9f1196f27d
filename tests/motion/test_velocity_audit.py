"""The audit of a recorded velocity against the differentiated position."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from scara_ident.motion.motion import stretches
from scara_ident.motion.velocity_audit import VelocityAudit, audit_velocity, velocity_remarks
from scara_ident.recording.audit.samples import Finding
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import recording, sines

RATE = 1000.0


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def truthful(robot: Robot) -> Recording:
    time = np.arange(8000) / RATE
    rng = np.random.default_rng(0)
    q, v, _ = sines(rng, time, 2)
    count = 2 * np.pi / 409600
    noisy = v + 1e-3 * rng.standard_normal(v.shape)
    return recording(robot, "run_1", time, count * np.rint(q / count), None, velocity=noisy)


def audits(item: Recording) -> tuple[VelocityAudit, ...]:
    return audit_velocity(item, stretches(item)[0])


def verdicts(item: Recording) -> list[str | None]:
    return [audit.verdict(RATE) for audit in audits(item)]


def test_a_good_velocity_is_silent(truthful: Recording):
    assert verdicts(truthful) == [None, None]
    for audit in audits(truthful):
        assert audit.gain == pytest.approx(1.0, abs=2e-3)
        assert abs(audit.lag) < 2e-4


def test_the_lag_of_a_first_order_filter_is_found(truthful: Recording):
    constant = 0.005
    share = 1 / (RATE * constant)
    assert truthful.velocity is not None
    late = lfilter([share], [1.0, share - 1.0], truthful.velocity, axis=1)
    found = audits(replace(truthful, velocity=late))
    for audit in found:
        # Sampled, it lags a sample less than its time constant.
        assert audit.lag == pytest.approx(constant - 1 / RATE, rel=0.05)
        verdict = audit.verdict(RATE)
        assert verdict is not None
        assert "lags the position" in verdict
        assert "filter" in verdict


def test_a_lead_is_called_a_lead(truthful: Recording):
    assert truthful.velocity is not None
    early = np.roll(truthful.velocity, -4, axis=1)
    early[:, -4:] = early[:, -5:-4]
    assert all("leads the position by 4 ms" in str(verdict) for verdict in verdicts(replace(truthful, velocity=early)))


def test_degrees_are_recognised(truthful: Recording):
    assert truthful.velocity is not None
    assert all(
        "degrees" in str(verdict) for verdict in verdicts(replace(truthful, velocity=np.degrees(truthful.velocity)))
    )


@pytest.mark.parametrize("gain", [-1.0, 0.5, 100.0])
def test_another_unit_or_sign_is_said_with_its_factor(truthful: Recording, gain: float):
    assert truthful.velocity is not None
    for verdict in verdicts(replace(truthful, velocity=gain * truthful.velocity)):
        assert verdict is not None
        assert f"{gain:.3g}"[:3] in verdict
        assert "degrees" not in verdict


@pytest.mark.parametrize(
    ("gains", "asked"),
    [((3.0, 3.0), True), ((1 / 60, 1 / 60), True), ((3.0, 1.0), False), ((3.0, 2.0), False), ((-1.0, -1.0), False)],
)
def test_a_factor_that_all_joints_share_may_be_that_of_time(
    truthful: Recording, gains: tuple[float, float], asked: bool
):
    """A log of 6 ms that was written at 2 ms had velocities of 2.996 to 3.001 times the slope, and only they were doubted."""
    assert truthful.velocity is not None
    found = audits(replace(truthful, velocity=np.array(gains)[:, None] * truthful.velocity))
    (names, remark), *_ = velocity_remarks([("a", RATE, found), ("b", RATE, found)])
    assert names == ["a", "b"]
    assert remark.startswith("recorded velocity of joint1")
    assert remark.endswith("on every joint: is the unit or rate of time wrong, or the unit of velocity?") is asked


def test_where_one_joint_moves_its_factor_may_be_that_of_time(truthful: Recording):
    assert truthful.velocity is not None
    found = audits(replace(truthful, velocity=3.0 * truthful.velocity))[:1]
    ((_, remark),) = velocity_remarks([("a", RATE, found)])
    assert remark.endswith(
        "times the derivative of the position: is the unit or rate of time wrong, or the unit of velocity?"
    )


def test_an_unrelated_signal_is_found(truthful: Recording):
    assert truthful.velocity is not None
    mixed = truthful.velocity.copy()
    mixed[1] = np.sin(9.0 * truthful.time)
    first, second = verdicts(replace(truthful, velocity=mixed))
    assert first is None
    assert second is not None
    assert "not the derivative of the position" in second


def test_swapped_joints_are_found(truthful: Recording):
    assert truthful.velocity is not None
    assert None not in verdicts(replace(truthful, velocity=truthful.velocity[::-1].copy()))


def test_a_dead_velocity_of_a_moving_joint_is_found(truthful: Recording):
    assert truthful.velocity is not None
    dead = truthful.velocity.copy()
    dead[0] = 0.0
    found = {audit.joint: audit.verdict(RATE) for audit in audits(replace(truthful, velocity=dead))}
    assert found["joint2"] is None
    assert found["joint1"] == "it is 0 while the position moves"


def test_a_joint_at_rest_is_not_judged(truthful: Recording):
    position, velocity = truthful.position.copy(), truthful.velocity.copy()
    position[0], velocity[0] = 0.7, 0.0
    assert [audit.joint for audit in audits(replace(truthful, position=position, velocity=velocity))] == ["joint2"]


def test_the_flicker_of_a_joint_that_stands_still_is_no_slope(truthful: Recording):
    """Of a joint that a servo held it was said that 100 % of its velocity is not the derivative of its position."""
    flicker = 1e-4 * np.sign(np.random.default_rng(1).standard_normal(truthful.time.shape))
    held = replace(truthful, position=np.array([truthful.position[0], flicker]))
    assert [audit.joint for audit in audits(held)] == list(truthful.joints)
    said = replace(held, findings=(Finding("idle_joint", "joint2 does not move", idle=(1,)),))
    assert [(audit.joint, audit.verdict(RATE)) for audit in audits(said)] == [("joint1", None)]


def test_without_a_recorded_velocity_there_is_nothing_to_say(truthful: Recording):
    assert audits(replace(truthful, velocity=None)) == ()
