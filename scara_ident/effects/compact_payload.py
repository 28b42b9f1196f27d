"""A point-like payload carried in some recordings: tested in the place of a body that comes out as physically impossible."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.links import point_mass, tool_of
from scara_ident.effects.parameters import Member, NonlinearParameter
from scara_ident.effects.payload import (
    BODY_COLUMN_SHARE,
    BODY_COLUMNS,
    SHORTEST_ARM,
    PayloadOfRecordings,
    body_columns,
    shown_of,
)
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.base_parameters import size_of
from scara_ident.robot.robot import Robot

# Share of the arm's size by which places of the mass are told apart before they are fitted.
RESOLUTION = 0.1
# No last link reaches farther, m; what an arm can have is said by its size.
MAX_REACH = 10.0


@dataclass(frozen=True)
class CompactPayload(PayloadOfRecordings):
    """A mass at one point of the last link in some recordings and not in others.

    Ten free parameters of a body take up what else differs between recordings, as friction that grows with the load, and may
    then be those of no body, its mass below zero. All moments of a mass at a point follow from the mass and where it sits.
    """

    nonlinear: ClassVar[tuple[NonlinearParameter, ...]] = tuple(
        NonlinearParameter(f"com_{axis}", "m", -MAX_REACH, MAX_REACH, False) for axis in "xyz"
    )

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return none: it is tried in the place of a body alone."""
        return ()

    def in_place_of(self, scene: Scene, effect: Effect, member: Member, value: Array) -> Member | None:
        """Return a mass in the recordings of a body mounted anyhow, where torque tells mass and place.

        It begins as far out as the tool, where the first moments of the body point, as a mass above zero has them.
        """
        shown = _shown(scene.robot)
        anyhow = type(effect) is PayloadOfRecordings and not effect.at_tool
        if not anyhow or not {0, 1, 2, 3} <= {*shown}:
            return None
        point = tool_of(scene.robot).point
        moments = value[[shown.index(k) for k in (1, 2, 3)]]
        out = max(float(np.linalg.norm(point)), SHORTEST_ARM * size_of(scene.robot))
        size = float(np.linalg.norm(moments))
        return replace(member, nonlinear=tuple((moments * (out / size) if size else point).tolist()))

    def limits(self, scene: Scene, member: Member) -> tuple[tuple[float, float], ...]:
        """Return the size of the arm to either side of the last joint."""
        size = size_of(scene.robot)
        return ((-size, size),) * len(self.nonlinear)

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return a share of the size of the arm."""
        return (RESOLUTION * size_of(scene.robot),) * len(self.nonlinear)

    def carried(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torque of 1 kg at the point."""
        shown = _shown(signals.scene.robot)
        body = point_mass(np.array(member.nonlinear))[list(shown)]
        return [np.einsum("jkn,k->jn", body_columns(signals, shown), body)]

    def _determined(self, robot: Robot) -> tuple[int, ...]:
        """Return the mass: all else follows from it and the point."""
        return (0,)


def _shown(robot: Robot) -> tuple[int, ...]:
    return shown_of(robot, BODY_COLUMNS, BODY_COLUMN_SHARE)
