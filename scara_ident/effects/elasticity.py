"""Joint elasticity and backlash: links that do not follow their motors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.filters.smoothed_positions import NulledPositions, SmoothedPositions
from scara_ident.effects.flight import FreeLink
from scara_ident.effects.following import EstimateSlopes
from scara_ident.effects.links import usual_link_inertia, usual_link_inertia_slopes
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Parameter, Tie, View, deviation
from scara_ident.effects.second_encoder import gear_stiffness
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.two_mass import TwoMasses, usual_coupling
from scara_ident.motion.prepared import PreparedRecording

# Frequencies of the link against its held motor that are tried, a factor apart, from the lowest to so many bands.
SPACING, HIGHEST_TRIED = 1.6, 4.0
# Limits of these frequencies, Hz, which hold for arms.
LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 2.0, 200.0
# Damping ratio of that swinging. Gears have 0.03 to 0.1, but then the phase after a few swings depends on inertia and
# stiffness to the percent; the search begins with more, so that what the link does follows from the torque of the last swing.
DAMPING = 0.2
# Damping ratios that the fit may reach: above it does not swing. Those of gears are estimated with the motor free, whose swinging is
# faster: behind a motor that is held the ratio is smaller by the root of the rotor's share of both inertias.
LOWEST_DAMPING, HIGHEST_DAMPING = 0.01, 0.7
# Of the highest damping ratio and frequency, at which a fit has gone as far as it may.
AS_FAR_AS_MAY_BE = 0.999
# A resonance is distinguished from a softer gear by what is above it: the band reaches so many times its frequency.
BOTH_SIDES = 1.5
# Links that share less of their inertia hardly swing together.
MIN_COUPLING = 0.2
# With less damping than this two gears are not fitted from a guess: the phase after a few swings would be anything.
STEADY_DAMPING = 0.05
# Clearances tried, rad at the joint: three times apart, which refinement bridges.
WIDTHS = (3e-4, 1e-3, 3e-3)
# Of a joint that slides more, as multiples of `Scene.radian`: a nut on its screw or a pinion has micrometres to millimetres, of
# a travel of millimetres to metres.
SLIDE_WIDTHS = (1e-5, 2.7e-5, 7.4e-5, 2e-4, 5.5e-4, 1.5e-3, 4e-3, 0.011, 0.03)
# The motion that is known within a band rounds off the blow of a landing: recordings without noise give a width that is up to
# twice this share too small.
ROUNDED_OFF = 0.04
# A clearance of more, rad, or of a joint that slides multiples of `Scene.radian`, is felt by hand.
LARGEST_WIDTH = 0.05


class BehindGear(Effect):
    """A link that does not follow its motor, which all joints feel."""

    all_joints = True
    at_rest = True
    in_small_ways = True
    follows_estimate = True

    def joints(self, scene: Scene) -> list[int]:
        """Return those that move in some recording: of one that is held all the while nothing is known of its link."""
        return [j for j in super().joints(scene) if scene.speed[j] > 0.0]

    def geared_joint(self, member: Member) -> int:
        """Return its joint."""
        return member.place

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return none: its tie says what follows from the bodies, and without one it has no torque."""
        return {}


