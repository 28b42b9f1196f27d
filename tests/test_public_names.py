"""The names of the package itself: all documented, loaded when used, and enough for the whole job."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import scara_ident
from scara_ident import (
    Comparison,
    Design,
    Diagnosis,
    Identification,
    compare,
    design_excitation,
    diagnose,
    export_mjcf,
    export_urdf,
    find_base_parameters,
    identify,
    load_robot,
    named_motion,
    read_recordings,
    simulate,
    virtual_arm,
    write_recording,
)
from scara_ident.effects import effects_named
from scara_ident.excitation.search import Effort
from tests.shared import ROOT

NAMES = [name for name in scara_ident.__all__ if name != "__version__"]


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_has_a_docstring(name: str):
    assert len(inspect.getdoc(getattr(scara_ident, name)) or "") > 20


def test_a_type_checker_sees_the_same_names_from_the_same_places():
    tree = ast.parse((ROOT / "scara_ident" / "__init__.py").read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.name: node.module for node in block.body for alias in node.names}
    assert seen == {name: f"scara_ident.{module}" for name, module in scara_ident._HOMES.items()}


def test_the_package_itself_loads_nothing():
    code = "import sys; import scara_ident; print([name for name in sys.modules if name.startswith('scara_ident.')])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert set(NAMES) < set(dir(scara_ident))
    with pytest.raises(AttributeError, match="has no attribute 'identfy'"):
        _ = scara_ident.identfy


@pytest.mark.slow
def test_the_whole_job_is_done_with_public_names(tmp_path: Path):
    robot = load_robot()
    arm = virtual_arm(robot)
    for name, seed in (("OJK", 1), ("OJD", 2)):
        run = simulate(arm, named_motion(name, robot), rate=250.0, seed=seed)
        write_recording(run.recording, tmp_path / f"{name}_1.parquet")
    recordings = read_recordings([tmp_path], robot)
    found = identify(robot, recordings, method="consistent")
    assert isinstance(found, Identification)
    assert len(found.estimate.value) == find_base_parameters(robot).count + 2 * 4 + 2
    table = compare(robot, recordings, bands=found.bands)
    assert isinstance(table, Comparison)
    result = diagnose(robot, recordings, bands=[20.0, 20.0], catalogue=effects_named("spring"))
    assert isinstance(result, Diagnosis)
    design = design_excitation(found.model, duration=5.0, harmonics=3, effort=Effort(starts=1, rounds=1))
    assert isinstance(design, Design)
    assert design.log_det > 0.0
    export_urdf(found, tmp_path / "arm.urdf")
    export_mjcf(found, tmp_path / "arm.xml")
    mass = load_robot(tmp_path / "arm.urdf").standard_parameters()[0]
    assert mass == pytest.approx(found.estimate.standard[0], rel=1e-9)
    assert (tmp_path / "arm.xml").read_text().startswith("<mujoco")


@pytest.mark.slow
def test_of_what_no_arm_can_be_the_nearest_is_exported_and_said(tmp_path: Path):
    robot = load_robot()
    recording = simulate(virtual_arm(robot), named_motion("OJD", robot), rate=250.0).recording
    found = identify(robot, [replace(recording, effort=recording.effort * [[1.0], [-1.0]])], method="ols")
    notes = export_urdf(found, tmp_path / "arm.urdf")
    assert notes[0].startswith("the identified parameters are not physically consistent; ")
