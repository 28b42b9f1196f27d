"""A model at hand and its torque, part by part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.export.arms import scara
from tests.export.identified import identified, model_torque, states


def test_parts_add_up_to_the_torque_and_its_uncertainty_is_that_of_the_parameters(tmp_path) -> None:
    found = identified(scara(tmp_path), ("transmission_loss",))
    moved = states(found.robot, 1, 20)
    parts = found.torque_parts(moved)
    assert list(parts) == [
        "rigid body",
        *(f"{word} friction" for word in ("Coulomb", "viscous", "quadratic", "cubic")),
        "offset",
        "transmission loss",
    ]
    expected = model_torque(found, found.value, moved)
    np.testing.assert_allclose(sum(parts.values()), expected, atol=1e-12)
    np.testing.assert_allclose(found.torque(moved), expected, atol=1e-12)
    root = np.random.default_rng(0).normal(size=(len(found.value), len(found.value)))
    regressor = found.model.regressor(moved)
    dense = np.sqrt(np.einsum("jpn,pq,jqn->jn", regressor, root @ root.T, regressor))
    np.testing.assert_allclose(replace(found, covariance=root @ root.T).torque_std(moved), dense, rtol=1e-9)
    assert replace(found, found=({"effect": "time_delay"}, {"effect": "transmission_loss"})).removed == ("time_delay",)
