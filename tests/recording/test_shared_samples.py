"""Copies of a recording are found by their samples, and repetitions are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.recording import shared_samples as module
from scara_ident.recording.recording import Recording
from scara_ident.recording.shared_samples import copies_among, shared_samples
from tests.made_recordings import columns


def recording(name: str, seed: int = 0, samples: int = 3000) -> Recording:
    made = columns(samples, seed=seed)
    position, effort = (np.array([made[f"joint{j}.{kind}"] for j in (1, 2)]) for kind in ("position", "effort"))
    return Recording(name, name, 1, ("joint1", "joint2"), made["time"], position, effort)


def part(item: Recording, rows: slice, shift: float = 0.0) -> Recording:
    time = item.time[rows]
    return replace(
        item, name="part", time=time - time[0] + shift, position=item.position[:, rows], effort=item.effort[:, rows]
    )


def followed(item: Recording, other: Recording) -> Recording:
    time = np.concatenate([item.time, other.time + item.time[-1] + 1e-3])
    return replace(
        item,
        time=time,
        position=np.concatenate([item.position, other.position], axis=1),
        effort=np.concatenate([item.effort, other.effort], axis=1),
    )


FIRST, SECOND, OTHER = recording("first"), recording("second", seed=1), recording("other", seed=2)
COPIES = {
    "copy": (FIRST, 1.0),
    "cut": (part(FIRST, slice(701, 1800)), 1.0),
    "another clock": (part(FIRST, slice(0, None), 7.0), 1.0),
    "the second half": (followed(OTHER, FIRST), 0.5),
    "a tenth": (followed(OTHER, part(FIRST, slice(1000, 1333))), 0.1),
}


@pytest.mark.parametrize("name", COPIES)
@pytest.mark.parametrize("chunk", [module.CHUNK, 256])
def test_copies_are_found_with_their_share(monkeypatch: pytest.MonkeyPatch, name: str, chunk: int):
    monkeypatch.setattr(module, "CHUNK", chunk)
    other, share = COPIES[name]
    ((found, first, told),) = shared_samples([SECOND, FIRST], [OTHER, other])
    assert found is other
    assert first is FIRST
    assert told == pytest.approx(share, abs=0.02)


def test_a_part_of_much_is_found_though_little_is_kept(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "KEPT_WINDOWS", 64)
    known = [recording(str(k), seed=k) for k in range(8)]
    ((found, first, _),) = shared_samples(known, [recording("new", seed=99), known[5]])
    assert found is known[5] is first


def test_repetitions_on_coarse_channels_and_arms_at_rest_are_no_copies():
    coarse = [replace(item, effort=np.round(item.effort, 1)) for item in (FIRST, SECOND)]
    assert list(shared_samples(coarse[:1], coarse[1:])) == []
    still = replace(FIRST, position=np.full((2, 3000), 0.3), effort=np.full((2, 3000), 0.1))
    assert list(shared_samples([still], [replace(still)])) == []
    assert list(shared_samples([], [FIRST])) == []
    assert list(shared_samples([FIRST], [part(FIRST, slice(0, 20))])) == []


def test_copies_among_recordings_are_those_behind_the_first():
    cut = part(SECOND, slice(200, 1500))
    found = copies_among([FIRST, SECOND, FIRST, OTHER, cut])
    assert found == {2: (FIRST, pytest.approx(1.0)), 4: (SECOND, pytest.approx(1.0))}
    assert copies_among([FIRST, SECOND, OTHER]) == {}
    assert copies_among([]) == {}
