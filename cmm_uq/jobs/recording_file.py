"""The file of a recording, whatever its format: the project's own is read as it is, any other is imported."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from cmm_uq.base.points import Machine, Points
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.recognised import Recognised
from cmm_uq.jobs.recording import REQUIRED, points_of, read_recording

_HEAD = 16_384


def read_recording_file(
    content: bytes, where: str, machine: Machine, keys: ImportKeys, without: Collection[str] = ()
) -> tuple[Points, Recognised | None]:  # fmt: skip
    """Points of a recording, and how it was read where it is in another format than the project's own.

    Parameters
    ----------
    content : bytes of the file.
    where : its path, for messages.
    machine : that read the points.
    keys : what the job says beside the name of the file.
    without : columns that are known to have empty cells, and are left out.

    Raises
    ------
    CmmUqError : it is damaged, or of no format that is known.
    """
    if not keys.asked and is_own(content):
        return read_recording(content, where, machine, without), None
    from cmm_uq.jobs.importing.imported import imported

    found = imported(content, where, keys, reach_mm=_reach(machine))
    return points_of(found.columns, found.lines.tolist(), where, machine), found.recognised


def is_own(content: bytes) -> bool:
    """Whether a recording is in the project's own format: empty, or a header that names one of its columns between commas."""
    return not content.strip() or any(name in REQUIRED for name in header(content))


def header(content: bytes) -> list[str]:
    """Names between commas in the first line that is no comment."""
    text = content[:_HEAD].decode("utf-8-sig", errors="replace")
    line = next((line for line in map(str.strip, text.splitlines()) if line and not line.startswith("#")), "")
    return [name.strip().strip('"') for name in line.split(",")]


def _reach(machine: Machine) -> float | None:
    """Diagonal of the travel, mm; ``None`` where the job does not say it."""
    spans = machine.travel_mm[:, 1] - machine.travel_mm[:, 0]
    return float(np.linalg.norm(spans)) if np.all(np.isfinite(spans)) else None
