"""One case judged: the files written to a folder, verified, and what came of it."""

from __future__ import annotations

import hashlib
import shutil
import time
import traceback
from pathlib import Path
from typing import Any

from benchmarks.tampering.cases import Case
from cmm_uq.app.commands.certificates.verification import again
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.base.errors import CmmUqError

_KNOWN: dict[str, Any] = {}


def judged(case: Case, folder: Path) -> dict[str, Any]:
    """What is said of an altered certificate, with the second computation and without.

    The second computation follows from the inputs, so those that were not altered are computed once in a process.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    paths = [folder / name for name in case.files]
    trust = None
    if case.trust is not None:
        trust = [folder.with_suffix(".pem")]
        trust[0].write_bytes(case.trust)
    record: dict[str, Any] = {"number": case.number, "base": case.base, "file": case.file, "form": case.form,
                              "given": sorted({name.rpartition(".")[2] for name in case.files}), "how": case.how,
                              "what": case.what}  # fmt: skip
    began = time.monotonic()
    try:
        found = verify(paths, compute=_once, trust=trust).inquiry
        record |= {"said": found.word, "findings": [str(one) for one in found.findings[:5]],
                   "checks": sorted({one.check for one in found.findings}),
                   "not_checked": [str(one) for one in found.unchecked]}  # fmt: skip
    except CmmUqError as error:
        record |= {"said": "REFUSED", "findings": [str(error)], "checks": ["files"], "not_checked": []}
    except Exception:
        record |= {"said": "FAULT", "findings": [traceback.format_exc()], "checks": [], "not_checked": []}
    record["seconds"] = round(time.monotonic() - began, 2)
    return record


def _once(given: Any, job: Any) -> Any:
    """The second computation, kept by what it follows from."""
    digest = hashlib.sha256()
    for name, content in sorted(job.inputs.items()):
        digest.update(name.encode() + b"\0" + hashlib.sha256(content).digest())
    data = given.results[1]
    key = f"{digest.hexdigest()} {(data.get('sampling') or {}).get('seed')} {'estimates' in data} {given.pdf is None}"
    key += f" {job.facts.job.language} {given.pdf and given.pdf[1].information.get('/Creator')}"
    key += str(sorted(hashlib.sha256(c).hexdigest() for n, c in given.files.items() if n.endswith(".xml")))
    if key not in _KNOWN:
        if len(_KNOWN) > 60:
            _KNOWN.clear()
        _KNOWN[key] = again(given, job)
    return _KNOWN[key]


def verified(number: int, folder: Path) -> dict[str, Any]:
    """What is said of a good certificate, computed again in full."""
    began = time.monotonic()
    record: dict[str, Any] = {"number": number}
    try:
        found = verify([folder]).inquiry
        quick = verify([folder], rerun=False).inquiry
        record |= {"said": found.word, "findings": [str(one) for one in (*found.findings, *quick.findings)][:5],
                   "not_checked": [str(one) for one in found.unchecked]}  # fmt: skip
    except CmmUqError as error:
        record |= {"said": "REFUSED", "findings": [str(error)], "not_checked": []}
    except Exception:
        record |= {"said": "FAULT", "findings": [traceback.format_exc()], "not_checked": []}
    shutil.rmtree(folder, ignore_errors=True)
    return record | {"seconds": round(time.monotonic() - began, 2)}
