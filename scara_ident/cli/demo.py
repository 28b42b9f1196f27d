"""``scara-ident demo``."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import output_console

# What the arm has and the identifier does not know.
HIDDEN = "transmission_loss:joint2:loss_coefficient=0.2"
# Folders of the chapters' results.
PARTS = (
    "base",
    "paper",
    "excite",
    "train",
    "test",
    "identify",
    "compare",
    "diagnose",
    "ask",
    "use",
    "export",
    "arms",
    "fleet",
)
# Days on which each of the fleet's arms is recorded; from the last on one of them has what the first arm has.
ARMS, DAYS, CHANGED = ("arm1", "arm2", "arm3"), ("2026-03-01", "2026-03-08"), "arm2"
# Samples per second of a fleet's recordings: what watches many arms for long keeps no more.
FLEET_RATE = 250.0


def demo(
    output: options.Folder = Path("demo-output"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise and of the random starts.")] = 1,
) -> None:
    """Run the whole story on the embedded arm: design, record, identify, compare, diagnose, ask, use, export, and a fleet."""
    from scara_ident.cli.ask import ask
    from scara_ident.cli.base import base
    from scara_ident.cli.compare import compare
    from scara_ident.cli.diagnose import diagnose
    from scara_ident.cli.excite import excite
    from scara_ident.cli.export import export
    from scara_ident.cli.fleet import fleet
    from scara_ident.cli.identify import identify
    from scara_ident.cli.paper import paper_in_short
    from scara_ident.cli.simulate import simulate
    from scara_ident.cli.use import use
    from scara_ident.errors import ScaraIdentError
    from scara_ident.files import check_output
    from scara_ident.fleet.folder import INSTALL

    check_output(output)
    for part in PARTS:
        if (output / part).is_symlink():
            raise ScaraIdentError(f"{output / part}: is a link, but results must stay in {output}; remove it")
    console = output_console()

    def chapter(text: str) -> None:
        console.print(f"\n== {text}", style="bold")

    train, test = output / "train", output / "test"
    chapter("The parameters that torque determines on this arm")
    base(output=output / "base")
    chapter("The tables of the original paper, printed and computed")
    paper_in_short(output / "paper")
    chapter("A motion with better excitation: 12 s within all limits")
    excite(duration=[12.0], harmonics=10, starts=2, seed=seed, output=output / "excite")
    chapter("Recordings of the virtual arm, with an effect that the model does not have")
    designed = str(output / "excite" / "trajectory.csv")
    simulate([designed, "OJD", "OJK", "CI"], effect=[HIDDEN], seed=seed, repetitions=2, output=train)
    simulate(["L1", "L2"], effect=[HIDDEN], seed=seed + 1, output=test)
    chapter("Parameters, and their errors on held-out recordings")
    identify([str(train)], validate=[str(test)], method="consistent", output=output / "identify")
    chapter("The parameters of each trajectory, tried on every trajectory")
    compare([str(train)], output=output / "compare")
    chapter("What the model lacks")
    found = output / "diagnose" / "diagnosis.json"
    diagnose([str(train)], validate=[str(test)], output=found.parent)
    console.print(f"The arm really had {HIDDEN}: see {train / 'OJD_1.truth.json'}.", soft_wrap=True)
    chapter("What to record next, if only one motion had been recorded")
    simulate(["CI"], effect=[HIDDEN], seed=seed, repetitions=2, output=output / "ask" / "recordings")
    ask(output / "ask", duration=8.0, starts=1, seed=seed)
    chapter("What the model gains, as feed-forward and in simulation")
    use(found, recording=[str(test)], output=output / "use")
    chapter("The identified arm for a controller: one C header")
    export(found, "c", output=output / "export")
    chapter("Three arms, a week apart: one of them has changed")
    if find_spec("distributed") is None:
        console.print(f"Not shown: the packages for fleets are missing; {INSTALL}")
    else:
        _record_fleet(output / "arms", seed)
        fleet(str(output / "arms"), output / "fleet")
    chapter("Done")
    console.print(f"Open {output / 'diagnose' / 'report.html'}", soft_wrap=True)


def _record_fleet(folder: Path, seed: int) -> None:
    """Record the fleet's arms on every day, a sub-folder each."""
    from scara_ident.simulation import parse_effect, simulate, virtual_arm, write_simulation
    from scara_ident.simulation.named import named_motion

    arm, loss = virtual_arm(), parse_effect(HIDDEN)
    motions = [named_motion(name, arm.robot) for name in ("OJD", "OJK", "CI")]
    for place, name in enumerate(ARMS):
        for k, day in enumerate(DAYS):
            effects = [loss] if name == CHANGED and day == DAYS[-1] else []
            for motion in motions:
                done = simulate(arm, motion, effects=effects, rate=FLEET_RATE, seed=100 * seed + 10 * place + k)
                write_simulation(done, folder / name / day)
