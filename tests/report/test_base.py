"""base.json: what each base parameter is made of, what is not identifiable and why."""

from __future__ import annotations

import json

import numpy as np
import pytest

from scara_ident.files import plain
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.report.base import base_dict
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf


def test_the_scara03_is_reported():
    content = json.loads(json.dumps(plain(base_dict(load_robot())), allow_nan=False))
    assert (content["robot"], content["count"]) == ("scara03", 5)
    assert [row["name"] for row in content["base_parameters"]] == ["P_d1", "P_d2", "P_d3", "P_d4", "P_d5"]
    first = content["base_parameters"][0]
    assert first["expression"] == "I1zz + 0.1089 m2 + 10000 Jm1"
    np.testing.assert_allclose([first["made_of"][name] for name in ("I1zz", "m2", "Ia1")], [1.0, 0.1089, 1.0])
    robot = load_robot()
    values = dict(zip(rigid_body(robot).base.standard_names, robot.standard_parameters(), strict=True))
    for row in content["base_parameters"]:
        assert row["urdf"] == pytest.approx(sum(share * values[name] for name, share in row["made_of"].items()))
    assert [body["link"] for body in content["bodies"]] == ["link1", "link2"]
    assert content["check"]["passed"] is True
    assert content["check"]["rank"] == 5


def test_every_standard_parameter_is_alone_in_sums_or_never_there():
    content = base_dict(load_robot(example_urdf("double_pendulum.urdf")))
    alone = {next(iter(row["made_of"])) for row in content["base_parameters"] if len(row["made_of"]) == 1}
    groups = [alone, set(content["only_in_sums"]), set(content["never_enter"])]
    assert sum(len(group) for group in groups) == 22
    assert len(set.union(*groups)) == 22
    # Nobody stated its rotors' inertia.
    rotors = [any(name.startswith("Ia") for name in row["made_of"]) for row in content["base_parameters"]]
    assert any(rotors)
    assert [bool(np.isnan(row["urdf"])) for row in content["base_parameters"]] == rotors
