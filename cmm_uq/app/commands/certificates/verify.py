"""Is a certificate what it says? ``cmm-uq verify`` of a machine's certificate, or of the report of a part."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.certificates import verification
from cmm_uq.app.commands.certificates.verification import Examined, Verification
from cmm_uq.certificate.verify.given import Given, Inquiry, read_given

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.again import Compute
    from cmm_uq.app.commands.files import Stage
    from cmm_uq.jobs.job import Job


def verify(
    paths: Iterable[Path], *, rerun: bool = True, trust: Iterable[Path] | None = None, schema: Path | None = None,
    compute: Compute | None = None, records: str | Path | None = None, stage: Stage = lambda what, part: None,
) -> Verification:  # fmt: skip
    """Verify the files of one certificate; see :func:`~cmm_uq.app.commands.certificates.verification.verify_given`."""
    trusted = None if trust is None else tuple(trust)

    def examine(inquiry: Inquiry, given: Given) -> Examined:
        if not given.of_part:
            found = verification.examine_certificate(inquiry, given, partial(_again, compute=compute, stage=stage))
            if found and found[0] and found[0].further:
                from cmm_uq.app.commands.certificates.further import verify_further

                for name, inner in verify_further(found[0], _again if rerun else None):
                    verification.merge(inquiry, inner.inquiry, name)
            return found
        from cmm_uq.app.commands.certificates.again import compute_again
        from cmm_uq.app.commands.certificates.verify_part import compare_part, part_again

        if (job := compare_part(inquiry, given, rerun=rerun, trust=trusted)) is None or given.results is None:
            return None
        computed = partial(part_again, inquiry, given, job, given.results[1], trust=trusted, stage=stage)
        return None, lambda: compute_again(inquiry, given, computed, "part")

    stage("Opening the files", 0.0)
    given = read_given(tuple(paths))
    return verification.verify_given(
        given, examine, rerun=rerun, trust=trusted, schema=schema, records=records, stage=stage
    )


def _again(
    inquiry: Inquiry, given: Given, job: Job, compute: Compute | None = None, stage: Stage = lambda what, part: None
) -> bool:
    from cmm_uq.app.commands.certificates.again import compute_machine_again  # with all that analyses a recording

    return compute_machine_again(inquiry, given, job, compute, stage)
