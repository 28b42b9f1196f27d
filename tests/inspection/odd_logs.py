"""Logs and URDFs as people have them: each writes a file, and says what is to be read of it or why it is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tests.arms import Link, write_urdf
from tests.made_recordings import save
from tests.recording.files.formats import DEGREE, write_bag, write_hdf5, write_mat, write_mat73, write_plotjuggler

Array = NDArray[np.float64]
Columns = dict[str, Array]

SAMPLES, RATE = 300, 100.0
ARM = ("j1", "j2", "j3")
EPOCH = 1_700_476_401.1


def moving(names: Sequence[str] = ARM, *, turns: float = 0.0, late: float = 0.0) -> Columns:
    """Return the contract's columns of joints that swing within 1.2 rad.

    The last also turns on, and the first is sampled late, by so many turns and seconds.
    """
    rng = np.random.default_rng(0)
    made = {"time": np.arange(SAMPLES) / RATE}
    for k, name in enumerate(names):
        time = made["time"] + (0.0 if k else late)
        w = 2 * np.pi * (0.5 + 0.13 * k)
        onward = 2 * np.pi * turns / time[-1] if k == len(names) - 1 else 0.0
        made[f"{name}.position"] = 0.2 * k + 0.5 * np.sin(w * time + k) + onward * time
        made[f"{name}.velocity"] = 0.5 * w * np.cos(w * time + k) + onward
        made[f"{name}.effort"] = 5.0 * np.sin(1.7 * w * time - k) + 0.01 * rng.standard_normal(SAMPLES)
    return made


MADE = moving()
GEARED = (100.0, 100.0, 100.0)


def arm(folder: Path) -> Path:
    """Three joints with gears."""
    return write_urdf(folder / "arm.urdf", [Link()] * 3, GEARED)


def with_gripper(folder: Path, *, coupled: bool = True) -> Path:
    """Two fingers at the third link."""
    fingers = (Link(kind="prismatic"), Link(kind="prismatic", parent=2))
    path = write_urdf(folder / "arm.urdf", (*[Link()] * 3, *fingers), GEARED)
    text = path.read_text()
    mimic = '<joint name="j5" type="prismatic"><mimic joint="j4"/>' if coupled else '<joint name="j5" type="prismatic">'
    path.write_text(text.replace('<joint name="j5" type="prismatic">', mimic))
    return path


def with_free_fingers(folder: Path) -> Path:
    return with_gripper(folder, coupled=False)


def with_wheels(folder: Path) -> Path:
    """Two wheels, j4 and j5, beside the arm on the base."""
    wheel = Link(kind="continuous", parent=-2)
    return write_urdf(folder / "arm.urdf", (*[Link()] * 3, wheel, wheel), GEARED)


def endless(folder: Path) -> Path:
    """The last joint turns without end."""
    return write_urdf(folder / "arm.urdf", (Link(), Link(), Link(kind="continuous")), GEARED)


def backwards(folder: Path) -> Path:
    """The file names the last joint first."""
    path = arm(folder)
    text = path.read_text()
    start, end = text.index('<joint name="j3"'), text.rindex("</joint>") + len("</joint>")
    path.write_text(text[:start].replace('<link name="l1">', f'{text[start:end]}<link name="l1">') + text[end:])
    return path


@dataclass(frozen=True)
class Log:
    """A file, and what is to become of it.

    Attributes
    ----------
    name : str
    write : callable
        Writes it into a folder and returns its path.
    urdf : callable
        Writes the URDF.
    made : mapping
        What is in it, as the contract has it.
    joints : tuple of str
        Those to be identified.
    refused : str
        Pattern of what is said where it cannot be read: the remedy.
    note : str
        Pattern of a note or finding.
    pattern : str or None
        Of ``--joints``.
    clock : float
        How exact its time is, s.
    exact : float
        How exact its numbers are.
    """

    name: str
    write: Callable[[Path], Path]
    urdf: Callable[[Path], Path] = arm
    made: Mapping[str, Array] | None = None
    joints: tuple[str, ...] = ARM
    refused: str = ""
    note: str = ""
    pattern: str | None = None
    clock: float = 1e-9
    exact: float = 1e-9


def parquet(made: Mapping[str, object]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        pl.DataFrame(dict(made)).write_parquet(folder / "log_1.parquet")
        return folder / "log_1.parquet"

    return write


def csv(
    made: Mapping[str, Sequence[object] | Array],
    separator: str = ",",
    *,
    comma: bool = False,
    header: bool = True,
    encoding: str = "utf-8",
    change: Callable[[list[str]], list[str]] = list,
) -> Callable[[Path], Path]:
    def word(value: object) -> str:
        text = value if isinstance(value, str) else f"{value:.12g}"
        return text.replace(".", ",") if comma and not isinstance(value, str) else text

    def write(folder: Path) -> Path:
        rows = [separator.join(made)] if header else []
        rows += [separator.join(map(word, row)) for row in zip(*made.values(), strict=True)]
        (folder / "log_1.csv").write_bytes(("\n".join(change(rows)) + "\n").encode(encoding))
        return folder / "log_1.csv"

    return write


def bag(made: Columns, names: Sequence[str] = ARM, **how: Any) -> Callable[[Path], Path]:
    return lambda folder: write_bag(folder / "run_1", made, names=names, **how)


def apart(made: Columns, groups: Sequence[tuple[Sequence[str], float]]) -> Callable[[Path], Path]:
    """Write a bag whose joints are published in groups, each with its delay in s."""

    def write(folder: Path) -> Path:
        return write_bag(folder / "run_1", made, groups=groups)

    return write


def bag_file(folder: Path) -> Path:
    (file,) = write_bag(folder / "run_1", MADE, names=ARM).glob("*.mcap")
    return file


def one_of_ros1(folder: Path) -> Path:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    with Writer(folder / "run_1.bag") as file:
        connection = file.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k, seconds in enumerate(MADE["time"]):
            instant = 1_700_000_000_000_000_000 + round(seconds * 1e9)
            sent = stamp(sec=instant // 10**9, nanosec=instant % 10**9)
            values = {s: np.array([MADE[f"{j}.{s}"][k] for j in ARM]) for s in ("position", "velocity", "effort")}
            message = state(header=header(seq=k, stamp=sent, frame_id=""), name=list(ARM), **values)
            file.write(connection, instant, store.serialize_ros1(message, state.__msgtype__))
    return folder / "run_1.bag"


def named(
    time: str, position: str, effort: str, *, angle: float = 1.0, made: Columns = MADE, first: int = 1
) -> Columns:
    """Return columns with other names, in which {k} is a joint's number."""
    found = {time: made["time"]}
    for k, joint in enumerate(ARM):
        found[position.format(k=k + first, joint=joint)] = made[f"{joint}.position"] / angle
        found[effort.format(k=k + first, joint=joint)] = made[f"{joint}.effort"]
    return found


