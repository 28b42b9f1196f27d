"""A model at hand and its torque, part by part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.export.arms import scara
from tests.export.identified import identified, model_torque, states


def test_parts_add_up_to_the_torque(tmp_path) -> None:
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
    assert replace(found, found=({"effect": "time_delay"}, {"effect": "transmission_loss"})).removed == ("time_delay",)
