"""What terms share: the dense regressor of what they fill in, and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scara_ident.model.terms.term import Column, Filled, per_speed
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import load_robot
from tests.arms import Link, motion, write_urdf


@dataclass(frozen=True, eq=False)
class Numbered(Filled):
    """A term whose entry of joint j and column p is 100 j + p plus the joint's position."""

    pattern: np.ndarray
    name: str = "numbered"
    columns: tuple[Column, ...] = ()

    def fill(self, motion: Motion, rows: Sequence[np.ndarray]) -> None:
        for j, row in enumerate(rows):
            for target, p in zip(row, np.flatnonzero(self.pattern[j]), strict=True):
                target[:] = 100.0 * j + p + motion.q[j]


@settings(max_examples=40)
@given(pattern=arrays(np.bool_, st.tuples(st.integers(1, 4), st.integers(0, 6))), samples=st.integers(0, 5))
def test_every_entry_stands_where_the_pattern_has_it_and_all_others_are_zero(pattern: np.ndarray, samples: int):
    n, p = pattern.shape
    q = np.random.default_rng(0).normal(size=(n, samples))
    dense = Numbered(pattern).regressor(motion(q, 0 * q, 0 * q))
    full = 100.0 * np.arange(n)[:, None, None] + np.arange(p)[:, None] + q[:, None]
    np.testing.assert_array_equal(dense, np.where(pattern[:, :, None], full, 0.0))


@pytest.mark.parametrize(
    ("side", "joint", "power", "unit"),
    [
        ("joint", 0, 0, "N m"),
        ("joint", 0, 1, "N m s/rad"),
        ("joint", 0, 2, "N m s^2/rad^2"),
        ("joint", 1, 0, "N"),
        ("joint", 1, 1, "N s/m"),
        ("motor", 1, 3, "N m s^3/m^3"),
    ],
)
def test_a_coefficient_has_the_unit_of_torque_over_speed(tmp_path: Path, side: str, joint: int, power: int, unit: str):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", (Link(), Link(kind="prismatic"))))
    assert per_speed(replace(robot, effort_side=side), joint, power) == unit
