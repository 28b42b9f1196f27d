"""A URDF is read and checked once, and in one line where it cannot be used."""

from __future__ import annotations

from pathlib import Path

import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.robot import embedded_urdf
from scara_ident.robot.urdf_file import pinocchio_model, read_urdf


def test_the_embedded_urdf_is_read_and_made_a_model() -> None:
    tree = read_urdf(embedded_urdf(), Path("robot.yaml"))
    assert pinocchio_model(embedded_urdf(), tree).nv == 3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<robot", "not well-formed XML"),
        ("<arm/>", "the root element is <arm>, a URDF has <robot>"),
        ('<?xml version="1.0" encoding="utf-99"?><robot/>', "save it in UTF-8"),
    ],
)
def test_what_is_none_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(text, encoding="utf-8")
    with pytest.raises(RobotError, match=said):
        read_urdf(urdf, tmp_path / "robot.yaml")
    with pytest.raises(RobotError, match=r"robot\.yaml: urdf: no such file"):
        read_urdf(tmp_path / "none.urdf", tmp_path / "robot.yaml")


def test_a_letter_in_another_encoding_is_named_with_its_line(tmp_path: Path) -> None:
    """It was said to be not well-formed XML."""
    text = embedded_urdf().read_text(encoding="utf-8").replace("</robot>", "<!-- für den Prüfstand -->\n</robot>")
    urdf, line = tmp_path / "arm.urdf", text[: text.index("für")].count("\n") + 1
    urdf.write_bytes(text.encode("latin-1", errors="replace"))
    with pytest.raises(RobotError) as caught:
        read_urdf(urdf, urdf)
    assert str(caught.value) == (
        f"{urdf}, line {line}: a letter that is not in UTF-8, 'ü' if it is in Windows-1252; save the file in UTF-8"
    )
    # Where the first line says so it is no fault.
    urdf.write_bytes(text.replace('encoding="utf-8"', 'encoding="ISO-8859-1"', 1).encode("latin-1", errors="replace"))
    assert pinocchio_model(urdf, read_urdf(urdf, urdf)).nv == 3


def test_the_namespace_of_a_schema_is_passed_over(tmp_path: Path) -> None:
    """Drake's own URDFs name one, and were refused as having no <robot>."""
    text = embedded_urdf().read_text(encoding="utf-8")
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(text.replace("<robot ", '<robot xmlns="https://drake.mit.edu" ', 1), encoding="utf-8")
    named, plain = read_urdf(urdf, urdf), read_urdf(embedded_urdf(), urdf)
    assert [element.tag for element in named.iter()] == [element.tag for element in plain.iter()]
    assert pinocchio_model(urdf, named).names.tolist() == pinocchio_model(urdf, plain).names.tolist()
