"""What else may change is asked beside a body, and what explains more than it beats it."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects.interval_rivals import beaten, explained
from scara_ident.effects.last_link_cells import cells_of
from scara_ident.robot.robot import Robot
from tests.effects.intervals import MIDWAY, arms, runs, seen

SHOWN = (0, 1, 3)
# Of noise alone, in units of what the base model leaves: a tenth of its size here.
SCATTER = 0.02


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Robot]:
    return arms(tmp_path_factory.mktemp("arm"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["payload", "weight", "offset", "friction", "scale", "contact"])
def test_each_change_beats_a_body_where_it_is_there(robots: tuple[Robot, Robot], kind: str):
    """What has weight and hardly any inertia is a body too, though a constant force explains it better by some 1 %."""
    scene, _ = seen(robots[0], runs(robots, MIDWAY, kind))
    cells = cells_of(scene, SHOWN)
    asked = {name: [(k, *own[0])] for k, (name, own) in enumerate(MIDWAY.items())}
    assert beaten(scene, SHOWN, cells, asked, SCATTER) == (kind not in ("payload", "weight"))


def test_what_columns_explain_is_what_least_squares_does():
    rng = np.random.default_rng(3)
    table, torque = rng.standard_normal((4, 50)) * np.array([[1e-3], [1.0], [10.0], [0.0]]), rng.standard_normal(50)
    left = torque - np.linalg.lstsq(table.T, torque, rcond=None)[0] @ table
    assert explained(table @ torque, table @ table.T) == pytest.approx(torque @ torque - left @ left)
