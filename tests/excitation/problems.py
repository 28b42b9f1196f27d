"""Problems of every kind and a motion inside their limits."""

import numpy as np

from scara_ident.excitation.criteria import BlockLogDet, Condition, LogDet
from scara_ident.excitation.interior_point import shrunk_inside
from scara_ident.excitation.search import _random_motion
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf
from tests.excitation.made import rigid_model, scara_with_quill, small_problem


def problems():
    scara = build_model(load_robot())
    # Without offset: the weight of a vertical slide is one.
    quill = build_model(scara_with_quill(), "reduced")
    arm = rigid_model(load_robot(example_urdf("ur5_robot.urdf")))
    return {
        "logdet": small_problem(scara, LogDet(), tool_speed=1.5),
        "block": small_problem(scara, BlockLogDet((1, 2, 3))),
        "cond": small_problem(scara, Condition(power=5.0)),
        "two, with a prior": small_problem(
            scara,
            LogDet(),
            lengths=((8.0, 6), (4.0, 5)),
            prior=3.0,
            accelerations={"joint1": 9.0},
            jerks={"joint2": 60.0},
        ),
        "prismatic": small_problem(quill, LogDet(), tool_acceleration=5.0, floor=0.0),
        "six joints": small_problem(arm, Condition(scaled=True, power=5.0), floor=-0.5),
    }


PROBLEMS = problems()


def inside(problem, seed=0):
    return shrunk_inside(problem, 0.7 * _random_motion(problem.task, np.random.default_rng(seed)))
