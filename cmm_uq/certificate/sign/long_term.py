"""Signatures that can be checked years later: what proves their certificates kept in the PDF (B-LT), stamped again (B-LTA)."""

from __future__ import annotations

import datetime as dt
from typing import Any

from asn1crypto import x509
from pyhanko.sign.signers import PdfTimeStamper
from pyhanko.sign.validation.dss import DocumentSecurityStore
from pyhanko_certvalidator import CertificateValidator, ValidationContext
from pyhanko_certvalidator.errors import PathBuildingError, PathValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign.adapter import translated
from cmm_uq.certificate.sign.appending import appending
from cmm_uq.certificate.sign.found import Trust
from cmm_uq.certificate.sign.signer import ONE_DIGEST, Signer
from cmm_uq.certificate.sign.time_server import Server

STAMP = "TimeStamp"
"""Name of the field of a document's time stamp, before its number."""


class Proof:
    """What proves the certificates of a signature at a time, fetched from those who issued them.

    Parameters
    ----------
    signer : who signs.
    server : of time stamps.
    trust : whom a chain of either must lead to.
    at : the time.
    """

    def __init__(self, signer: Signer, server: Server, trust: Trust, at: dt.datetime) -> None:
        self._signer, self._server = signer, server
        self.context = ValidationContext(
            trust_roots=[x509.Certificate.load(anchor) for anchor in trust.anchors],
            other_certs=[translated(one) for one in signer.chain], allow_fetching=True, moment=at,
            revocation_mode="require", retroactive_revinfo=True,
        )  # fmt: skip
        self.paths: list[Any] = []

    async def gather(self) -> None:
        """Fetch it, before anything is signed.

        Raises
        ------
        CmmUqError : a chain does not lead to anybody trusted, or nobody says whether a certificate was revoked.
        """
        signer = CertificateValidator(translated(self._signer.certificate), validation_context=self.context)
        try:
            self.paths.append(await signer.async_validate_path())
            async for path in self._server.validation_paths(self.context):
                self.paths.append(path)
        except (PathBuildingError, PathValidationError) as error:
            raise CmmUqError(f"a certificate cannot be proven: {error}", where=self._signer.where,
                             fix="Trust its root with --trust, or sign at level B-T") from None  # fmt: skip
        finally:
            await self.context.aclose()

    def kept(self, pdf: bytes) -> Any:
        """A writer of a PDF with a further revision that holds it."""
        writer = appending(pdf)
        DocumentSecurityStore.supply_dss_in_writer(writer, None, paths=self.paths, validation_context=self.context)
        return writer


async def stamped(writer: Any, server: Server) -> bytes:
    """The whole document stamped, with what its revision holds."""
    from pyhanko.sign.fields import enumerate_sig_fields

    taken = {name for name, _, _ in enumerate_sig_fields(writer)}
    name = next(name for name in (f"{STAMP}{i}" for i in range(1, len(taken) + 2)) if name not in taken)
    output = await PdfTimeStamper(server, field_name=name).async_timestamp_pdf(writer, ONE_DIGEST)
    output.seek(0)
    return bytes(output.read())
