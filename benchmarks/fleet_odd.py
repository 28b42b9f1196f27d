"""How often a fleet's report names an arm as unlike the others where none is, and where one is.

Arms are simulated with friction, bodies, rotors and torque constants of their own, and one run each of a first date.

Run ``python benchmarks/fleet_odd.py [--fleets N] [--seed S] [--arms N]``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from fleet import DAILY, OWN_FRICTION, SECONDS, date_name

from scara_ident.fleet.history import History
from scara_ident.fleet.odd import FALSE_ODD_LEVEL, odd_arms
from scara_ident.fleet.table import Quantity, quantities
from scara_ident.fleet.visit import _visit
from scara_ident.model.model import build_model
from scara_ident.paper import OJD
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import sampled, simulate, virtual_arm
from scara_ident.simulation.runs import RunState

# Spread of bodies, rotors and torque constants over the arms, as shares: castings, windings and magnets of one drawing.
OWN_BODIES, OWN_ROTORS, OWN_SCALE = 0.01, 0.02, 0.02
# What makes an arm odd: its friction of joint2, its torque constant of joint1, or all its bodies, as shares.
ODD = {"friction of joint2 doubled": 1.0, "torque constant of joint1 off by 20 %": 0.2, "bodies 20 % heavier": 0.2}


def run_of(seed: int, fleet: int, number: int, odd: str | None) -> Recording:
    """Simulate the first run of one arm."""
    arm, random = virtual_arm(), np.random.default_rng([seed, fleet, number])
    friction = arm.friction * (1.0 + OWN_FRICTION * random.standard_normal((2, 1)))
    bodies = arm.bodies * (1.0 + OWN_BODIES * random.standard_normal((2, 1)))
    rotors = arm.rotor_inertia * (1.0 + OWN_ROTORS * random.standard_normal(2))
    daily = 1.0 + np.array(DAILY[:2])[:, None] * random.standard_normal((2, 2))
    scale = daily[1] * (1.0 + OWN_SCALE * random.standard_normal(2))
    offset = DAILY[2] * arm.torque_noise * random.standard_normal(2)
    if odd is not None:
        size = ODD[odd]
        friction[1] *= 1.0 + size * odd.startswith("friction")
        scale[0] *= 1.0 + size * odd.startswith("torque")
        bodies *= 1.0 + size * odd.startswith("bodies")
    arm = replace(arm, friction=friction, bodies=bodies, rotor_inertia=rotors)
    state = RunState(daily[0], scale, offset, float(DAILY[3] * random.standard_normal()))
    motion = sampled("OJD", arm.robot, OJD.motion, SECONDS)
    return simulate(arm, motion, seed=10**6 * seed + 1000 * fleet + number, run=state).recording


def first_date(seed: int, fleet: int, number: int, odd: str | None = None) -> Sequence[Quantity]:
    """Return the quantities of one arm on its first date."""
    model = build_model(load_robot())
    visit = _visit(model, [run_of(seed, fleet, number, odd)], None)
    return quantities([History("arm", (date_name(0),), (visit,), model)])["arm"][0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fleets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--arms", type=int, default=8)
    options = parser.parse_args()
    model, false = build_model(load_robot()), 0
    right, beside = dict.fromkeys(ODD, 0), dict.fromkeys(ODD, 0)
    for fleet in range(options.fleets):
        arms = {f"arm{k}": first_date(options.seed, fleet, k) for k in range(options.arms)}
        false += bool(odd_arms(model, arms))
        for odd in ODD:
            named = odd_arms(model, arms | {"arm0": first_date(options.seed, fleet, 0, odd)})
            right[odd] += "arm0" in named
            beside[odd] += bool(named.keys() - {"arm0"})
    print(
        f"{options.fleets} fleets of {options.arms} arms, seed {options.seed}: {false} of those without an odd arm "
        f"named any ({FALSE_ODD_LEVEL * options.fleets:.1f} stated)"
    )
    for odd, count in right.items():
        print(f"{odd}: {count} of {options.fleets} named, another arm in {beside[odd]}")


if __name__ == "__main__":
    main()
