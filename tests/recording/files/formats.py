"""One recording in the formats that people have, each written by the library of that format or by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.made_recordings import columns

Columns = dict[str, NDArray[np.float64]]

JOINTS = ("joint1", "joint2")
DEGREE = np.pi / 180


def recorded(samples: int = 400, interval: float = 2e-3) -> Columns:
    """Return a faultless recording of the SCARA03 with velocities, as the contract has it."""
    made = columns(samples, interval)
    for joint in JOINTS:
        made[f"{joint}.velocity"] = np.gradient(made[f"{joint}.position"], interval)
    return made


def write_bag(
    path: Path,
    made: Columns,
    *,
    names: Sequence[str] = JOINTS,
    topics: Sequence[str] = ("/joint_states",),
    storage: str = "mcap",
    stamped: bool = True,
    apart: bool = False,
    groups: Sequence[tuple[Sequence[str], float]] = (),
) -> Path:
    """Write a rosbag2 folder of joint states.

    `apart` publishes every joint in a message of its own; `groups` publish some joints together, each so many s late.
    """
    parts = groups or [([name], 0.0) for name in names] if groups or apart else [(names, 0.0)]
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp, text = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/String"]
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    start = 1_700_000_000_123_456_789
    with Writer(path, version=9, storage_plugin=plugin) as bag:
        chatter = bag.add_connection("/chatter", text.__msgtype__, typestore=store)
        bag.write(chatter, start, store.serialize_cdr(text(data="hello"), text.__msgtype__))
        for topic in topics:
            connection = bag.add_connection(topic, state.__msgtype__, typestore=store)
            for k, seconds in enumerate(made["time"]):
                for group, late in parts:
                    instant = start + round((seconds + late) * 1e9)
                    sent = stamp(sec=instant // 10**9, nanosec=instant % 10**9) if stamped else stamp(sec=0, nanosec=0)
                    values = {
                        signal: np.array([made[f"{name}.{signal}"][k] for name in group if f"{name}.{signal}" in made])
                        for signal in ("position", "velocity", "effort")
                    }
                    message = state(header=header(stamp=sent, frame_id=""), name=list(group), **values)
                    bag.write(connection, instant + 40_000, store.serialize_cdr(message, state.__msgtype__))
    return path


def write_mat(path: Path, content: Mapping[str, object]) -> Path:
    """Write a MATLAB file of version 5."""
    from scipy.io import savemat

    savemat(path, dict(content))
    return path


def write_mat73(path: Path, content: Mapping[str, NDArray[np.float64]]) -> Path:
    """Write what MATLAB writes with -v7.3: HDF5 behind a header of 512 bytes, arrays transposed."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in content.items():
            data = file.create_dataset(name.replace(".", "/"), data=np.atleast_2d(values.T))
            data.attrs["MATLAB_class"] = np.bytes_("double")
        note = file.create_dataset("note", data=np.array([[104], [105]], dtype=np.uint16))
        note.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("#refs#").create_dataset("a", data=np.arange(5.0))
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def write_hdf5(path: Path, content: Mapping[str, NDArray[np.float64]]) -> Path:
    """Write data sets by their paths."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in content.items():
            file.create_dataset(name, data=values)
        file.create_dataset("remark", data="by hand")
    return path


def write_plotjuggler(path: Path, made: Columns, *, others: bool = True) -> Path:
    """Write a CSV as PlotJuggler exports it: a row for every time of any signal, empty where another has none."""
    names = [name for name in made if name != "time"]
    lines = [",".join(["__time", *(f"/joint_states/{name.replace('.', '/')}" for name in names), "/imu/acc/z"])]
    for k, seconds in enumerate(1_700_000_000.0 + made["time"]):
        lines.append(",".join([f"{seconds:.9f}", *(f"{made[name][k]:.17g}" for name in names), ""]))
        if others and k % 3 == 0:
            lines.append(",".join([f"{seconds + 7e-4:.9f}", *([""] * len(names)), "9.81"]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
