import numpy as np
import pytest

from scara_ident.excitation import verification
from scara_ident.excitation.limits import Limits
from scara_ident.excitation.search import _random_motion
from scara_ident.excitation.verification import Reached, extremes
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.excitation.made import small_problem

TASK = small_problem(build_model(load_robot()), lengths=((8.0, 6), (5.0, 5)), tool_speed=1.5).task
MOVED = 0.3 * _random_motion(TASK, np.random.default_rng(0))


@pytest.mark.parametrize("chunk", [7, 100, 399])
def test_long_motions_are_verified_piece_by_piece_alike(monkeypatch, chunk):
    whole = extremes(TASK, MOVED, 400)
    monkeypatch.setattr(verification, "CHUNK", chunk)
    for once, by_pieces in zip(whole, extremes(TASK, MOVED, 400), strict=True):
        np.testing.assert_allclose(by_pieces, once, rtol=1e-12)


def test_the_extremes_of_a_grid_bound_those_of_a_finer_one():
    coarse, fine = extremes(TASK, MOVED, 400), extremes(TASK, MOVED, 40_000)
    assert np.all(coarse[0] >= fine[0] - 1e-6) and np.all(coarse[1] <= fine[1] + 1e-6)
    np.testing.assert_allclose(coarse[0], fine[0], atol=0.01)


def test_a_limit_is_active_near_its_bound_and_broken_beyond_it():
    shares = {0.5: (True, False), 0.995: (True, True), 1.0: (True, True), 1.0001: (False, True)}
    for share, (kept, active) in shares.items():
        each = Reached("joint1.velocity", 2.0, 2.0 * share, "rad/s", share)
        assert (each.kept, each.active) == (kept, active)


def test_limits_about_the_tool_are_watched():
    bare = Limits(-np.ones(1), *np.ones((5, 1)))
    assert not bare.watches_tool
    assert TASK.limits.watches_tool
