"""When more recordings no longer pay: the expected standard deviation after each designed motion, against the wanted one."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.estimation.information import Information, merge
from scara_ident.excitation.design import Design, information_of
from scara_ident.memory import read_text
from scara_ident.robot.robot import Robot

# Noise of a torque is given as its rms below this frequency, Hz.
NOISE_BAND = 50.0
# Most recordings of every motion that are worth naming.
MAX_REPETITIONS = 1000


@dataclass(frozen=True)
class After:
    """What is expected once the first so many motions are recorded.

    Attributes
    ----------
    motions : int
        0: with the recordings at hand.
    seconds : float
        Of arm time so far, s.
    parameter : str
        The one that is farthest from what is asked.
    std, asked : float
        Of it, in its unit.
    """

    motions: int
    seconds: float
    parameter: str
    std: float
    asked: float

    @property
    def share(self) -> float:
        """Expected std over the asked one; at most 1 where all parameters are as sure as asked."""
        return self.std / self.asked

    def entry(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {**vars(self), "share": self.share}


@dataclass(frozen=True)
class Stopping:
    """Motions in the order of recording, and which is the first that suffices.

    Attributes
    ----------
    after : tuple of After
        With the recordings at hand, if there are any, then after each motion.
    repetitions : int or None
        How often each motion is to be recorded so that all suffice; 0 where the recordings at hand do, None where no
        number does.
    not_judged : tuple of str
        Parameters of which no std is asked, as no value is known.
    """

    after: tuple[After, ...]
    repetitions: int | None
    not_judged: tuple[str, ...]

    @property
    def suffices(self) -> int | None:
        """The first motion after which all is as sure as asked; 0: no recording pays; None: not all of them do."""
        return next((each.motions for each in self.after if each.share <= 1.0), None)

    def entry(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {
            "after": [each.entry() for each in self.after],
            "suffices": self.suffices,
            "repetitions": self.repetitions,
            "not_judged": list(self.not_judged),
        }

    def words(self) -> str:
        """Say it in a sentence, and what is not judged in another."""
        unjudged = f" Not judged, because no value is known to take a percentage of: {', '.join(self.not_judged)}."
        return f"{self._verdict()}{unjudged if self.not_judged else ''}"

    def _verdict(self) -> str:
        last, first = self.after[-1], self.suffices
        worst = f"{last.parameter}, {last.std:.3g} instead of {last.asked:.3g}"
        if first == 0:
            return "The existing recordings reach the requested std: no more are needed."
        if first is not None:
            seconds = next(each.seconds for each in self.after if each.motions == first)
            more = "" if first == last.motions else "; the others are not needed"
            return f"Motion {first} of {last.motions}, at {seconds:g} s of arm time, is enough for the requested std{more}."
        if self.repetitions is None:
            return f"No number of these motions gives the requested std: the worst parameter is {worst}."
        return f"The requested std takes {self.repetitions} recordings of each motion: after one the worst parameter is {worst}."


def stopping(design: Design, asked: Mapping[str, float], not_judged: Sequence[str] = ()) -> Stopping:
    """Say after which motion of a design the parameters are as sure as asked.

    Parameters
    ----------
    design : Design
        Made with the noise of the torques, and with what was known before weighted by it.
    asked : mapping from parameter to std
        In the parameter's unit.
    not_judged : sequence of str

    Notes
    -----
    Noise is taken to be white, as by `Design.std`: what repeats between recordings is not averaged away.
    """
    names = design.model.names
    columns = np.array([names.index(name) for name in asked])
    wanted = np.array(list(asked.values()))

    def farthest(known: Information, motions: int, seconds: float) -> After:
        std = known.std()[columns]
        worst = int(np.argmax(std / wanted))
        return After(motions, seconds, names[columns[worst]], float(std[worst]), float(wanted[worst]))

    known = Information.empty(len(names)) if design.prior is None else design.prior
    after = [] if design.prior is None else [farthest(known, 0, 0.0)]
    seconds = 0.0
    for count, (each, samples) in enumerate(zip(design.trajectories, design.samples, strict=True), 1):
        known = merge([known, information_of(design.model, each, samples, design.weights)])
        seconds += each.duration
        after.append(farthest(known, count, seconds))

    def enough(repetitions: int) -> bool:
        more = design.information.scaled(float(np.sqrt(repetitions)))
        total = more if design.prior is None else merge([design.prior, more])
        return farthest(total, 0, 0.0).share <= 1.0

    low, high = (0, 1) if design.prior is None else (-1, 0)
    while high <= MAX_REPETITIONS and not enough(high):
        low, high = high, max(1, 2 * high)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return Stopping(tuple(after), high if high <= MAX_REPETITIONS else None, tuple(not_judged))


def asked_std(words: Sequence[str], values: Mapping[str, float]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Read what std is asked: ``5`` or ``5%`` of every value, ``NAME=STD`` of one parameter.

    Parameters
    ----------
    words : sequence of str
    values : mapping from parameter to value
        The parameters to be judged, 0 where no value is known.

    Returns
    -------
    asked : dict
        std by parameter, in its unit.
    not_judged : tuple of str
        Parameters that a percentage says nothing about.

    Raises
    ------
    UsageError
        If a word is none of these, or no parameter is judged.
    """
    asked: dict[str, float] = {}
    percents: list[float] = []
    for word in words:
        name, sign, text = word.rpartition("=")
        try:
            size = float(text.removesuffix("%"))
        except ValueError:
            size = np.nan
        if not 0.0 < size < np.inf or (sign and text.endswith("%")):
            raise UsageError(f"--asked-std {word}: expected a percentage such as 5, or NAME=STD, such as a01=0.02")
        if sign and name not in values:
            raise UsageError(f"--asked-std {word}: parameter {name!r} is not among those judged: {', '.join(values)}")
        if sign:
            asked[name] = size
        else:
            percents.append(size)
    if len(percents) > 1:
        raise UsageError("--asked-std: two percentages; give one, and NAME=STD for single parameters")
    for name, value in values.items() if percents else ():
        if name not in asked and value != 0.0:
            asked[name] = 0.01 * percents[0] * abs(value)
    if not asked:
        raise UsageError("--asked-std: no value is known to take a percentage of; give --parameters, or NAME=STD")
    return asked, tuple(name for name in values if name not in asked) if percents else ()


