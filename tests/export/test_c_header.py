"""The C header: compiled without a warning as C99 and C++17, against the model, with double and float."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from scara_ident.export.c_header import c_header, c_name
from scara_ident.export.traced_model import trace_model
from tests.export.identified import model_torque, states

# Each compiler and each kind of number once.
COMPILERS = ((("gcc", "-std=c99"), "double"), (("g++", "-std=c++17"), "float"))


@pytest.mark.slow
@pytest.mark.parametrize(("command", "real"), COMPILERS, ids=["C99, double", "C++17, float"])
def test_it_compiles_without_a_warning_and_gives_the_model_s_torque(models, readers, tmp_path, command, real):
    if shutil.which(command[0]) is None:
        pytest.skip(f"needs the compiler {command[0]}")
    found = models["panda", True]
    robot, motion = found.robot, states(found.robot, 3, 20)
    (tmp_path / "arm.h").write_text(c_header(trace_model(found.model, found.value), ("a note */ with an end",)))
    library = readers.compiled(tmp_path / "arm.h", robot, command, real)
    dtype, digits = (np.float64, 1e-12) if real == "double" else (np.float32, 2e-6)
    state = (motion.q, motion.v, motion.a)
    torque = readers.called(library.torque, state, robot.n, dtype)
    expected = model_torque(found, found.value, motion)
    np.testing.assert_allclose(torque, expected, rtol=0, atol=digits * np.max(np.abs(expected)))
    mass = readers.called(library.mass, state[:1], robot.n**2, dtype).reshape(robot.n, robot.n, -1)
    parts = np.einsum("jkn,kn->jn", mass, motion.a) + readers.called(library.bias, state[:2], robot.n, dtype)
    parts += readers.called(library.friction, state, robot.n, dtype)
    np.testing.assert_allclose(parts, expected, rtol=0, atol=digits * np.max(np.abs(expected)))


def test_it_allocates_nothing_and_does_not_branch(models):
    text = c_header(trace_model(models["ur5", True].model, models["ur5", True].value))
    code = text[text.index("#include") :]
    for word in ("malloc", "new ", "if (", "for (", "while", "?", "static const"):
        assert word not in code
    assert code.count("#include") == 1


@pytest.mark.parametrize(("name", "found"), [("UR5", "ur5"), ("my arm-2", "my_arm_2"), ("6R", "arm_6r"), ("é", "arm_")])
def test_names_of_robots_become_names_in_c(name, found):
    assert c_name(name) == found
