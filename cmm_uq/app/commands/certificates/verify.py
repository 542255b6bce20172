"""Is a certificate what it says? ``cmm-uq verify`` of a machine's certificate, or of the report of a part."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.certificates.verification import Recomputation, Verification, examine_certificate, verify_given
from cmm_uq.certificate.verify.given import Given, read_given

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.verify_again import Compute
    from cmm_uq.app.commands.files import Stage
    from cmm_uq.certificate.verify.found import Inquiry


def verify(
    paths: Iterable[Path], *, rerun: bool = True, trust: Iterable[Path] | None = None, schema: Path | None = None,
    compute: Compute | None = None, stage: Stage = lambda what, part: None,
) -> Verification:  # fmt: skip
    """Verify the files of one certificate.

    Parameters
    ----------
    paths : PDF, XML, HTML, ``results.json`` and what belongs to them, or the folder of a report.
    rerun : whether everything is computed again from the inputs.
    trust : files and folders of certificates that are trusted; ``None`` for nobody, and then nothing need be signed.
    schema : folder with PTB's schemas, that the digital certificate is held to as well.
    compute : the second computation of a machine's certificate; as ``report`` and ``diagnose`` do where none is given.
    stage : told of progress.

    Raises
    ------
    CmmUqError : a file cannot be read, is hostile, or nothing of a certificate.
    """
    trusted = None if trust is None else tuple(trust)

    def examine(inquiry: Inquiry, given: Given) -> Recomputation | None:
        if not given.of_part:
            return examine_certificate(inquiry, given, compute, stage)
        from cmm_uq.app.commands.certificates.verify_part import examine_part

        return examine_part(inquiry, given, rerun=rerun, trust=trusted, stage=stage)

    stage("Opening the files", 0.0)
    return verify_given(read_given(tuple(paths)), examine, rerun=rerun, trust=trusted, schema=schema, stage=stage)
