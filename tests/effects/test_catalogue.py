"""The registry: what is built in, and what installed packages add."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import scara_ident
from scara_ident.effects import CATALOGUE, EFFECTS, available_effects, effects_named
from scara_ident.errors import ArgumentError, PluginWarning, ScaraIdentError, UsageError
from tests.plugins.made import make_installed

SOURCE = """
from scara_ident.effects import Coefficient, Effect

class Cable(Effect):
    name = "cable"
    summary = "a cable"
    coefficients = (Coefficient("size"),)

    def signal_columns(self, signals, member):
        return [signals.time]

class Nameless(Cable):
    name = ""

cable = Cable()
number = 3
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Put a package with one effect where Python finds it, as pip would."""

    def put(value: str, package: str) -> None:
        make_installed(tmp_path, package, "scara_ident.effects", {"cable": value}, SOURCE)
        monkeypatch.syspath_prepend(str(tmp_path))
        EFFECTS.refresh()

    yield put
    monkeypatch.undo()
    EFFECTS.refresh()


def test_families_of_one_name_come_together():
    assert available_effects()[: len(CATALOGUE)] == CATALOGUE
    assert effects_named("spring") == tuple(effect for effect in CATALOGUE if effect.name == "spring")
    assert len(effects_named("payload_change", "base_tilt")) == 7
    with pytest.raises(UsageError, match="effect 'sprign': did you mean spring"):
        effects_named("spring", "sprign")


@pytest.mark.parametrize("value", ["Cable", "cable"])
def test_a_package_adds_its_effect(install, value: str):
    install(f"package_of_{value}:{value}", f"package_of_{value}")
    (own,) = effects_named("cable")
    assert own.summary == "a cable"
    assert available_effects() == (*CATALOGUE, own)


@pytest.mark.parametrize(
    ("package", "value", "said"),
    [
        ("of_nothing", "of_nothing:Missing", "AttributeError"),
        ("of_nowhere", "nowhere_at_all:Cable", "ModuleNotFoundError"),
        ("of_numbers", "of_numbers:number", "is no scara_ident.effects.Effect"),
        ("of_nameless", "of_nameless:Nameless", "has no name"),
    ],
)
def test_a_broken_package_is_named_in_one_line(install, package: str, value: str, said: str):
    install(value, package)
    with pytest.raises(ScaraIdentError, match=f"^effect 'cable' of the package {package} cannot .*{said}") as error:
        effects_named("cable")
    assert "\n" not in str(error.value)
    with pytest.warns(PluginWarning, match=package):
        assert available_effects() == CATALOGUE


def sources(*rooms: str):
    package = Path(scara_ident.__file__).parent
    return {file: file.read_text() for room in rooms for file in sorted((package / room).rglob("*.py"))}


def test_report_diagnosis_and_inquiry_name_no_effect_and_import_no_family():
    names = re.compile(rf"\b({'|'.join(effect.name for effect in CATALOGUE)})\b")
    families = {type(effect).__module__ for effect in CATALOGUE}
    for file, text in sources("report", "diagnosis", "inquiry").items():
        code = re.sub(r"#.*", "", text)
        assert not names.search(code), f"{file}: {names.search(code)}"
        assert not [module for module in families if f"{module} import" in code], file


def test_no_joint_silently_becomes_the_first():
    found = [file for file, text in sources("").items() if re.search(r"\b(joint|partner|place) or 0\b", text)]
    assert found == []


def test_what_is_no_name_is_refused_as_a_type():
    with pytest.raises(ArgumentError, match="expected names, one after the other; found list"):
        effects_named(["spring"])  # type: ignore[arg-type]


def test_what_settles_an_effect_of_a_joint_that_may_slide_is_no_angle() -> None:
    """Of a carriage it was said that the memory of its friction is in angle."""
    for effect in CATALOGUE:
        if effect.name in ("presliding", "backlash"):
            assert "angle" not in effect.experiment