class JointElasticity(BehindGear):
    """An elastic gear with the encoder on the motor: the link lags behind the motor by x.

    The link oscillates on the spring of the gear, ``M_jj x'' + d x' + k x = tau_j`` with the torque tau_j that a rigid
    gear would transmit. Its lag changes the torques of all joints, mainly by ``-M x''`` (Spong 1987). Well below the
    resonance frequency x is ``tau_j / k``. The nonlinear parameter is this frequency, at which the link oscillates with
    its motor held; it matters if it is not far above the band. The coefficient is ``1/stiffness`` in any case. A base
    that yields about the first joint's axis has the same effect on the torques.
    """

    name = "joint_elasticity"
    summary = "an elastic gear"
    coefficients = (
        Coefficient(
            "compliance", "{compliance}", "compliance of the gear of {joint}",
            "its compliance would be negative: the link would move ahead of its motor",
        ),
    )  # fmt: skip
    nonlinear = (
        NonlinearParameter("frequency", "Hz", LOWEST_FREQUENCY, HIGHEST_FREQUENCY, symmetric_power=-2.0),
        NonlinearParameter("_damping_ratio", "1", LOWEST_DAMPING, HIGHEST_DAMPING),
    )
    fitted_first = True
    together = True
    smooth = True
    imitated_by = (SmoothedPositions(), NulledPositions())
    view = View("acceleration")
    experiment = "excite above 5 Hz with short steps, and look for a resonance that stays at its frequency"

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return frequencies from the lowest to far above the band."""
        highest = min(HIGHEST_TRIED * scene.band, HIGHEST_FREQUENCY)
        count = max(1, round(np.log(highest / LOWEST_FREQUENCY) / np.log(SPACING)))
        return ((float(frequency), DAMPING) for frequency in np.geomspace(LOWEST_FREQUENCY, highest, count + 1))

    def band(self, member: Member) -> float:
        """Return a band that holds both sides of the resonance; 0 where a fit ended without one."""
        frequency, ratio = member.nonlinear
        # What does not swing, or faster than any gear, only lags: where its frequency ended tells of no resonance there.
        seen = not _is_damped(ratio) and frequency < AS_FAR_AS_MAY_BE * HIGHEST_FREQUENCY
        return BOTH_SIDES * frequency if seen else 0.0

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add the unit of the compliance, at the joint."""
        unit = "m/N" if scene.robot.prismatic[member.place] else "rad/(N m)"
        return super().words(scene, member) | {"compliance": unit}

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the change of torque per compliance, of a member that is not in the model beside those that are."""
        if not usual_link_inertia(signals.scene, member.place) > 0.0:
            return [np.zeros_like(signals.motion.q)]
        members = self._swinging(signals.scene, member)
        masses = TwoMasses(signals, members)
        if not masses.held:
            return [np.zeros_like(signals.motion.q)]
        stiffness = masses.stiffness[members.index(member)]
        if (self, member) in signals.scene.together:
            return [stiffness * masses.parts[members.index(member)]]
        others = tuple(item for item in members if item is not member)
        without = TwoMasses(signals, others).change if others else 0.0
        return [stiffness * (masses.change - without)]

    def _swinging(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return a member and those of other joints in the model, in the order of joints."""
        others = [item for effect, item in scene.together if effect == self and item.place != member.place]
        moving = [item for item in others if usual_link_inertia(scene, item.place) > 0.0]
        return tuple(sorted([*moving, member], key=lambda item: item.place))

    def tie(self, scene: Scene, member: Member) -> Tie | None:
        """Return the compliance that goes with the frequency."""
        inertia = usual_link_inertia(scene, member.place)
        if not inertia > 0.0:
            return None
        compliance = 1.0 / (inertia * (2.0 * np.pi * member.nonlinear[0]) ** 2)
        bodies = np.append(usual_link_inertia_slopes(scene, member.place), -1.0)
        return Tie(compliance, -compliance * np.append(bodies / inertia, [2.0 / member.nonlinear[0], 0.0]))

    def slopes(self, signals: Signals, member: Member) -> Iterable[tuple[NDArray[np.intp], Array]]:
        """Give the derivatives of what all members in the model do, with the compliances as they are."""
        members = self._swinging(signals.scene, member)
        return TwoMasses(signals, members).slopes(members.index(member))

    def instead(self, scene: Scene, member: Member) -> tuple[tuple[Member, Member], ...]:
        """Return gears of two links that share much of their inertia: one softer gear swings as slowly as both together."""
        frequency, ratio = member.nonlinear
        pairs = []
        for j, coupling in self._coupled(scene, member).items():
            # Of two alike, the slower way to swing together.
            both = frequency * np.sqrt(1.0 + min(coupling, 1.0)), max(ratio, STEADY_DAMPING)
            if both[0] < HIGHEST_FREQUENCY:
                pairs.append((Member(member.place, both), Member(j, both)))
        return tuple(pairs)

    def unfound(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return the gear of the link that shares most of its inertia, so stiff that it swings faster than is seen."""
        frequency = min(SPACING * max(scene.band, member.nonlinear[0]), HIGHEST_FREQUENCY)
        return tuple(Member(j, (frequency, DAMPING)) for j in self._coupled(scene, member))[:1]

    def _coupled(self, scene: Scene, member: Member) -> dict[int, float]:
        """Return joints without an elastic gear in the model whose links share much of their inertia, most of it first, and how much."""
        taken = {member.place, *(item.place for effect, item in scene.together if effect == self)}
        found = {j: usual_coupling(scene, member.place, j) for j in self.joints(scene) if j not in taken}
        return {j: found[j] for j in sorted(found, key=lambda j: -found[j]) if found[j] > MIN_COUPLING}

    def elsewhere(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return a softer and a stiffer gear, as far as the frequencies that are tried are apart."""
        reached = (member.nonlinear[0] / SPACING, member.nonlinear[0] * SPACING)
        return tuple(Member(member.place, (x, DAMPING)) for x in reached if LOWEST_FREQUENCY < x < HIGHEST_FREQUENCY)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where a spring does not pull back, would swing slower than is seen, or does not swing at all."""
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is not None:
            return wrong
        frequency, ratio = member.nonlinear
        if frequency < scene.band and _is_damped(ratio):
            return f"no resonance is seen within the band at {frequency:.2g} Hz: with so much damping it looks like a delay"
        usual = usual_link_inertia(scene, member.place)
        least = value[0] - DOUBT_STDS * std[0]
        if usual > 0.0 and least > 0.0:
            frequency = float(1.0 / np.sqrt(least * usual) / (2.0 * np.pi))
            if 2.0 * frequency < min(member.nonlinear[0], scene.band):
                return (
                    f"with so soft a gear the link would swing at {frequency:.2g} Hz, and no such oscillation is seen"
                )
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the stiffness, 1 over the coefficient."""
        compliance = float(value[0])
        unit = "N/m" if scene.robot.prismatic[member.place] else "N m/rad"
        if compliance == 0.0:
            return {"stiffness": Parameter(np.inf, np.inf, unit)}
        return {"stiffness": Parameter(1.0 / compliance, deviation(covariance) / compliance**2, unit)}

    def with_symmetric_powers(self, parameters: Mapping[str, Parameter]) -> Mapping[str, Parameter]:
        """Say of the stiffness how much of what is unsure of it is the frequency, and not the inertia that goes with this.

        The stiffness follows the inertia, and the frequency enters with its own power.
        """
        stiffness, frequency = parameters["stiffness"], parameters["frequency"]
        if not 0.0 < stiffness.std < np.inf:
            return parameters
        share = min(1.0, (2.0 * frequency.std / frequency.value * stiffness.value / stiffness.std) ** 2)
        return {**parameters, "stiffness": replace(stiffness, symmetric_power=1.0 - 2.0 * share)}

    def read_directly(
        self, scene: Scene, joint: int, recordings: Sequence[PreparedRecording], rotor_std: float
    ) -> Mapping[str, Parameter]:
        """Return the stiffness that a second encoder behind the gear tells."""
        stiffness = gear_stiffness(scene, recordings, joint, rotor_std)
        return {} if stiffness is None else {"stiffness": stiffness}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what else it may be on the first joint."""
        return self.summary + (", or a base that yields about the same axis" if member.joint == 0 else "")


def _is_damped(ratio: float) -> bool:
    """Whether a damping ratio is as high as a fit may reach: what is damped so does not swing."""
    return ratio >= AS_FAR_AS_MAY_BE * HIGHEST_DAMPING


class Backlash(BehindGear):
    """Clearance between motor and link: ``q_link = q - width s(t)``, where s is one half on either flank.

    When the torque through the gear changes its sign, the link loses contact and moves freely: motor and link separate
    with the acceleration that the torque would have caused, until the link lands on the other flank without bouncing.
    The duration depends on the width and on the bodies. Both the coefficient and the nonlinear parameter are that
    width. The effect acts where the torque reverses, not where the speed does.
    """

    name = "backlash"
    summary = "clearance in the gear"
    coefficients = (
        Coefficient(
            "width", "{position}", "clearance in the gear of {joint}", "the clearance would be negative",
        ),
    )  # fmt: skip
    nonlinear = (NonlinearParameter("_flown_width", "{position}", 1e-5, LARGEST_WIDTH, of_length=True),)
    view = View("reversal", along=True, distance="width")
    experiment = "reverse under little load, and look for the travel in which no torque is needed"

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return three widths, and more of a joint that slides."""
        widths = SLIDE_WIDTHS if scene.robot.prismatic[joint] else WIDTHS
        return ((float(scene.radian[joint] * width),) for width in widths)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so of a clearance that anybody would have felt."""
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is None and value[0] > LARGEST_WIDTH * scene.radian[member.place] + DOUBT_STDS * std[0]:
            return f"a clearance of {value[0]:.2g} {scene.robot.position_unit(member.place)} could be felt by hand"
        return wrong

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the change of torque per width."""
        link = FreeLink(signals, member.place, *member.nonlinear)
        return [link.change if link.usual > 0.0 else np.zeros_like(signals.motion.q)]

    def tie(self, scene: Scene, member: Member) -> Tie | None:
        """Return the width that is flown through."""
        if not usual_link_inertia(scene, member.place) > 0.0:
            return None
        bodies = len(scene.model.rigid_body.columns)
        return Tie(member.nonlinear[0], np.append(np.zeros(bodies + 1), 1.0))

    def slopes(self, signals: Signals, member: Member) -> Iterable[tuple[NDArray[np.intp], Array]]:
        """Give the derivatives with the width that multiplies the column as it is."""
        return FreeLink(signals, member.place, *member.nonlinear).slopes()

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the width, as unsure as noise and the band make it."""
        (width,) = super().parameters(scene, member, value, covariance).values()
        return {"width": replace(width, std=float(np.hypot(width.std, ROUNDED_OFF * width.value)))}
