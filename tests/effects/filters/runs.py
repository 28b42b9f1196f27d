"""What the diagnosis finds of a virtual arm that has a filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.diagnosis.made import BANDS, multisine

RATE = 500.0


def diagnosed(effect: str) -> Diagnosis:
    """Four recordings of two motions of the SCARA03, with an effect as on the command line."""
    arm = replace(virtual_arm(), torque_noise=np.array([0.002, 0.0008]))
    made = [
        simulate(
            arm, multisine(f"m{seed}", seed, 8.0, 0.8), effects=[parse_effect(effect)], seed=seed, repetition=k,
            rate=RATE,
        )
        for seed in (2, 3)
        for k in (1, 2)
    ]  # fmt: skip
    return diagnose(load_robot(), [item.recording for item in made], bands=BANDS)
