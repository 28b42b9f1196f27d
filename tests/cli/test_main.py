"""The program: help, versions, exit status, and a run as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

import scara_ident
from scara_ident.cli import options
from scara_ident.cli.main import app, main, run
from scara_ident.errors import ScaraIdentError, UsageError
from tests.shared import PATIENCE
from tests.test_threads import blas_threads

COMMANDS = tuple(command.name or command.callback.__name__ for command in app.registered_commands)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(command, name: str):
    result = command(name, "--help")
    assert result.status == 0
    assert name in result.out
    assert "--help" in result.out


def test_the_program_lists_its_commands(command):
    result = command("--help")
    assert result.status == 0
    assert {"identify", "base"} <= set(COMMANDS)
    assert all(name in result.out for name in COMMANDS)
    # No line that is cut.
    assert "..." not in result.out.partition("Commands:")[2]


def test_the_version_is_the_packages(command):
    assert command("--version").out == f"scara-ident {scara_ident.__version__}\n"


def test_an_unknown_command_is_bad_usage(command):
    result = command("identfy")
    assert result.status == 2
    assert "identfy" in result.err


def test_no_word_at_all_is_the_help_and_bad_usage(capfd: pytest.CaptureFixture[str]):
    assert run([]) == 2
    captured = capfd.readouterr()
    assert "identify" in captured.out + captured.err
    assert "Traceback" not in captured.err


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (ScaraIdentError("a [b] c\nd"), 1, "scara-ident: a [b] c d\n"),
        (UsageError("wrong"), 2, "scara-ident: wrong\n"),
        (KeyboardInterrupt(), 130, "scara-ident: interrupted; no file is left half-written\n"),
        (MemoryError(), 1, "scara-ident: out of memory; give fewer recordings at a time, or shorter ones\n"),
        (PermissionError(13, "Permission denied", "/a/b"), 1, "scara-ident: /a/b: Permission denied\n"),
    ],
)
def test_errors_are_one_line_and_a_status(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], error: BaseException, status: int, said: str
):
    def fails(**_: object) -> None:
        raise error

    monkeypatch.setattr(sys.modules[run.__module__], "_commands", lambda: fails)
    assert run(["identify", "x"]) == status
    assert capfd.readouterr().err == said


def test_a_command_has_one_blas_thread_on_which_the_last_digits_depend():
    seen: list[set[int]] = []
    with threadpool_limits(limits=2, user_api="blas"):
        options.limited(lambda: seen.append(blas_threads()))()
    assert seen == [{1}]


def test_long_errors_are_not_wrapped(command, tmp_path: Path):
    path = tmp_path / ("long" * 40) / "robot.yaml"
    result = command("base", "--robot", path)
    assert str(path) in result.err


def test_main_exits_with_the_status(capfd: pytest.CaptureFixture[str]):
    for words, status in ((["--version"], 0), (["export", __file__, "--to", "c"], 1), (["nothing"], 2)):
        with pytest.raises(SystemExit) as caught:
            main(words)
        assert caught.value.code == status
    capfd.readouterr()


def user(*words: str | Path, **options) -> subprocess.CompletedProcess[str]:
    """Run the program as its own process, as from a shell."""
    program = [sys.executable, "-c", "from scara_ident.cli import main; main()"]
    environment = {key: value for key, value in os.environ.items() if key not in ("FORCE_COLOR", "COLUMNS")}
    environment.update(options.pop("environment", {}))
    return subprocess.run(
        [*program, *map(str, words)],
        capture_output=True,
        text=True,
        env=environment,
        timeout=PATIENCE,
        check=False,
        **options,
    )


@pytest.mark.slow
def test_a_user_gets_results_on_a_pipe_without_escape_codes(folder: Path, tmp_path: Path):
    done = user("identify", folder / "OJD_1.parquet", "--output", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "\x1b" not in done.stdout
    assert "\r" not in done.stdout
    assert "P_d1" in done.stdout
    assert (tmp_path / "out" / "identification.json").is_file()


@pytest.mark.slow
def test_a_user_gets_one_line_when_it_cannot_be(tmp_path: Path):
    done = user("identify", "nowhere.parquet", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "scara-ident: nowhere.parquet: no such file or folder\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("scara-ident id", {"identify"}),
        ("scara-ident identify --val", {"--validate"}),
        ("scara-ident identify --method ", {"ols", "wls", "rls", "consistent"}),
    ],
)
def test_the_shell_gets_the_completions(words: str, offered: set[str]):
    asked = {"_SCARA_IDENT_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    done = user(environment=asked)
    assert (done.returncode, done.stderr) == (0, "")
    assert set(done.stdout.split()) == offered


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_installed_as_the_documentation_says(shell: str, tmp_path: Path):
    # Which shell runs is told by the processes above, of which there may be none, or too many.
    told = {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    done = user("--install-completion", shell, environment=told)
    assert (done.returncode, done.stderr) == (0, "")
    written = [path for path in tmp_path.rglob("*") if path.is_file() and "_SCARA_IDENT_COMPLETE" in path.read_text()]
    assert len(written) == 1


@pytest.mark.slow
def test_a_terminal_that_knows_ascii_only_is_no_trouble():
    done = user("base", environment={"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "I1zz + 0.1089 m2 + 10000 Jm1" in done.stdout


@pytest.mark.slow
def test_a_reader_that_goes_away_is_no_trouble():
    program = f"{sys.executable} -c 'from scara_ident.cli import main; main()' base"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {program} | head -n 1"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout.startswith("bodies")
    assert done.returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_behind_the_output_is_one_line(monkeypatch, capfd: pytest.CaptureFixture[str]):
    full = open("/dev/full", "w", encoding="utf-8")  # noqa: SIM115
    monkeypatch.setattr(sys, "stdout", full)
    assert run(["--help"]) == 1
    with pytest.raises(OSError, match="No space"):
        full.close()
    told = capfd.readouterr().err
    assert told == "scara-ident: standard output or a temporary file: No space left on device; make room\n"


@pytest.mark.slow
def test_importing_the_package_is_quick():
    """Heavy libraries wait until they are needed."""
    heavy = ("cvxpy", "matplotlib", "polars", "pandas", "pinocchio", "numba", "yourdfpy", "rich")
    code = f"import sys, scara_ident; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert done.stdout.strip() == "[]"
    # What only coloured noise needs takes longer to import than many commands to run.
    code = "import sys, scara_ident.simulation, scara_ident.use; print('scipy.signal' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert done.stdout.strip() == "False"


def test_every_public_name_is_there():
    for name in scara_ident.__all__:
        assert getattr(scara_ident, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        getattr(scara_ident, "no" + "thing")
