"""What of the channels is not as the mapping says, in words, and what to do about it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scara_ident.errors import RecordingError
from scara_ident.identification.channel_reading import JointReading, Reading, Signal

# Another mapping must leave at most this share of the error on blocks that it was not fitted to, geometric mean over joints.
MENDED = 0.5
SIGNALS: tuple[Signal, ...] = ("effort", "position", "effort and position")


@dataclass(frozen=True)
class ChannelFault:
    """Another reading of the channels that fits far better.

    Attributes
    ----------
    signal : {"effort", "position", "effort and position"}
    joints : tuple of str
        Those whose sign is opposite, or whose position counts from elsewhere, or the two that are exchanged.
    error, mended : float
        Rms of what is left as a share of the torque, geometric mean over the joints (of an effort turned round those that
        either reading explains badly; of all readings those that are hardly explained, where these alone show it), on blocks of time that the parameters were not fitted to, as mapped and as it should be.
    zeros : tuple of JointReading
        Of each joint, where its position counts from elsewhere by quarter turns, how it is to be read; else empty.
    alternatives : tuple of str
        In words, what leaves as much as these zeros, so that it may be that instead.
    unsigned : bool
        Whether the effort is a magnitude; its errors are of these joints alone.
    by_bodies : bool
        Whether gravity and inertia show that every effort has the opposite sign, of which no residual speaks.
    """

    signal: Signal
    joints: tuple[str, ...]
    exchanged: bool
    error: float
    mended: float
    zeros: tuple[JointReading, ...] = ()
    alternatives: tuple[str, ...] = ()
    unsigned: bool = False
    by_bodies: bool = False

    @property
    def readings(self) -> Mapping[str, JointReading]:
        """How each joint is to be read, but for exchanges and magnitudes."""
        if self.zeros:
            return dict(zip(self.joints, self.zeros, strict=True))
        sign = JointReading(-1 if "effort" in self.signal else 1, -1 if "position" in self.signal else 1)
        return dict.fromkeys(self.joints, sign)

    def __str__(self) -> str:
        """Say what, and what to do."""
        gain = f"the unexplained part of the torque falls from {percent(self.error)} to {percent(self.mended)} %"
        names = (" and " if self.exchanged else ", ").join(self.joints)
        if self.unsigned:
            return (
                f"effort of {names} seems to be logged without its sign: the sign never changes, and with the signs "
                f"that the motion requires {gain}; log the effort with its sign"
            )
        if self.zeros:
            return self._elsewhere(gain)
        if self.exchanged:
            return (
                f"{self.signal} of {names} look exchanged: with the columns exchanged {gain}; exchange their columns "
                f"under recording: in robot.yaml"
            )
        if self.by_bodies:
            return (
                f"{names}: the effort has the opposite sign: gravity and inertia both have the opposite sign of the "
                f"URDF's; negate effort_gain of all in robot.yaml (effort_gain: -1 where none is given)"
            )
        if self.mended > MENDED * self.error:
            return (
                f"{names}: the effort, or the position, has the opposite sign: friction feeds energy in on some joints "
                f"and brakes on none; negate effort_gain in robot.yaml"
            )
        turn = {
            "effort": f"negate effort_gain of {names} in robot.yaml",
            "position": f"negate the axis of {names} in the URDF, or give its position scale: -1 in robot.yaml",
            "effort and position": f"negate the axis of {names} in the URDF",
        }[self.signal]
        verb = "look" if self.signal == "effort and position" else "looks"
        return f"{self.signal} of {names} {verb} like the opposite sign: with the sign changed {gain}; {turn}"

    def _elsewhere(self, gain: str) -> str:
        """Say which zeros are elsewhere, and which lines mend it."""
        each = self.readings
        verb = "counts" if len(each) == 1 else "count"
        turns = " and ".join(f"{_added(own)} on {joint}" for joint, own in each.items())
        lines = ", ".join(f"{joint}: {0.5 * math.pi * own.quarters:.5f}" for joint, own in each.items())
        said = f"position of {', '.join(each)} {verb} from a zero that differs from the URDF's: with {turns} {gain}"
        if self.alternatives:
            said += f" (it does so too with {', or with '.join(self.alternatives)})"
        mend = ""
        for word, signal in (("position scale and offset", "position"), ("effort_gain", "effort")):
            own = [joint for joint, read in each.items() if signal in (read.signal or "")]
            if own:
                mend += f"negate {word} of {', '.join(own)} in robot.yaml, "
        return (
            f"{said}; {mend}{'then ' if mend else ''}add in robot.yaml under recording, position: offset: {{{lines}}} in "
            f"rad, or the same angle in the unit there"
        )


def percent(share: float) -> str:
    """Return a share in percent, of two digits or whole."""
    return f"{100 * share:.2g}" if share < 0.99 else f"{100 * share:.0f}"


def faults_of(
    reading: Reading,
    joints: Sequence[str],
    error: float,
    mended: float,
    alternatives: tuple[str, ...] = (),
) -> list[ChannelFault]:
    """Return the faults of a mapping that another reading mends."""
    wrong = {joint: own for joint, own in zip(joints, reading, strict=True) if own.quarters}
    found = []
    if wrong:
        found.append(ChannelFault("position", tuple(wrong), False, error, mended, tuple(wrong.values()), alternatives))
    for signal in SIGNALS:
        own = tuple(
            joint for joint, read in zip(joints, reading, strict=True) if not read.quarters and read.signal == signal
        )
        if own:
            found.append(ChannelFault(signal, own, False, error, mended))
    return found


def merged(faults: Sequence[ChannelFault], joints: Sequence[str]) -> tuple[ChannelFault, ...]:
    """Return faults with those of one joint in one: what is turned twice is right."""
    each = [joint for fault in faults for joint in fault.joints]
    if len(set(each)) == len(each) or any(fault.exchanged for fault in faults):
        return tuple(faults)
    read = dict.fromkeys(joints, JointReading())
    for fault in faults:
        for joint, own in fault.readings.items():
            read[joint] = read[joint].then(own)
    error, mended = max(fault.error for fault in faults), min(fault.mended for fault in faults)
    return tuple(faults_of(tuple(read.values()), joints, error, mended))


def in_words(reading: Reading, joints: Sequence[str]) -> str:
    """Say in short what a reading has otherwise than the mapping."""
    said = []
    for joint, own in zip(joints, reading, strict=True):
        if own.quarters:
            said.append(f"{_added(own)} on {joint}")
        elif own.signal is not None:
            said.append(f"{own.signal} of {joint} of opposite sign")
    return " and ".join(said)


def _added(own: JointReading) -> str:
    """Say what is added to a position, and what changes its sign."""
    return f"{90 * own.quarters:+d} deg" + ("" if own.signal is None else f" ({own.signal} of opposite sign)")


def refuse_exchanged(faults: Sequence[ChannelFault]) -> None:
    """Refuse joints that are exchanged, and efforts without a sign: whatever is fitted to them is of no joint.

    Raises
    ------
    RecordingError
    """
    if any(fault.exchanged or fault.unsigned for fault in faults):
        raise RecordingError("; ".join(str(fault) for fault in faults))
