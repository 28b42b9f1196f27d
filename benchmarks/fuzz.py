"""Thousands of wrong inputs: each is read right or refused in one line, in time, within memory, with nothing left behind.

    PYTHONPATH=. python benchmarks/fuzz.py --inputs 5000 --seed 1
    PYTHONPATH=. python benchmarks/fuzz.py --kills 100
    PYTHONPATH=. python benchmarks/fuzz.py --full-disk

Each input runs the program in a process of its own, forked from one that has imported it, with limits of time, processor
and memory. Counted are: a trace, an internal error, an end by a signal, no end, more memory than allowed, a refusal of
other than one line, files beside ``--output``, and results that are not whole. `--kills` ends runs by SIGTERM or SIGKILL at
random moments and looks for results that are not whole and for what is left behind; `--full-disk` lets commands write onto
disks that become full.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from random import Random

import numpy as np
from fuzz_disk import full_disk
from fuzz_inputs import KINDS, mutate

from scara_ident.robot.robot import load_robot
from scara_ident.simulation import virtual_arm
from scara_ident.simulation.simulate import free_motion

LONGEST = 10.0  # s of the processor
PATIENCE = 120.0  # s by the clock, on a machine that does other things too: what only waits is found by this
MAX_MEMORY = 3e9
NOT_MADE = "not made"  # a fault of this program, counted as none of the other's
ALLOWED = 1.0  # GB, as --max-memory; the program itself and what is made of a recording come on top


@dataclass(frozen=True)
class Outcome:
    """What one input came to."""

    verdict: str
    seconds: float
    peak: float
    said: str


def words_for(name: str, work: Path, seeds: Path, random: Random) -> list[str]:
    """Return the command that reads a file; results take longer than all else, and are not always written."""
    file, out = str(work / name), ["--output", str(work / "out")]
    written = out if random.random() < 0.3 else []
    if name in ("robot.yaml", "scara.urdf"):
        robot = file
        if name == "scara.urdf" and random.random() < 0.5:
            shutil.copyfile(seeds / "robot.yaml", work / "robot.yaml")
            robot = str(work / "robot.yaml")
        elif name == "robot.yaml":
            shutil.copyfile(seeds / "scara.urdf", work / "scara.urdf")
        if random.random() < 0.5 or robot.endswith(".urdf"):
            return ["base", "--robot", robot, *out]
        return ["identify", str(seeds / "run.parquet"), "--robot", robot, "--model", "basic", *written]
    if name == "trajectory.csv":
        return ["simulate", file, *out]
    if name == "identification.json":
        return ["parameters", file]
    if random.random() < 0.4:
        return ["inspect", file]
    return ["identify", file, "--model", "basic", *written]


def run_one(words: list[str], work: Path, *, anew: bool = False) -> Outcome:
    """Run the program in a fork of this process, or in one of its own as a user does, and judge it."""
    before = {path for path in work.rglob("*") if path.is_file()}
    told = work.parent / "told"
    begin = time.monotonic()
    child = os.fork()
    if child == 0:
        _be_the_program(words, told, work, anew=anew)
    usage, status, verdict = _waited(child, begin)
    seconds = time.monotonic() - begin
    said = told.read_text(encoding="utf-8", errors="replace")
    lines = [line for line in said.splitlines() if "scara-ident: note:" not in line]
    left = [p for p in work.parent.rglob("*") if p.is_file() and p not in before and p != told]
    beside = [path for path in left if work / "out" not in path.parents and "seeds" not in path.parts]
    if verdict is None and usage.ru_maxrss * 1024 > MAX_MEMORY:
        verdict = "over memory"
    if verdict is None and os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        verdict = "hang" if number == signal.SIGXCPU else f"signal {number}"
    code = os.waitstatus_to_exitcode(status)
    for word, name in (("Traceback", "trace"), ("internal error", "internal error"), ("out of memory", "over memory")):
        if verdict is None and word in said:
            verdict = name
    if verdict is None and beside:
        verdict = f"beside output: {beside[0].name}"
    if verdict is None and (fault := unfinished(work / "out")):
        verdict = fault
    if verdict is None and code not in (0, 1, 2):
        verdict = f"status {code}"
    if verdict is None and code and len(lines) != 1:
        verdict = f"{len(lines)} lines"
    if verdict is None and code and any((work / "out").rglob("*")):
        verdict = "results of a refused input"
    return Outcome(verdict or ("read" if code == 0 else "refused"), seconds, usage.ru_maxrss * 1024, said.strip())


def _be_the_program(words: list[str], told: Path, work: Path, *, anew: bool = False) -> None:
    """Run the program with its output in a file, and end this process."""
    status = 70
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (int(LONGEST), int(LONGEST) + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        sink, source = os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), os.open(os.devnull, os.O_RDWR)
        os.dup2(source, 0)
        os.dup2(source, 1)
        os.dup2(sink, 2)
        os.chdir(work)
        if words[0] == "parameters":
            # What excite reads first; designing with them takes longer than is allowed here.
            status = _read_parameters(Path(words[1]))
        else:
            words = [*words, "--max-memory", str(ALLOWED)]
            if anew:
                program = f"import sys; sys.path[:0] = {sys.path!r}; from scara_ident.cli.main import main; main()"
                os.execv(sys.executable, [sys.executable, "-c", program, *words])
            from scara_ident.cli.main import run

            status = run(words)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(status)


def _read_parameters(path: Path) -> int:
    from scara_ident.errors import ScaraIdentError
    from scara_ident.excitation.known import read_parameters
    from scara_ident.model.model import build_model
    from scara_ident.robot.robot import load_robot

    try:
        read_parameters(path, build_model(load_robot(), "complete"))
    except ScaraIdentError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _waited(child: int, begin: float) -> tuple[resource.struct_rusage, int, str | None]:
    while True:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return usage, status, None
        if time.monotonic() - begin > PATIENCE:
            os.kill(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
            return usage, status, "hang"
        time.sleep(0.005)


def unfinished(out: Path) -> str | None:
    """Say what of the results is not whole."""
    for path in out.rglob("*"):
        if path.name.startswith("."):
            return f"left behind: {path.name}"
        if path.suffix == ".json":
            try:
                json.loads(path.read_text(encoding="utf-8"))
            except ValueError:
                return f"half a file: {path.name}"
        if path.suffix == ".html" and not path.read_text(encoding="utf-8").rstrip().endswith("</html>"):
            return f"half a file: {path.name}"
        if path.suffix in (".urdf", ".xml") and not path.read_text(encoding="utf-8").rstrip().endswith(">"):
            return f"half a file: {path.name}"
    return None


def fuzz(
    inputs: int, seed: int, kinds: tuple[str, ...] = KINDS, first: int = 0
) -> Iterator[tuple[str, str, list[str], Outcome]]:
    """Run the program on mutations; yield for each its number and kind, what was done, the words, and the outcome."""
    with tempfile.TemporaryDirectory() as place:
        seeds = Path(place) / "seeds"
        _seeds_written(seeds)
        for number in range(first, first + inputs):
            name = kinds[number % len(kinds)]
            # Of its own, so that one input can be run again alone.
            random = Random(f"{seed} {number}")
            work = Path(place) / "work"
            work.mkdir()
            # In a process of its own, as it uses Polars.
            done = _forked(lambda name=name, work=work, random=random: mutate(work / name, seeds, random))
            words = words_for(name, work, seeds, Random(f"{seed} {number} words"))
            made = not done.startswith(NOT_MADE)
            outcome = run_one(words, work) if made else Outcome(NOT_MADE, 0.0, 0.0, "")
            if outcome.verdict.startswith("signal") and words[0] != "parameters":
                # Commands read in another process, but where Polars is loaded as it is here.
                outcome = run_one(words, work, anew=True)
            yield f"{number} {name}", done, words, outcome
            shutil.rmtree(work)
            for stray in Path(place).iterdir():
                if stray.name not in ("seeds", "told"):
                    stray.unlink() if stray.is_file() else shutil.rmtree(stray)


def _seeds_written(seeds: Path) -> None:
    """Write them in another process: Polars starts threads where it is used, which a fork of this one would not have."""
    seeds.mkdir()
    program = f"import sys; sys.path[:0] = {sys.path!r}\nfrom pathlib import Path\nimport fuzz_inputs\n"
    subprocess.run([sys.executable, "-c", f"{program}fuzz_inputs.write_seeds(Path({str(seeds)!r}))"], check=True)


def _forked(make: Callable[[], str]) -> str:
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(writer, make().encode())
        except BaseException as error:
            os.write(writer, f"{NOT_MADE}: {type(error).__name__}: {error}".encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        said = pipe.read().decode()
    os.waitpid(child, 0)
    return said


def import_program() -> None:
    """Import what the commands import while they run, and compile the virtual arm, once for all inputs.

    Else each fork of a process pays for it again: with it an input takes a third of the time.
    """
    ours = (
        *("cli.main", "excitation.known", "export.robots", "identification.identify", "inspection.inspection"),
        *("recording.files.hdf5", "recording.files.mat", "recording.files.rosbag", "report.base", "report.html"),
        *("report.pictures", "report.summaries.identification", "simulation.named", "simulation.simulate"),
    )
    others = ("cvxpy", "h5py", "matplotlib.figure", "polars", "rosbags.highlevel", "scipy.io", "scipy.stats")
    stores = ("dashing", "eloquent", "foxy", "galactic", "humble")
    for name in (
        *others,
        *(f"rosbags.typesys.stores.ros2_{store}" for store in stores),
        *(f"scara_ident.{module}" for module in ours),
    ):
        import_module(name)
    arm = virtual_arm(load_robot())
    free_motion(arm, np.zeros(arm.robot.n), np.zeros(arm.robot.n), 1e-3)


def kills(count: int, seed: int) -> Counter[str]:
    """End runs at random moments; count what they leave."""
    random = Random(seed)
    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as place:
        seeds, work, told = Path(place) / "seeds", Path(place) / "work", Path(place) / "told"
        work.mkdir()
        _seeds_written(seeds)
        out = work / "out"
        words = ["identify", str(seeds / "run.parquet"), "--model", "basic", "--output", str(out)]

        def begin() -> int:
            if (child := os.fork()) == 0:
                _be_the_program(words, told, work)
            return child

        usage, _, _ = _waited(begin(), time.monotonic())
        usual = usage.ru_utime + usage.ru_stime
        for _ in range(count):
            number = random.choice((signal.SIGTERM, signal.SIGKILL))
            # Mostly while it writes, which is at the end; by the processor's time, as others use it too.
            moment = usual * random.choice((random.random(), random.uniform(0.5, 1.05)))
            child = begin()
            while (spent := _spent(child)) is not None and spent < moment:
                time.sleep(0.002)
            os.kill(child, number)
            _, status, _ = _waited(child, time.monotonic())
            fault = unfinished(out)
            if number == signal.SIGKILL and fault is not None and fault.startswith("left behind"):
                found["left behind by SIGKILL, to be swept"] += 1
                fault = None
            ended = "done before" if status == 0 else signal.Signals(number).name
            found[f"{ended}: {fault or 'whole'}"] += 1
            said = told.read_text(encoding="utf-8", errors="replace")
            if len(said.splitlines()) > 1 or "internal error" in said:
                found[f"said: {said}"] += 1
        _waited(begin(), time.monotonic())
        found[f"after the next run: {unfinished(out) or 'whole'}"] += 1
    return found


def _spent(child: int) -> float | None:
    """Return the time of the processor that a process took so far, s; None where it has ended."""
    words = Path(f"/proc/{child}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return None if words[0] == "Z" else (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first, to run one again")
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--show", action="store_true", help="also print what was said of every input")
    parser.add_argument("--full-disk", nargs="*", metavar="COMMAND", help="of all commands, or of these")
    asked = parser.parse_args()
    counts: Counter[str] = Counter()
    if asked.full_disk is not None:
        for what, verdict, said in full_disk(asked.full_disk):
            counts[verdict] += 1
            print(f"{verdict}: {what}: {said}", flush=True)
        _print(counts)
        return
    import_program()
    if asked.kills:
        _print(kills(asked.kills, asked.seed))
        return
    for name, done, words, outcome in fuzz(asked.inputs, asked.seed, tuple(asked.kinds), asked.first):
        counts[outcome.verdict] += 1
        if counts.total() % 500 == 0:
            print(f"after {counts.total()}: {dict(counts.most_common())}", flush=True)
        if asked.show or outcome.verdict not in ("read", "refused"):
            said = outcome.said if len(outcome.said) < 600 else f"{outcome.said[:250]} ... {outcome.said[-250:]}"
            print(
                f"{outcome.verdict}: {name} ({done}) {' '.join(words[:2])} {outcome.seconds:.1f} s: {said}", flush=True
            )
    _print(counts)


def _print(counts: Counter[str]) -> None:
    for what, count in counts.most_common():
        print(f"{count:6} {what}")


if __name__ == "__main__":
    main()
