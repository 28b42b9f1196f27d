"""Changes in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.fleet.changes import Change
from scara_ident.fleet.words import day, sentences


def test_a_change_is_said_with_size_uncertainty_and_date(histories):
    history = histories[0]
    causes = {cause.label: cause for cause in history.causes}

    def of(label, size, variance, **more):
        cause = causes[label]
        change = Change(cause, cause.joint, "2026-03-01", False, np.array(size), np.diag(variance), 1e-6)
        (said,) = sentences([replace(change, **more)], history.scene)
        return said

    coulomb = "Coulomb friction of joint2"
    assert of(coulomb, [0.314], [4e-4]) == "Coulomb friction of joint2 up 31 % (± 2 %) since 1 March 2026"
    slow = of(coulomb, [-0.05], [1e-4], gradual=True, or_else=(causes["friction of joint2"],))
    assert slow == (
        "Coulomb friction of joint2 down 5 % (± 1 %) gradually since 1 March 2026; it could also be friction of joint2"
    )
    loss = of("transmission_loss of joint1", [0.052], [1e-6])
    assert loss == (
        "Gear loss that grows with the transmitted torque on joint1: loss coefficient up 0.052 (± 0.001) since 1 March 2026"
    )
    inertia = next(label for label, cause in causes.items() if cause.effect == "inertia")
    count = causes[inertia].sizes
    assert "masses and inertias" in of(inertia, [1.0] + [0.0] * (count - 1), [1e-2] * count).lower()
    scale = "torque scale of joint1"
    assert of(scale, [-2.0], [4e-6]) == (
        "Torque scale of joint1 down 200 % (± 0.2 %) since 1 March 2026; its sign is reversed"
    )
    assert "reversed" not in of(scale, [-0.5], [4e-6]) + of(coulomb, [-1.2], [1e-2])
    unknown = of(coulomb, [2.0], [0.01], cause=None)
    assert unknown == "Residual of joint2 up 200 % (± 10 %) since 1 March 2026; no known cause explains it"


def test_two_changes_of_one_cause_are_one_sentence_by_their_dates(histories):
    history = histories[0]
    spring = next(cause for cause in history.causes if cause.label == "spring of joint1")
    later = Change(spring, "joint1", "2026-05-01", False, np.array([0.25]), np.array([[1e-4]]), 1e-9)
    first = Change(spring, "joint1", "2026-03-01", True, np.array([-0.05]), np.array([[1e-4]]), 1e-6)
    grown = Change(None, "joint2", "2026-05-01", False, np.array([2.0]), np.array([[0.01]]), 1e-6)
    said, residual = sentences([later, first, grown], history.scene)
    assert said.endswith(
        "on joint1: stiffness down 0.05 N m/rad (± 0.01) gradually since 1 March 2026, up 0.25 N m/rad (± 0.01) since 1 May 2026"
    )
    assert said.count("stiffness") == 1 and residual.startswith("Residual of joint2")


def test_dates_are_short():
    assert day("2026-12-31") == "31 December 2026"