def noise_of(robot: Robot, given: Mapping[str, float], identification: Path | None) -> Array:
    """Return the noise of the joints' torques, as rms below `NOISE_BAND`, shape (n,).

    Parameters
    ----------
    robot : Robot
    given : mapping from joint to rms
    identification : Path, optional
        An ``identification.json``, whose residual counts where nothing is given.

    Raises
    ------
    UsageError
        If a joint has no noise, or it makes no sense.
    """
    found = {} if identification is None else _residual(identification)
    for name, value in given.items():
        if name not in robot.joints:
            raise UsageError(f"noise of {name!r}: the robot has no such joint; its joints: {', '.join(robot.joints)}")
        if not 0.0 < value < np.inf:
            raise UsageError(f"noise of {name}: {value:g}; expected a number above 0")
    found = {**found, **given}
    missing = [name for name in robot.joints if name not in found]
    if missing:
        raise UsageError(
            f"--asked-std: the noise of {', '.join(missing)} is not known; give --noise {missing[0]}=RMS, or --parameters"
        )
    return np.array([found[name] for name in robot.joints])


def _residual(path: Path) -> dict[str, float]:
    """Largest rms of the residual over the training recordings by joint, as if it were white up to `NOISE_BAND`."""
    try:
        content = json.loads(read_text(path))
        bands = content.get("band_hz") or {}
        rms: dict[str, float] = {}
        for joints in content["errors"]["training"].values():
            for name, each in joints.items():
                band = bands.get(name) or NOISE_BAND
                rms[name] = max(rms.get(name, 0.0), each["rms"] * np.sqrt(max(1.0, NOISE_BAND / band)))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise ScaraIdentError(f"{path}: no training errors in it; give the noise by --noise JOINT=RMS") from None
    return {name: value for name, value in rms.items() if value > 0.0}
