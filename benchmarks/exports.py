"""Exported forms of identified arms: equal to the model in what they can say, and what the rest costs held out.

Each arm is a virtual one of `virtual_sets.py` (the SCARA03 its own), with four random motions fitted and a fifth held out.
Without effects it is identified; with a gear loss it is diagnosed, for that effect only. Results are written and read back,
exported in every form, and read by the program that each is for. ``equal`` is the largest difference to the model with
the parameters that the form says, as a share of the largest torque. The last table has the held-out rms error of the joint
where it grows most (N m), and in brackets the model's there. The arms' friction bends with speed, as the SCARA03's does.

    python benchmarks/exports.py [--robot scara03 ur5 panda] [--seed 1] [--seconds 12]
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from export_readers import READERS, WARNINGS
from virtual_motions import random_motion
from virtual_sets import random_arm

from scara_ident.diagnosis import diagnose
from scara_ident.effects import effects_named
from scara_ident.export.c_header import c_name
from scara_ident.export.exported import export_model, write_exported
from scara_ident.export.forms import Said
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.export.result import read_identified
from scara_ident.files import write_json
from scara_ident.identification.identify import identify
from scara_ident.motion.motion import Motion
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.identification import identification_dict
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import VirtualArm, parse_effect, simulate, virtual_arm

KINDS = ("fourier", "points", "sweep", "fourier", "sweep")
RATE = 500.0
LOSSY = {"scara03": "joint1", "ur5": "shoulder_lift_joint", "panda": "panda_joint4"}
# Quadratic and cubic friction per viscous, s/rad and s^2/rad^2.
BENT = (-0.3, 0.05)
CALLS = 1_000_000
TIMED = """
#include "{low}.h"
#include <stdio.h>
#include <time.h>
int main(void)
{{
    double q[{n}], v[{n}], a[{n}], out[{n}], sum = 0.0;
    struct timespec begin, end;
    for (int i = 0; i < {n}; i++) {{ q[i] = 0.3 * i + 0.1; v[i] = 0.2 * i - 0.3; a[i] = 1.0; }}
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
    for (int k = 0; k < {calls}; k++) {{ q[k % {n}] += 1e-6; {low}_torque(q, v, a, out); sum += out[0]; v[0] += 1e-12 * out[0]; }}
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
    printf("%.4f %g\\n", ((end.tv_sec - begin.tv_sec) * 1e9 + (end.tv_nsec - begin.tv_nsec)) / {calls} / 1e3, sum);
    return 0;
}}
"""


def arm_of(name: str, seed: int, folder: Path) -> tuple[VirtualArm, Robot]:
    """Return a virtual arm and the robot as its identifier is told of it."""
    if name == "scara03":
        return virtual_arm(), load_robot()
    arm, robot = random_arm(name, True, 18, folder, np.random.default_rng([seed, 1]))
    viscous = arm.friction[:, 1:2]
    return replace(arm, friction=np.hstack([arm.friction[:, :2], BENT[0] * viscous, BENT[1] * viscous])), robot


def result_of(name: str, effects: bool, seed: int, seconds: float, folder: Path) -> Path:
    """Record, identify or diagnose, and write the result."""
    arm, robot = arm_of(name, seed, folder)
    rng = np.random.default_rng([seed, 2])
    added = [parse_effect(f"transmission_loss:{LOSSY[name]}")] if effects else []
    motions = [random_motion(f"M{k + 1}", arm, kind, seconds, rng) for k, kind in enumerate(KINDS)]
    runs = [simulate(arm, item, effects=added, seed=seed, rate=RATE).recording for item in motions]
    runs = [replace(run, name=f"M{k + 1}_1", trajectory=f"M{k + 1}") for k, run in enumerate(runs)]
    path = folder / f"{name}_{effects}.json"
    if effects:
        found = diagnose(robot, runs[:4], validation=runs[4:], catalogue=effects_named("transmission_loss"))
        write_json(path, diagnosis_dict(found))
    else:
        write_json(path, identification_dict(identify(robot, runs[:4], validation=runs[4:])))
    return path


def states(robot: Robot, seed: int, samples: int = 200) -> Motion:
    """Return random states within the joints' ranges, away from rest."""
    rng = np.random.default_rng([seed, 3])
    low, high = (np.clip(limit, -np.pi, np.pi)[:, None] for limit in (robot.lower, robot.upper))
    q = low + (high - low) * rng.uniform(size=(robot.n, samples))
    v = rng.choice([-1.0, 1.0], q.shape) * rng.uniform(0.3, 2.0, q.shape)
    return Motion("states", "states", np.arange(samples) / 1e9, q, v, rng.normal(0.0, 5.0, q.shape), None, 1e9)


