"""Wrong inputs of every kind are read or refused in one line; thousands of them: benchmarks/fuzz.py."""

from __future__ import annotations

import signal
from pathlib import Path
from random import Random
from types import FrameType, ModuleType

import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.excitation.known import read_parameters
from scara_ident.model.model import build_model
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation.reference import read_trajectory

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
SEED = 7
EACH = 16
# Seconds of the processor after which an input counts as one that is never done with; most take hundredths.
HANG = 20


@pytest.fixture(scope="module")
def inputs() -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        return pytest.importorskip("fuzz_inputs", reason="benchmarks are not part of an installed package")


@pytest.fixture(scope="module")
def seeds(inputs: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeds")
    inputs.write_seeds(folder)
    return folder


@pytest.fixture(scope="module")
def arm() -> Robot:
    return load_robot()


def read(path: Path, arm: Robot) -> object:
    if path.name in ("robot.yaml", "scara.urdf"):
        return load_robot(path)
    if path.name == "trajectory.csv":
        return read_trajectory(path, arm)
    if path.name == "identification.json":
        return read_parameters(path, build_model(arm, "complete"))
    return read_recording(path, arm)


KINDS = (
    "robot.yaml", "scara.urdf", "run.csv", "run.parquet", "run.mat", "run73.mat", "run.npz", "run.h5", "run.mcap", "run.db3", "bag",
    "trajectory.csv", "identification.json",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", KINDS)
def test_a_wrong_input_is_read_or_refused_in_one_line(
    inputs: ModuleType, seeds: Path, arm: Robot, tmp_path: Path, kind: str
) -> None:
    assert set(KINDS) == set(inputs.KINDS)
    refused = 0

    def hangs(_signal: int, _frame: FrameType | None) -> None:
        raise AssertionError(f"{kind}: not done after {HANG} s of the processor")

    before = signal.signal(signal.SIGVTALRM, hangs)
    try:
        for number in range(EACH):
            random = Random(f"{SEED} {kind} {number}")
            work = tmp_path / str(number)
            work.mkdir()
            if kind == "robot.yaml":
                (work / "scara.urdf").write_bytes((seeds / "scara.urdf").read_bytes())
            done = inputs.mutate(work / kind, seeds, random)
            there = sorted(tmp_path.rglob("*"))
            signal.setitimer(signal.ITIMER_VIRTUAL, HANG)
            try:
                read(work / kind, arm)
            except ScaraIdentError as error:
                refused += 1
                assert str(work) in str(error), f"{number} ({done}) names no file: {error}"
            except Exception as error:
                raise AssertionError(f"{number} ({done}): {type(error).__name__}: {error}") from error
            finally:
                signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
            assert sorted(tmp_path.rglob("*")) == there
    finally:
        signal.signal(signal.SIGVTALRM, before)
    assert refused > 0
