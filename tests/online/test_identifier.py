"""Sample by sample against all at once; changes named in time; a crash changes nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects.links import point_mass, tool_of
from scara_ident.errors import UsageError
from scara_ident.online import OnlineIdentifier, OnlineSettings
from scara_ident.robot.robot import load_robot
from tests.online.made import NOISE, RATE, columns, model, signals, torque, truth

SETTINGS = OnlineSettings(rate=RATE, block=32, memory=60.0)


def fed(states, effort, settings=SETTINGS) -> OnlineIdentifier:
    online = OnlineIdentifier(model(), NOISE, settings)
    online.update_block(*states, effort)
    return online


def batch(states, effort) -> np.ndarray:
    """Weighted least squares of the same rows, dense."""
    tables = []
    for j, (own, each) in enumerate(zip(model().active, columns(*states), strict=True)):
        wide = np.zeros((each.shape[1], len(model().columns) + 1))
        wide[:, own], wide[:, -1] = each.T, effort[j]
        moves = np.abs(states[1][j]) > 3e-3 * load_robot().velocity_limit[j]
        tables.append(wide[moves] / NOISE[j])
    table = np.concatenate(tables)
    return np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0]


def test_online_is_batch_on_the_same_rows():
    states = signals(3.0)
    effort = torque(states, truth())
    online = fed(states, effort, replace(SETTINGS, forgetting="none"))
    np.testing.assert_allclose(online.value, batch(states, effort), rtol=1e-9, atol=1e-12)
    assert online.samples == states[0].shape[1]


def test_one_sample_after_the_other_is_blocks_of_any_size_bit_for_bit():
    states = signals(1.0)
    effort = torque(states, truth())
    whole, single, parts = (
        fed(states, effort),
        OnlineIdentifier(model(), NOISE, SETTINGS),
        OnlineIdentifier(model(), NOISE, SETTINGS),
    )
    for k in range(effort.shape[1]):
        single.update(*(signal[:, k] for signal in states), effort[:, k])
    for start in range(0, effort.shape[1], 77):
        parts.update_block(*(signal[:, start : start + 77] for signal in (*states, effort)))
    for other in (single, parts):
        np.testing.assert_array_equal(other.value, whole.value)
        np.testing.assert_array_equal(other.std, whole.std)


def test_before_all_is_known_nothing_is_claimed():
    online = OnlineIdentifier(model(), NOISE, SETTINGS)
    assert not online.determined and np.all(np.isnan(online.value)) and np.all(np.isinf(online.std))


def test_parameters_lie_within_their_standard_deviations():
    scores = []
    for seed in range(6):
        states = signals(6.0, seed)
        online = fed(states, torque(states, truth(), seed=seed + 50))
        scores.append((online.value - truth()) / online.std)
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.3


def test_a_crash_changes_nothing(tmp_path: Path):
    states = signals(2.0)
    effort = torque(states, truth())
    whole, half = fed(states, effort), 333
    first = fed([signal[:, :half] for signal in states], effort[:, :half])
    first.save(tmp_path / "state.npz")
    second = OnlineIdentifier.restore(tmp_path / "state.npz", model())
    second.update_block(*(signal[:, half:] for signal in (*states, effort)))
    second.save(tmp_path / "again.npz")
    whole.save(tmp_path / "whole.npz")
    with np.load(tmp_path / "again.npz") as again, np.load(tmp_path / "whole.npz") as other:
        for name in other.files:
            np.testing.assert_array_equal(again[name], other[name])


def test_a_file_that_is_no_state_or_of_another_model_is_refused(tmp_path: Path):
    (tmp_path / "x.npz").write_bytes(b"no")
    with pytest.raises(UsageError, match="no state"):
        OnlineIdentifier.restore(tmp_path / "x.npz", model())
    from scara_ident.model.model import build_model

    OnlineIdentifier(model(), NOISE, SETTINGS).save(tmp_path / "state.npz")
    with pytest.raises(UsageError, match="give that model"):
        OnlineIdentifier.restore(tmp_path / "state.npz", build_model(load_robot()))


@pytest.mark.parametrize("noise", [[0.1], [0.1, 0.0], [0.1, np.inf]])
def test_noise_is_a_positive_number_for_each_joint(noise):
    with pytest.raises(UsageError, match="noise"):
        OnlineIdentifier(model(), noise)


def test_at_rest_nothing_winds_up():
    # Whole blocks, so that the first at rest has no motion in it.
    moving = signals(4.096)
    online = fed(moving, torque(moving, truth()), replace(SETTINGS, memory=1.0))
    before = online.std.copy()
    still = [np.full((2, 5000), 0.3), np.zeros((2, 5000)), np.zeros((2, 5000))]
    online.update_block(*still, torque(still, truth()))
    np.testing.assert_allclose(online.std, before, rtol=1e-9)
    fading = fed(moving, torque(moving, truth()), replace(SETTINGS, memory=1.0, forgetting="exponential"))
    fading.update_block(*still, torque(still, truth()))
    assert np.all(fading.std > 3.0 * before)


def changed_torque(kind: str, states) -> np.ndarray:
    value = truth().copy()
    if kind == "friction":
        value[[model().names.index(name) for name in ("a02", "a12")]] *= 1.4
    if kind == "payload_change":
        robot, term = load_robot(), model().rigid_body
        mass = 0.05 * robot.standard_parameters()[[0, 10]].sum()
        standard = np.zeros(term.base.grouping.shape[1])
        tool = tool_of(robot)
        standard[10 * tool.joint : 10 * tool.joint + 10] = mass * point_mass(tool.point)
        value[model().place(term)] += term.base.grouping[term.kept] @ standard
    return torque(states, value, (1.0, 1.1) if kind == "torque_scale" else (1.0, 1.0), seed=9)


CHANGES = pytest.mark.parametrize(
    ("kind", "joint"), [("payload_change", None), ("friction", "joint2"), ("torque_scale", "joint2")]
)


@CHANGES
def test_a_change_is_seen_within_a_second_of_motion_and_named(kind, joint):
    states = signals(9.0)
    part = round(7.0 * RATE)
    before = [signal[:, :part] for signal in states]
    after = [signal[:, part:] for signal in states]
    online = OnlineIdentifier(model(), NOISE, SETTINGS)
    assert online.update_block(*before, torque(before, truth())) == []
    alarms = online.update_block(*after, changed_torque(kind, after))
    assert alarms and alarms[0].sample - part <= RATE
    assert (alarms[0].effect, alarms[0].joint) == (kind, joint)
    assert alarms[0].size > 0.0 and alarms[0].unit in ("1", "kg")


def test_a_sample_that_is_not_finite_is_lost_and_its_time_counts(tmp_path: Path):
    """One NaN poisoned all that was known, silently, and then no call came back."""
    states = signals(3.0)
    effort = torque(states, truth())
    bad = effort.copy()
    bad[0, [5, 700]] = np.nan, np.inf
    kept = np.isfinite(bad[0])
    expected = fed([signal[:, kept] for signal in states], effort[:, kept])
    whole, single = fed(states, bad), OnlineIdentifier(model(), NOISE, SETTINGS)
    for k in range(effort.shape[1]):
        single.update(*(signal[:, k] for signal in states), bad[:, k])
    for online in (whole, single):
        np.testing.assert_array_equal(online.value, expected.value)
        assert online.samples == effort.shape[1]
    whole.save(str(tmp_path / "state.npz"))
    np.testing.assert_array_equal(OnlineIdentifier.restore(tmp_path / "state.npz", model()).value, whole.value)


def test_shapes_and_shares_that_mean_nothing_are_refused():
    online, (q, v, a) = OnlineIdentifier(model(), NOISE, SETTINGS), signals(0.1)
    effort = torque((q, v, a), truth())
    with pytest.raises(UsageError, match=r"effort of shape \(\); expected \(2,\)"):
        online.update(q[:, 0], v[:, 0], a[:, 0], 1.0)
    with pytest.raises(UsageError, match=r"position of shape \(3,\); expected \(2,\)"):
        online.update(np.zeros(3), v[:, 0], a[:, 0], effort[:, 0])
    for wrong in ((q.T, v.T, a.T, effort.T), (q, v, a, effort[:, 1:]), (q[:, 0], v[:, 0], a[:, 0], effort[:, 0])):
        with pytest.raises(UsageError, match=r"expected \(2, N\) of each"):
            online.update_block(*wrong)
    for share in (0.0, 2.0, np.nan):
        with pytest.raises(UsageError, match="share"):
            online.forget(share)
    assert online.samples == 0


def test_a_block_that_cannot_be_absorbed_does_not_end_it(monkeypatch: pytest.MonkeyPatch):
    states = signals(3.0)
    effort = torque(states, truth())
    online = fed(states, effort)
    known, std = online.value, online.std

    def fails(*_: object) -> None:
        raise np.linalg.LinAlgError("did not converge")

    with monkeypatch.context() as context:
        context.setattr(OnlineIdentifier, "_rows", fails)
        with pytest.raises(np.linalg.LinAlgError):
            online.update_block(*(signal[:, :64] for signal in states), effort[:, :64])
    online.update_block(*(signal[:, :320] for signal in states), effort[:, :320])
    assert np.all(np.abs(online.value - known) < 3.0 * std)
    assert np.all(online.std < std)
