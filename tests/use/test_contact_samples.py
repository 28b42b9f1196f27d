"""The samples that a force is fitted to: its begin and end, and the delay of the velocity's low-pass, are no part of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.recording.recording import Recording
from scara_ident.use.contact import Contact, look_for_contact
from scara_ident.use.observer import ContactObserver, contact_observer
from tests.use.quiet import known_ur5, pushed, quiet

# So large that the error of what the low-pass shows of it would be some times that of the torque.
FORCE = np.array([300.0, -200.0, 400.0])
# Share of the force that it is off at most: some times what noise and friction of `quiet` make of it, 0.05 to 0.3 %, and those of
# `turning`, whose thresholds are larger, 1 to 2 %. With a begin taken for a step, an end taken for force and no delay of 13 ms
# it is 4 to 33 %.
OFF = {"quiet": 0.006, "turning": 0.03}


def turning(seed: int) -> Recording:
    """A run without recorded velocity whose first joint turns at 1.5 rad/s, and the force in the arm's frame with it."""
    run = quiet(seed)
    return replace(run, position=run.position + np.array([[1.5], *[[0.0]] * 5]) * run.time, velocity=None)


@pytest.fixture(scope="module")
def observers() -> dict[str, ContactObserver]:
    return {
        made.__name__: contact_observer(known_ur5(), [made(seed) for seed in range(3)], rate=1.0)
        for made in (quiet, turning)
    }


def told(observer: ContactObserver, run: Recording) -> Contact:
    (own,) = (each for each in look_for_contact(observer, [run]).contacts if 8.0 <= each.start < 8.2)
    return own


def off(found: Contact, force: np.ndarray) -> float:
    return float(np.linalg.norm(found.force - force) / np.linalg.norm(force))


@pytest.mark.slow
@pytest.mark.parametrize("made", [quiet, turning])
@pytest.mark.parametrize("lasting", [0.3, 1.0])
def test_a_strong_force_is_determined_as_well_as_the_torque_without_it(observers, made, lasting: float):
    # A direction that is told 40 times worse than another, of seeds 21 and 23, is no reason to place it elsewhere.
    errors, z = [], []
    for seed in range(20, 26):
        force = FORCE[np.random.default_rng(seed).permutation(3)]
        found = told(observers[made.__name__], pushed(made(seed), force, 8.0, 8.0 + lasting))
        assert found.place == "tool"
        errors.append(off(found, force))
        z.append((found.force - force) / np.sqrt(np.diag(found.force_covariance)))
    assert np.max(errors) < OFF[made.__name__]
    assert np.max(np.abs(z)) < 2.0


@pytest.mark.slow
def test_a_force_that_rises_and_falls_is_reported_where_it_is_whole(observers):
    # In steps of 20 ms to all of it and back, which is a push that nobody taps: 60 ms each.
    run = quiet(21)
    for first, last in ((8.0, 9.0), (8.02, 8.98), (8.04, 8.96), (8.06, 8.94)):
        run = pushed(run, FORCE / 4.0, first, last)
    assert off(told(observers["quiet"], run), FORCE) < OFF["quiet"]


@pytest.mark.slow
def test_one_too_short_to_be_whole_is_reported_still(observers):
    found = told(observers["quiet"], pushed(quiet(21), FORCE, 8.0, 8.05))
    assert found.force is not None
    # A share of it, in its direction.
    assert found.force @ FORCE > 0.95 * np.linalg.norm(found.force) * np.linalg.norm(FORCE)
