"""Fixtures of the tests beside."""

from __future__ import annotations

import pytest

from scara_ident.robot.robot import Robot, load_robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot()
