"""From the folder of a part's job to a :class:`PartJob`, and what a new job of a part begins with."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.limits import JOB_BYTES, JSON_BYTES, LISTED, LOGO_BYTES, TABLE_BYTES, text_of
from cmm_uq.base.files.toml_file import checked
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.logo import checked_logo
from cmm_uq.jobs.part.checks import check_names, check_plan
from cmm_uq.jobs.part.machine_state import MachineStateFacts
from cmm_uq.jobs.part.probed import Probed, probed
from cmm_uq.jobs.part.readings import OtherReadings, measured_points, other_readings
from cmm_uq.jobs.part.tables import PartFile, Places
from cmm_uq.jobs.part.values import Reported, reported_values
from cmm_uq.jobs.reading import CERTIFICATES, WHOLE, further_named, in_folder
from cmm_uq.jobs.source import RESULTS, FilesInMemory, JobFiles
from cmm_uq.jobs.tables.identification import check_examples, check_mark

_FIX = "A part's job is a folder with a job.toml; cmm-uq new part begins one"
POSTERIOR = "posterior.npz"


@dataclass(frozen=True, eq=False, repr=False)
class PartJob:
    """A part's job as read, with the bytes of every file it was read from."""

    folder: Path  # where it lies; the empty path for a job that lies in no folder yet
    facts: PartFile  # job.toml.
    features: tuple[Probed, ...]  # with their contact points, in the order of the job
    inputs: Mapping[str, bytes]  # contents of each input by its path inside the folder
    # (n, 3) measured points in the order of the features' points, mm; ``None`` where nothing is measured
    measured: Floats | None = None
    stated_by: tuple[str, ...] = ()  # names of those of the inputs that state the machine
    others: OtherReadings = field(default_factory=OtherReadings)  # recordings of other methods
    reported: Reported | None = None  # in place of measured points, what the report of another program says
    further: tuple[str, ...] = ()  # names of those of the inputs that are further certificates of the machine

    @property
    def machine_files(self) -> Mapping[str, bytes]:
        """Those of the inputs that state the machine: its certificate or results, and the draws of its errors."""
        return {name: self.inputs[name] for name in self.stated_by}


def read_part(folder: Path, *, machine: bool = True) -> PartJob:
    """Read and check a part's job.

    ``machine``: whether the files that state the machine must be there.
    """
    return _read(in_folder(folder), machine=machine)


def part_of(files: Mapping[str, bytes], *, machine: bool = True) -> PartJob:
    """Read and check a part's job that lies in no folder yet; see :func:`read_part`."""
    return _read(FilesInMemory(files), machine=machine)


def files_of_the_machine(facts: MachineStateFacts, source: JobFiles) -> tuple[str, ...]:
    """Names of the files that state the machine.

    Beside ``results.json`` lie the draws that it names, which a certificate carries in itself; in a folder that certificate
    too, for it has the recording inside.
    """
    if facts.certificate is None:
        return ()
    name = facts.certificate.removesuffix("/")
    if name.lower().endswith(WHOLE):
        return (name,)
    if name.lower().endswith(".json"):
        folder, results, certificates = name.rpartition("/")[0], name, list[str]()
    else:
        folder, results = name, f"{name}/{RESULTS}"
        certificates = [each for one in CERTIFICATES if source.has(each := f"{name}/{one}", written=True)]
    if certificates and not source.has(results, written=True):
        return (certificates[0],)
    drawn = facts.posterior or f"{folder}/{_posterior_named(source, results)}".lstrip("/")
    return (results, drawn, *certificates)


def _posterior_named(source: JobFiles, results: str) -> str:
    """The file of draws that ``results.json`` names; the usual one where it cannot be read or names none."""
    try:
        named = json.loads(source.content(results, JSON_BYTES, "", written=True))["posterior"]["file"]
    except (CmmUqError, OSError, ValueError, KeyError, TypeError, RecursionError):
        return POSTERIOR
    return named if isinstance(named, str) and "/" not in named else POSTERIOR


def _read(source: JobFiles, *, machine: bool) -> PartJob:
    path, folder = source.toml, source.toml.parent
    content = source.job_file(JOB_BYTES, _FIX)
    facts = checked(content, path, PartFile)
    places, wrong = Places(path, text_of(content, str(path))), Gathered()
    check_examples(content, facts.job.origin, str(path))
    features: list[Probed] = []
    check_names(facts, places, wrong)
    for i, feature in enumerate(facts.feature):
        with wrong.going_on():
            features.append(probed(feature, places.of("feature", number=i)))
    wrong.refuse()
    total = sum(len(one.points) for one in features)
    if total > LISTED.most:
        raise CmmUqError(f"has {total} points: {LISTED.most} are the most", where=str(path), fix="Probe fewer")
    check_plan(facts, {one.facts.name: one for one in features}, places, wrong)
    wrong.refuse()
    inputs, stated_by = {"job.toml": content}, files_of_the_machine(facts.machine_state, source) if machine else ()
    fix = (
        f"Put the machine's certificate (PDF) or its report's files there, or mend its name in {path}: [machine_state]"
    )
    further = further_named(facts.machine_state.further, source) if machine else ()
    for name in (*stated_by, *further):
        with wrong.going_on():
            inputs[name] = source.content(name, TABLE_BYTES, fix, written=True)
    beside = f"Put it beside job.toml, or mend its name in {path}"
    if logo := facts.laboratory.logo:
        with wrong.going_on():
            inputs[logo] = source.content(logo, LOGO_BYTES, beside)
            checked_logo(inputs[logo], str(folder / logo))

    def recorded(name: str) -> tuple[bytes, str]:
        inputs[name] = source.content(name, TABLE_BYTES, beside)
        check_mark(folder, facts.job.origin, inputs[name], str(folder / name))
        return inputs[name], str(folder / name)

    measured, reported = None, None
    if facts.recording is not None:
        with wrong.going_on():
            if facts.recording.values is None:
                measured = measured_points(*recorded(facts.recording.recorded), features)
            else:
                said = facts.recording.values
                reported = reported_values(*recorded(said), said, facts, places)
    others = other_readings(facts, features, places, recorded, wrong)
    wrong.refuse()
    return PartJob(folder, facts, tuple(features), inputs, measured, stated_by, others, reported, further)


TABLES: Mapping[str, Any] = MappingProxyType(
    tomllib.loads(Path(__file__).with_name("example.toml").read_text(encoding="utf-8"))
)
"""Tables of job.toml but ``[job]``: a plate with a bore, on three datum planes; every figure is an example."""
