"""Recordings that leave a question open: one small motion of an arm with a spring, twice, on which gravity does as well."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.position import Spring
from scara_ident.effects.tilt import BaseTilt
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import ReferenceMotion, parse_effect, simulate, virtual_arm
from tests.diagnosis.made import BANDS, NOISE, multisine

SPRING = "spring:joint1:stiffness=0.08"
PAIR = "spring of joint1 or base_tilt"


def recorded(motion: ReferenceMotion, seed: int = 1) -> tuple[Recording, ...]:
    """Record a motion twice on the arm with a spring."""
    arm = replace(virtual_arm(), torque_noise=np.array(NOISE))
    spring = [parse_effect(SPRING)]
    return tuple(simulate(arm, motion, effects=spring, seed=seed, repetition=k, rate=250.0).recording for k in (1, 2))


@lru_cache(maxsize=1)
def small_runs() -> tuple[Recording, ...]:
    """Two runs within 0.4 rad about the middle."""
    return recorded(multisine("small", 2, 5.0, 0.4), seed=3)


@lru_cache(maxsize=1)
def open_diagnosis() -> Diagnosis:
    """What these tell of a spring and a tilt."""
    return diagnose(load_robot(), small_runs(), bands=BANDS, catalogue=(Spring(), BaseTilt()))


# Torque noise of an arm with encoders of so many steps a turn, times `NOISE`.
COARSE_STEPS, COARSE_NOISE = 300.0, 3.0


@lru_cache(maxsize=3)
def coarse_diagnosis(seed: int) -> Diagnosis:
    """What an arm with coarse encoders tells: in 20 Hz these make as much of what is left as the torque, and lags of links."""
    arm = replace(virtual_arm(), torque_noise=COARSE_NOISE * np.array(NOISE), encoder_steps=np.full(2, COARSE_STEPS))
    motion = multisine("small", 1, 8.0, 1.0)
    runs = [simulate(arm, motion, seed=seed, repetition=k, rate=250.0).recording for k in (1, 2)]
    return diagnose(arm.robot, runs, bands=(20.0, 20.0), catalogue=(JointElasticity(),))