def stamps(form: str, start: float = EPOCH) -> list[str]:
    """Return the times as words."""
    from datetime import UTC, datetime

    return [datetime.fromtimestamp(start + t, UTC).strftime(form) for t in MADE["time"]]


def table(*signals: str) -> list[Array]:
    return [MADE["time"], *(MADE[f"{joint}.{signal}"] for signal in signals for joint in ARM)]


def numbered(columns: Sequence[Array]) -> Columns:
    return {f"c{k}": values for k, values in enumerate(columns)}


def stacked(signal: str) -> Array:
    return np.array([MADE[f"{joint}.{signal}"] for joint in ARM])


def without(made: Columns, *endings: str) -> Columns:
    return {name: values for name, values in made.items() if not name.endswith(endings)}


def and_more(*names: str, position: Array | float = 0.02, effort: Array | float = 0.0) -> Columns:
    """Return the arm's columns and those of joints that are not to be identified."""
    more = {}
    for name in names:
        more[f"{name}.position"] = position + np.zeros(SAMPLES)
        more[f"{name}.velocity"] = np.gradient(more[f"{name}.position"], 1 / RATE)
        more[f"{name}.effort"] = effort + np.zeros(SAMPLES)
    return MADE | more


TIME = MADE["time"]
SPIN = 9.0 * TIME
NAMED = named("t", "q{k}", "tau{k}")
ENDLESS = moving(turns=2.2)
BEYOND = MADE | {"j1.position": MADE["j1.position"] + 3.0}
JITTER = TIME + np.random.default_rng(1).uniform(-2e-3, 2e-3, SAMPLES)
GAP = np.where(TIME > 1.5, TIME + 1.0, TIME)

