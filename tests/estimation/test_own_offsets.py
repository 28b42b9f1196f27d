"""Offsets of runs where no row is kept."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.bands import choose_bands
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.least_squares import weighted_value
from scara_ident.estimation.observations import informations, informations_of_each, observe
from scara_ident.estimation.own_offsets import value_beside_offsets, without
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, write_urdf
from tests.estimation.test_run_offsets import zeroed_runs


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R))


def test_a_parameter_of_their_own_is_what_rows_with_a_column_more_say():
    rng = np.random.default_rng(0)
    rows = [rng.standard_normal((30, 4)) for _ in range(3)]
    for own in rows:
        own[:, -1] = own[:, :-1] @ [1.0, 0.0, 2.0] + 5.0 * rng.standard_normal() * own[:, 1]
    parts = [Information.empty(3).absorb_columns(own.T) for own in rows]
    found = merge([without(item, 1) for item in parts])
    wide = np.zeros((90, 5))
    for k, own in enumerate(rows):
        wide[30 * k : 30 * k + 30, [0, 1, 2 + k]] = own[:, [0, 2, 1]]
    expected, left, *_ = np.linalg.lstsq(wide, np.concatenate([own[:, -1] for own in rows]), rcond=None)
    value = found.solve().value
    np.testing.assert_allclose(value, [expected[0], 0.0, expected[1]], atol=1e-12)
    assert found.residual_sum(value) == pytest.approx(float(left[0]) if len(left) else 0.0, abs=1e-18)
    # Rows that do not know it stay.
    nothing = Information.empty(3).absorb_columns(
        np.delete(rows[0].T, 1, axis=0)[[0, 0, 1, 2]] * [[1.0], [0.0], [1.0], [1.0]]
    )
    assert without(nothing, 1) is nothing


def test_each_run_has_its_own_only_where_that_makes_most_of_what_is_left(robot: Robot):
    model = build_model(robot, "basic")
    offsets = [model.names.index(name) for name in ("p_o1", "p_o2")]
    for size, freed in ((0.0, False), (0.5, True)):
        data = prepare(zeroed_runs(robot, size), (8.0, 8.0))
        value = value_beside_offsets(model, informations_of_each(model, data))
        one = weighted_value(informations(model, data))
        assert (np.any(value != one)) == freed
        assert np.all((value[offsets] == 0.0) == freed)
    steady = weighted_value(observe(model, prepare(zeroed_runs(robot, 0.0), (8.0, 8.0))).by_joint)
    bodies = np.arange(len(value)) < min(offsets)
    assert np.linalg.norm((value - steady)[bodies]) < 0.05 * np.linalg.norm((one - steady)[bodies])


def test_the_band_is_that_of_runs_without_offsets(robot: Robot):
    """It was the narrowest: of what one offset left nothing was explained."""
    model = build_model(robot, "basic")
    bands = [choose_bands(model, prepare(zeroed_runs(robot, size))).bands for size in (0.0, 0.5, 5.0)]
    np.testing.assert_allclose(bands[1], bands[0], rtol=0.3)
    np.testing.assert_allclose(bands[2], bands[0], rtol=0.3)
