"""A certification authority for tests: a root, an intermediate, and whatever signers a test asks for."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import pkcs12
from cryptography.x509.oid import NameOID

from cmm_uq.certificate.sign.signer import Signer, signing

SIGNED = dt.datetime(2026, 3, 2, 9, 30, tzinfo=dt.UTC)
FIRST, LAST = SIGNED - dt.timedelta(days=30), SIGNED + dt.timedelta(days=335)


def usage(**given: bool) -> x509.KeyUsage:
    none = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment", "key_agreement",
         "key_cert_sign", "crl_sign", "encipher_only", "decipher_only"), False,
    )  # fmt: skip
    return x509.KeyUsage(**{**none, **given})


def named(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common),
                      x509.NameAttribute(NameOID.ORGANIZATION_NAME, "Messlabor Müller")])  # fmt: skip


@dataclass(frozen=True)
class Held:
    """A key with its certificate and those above it."""

    key: Any
    certificate: x509.Certificate
    chain: tuple[x509.Certificate, ...] = ()

    @property
    def signer(self) -> Signer:
        return Signer(self.certificate, self.chain, *signing(self.key, "the test"), where="the test")

    @property
    def pem(self) -> bytes:
        return self.certificate.public_bytes(serialization.Encoding.PEM)

    def file(self, passphrase: str) -> bytes:
        kept = serialization.PrivateFormat.PKCS12.encryption_builder().kdf_rounds(1).build(passphrase.encode())
        return pkcs12.serialize_key_and_certificates(b"key", self.key, self.certificate, self.chain, kept)


def issued(
    common: str, key: Any, above: Held | None = None, *, authority: bool = False, first: dt.datetime = FIRST,
    last: dt.datetime = LAST, key_usage: x509.KeyUsage | None = None, digest: Any = None,
    further: tuple[tuple[Any, bool], ...] = (),
) -> Held:  # fmt: skip
    """A certificate for a key, by whoever is above it, or by itself."""
    own = (
        usage(key_cert_sign=True, crl_sign=True, digital_signature=True)
        if authority
        else usage(content_commitment=True)
    )
    builder = (
        x509.CertificateBuilder().subject_name(named(common))
        .issuer_name(above.certificate.subject if above else named(common)).public_key(key.public_key())
        .serial_number(x509.random_serial_number()).not_valid_before(first).not_valid_after(last)
        .add_extension(x509.BasicConstraints(ca=authority, path_length=None), critical=True)
        .add_extension(key_usage or own, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )  # fmt: skip
    issuer_key = above.certificate.public_key() if above else key.public_key()
    builder = builder.add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key), critical=False)
    for extension, critical in further:
        builder = builder.add_extension(extension, critical=critical)
    certificate = builder.sign(above.key if above else key, digest or hashes.SHA256())
    return Held(key, certificate, (above.certificate, *above.chain) if above else ())


def curve_key() -> ec.EllipticCurvePrivateKey:
    return ec.generate_private_key(ec.SECP256R1())


def root(common: str = "Test Root") -> Held:
    return issued(common, curve_key(), authority=True, first=SIGNED - dt.timedelta(days=3650),
                  last=SIGNED + dt.timedelta(days=3650))  # fmt: skip
