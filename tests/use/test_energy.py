"""Energy of a motion against closed forms and its own balance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.use.energy import drive, energy_of
from tests.arms import motion


@pytest.fixture(scope="module")
def swung():
    """Two joints on whole periods of sines, 20 s."""
    time = np.arange(20001) / 1000.0
    omega = 2.0 * np.pi * np.array([[0.2], [0.3]])
    return motion(np.sin(omega * time), omega * np.cos(omega * time), -(omega**2) * np.sin(omega * time))


def test_what_is_given_is_taken_back_or_spent_on_parts(known: IdentifiedModel, swung):
    found = energy_of([drive(known, swung)])
    np.testing.assert_allclose(found.given - found.returned, sum(found.work.values()), rtol=1e-9)
    # Friction and offset alone take anything over whole periods, when both joints and the coupling between them are counted.
    assert abs(np.sum(found.work["rigid body"])) < 1e-6 * np.sum(found.given)
    assert {"Coulomb friction", "viscous friction"} <= set(found.heat)
    assert {"rigid body", "offset"}.isdisjoint(found.heat)


def test_coulomb_and_viscous_heat_are_those_of_a_sine(known: IdentifiedModel, swung):
    found = energy_of([drive(known, swung)])
    names, scale = known.model.names, np.abs(known.robot.row_scale)
    for j, frequency in enumerate((0.2, 0.3)):
        periods, omega = 20.0 * frequency, 2.0 * np.pi * frequency
        coulomb, viscous = (known.value[names.index(f"a{k}{j + 1}")] / scale[j] for k in (0, 1))
        assert found.work["Coulomb friction"][j] == pytest.approx(4.0 * coulomb * periods, rel=1e-3)
        assert found.work["viscous friction"][j] == pytest.approx(np.pi * viscous * omega * periods, rel=1e-3)


def test_a_negative_quadratic_part_lowers_the_heat(known: IdentifiedModel, swung):
    value = known.value.copy()
    place = [known.model.names.index(name) for name in ("a21", "a22")]
    value[place] = -0.01
    found = energy_of([drive(replace(known, value=value), swung)])
    assert np.all(found.work["quadratic friction"] < 0.0)
    assert "quadratic friction" in found.heat
    assert np.all(found.heated < sum(found.work[f"{word} friction"] for word in ("Coulomb", "viscous", "cubic")))


def test_stretches_add_up(known: IdentifiedModel, swung):
    whole = energy_of([drive(known, swung)])
    halves = energy_of([drive(known, swung.part(0, 10001)), drive(known, swung.part(10000, 20001))])
    np.testing.assert_allclose(halves.given, whole.given, rtol=1e-9)
    np.testing.assert_allclose(halves.returned, whole.returned, rtol=1e-9)
    assert halves.rms_torque == pytest.approx(whole.rms_torque, rel=1e-3)
