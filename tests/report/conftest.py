"""A diagnosis that several tests of reports read."""

from __future__ import annotations

import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque

CATALOGUE = (Spring(), Stribeck())


def spring(motion):
    return 0.05 * motion.q[1]


@pytest.fixture(scope="session")
def result():
    runs = exact_runs(3)
    held_out = with_torque(runs[4:5], 1, spring)
    return diagnose(
        load_robot(), with_torque(runs[:4], 1, spring), validation=held_out, bands=BANDS, catalogue=CATALOGUE
    )
