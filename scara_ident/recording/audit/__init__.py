"""What may be wrong with a recording, found before anything is fitted to it.

Every check either passes the samples on, or leaves out or mends a few and says so, or refuses the file. A check relies
on those before it: units are judged on finite numbers in order of time, spikes on known units, and so on.
"""

from __future__ import annotations

import logging

from scara_ident.recording.audit import clock, effort, held, interpolated, lost_samples, position, stamps
from scara_ident.recording.audit.samples import Finding, Samples, once

_LOG = logging.getLogger(__name__)

CHECKS = (
    clock.enough,
    clock.missing_numbers,
    clock.enough,
    position.impossible_sizes,
    clock.clock_unit,
    clock.time_order,
    clock.enough,
    # What the positions tell of the stamps is hidden by rows that repeat.
    held.held_rows,
    held.stale_positions,
    clock.enough,
    stamps.late_stamps,
    stamps.coinciding,
    clock.enough,
    clock.sampling,
    position.position_unit,
    position.whole_turns,
    position.spikes,
    lost_samples.restamped,
    position.idle_joints,
    effort.dead_effort,
    effort.copies,
    effort.saturation,
    effort.coarse_effort,
    position.limits,
    position.computed,
    interpolated.interpolated_positions,
    clock.enough,
)


def audit(samples: Samples) -> tuple[Samples, tuple[Finding, ...]]:
    """Look for what may be wrong with a recording.

    Parameters
    ----------
    samples : Samples
        All rows of a file, as they stand there.

    Returns
    -------
    samples : Samples
        The rows that can be used, finite and strictly increasing in time.
    findings : tuple of Finding
        What was seen and what was done about it, at most a line or two per fault and joint.

    Raises
    ------
    RecordingError
        In one line: the file, the column and row, and what to do.
    """
    findings: list[Finding] = []
    for check in CHECKS:
        samples, found = check(samples)
        findings += found
    # Whoever fits the recording is warned of them again.
    for finding in findings:
        _LOG.info("%s: %s", samples.source, finding.message)
    return samples, tuple(findings)


__all__ = ["Finding", "Samples", "audit", "once"]
