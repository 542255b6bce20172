"""What the desk's worker does: one line of JSON in says what, lines of JSON out say how far it is and what it found.

Run by the server as ``python -P -m cmm_uq.app.desk.work BYTES`` in the root folder; BYTES of memory are the most it takes, 0
is no limit. It ends with the server, whose pipe it reads.

The job of a part, as the worker writes it from a plan and the certificate of the machine.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any, TextIO

import numpy as np
import tomlkit

from cmm_uq.analysis.diagnosis.location import residual_field
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.files import Written
from cmm_uq.app.commands.jobs.exchange import read_export, write_recording
from cmm_uq.app.commands.jobs.new import check_empty, job_id, kind_or_refused, known, put_new
from cmm_uq.app.commands.parts.new import PART, Answers, certificate_files, part_of_drawing
from cmm_uq.app.commands.parts.part import PartOptions, write_part
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.app.desk import exports, questions
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, content_of, value_of
from cmm_uq.base.output import Owner
from cmm_uq.base.output.interruption import done, watch
from cmm_uq.base.unused import lighten
from cmm_uq.certificate.plots.machine import machine_plot
from cmm_uq.certificate.result import Outcome, Result
from cmm_uq.certificate.verify.given import CHECKS
from cmm_uq.jobs.reading import is_part
from cmm_uq.jobs.tables.identification import EXAMPLE, MEASURED


def create_part(
    plan: str, certificate: str, folder: str, date: str, not_measured: bool, facts: Mapping[str, str]
) -> dict[str, Any]:
    """Write the job of a part as ``cmm-uq new part --from`` does, with the machine's certificate in it.

    facts : by dotted key, what is empty is not stated; those of a stylus are of each.
    """
    target = Path(folder)
    check_empty(target)
    given: dict[str, dict[str, Any]] = {"job": {"date": value_of(date)}} if date else {}
    if not_measured:
        given[PART] = {"not_measured": ["*"]}
    machine = certificate_files(Path(certificate))
    stated = {key: value_of(questions.plain_number(text.strip())) for key, text in facts.items() if text.strip()}
    if (gradient := "environment.u_gradient_k_per_m") in stated:
        stated[gradient] = [stated[gradient]] * 3
    for dotted, value in stated.items():
        table, _, key = dotted.partition(".")
        if table != "stylus":
            given.setdefault(table, {})[key] = value
    given["machine_state"] = {"certificate": Answers(machine=machine).certificate}
    name = job_id(target, given)
    files = part_of_drawing(Path(plan), given, id=name)
    document = tomlkit.parse(files["job.toml"].decode())
    for dotted, value in stated.items():
        for one in document["stylus"] if dotted.startswith("stylus.") else ():
            one[dotted.partition(".")[2]] = value
    text = tomlkit.dumps(document)
    if text.count(EXAMPLE) == 1:  # in the head alone: no figure is an example's
        del document["job"]["origin"]
        text = tomlkit.dumps(document)
    files["job.toml"] = text.encode()
    return {"files": sorted(put_new(target, Owner("new", name, MEASURED), {**files, **machine}, (Path(plan),)))}


MOST_VECTORS = 1500
Tell = Callable[[Mapping[str, Any]], None]


def report(job: str, tell: Tell) -> dict[str, Any]:
    """``cmm-uq report`` of a job in the root folder, with its residuals as vectors where it has some, or ``part``."""
    folder = Path(job)

    def stage(what: str, part: float) -> None:
        tell({"what": what, "part": part})

    if is_part(content_of(folder / "job.toml", JOB_BYTES, "")):
        of_part = write_part(folder, options=PartOptions(), stage=stage, records=None)
        return {"id": of_part.name, "sha256": "", "field": None}
    written = write_report(folder, stage=stage, records=None)
    return {"id": written.name, "sha256": sha256(written.results).hexdigest(), "field": vectors(written)}


def vectors(written: Written[Outcome]) -> dict[str, Any] | None:
    """Places, mm, and residuals, µm, before and after what was left out, with U of their lengths."""
    found = written.found.found
    if not isinstance(found, Result):
        return None
    diagnosis = found.diagnosed.diagnosis
    field = residual_field(diagnosis.before, diagnosis.after)
    if field is None or len(field.place) > MOST_VECTORS:
        return None
    rounded = {
        "place": np.round(field.place, 3),
        "before": np.round(field.before, 4),
        "after": np.round(field.after, 4),
    }
    limit = np.round(field.expanded(diagnosis.noise.coordinate), 4).tolist()
    return {name: values.tolist() for name, values in rounded.items()} | {
        "limit": limit,
        "found": bool(diagnosis.effects),
    }


def verification(path: str) -> dict[str, Any]:
    """What a certificate says, on what it rests, and whether it holds, as ``cmm-uq verify --no-rerun`` finds it."""
    found = verify((Path(path),), rerun=False)
    inquiry = found.inquiry
    checks = [
        [any(one.check == name for one in inquiry.findings), what, inquiry.done.get(name, 0)]
        for name, what in CHECKS.items()
        if inquiry.done.get(name) or any(one.check == name for one in inquiry.findings)
    ]
    signed = next((note for note in inquiry.notes if "sign" in note.lower()), "Nobody has signed it electronically.")
    return {
        "word": inquiry.word,
        "said": found.said,
        "signed": signed,
        "checks": checks,
        "findings": [str(one) for one in inquiry.findings],
        "unchecked": [str(one) for one in inquiry.unchecked],
    }


_SMALL = 1_000_000  # bytes of an export that every kind is tried with


def kinds(export: str = "", keys: Mapping[str, Any] = MappingProxyType({})) -> list[list[Any]]:
    """Kinds that an export may be a recording of: name, what it measures, what a set-up is, how it fits, and what does not.

    What does not is what ``cmm-uq check`` finds wrong with the readings of such a job. First come kinds with which nothing is
    wrong, then those that wait for what the export does not hold, and those with other readings last: 0, 1 and 2.
    """
    kind = {name: kind_or_refused(one) for name, one in known().items()}
    begun = {name: one.beginning(name) for name, one in kind.items() if one.table.with_recording}
    fits = dict.fromkeys(begun, (0, ""))
    if export and Path(export).stat().st_size <= _SMALL:
        read = read_export(Path(export), exports.keys_of(keys))
        calibrated = any(name.startswith("reference_") for name in read.columns)
        with tempfile.TemporaryDirectory(prefix="cmm-uq-") as place:
            own = Path(place, "readings.csv")
            write_recording(Path(export), read, own)
            whole = {name: calibrated or not kind[name].table.with_references for name in begun}
            fits = {name: _fit(name, own, whole=whole[name]) for name in begun}
    found = [[name, one.measured or one.title, one.numbering, *fits[name]] for name, one in begun.items()]
    return sorted(found, key=lambda one: int(one[3]))


def _fit(kind: str, own: Path, *, whole: bool) -> tuple[int, str]:
    """``whole``: whether the readings have the calibration of the artefact with them, where a kind needs it of each point."""
    found = questions.job_begun(kind, str(own), {}, {"machine.name": "?", "job.date": "2000-01-01"})
    wrong = [one.problem for one in found.problems if Path(one.file).name == own.name]
    return (2, wrong[0]) if wrong and whole else (0 if found.sound else 1, "")


def machine(job: str) -> str:
    """The picture of a job's machine, as SVG."""
    return machine_plot(read_job(Path(job), recorded=False).points.machine).svg


