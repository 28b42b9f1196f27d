"""What leaving out sharp turns wins on recordings held out, on the same samples: with and without those turns.

    python benchmarks/turns.py DATA

DATA is the folder of the measured arms. Each arm is fitted twice in the same bands, with every turn and without the sharp ones
(see `scara_ident.motion.rest.SHARP`), and both fits are asked for the relative error on each recording held out.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from checkouts import measured

from scara_ident import identify, load_robot, observe, prepare, read_recordings
from scara_ident.motion import rest


@contextmanager
def sharp(share: float) -> Iterator[None]:
    """Let turns be sharp from another share on; infinite keeps them all."""
    usual = rest.SHARP
    rest.SHARP = share
    try:
        yield
    finally:
        rest.SHARP = usual


def compare(name: str, words: list[str]) -> None:
    """Print the relative errors of both fits on each recording held out, %."""
    held = [words[k + 1] for k, word in enumerate(words) if word == "--validate"]
    robot = load_robot(words[words.index("--robot") + 1])
    training = read_recordings(words[: words.index("--validate")], robot)
    with sharp(np.inf):
        every = identify(robot, training, model="basic")
    without = identify(robot, training, model="basic", bands=every.bands)
    for samples, share in (("every turn", np.inf), ("no sharp turns", rest.SHARP)):
        for recording in read_recordings(held, robot):
            with sharp(share):
                rows = observe(every.model, prepare([recording], every.bands)).by_joint
            errors = [
                [100.0 * item.rms(found.estimate.value) / item.torque_rms for item in rows]
                for found in (every, without)
            ]
            print(
                f"{name:18} {recording.name:18} over {samples:14} fitted with them {np.round(errors[0], 2)}, "
                f"without {np.round(errors[1], 2)}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of the measured arms")
    for name, (words, _) in measured(parser.parse_args().data).items():
        compare(name, words)


if __name__ == "__main__":
    main()
