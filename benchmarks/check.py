"""Whether `check` foresees the torque, energy and limiting joint that a virtual arm then needs.

Random arms as in `virtual_sets`, without effects, identified from four motions; a motion from pose to pose that no one has
recorded is checked, and then run with the foreseen torque fed forward, once with encoders without steps and once with the
arm's own. Each joint's largest torque is compared: without steps the drive gives what the motion takes, with them also the
controller's answer to their noise, of which `check` states two standard deviations. The limits are the URDF's. Of the energy
that all drives give the share of difference is shown, and how many standard deviations of the parameters the peaks are off.

The controller runs at 1 kHz in all runs, and of the recordings every other sample is kept: at 500 Hz its gains make the loop
of some arms ring.

    python benchmarks/check.py --arms 3 --seed 1 [--robots scara03 ur5 panda]
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from virtual_motions import random_motion
from virtual_sets import random_arm

from scara_ident import identify, simulate
from scara_ident.export.identified_model import identified_model
from scara_ident.motion.motion import Motion
from scara_ident.simulation.arm import ideal
from scara_ident.use.check import CLOSE_STDS, Peak, check
from scara_ident.use.joint_limits import joint_limits
from scara_ident.use.tracking import RATE, at_ticks
from scara_ident.use.trial_motion import trial_motion

Array = NDArray[np.float64]
KINDS = ("fourier", "points", "sweep", "fourier")
SECONDS, RECORDED = 12.0, 500.0
# What peaks may differ by, share.
WITHIN = 0.05
HEAD = "| arm | seed | limiting joint | foreseen at [s] | needed at [s] | its peak | worst peak | in closed loop: its peak | worst peak | joints within 5 % | else within 2 std | neither | energy given |"


@dataclass(frozen=True, eq=False)
class Checked:
    """One arm: what was foreseen, and the largest torque of each joint without encoder steps and with them, shape (n,)."""

    name: str
    seed: int
    peaks: tuple[Peak, ...]
    bound: Array
    quiet: Array
    loop: Array
    # When each joint needed most, s.
    at: Array
    energy: float

    @property
    def foreseen(self) -> Array:
        """Sizes of the peaks, shape (n,)."""
        return np.array([abs(each.torque) for each in self.peaks])

    @property
    def limiting(self) -> int:
        """The joint that is nearest to its limit."""
        return int(np.argmax(self.quiet / self.bound))

    @property
    def named(self) -> bool:
        """Whether it was foreseen."""
        return int(np.argmax(self.foreseen / self.bound)) == self.limiting

    def off(self, needed: Array) -> Array:
        """Return by how much peaks were foreseen too low or too high, share, shape (n,)."""
        return np.asarray(np.abs(self.foreseen / needed - 1.0))

    @property
    def kinds(self) -> tuple[int, int, int]:
        """Joints whose peak in closed loop is within 5 %, else within two stated standard deviations, and neither."""
        near = self.off(self.loop) <= WITHIN
        stated = np.abs(self.foreseen - self.loop) <= CLOSE_STDS * np.array([each.std for each in self.peaks])
        return int(near.sum()), int((~near & stated).sum()), int((~near & ~stated).sum())

    def row(self) -> str:
        """Return a line of the table."""
        k = self.limiting
        cells = (
            self.name, self.seed, self.peaks[k].joint if self.named else f"{self.peaks[k].joint}, another named",
            f"{self.peaks[k].time:.2f}", f"{self.at[k]:.2f}",
            *(f"{x:.1%}" for y in (self.quiet, self.loop) for x in (self.off(y)[k], np.max(self.off(y)))),
            *self.kinds, f"{self.energy:.1%}",
        )  # fmt: skip
        return f"| {' | '.join(map(str, cells))} |"


def on_one_arm(name: str, seed: int, folder: Path) -> Checked:
    """Check a motion with the model of one arm, and let the arm run it."""
    rng = np.random.default_rng([seed, 1])
    arm, robot = random_arm(name, True, 18, folder, rng)
    motions = [random_motion(f"M{k + 1}", arm, kind, SECONDS, rng) for k, kind in enumerate(KINDS)]
    ticks = round(RATE / RECORDED)
    runs = [simulate(arm, item, seed=seed + k, rate=RECORDED, ticks=ticks).recording for k, item in enumerate(motions)]
    known = identified_model(identify(robot, runs))
    wanted = at_ticks(trial_motion(arm, seed))
    signals = wanted.position, wanted.velocity, wanted.acceleration
    limits = joint_limits(robot)
    found = check(known, [Motion("trial", "trial", wanted.time, *signals, None, RATE)], limits)
    feed = found.drives[0].torque
    quiet, loop = (simulate(each, wanted, feed=feed, seed=seed, rate=RATE).true for each in (ideal(arm), arm))
    power = quiet.effort * quiet.velocity / robot.row_scale[:, None]
    given = float(np.sum(np.trapezoid(np.maximum(power, 0.0), dx=1.0 / RATE, axis=1)))
    size = np.abs(quiet.effort)
    return Checked(
        name, seed, found.peaks, limits.torque, np.max(size, axis=1), np.max(np.abs(loop.effort), axis=1),
        wanted.time[np.argmax(size, axis=1)], abs(float(np.sum(found.energy.given)) / given - 1.0),
    )  # fmt: skip


def summary(name: str, all_: Sequence[Checked]) -> str:
    """Return what was found on the arms of one robot."""
    joints = sum(len(each.peaks) for each in all_)
    near, stated, neither = np.sum([each.kinds for each in all_], axis=0)
    quiet = [share for each in all_ for share in each.off(each.quiet)]
    own = [each.off(each.quiet)[each.limiting] for each in all_]
    loop = [each.off(each.loop)[each.limiting] for each in all_]
    std = [
        (size - needed) / peak.model_std
        for each in all_
        for size, needed, peak in zip(each.foreseen, each.quiet, each.peaks, strict=True)
    ]
    return (
        f"{name}: limiting joint foreseen on {sum(each.named for each in all_)} of {len(all_)}, its peak within {max(own):.1%}, in closed "
        f"loop {max(loop):.1%}; all {joints} joints within {max(quiet):.1%} ({np.median(np.abs(std)):.1f} std of the parameters, median); in closed loop "
        f"{near} within 5 %, {stated} more within 2 stated std, {neither} neither"
    )


def main() -> None:
    """Print a line per arm, and what was found per robot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="*", default=["scara03", "ur5", "panda"], choices=["scara03", "ur5", "panda"])
    parser.add_argument("--arms", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print(f"{HEAD}\n|{'---|' * (HEAD.count('|') - 1)}")
    said = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.robots:
            done = []
            for k in range(options.arms):
                seed = 100 * options.seed + k
                place = Path(folder) / f"{name}_{seed}"
                place.mkdir()
                done.append(on_one_arm(name, seed, place))
                print(done[-1].row(), flush=True)
            said.append(summary(name, done))
    print("\n".join(["", *said]))


if __name__ == "__main__":
    main()
