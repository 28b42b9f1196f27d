"""Every threshold of the diagnosis, with unit, reason and source."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from scara_ident.effects.spanned import ABSORBED_SHARE

# Where nothing else is cited.
CHOSEN = "chosen; docs/criteria.md shows what it moves"


def _criterion(value: Any, unit: str, reason: str, source: str = CHOSEN) -> Any:
    return field(default=value, metadata={"unit": unit, "reason": reason, "source": source})


@dataclass(frozen=True)
class SelectionCriteria:
    """When an effect is believed, and what is called left over.

    The metadata of each field holds its unit, the reason for it and where it comes from; see `documented`.
    """

    # Letting an effect in.
    absorbed: float = _criterion(
        ABSORBED_SHARE,
        "share of its square",
        "of less of a column outside the model only rounding is left",
        "effects/spanned.py: above what a URDF loses by few digits",
    )
    min_outside: float = _criterion(
        5e-4,
        "share of its square",
        "what the model nearly spans is known by its own small errors only, unless it removes most of what is left (`dominant`)",
        "docs/decisions.md",
    )
    abstains: float = _criterion(
        0.05,
        "of the mean fold",
        "a trajectory that hardly excites an effect says nothing for or against it",
    )
    family_error: float = _criterion(
        0.002,
        "probability",
        "of letting any effect in where nothing is missing, over all candidates tried; asked in some five rounds",
        "Bonferroni: 1 % over a diagnosis",
    )
    min_gain: float = _criterion(
        0.05,
        "share of squared residual",
        "removed on rows that it was not fitted to; below it is the detection limit",
        "docs/decisions.md",
    )
    nearly_all: float = _criterion(
        0.9,
        "share of squared residual",
        "what removes as much leaves little but noise on its joint, and is tested by single rows too",
        "diagnosis/testing/row_test.py",
    )
    min_votes: float = _criterion(
        0.75, "of voting trajectories", "an effect of the arm helps on most motions that excite it", "docs/decisions.md"
    )
    min_size: float = _criterion(
        2.5,
        "standard deviations",
        "by which its size differs from none with its nonlinear parameters free",
        "1 % two-sided",
    )
    min_final_size: float = _criterion(
        3.0,
        "standard deviations",
        "by which its coefficients differ from none beside all that was found",
        "0.3 % two-sided; docs/decisions.md",
    )
    parts: int = _criterion(4, "parts", "of the only trajectory stand in for trajectories where there is but one")
    rotor_inertia_std: float = _criterion(
        0.2, "of its nominal value", "a data sheet leaves out shaft, brake and wave generator", "docs/decisions.md"
    )
    # Lines in the residual's spectra, which suggest orders and frequencies to try.
    line_significance: float = _criterion(
        1e-3, "probability", "that noise alone has the strongest line; its sidelobes are not tried"
    )
    lowest_order: float = _criterion(
        0.4, "1 / motor turn", "slower changes over the motor's angle are motion, not gear"
    )
    highest_order: float = _criterion(13.0, "1 / motor turn", "gears and motors have orders up to 12")
    min_line_periods: float = _criterion(
        6.0, "periods in a recording", "a slower line in time is not distinguished from the motion's own harmonics"
    )
    # Searching.
    max_effects: int = _criterion(
        3,
        "effects per joint, and of the whole arm",
        "more at once are not believed, and what is left is then not called noise",
    )
    near_best: float = _criterion(
        0.6, "of the best gain", "families worth refining before one is chosen: a grid point loses up to 40 %"
    )
    max_refined: int = _criterion(4, "families", "refined at once, for time")
    dominant: float = _criterion(
        0.5,
        "share of squared residual",
        "a family whose grid point removes as much is fitted, or another band tried for it, however few blocks show it; what does is no small error of the model",
    )
    max_fitted: int = _criterion(
        2,
        "candidates",
        "fitted with all else in one round, for time: an elastic joint is simulated anew in every step of a fit",
    )
    min_without_noise: float = _criterion(
        0.5,
        "of the squared torque",
        "what an effect must keep without the noise of the positions: noise of many rows is as sure as an effect",
    )
    lower_band: float = _criterion(
        0.35,
        "of the band",
        "in which what is the same at all frequencies is looked for again, and what each recording has of its own is estimated; half-way to it by octaves what noise could make, and parameters of effects that act together",
    )
    lower_change: float = _criterion(
        0.5,
        "of its size",
        "by which it is another one there, or less where noise could make it, or another once it was taken out of the data: a column of first order says too little of a long delay",
    )
    min_beside_rest: float = _criterion(
        0.5,
        "of what it removes",
        "that an effect must still remove beside what does as well in its place and is no effect: the rest of a correction, or a force on the tool",
        "docs/diagnosis.md",
    )
    # What is left over.
    remainder: float = _criterion(
        0.08,
        "share of squared residual",
        "that signals explain on other trajectories to be called a remainder",
        "docs/diagnosis.md",
    )
    min_remainder: float = _criterion(
        0.01,
        "of the joint's torque",
        "sampling, filters and friction about a reversal leave as much",
        "docs/diagnosis.md",
    )
    min_remainder_of_runs: float = _criterion(
        0.02,
        "of the joint's torque",
        "the same where runs differ: what is of second order in their differences repeats too",
        "docs/diagnosis.md",
    )
    remainder_of_runs: float = _criterion(
        0.2,
        "share of squared residual",
        "the same where runs differ: what is of second order in their differences depends on signals too",
        "docs/diagnosis.md",
    )
    remainder_to_noise: float = _criterion(
        1.0, "of the noise", "a repeatable remainder larger than the noise is one whatever it depends on"
    )
    far_above_noise: float = _criterion(
        3.0,
        "of the noise, and of what that of positions makes",
        "what repeats so much more is a remainder whatever its colour: a ripple at many speeds is as even as noise",
        "docs/diagnosis.md",
    )
    colour_of_remainder: float = _criterion(
        0.5,
        "share of the residual's power",
        "above white noise where it repeats: coarse encoders repeat too, and leave a third where bands are narrow or motions short",
        "docs/diagnosis.md",
    )
    significant: float = _criterion(
        0.01, "probability", "that noise alone repeats so much, or does as well as what is worth a look", "F test"
    )
    single_bins: int = _criterion(24, "bins", "of one signal, with equal numbers of samples, follow what it does")
    pair_bins: int = _criterion(10, "bins", "of each signal of a pair, so that their square is filled")
    min_per_bin: int = _criterion(10, "samples", "in each bin of a pair on average, or nothing is said")
    shrinkage: float = _criterion(
        5.0, "samples", "of zero in every bin, so that a mean over few samples counts for little"
    )
    alone: float = _criterion(
        0.8, "of what the best pair explains", "one signal that explains so much is named without the other"
    )
    # Shown to be noise.
    min_power: float = _criterion(
        0.3,
        "share of squared residual",
        "where half of the effects would have to remove more to be significant, nothing found says nothing",
        "docs/diagnosis.md",
    )
    min_colour: float = _criterion(
        0.25,
        "share of the residual's power",
        "above white noise within the band: more may be a motion's doing, or noise with a memory",
        "docs/diagnosis.md",
    )
    worse_held_out: float = _criterion(
        1.5, "times the training error", "on recordings held out: the model does not hold there", "docs/diagnosis.md"
    )
    # Choosing the band again.
    wider: float = _criterion(
        1.3, "of the band", "with an effect found the search is repeated where the band grows by so much"
    )
    beyond: float = _criterion(
        2.0,
        "of the band",
        "above it is looked for what the band's end may itself come from, an elastic joint's resonance",
    )
    max_widenings: int = _criterion(2, "times", "bands grow no further")
    # Effects that stand for another.
    min_of_repeatable: float = _criterion(
        0.5,
        "of what repeats",
        "where most of it stays unexplained, an effect that removes less stands for another; on recordings held out, of what its "
        "size promises",
    )
    max_demotions: int = _criterion(3, "rounds", "for time")
    # Effects that cannot be told apart.
    alike: float = _criterion(2.0, "standard errors", "errors of two models that differ by less are the same", "95 %")
    near_confounder: float = _criterion(
        0.4, "of its gain", "that another effect must remove at a grid point to be refined and compared"
    )
    min_share: float = _criterion(
        0.8, "of its gain", "that another effect must remove to be compared with the best, and to be a confounder"
    )
    cancels: float = _criterion(
        0.5, "of the smaller torque", "two effects of a joint leave less together: each takes back most of the other"
    )

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
