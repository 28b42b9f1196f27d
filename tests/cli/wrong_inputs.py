"""Files that are wrong in one way each, for the commands to refuse."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from scara_ident.robot.robot import embedded_urdf
from tests.made_recordings import columns, save

LONG = 1200


def make_wrong_files(place: Path) -> None:
    """Write them all into a folder."""
    place.mkdir(parents=True, exist_ok=True)
    _recordings(place)
    _robots(place)
    _others(place)


def _recordings(place: Path) -> None:
    good = columns(LONG)
    time = good["time"]
    save(place / "good_1.parquet", good)
    save(place / "good_1.csv", good)
    (place / "empty_1.csv").write_bytes(b"")
    (place / "empty_1.parquet").write_bytes(b"")
    header, first, *rest = (place / "good_1.csv").read_text().splitlines()
    (place / "header_1.csv").write_text(f"{header}\n")
    (place / "one_1.csv").write_text(f"{header}\n{first}\n")
    (place / "text_1.csv").write_text("\n".join([header, first, first.replace(",", ",oops", 1), *rest]) + "\n")
    (place / "numbers_1.csv").write_text("\n".join([first, *rest]) + "\n")
    (place / "long_1.csv").write_text("\n".join([header, f"{first},7", *rest]) + "\n")
    (place / "twice_1.csv").write_text("\n".join([header.replace("joint2.effort", "joint1.effort"), first, *rest]))
    # A byte that is no letter in Windows-1252 either.
    (place / "no_text_1.csv").write_bytes(b"time,joint1.position \x81\n0,1\n")
    (place / "cut_1.parquet").write_bytes((place / "good_1.parquet").read_bytes()[:-200])
    (place / "log.txt").write_text("not a recording\n")
    (place / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(200))
    for suffix in ("mcap", "mat", "h5", "db3"):
        (place / f"garbage.{suffix}").write_bytes(bytes(range(256)) * 4)
    save(place / "other_1.csv", {name.replace("joint2", "elbow"): values for name, values in good.items()})
    save(place / "dumb_1.csv", {name: values for name, values in good.items() if name != "joint2.effort"})
    still = {name: np.full(LONG, 0.3) for name in good if name.endswith("position")}
    save(place / "still_1.parquet", good | still)
    save(place / "dead_1.parquet", good | {"joint1.effort": np.zeros(LONG)})
    save(place / "nan_1.parquet", good | {"joint1.position": np.full(LONG, np.nan)})
    degrees = {name: np.rad2deg(good[name]) for name in good if name.endswith("position")}
    save(place / "degrees_1.parquet", good | degrees)
    save(place / "nanoseconds_1.parquet", good | {"time": 1.7e18 + 1e9 * time})
    save(place / "milliseconds_1.parquet", good | {"time": 1e3 * time})
    save(place / "backwards_1.parquet", good | {"time": time[::-1].copy()})
    save(place / "leap_1.parquet", good | {"time": np.where(np.arange(LONG) == 600, time[500], time)})
    save(place / "stiff_1.parquet", good | {"joint2.position": np.full(LONG, 0.3)})
    save(place / "frozen_1.parquet", good | {"time": np.zeros(LONG)})
    (place / "nothing").mkdir()
    for folder in ("day1", "day2"):
        (place / folder).mkdir()
        save(place / folder / "run_1.parquet", good)


def _robots(place: Path) -> None:
    def describe(name: str, text: str) -> None:
        (place / f"{name}.yaml").write_text(text)

    urdf = f"urdf: {embedded_urdf()}\n"
    describe("list", "- urdf: arm.urdf\n")
    describe("syntax", "urdf: [arm\njoints: }\n")
    describe("key", f"{urdf}effort_side: motor\njoints: {{joint1: {{reductoin: 100}}}}\n")
    describe("reduction", f"{urdf}effort_side: motor\njoints: {{joint1: {{reduction: 0}}}}\n")
    describe("nourdf", "urdf: arm_that_is_not_there.urdf\n")
    describe("side", f"{urdf}effort_side: elbow\n")
    describe("gravity", f"{urdf}effort_side: motor\ngravity: [0, -9.81]\n")
    describe("unknown", f"{urdf}effort_side: motor\njoints: {{jiont1: }}\n")
    describe("again", f"{urdf}effort_side: motor\njoints:\n  joint1: {{reduction: 100}}\n  joint1: {{reduction: 50}}\n")
    describe("both", f"{urdf}effort_side: motor\njoints: {{joint1: , joint2: }}\nlocked: {{joint2: 0.1}}\n")
    (place / "binary.yaml").write_bytes(bytes(range(256)))
    text = embedded_urdf().read_text()
    (place / "syntax.urdf").write_text(text.replace("</robot>", ""))
    (place / "root.urdf").write_text("<sdf version='1.6'></sdf>\n")
    (place / "rigid.urdf").write_text("<robot name='post'><link name='base'/></robot>\n")
    endless = re.sub(r'lower="[^"]*" upper="[^"]*" ', "", text.replace('type="revolute"', 'type="continuous"'))
    (place / "endless.urdf").write_text(endless)
    child = '<child link="link2"/>'
    for name, old, new in (
        ("samename", 'joint name="joint2"', 'joint name="joint1"'),
        ("samelink", 'link name="link2"', 'link name="link1"'),
        ("nolink", child, '<child link="lnk2"/>'),
        ("nochild", child, ""),
        ("loop", child, '<child link="link1"/>'),
        ("roots", "</robot>", '<link name="lonely"/></robot>'),
    ):
        (place / f"{name}.urdf").write_text(text.replace(old, new))


def _others(place: Path) -> None:
    time = np.arange(50) / 100
    motion = {"time": time} | {
        f"joint{j}.{kind}": np.zeros(50) for j in (1, 2) for kind in ("position", "velocity", "acceleration")
    }
    save(place / "path.csv", motion)
    save(place / "lacking.csv", {"time": time, "joint1.position": time})
    save(place / "hole.csv", motion | {"joint2.velocity": np.where(time > 0.2, np.nan, 0.0)})
    save(place / "short.csv", {name: values[:1] for name, values in motion.items()})
    save(place / "loop.csv", motion | {"time": np.zeros(50)})
