"""Rows at every sample, against the columns and the torques that they are of."""

from __future__ import annotations

import numpy as np

from scara_ident.online.sampled import rows_of_samples
from tests.online.made import NOISE, RATE, columns, model, signals, torque, truth


def test_rows_are_weighted_columns_and_torques_and_zero_at_rest():
    states = signals(0.5)
    states[1][0, 10:20] = 1e-4
    effort, weight = torque(states, truth()), 1.0 / NOISE
    given = np.array([*states, effort]).transpose(2, 0, 1)
    tables, counted = rows_of_samples(model(), given, np.full(2, 1e-3), weight, RATE)
    assert counted.tolist() == np.count_nonzero(np.abs(states[1]) > 1e-3, axis=1).tolist()
    assert counted[0] <= effort.shape[1] - 10
    for j, (table, own) in enumerate(zip(tables, columns(*states), strict=True)):
        moves = np.abs(states[1][j]) > 1e-3
        np.testing.assert_allclose(table[moves], weight[j] * np.vstack([own, effort[j]]).T[moves], rtol=1e-12)
        np.testing.assert_array_equal(table[~moves], 0.0)
