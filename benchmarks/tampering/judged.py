"""One case judged: the files written to a folder, verified, and what came of it."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from benchmarks.tampering.cases import Case
from benchmarks.tampering.certificates import ROOT, Good, person, write_good
from cmm_uq.app.commands.certificates.again import again
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.base.errors import CmmUqError

QUICKLY, NOT_CONFORMING = 10, 4
"""Every so many-th is verified without computing again too; exit code of a report whose machine does not conform."""
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


def verified(this: Good, folder: Path) -> dict[str, Any]:
    """Make a good certificate in this process, and say what a verification says of it, with computing again in full."""
    began, out = time.monotonic(), folder / f"report-{this.number}"
    record = this.facts
    try:
        write_good(this, out)
        trust = folder / "root.pem"
        trust.write_bytes(person()[1])
        found = verify([out], trust=[trust] if this.signed else None).inquiry
        findings = found.findings
        if this.number % QUICKLY == 0:
            findings = (*findings, *verify([out], rerun=False, trust=[trust] if this.signed else None).inquiry.findings)
        record |= {"said": found.word, "findings": [str(one) for one in findings][:5],
                   "not_checked": [str(one) for one in found.unchecked]}  # fmt: skip
    except CmmUqError as error:
        record |= {"said": "REFUSED", "findings": [str(error)], "not_checked": []}
    except Exception:
        record |= {"said": "FAULT", "findings": [traceback.format_exc()], "not_checked": []}
    return _cleared(record, began, out, this.job)


def by_command(this: Good, folder: Path) -> dict[str, Any]:
    """The same by the command, two processes that import everything themselves: what it says, and its exit codes."""
    began, out = time.monotonic(), folder / f"report-{this.number}"
    held, root = person()
    key, trust = folder / "key.p12", folder / "root.pem"
    key.write_bytes(held.file("open"))
    trust.write_bytes(root)
    sign = ("--sign", key) if this.signed else ()
    none = ("--records", "none") if this.command in ("report", "diagnose") else ()
    made = _run(
        this.command, this.job, "--out", out, "--seed", this.seed, "--language", this.language, "--quiet", *none, *sign
    )
    record = this.facts | {"codes": [made.returncode], "said": "REFUSED", "findings": [made.stderr], "not_checked": []}
    if made.returncode in (0, NOT_CONFORMING):
        done = _run("verify", out, "--json", *(("--trust", trust) if this.signed else ()))
        told = json.loads(done.stdout) if done.returncode in (0, 1, 3) and done.stdout else {}
        record |= {"codes": [made.returncode, done.returncode], "said": str(told.get("verdict", "REFUSED")),
                   "findings": [str(one) for one in told.get("findings", [done.stderr])][:5],
                   "not_checked": [str(one) for one in told.get("not_checked", [])]}  # fmt: skip
    return _cleared(record, began, out, this.job)


def _run(*words: object) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "CMM_UQ_SIGN_PASSPHRASE": "open"}
    command = [sys.executable, "-m", "cmm_uq", *map(str, words)]
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)


def _cleared(record: dict[str, Any], began: float, *folders: Path) -> dict[str, Any]:
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    return record | {"seconds": round(time.monotonic() - began, 2)}