DOES: Mapping[str, Callable[..., Any]] = {
    "first_keys": exports.first_keys,
    "read": exports.read,
    "corrected": exports.corrected,
    "remembered": exports.remembered,
    "kinds": kinds,
    "fields": questions.fields_for,
    "check_answers": questions.check_answers,
    "check": questions.check_text,
    "create": questions.create,
    "create_part": create_part,
    "facts": questions.facts,
    "with_facts": questions.with_facts,
    "with_file": questions.with_file,
    "report": report,
    "machine": machine,
    "verification": verification,
    "ready": lambda: True,
}


def answer(line: str, tell: Tell) -> dict[str, Any]:
    try:
        asked = json.loads(line)
        function = DOES[asked.pop("do")]
        further = {"tell": tell} if function is report else {}
        return {"found": function(**asked, **further)}
    except CmmUqError as error:
        return {"refused": [error.where or "", error.problem, error.fix or ""]}
    except MemoryError:
        return {"refused": ["", "needs more memory than the desk gives to a file", "Export the part that is needed"]}
    except Exception as error:  # a fault is told on the page; the worker goes on
        told = f"a fault of the program: {type(error).__name__}: {error}"
        return {"refused": ["", told, "Please report it"], "fault": True}


def limit_memory(most: int) -> None:
    """Where the system can: elsewhere the limits of readers alone hold."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def main() -> None:
    watch()
    warnings.simplefilter("ignore")
    out: TextIO = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever a library prints is no answer
    if most := int(sys.argv[1]):
        limit_memory(most)

    def tell(said: Mapping[str, Any]) -> None:
        out.write(json.dumps(said) + "\n")
        out.flush()

    with contextlib.suppress(BrokenPipeError):
        for line in sys.stdin:
            tell(answer(line, tell))
    done()


if __name__ == "__main__":
    lighten()
    main()
