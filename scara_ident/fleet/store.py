"""Finished work of a fleet, on disk under keys of its inputs, so that a later run continues from there."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict, dataclass
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.files import write_json, write_whole
from scara_ident.fleet.folder import Fault
from scara_ident.fleet.visit import Reference, Visit

FOLDER = "cache"


@dataclass(frozen=True)
class Store:
    """Results of an output folder.

    Attributes
    ----------
    folder : Path
        Made when something is put into it.
    """

    folder: Path

    def visit(self, key: str) -> Visit | None:
        """Return what is held under a key; None where there is nothing, or nothing whole."""
        try:
            with np.load(self.folder / f"{key}.npz", allow_pickle=False) as held:
                return _visit(dict(held))
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def put_visit(self, key: str, visit: Visit) -> None:
        """Hold what an arm showed on a date, whole or not at all."""
        # In memory first: the archive is put together in many small steps, which on disk take long.
        archive = BytesIO()
        np.savez(archive, **_arrays(visit))

        def write(place: Path) -> None:
            place.write_bytes(archive.getvalue())

        write_whole(self.folder / f"{key}.npz", write)

    def content(self, key: str) -> dict[str, Any] | None:
        """Return the JSON that is held under a key; None where there is nothing, or nothing whole."""
        try:
            found = json.loads((self.folder / f"{key}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) else None

    def put_content(self, key: str, content: dict[str, Any]) -> None:
        """Hold JSON, whole or not at all."""
        write_json(self.folder / f"{key}.json", content)


def key_of(*parts: str | bytes) -> str:
    """Return a key of what something is made from."""
    digest = blake2b(digest_size=16)
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()


def reference_bytes(reference: Reference | None) -> bytes:
    """Return what tells one reference from another."""
    if reference is None:
        return b""
    parts = [np.array([np.nan if band is None else band for band in reference.bands]), reference.value]
    parts += [reference.travel, reference.speed, np.array(reference.reach), np.array(reference.armatures, dtype=float)]
    return b"".join(part.tobytes() for part in parts)


def _arrays(visit: Visit) -> dict[str, Any]:
    reference = visit.reference
    found: dict[str, Any] = {"value": visit.value, "std": visit.std, "error": visit.error, "rows": visit.rows}
    for joint, (columns, factor) in enumerate(zip(visit.columns, visit.factors, strict=True)):
        found |= {f"columns{joint}": columns, f"factor{joint}": factor}
    found |= {
        "reference_bands": np.array([np.nan if band is None else band for band in reference.bands]),
        "reference_value": reference.value,
        "reference_travel": reference.travel,
        "reference_speed": reference.speed,
        "reference_reach": np.array(reference.reach),
        "reference_armatures": np.array(reference.armatures, dtype=float).reshape(-1, 2),
        "faults": np.array(json.dumps([asdict(fault) for fault in visit.faults])),
    }
    return found


def _visit(held: dict[str, Any]) -> Visit:
    longest, rate, band = (float(x) for x in held["reference_reach"])
    reference = Reference(
        tuple(None if np.isnan(band) else float(band) for band in held["reference_bands"]),
        held["reference_value"],
        held["reference_travel"],
        held["reference_speed"],
        (longest, rate, band),
        tuple((int(joint), float(value)) for joint, value in held["reference_armatures"]),
    )
    joints = range(len(held["rows"]))
    return Visit(
        held["value"],
        held["std"],
        held["error"],
        tuple(held[f"columns{joint}"] for joint in joints),
        tuple(held[f"factor{joint}"] for joint in joints),
        held["rows"],
        reference,
        tuple(Fault(**fault) for fault in json.loads(str(held["faults"]))),
    )