LOGS = (
    # Formats.
    Log("parquet", parquet(MADE)),
    Log("csv", csv(MADE), exact=1e-8),
    Log("csv with semicolons and decimal commas", csv(MADE, ";", comma=True), exact=1e-8),
    Log("csv with tabs", csv(MADE, "\t"), exact=1e-8),
    Log("csv with blanks", csv(MADE, " "), exact=1e-8),
    Log("csv with a byte order mark", csv(MADE, encoding="utf-8-sig"), exact=1e-8),
    Log("csv in Windows-1252", csv(named("Zeit", "Winkel {k} [°]", "Moment {k}", angle=DEGREE), encoding="cp1252"), note="read as Windows-1252", exact=1e-8),
    Log("csv in UTF-16", csv(named("Zeit", "Winkel {k} [°]", "Moment {k}", angle=DEGREE), encoding="utf-16"), exact=1e-8),
    Log("csv with a row too long", csv(MADE, change=lambda rows: [*rows[:50], rows[50] + ",1", *rows[51:]]), refused="correct or remove it"),
    Log("csv with a name twice", csv(MADE, change=lambda rows: [rows[0].replace("j2.effort", "j1.effort"), *rows[1:]]), refused="rename one"),
    Log("csv without a header", csv(numbered(table("position", "effort")), header=False), note="no header", exact=1e-8),
    Log("csv without a header, with velocities", csv(numbered(table("position", "velocity", "effort")), header=False), note="no header", exact=1e-8),
    Log("csv without a header, of other columns", csv(numbered(table("position", "effort")[:-1]), header=False), refused="position: columns: .*j1: column_2.*and time: .column: column_1"),
    Log("csv behind lines of a controller", csv(MADE, ";", comma=True, change=lambda rows: ["Trace export", "Channels;10", "Sample time;10,0", "", *rows]), exact=1e-8),
    Log("csv without a header behind a line of words", csv(numbered(table("position", "effort")), header=False, change=lambda rows: ["recorded by hand", "", *rows]), note="no header", exact=1e-8),
    Log("csv behind comments, with a commented header", csv(MADE, change=lambda rows: ["# made by a script, in a hurry", "#", f"# {rows[0]}", *rows[1:]]), exact=1e-8),
    Log("csv with blanks and a commented header", csv(MADE, " ", change=lambda rows: [f"# {rows[0]}", *rows[1:]]), exact=1e-8),
    Log("csv with a line of units", csv(named("t", "q{k}", "tau{k}", angle=DEGREE), change=lambda rows: ["exported", rows[0], "s" + ",deg,Nm" * 3, *rows[1:]]), exact=1e-8),
    Log("csv with a line of units in brackets", csv(named("t", "q{k}", "tau{k}", angle=DEGREE), "\t", change=lambda rows: [rows[0], "[s]" + "\t[°]\t[Nm]" * 3, *rows[1:]]), exact=1e-8),
    Log("mat", lambda folder: write_mat(folder / "log_1.mat", {"t": TIME, "q": stacked("position").T, "tau": stacked("effort")})),
    Log("mat 7.3", lambda folder: write_mat73(folder / "log_1.mat", {"t": TIME, "q": stacked("position"), "tau": stacked("effort")})),
    Log("mat of other lengths", lambda folder: write_mat(folder / "log_1.mat", {"t": TIME, "q": stacked("position")[:, 1:], "tau": stacked("effort")}), refused="name their columns"),
    Log("hdf5", lambda folder: write_hdf5(folder / "log_1.h5", {name.replace(".", "/"): values for name, values in MADE.items()})),
    Log("rosbag2", bag(MADE)),
    Log("rosbag2 in SQLite", bag(MADE, storage="sqlite3")),
    Log("mcap", bag_file),
    Log("ROS 1", one_of_ros1),
    Log("PlotJuggler", lambda folder: write_plotjuggler(folder / "log_1.csv", MADE), clock=5e-7),
    Log("another suffix", lambda folder: save(folder / "log_1.parquet", MADE).rename(folder / "log_1.xlsx"), refused="a recording is a .parquet"),
    # Clocks.
    Log("ms", parquet({**without(MADE, "time"), "time": 1e3 * TIME})),
    Log("us", parquet({**without(MADE, "time"), "stamp": 1e6 * TIME})),
    Log("whole ns since 1970", parquet({**without(MADE, "time"), "t_ns": (1e9 * TIME).astype(np.int64) + 1_700_000_000 * 10**9}), clock=6e-7),
    Log("s since 1970", parquet(MADE | {"time": TIME + EPOCH}), clock=3e-7),
    Log("a text of date and time", csv(MADE | {"time": stamps("%Y-%m-%d %H:%M:%S.%f")}), exact=1e-8, clock=2e-6),
    Log("ISO 8601 in UTC", csv(MADE | {"time": stamps("%Y-%m-%dT%H:%M:%S.%fZ")}), exact=1e-8, clock=2e-6),
    Log("a German date", csv(MADE | {"time": stamps("%d.%m.%Y %H:%M:%S,%f")}, ";", comma=True), exact=1e-8, clock=2e-6),
    Log("time of day over midnight", csv(MADE | {"time": stamps("%H:%M:%S.%f", 1_700_006_398.5)}), exact=1e-8, clock=2e-6),
    Log("dates in Parquet", parquet(MADE | {"time": pl.Series(1e9 * (TIME + 1.7e9)).cast(pl.Int64).cast(pl.Datetime("ns"))}), clock=5e-7),
    Log("text of tenths of a second", csv(MADE | {"time": [word[:-5] for word in stamps("%Y-%m-%d %H:%M:%S.%f")]}), refused="record time with more digits"),
    Log("jitter", parquet(MADE | {"time": JITTER}), note="the samples are taken as even", clock=1e-3),
    Log("a gap", parquet(MADE | {"time": GAP}), made=MADE | {"time": GAP}, note="the recording is cut there"),
    Log("time that runs back", parquet(MADE | {"time": np.where(TIME > 2.0, TIME - 1.0, TIME)}), refused="sort the rows by time"),
    Log("no time", parquet(without(MADE, "time")), refused="name its column and unit"),
    Log("messages without stamps", bag(MADE, stamped=False)),
    # Names and columns.
    Log("URDF's joints by number", parquet(named("timestamp", "actual_q_{k}", "actual_current_{k}", first=0))),
    Log("degrees", parquet(named("t", "{joint}_pos_deg", "{joint}_torque_Nm", angle=DEGREE))),
    Log("degrees that no name says", parquet(named("t", "angle{k}", "torque{k}", angle=DEGREE)), note="the URDF's limits allow deg"),
    Log("German", csv(named("Zeit [s]", "Istwinkel Achse {k} [Grad]", "Drehmoment Achse {k} [Nm]", angle=DEGREE), ";", comma=True), exact=1e-8),
    Log("French", csv(named("temps", "angle mesuré axe {k} (degrés)", "couple axe {k} (Nm)", angle=DEGREE)), exact=1e-8),
    Log("commands beside measurements", parquet(NAMED | named("t", "q_soll{k}", "tau_cmd{k}", made=moving(ARM[::-1])))),
    Log("an encoder at the links that some joints lack", parquet({f"Link.q{k}": stacked("position")[k - 1] if k < 2 else np.zeros(SAMPLES) for k in (1, 2, 3)} | {f"Motor.{name}": values for name, values in NAMED.items()}), note="Motor"),
    Log("two sources of efforts", parquet(named("t", "/real/q{k}", "/ideal/tau{k}", made=moving(ARM[::-1])) | named("t", "/real/q{k}", "/real/tau{k}"))),
    Log("texts and constants beside", parquet(NAMED | {"mode": ["run"] * SAMPLES, "torque_limit": np.full(SAMPLES, 9.0)})),
    Log("numbers as texts", parquet({name: [f"{value:.17g}" for value in values] for name, values in MADE.items()})),
    Log("encoder counts", parquet(MADE | {f"{j}.position": np.rint(1e4 * MADE[f"{j}.position"]) for j in ARM}), refused="state position: counts_per_turn"),
    Log("no efforts at all", parquet(without(MADE, "effort")), note="cannot be used to identify"),
    Log("a dead effort within the arm", parquet(MADE | {"j2.effort": np.zeros(SAMPLES)}), refused="identify without j2"),
    Log("constant efforts", parquet(MADE | {f"{j}.effort": np.zeros(SAMPLES) for j in ARM} | {f"{j}.position": np.zeros(SAMPLES) for j in ARM}), refused="record the efforts"),
    # Arms.
    Log("a file that names joints from the last", parquet(NAMED), backwards, joints=("j3", "j1", "j2")),
    Log("a gripper without channels", parquet(MADE), with_gripper, note="j4, j5: coupled"),
    Log("a gripper in the messages", bag(and_more("j4", "j5"), (*ARM, "j4", "j5")), with_gripper, note="j4, j5: coupled"),
    Log("three numbers for an arm with a gripper", parquet(NAMED), with_gripper, note="matched to the joints by order"),
    Log("fingers that are not coupled", parquet(and_more("j4", "j5")), with_free_fingers, note="position and effort are constant"),
    Log("fingers that move without effort", parquet(and_more("j4", "j5", position=0.02 * np.sin(TIME))), with_free_fingers, note="carries no joint"),
    Log("three numbers for an arm with fingers", parquet(NAMED), with_free_fingers, note="no channels for j4, j5"),
    Log("wheels that turn without effort", parquet(and_more("j4", "j5", position=SPIN)), with_wheels, note="j4, j5: carries no joint"),
    Log("wheels without efforts", parquet(and_more("j4", "j5", position=SPIN, effort=np.nan)), with_wheels, note="j4, j5: carries no joint"),
    Log("three numbers for an arm on wheels", parquet(NAMED), with_wheels, note="no channels for j4, j5"),
    Log("a joint that turns on and on", parquet(ENDLESS), endless, made=ENDLESS),
    Log("that joint within one turn", parquet(ENDLESS | {"j3.position": np.mod(ENDLESS["j3.position"], 2 * np.pi)}), endless, made=ENDLESS, note="unwrapped"),
    Log("a joint without channels", parquet(without(MADE, "j3.position", "j3.effort")), joints=("j1", "j2"), note="no channels for j3: taken as locked"),
    Log("joints by a pattern", parquet(MADE), pattern="j[13]", joints=("j1", "j3"), note="j2 is locked at .* 'j2.position' goes from"),
    Log("a pattern of no joint", parquet(MADE), pattern="arm_.*", refused="has j1, j2, j3"),
    Log("a joint that others follow", parquet(MADE), with_gripper, pattern="j[1-4]", refused="leave it out"),
    # Messages.
    Log("names in another order", bag(MADE, ARM[::-1])),
    Log("each joint in its message", bag(MADE, apart=True), note="joined"),
    Log("torso and arm apart, with the same stamps", apart(MADE, [(ARM[:1], 0.0), (ARM[1:], 0.0)]), note="joined"),
    Log("torso and arm apart, 3 ms later", apart(moving(late=0.003), [(ARM[:1], 0.003), (ARM[1:], 0.0)]), note="interpolated onto its clock"),
    Log("two topics", bag(MADE, topics=("/a/joint_states", "/b/joint_states")), note="taken of /a/joint_states, /b/joint_states"),
    Log("no joint states", bag(MADE, topics=()), refused="record the topic of the joint states"),
    Log("rad beyond the URDF's limits", bag(BEYOND), made=BEYOND, note="beyond the URDF's limit"),
)  # fmt: skip
