"""One job of a scheduled run: taken where it is new or changed and nobody else is at it, reported, and what came of it."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import finish_interrupted
from cmm_uq.base.plugins import told_with_package
from cmm_uq.jobs.file_names import RESULTS
from cmm_uq.laboratory.schedule import locks
from cmm_uq.laboratory.schedule.found import JOB_FILE, Found, differing
from cmm_uq.laboratory.schedule.notices import Notice, decisions, of_results
from cmm_uq.laboratory.schedule.state import PRIVATE, State

Report = Callable[[Found], bytes]
"""Reports a job into its folder below ``out``, and returns contents of results.json."""

REPORTED, UNCHANGED, WAITING, BUSY, GONE = "reported", "unchanged", "waiting", "busy", "gone"
REFUSED, FAILED, WOULD = "refused", "failed", "would report"
"""What came of a job."""


@dataclass(frozen=True)
class Ended:
    """What came of a job, or of a folder.

    Parameters
    ----------
    job : that it is about.
    state : one of the words above.
    why : in words.
    error : that stopped it.
    results : contents of results.json where it was reported.
    notices : of what a person must hear of the certificate.
    seconds : that it took.
    """

    job: Found
    state: str
    why: str = ""
    error: CmmUqError | None = None
    results: Mapping[str, Any] = field(default_factory=dict)
    notices: Sequence[Notice] = ()
    seconds: float = 0.0

    @classmethod
    def refused(cls, job: Found, error: CmmUqError) -> Ended:
        """Of a job that an error stopped."""
        return cls(job, FAILED if isinstance(error, OutputError) else REFUSED, str(error), error)

    @property
    def name(self) -> str:
        """Id of the job, or its folder where it has none."""
        return self.job.id or str(self.job.folder)

    @property
    def events(self) -> list[str]:
        """What a person must hear of."""
        return [notice.event for notice in self.notices] if self.error is None else ["error"]

    @property
    def code(self) -> int:
        """Exit code for this alone: 0 well, 1 needs a person, 2 bad input, 3 no output possible."""
        if self.error is not None:
            return 3 if isinstance(self.error, OutputError) else 2
        return int(bool(self.notices))

    def line(self) -> dict[str, Any]:
        """What is told of it, for a program."""
        error, results = self.error, self.results
        told = {
            "job": self.job.id or None, "folder": str(self.job.folder), "state": self.state, "why": self.why or None,
            "decisions": decisions(results), "verdict": (results.get("diagnosis") or {}).get("verdict"),
            "events": self.events, "seconds": round(self.seconds, 3), "exit_code": self.code,
        }  # fmt: skip
        if error is not None:
            told["error"] = {"problem": error.problem, "where": error.where, "fix": error.fix}
        return told


@dataclass(frozen=True)
class Work:
    """How jobs are reported.

    Parameters
    ----------
    out : folder with a folder for each job.
    state : what earlier runs have done.
    report : reports one job.
    queue : lets notices go out, before a job counts as done.
    further : what the history of its machine says of a new certificate.
    """

    out: Path
    state: State
    report: Report
    queue: Callable[[Sequence[Notice]], object]
    further: Callable[[Found], Iterable[Notice]] = lambda job: ()

    def lock_of(self, job: Found) -> Path:
        """Its lock file; one for two ids that some systems take for one."""
        return self.out / PRIVATE / "locks" / f"{job.id.casefold()}.lock"

    def was_left(self, job: Found) -> bool:
        """Whether the last run ended in this job."""
        return bool(job.id) and locks.was_left(self.lock_of(job))

    def reason(self, job: Found) -> str:
        """Why a job is to be reported; empty where its certificate stands.

        Raises
        ------
        CmmUqError : it changed after a person had released its certificate.
        """
        known = self.state.reported(job.id) if job.id else None
        if known is None:
            return "new"  # one without an id is refused when it is read
        changed = differing(job, known.inputs)
        if changed and self.state.released(job.id):
            raise CmmUqError(f"{', '.join(changed)} changed after the certificate was released", where=str(job.folder),
                             fix="Give the new recording a job id of its own, or withdraw the certificate")  # fmt: skip
        return f"changed: {', '.join(changed)}" if changed else ""

    def take(self, job: Found) -> Ended:
        """Report a job unless it has its certificate, or another run is at it."""
        begun = time.monotonic()
        try:
            ended = self._alone(job)
        except CmmUqError as error:
            ended = _stopped(job, error)
        except MemoryError:
            ended = _stopped(job, CmmUqError("the memory does not suffice for this input", where=str(job.folder)))
        except Exception as error:  # whatever a job makes break, the next one is to be reported
            ended = _stopped(job, _fault(error, job))
        return replace(ended, seconds=time.monotonic() - begun)

    def _alone(self, job: Found) -> Ended:
        if not job.id:
            self.report(job)
            return Ended(job, WAITING, "was changed while it was read: left for the next run")
        with locks.turn(self.lock_of(job)) as turn:
            if turn is None:
                return Ended(job, BUSY, "another run is at it")
            finish_interrupted(self.out / job.id)
            why = self.reason(job)  # asked again: another run may have been through with it
            if not why and not turn.resumed:
                return Ended(job, UNCHANGED)
            results = json.loads(self.report(job) if why else self._written(job))
            turn.through = False  # until its messages wait to be sent, the next run has to look at it again
            notices = [*of_results(results, _digest(results), str(self.out / job.id)), *self.further(job)]
            self.queue(notices)
            turn.through = True
            return Ended(job, REPORTED, why, results=results, notices=notices) if why else Ended(job, UNCHANGED)

    def _written(self, job: Found) -> bytes:
        """Of a job whose run ended between its certificate and its messages."""
        try:
            return (self.out / job.id / RESULTS).read_bytes()
        except OSError:
            return b"{}"


def _stopped(job: Found, error: CmmUqError) -> Ended:
    if not (job.folder / JOB_FILE).exists() and job.root.is_dir():
        return Ended(job, GONE, "the folder went away meanwhile")
    return Ended.refused(job, error)


def _digest(results: Mapping[str, Any]) -> str:
    """One hash over those of all inputs."""
    inputs = results.get("job", {}).get("inputs_sha256", {})
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _fault(error: Exception, job: Found) -> CmmUqError:
    told = told_with_package(error)
    if told is not None:
        return told
    return CmmUqError(f"a fault of the program: {type(error).__name__}: {error}", where=str(job.folder),
                      fix="Please report it with the input")  # fmt: skip
