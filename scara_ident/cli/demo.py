"""``scara-ident demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import output_console

# What the arm has and the identifier is not told.
HIDDEN = "transmission_loss:joint2:loss_coefficient=0.2"
# Folders of the chapters' results.
PARTS = ("base", "paper", "excite", "train", "test", "identify", "compare", "diagnose")


def demo(
    output: options.Folder = Path("demo-output"),
    seed: Annotated[int, typer.Option(min=0, help="Of noise and random starts.")] = 1,
) -> None:
    """Run the whole story on the embedded arm: design, record, identify, compare, diagnose, report."""
    from scara_ident.cli.base import base
    from scara_ident.cli.compare import compare
    from scara_ident.cli.diagnose import diagnose
    from scara_ident.cli.excite import excite
    from scara_ident.cli.identify import identify
    from scara_ident.cli.paper import paper_in_short
    from scara_ident.cli.simulate import simulate
    from scara_ident.errors import ScaraIdentError
    from scara_ident.files import check_output

    check_output(output)
    for part in PARTS:
        if (output / part).is_symlink():
            raise ScaraIdentError(f"{output / part}: a link, and results stay in {output}; take it away")
    console = output_console()

    def chapter(text: str) -> None:
        console.print(f"\n== {text}", style="bold")

    train, test = output / "train", output / "test"
    chapter("What torque can tell of this arm")
    base(output=output / "base")
    chapter("The founding paper, printed against computed")
    paper_in_short(output / "paper")
    chapter("A motion that tells more: 12 s within all limits")
    excite(duration=[12.0], harmonics=10, starts=2, seed=seed, output=output / "excite")
    chapter("Recordings of the virtual arm, with an effect that nobody declares")
    designed = str(output / "excite" / "trajectory.csv")
    simulate([designed, "OJD", "OJK", "CI"], effect=[HIDDEN], seed=seed, repetitions=2, output=train)
    simulate(["L1", "L2"], effect=[HIDDEN], seed=seed + 1, output=test)
    chapter("Parameters, and torques that they were not fitted to")
    identify([str(train)], validate=[str(test)], method="consistent", output=output / "identify")
    chapter("Every trajectory's parameters against every trajectory")
    compare([str(train)], output=output / "compare")
    chapter("What the model lacks")
    diagnose([str(train)], validate=[str(test)], output=output / "diagnose")
    chapter("Done")
    console.print(f"The arm really had {HIDDEN}: see {train / 'OJD_1.truth.json'}.", soft_wrap=True)
    console.print(f"Open {output / 'diagnose' / 'report.html'}", soft_wrap=True)
