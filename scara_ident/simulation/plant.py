"""The plant that the compiled loop integrates: the arm and its effects as plain arrays on the joint side of the gears.

Rows are in Pinocchio's order of joints. Recorded-side constants are brought to the joint side with
``torque at the joint = scale x recorded torque``, where scale is N on the motor side and 1 on the joint side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# What a joint may have several of -> lengths of their values, 0 for a number. The force of a push is in the base frame, its
# point in the turned frame of its joint, its times are begin, end and length of the edges.
FAMILIES: dict[str, dict[str, int]] = {
    "ripple": {"order": 0, "amplitude": 0, "phase": 0},
    "vibration": {"frequency": 0, "amplitude": 0, "phase": 0},
    "shaft": {"other": 0, "sign": 0, "inertia": 0, "viscous": 0, "coulomb": 0},
    "push": {"point": 3, "force": 3, "time": 3},
}


class Plant(NamedTuple):
    """Arrays of the compiled loop; see `PlantDraft` for their meaning."""

    parent: NDArray[np.int64]
    prismatic: NDArray[np.bool_]
    rotation: Array
    offset: Array
    bodies: Array
    gravity: Array
    armature: Array
    friction: Array
    constant: Array
    direction_matters: NDArray[np.bool_]
    stribeck_amplitude: Array
    stribeck_velocity: Array
    asymmetry: Array
    presliding: Array
    smooth_velocity: Array
    warm_share: Array
    warm_time: Array
    position_share: Array
    position_phase: Array
    position_order: Array
    spring: Array
    spring_rest: Array
    efficiency: Array
    elastic: NDArray[np.bool_]
    stiffness: Array
    damping: Array
    width: Array
    coupled: bool
    coupling_viscous: Array
    coupling_coulomb: Array
    ripple_joint: NDArray[np.int64]
    ripple_order: Array
    ripple_amplitude: Array
    ripple_phase: Array
    vibration_joint: NDArray[np.int64]
    vibration_frequency: Array
    vibration_amplitude: Array
    vibration_phase: Array
    signed_sine: Array
    signed_sine_of: NDArray[np.int64]
    swinging_viscous: Array
    swinging_viscous_of: NDArray[np.int64]
    payload_body: Array
    payload_span: Array
    shaft_joint: NDArray[np.int64]
    shaft_other: NDArray[np.int64]
    shaft_sign: Array
    shaft_inertia: Array
    shaft_viscous: Array
    shaft_coulomb: Array
    push_joint: NDArray[np.int64]
    push_point: Array
    push_force: Array
    push_time: Array


class Sensors(NamedTuple):
    """What the controller sees and what the drive can give."""

    resolution: Array
    shift: Array
    eccentricity: Array
    eccentricity_order: Array
    eccentricity_phase: Array
    torque_limit: Array


@dataclass
class PlantDraft:
    """An arm without effects, to which effects add themselves before the loop is compiled in.

    Attributes
    ----------
    scale : ndarray, shape (n,)
        Torque at the joint per recorded torque, Pinocchio's order.
    reduction : ndarray, shape (n,)
        Motor angle per joint angle.
    arrays : dict
        Fields of `Plant`, in joint-side SI units.
    sensors : dict
        Fields of `Sensors`.
    delay : ndarray, shape (n,)
        Time by which the recorded effort lags, s.
    lag : ndarray, shape (n,)
        Time constant of a first-order filter of the recorded effort, s.
    position_lag : float
        The same of the recorded positions.
    gain : ndarray, shape (n,)
        Recorded per true torque.
    cubic : ndarray, shape (n,)
        1/(N m)^2, on the recorded side.
    square : ndarray, shape (n,)
        1/(N m), on the recorded side.
    drift : ndarray, shape (n,)
        Rate of the recorded torque's offset, N m/s.
    shift : ndarray, shape (n,)
        Offset of the recorded torque that the drive does not give, N m.
    zero : ndarray, shape (n,)
        Position of the joint less that recorded, rad or m.
    pickup : list of (int, float, float, float)
        Joint, order per joint turn, amplitude and phase of a ripple that only the torque sensor sees.
    """

    n: int
    scale: Array
    reduction: Array
    arrays: dict[str, Array]
    sensors: dict[str, Array]
    delay: Array
    lag: Array
    position_lag: float
    gain: Array
    cubic: Array
    square: Array
    drift: Array
    shift: Array
    zero: Array
    pickup: list[tuple[int, float, float, float]]

    def array(self, name: str) -> Array:
        """Return an array of the plant, or of the measurement."""
        return self.arrays[name] if name in self.arrays else np.asarray(getattr(self, name))

    def carry(self, body: Array, span: Array) -> None:
        """Add a payload to the last body: standard parameters in its turned frame, when it comes and when it goes, s."""
        self.arrays["payload_body"] = np.vstack([self.arrays["payload_body"], body])
        self.arrays["payload_span"] = np.vstack([self.arrays["payload_span"], span])

    def append(self, family: str, joint: int, *values: float | Array) -> None:
        """Append a row to a family of `FAMILIES`, with its values in that order."""
        for name, value in zip(("joint", *FAMILIES[family]), (joint, *values), strict=True):
            key = f"{family}_{name}"
            self.arrays[key] = np.concatenate([self.arrays[key], np.array([value], dtype=float)])

    def plant(self) -> Plant:
        """Freeze the plant."""
        a = self.arrays
        coupled = bool(np.any(a["coupling_viscous"]) or np.any(a["coupling_coulomb"]))
        dry = (
            (a["friction"][:, 0] != 0.0)
            | (a["stribeck_amplitude"] != 0.0)
            | (a["signed_sine"] != 0.0)
            | (a["efficiency"] < 1.0)
        )
        seen = np.any(a["coupling_coulomb"] != 0.0, axis=0)
        matters = (dry | seen) & (a["presliding"] == 0.0) & (a["smooth_velocity"] == 0.0)
        integers = {
            "parent",
            "shaft_other",
            "signed_sine_of",
            "swinging_viscous_of",
            *(f"{name}_joint" for name in FAMILIES),
        }
        flags = {"prismatic", "elastic"}
        values: dict[str, Any] = {}
        for name in Plant._fields:
            if name in ("coupled", "direction_matters"):
                continue
            kind = np.int64 if name in integers else np.bool_ if name in flags else np.float64
            values[name] = np.ascontiguousarray(a[name], dtype=kind)
        return Plant(**values, coupled=coupled, direction_matters=matters)

    def sensing(self) -> Sensors:
        """Freeze the sensors."""
        return Sensors(**{name: np.ascontiguousarray(self.sensors[name], dtype=float) for name in Sensors._fields})


def empty_draft(n: int, scale: Array, reduction: Array) -> PlantDraft:
    """Return a draft with no effect and no bodies; the arm fills in the rest."""
    zero = np.zeros(n)
    per_joint = (
        "constant stribeck_amplitude asymmetry presliding smooth_velocity warm_share position_share position_phase spring "
        "spring_rest elastic stiffness damping width signed_sine swinging_viscous"
    )
    arrays: dict[str, Array] = {name: zero.copy() for name in per_joint.split()}
    arrays |= {name: np.ones(n) for name in ("stribeck_velocity", "warm_time", "position_order", "efficiency")}
    arrays |= {name: np.zeros((n, n)) for name in ("coupling_viscous", "coupling_coulomb")}
    arrays |= {name: zero.copy() for name in ("signed_sine_of", "swinging_viscous_of")}
    for family, lengths in FAMILIES.items():
        arrays[f"{family}_joint"] = np.zeros(0)
        arrays |= {f"{family}_{name}": np.zeros((0, length) if length else 0) for name, length in lengths.items()}
    arrays |= {"payload_body": np.zeros((0, 10)), "payload_span": np.zeros((0, 2))}
    sensors = {name: zero.copy() for name in ("eccentricity", "eccentricity_order", "eccentricity_phase", "shift")}
    return PlantDraft(
        n=n,
        scale=scale,
        reduction=reduction,
        arrays=arrays,
        sensors=sensors,
        delay=zero.copy(),
        lag=zero.copy(),
        position_lag=0.0,
        gain=np.ones(n),
        cubic=zero.copy(),
        square=zero.copy(),
        drift=zero.copy(),
        shift=zero.copy(),
        zero=zero.copy(),
        pickup=[],
    )
