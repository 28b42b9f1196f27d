"""A small fleet, made up."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np

from scara_ident.fleet import Fleet
from scara_ident.fleet.changes import Change
from scara_ident.fleet.fleet import ArmReport
from scara_ident.fleet.folder import Fault
from scara_ident.fleet.history import History
from scara_ident.fleet.table import quantities
from scara_ident.fleet.visit import _visit
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.fleet.made import DATES, run_of


@cache
def made_fleet() -> Fleet:
    """Two arms on two dates, of which one is said to have changed."""
    model = build_model(pickle.loads(pickle.dumps(load_robot())))
    histories = []
    for arm in (1, 2):
        first = _visit(model, [run_of(arm, 0)], None)
        histories.append(
            History(f"arm{arm}", DATES[:2], (first, _visit(model, [run_of(arm, 1)], first.reference)), model)
        )
    cause = next(item for item in histories[1].causes if item.words == "Coulomb friction of joint2")
    change = Change(cause, "joint2", DATES[1], False, np.array([0.31]), np.array([[4e-4]]), 1e-5)
    diagnosis = {"date": DATES[1], "verdict": "complete", "effects": []}
    arms = (
        ArmReport("arm1", histories[0]),
        ArmReport("arm2", histories[1], (change,), diagnosis, (Fault("arm2", DATES[0], "x.csv", "<not> whole"),)),
        ArmReport("arm3", None, faults=(Fault("arm3", None, None, "arm3: no recording"),)),
    )
    return Fleet(model.robot, model, arms, quantities(histories))
