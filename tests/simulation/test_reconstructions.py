"""The reconstructions of L1, L2 and CI against the figures that the paper prints."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.paper import tool_acceleration
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import RECONSTRUCTIONS, reconstruction, reconstruction_match, simulate, virtual_arm
from scara_ident.simulation.reconstructions import print_reconstruction_match
from tests.arms import example_urdf

MATCH = {(row.trajectory, row.quantity): row for row in reconstruction_match()}


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_what_a_path_can_match_is_matched(name: str) -> None:
    assert MATCH[name, "duration"].relative == 0.0
    for end in ("smallest q2", "largest q2"):
        row = MATCH[name, end]
        assert abs(row.reconstructed - row.printed) < 0.005  # half of the last printed digit
    for kind in ("velocity", "acceleration"):
        for joint in (1, 2):
            assert abs(MATCH[name, f"peak {kind} of joint {joint}"].relative) < 0.07


def test_indexes_come_out_close_and_in_the_papers_order() -> None:
    for name, tolerance in (("L1", 1.0), ("CI", 1.0), ("L2", 4.5)):
        row = MATCH[name, "J_d"]
        assert abs(row.reconstructed - row.printed) < tolerance
    order = [
        sorted(RECONSTRUCTIONS, key=lambda n: getattr(MATCH[n, "J_d"], side)) for side in ("printed", "reconstructed")
    ]
    assert order[0] == order[1] == ["L2", "CI", "L1"]
    for name in RECONSTRUCTIONS:
        assert abs(np.log10(1.0 + MATCH[name, "J_k"].relative)) < 0.2


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_a_reconstruction_is_smooth_and_within_the_arms_limits(name: str) -> None:
    robot = load_robot()
    motion = reconstruction(name)
    assert np.all(motion.position >= robot.lower[:, None])
    assert np.all(motion.position <= robot.upper[:, None])
    assert np.all(np.abs(motion.velocity).max(axis=1) < robot.velocity_limit)
    assert tool_acceleration(motion.position, motion.velocity, motion.acceleration).max() < 9.0
    assert np.all(motion.velocity[:, [0, -1]] == 0.0)
    slope = np.gradient(motion.position, motion.time, axis=1)
    np.testing.assert_allclose(slope, motion.velocity, atol=0.02)


def test_the_virtual_arm_follows_a_reconstruction() -> None:
    motion = reconstruction("L2")
    result = simulate(virtual_arm(), motion)
    assert result.recording.name == "L2_1"
    assert np.abs(result.true.position - motion.position).max() < 0.05


def test_the_printed_table_says_what_it_is() -> None:
    lines: list[str] = []
    print_reconstruction_match(lines.append)
    assert "not the originals" in lines[0]
    assert len(lines) == 2 + 3 * 9


def test_what_is_no_reconstruction_is_refused() -> None:
    with pytest.raises(UsageError, match="there are L1, L2, CI"):
        reconstruction("OJD")
    with pytest.raises(UsageError, match="is for the SCARA03's two"):
        reconstruction("L1", load_robot(example_urdf("ur5_robot.urdf")))
