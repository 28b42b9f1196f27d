"""How long the torque of one state takes: the first call, and each after it.

python benchmarks/predict.py [--robot panda]
"""

from __future__ import annotations

import argparse
import time
import timeit

import numpy as np

from scara_ident.model.model import build_model
from scara_ident.model.prediction import Prediction
from scara_ident.robot.description import JointDescription, RobotDescription
from scara_ident.robot.examples import example_urdf
from scara_ident.robot.robot import Robot, build_robot, load_robot

# Short rounds fit between what else the machine does.
CALLS, REPEATS = 100, 400


def panda() -> Robot:
    """Return the arm's seven joints without the fingers."""
    urdf = example_urdf("panda")
    joints = {f"panda_joint{k}": JointDescription() for k in range(1, 8)}
    return build_robot(RobotDescription(urdf=urdf, effort_side="joint", joints=joints), urdf)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="panda", help="panda (seven joints), or what load_robot takes")
    given = parser.parse_args()
    robot = panda() if given.robot == "panda" else load_robot(given.robot)
    model = build_model(robot)
    rng = np.random.default_rng(0)
    found = Prediction(model, rng.standard_normal(len(model.columns)))
    q, v, a = rng.standard_normal((3, robot.n))
    began = time.perf_counter()
    found(q, v, a)
    first = time.perf_counter() - began
    rounds = np.array(timeit.repeat(lambda: found(q, v, a), number=CALLS, repeat=REPEATS)) / CALLS
    many = rng.standard_normal((3, 100_000, robot.n))
    began = time.perf_counter()
    found(*many)
    each = (time.perf_counter() - began) / many.shape[1]
    print(
        f"{robot.name}, {robot.n} joints, {len(model.columns)} parameters: first call {1e3 * first:.2f} ms, "
        f"then {1e6 * rounds.min():.1f} us at best, {1e6 * np.median(rounds):.1f} us in the median of {REPEATS} rounds; "
        f"of 100000 states at once {1e6 * each:.2f} us each"
    )


if __name__ == "__main__":
    main()
