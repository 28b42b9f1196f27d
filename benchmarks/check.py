"""Whether `check` foresees the torque, energy and limiting joint that a virtual arm then needs.

Random arms as in `virtual_sets`, without effects, identified from four motions; a motion from pose to pose that no one has
recorded is checked, and then run with the foreseen torque fed forward. Differences are shares of each joint's peak torque, of its rms torque, and of the energy of
all drives; the worst joint counts. The limits are the URDF's.

    python benchmarks/check.py --arms 3 --seed 1 [--robots scara03 ur5 panda]
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from virtual_motions import random_motion
from virtual_sets import random_arm

from scara_ident import identify, simulate
from scara_ident.export.identified_model import identified_model
from scara_ident.motion.motion import Motion
from scara_ident.use.check import check
from scara_ident.use.joint_limits import joint_limits
from scara_ident.use.tracking import RATE, at_ticks
from scara_ident.use.trial_motion import trial_motion

KINDS = ("fourier", "points", "sweep", "fourier")
SECONDS, RECORDED = 12.0, 500.0
# Nearer than this to a reversal Coulomb friction may have either sign, share of the joint's largest speed.
SLOW = 0.02


def on_one_arm(name: str, seed: int, folder: Path) -> tuple[float, float, float, float, float, bool]:
    """Return shares of difference: of samples, of peaks, of the limiting peak, of rms, of energy; whether the limiting joint agrees."""
    rng = np.random.default_rng([seed, 1])
    arm, robot = random_arm(name, True, 18, folder, rng)
    motions = [random_motion(f"M{k + 1}", arm, kind, SECONDS, rng) for k, kind in enumerate(KINDS)]
    runs = [simulate(arm, item, seed=seed + k, rate=RECORDED).recording for k, item in enumerate(motions)]
    known = identified_model(identify(robot, runs))
    wanted = at_ticks(trial_motion(arm, seed))
    signals = wanted.position, wanted.velocity, wanted.acceleration
    limits = joint_limits(robot)
    found = check(known, [Motion("trial", "trial", wanted.time, *signals, None, RATE)], limits)
    foreseen = found.drives[0].torque
    run = simulate(arm, wanted, feed=foreseen, seed=seed, rate=RATE)
    needed, v = run.true.effort, run.true.velocity
    # Friction where the speed changes its sign is in no forecast.
    moving = np.abs(wanted.velocity) > SLOW * np.max(np.abs(wanted.velocity), axis=1, keepdims=True)
    left = np.where(moving, foreseen - needed, np.nan)
    rms, own = (np.sqrt(np.nanmean(np.where(moving, x, np.nan) ** 2, axis=1)) for x in (foreseen, needed))
    peaks = [np.nanmax(np.where(moving, np.abs(x), np.nan), axis=1) for x in (foreseen, needed)]
    power = needed * v / robot.row_scale[:, None]
    given = float(np.sum(np.trapezoid(np.maximum(power, 0.0), dx=1.0 / RATE, axis=1)))
    use_of = [np.argmax(peak / limits.torque) for peak in peaks]
    return (
        float(np.max(np.sqrt(np.nanmean(left**2, axis=1)) / peaks[1])),
        float(np.max(np.abs(peaks[0] / peaks[1] - 1.0))),
        float(np.abs(peaks[0] / peaks[1] - 1.0)[use_of[1]]),
        float(np.max(np.abs(rms / own - 1.0))),
        abs(float(np.sum(found.energy.given)) / given - 1.0),
        bool(use_of[0] == use_of[1]),
    )


def main() -> None:
    """Print a line per arm."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="*", default=["scara03", "ur5", "panda"], choices=["scara03", "ur5", "panda"])
    parser.add_argument("--arms", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print("robot     seed  rms difference of peak  peak  limiting peak  rms torque  energy given  limiting joint")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.robots:
            for k in range(options.arms):
                seed = 100 * options.seed + k
                place = Path(folder) / f"{name}_{seed}"
                place.mkdir()
                *shares, same = on_one_arm(name, seed, place)
                print(f"{name:8s} {seed:5d}  " + "  ".join(f"{x:6.2%}" for x in shares) + f"  {'same' if same else 'another'}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
