"""Audit of a recorded velocity against the differentiated position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.motion.low_pass import derivative
from scara_ident.motion.motion import Stretch
from scara_ident.recording.recording import Recording

# What is worth saying: a lag of more than this many samples, a gain off by more, a part that is not velocity.
LAG_SAMPLES = 0.5
GAIN_ERROR = 0.02
UNRELATED = 0.05
# Cut-off for the comparison as a share of the sample rate.
COMPARE_BAND = 0.04
# The words of a velocity that is another multiple of the slope.
OTHER_UNIT = "it is {} times the derivative of the position"


@dataclass(frozen=True)
class VelocityFault:
    """What is wrong with a recorded velocity.

    Attributes
    ----------
    words : str
        With ``{}`` in the place of how much; what has the same words is the same fault.
    size : float
    form : str
        How it is written.
    """

    words: str
    size: float = 0.0
    form: str = ""


@dataclass(frozen=True)
class VelocityAudit:
    """How a recorded velocity relates to the position's derivative.

    Attributes
    ----------
    gain : float
        Recorded velocity per derivative of the position; 1 when they agree, 57.3 for degrees.
    lag : float
        s by which the recorded velocity comes later, as after a filter.
    unrelated : float
        Share of the recorded velocity's rms that neither explains.
    """

    joint: str
    gain: float
    lag: float
    unrelated: float

    def fault(self, rate: float) -> VelocityFault | None:
        """Return what a person should know, None when the velocity is what it says."""
        if self.gain == 0.0:
            return VelocityFault("it is 0 while the position moves")
        if self.unrelated > UNRELATED:
            return VelocityFault("{} of it is not the derivative of the position", self.unrelated, ".0%")
        if abs(self.gain - 1.0) > GAIN_ERROR:
            degrees = " (looks like degrees)" if abs(self.gain / np.degrees(1.0) - 1.0) < GAIN_ERROR else ""
            return VelocityFault(f"{OTHER_UNIT}{degrees}", self.gain, ".4g")
        if abs(self.lag) * rate > LAG_SAMPLES:
            verb = "lags" if self.lag > 0 else "leads"
            return VelocityFault(
                f"it {verb} the position by {{}} ms, like the output of a filter", abs(self.lag) * 1e3, ".2g"
            )
        return None

    def verdict(self, rate: float) -> str | None:
        """Return `fault` in words."""
        fault = self.fault(rate)
        return None if fault is None else faults_in_words([fault])


def faults_in_words(faults: Sequence[VelocityFault], moving: int = 0) -> str:
    """Return the words of the same fault on several joints or recordings, with the range of its size.

    Parameters
    ----------
    moving : int, optional
        Joints that move in each recording, where all have the fault: a factor that they share may be that of time.
    """
    sizes = [fault.size for fault in faults]
    ends = dict.fromkeys(format(size, faults[0].form) for size in (min(sizes), max(sizes)))
    said = faults[0].words.format(" to ".join(ends))
    alike = max(sizes) - min(sizes) < GAIN_ERROR * min(sizes)
    if faults[0].words == OTHER_UNIT and moving and alike:
        where = " on every joint" if moving > 1 else ""
        return f"{said}{where}: is the unit or rate of time wrong, or the unit of velocity?"
    return said


def velocity_remarks(audited: Sequence[tuple[str, float, Sequence[VelocityAudit]]]) -> list[tuple[list[str], str]]:
    """Say of which joints the recorded velocity is not used, and why; the same fault of the same joints once.

    Parameters
    ----------
    audited : sequence of (str, float, sequence of VelocityAudit)
        Name and rate of each recording, with what `audit_velocity` says of it.

    Returns
    -------
    list of (list of str, str)
        Names of recordings, and the remark on them.
    """
    found: dict[tuple[tuple[str, ...], str, bool], tuple[list[str], list[VelocityFault]]] = {}
    for name, rate, audits in audited:
        faults = [(audit.joint, fault) for audit in audits if (fault := audit.fault(rate)) is not None]
        for words in dict.fromkeys(fault.words for _, fault in faults):
            own = [(joint, fault) for joint, fault in faults if fault.words == words]
            key = tuple(joint for joint, _ in own), words, len(own) == len(audits)
            names, sizes = found.setdefault(key, ([], []))
            names.append(name)
            sizes += [fault for _, fault in own]
    return [
        (
            names,
            f"recorded velocity of {', '.join(joints)} is not used: {faults_in_words(sizes, len(joints) if every else 0)}",
        )
        for (joints, _, every), (names, sizes) in found.items()
    ]


def audit_velocity(recording: Recording, part: Stretch) -> tuple[VelocityAudit, ...]:
    """Compare the recorded velocity with the derivative of the position.

    Both pass the same low-pass; the recorded velocity is then written as gain times velocity minus gain times
    lag times acceleration, by least squares.

    Parameters
    ----------
    part : Stretch
        A gapless part of it.

    Returns
    -------
    tuple of VelocityAudit
        One per moving joint; empty where no velocity was recorded.
    """
    if recording.velocity is None:
        return ()
    cut = COMPARE_BAND * part.rate
    found = []
    # The slope of a position that flickers by a count is noise.
    idle = {joint for finding in recording.findings for joint in finding.idle}
    inside = (recording.time >= part.time[0] - 1e-9) & (recording.time <= part.time[-1] + 1e-9)
    for j, joint in enumerate(recording.joints):
        if j in idle:
            continue
        recorded = np.interp(part.time, recording.time[inside], recording.velocity[j][inside])
        _, v, a = part.filtered(j, cut)
        smooth = derivative(recorded, part.rate, cut, 0)
        scale = float(np.sqrt(np.mean(smooth**2)))
        if float(np.max(np.abs(v))) < 1e-4 * max(1.0, float(np.max(np.abs(recorded)))):
            continue
        if scale == 0.0:
            found.append(VelocityAudit(joint, 0.0, 0.0, 0.0))
            continue
        columns = np.column_stack([v, a])
        (gain, change), *_ = np.linalg.lstsq(columns, smooth, rcond=None)
        left = float(np.sqrt(np.mean((smooth - columns @ [gain, change]) ** 2))) / scale
        found.append(VelocityAudit(joint, float(gain), float(-change / gain) if gain else 0.0, left))
    return tuple(found)
