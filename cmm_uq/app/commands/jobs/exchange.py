"""Files of other programs: exports and digital certificates read, results written as QIF 3.0."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import DCC_BYTES, TABLE_BYTES, content_of
from cmm_uq.base.files.toml_file import nested
from cmm_uq.base.output import Owner
from cmm_uq.base.output.manifest import refuse_taken, write_new
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Machine
from cmm_uq.certificate.results.qif_file import qif
from cmm_uq.jobs.columns import WHOLE
from cmm_uq.jobs.dcc import Certificate, read
from cmm_uq.jobs.importing.answers import as_file, folder, matching, path_of
from cmm_uq.jobs.importing.cells.stated import Offer, offers
from cmm_uq.jobs.importing.format import ImportKeys, Recognition
from cmm_uq.jobs.importing.lengths.placing import proposed as proposed
from cmm_uq.jobs.importing.lines import UnplacedRunsError, axis_place
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, example as example, imported
from cmm_uq.jobs.recording.own import points_of, read_recording
from cmm_uq.jobs.reports import ReportResults, read_results
from cmm_uq.jobs.source import RESULTS

_FIRST = ("measurement", "point", "repeat", "x_mm", "y_mm", "z_mm")
_MARK = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*")


def remembered_keys(path: Path, keys: ImportKeys) -> tuple[ImportKeys, Path | None]:
    """Keys for an export: those that are said, else those remembered of its format, with the file that they stand in."""
    if keys.model_copy(update={"lines": {}}).asked or not folder().is_dir():
        return keys, None
    found = matching(content_of(path, TABLE_BYTES, "Check its name"), str(path))
    return (keys, None) if found is None else (found[1].model_copy(update={"lines": keys.lines}), found[0])


def remember(name: str, keys: ImportKeys, head: tuple[str, ...]) -> Path:
    """Keep the answers to an export by name, for all with the same head."""
    if not head:
        raise CmmUqError(
            "has no head by which another of its format would be known", where="--save-as", fix="Leave it out"
        )
    path = path_of(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_new(path, as_file(keys, head))
    return path


def offered(path: Path, keys: ImportKeys) -> tuple[Offer, ...]:
    """What an export says of its measurement around the table."""
    content = content_of(path, TABLE_BYTES, "Check its name")
    return offers(content, str(path), keys)


@naming_package()
def read_export(path: Path, keys: ImportKeys | None = None) -> ImportedTable:
    content = content_of(path, TABLE_BYTES, "Check its name")
    found = imported(content, str(path), keys or ImportKeys())
    points_of(found.columns, found.lines.tolist(), str(path), Machine())  # refused as a job refuses it
    return found


def lines_asked(error: CmmUqError) -> tuple[Recognition | None, str, dict[str, tuple[str, str, str]]] | None:
    """How lengths or runs were read of which nothing says where they lie: the reading, its first in words, lines by name.

    Of each line its place as far as the file says it, with ? for what it leaves open, an example of one, and its words.
    """
    if isinstance(error, UnplacedRunsError):
        return None, error.example, {name: axis_place(name) for name in error.names}
    if not isinstance(error, UnplacedError):
        return None
    places = {name: place for one in error.lengths for name, (place, _) in one.places.items()}
    words = {name: beside for one in error.lengths for name, beside in one.words.items()}
    lines = {name: (*proposed(places.get(name, ""), f"{name}; {beside}"), beside) for name, beside in words.items()}
    return error.recognised, example(error.lengths), lines


def amounts(read: ImportedTable) -> str:
    """How many of what were read, so that a reading that lost some is seen: ``4 set-ups, 3 points in each, 3 repeats``."""
    each = np.column_stack([read.columns.get(name, np.ones(len(read.lines))) for name in ("measurement", "point")])
    places, repeats = np.unique(each, axis=0, return_counts=True)
    points = np.unique(places[:, 0], return_counts=True)[1]
    if "lines" in {fact.key for fact in read.recognised.facts} and "length_mm" in read.recognised.columns:
        return f"{len(points)} lengths, {_counted(repeats, 'run')}"
    return f"{_counted([len(points)], 'set-up')}, {_counted(points, 'point')} in each, {_counted(repeats, 'repeat')}"


def _counted(counts: Any, what: str) -> str:
    least, most = int(min(counts)), int(max(counts))
    return f"{most if least == most else f'{least} to {most}'} {what}{'' if most == 1 else 's'}"


def placed_by_plan(export: Path, keys: ImportKeys, plan: Path) -> ImportKeys:
    """Keys of an export of lengths: each line that they do not place lies as a plan's measurement of its number does.

    plan : ``plan.csv`` or any recording; a line begins at the measurement's first point and goes to the one farthest from it.
    """
    try:
        read_export(export, keys)
    except UnplacedError as error:
        lines = dict.fromkeys(name for one in error.lengths for name in one.names if name not in keys.lines)
    else:
        raise CmmUqError(f"{export} holds no lengths whose place is asked for", where="--plan", fix="Leave it out")
    content = content_of(plan, TABLE_BYTES, "Name the plan.csv of cmm-uq plan, or a recording")
    points, placed = read_recording(content, str(plan), Machine()), dict[int, str]()
    for name in lines:
        numbers = [int(one) for one in re.findall(r"\d+", name)]
        rows = np.flatnonzero(points.measurement == numbers[0]) if len(numbers) == 1 else ()
        fix = f'Say where it lies: --line "{name}=along X from 100,200,300"'
        if len(rows) < 2:
            raise CmmUqError(f"no measurement has the number of line {name!r}", where=str(plan), fix=fix)
        if numbers[0] in placed:
            what = f"lines {placed[numbers[0]]!r} and {name!r} have the same number"
            raise CmmUqError(what, where=str(export), fix=fix)
        xyz = points.xyz[rows[np.argsort(points.point[rows], kind="stable")]]
        far = xyz[np.linalg.norm(xyz - xyz[0], axis=1).argmax()]
        start, end = (",".join(map(repr, one.tolist())) for one in (xyz[0], far))
        placed[numbers[0]], lines[name] = name, f"from {start} to {end}"
    return keys.model_copy(update={"lines": {**keys.lines, **lines}})


def own_format(found: ImportedTable) -> bytes:
    """The same in the project's own format: numbers with as many digits as they need to be read back the same."""
    names = [name for name in _FIRST if name in found.columns]
    names += [name for name in found.columns if name not in _FIRST]
    whole = ((found.columns[name], np.int64 if name in WHOLE else np.float64) for name in names)
    columns = [map(repr, values.astype(sort).tolist()) for values, sort in whole]
    lines = [",".join(names), *(",".join(row) for row in zip(*columns, strict=True))]
    return ("\n".join(lines) + "\n").encode()


