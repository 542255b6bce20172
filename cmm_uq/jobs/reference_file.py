"""Certified values from the file of the artefact's certificate, joined to a recording by the numbers of its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.importing.recognised import Recognised
from cmm_uq.jobs.recording import LARGEST_NUMBER, largest
from cmm_uq.points import AXES, Points

REFERENCES = ("reference_mm", *(f"reference_{axis}_mm" for axis in AXES))


def reference_file(artefact: ArtefactFacts) -> list[str]:
    """Name of the file of certified values, if a job names one."""
    chain = artefact.certificate
    return [] if chain is None or chain.file is None else [chain.file]


def with_references(
    points: Points, artefact: ArtefactFacts, inputs: Mapping[str, bytes], folder: Path, where: str
) -> tuple[Points, Recognised]:
    """A recording with the certified values of its points, and how their file was read.

    Parameters
    ----------
    points : without certified values.
    artefact : whose certificate names a file.
    inputs : bytes of the files of the job, by name.
    folder : of the job, for messages.
    where : file of the recording, for messages.

    Raises
    ------
    CmmUqError : the file cannot be read, does not number its values, or lacks a point; or the recording has such values too.
    """
    chain = artefact.certificate
    if chain is None or chain.file is None:
        raise CmmUqError("the certificate names no file", where=where)
    place = str(folder / chain.file)
    twice = next((name for name in REFERENCES if name in points.columns), None)
    if twice is not None:
        raise CmmUqError(f"has {twice}, and so has {chain.file}", where=where, fix="Leave one of them out")
    from cmm_uq.jobs.importing.imported import imported_references

    found = imported_references(inputs[chain.file], place, chain)
    if "point" not in found.columns:
        raise CmmUqError("does not number its values", where=place,
                         fix='Say which column is the number of the point: columns = { point = "…" }')  # fmt: skip
    rows = _rows_by_point(found.columns["point"].tolist(), found.lines.tolist(), place)
    missing = next((number for number in points.point.tolist() if number not in rows), None)
    if missing is not None:
        line = points.lines[points.point.tolist().index(missing)] if len(points.lines) else 0
        raise CmmUqError(f"point {missing} is not among the certified values of {chain.file}", where=f"{where} line {line}",
                         fix="Number points as the certificate does, or leave the point out")  # fmt: skip
    index = np.array([rows[number] for number in points.point.tolist()], dtype=np.int64)
    columns = {name: values[index] for name, values in found.columns.items() if name in REFERENCES}
    for name, values in columns.items():
        if np.any(np.abs(values) > largest(name)):
            raise CmmUqError(f"{name} is more than anything that is measured", where=place, fix="Check its unit")
    return replace(points, columns={**points.columns, **columns}), found.recognised


def _rows_by_point(numbers: list[float], lines: list[int], place: str) -> dict[int, int]:
    rows: dict[int, int] = {}
    for row, number in enumerate(numbers):
        if number != round(number) or abs(number) > LARGEST_NUMBER:
            raise CmmUqError(f"{number:g} is not a whole number", where=f"{place} line {lines[row]}, column point",
                             fix="Number the points 1, 2, …")  # fmt: skip
        if int(number) in rows:
            raise CmmUqError(f"point {int(number)} is there twice", where=f"{place} line {lines[row]}", fix="Keep one")
        rows[int(number)] = row
    return rows
