"""Short designs for the SCARA03."""

from scara_ident.excitation import (
    Effort,
)
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

SCARA = load_robot()


COMPLETE = build_model(SCARA)


QUICK = Effort(starts=1, rounds=0, processes=1)


SHORT = {"duration": 4.0, "harmonics": 6, "samples": 400}
