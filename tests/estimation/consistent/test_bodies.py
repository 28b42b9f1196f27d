from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.estimation.consistent.bodies import (
    link_inertia,
    pack,
    packed_pseudo_inertia,
    unpack,
    unpacking,
)
from scara_ident.model.base_parameters import pseudo_inertia
from tests.estimation.consistent.arms import smallest_eigenvalue_share


def point_mass(mass: float, place: tuple[float, float, float]) -> np.ndarray:
    """Ten parameters of a point mass, from the definition of the moments of inertia."""
    x, y, z = place
    about = [y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y]
    return mass * np.array([1.0, x, y, z, *about])


def thin_rod(mass: float, length: float) -> np.ndarray:
    """Ten parameters of a thin rod along x that begins at the origin."""
    about = mass * length**2 / 3.0
    return np.array([mass, mass * length / 2.0, 0.0, 0.0, 0.0, 0.0, about, 0.0, 0.0, about])


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_packing_keeps_matrices_and_their_inner_product(seed):
    rng = np.random.default_rng(seed)
    a, b = (m + np.swapaxes(m, -1, -2) for m in rng.standard_normal((2, 3, 4, 4)))
    np.testing.assert_allclose(unpack(pack(a)), a, rtol=1e-14)
    np.testing.assert_allclose(np.sum(pack(a) * pack(b)), np.sum(a * b), rtol=1e-12)
    np.testing.assert_allclose(unpacking() @ pack(a)[0], a[0].ravel(), rtol=1e-14)
    small = a[:, :2, :2]
    np.testing.assert_allclose(pack(small), np.array([small[:, 0, 0], 2**0.5 * small[:, 0, 1], small[:, 1, 1]]).T)
    np.testing.assert_allclose(unpack(pack(small)), small, rtol=1e-14)


def test_the_linear_map_is_pinocchios_pseudo_inertia():
    parameters = pin.Inertia.Random().toDynamicParameters()
    np.testing.assert_allclose(unpack(packed_pseudo_inertia() @ parameters), pseudo_inertia(parameters), atol=1e-15)


def test_a_point_mass_and_a_thin_rod_can_exist():
    assert smallest_eigenvalue_share(point_mass(2.0, (0.1, -0.2, 0.3))) >= -1e-15
    assert smallest_eigenvalue_share(thin_rod(2.0, 0.5)) >= -1e-15


def test_a_point_mass_with_a_product_of_inertia_of_the_wrong_sign_cannot_exist():
    body = point_mass(2.0, (0.1, -0.2, 0.3))
    body[5] *= -1.0
    # Its rotational inertia alone would pass: the triangle inequality holds and it is positive definite.
    rotational = np.array([[body[4], body[5], body[7]], [body[5], body[6], body[8]], [body[7], body[8], body[9]]])
    values = np.linalg.eigvalsh(rotational)
    assert values[0] > 0.0
    assert smallest_eigenvalue_share(body) < -1e-3


def test_links_are_written_about_their_centre_of_mass():
    link = link_inertia("rod", thin_rod(3.0, 0.4))
    assert link.mass == pytest.approx(3.0)
    assert link.com == pytest.approx((0.2, 0.0, 0.0))
    about = 3.0 * 0.4**2 / 12.0
    assert link.inertia == pytest.approx((0.0, 0.0, 0.0, about, 0.0, about), abs=1e-15)
