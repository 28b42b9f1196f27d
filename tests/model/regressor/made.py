"""Random trees of joints with random bodies, and states of them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

LINK = 0.33


def scara() -> pin.Model:
    model = pin.Model()
    model.name = "scara"
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint1")
    model.addJoint(first, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([LINK, 0.0, 0.0])), "joint2")
    return model


def states(model: pin.Model, samples: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    q, v, a = (generator.uniform(-size, size, (model.nv, samples)) for size in (7.0, 2.0, 8.0))
    return q, v, a


def consistent_inertia(generator: np.random.Generator) -> pin.Inertia:
    """Draw a body of a few point masses: physically consistent whatever they are."""
    masses = generator.uniform(0.1, 2.0, 5)
    points = generator.normal(scale=0.3, size=(5, 3))
    com = masses @ points / masses.sum()
    rotational = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, points - com, strict=True))
    return pin.Inertia(masses.sum(), com, rotational)


def fill_inertias(model: pin.Model, seed: int) -> np.ndarray:
    """Give every body a random inertia; return the standard parameters."""
    generator = np.random.default_rng(seed)
    for body in range(1, model.njoints):
        model.inertias[body] = consistent_inertia(generator)
    return np.concatenate([model.inertias[body].toDynamicParameters() for body in range(1, model.njoints)])


def random_model(seed: int, bodies: int) -> pin.Model:
    """Build a tree of revolute, unbounded and prismatic joints, axes along coordinates or anywhere."""
    generator = np.random.default_rng(seed)
    plain = [
        pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ,
        pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ,
    ]  # fmt: skip
    free = [pin.JointModelRevoluteUnaligned, pin.JointModelPrismaticUnaligned]
    model = pin.Model()
    model.name = "random"
    model.gravity.linear = generator.normal(scale=6.0, size=3)
    for body in range(bodies):
        choice = generator.integers(len(plain) + len(free))
        if choice < len(plain):
            joint = plain[choice]()
        else:
            axis = generator.normal(size=3)
            joint = free[choice - len(plain)](axis / np.linalg.norm(axis))
        angles = generator.choice([0.0, np.pi / 2, np.pi, 1.57079632679, generator.uniform(-3, 3)], 3)
        offset = generator.normal(scale=0.4, size=3) * generator.integers(0, 2, 3)
        placement = pin.SE3(pin.rpy.rpyToMatrix(*angles), offset)
        model.addJoint(int(generator.integers(max(0, body - 2), body + 1)), joint, placement, f"joint{body + 1}")
    return model


def random_chain(seed: int, joints: int) -> pin.Model:
    """Build a serial chain of revolute and prismatic joints about axes and at angles anywhere."""
    generator = np.random.default_rng(seed)
    model = pin.Model()
    model.name = "chain"
    for body in range(joints):
        axis = generator.normal(size=3)
        kind = pin.JointModelPrismaticUnaligned if generator.random() < 0.25 else pin.JointModelRevoluteUnaligned
        turn = pin.rpy.rpyToMatrix(*generator.uniform(-3.0, 3.0, 3))
        placement = pin.SE3(turn, generator.uniform(-0.3, 0.3, 3))
        model.addJoint(body, kind(axis / np.linalg.norm(axis)), placement, f"joint{body + 1}")
    return model


def configuration(model: pin.Model, q: np.ndarray) -> np.ndarray:
    """Integrate from neutral: Pinocchio's own way from angles to a configuration."""
    return pin.integrate(model, pin.neutral(model), q)
