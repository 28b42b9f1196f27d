"""What of the channels is not as the mapping says, in words, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from scara_ident.errors import RecordingError

Signal = Literal["effort", "position", "effort and position"]

# Another mapping must leave at most this share of the error on blocks that it was not fitted to, geometric mean over joints.
MENDED = 0.5


@dataclass(frozen=True)
class ChannelFault:
    """Another reading of the channels that fits far better.

    Attributes
    ----------
    signal : {"effort", "position", "effort and position"}
    joints : tuple of str
        Those whose sign is opposite, or the two that are exchanged.
    error, mended : float
        Rms of what is left as a share of the torque, geometric mean over the joints (of an effort turned round those that
        either reading explains badly), on blocks of time that the parameters were not fitted to, as mapped and as it should be.
    unsigned : bool
        Whether the effort is a magnitude; its errors are those of the fit, of these joints alone.
    by_bodies : bool
        Whether gravity and inertia told that every effort has the opposite sign, of which no residual speaks.
    """

    signal: Signal
    joints: tuple[str, ...]
    exchanged: bool
    error: float
    mended: float
    unsigned: bool = False
    by_bodies: bool = False

    def __str__(self) -> str:
        """Say what, and what to do."""
        gain = f"what is left of the torque falls from {100 * self.error:.2g} to {100 * self.mended:.2g} %"
        names = (" and " if self.exchanged else ", ").join(self.joints)
        if self.unsigned:
            return (
                f"effort of {names} seems to be logged without its sign: it never changes it, and with the signs that the "
                f"motion asks for {gain}; log the effort with its sign"
            )
        if self.exchanged:
            return (
                f"{self.signal} of {names} look exchanged: the other way round {gain}; exchange their columns under "
                f"recording: in robot.yaml"
            )
        if self.by_bodies:
            return (
                f"{names}: the effort has the opposite sign: gravity and inertia would both be those of the URDF the other way "
                "round; negate effort_gain of all in robot.yaml (effort_gain: -1 where none is given)"
            )
        if self.mended > MENDED * self.error:
            return (
                f"{names}: the effort, or the position, has the opposite sign: friction would feed energy in, and no joint "
                "speaks against it; negate effort_gain in robot.yaml"
            )
        turn = {
            "effort": f"negate effort_gain of {names} in robot.yaml",
            "position": f"negate the axis of {names} in the URDF, or give its position scale: -1 in robot.yaml",
            "effort and position": f"negate the axis of {names} in the URDF",
        }[self.signal]
        verb = "look" if self.signal == "effort and position" else "looks"
        return f"{self.signal} of {names} {verb} like the opposite sign: turned round {gain}; {turn}"


def merged(faults: Sequence[ChannelFault], joints: Sequence[str]) -> tuple[ChannelFault, ...]:
    """Return faults with those of one joint in one: what is turned twice is right."""
    each = [joint for fault in faults for joint in fault.joints]
    if len(set(each)) == len(each) or any(fault.exchanged for fault in faults):
        return tuple(faults)
    kinds: dict[frozenset[str], Signal] = {
        frozenset({"effort"}): "effort",
        frozenset({"position"}): "position",
        frozenset({"effort", "position"}): "effort and position",
    }
    turned: dict[str, frozenset[str]] = {joint: frozenset() for joint in joints}
    for fault in faults:
        for joint in fault.joints:
            turned[joint] ^= frozenset(fault.signal.split(" and "))
    error, mended = max(fault.error for fault in faults), min(fault.mended for fault in faults)
    found = []
    for signals, signal in kinds.items():
        own = tuple(joint for joint in joints if turned[joint] == signals)
        if own:
            found.append(ChannelFault(signal, own, False, error, mended))
    return tuple(found)


def refuse_exchanged(faults: Sequence[ChannelFault]) -> None:
    """Refuse joints that are exchanged, and efforts without a sign: whatever is fitted to them is of no joint.

    Raises
    ------
    RecordingError
    """
    if any(fault.exchanged or fault.unsigned for fault in faults):
        raise RecordingError("; ".join(str(fault) for fault in faults))
