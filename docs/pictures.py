"""Make the pictures of the documentation: each is what commands of its page print or draw, made small.

    python docs/pictures.py           # all, in some minutes; needs the extra test, and Chromium for pages
    python docs/pictures.py report    # one

Pages are photographed in light mode at the width of a desktop.
"""

from __future__ import annotations

import base64
import io
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from scara_ident import named_motion, parse_effect, simulate, virtual_arm, write_recording
from scara_ident.robot.robot import embedded_urdf

FIGURES = Path(__file__).resolve().parent / "figures"
CHROMIUM = Path("/usr/bin/chromium")
SHADES, WIDEST = 256, 1100


def run(folder: Path, commands: str) -> None:
    """Run commands of ``scara-ident``, a line each."""
    for line in commands.strip().splitlines():
        subprocess.run([sys.executable, "-m", "scara_ident", *line.split()], cwd=folder, check=True, env=os.environ)


def kept(picture: Path, name: str) -> None:
    """Keep a picture among those of the documentation."""
    (FIGURES / f"{name}.png").write_bytes(small(picture.read_bytes()))


def small(png: bytes) -> bytes:
    """Return a picture no wider than a page, with few colours."""
    from PIL import Image

    with Image.open(io.BytesIO(png)) as image:
        full = image.convert("RGB")
    if full.width > WIDEST:
        full = full.resize((WIDEST, round(full.height * WIDEST / full.width)), Image.Resampling.LANCZOS)
    made = io.BytesIO()
    full.quantize(SHADES, dither=Image.Dither.NONE).save(made, "PNG", optimize=True)
    return made.getvalue()


def photographed(page: Path, name: str, height: int, shown: str = "") -> None:
    """Keep what a page shows in a window so high, from the top or from what a selector finds on."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        window = {"width": WIDEST, "height": height}
        opened = browser.new_page(viewport=window, color_scheme="light")
        opened.goto(page.as_uri())
        opened.wait_for_selector("html[data-ready=true]")
        if shown:
            opened.locator(shown).first.evaluate("item => item.scrollIntoView()")
        opened.wait_for_timeout(500)
        opened.screenshot(path=page.with_suffix(".png"))
        browser.close()
    kept(page.with_suffix(".png"), name)


def report(folder: Path) -> None:
    """The report of the diagnosis with which the README begins."""
    hidden = "--effect spring:joint1:stiffness=0.045 --effect presliding:joint2:presliding_distance=0.015"
    run(
        folder,
        f"""simulate OJD OJK --repetitions 2 {hidden} --output train
            simulate L1 CI --seed 7 {hidden} --output test
            diagnose train --validate test --output out""",
    )
    photographed(folder / "out" / "report.html", "report", 818)


def tutorial_effect(folder: Path) -> None:
    """The effect of the tutorial, as its step 7 draws it."""
    urdf = embedded_urdf().read_text(encoding="utf-8")
    (folder / "my_arm.urdf").write_text(urdf.replace('<mass value="7.5"/>', '<mass value="6"/>'), encoding="utf-8")
    (folder / "robot.yaml").write_text(
        "urdf: my_arm.urdf\neffort_side: motor\njoints:\n  joint1: {reduction: 100}\n  joint2: {reduction: 100}\n",
        encoding="utf-8",
    )
    lossy = "--effect transmission_loss:joint1:loss_coefficient=0.25"
    run(
        folder,
        f"""excite --robot robot.yaml --duration 10 --harmonics 6 --starts 1 --output excite
            simulate excite/trajectory.csv OJK --repetitions 2 {lossy} --output train
            simulate CI --seed 7 {lossy} --output test
            diagnose train --robot robot.yaml --validate test --output out""",
    )
    kept(folder / "out" / "effect_1.png", "tutorial_effect")


def ten_minutes(folder: Path) -> None:
    """What the diagnosis of the page of ten minutes finds."""
    cable = "--effect spring:joint2:stiffness=0.05"
    run(
        folder,
        f"""simulate OJD OJK --repetitions 2 {cable} --output train
            simulate CI --seed 1 {cable} --output test
            diagnose train --validate test --output out""",
    )
    kept(folder / "out" / "effect_1.png", "ten_minutes")


def design_motion(folder: Path) -> None:
    """The preview of the motion with which the page on designing one begins."""
    run(folder, "excite --duration 5 --harmonics 5 --starts 1 --output motion")
    kept(folder / "motion" / "excitation.png", "design_motion")


def contact(folder: Path) -> None:
    """The contact of the page on detecting one."""
    arm = virtual_arm()
    push = parse_effect("push:force=60,from=8,duration=0.8,direction=1/1/0,recording=pushed_1")
    for seed, name in enumerate(("fit", "free", "pushed")):
        wanted = replace(named_motion("OJD", arm.robot), name=name)
        made = simulate(arm, wanted, effects=[push], seed=seed, rate=250.0, record_velocity=True)
        write_recording(made.recording, folder / f"{name}_1.parquet")
    run(
        folder,
        """identify fit_1.parquet --output model
           contact pushed_1.parquet model/identification.json --free free_1.parquet --output contact""",
    )
    kept(folder / "contact" / "contact.png", "contact")


def feed_forward(folder: Path) -> None:
    """What the model wins as feed-forward, of the page on using it."""
    run(
        folder,
        """simulate OJD OJK L1 --effect transmission_loss:joint1:loss_coefficient=0.2 --output runs
           diagnose runs/OJD_1.parquet runs/OJK_1.parquet --validate runs/L1_1.parquet --effects transmission_loss --output out
           use out/diagnosis.json --recording runs/L1_1.parquet --output use""",
    )
    photographed(folder / "use" / "report.html", "feed_forward", 686)


def fleet(folder: Path) -> None:
    """Three arms over four dates, of which the second has a cable that gets stiffer."""
    arm = virtual_arm()
    for number in (1, 2, 3):
        for month in (1, 2, 3, 4):
            stiffness = 0.02 * (month - 1) if number == 2 else 0.0
            hidden = [parse_effect(f"spring:joint2:stiffness={stiffness}")] if stiffness else []
            made = simulate(arm, named_motion("OJD", arm.robot), effects=hidden, seed=10 * number + month, rate=250.0)
            place = folder / "fleet" / f"arm{number}" / f"2026-{month:02d}-15"
            place.mkdir(parents=True)
            write_recording(made.recording, place / "OJD_1.parquet")
    run(folder, "fleet fleet --workers 1 --output results")
    photographed(folder / "results" / "report.html", "fleet", 900)


def notebook(folder: Path) -> None:
    """What the cells of the notebook print and draw, stored in it."""
    import nbclient
    import nbformat

    path = FIGURES.parent / "tutorial.ipynb"
    held = nbformat.read(path, as_version=4)
    told = dict(held.metadata)
    nbclient.NotebookClient(held, timeout=1800, resources={"metadata": {"path": str(folder)}}).execute()
    for cell in held.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                made = small(base64.b64decode(output["data"]["image/png"]))
                output["data"]["image/png"] = base64.b64encode(made).decode("ascii") + "\n"
    held.metadata = nbformat.from_dict(told)
    nbformat.write(held, path)


PICTURES: tuple[Callable[[Path], None], ...] = (
    report,
    ten_minutes,
    tutorial_effect,
    design_motion,
    contact,
    feed_forward,
    fleet,
    notebook,
)


def main(wanted: Sequence[str]) -> None:
    """Make the pictures of these names, by default all."""
    for make in PICTURES:
        if not wanted or make.__name__ in wanted:
            with tempfile.TemporaryDirectory() as folder:
                make(Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:])
