"""Every decision of the diagnosis that a number stands behind."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from scara_ident.effects.spanned import ABSORBED


def _criterion(value: Any, unit: str, reason: str, source: str = "") -> Any:
    return field(default=value, metadata={"unit": unit, "reason": reason, "source": source})


@dataclass(frozen=True)
class SelectionCriteria:
    """When an effect is believed, and what is called left over.

    The metadata of each field holds its unit, the reason for it and where it comes from; see `documented`.
    """

    # Letting an effect in.
    absorbed: float = _criterion(
        ABSORBED,
        "share of its square",
        "of less of a column outside the model only rounding is left",
        "half the digits of a double",
    )
    least_outside: float = _criterion(
        5e-4,
        "share of its square",
        "what the model nearly spans is known by its own small errors only",
        "docs/diagnosis.md",
    )
    abstains: float = _criterion(
        0.05,
        "of the mean fold",
        "a trajectory that hardly excites an effect says nothing for or against it",
        "design: folds that abstain",
    )
    family_error: float = _criterion(
        0.01,
        "probability",
        "of letting any effect in where nothing is missing, over all candidates tried",
        "Bonferroni",
    )
    least_gain: float = _criterion(
        0.05,
        "share of squared residual",
        "removed on rows that it was not fitted to; below it is the detection limit",
        "docs/diagnosis.md",
    )
    least_votes: float = _criterion(
        0.75, "of voting trajectories", "an effect of the arm helps on most motions that excite it", "docs/diagnosis.md"
    )
    least_size: float = _criterion(
        2.5,
        "standard deviations",
        "by which its size differs from none with its nonlinear parameters free",
        "1 % two-sided",
    )
    # Searching.
    most_effects: int = _criterion(6, "effects", "more at once are not believed")
    near_best: float = _criterion(
        0.6, "of the best gain", "families worth refining before one is chosen: a grid point loses up to 40 %"
    )
    most_refined: int = _criterion(4, "families", "refined at once, for time")
    # What is left over.
    remainder: float = _criterion(
        0.08,
        "share of squared residual",
        "that signals explain on other trajectories to be called a remainder",
        "docs/diagnosis.md",
    )
    remainder_to_noise: float = _criterion(
        1.0, "of the noise", "a repeatable remainder larger than the noise is one whatever it depends on"
    )
    significant: float = _criterion(0.01, "probability", "that noise alone repeats so much", "F test")
    # Choosing the band again.
    wider: float = _criterion(
        1.3, "of the band", "with an effect found the search is repeated where the band grows by so much"
    )
    most_widenings: int = _criterion(2, "times", "bands grow no further")
    narrower: tuple[float, ...] = _criterion(
        (0.63, 0.4), "of the band", "tried for an effect with a resonance: two thirds of an octave each"
    )
    below_resonance: float = _criterion(
        1.5, "of the band", "columns of an effect with a resonance hold in a band that ends so far below it"
    )
    # Effects that stand for another.
    least_of_repeatable: float = _criterion(
        0.5, "of what repeats", "where most of it stays unexplained, an effect that removes less stands for another"
    )
    most_demotions: int = _criterion(3, "rounds", "for time")
    # Effects that cannot be told apart.
    alike: float = _criterion(2.0, "standard errors", "errors of two models that differ by less are the same", "95 %")
    least_share: float = _criterion(0.8, "of its gain", "that another effect must remove to be a confounder")

    def documented(self) -> list[tuple[str, Any, str, str, str]]:
        """Return name, value, unit, reason and source of every criterion."""
        return [
            (
                item.name,
                getattr(self, item.name),
                item.metadata["unit"],
                item.metadata["reason"],
                item.metadata["source"],
            )
            for item in fields(self)
        ]


CRITERIA = SelectionCriteria()
