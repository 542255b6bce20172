"""A digital calibration certificate read from its file, by our own model and, where asked, by PTB's schema."""

from __future__ import annotations

from pathlib import Path

from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import DCC_BYTES
from cmm_uq.jobs.dcc import Certificate, read


def read_certificate(file: Path, schema: Path | None = None) -> Certificate:
    """The certificate of a file.

    Parameters
    ----------
    file : XML.
    schema : folder of the schemas; ``None`` for our own checks alone.

    Raises
    ------
    CmmUqError : it is missing, no DCC, or breaks the schema, with line and XPath.
    """
    content = content_of(file, DCC_BYTES, "Name a digital calibration certificate (.xml)")
    certificate = read(content, str(file))
    if schema is not None:
        from cmm_uq.jobs.dcc.schema import checked_by_schema

        checked_by_schema(content, schema, str(file))
    return certificate
