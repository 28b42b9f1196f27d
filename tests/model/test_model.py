"""The torque model: which terms the three names stand for, and where a term stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident import paper
from scara_ident.errors import UsageError
from scara_ident.model.model import build_model
from scara_ident.model.terms import Offset
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, motion, write_urdf
from tests.excitation.made import scara_with_quill

PAPER = tuple(parameter.name for parameter in paper.PARAMETERS)


def random_motion(n: int = 2, samples: int = 50):
    rng = np.random.default_rng(0)
    return motion(*(rng.uniform(-2, 2, (n, samples)) for _ in range(3)))


def test_complete_is_the_papers_fifteen_parameters():
    model = build_model(load_robot())
    assert model.name == "complete"
    assert model.names == PAPER
    made = random_motion()
    np.testing.assert_allclose(model.regressor(made), paper.regressor(made.q, made.v, made.a), rtol=0, atol=1e-13)
    units = [parameter.unit for parameter in paper.PARAMETERS]
    assert [column.unit for column in model.columns] == units


def test_reduced_is_the_papers_ten():
    model = build_model(load_robot(), "reduced")
    assert model.names == paper.REDUCED
    made = random_motion()
    columns = [PAPER.index(name) for name in paper.REDUCED]
    expected = paper.regressor(made.q, made.v, made.a)[:, columns]
    np.testing.assert_allclose(model.regressor(made), expected, rtol=0, atol=1e-13)


def test_basic_has_coulomb_viscous_and_offset():
    names = build_model(load_robot(), "basic").names
    assert names == ("P_d1", "P_d2", "P_d3", "P_d4", "P_d5", "a01", "a11", "a02", "a12", "p_o1", "p_o2")


def test_on_other_arms_reduced_keeps_every_base_parameter(tmp_path: Path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    complete, reduced = build_model(robot), build_model(robot, "reduced")
    bases = len(complete.rigid_body.columns)
    assert complete.names[:bases] == reduced.names[:bases]
    assert set(complete.names) - set(reduced.names) == {"a31", "a32", "p_o1", "p_o2"}


def test_another_name_is_refused():
    with pytest.raises(UsageError, match="model 'full': expected one of complete, reduced, basic"):
        build_model(load_robot(), "full")


def test_a_term_knows_its_place():
    model = build_model(load_robot())
    places = [model.place(term) for term in model.terms]
    assert [(place.start, place.stop) for place in places] == [(0, 5), (5, 13), (13, 15)]
    for term, place in zip(model.terms, places, strict=True):
        assert model.columns[place] == tuple(term.columns)
    with pytest.raises(ValueError, match="no such term: offset"):
        model.place(Offset(model.robot))


def test_entries_outside_the_pattern_are_zero_and_those_inside_are_not():
    for name in ("complete", "reduced", "basic"):
        model = build_model(load_robot(), name)
        entries = model.regressor(random_motion())
        np.testing.assert_array_equal(np.any(entries != 0.0, axis=2), model.pattern)


def test_names_are_unique(tmp_path: Path):
    for robot in (load_robot(), load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))):
        names = build_model(robot).names
        assert len(set(names)) == len(names)


def test_an_offset_is_a_sum_of_columns_also_where_weight_stands_for_it():
    for robot in (load_robot(), scara_with_quill()):
        model, moved = build_model(robot), random_motion(robot.n)
        rows = model.regressor(moved)
        for joint, own in enumerate(rows):
            np.testing.assert_allclose(model.constants[joint] @ own, 1.0, rtol=1e-9)
    assert "p_o3" not in model.names
    assert not np.any(build_model(load_robot(), "reduced").constants)
