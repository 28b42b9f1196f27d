"""Every threshold of the diagnosis, with unit, reason and source."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from scara_ident.effects.spanned import ABSORBED_SHARE

# The source, if no other is cited.
CHOSEN = "chosen; docs/criteria.md shows its influence"


def _criterion(value: Any, unit: str, reason: str, source: str = CHOSEN) -> Any:
    return field(default=value, metadata={"unit": unit, "reason": reason, "source": source})


@dataclass(frozen=True)
class SelectionCriteria:
    """When an effect is believed, and what counts as a remainder.

    The metadata of each field holds its unit, its reason and its source; see `documented`.
    """

    # Accepting an effect.
    absorbed: float = _criterion(
        ABSORBED_SHARE,
        "share of its square",
        "below this share of a column outside the model only rounding errors remain",
        "effects/spanned.py: above the errors of a URDF with few digits",
    )
    min_outside: float = _criterion(
        5e-4,
        "share of its square",
        "below this share small errors of the model may look like the effect, unless it removes most of the residual (`dominant`)",
        "docs/decisions.md",
    )
    abstains: float = _criterion(
        0.05,
        "of the mean fold",
        "a trajectory that hardly excites an effect does not vote",
    )
    family_error: float = _criterion(
        0.002,
        "probability",
        "of accepting any effect if nothing is missing, over all candidates tried; tested in about five rounds",
        "Bonferroni: 1 % over a diagnosis",
    )
    min_gain: float = _criterion(
        0.05,
        "share of squared residual",
        "that an effect must remove in cross-validation; an effect below it is below the detection limit",
        "docs/decisions.md",
    )
    nearly_all: float = _criterion(
        0.9,
        "share of squared residual",
        "a candidate that removes as much leaves little except noise on its joint, and is tested by single rows too",
        "diagnosis/testing/row_test.py",
    )
    min_votes: float = _criterion(
        0.75, "of voting trajectories", "an effect of the arm helps on most motions that excite it", "docs/decisions.md"
    )
    min_size: float = _criterion(
        2.5,
        "standard deviations",
        "by which its size must differ from zero with its nonlinear parameters free",
        "1 % two-sided",
    )
    min_final_size: float = _criterion(
        3.0,
        "standard deviations",
        "by which its coefficients must differ from zero with all effects found in the model",
        "0.3 % two-sided; docs/decisions.md",
    )
    parts: int = _criterion(4, "parts", "into which a single trajectory is divided for cross-validation")
    rotor_inertia_std: float = _criterion(
        0.2, "of its nominal value", "a data sheet leaves out shaft, brake and wave generator", "docs/decisions.md"
    )
    # Lines in the residual's spectra, which suggest orders and frequencies to try.
    line_significance: float = _criterion(
        1e-3, "probability", "that noise alone has so strong a line; sidelobes of a line are not tried"
    )
    lowest_order: float = _criterion(
        0.4, "1 / motor turn", "slower changes over the motor's angle come from the motion, not the gear"
    )
    highest_order: float = _criterion(13.0, "1 / motor turn", "gears and motors have orders up to 12")
    min_line_periods: float = _criterion(
        6.0, "periods in a recording", "a slower line in time is not distinguished from the motion's own harmonics"
    )
    # Searching.
    max_effects: int = _criterion(
        3,
        "effects per joint, and of the whole arm",
        "more at once are not believed, and the residual is then not called noise",
    )
    near_best: float = _criterion(
        0.6, "of the best gain", "families worth refining before one is chosen: a grid point loses up to 40 %"
    )
    max_refined: int = _criterion(4, "families", "refined in one round, to limit the time")
    dominant: float = _criterion(
        0.5,
        "share of squared residual",
        "a family whose grid point removes as much is fitted, or another band is tried for it, even if few blocks show it; so large a share is no small error of the model",
    )
    max_fitted: int = _criterion(
        2,
        "candidates",
        "fitted with everything else in one round, to limit the time: an elastic joint is simulated in every step of a fit",
    )
    min_without_noise: float = _criterion(
        0.5,
        "of the squared torque",
        "that an effect must keep without the noise of the positions: with many rows this noise is as significant as an effect",
    )
    lower_band: float = _criterion(
        0.35,
        "of the band",
        "in which effects that are the same at all frequencies are checked, and effects of each recording are estimated; effects that noise could cause, and effects that act together, are also checked half-way to it in octaves",
    )
    lower_change: float = _criterion(
        0.5,
        "of its size",
        "by which an effect may change in the lower band, or decrease if noise could cause it, or change after the correction of the data: a column of first order underestimates a long delay",
    )
    min_beside_rest: float = _criterion(
        0.5,
        "of what it removes",
        "that an effect must still remove with an imitation in the model that explains as much and is no effect: the rest of a correction, or a force on the tool",
        "docs/diagnosis.md",
    )
    # Remainders.
    remainder: float = _criterion(
        0.08,
        "share of squared residual",
        "that signals must explain in cross-validation for a remainder",
        "docs/diagnosis.md",
    )
    min_remainder: float = _criterion(
        0.01,
        "of the joint's torque",
        "sampling, filters and friction near reversals cause as much",
        "docs/diagnosis.md",
    )
    min_remainder_of_runs: float = _criterion(
        0.02,
        "of the joint's torque",
        "the same if runs differ: their differences of second order repeat too",
        "docs/diagnosis.md",
    )
    remainder_of_runs: float = _criterion(
        0.2,
        "share of squared residual",
        "the same if runs differ: their differences of second order depend on signals too",
        "docs/diagnosis.md",
    )
    remainder_to_noise: float = _criterion(
        1.0, "of the noise", "a repeatable residual larger than the noise is a remainder, whatever it depends on"
    )
    far_above_noise: float = _criterion(
        3.0,
        "of the noise, and of what that of positions makes",
        "a repeating residual above it is a remainder even if it is white: a ripple at many speeds is as white as noise",
        "docs/diagnosis.md",
    )
    colour_of_remainder: float = _criterion(
        0.5,
        "share of the residual's power",
        "above white noise that makes a repeating residual a remainder: coarse encoders repeat too, and leave a third in narrow bands or short motions",
        "docs/diagnosis.md",
    )
    significant: float = _criterion(
        0.01, "probability", "that noise alone repeats so much, or explains as much as an effect worth a look", "F test"
    )
    single_bins: int = _criterion(
        24, "bins", "of one signal, with equal numbers of samples; enough to show a dependence"
    )
    pair_bins: int = _criterion(10, "bins", "of each signal of a pair, so that most pairs of bins have samples")
    min_per_bin: int = _criterion(
        10, "samples", "in each bin of a pair on average; with fewer no dependence is reported"
    )
    shrinkage: float = _criterion(
        5.0, "samples", "of value zero added to every bin, so that a mean over few samples counts little"
    )
    alone: float = _criterion(
        0.8, "of what the best pair explains", "if one signal explains this share, it is named without the other"
    )
    # Shown to be noise.
    min_power: float = _criterion(
        0.3,
        "share of squared residual",
        "if half of the effects would have to remove more to be significant, finding none is no evidence",
        "docs/diagnosis.md",
    )
    min_colour: float = _criterion(
        0.25,
        "share of the residual's power",
        "above white noise within the band: more may depend on the motion, or be correlated noise",
        "docs/diagnosis.md",
    )
    worse_held_out: float = _criterion(
        1.5, "times the training error", "on held-out recordings: the model is not valid there", "docs/diagnosis.md"
    )
    # Choosing the band again.
    wider: float = _criterion(
        1.3, "of the band", "with an effect found, the search is repeated if the band grows by this factor"
    )
    beyond: float = _criterion(
        2.0,
        "of the band",
        "up to which an elastic joint's resonance is searched, because the band may end at such a resonance",
    )
    max_widenings: int = _criterion(2, "times", "after which bands are not widened further")
    # Effects that stand for another.
    min_of_repeatable: float = _criterion(
        0.5,
        "of what repeats",
        "if most of it stays unexplained, an effect that removes less stands for another; on held-out recordings, of "
        "what its size predicts",
    )
    max_demotions: int = _criterion(3, "rounds", "to limit the time")
    # Effects that cannot be distinguished.
    alike: float = _criterion(2.0, "standard errors", "errors of two models that differ by less count as equal", "95 %")
    near_confounder: float = _criterion(
        0.4, "of its gain", "that another effect must remove at a grid point to be refined and compared"
    )
    min_share: float = _criterion(
        0.8, "of its gain", "that another effect must remove to be compared with the best, and to be a confounder"
    )
    cancels: float = _criterion(
        0.5, "of the smaller torque", "two effects on a joint whose sum is smaller: each cancels most of the other"
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
