"""A page of every kind, and a browser to look at it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.effects.position import Spring
from scara_ident.export.identified_model import identified_model
from scara_ident.files import plain
from scara_ident.identification.compare import compare
from scara_ident.motion.motion import Motion
from scara_ident.paper import check_paper
from scara_ident.report.comparison import comparison_dict
from scara_ident.report.html.check import check_report
from scara_ident.report.html.comparison import comparison_report
from scara_ident.report.html.contact import contact_report
from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
from scara_ident.report.html.excitation import excitation_report
from scara_ident.report.html.fleet import fleet_report
from scara_ident.report.html.identification import IdentificationContext, identification_report
from scara_ident.report.html.paper import paper_report
from scara_ident.report.html.use import use_report
from scara_ident.robot.robot import load_robot
from scara_ident.use.check import Check, check
from scara_ident.use.contact import ContactFindings, look_for_contact
from scara_ident.use.joint_limits import joint_limits
from scara_ident.use.observer import contact_observer
from tests.arms import noisy, recorded_torque, recording, sines, ur5
from tests.report.html.made_fleet import made_fleet
from tests.report.simulated import made, run, swinging
from tests.report.test_use import result as used
from tests.shared import PATIENCE
from tests.use.quiet import known_ur5, pushed, quiet


@pytest.fixture(scope="session")
def place(tmp_path_factory) -> Callable[[str], Path]:
    """Where a page goes that all tests look at."""
    return lambda name: tmp_path_factory.mktemp(name) / "report.html"


@pytest.fixture(scope="session")
def result():
    return made([run("OJD_1", 1), run("OJD_2", 2)], [run("CI_1", 3, start=4.0)], bands=[15.0, 15.0])


@pytest.fixture(scope="session")
def identified(result, place) -> Path:
    path = place("identified")
    identification_report(path, IdentificationContext(result))
    return path


def _with_spring(name: str, motion: int, seed: int):
    """A run of several sines with a spring of 0.05 N m/rad on joint 1, which one sine could not tell from inertia."""
    robot = load_robot()
    time = np.arange(4000) / 250.0
    q, v, a = sines(np.random.default_rng(motion), time, 2)
    torque = recorded_torque(robot, q, v, a, [(0.1, 0.05, 0.0, 0.0, 0.0)] * 2)
    torque[0] += 0.05 * (q[0] - 0.4)
    return noisy(recording(robot, name, time, q, torque), np.random.default_rng(seed), (0.01, 0.005))


@pytest.fixture(scope="session")
def diagnosis() -> Diagnosis:
    fit = [_with_spring(f"{name}_{k}", motion, 10 * motion + k) for motion, name in enumerate("ABC") for k in (1, 2)]
    held_out = [_with_spring("D_1", 7, 77)]
    found = diagnose(load_robot(), fit, validation=held_out, bands=[15.0, 15.0], catalogue=(Spring(),))
    assert [(effect.effect, effect.joint) for effect in found.effects] == [("spring", "joint1")]
    return found


@pytest.fixture(scope="session")
def diagnosed(diagnosis, place) -> Path:
    path = place("diagnosed")
    diagnosis_report(path, DiagnosisContext(diagnosis))
    return path


@pytest.fixture(scope="session")
def compared(place) -> Path:
    path = place("compared")
    content = comparison_dict(compare(load_robot(), [run("A_1", 1), run("A_2", 2), run("B_1", 3, start=5.0)]))
    comparison_report(path, json.loads(json.dumps(plain(content))))
    return path


def _designed() -> Motion:
    time = np.linspace(0.0, 10.0, 2001)
    omega = 2.0 * np.pi * np.array([[0.2], [0.3]])
    return Motion("X", "X", time, np.sin(omega * time), omega * np.cos(omega * time), -(omega**2) * np.sin(omega * time), None, 200.0)  # fmt: skip


@pytest.fixture(scope="session")
def excited(place) -> Path:
    path = place("excited")
    limits = {"joint1.velocity": {"bound": 1.0, "reached": 1.2566, "unit": "rad/s", "share": 1.2566}}
    content = {"log_det": 70.0, "condition": 2e5, "duration": 10.0, "limits": limits}
    excitation_report(path, content, load_robot(), [_designed()])
    return path


def _in_space() -> Motion:
    """A UR5 on a sine of every joint."""
    time = np.linspace(0.0, 10.0, 1001)
    omega = 2.0 * np.pi * np.linspace(0.1, 0.3, 6)[:, None]
    return Motion("X", "X", time, np.sin(omega * time), omega * np.cos(omega * time), -(omega**2) * np.sin(omega * time), None, 100.0)  # fmt: skip


@pytest.fixture(scope="session")
def turning(place) -> Path:
    """The page of a motion of an arm that leaves every plane."""
    path = place("turning")
    excitation_report(path, {"log_det": 70.0, "condition": 2e5, "duration": 10.0}, ur5(), [_in_space()])
    return path


@pytest.fixture(scope="session")
def checked(result) -> Check:
    """A motion on which joint 1 needs more torque than it has."""
    known = identified_model(result)
    return check(known, [swinging(np.zeros((2, 1000)))], joint_limits(known.robot, torques={"joint1": 0.3}))


@pytest.fixture(scope="session")
def checked_page(checked, place) -> Path:
    path = place("checked")
    check_report(path, checked)
    return path


@pytest.fixture(scope="session")
def touched() -> ContactFindings:
    """A UR5 without contact, and pushed at its tool."""
    observer = contact_observer(known_ur5(), [quiet(seed, 12.0) for seed in range(2)])
    push = pushed(quiet(7, 12.0), np.array([60.0, 0.0, 60.0]), 6.0, 7.0)
    return look_for_contact(observer, [quiet(9, 12.0), push])


@pytest.fixture(scope="session")
def touched_page(touched, place) -> Path:
    path = place("touched")
    contact_report(path, touched)
    return path


@pytest.fixture(scope="session")
def fleet_page(place) -> Path:
    path = place("fleet")
    fleet_report(path, made_fleet())
    return path


@pytest.fixture(scope="session")
def used_page(place) -> Path:
    path = place("used")
    use_report(path, used())
    return path


@pytest.fixture(scope="session")
def printed(place) -> Path:
    path = place("printed")
    paper_report(path, check_paper())
    return path


@pytest.fixture(scope="session")
def pages(
    identified, diagnosed, compared, excited, turning, printed, checked_page, touched_page, used_page, fleet_page
) -> dict[str, Path]:
    return {
        "identification": identified,
        "diagnosis": diagnosed,
        "comparison": compared,
        "excitation": excited,
        "excitation in space": turning,
        "paper": printed,
        "check": checked_page,
        "contact": touched_page,
        "use": used_page,
        "fleet": fleet_page,
    }


@pytest.fixture(scope="session")
def big(place) -> Path:
    """Ten recordings of 25 s at 1 kHz, with one sample of the first far off."""
    path = place("big")
    slow = run("OJD_1", 1, seconds=25.0)
    time = np.arange(25000) / 1000.0
    robot = load_robot()
    fast = [np.array([np.interp(time, slow.time, row) for row in signal]) for signal in (slow.position, slow.effort)]
    fast[0] = np.array([np.convolve(np.pad(row, 40, "edge"), np.hanning(83)[1:-1] / np.hanning(83).sum(), "valid") for row in fast[0]])  # fmt: skip
    first = recording(robot, "OJD_1", time, *fast)
    effort = first.effort.copy()
    effort[0, 12345] = 9.0
    group = [replace(first, effort=effort), *(replace(first, name=f"OJD_{k}", repetition=k) for k in range(2, 11))]
    identification_report(path, IdentificationContext(made(group, bands=[15.0, 15.0])))
    return path


ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.fixture(scope="session")
def browser():
    chromium = Path("/usr/bin/chromium")
    if not chromium.exists():
        pytest.skip("needs Debian's chromium (apt-get install chromium), which is not here")
    api = pytest.importorskip("playwright.sync_api", reason="needs the Python package playwright")
    with api.sync_playwright() as playwright:
        program = playwright.chromium.launch(executable_path=str(chromium), args=ARGUMENTS)
        yield program
        program.close()


class Window:
    """A page of the browser; what is said on its console and what it asks of a network."""

    def __init__(self, browser, options: dict) -> None:
        context = browser.new_context(**options)
        context.set_default_timeout(1000.0 * PATIENCE)
        self.page, self.said, self.asked = context.new_page(), [], []
        self.page.on(
            "console", lambda message: self.said.append(message.text) if message.type in ("error", "warning") else None
        )
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))

    def load(self, path: Path) -> None:
        self.page.mouse.move(0, 0)
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-ready=true]")


@pytest.fixture(scope="session")
def windows(browser):
    """A window for each choice of options: to begin one takes longer than to load another report into it."""
    made: dict[str, Window] = {}

    def window(options: dict) -> Window:
        if repr(options) not in made:
            made[repr(options)] = Window(browser, options)
        return made[repr(options)]

    yield window
    for each in made.values():
        each.page.context.close()


@pytest.fixture
def opened(browser, windows):
    """Load a page; at the end nothing may have been said on the console and nothing asked of a network.

    A test that changes more than the page, as size or colours, asks for a window of its own.
    """
    used, closed = [], []

    def open_(path: Path, own: bool = False, **options):
        options = {"viewport": {"width": 1180, "height": 900}, **options}
        window = Window(browser, options) if own else windows(options)
        used.append(window)
        if own:
            closed.append(window)
        window.said.clear()
        window.asked.clear()
        window.load(path)
        return window.page

    yield open_
    for window in closed:
        window.page.context.close()
    assert [words for window in used for words in window.said] == []
    assert all(url.startswith(("file:", "data:")) for window in used for url in window.asked)


# Figures without anything drawn in them, or with numbers that are none.