@dataclass(frozen=True)
class Row:
    """A form of one arm.

    Attributes
    ----------
    form : str
    equal : float
        Largest difference to the model as the form says it, over the largest torque.
    joint : str
        The one whose held-out error grows most.
    own, model : float
        Its error, and the model's.
    missing : str
        What the form cannot say.
    """

    form: str
    equal: float
    joint: str
    own: float
    model: float
    missing: str


def row(found: IdentifiedModel, to: str, key: str, said: Said, folder: Path, motion: Motion) -> Row:
    """Read a form again and return its row."""
    read = READERS[to] if key == "exported" else partial(READERS[to], effects=True)
    torque = read(folder, found.robot, motion.q, motion.v, motion.a)
    expected = np.einsum("jpn,p->jn", found.model.regressor(motion), said.value)
    equal = float(np.max(np.abs(torque - expected)) / np.max(np.abs(expected)))
    errors = (
        (joint, own, model)
        for (joint, own), model in zip(
            found.errors(said.value).items(), found.errors(found.value).values(), strict=True
        )
    )
    known = [(joint, own, model) for joint, own, model in errors if own is not None and model]
    joint, own, model = max(known, key=lambda item: item[1] / item[2])
    form = to if key == "exported" else f"{to} with its code"
    return Row(form, equal, joint, own, model, "; ".join(what for what, _ in said.missing) or "nothing")


def timed(folder: Path, robot: Robot) -> float:
    """Return microseconds a call of the header's torque."""
    low = c_name(robot.name)
    (folder / "timed.c").write_text(TIMED.format(low=low, n=robot.n, calls=CALLS))
    command = ["gcc", "-std=gnu99", "-O2", *WARNINGS, "timed.c", "-o", "timed", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    runs = [subprocess.run(["./timed"], cwd=folder, check=True, capture_output=True, text=True) for _ in range(3)]
    return min(float(run.stdout.split()[0]) for run in runs)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", nargs="+", default=list(LOSSY), choices=list(LOSSY))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=12.0)
    options = parser.parse_args()
    tables: dict[str, list[Row]] = {}
    for name in options.robot:
        for effects in (False, True):
            with tempfile.TemporaryDirectory() as made:
                folder = Path(made)
                path = result_of(name, effects, options.seed, options.seconds, folder)
                found = read_identified(path)
                terms = [f"{term.name} of {getattr(term, 'joint', '')}" for term in found.model.terms[3:]]
                title = f"{name}, {' and '.join(terms) or 'no effect'}"
                rows = tables.setdefault(title, [])
                print(f"\n{title}: {found.robot.n} joints, a result of {path.stat().st_size} bytes", flush=True)
                motion = states(found.robot, options.seed)
                for to in READERS:
                    done = export_model(found, to)
                    write_exported(found, done, folder / to, path.name)
                    for key, said in (("exported", done.alone), ("with_code", done.beside)):
                        if said is not None:
                            rows.append(row(found, to, key, said, folder / to, motion))
                            print(rows[-1], flush=True)
                    for note in done.notes:
                        print(f"  {to}: {note}")
                print(f"C: {timed(folder / 'c', found.robot):.3f} us a call", flush=True)
    print("\n| form | equal | " + " | ".join(tables) + " |\n|---|---|" + "---|" * len(tables))
    for rows in zip(*tables.values(), strict=True):
        cells = (f"{item.own:.3g} ({item.model:.3g})" for item in rows)
        print(f"| {rows[0].form} | {max(item.equal for item in rows):.0e} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
