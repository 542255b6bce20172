"""Is a certificate what it says? ``cmm-uq verify`` of a machine's certificate, or of the report of a part."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.certificates.verification import Recomputation, Verification, examine_certificate, verify_given
from cmm_uq.certificate.verify.given import Given, read_given

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.verification import Compute
    from cmm_uq.app.commands.files import Stage
    from cmm_uq.certificate.verify.given import Inquiry


def verify(
    paths: Iterable[Path], *, rerun: bool = True, trust: Iterable[Path] | None = None, schema: Path | None = None,
    compute: Compute | None = None, records: str | Path | None = None, stage: Stage = lambda what, part: None,
) -> Verification:  # fmt: skip
    """Verify the files of one certificate; see :func:`~cmm_uq.app.commands.certificates.verification.verify_given`."""
    trusted = None if trust is None else tuple(trust)

    def examine(inquiry: Inquiry, given: Given) -> Recomputation | None:
        if not given.of_part:
            return examine_certificate(inquiry, given, compute, stage)
        from cmm_uq.app.commands.certificates.verify_part import examine_part

        return examine_part(inquiry, given, rerun=rerun, trust=trusted, stage=stage)

    stage("Opening the files", 0.0)
    given = read_given(tuple(paths))
    return verify_given(given, examine, rerun=rerun, trust=trusted, schema=schema, records=records, stage=stage)
