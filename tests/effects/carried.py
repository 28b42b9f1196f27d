"""An arm with a mass at its tool, told in two ways: as an effect beside the base model, and within the last body."""

from __future__ import annotations

from dataclasses import replace

from scara_ident.effects import Member, Scene
from scara_ident.effects.links import point_mass, tool_of
from scara_ident.effects.payload import PayloadChange
from scara_ident.effects.signals import ModelledEffect
from scara_ident.robot.robot import Robot
from tests.effects.scenes import scene_of

# From before every recording on.
ALWAYS = Member(None, (-1.0,))


def carrying(scene: Scene, mass: float) -> Scene:
    """The scene of a model that has the mass as an effect."""
    return replace(scene, link_torques=(ModelledEffect(PayloadChange(), ALWAYS, (mass,)),))


def heavier(robot: Robot, mass: float) -> Scene:
    """The scene of a base model whose last body has the mass."""
    scene, tool = scene_of(robot), tool_of(robot)
    term, standard = scene.model.rigid_body, robot.standard_parameters()
    standard[10 * tool.joint : 10 * tool.joint + 10] += mass * point_mass(tool.point)
    value = scene.value.copy()
    value[scene.model.place(term)] = (term.base.grouping @ standard)[term.kept]
    return replace(scene, value=value)
