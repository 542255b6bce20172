"""Where a recording comes from: measured, or derived from another by a command; and that the mark stays on it.

The commands that derive a recording write the mark into job.toml. That it was taken away shows where a hash or a line still
tells: the first line of the recording, and the manifest beside it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.table import JobTable, required
from cmm_uq.base.output import MANIFEST, read_manifest
from cmm_uq.jobs.source import sha256

Origin = Literal["measured", "simulated", "compensated"]
MEASURED: Final = "measured"
SIMULATED: Final = "simulated"
COMPENSATED: Final = "compensated"
# commands that write a recording, and what they make of it
DERIVING: Mapping[str, Origin] = {"simulate": SIMULATED, "compensate": COMPENSATED}
_WRITTEN = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*?# (simulated|compensated) by cmm-uq ")
# first line of the recording that a plan writes for the operator to fill in
PLANNED = "# planned, nothing is measured yet: nominal coordinates\n"
_PLANNED = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*?# planned, nothing is measured yet")
EXAMPLE = "EXAMPLE"  # first word behind a figure of a new job.toml that nobody has stated yet
_EXAMPLE = re.compile(r"[ \t]*([A-Za-z_]+)[ \t]*=.*# EXAMPLE\b")
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class DerivedFrom(JobTable):
    """``derived_from``: the job that a recording was made from, by what, and SHA-256 of what went in and came out.

    ``inputs``: of the files of that job; ``files``: of the recording and of what else was written with it (the truth, the
    error maps), which belong to this job and are attached to its documents.
    """

    job: str = required("Id of the job that the recording was made from.")
    by: Literal["simulate", "compensate"] = required("Command that made it.")
    program: str = required("Program and version that made it.")
    inputs: dict[str, Digest] = required("SHA-256 of each file of that job.")
    files: dict[str, Digest] = required("SHA-256 of each file that was written with the recording.")


def first_line(by: str, program: str, how: str) -> str:
    """The line that a derived recording begins with."""
    return f"# {DERIVING[by]} by {program}{how}\n"


def check_mark(folder: Path, origin: str, recording: bytes, where: str) -> None:
    """That a recording which was derived says so."""
    if origin != MEASURED:
        return
    manifest = read_manifest(folder)
    if mark := _WRITTEN.match(recording):
        made, problem, place = mark[1].decode(), "was", f"{where} line 1"
    elif manifest is not None and manifest.owner.command in DERIVING:
        made, problem, place = DERIVING[manifest.owner.command], "the recording was", str(folder / MANIFEST)
    else:
        return
    fix = f'Write origin = "{made}" in [job]'
    raise CmmUqError(f"{problem} {made}, and job.toml says measured", where=place, fix=fix)


def check_examples(toml: bytes, origin: str, where: str) -> None:
    """That no figure of an example is taken for one of a machine or an artefact that was measured."""
    if origin != MEASURED:
        return
    wrong = Gathered()
    for number, line in enumerate(toml.decode("utf-8-sig").splitlines(), 1):
        if found := _EXAMPLE.match(line):
            wrong.add(CmmUqError(f"{found[1]} is still an example's", where=f"{where} line {number}",
                                 fix=f"Put in your own, or leave it out, and take the word {EXAMPLE} away"))  # fmt: skip
    wrong.refuse()


def is_planned(recording: bytes) -> bool:
    """Whether a recording is a plan's, with nominal coordinates."""
    return _PLANNED.match(recording) is not None


def altered(derived: DerivedFrom | None, inputs: Mapping[str, bytes]) -> tuple[str, ...]:
    """Names of files that were changed after a command wrote them."""
    if derived is None:
        return ()
    hashes = sha256(inputs)
    return tuple(name for name, digest in derived.files.items() if hashes.get(name, digest) != digest)
