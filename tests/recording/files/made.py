"""Descriptions of files, and how recordings out of them are compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.recording.recording import Recording, read_recording
from scara_ident.robot.robot import Robot, embedded_urdf, load_robot
from tests.made_recordings import save
from tests.recording.files.formats import (
    JOINTS,
    recorded,
)

MADE = recorded()


def described(folder: Path, recording: str, joints: str = "{joint1: {}, joint2: {}}") -> Robot:
    path = folder / "robot.yaml"
    text = f"urdf: {embedded_urdf()}\neffort_side: motor\njoints: {joints}\nrecording: {recording}\n"
    path.write_text(text, encoding="utf-8")
    return load_robot(path)


def expected(folder: Path) -> Recording:
    return read_recording(save(folder / "expected.parquet", MADE), load_robot())


def assert_same(found: Recording, wanted: Recording, *, clock: float = 1e-12) -> None:
    assert found.joints == wanted.joints
    np.testing.assert_allclose(found.time - found.time[0], wanted.time - wanted.time[0], rtol=0, atol=clock)
    for signal in ("position", "effort", "velocity"):
        np.testing.assert_allclose(getattr(found, signal), getattr(wanted, signal), rtol=1e-12, atol=1e-12)


def stacked(signal: str, factor: float = 1.0) -> np.ndarray:
    return factor * np.array([MADE[f"{joint}.{signal}"] for joint in JOINTS])


PLOTJUGGLER = "{time: {column: __time}, position: {column: '/joint_states/{joint}/position'}, \
velocity: {column: '/joint_states/{joint}/velocity'}, effort: {column: '/joint_states/{joint}/effort'}}"
