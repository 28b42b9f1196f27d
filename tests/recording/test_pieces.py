"""Recordings that are pieces of one."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.recording.pieces import of_one_run
from scara_ident.robot.robot import load_robot
from tests.arms import recording

TIME = np.arange(3000) / 200.0
MOTION = np.vstack([np.sin(1.3 * TIME), 0.5 * np.cos(2.1 * TIME)])


def cut(position: np.ndarray, bounds: list[int]):
    return [
        recording(load_robot(), f"{name}_1", TIME[: stop - start], position[:, start:stop], position[:, start:stop])
        for name, start, stop in zip("ABCDEF", bounds[:-1], bounds[1:], strict=False)
    ]


@pytest.mark.parametrize("step", [0.0, 2.0 * np.pi / 2**14])
def test_pieces_of_one_recording_are_of_one_run_in_any_order(step: float):
    position = MOTION if step == 0.0 else step * np.round(MOTION / step)
    first, second, third = cut(position, [0, 900, 1700, 3000])
    assert of_one_run([first, second, third]).tolist() == [0, 0, 0]
    assert of_one_run([third, first, second]).tolist() == [0, 0, 0]
    # Without the piece between them nothing says that they are of one.
    assert of_one_run([first, third]).tolist() == [0, 1]


def test_runs_that_begin_where_others_end_at_rest_are_runs():
    slow = MOTION * np.sin(np.pi * TIME / TIME[-1]) ** 2
    (run,) = cut(slow, [0, 3000])
    assert of_one_run([run, run]).tolist() == [0, 1]
    still = np.ones((2, 3000))
    assert of_one_run(cut(still, [0, 1000, 3000])).tolist() == [0, 1]


def test_whole_periods_of_a_motion_are_runs():
    phase = 2.0 * np.pi * np.arange(1500) / 1500.0
    period = np.vstack([np.sin(phase), np.cos(2.0 * phase)])
    (run,) = cut(period, [0, 1500])
    assert of_one_run([run, run, run]).tolist() == [0, 1, 2]
