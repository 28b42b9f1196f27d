"""The page of a fleet."""

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
from scara_ident.report.html.fleet import fleet_report
from scara_ident.robot.robot import load_robot
from tests.fleet.made import DATES, run_of
from tests.report.html.document import data_of, document


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


def test_the_arm_that_changed_comes_first_with_what_and_since_when(tmp_path):
    fleet_report(tmp_path / "report.html", made_fleet())
    page = document(tmp_path / "report.html")
    assert page.wrong == []
    assert page.sections == ["arms", "time", "quantities", "faults"]
    assert "1 of 3 arms changed by more than noise." in page.words
    assert "arm2: Coulomb friction of joint2 up 31 % (± 2 %) since 15 February 2026." in page.words
    assert page.words.index("arm2") < page.words.index("arm1")
    assert "arm2/x.csv: <not> whole" in page.words


def test_every_quantity_is_drawn_with_its_bars_for_every_arm(tmp_path):
    fleet = made_fleet()
    fleet_report(tmp_path / "report.html", fleet)
    figures = data_of(tmp_path / "report.html")["figures"]
    plots = [plot for figure in figures.values() for plot in figure["variants"].values()]
    told = [{one.name for each in dates for one in each if np.isfinite(one.std)} for dates in fleet.quantities.values()]
    assert len(plots) == sum(map(len, told))
    assert all(any("e" in layer for layer in plot["panels"][0]["layers"]) for plot in plots)
    # The quantity that changed is the first of its joint.
    changed = figures["time-0"]["variants"]["0,1"]["panels"][0]
    assert changed["label"].startswith("a02")
    assert {layer.get("c") for layer in changed["layers"]} == {"grey", "blue", "vermillion"}
