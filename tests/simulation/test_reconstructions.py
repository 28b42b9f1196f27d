"""The reconstructions of L1, L2 and CI against the figures that the paper prints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.paper import LINK_LENGTH, TABLE_1, TRAJECTORIES, criteria, regressor, tool_acceleration
from scara_ident.paper.tables import DURATION, POSITION_RANGE_2
from scara_ident.paper.trajectories import SAMPLES
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import RECONSTRUCTIONS, reconstruction, simulate, virtual_arm
from tests.arms import example_urdf


@dataclass(frozen=True)
class Match:
    """One figure of the paper and the reconstruction's."""

    trajectory: str
    quantity: str
    unit: str
    printed: float
    reconstructed: float

    @property
    def relative(self) -> float:
        """Difference relative to the printed figure."""
        return self.reconstructed / self.printed - 1.0


@cache
def match() -> dict[tuple[str, str], Match]:
    """Compare the reconstructions with the figures that the paper prints, once they are asked for: every worker loads this."""
    found: list[Match] = []
    for name in RECONSTRUCTIONS:
        column = TRAJECTORIES.index(name)
        motion = reconstruction(name)
        coarse = motion.at(np.linspace(0.0, motion.duration, SAMPLES))
        log_det, condition = criteria(
            regressor(coarse.position, coarse.velocity, coarse.acceleration, link_length=LINK_LENGTH)
        )
        low, high = POSITION_RANGE_2[column]
        found.append(Match(name, "duration", "s", DURATION[column], motion.duration))
        found.append(Match(name, "smallest q2", "rad", low, float(motion.position[1].min())))
        found.append(Match(name, "largest q2", "rad", high, float(motion.position[1].max())))
        for word, unit, printed, signal in (
            ("velocity", "rad/s", TABLE_1.peak_velocity, motion.velocity),
            ("acceleration", "rad/s^2", TABLE_1.peak_acceleration, motion.acceleration),
        ):
            for j in range(2):
                peak = float(np.abs(signal[j]).max())
                found.append(Match(name, f"peak {word} of joint {j + 1}", unit, printed[j][column], peak))
        found.append(Match(name, "J_d", "", TABLE_1.log_det[column], log_det))
        found.append(Match(name, "J_k", "", TABLE_1.condition[column], condition))
    return {(row.trajectory, row.quantity): row for row in found}


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_what_a_path_can_match_is_matched(name: str) -> None:
    assert match()[name, "duration"].relative == 0.0
    for end in ("smallest q2", "largest q2"):
        row = match()[name, end]
        assert abs(row.reconstructed - row.printed) < 0.005  # half of the last printed digit
    for kind in ("velocity", "acceleration"):
        for joint in (1, 2):
            assert abs(match()[name, f"peak {kind} of joint {joint}"].relative) < 0.07


def test_indexes_come_out_close_and_in_the_papers_order() -> None:
    for name, tolerance in (("L1", 1.0), ("CI", 1.0), ("L2", 4.5)):
        row = match()[name, "J_d"]
        assert abs(row.reconstructed - row.printed) < tolerance
    order = [
        sorted(RECONSTRUCTIONS, key=lambda n: getattr(match()[n, "J_d"], side)) for side in ("printed", "reconstructed")
    ]
    assert order[0] == order[1] == ["L2", "CI", "L1"]
    for name in RECONSTRUCTIONS:
        assert abs(np.log10(1.0 + match()[name, "J_k"].relative)) < 0.2


@pytest.mark.slow
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


def test_what_is_no_reconstruction_is_refused() -> None:
    with pytest.raises(UsageError, match="there are L1, L2, CI"):
        reconstruction("OJD")
    with pytest.raises(UsageError, match="is for the SCARA03's two"):
        reconstruction("L1", load_robot(example_urdf("ur5_robot.urdf")))
