"""An observer of contact, sample by sample and over recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import RecordingError, ScaraIdentError, UsageError
from scara_ident.use.contact import look_for_contact
from scara_ident.use.observer import ContactObserver, Reading, contact_observer
from tests.use.quiet import RATE, known_ur5, pushed, quiet

FORCE = np.array([30.0, -20.0, 40.0])


@pytest.fixture(scope="module")
def observer() -> ContactObserver:
    return contact_observer(known_ur5(), [quiet(seed) for seed in range(3)], rate=1.0)


@pytest.mark.slow
def test_sample_by_sample_is_the_same(observer: ContactObserver):
    run = pushed(quiet(7), FORCE, 8.0, 9.0)
    observer.reset()
    readings = [
        observer.update(q, v, u, 1.0 / RATE)
        for q, v, u in zip(run.position.T, run.velocity.T, run.effort.T, strict=True)
    ]
    offline = observer.observe(run)
    np.testing.assert_allclose(np.array([each.torque for each in readings])[100:].T, offline.torque[:, 100:], atol=1e-6)
    touched = [k / RATE for k, each in enumerate(readings) if each.contact]
    (contact,) = look_for_contact(observer, [run]).contacts
    assert (touched[0], touched[-1]) == (pytest.approx(contact.start), pytest.approx(contact.stop))


@pytest.mark.slow
def test_lost_samples_and_gaps_are_no_contact(observer: ContactObserver):
    run = quiet(7, seconds=6.0)
    lost = run.effort.copy()
    lost[2, 200:203], lost[:2, 300] = np.nan, (np.inf, -np.inf)

    def readings(effort: np.ndarray, left_out: slice) -> list[Reading]:
        observer.reset()
        every = np.delete(np.arange(len(run.time)), left_out)
        steps = np.diff(run.time[every], prepend=-1.0 / RATE)
        return [observer.update(run.position[:, k], run.velocity[:, k], effort[:, k], float(step)) for k, step in zip(every, steps, strict=True)]  # fmt: skip

    whole, holes = readings(run.effort, slice(0)), readings(lost, slice(0))
    assert holes[201].torque is holes[199].torque
    assert all(np.isfinite(each.torque).all() and not each.contact for each in holes)
    # What was bridged is forgotten like all else.
    np.testing.assert_allclose(holes[-1].torque, whole[-1].torque, rtol=0.05, atol=0.02)
    # A second is not there, and a push is at once when it goes on: until 0.4 s later nothing is said.
    gap = readings(run.effort + 100.0 * (run.time > 3.0), slice(200, 300))
    assert next(k for k, each in enumerate(gap) if each.contact) == 200 + 40
    np.testing.assert_array_equal(gap[200].torque, 0.0)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"q": np.zeros(5)}, r"q has the shape \(5,\); expected \(6,\), one number for each joint of ur5"),
        ({"effort": np.zeros((6, 1))}, "effort has the shape"),
        ({"v": None}, "v is None, .* give velocities"),
        ({"step": 0.0}, "step is 0 s; expected"),
        ({"step": np.nan}, "step is nan s; expected"),
    ],
)
def test_a_wrong_sample_is_one_line(observer: ContactObserver, changed: dict, said: str):
    sample = {"q": np.zeros(6), "v": np.zeros(6), "effort": np.zeros(6), "step": 1e-3} | changed
    with pytest.raises(UsageError, match=said):
        observer.update(**sample)


def test_without_velocities_positions_are_differentiated():
    free = [replace(quiet(seed), velocity=None) for seed in range(2)]
    observer = contact_observer(known_ur5(), free, rate=1.0)
    assert not observer.velocity
    (contact,) = look_for_contact(observer, [pushed(quiet(7), 2.0 * FORCE, 8.0, 9.0)]).contacts
    assert 8.0 <= contact.start < 8.3


@pytest.mark.parametrize(
    ("free", "rate", "said"),
    [
        ([], 1.0, "no recordings without contact"),
        ([quiet(0)], 0.0, "give numbers above 0"),
        ([replace(quiet(0), effort=None)], 1.0, "no effort was recorded"),
    ],
)
def test_what_cannot_be_is_one_line(free, rate: float, said: str):
    with pytest.raises(ScaraIdentError, match=said):
        contact_observer(known_ur5(), free, rate=rate)


def test_velocities_must_be_there_as_they_were(observer: ContactObserver):
    with pytest.raises(RecordingError, match="no velocity was recorded"):
        observer.observe(replace(quiet(0), velocity=None))


def test_all_directions_are_felt_by_an_arm_in_space(observer: ContactObserver):
    assert observer.felt == 3