def write_recording(path: Path, found: ImportedTable, out: Path) -> None:
    """Write a recording in the project's own format, whole or not at all, and over nothing."""
    mark = _MARK.match(content_of(path, TABLE_BYTES, "Check its name"))
    content = (mark[0].removeprefix(b"\xef\xbb\xbf") if mark else b"") + own_format(found)
    write_new(out, content)


@naming_package()
def write_job_of_export(
    kind: str,
    export: Path,
    folder: Path,
    given: Mapping[str, Mapping[str, Any]],
    keys: ImportKeys,
    *,
    fetched: bool = False,
) -> dict[str, Path]:
    """Write the folder of a new job around an export that was measured: the export itself lies in it, and is imported.

    Nothing is made up: artefact, limits and travel are those that are given, whatever a new job of the kind would begin with.

    folder : that does not exist, or is empty; fetched : whether the artefact's certificate, of any path that is given, is laid
    into it too; not for those whose files these are not.
    """
    from cmm_uq.app.commands.jobs.new import check_empty, job_id, job_of_export, put_new

    check_empty(folder)
    content = content_of(export, TABLE_BYTES, "Check its name")
    said = {key: value for key, value in keys.model_dump().items() if value not in (None, {})}
    name = job_id(folder, given)
    tables = {**given, "recording": {"file": export.name, **said, **given.get("recording", {})}}
    read, artefact = {export: content}, nested(given.get("artefact", {}))
    stated = artefact.get("certificate")
    if fetched and isinstance(stated, Mapping) and stated.get("file"):
        certificate = Path(str(stated["file"]))
        if certificate.name == export.name:
            raise CmmUqError("has the name of the export", where=str(certificate), fix="Give a copy with another name")
        read[certificate] = content_of(certificate, TABLE_BYTES, "Name the file of [artefact.certificate] file")
        tables["artefact"] = nested({**artefact, "certificate.file": certificate.name})
    files = job_of_export(kind, tables, {path.name: content for path, content in read.items()}, id=name)
    return put_new(folder, Owner("new", name), files, tuple(read))


_FIX = "Name the results.json of a report, or the folder it lies in"


def write_qif(report: Path, out: Path | None = None) -> Path:
    path = report / RESULTS if report.is_dir() else report
    content = content_of(path, TABLE_BYTES, _FIX)
    found = read_results(ReportResults, content, str(path), "is no results.json of a report", _FIX)
    file = out or Path(f"{found.job.id}.qif")
    refuse_taken(file)
    write_new(file, qif(found))
    return file


def read_certificate(file: Path, schema: Path | None = None) -> Certificate:
    """The certificate of a file.

    schema : folder of the schemas; ``None`` for our own checks alone.
    """
    content = content_of(file, DCC_BYTES, "Name a digital calibration certificate (.xml)")
    certificate = read(content, str(file))
    if schema is not None:
        from cmm_uq.jobs.dcc.xml_file import checked_by_schema

        checked_by_schema(content, schema, str(file))
    return certificate
