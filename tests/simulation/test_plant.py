"""What the compiled loop is given."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.simulation.plant import Plant, PlantDraft
from tests.simulation.made import scara


@pytest.fixture
def draft() -> PlantDraft:
    """The SCARA03 without friction, so that no joint's direction of motion matters."""
    made = scara().draft()
    made.arrays["friction"] = np.zeros((2, 4))
    return made


def test_the_arm_alone_has_neither_coupling_nor_a_payload_nor_elastic_joints(draft: PlantDraft):
    plant = draft.plant()
    assert not plant.coupled
    assert plant.payload_span.shape == (0, 2)
    assert not plant.elastic.any()
    np.testing.assert_array_equal(plant.direction_matters, [False, False])


def test_constants_are_brought_to_the_joint_side():
    arm = scara()
    plant = arm.draft().plant()
    np.testing.assert_allclose(plant.friction, 100.0 * arm.friction)
    np.testing.assert_allclose(plant.armature, 1e4 * arm.rotor_inertia)


@pytest.mark.parametrize(("name", "value"), [("stribeck_amplitude", 0.1), ("signed_sine", 0.1), ("efficiency", 0.9)])
def test_the_direction_matters_where_a_torque_jumps_with_it(draft: PlantDraft, name: str, value: float):
    draft.arrays[name][1] = value
    np.testing.assert_array_equal(draft.plant().direction_matters, [False, True])
    for grows in ("presliding", "smooth_velocity"):
        draft.arrays[grows][1] = 0.01  # then it grows with the way, or the speed, instead of jumping
        np.testing.assert_array_equal(draft.plant().direction_matters, [False, False])
        draft.arrays[grows][1] = 0.0


def test_coupled_coulomb_friction_makes_the_other_joints_direction_matter(draft: PlantDraft):
    draft.arrays["coupling_viscous"][0, 1] = 0.2
    assert draft.plant().coupled
    assert not draft.plant().direction_matters.any()
    draft.arrays["coupling_coulomb"][0, 1] = 0.2
    np.testing.assert_array_equal(draft.plant().direction_matters, [False, True])


def test_a_joint_may_have_several_ripples_and_vibrations(draft: PlantDraft):
    draft.append("ripple", 1, 100.0, 0.03, 0.2)
    draft.append("ripple", 0, 200.0, 0.02, 0.1)
    draft.append("vibration", 1, 7.0, 0.01, 0.0)
    plant = draft.plant()
    np.testing.assert_array_equal(plant.ripple_joint, [1, 0])
    np.testing.assert_array_equal(plant.ripple_order, [100.0, 200.0])
    np.testing.assert_array_equal(plant.ripple_amplitude, [0.03, 0.02])
    np.testing.assert_array_equal(plant.vibration_frequency, [7.0])


def test_places_are_whole_numbers_whatever_they_were_in_the_draft(draft: PlantDraft):
    draft.arrays["parent"] = draft.arrays["parent"].astype(float)
    plant = draft.plant()
    kinds = {name: getattr(plant, name).dtype for name in Plant._fields if isinstance(getattr(plant, name), np.ndarray)}
    assert {name for name, kind in kinds.items() if kind == np.int64} == {
        "parent", "shaft_joint", "shaft_other", "push_joint", "ripple_joint", "vibration_joint", "signed_sine_of", "swinging_viscous_of",
    }  # fmt: skip
    assert all(getattr(plant, name).flags.c_contiguous for name in kinds)
