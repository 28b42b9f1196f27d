"""What touches the arm from outside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.errors import UsageError
from scara_ident.robot.kinematics import tool_frame
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class Push(Effect):
    """A force on a point of a link for a time, such as a person's hand: the drives give ``-J^T f`` more.

    The force keeps its direction, which is in the base frame; it comes and goes by half a cosine over ``edge``. The point is
    in the frame of ``link``, by default that link's origin; without a link it is in the last joint's frame, by default the
    tool. May be given several times.
    """

    name: ClassVar[str] = "push"
    units: ClassVar[dict[str, str]] = {
        "force": "N", "time": "s", "duration": "s", "direction": "1", "point": "m", "edge": "s",
    }  # fmt: skip
    bounds: ClassVar[dict[str, tuple[float, float]]] = {
        "time": (0.0, np.inf), "duration": (1e-3, np.inf), "edge": (1e-3, np.inf),
    }  # fmt: skip
    whole_arm = "always"
    spelled: ClassVar[dict[str, str]] = {"time": "from"}
    force: float = 20.0
    time: float = 2.0
    duration: float = 0.8
    direction: Vector = (1.0, 1.0, 1.0)
    link: str | None = None
    point: Vector = (BY_ARM, BY_ARM, BY_ARM)
    edge: float = 0.02

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Give the tool, or the origin of the link that is named."""
        return {"point": tuple(arm.tool.tolist()) if self.link is None else (0.0, 0.0, 0.0)}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Append the force at its point."""
        from scara_ident.simulation.spatial import turned_frames

        length = float(np.linalg.norm(self.direction))
        if length == 0.0:
            raise UsageError(f"{self.name}: direction is zero; give it as x/y/z in the base frame")
        if self.force == 0.0:
            return
        row, point = arm.robot.n - 1, np.array(self.point)
        if self.link is not None:
            frame = tool_frame(arm.robot, self.link)
            row, point = frame.parentJoint - 1, frame.placement.act(point)
        turn = turned_frames(arm.robot.model)[-1][row]
        force = self.force / length * np.array(self.direction)
        times = np.array([self.time, self.time + self.duration, min(self.edge, 0.5 * self.duration)])
        draft.append("push", row, turn.T @ point, force, times)
