"""The torque noise that an estimate, and the expected answers of a further recording, rest on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.testing.selection_step import fitted_model
from scara_ident.estimation.bands import needed_rows
from scara_ident.estimation.noise_bias import noise_torque
from scara_ident.motion.low_pass import noise_share


def noise_density(diagnosis: Diagnosis) -> Array:
    """Return the noise of each joint that an estimate sees, (N m)^2 s, shape (n,); infinite where nothing tells it.

    Squares of what is left over those that white noise would leave, which the low-pass thins, the times at rest fade and the
    columns take a part of; times by how much blocks of time scatter more than white residuals would, for all joints alike,
    as few blocks tell it badly of one. Without what the noise of the positions leaves: differentiated twice it is at the end
    of the band, where motions have little torque. What effects that are worth a look explain is no noise: it is what is
    asked for.
    """
    search, after = diagnosis.search, diagnosis.after
    step, observations = search.step, diagnosis.training_after
    maybe = [item.decision.candidate for item in diagnosis.tentative if item.decision is not None]
    columns = step.columns.rows(search.scene, [*search.chosen, *maybe])
    model = fitted_model(step.observations, columns, after.weights, 1)
    if after.offsets is not None:
        model = replace(model, joints=after.offsets.whitened_rows(model.joints))
    parts = [part for part in step.observations.data.stretches if part.usable]
    rate = min(part.rate for part in parts)
    level, thinned, count = np.full(len(model.joints), np.inf), 0.0, 0
    made = noise_torque(observations, after.value) ** 2
    taken = needed_rows(after.model)
    for rows in columns[len(search.chosen) :]:
        for j, own in rows.items():
            taken[j] += len(own) / len(rows)
    for j, (error, weight) in enumerate(zip(model.residual, after.weights, strict=True)):
        white = sum(
            part.steps[j] * noise_share(part.rate, part.bands[j]) * np.sum(part.fade[j, part.kept[j]] ** 2)
            for part in parts
        )
        if white > taken[j] and weight > 0.0:
            squares = float(error @ error) / weight**2
            of_positions = made[j] * sum(part.steps[j] * len(part.kept[j]) for part in parts)
            # Each is known to a share of ``sqrt(2 / white)``: less than twice the error of their difference is not significant.
            level[j] = max(squares - of_positions, min(1.0, 4.0 / np.sqrt(white)) * squares) / (white - taken[j])
            thinned, count = thinned + white, count + len(error)
    size = np.sqrt(np.clip(np.diag(after.information.inverse()), 0.0, None))
    plain = np.sqrt(after.information.residual_sum(after.value) / max(1, count)) * size
    known = (plain > 0.0) & np.isfinite(after.std) & ~after.undetermined
    if not (np.any(known) and count):
        return level / rate
    scatter = float(np.median((after.std[known] / plain[known]) ** 2)) * thinned / count
    # A variance estimated from so many blocks is this far off by chance, one standard deviation.
    return level * max(1.0, scatter / float(1.0 + np.sqrt(2.0 / len(model.owner)))) / rate
