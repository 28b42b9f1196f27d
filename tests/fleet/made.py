"""A small fleet on disk: arms of one kind with noise and friction of their own on every date, one of which wears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from scara_ident.effects.links import point_mass, tool_of
from scara_ident.fleet.history import History, noise_of
from scara_ident.fleet.visit import Visit, _visit
from scara_ident.model.model import build_model
from scara_ident.motion.motion import Motion
from scara_ident.paper import OJD, table5_parameters
from scara_ident.recording.recording import Recording, write_recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import noisy, recorded_torque, recording, sines
from tests.excitation.made import scara_with_quill

RATE, SECONDS = 200.0, 10.0
DATES = ("2026-01-15", "2026-02-15", "2026-03-15", "2026-04-15", "2026-05-15", "2026-06-15")
WORN = "arm2"
# Coulomb friction of joint 2 of the arm that wears, by date, as a ratio.
WEAR = (1.0, 1.0, 1.15, 1.3, 1.45, 1.6)


@cache
def _parts() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    robot, time = load_robot(), np.arange(round(SECONDS * RATE)) / RATE
    q, v, a = OJD.motion(time)
    rigid = recorded_torque(robot, q, v, a, [(0.0,) * 5] * 2)
    truth = table5_parameters("OJD")
    friction = np.array([truth[5 + 4 * j : 9 + 4 * j] for j in range(2)])
    speed = v
    each = np.array([np.sign(speed), speed, np.abs(speed) * speed, speed**3])
    return time, q, rigid, friction, each


def run_of(arm: int, date: int, wear: float = 1.0) -> Recording:
    """One run of one arm on one date; all friction differs by 2 % from date to date."""
    random = np.random.default_rng([arm, date])
    time, q, rigid, friction, each = _parts()
    own = friction * (1.0 + 0.02 * random.standard_normal((2, 1)))
    own[1, 0] *= wear
    torque = rigid + np.einsum("jp,pjt->jt", own, each)
    return noisy(recording(load_robot(), "OJD_1", time, q, torque), random, (0.02, 0.008))


def write_fleet(folder: Path, arms: int = 4, dates: int = len(DATES), suffix: str = ".csv") -> Path:
    """Write a fleet, a folder for each date; of ``arm2`` the Coulomb friction of joint 2 rises from March on."""
    for arm in range(1, arms + 1):
        for k, date in enumerate(DATES[:dates]):
            place = folder / f"arm{arm}" / date
            place.mkdir(parents=True)
            wear = WEAR[k] if f"arm{arm}" == WORN else 1.0
            write_recording(run_of(arm, k, wear), place / f"OJD_1{suffix}")
    return folder


def drawn(first: Visit, random: np.random.Generator) -> Visit:
    """A date of nothing but noise, in the columns of the first."""
    factors = []
    for factor, rows in zip(first.factors, first.rows, strict=True):
        own = factor.copy()
        known = factor.shape[1] - 1
        own[:known, known] = noise_of(factor, rows) * random.standard_normal(known)
        factors.append(own)
    return replace(first, factors=tuple(factors))


@cache
def _swing(speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return sines(np.random.default_rng(3), np.arange(round(SECONDS * RATE)) / RATE, 3, lowest=speed)


@cache
def _of_payload(speed: float) -> np.ndarray:
    """Torque of 1 kg at the tool, shape (3, N)."""
    robot, (q, v, a) = scara_with_quill(), _swing(speed)
    motion = Motion("swing_1", "swing", np.arange(q.shape[1]) / RATE, q, v, a, None, RATE)
    tool = tool_of(robot)
    torque = np.einsum("jpt,p->jt", tool.columns(robot, motion), point_mass(tool.point))
    turns = robot.reduction[1] * q[1]
    torque[1] += 0.01 * np.sqrt(2.0 * np.mean(torque[1] ** 2)) * np.sin(3.0 * turns)
    return torque


@cache
def _quill_parts(speed: float) -> tuple[Robot, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    robot, time = scara_with_quill(), np.arange(round(SECONDS * RATE)) / RATE
    q, v, a = _swing(speed)
    rigid = recorded_torque(robot, q, v, a, [(0.0,) * 5] * 3)
    own = robot.drive_sign[:, None] * v
    return robot, time, q, rigid, np.array([np.sign(own), own])


def quill_fleet(
    seed: int, scatter: Sequence[float], gain: float = 0.0, speed: float = 0.3, payload: float = 0.0
) -> tuple[History, ...]:
    """Four arms whose last joint goes up and down, on six dates.

    Parameters
    ----------
    scatter : sequence of float
        Standard deviations from date to date of Coulomb friction, viscous friction and torque scale, as shares and each of its own,
        and of the offset of the last joint as a share of its weight.
    gain : float
        By what share of its torque joint 2 of `WORN` is recorded as more from the fourth date on.
    payload : float
        What `WORN` carries at its tool from the fourth date on, kg. Of its torque on joint 2 a hundredth is a ripple.
    """
    robot, time, q, rigid, each = _quill_parts(speed)
    model, random, found = build_model(robot), np.random.default_rng(seed), []
    noise = 0.01 * np.sqrt(np.mean(rigid**2, axis=1))
    friction = 0.2 * np.sqrt(np.mean(rigid**2, axis=1) / np.mean(each**2, axis=2))
    for arm in ("arm1", WORN, "arm3", "arm4"):
        visits: list[Visit] = []
        for k in range(len(DATES)):
            share = 1.0 + np.array(scatter[:3])[:, None] * random.standard_normal((3, 3))
            torque = rigid + np.einsum("pj,pjt->jt", friction * share[:2], each)
            torque *= share[2][:, None]
            torque[2] += scatter[3] * np.mean(rigid[2]) * random.standard_normal()
            if arm == WORN and k >= 3:
                torque[1] *= 1.0 + gain
                torque += payload * _of_payload(speed)
            run = noisy(recording(robot, "swing_1", time, q, torque), random, noise)
            visits.append(_visit(model, [run], visits[0].reference if visits else None))
        found.append(History(arm, DATES, tuple(visits), model))
    return tuple(found)
