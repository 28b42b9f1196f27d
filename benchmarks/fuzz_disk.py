"""A disk that becomes full while results are written: one line that says so, and nothing half-written, see `fuzz.py`.

It needs the right to mount a tmpfs (root, or ``unshare --map-root-user --mount``).
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from fuzz_inputs import write_columns, write_seeds

from tests.recording.files.formats import recorded

SIZE = 32 * 2**20
PAGE = resource.getpagesize()
# Of the room that the results take, how much there is; with none a command stops before its work.
SHARES = (0.0, 0.15, 0.4, 0.65, 0.9)
QUICK = "excite --duration 4 --harmonics 3 --starts 1 --model basic --rate 200 --json"
# IN is where the inputs stand, OUT the folder on the disk; what a command reads of another's results is in IN/NAME.
COMMANDS = {
    "identify": "identify IN/run.parquet --model basic --output OUT",
    "diagnose": "diagnose IN/run.parquet --output OUT",
    "excite": f"{QUICK} --output OUT",
    "simulate": "simulate IN/trajectory.csv --repetitions 3 --output OUT",
    "inspect": "inspect IN/run.csv --urdf IN/scara.urdf --output OUT",
    "base": "base --output OUT",
    "check": "check IN/trajectory.csv IN/identify/identification.json --output OUT",
    "fleet": "fleet IN/arms --workers 1 --model basic --output OUT",
    **{
        f"export {to}": f"export IN/identify/identification.json --to {to} --output OUT" for to in ("mjcf", "c", "ros2")
    },
}


def write_inputs(folder: Path) -> None:
    """Write what the commands read."""
    write_seeds(folder)
    made_run, noise = recorded(samples=500), np.random.default_rng(0)
    for arm in ("arm1", "arm2"):
        (folder / "arms" / arm).mkdir(parents=True)
        for date in ("2026-01-15", "2026-02-15"):
            # The same motion with noise of its own: the same content twice is refused.
            made = {
                name: values if name == "time" else values + noise.normal(0.0, 1e-6, len(values))
                for name, values in made_run.items()
            }
            write_columns(folder / "arms" / arm / f"{date}_1.parquet", made)


@contextmanager
def small_disk(place: Path) -> Iterator[Callable[[int], None]]:
    """Mount an empty disk; yields how to leave so many bytes on it."""
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(place)], check=True)

    def leave(room: int) -> None:
        filler = place / "filler"
        filler.unlink(missing_ok=True)
        found = os.statvfs(place)
        # The last page is the filler's own.
        filler.write_bytes(bytes(max(found.f_bavail * found.f_bsize - room, 0)))

    try:
        yield leave
    finally:
        subprocess.run(["umount", str(place)], check=True)


def run(words: str, inputs: Path, out: Path, temporary: Path) -> subprocess.CompletedProcess[str]:
    """Run the program."""
    line = [word.replace("IN", str(inputs), 1).replace("OUT", str(out)) for word in words.split(" ")]
    return subprocess.run(
        [sys.executable, "-m", "scara_ident", *line],
        env={**os.environ, "TMPDIR": str(temporary)}, capture_output=True, text=True, timeout=600,
    )  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def fault(
    done: subprocess.CompletedProcess[str], out: Path, before: dict[str, bytes], whole: dict[str, bytes]
) -> str | None:
    """Say what is wrong with how a command ended on a full disk."""
    lines = [line for line in done.stderr.splitlines() if "scara-ident: note:" not in line]
    after = contents(out)
    # Results that come one by one, as a fleet's arms, may be there; each is whole.
    strange = [
        name for name, held in after.items() if before.get(name) != held and len(whole.get(name, b"")) != len(held)
    ]
    if strange:
        return f"half-written: {strange[0]}"
    if missing := sorted(before.keys() - after.keys()):
        return f"lost: {missing[0]}"
    if done.returncode == 0:
        return None if after.keys() >= whole.keys() else "nothing said"
    if done.returncode != 1:
        return f"status {done.returncode}"
    if len(lines) != 1:
        return f"{len(lines)} lines"
    if str(out.parent) not in lines[0] or "make room" not in lines[0]:
        return "not said what, where, what to do"
    return None


def full_disk(names: Sequence[str] = ()) -> Iterator[tuple[str, str, str]]:
    """Run every command on disks that are full sooner or later; yield what was done, a verdict and what was said."""
    with tempfile.TemporaryDirectory() as place, small_disk(Path(place) / "disk") as leave:
        inputs, out = Path(place) / "in", Path(place) / "disk" / "out"
        inputs.mkdir()
        write_inputs(inputs)
        for name, words in COMMANDS.items():
            # What others read is written first.
            if names and name not in (*names, "identify"):
                continue
            done = run(words, inputs, inputs / name, Path(place))
            if done.returncode:
                raise RuntimeError(f"{words}: {done.stderr}")
            whole = contents(inputs / name)
            if names and name not in names:
                continue
            needed = sum(-(-len(content) // PAGE) * PAGE for content in whole.values())
            for share in SHARES:
                leave(SIZE)
                out.mkdir()
                for old in whole:
                    (out / old).parent.mkdir(exist_ok=True)
                    (out / old).write_text("" if name in ("inspect", "fleet") else "old")
                if name == "inspect":
                    shutil.rmtree(out)
                    out.mkdir()
                before = contents(out)
                leave(int(share * needed))
                done = run(words, inputs, out, out.parent if share == SHARES[-1] else Path(place))
                wrong = fault(done, out, before, whole)
                verdict = wrong or ("written" if done.returncode == 0 else "refused")
                yield f"{name}, room for {share:.0%} of {needed // 1024} KiB", verdict, done.stderr.strip()[-300:]
                shutil.rmtree(out)
