"""Inputs that are wrong: whole files of every kind the program reads, and seeded mutations of them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from scara_ident.robot.robot import embedded_urdf
from tests.recording.files.formats import recorded, write_bag, write_hdf5, write_mat, write_mat73

DESCRIPTION = """urdf: scara.urdf
effort_side: motor
joints:
  joint1: {reduction: 100, effort_gain: 1.0, rotor_inertia: 0.0003}
  joint2: {reduction: 100}
locked: {joint3: 0.0}
gravity: [0, 0, -9.81]
recording:
  time: {column: time, unit: s}
  position: {column: "{joint}.position", unit: rad, scale: 1.0, offset: 0.0}
  effort: {columns: {joint1: joint1.effort, joint2: joint2.effort}}
"""
TOKENS = (
    "nan", "inf", "-inf", "-1", "0", "1e308", "1e-300", "1e160", "", "abc", "5kg", "1,5", "99999999999999999999999", "null",
    "true", "[]", "{}", "2020-13-45", "'", '"', "&a *a", "!!python/object:os.system", "..", "../../../PWNED", "/etc/passwd",
    "\x00", "\ud800", "\u202e\u00e9", "0x1F", "1_000", "9" * 5000, "[" * 2000, "-", "0 0 0", "1 2", "joint1", "link1", "%s",
    "${x}", "&lt;", "]]>", "<joint/>", "{joint}", "time", "rpm", "deg", "\n", "\t", ",", ";", "1e5", "1e29", "-0.0",
)  # fmt: skip
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, -1e308, 1e160, 1e29, 1e-300, 5e-324, 1e9, 360.0)
LARGEST = 200_000_000  # bytes of a file whose lines are repeated: more than may be read, less than the machine has
KINDS = ("robot.yaml", "scara.urdf", "run.csv", "run.parquet", "run.mat", "run73.mat", "run.npz", "run.h5", "run.mcap", "run.db3",
         "bag", "trajectory.csv", "identification.json")  # fmt: skip


def write_seeds(folder: Path) -> None:
    """Write a whole file of every kind, short enough to be identified from within a second."""
    made = recorded(samples=500)
    (folder / "robot.yaml").write_text(DESCRIPTION, encoding="utf-8")
    shutil.copyfile(embedded_urdf(), folder / "scara.urdf")
    write_columns(folder / "run.csv", made)
    write_columns(folder / "run.parquet", made)
    write_mat(folder / "run.mat", made)
    write_mat73(folder / "run73.mat", made)
    write_npz(folder / "run.npz", made)
    write_hdf5(folder / "run.h5", made)
    for storage, suffix in (("mcap", "mcap"), ("sqlite3", "db3")):
        bag = write_bag(folder / f"bag_{suffix}", made, storage=storage)
        shutil.copyfile(next(bag.glob(f"*.{suffix}")), folder / f"run.{suffix}")
    (folder / "bag_mcap").rename(folder / "bag")
    shutil.rmtree(folder / "bag_db3")
    write_columns(folder / "trajectory.csv", motion())
    names = [f"P_d{k}" for k in range(1, 6)] + [f"a{k}{j}" for j in (1, 2) for k in range(4)] + ["p_o1", "p_o2"]
    rows = [{"name": name, "joint": "joint1", "value": 0.01, "std": 0.1, "unit": "", "meaning": ""} for name in names]
    (folder / "identification.json").write_text(json.dumps({"robot": "scara03", "parameters": rows}))


def motion() -> dict[str, object]:
    """Return a motion of a tenth of a second."""
    made: dict[str, object] = {"time": 1e-3 * np.arange(100)}
    for joint in ("joint1", "joint2"):
        for order, signal in enumerate(("position", "velocity", "acceleration")):
            made[f"{joint}.{signal}"] = 0.2 * 10.0**order * np.sin(10.0 * 1e-3 * np.arange(100) + 0.5 * np.pi * order)
    return made


def write_columns(path: Path, made: dict[str, object]) -> None:
    """Write columns of any type to a CSV or Parquet file."""
    import polars as pl

    frame = pl.DataFrame(made, strict=False)
    frame.write_csv(path) if path.suffix == ".csv" else frame.write_parquet(path)


def write_npz(path: Path, made: Mapping[str, Any]) -> None:
    """Write columns to an archive of arrays."""
    np.savez(path, **made)


def mutate(path: Path, seeds: Path, random: Random) -> str:
    """Write a mutation of the file of that name among the seeds; return what was done."""
    source = seeds / path.name
    if source.is_dir():
        shutil.copytree(source, path)
        path = source = random.choice(sorted(path.iterdir()))
    table = {".csv": _table, ".parquet": _table, ".mat": _table, ".npz": _table, ".h5": _table}.get(path.suffix)
    if table is not None and random.random() < 0.5:
        return table(path, random)
    binary = path.suffix in (".parquet", ".mat", ".npz", ".h5", ".mcap", ".db3") or random.random() < 0.15
    content = source.read_bytes()
    done = []
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        change = random.choice(BINARY if binary else TEXT)
        content = change(content, random)
        done.append(change.__name__.strip("_"))
    path.write_bytes(content)
    return "+".join(done)


def _flip(content: bytes, random: Random) -> bytes:
    made = bytearray(content)
    for _ in range(random.choice((1, 4, 40))):
        if made:
            made[random.randrange(len(made))] = random.randrange(256)
    return bytes(made)


def _cut(content: bytes, random: Random) -> bytes:
    return content[: random.randrange(len(content) + 1)]


def _drop(content: bytes, random: Random) -> bytes:
    first = random.randrange(len(content) + 1)
    return content[:first] + content[first + random.choice((1, 8, 300)) :]


def _repeat(content: bytes, random: Random) -> bytes:
    first = random.randrange(len(content) + 1)
    last = first + random.choice((4, 64, 4000))
    return content[:last] + content[first:last] * random.choice((1, 3, 50)) + content[last:]


def _number(content: bytes, random: Random) -> bytes:
    """Write an extreme whole number over four or eight bytes."""
    size = random.choice((2, 4, 8))
    place = random.randrange(len(content) + 1)
    value = random.choice(
        (0, 1, 2 ** (8 * size - 1) - 1, 2 ** (8 * size) - 1, 2 ** (4 * size), random.getrandbits(8 * size))
    )
    return content[:place] + value.to_bytes(size, "little") + content[place + size :]


def _insert(content: bytes, random: Random) -> bytes:
    place = random.randrange(len(content) + 1)
    return content[:place] + random.choice(TOKENS).encode("utf-8", "surrogatepass") + content[place:]


def _words(content: bytes) -> list[bytes]:
    import re

    return re.split(rb"([\s\"'<>=:,{}\[\]]+)", content)


def _token(content: bytes, random: Random) -> bytes:
    words = _words(content)
    words[random.randrange(0, len(words), 2)] = random.choice(TOKENS).encode("utf-8", "surrogatepass")
    return b"".join(words)


def _another_token(content: bytes, random: Random) -> bytes:
    words = _words(content)
    words[random.randrange(0, len(words), 2)] = words[random.randrange(0, len(words), 2)]
    return b"".join(words)


def _line(content: bytes, random: Random) -> bytes:
    lines = content.splitlines(keepends=True) or [b""]
    place, other = random.randrange(len(lines)), random.randrange(len(lines))
    what = random.randrange(4)
    if what == 0:
        del lines[place]
    elif what == 1:
        lines.insert(other, lines[place])
    elif what == 2:
        lines[place], lines[other] = lines[other], lines[place]
    else:
        times = random.choice((2, 2000))
        lines[place:place] = [lines[place]] * min(times, 1 + LARGEST // max(len(lines[place]), 1))
    return b"".join(lines)


def _encoding(content: bytes, random: Random) -> bytes:
    text = content.decode("utf-8", "replace")
    return random.choice(
        (text.encode("utf-16"), b"\xff\xfe" + content, text.encode("cp1252", "replace"), b"", b"\n" * 99)
    )


BINARY: tuple[Callable[[bytes, Random], bytes], ...] = (_flip, _cut, _drop, _repeat, _number, _number, _insert)
TEXT: tuple[Callable[[bytes, Random], bytes], ...] = (
    _token, _token, _token, _another_token, _another_token, _line, _line, _insert, _drop, _cut, _encoding,
)  # fmt: skip


def _table(path: Path, random: Random) -> str:
    """Write a recording with a fault in its columns: names, types, lengths, numbers, order."""
    count = random.choice((500, 500, 500, 0, 1, 3, 60))
    made: dict[str, object] = {name: values[:count] for name, values in recorded(samples=500).items()}
    if path.name == "trajectory.csv":
        made = motion()
    done = []
    for _ in range(random.choice((1, 1, 2, 4))):
        name = random.choice(sorted(made))
        values = np.asarray(made[name])
        count = len(values) if values.ndim else 0
        what = random.choice(
            ("name", "drop", "extreme", "all", "type", "unit", "order", "noise", "shape", "constant", "copy")
        )
        done.append(what)
        some = (
            np.array([random.randrange(count) for _ in range(random.choice((1, 5, 200)))], dtype=int) if count else []
        )
        if what == "name":
            made[random.choice((*TOKENS[:40], "joint3.position", "Time")).encode("utf-8", "replace").decode()] = (
                made.pop(name)
            )
        elif what == "drop" and len(made) > 1:
            del made[name]
        elif values.dtype != np.float64:
            continue
        elif what in ("extreme", "noise"):
            values = values.copy()
            values[some] = random.choice(NUMBERS) if what == "extreme" else values[some] * random.gauss(0.0, 3.0)
            made[name] = values
        elif what == "all":
            made[name] = np.full(count, random.choice(NUMBERS))
        elif what == "type":
            made[name] = random.choice(
                (values.astype(str), values.astype(np.float16), values > 0, (1000 * values).astype(int))
            )
        elif what == "unit":
            made[name] = values * random.choice((1e-3, 1e3, 57.3, 1e9, -1.0, 1e-9))
        elif what == "order":
            made[name] = values[::-1].copy()
        elif what == "shape" and path.suffix in (".mat", ".npz", ".h5"):
            made[name] = random.choice(
                (values[: count // 2], values.reshape(1, -1), np.stack([values] * 3), values[:0])
            )
        elif what == "constant":
            made[name] = np.full(count, float(values.ravel()[0]) if values.size else 0.0)
        elif what == "copy":
            made[random.choice(sorted(made))] = values
    mat = write_mat73 if "73" in path.name else write_mat
    writer = {".mat": mat, ".npz": write_npz, ".h5": write_hdf5}.get(path.suffix, write_columns)
    try:
        writer(path, made)
    except Exception:
        # No writer takes such columns: an empty file is an input too.
        path.write_bytes(b"")
        done.append("empty")
    return "columns: " + "+".join(done)
