"""A signer as the library of PDF signatures knows one."""

from __future__ import annotations

from typing import Any

from asn1crypto import x509
from asn1crypto.algos import SignedDigestAlgorithm
from cryptography.hazmat.primitives.serialization import Encoding
from pyhanko.sign import signers
from pyhanko_certvalidator.registry import SimpleCertificateStore

from cmm_uq.certificate.sign.signer import ONE_DIGEST, Signer

_ROOM = 16
"""Bytes by which two signatures of an ECDSA key may differ in length, as DER."""


class Adapted(signers.Signer):  # type: ignore[misc]
    """Signs whatever the library gives it with a :class:`~cmm_uq.certificate.sign.signer.Signer`."""

    def __init__(self, signer: Signer) -> None:
        registry = SimpleCertificateStore()
        registry.register_multiple([translated(one) for one in signer.chain])
        mechanism = {"rsa": f"{ONE_DIGEST}_rsa", "ecdsa": f"{ONE_DIGEST}_ecdsa"}[signer.algorithm]
        super().__init__(
            signing_cert=translated(signer.certificate), cert_registry=registry,
            signature_mechanism=SignedDigestAlgorithm({"algorithm": mechanism}),
        )  # fmt: skip
        self.signer = signer

    async def async_sign_raw(self, data: bytes, digest_algorithm: str, dry_run: bool = False) -> bytes:
        """Signature of data; of a rehearsal only its length counts."""
        if dry_run:
            return bytes((self.signer.bits + 7) // 8 * 2 + _ROOM)
        return self.signer.signed(data)


def translated(certificate: Any) -> x509.Certificate:
    """A certificate as the library knows one."""
    return x509.Certificate.load(certificate.public_bytes(Encoding.DER))
