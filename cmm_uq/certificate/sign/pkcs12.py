"""Keys in a PKCS#12 file (``.p12``, ``.pfx``): read, and made for trying."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import KEY_BYTES
from cmm_uq.certificate.sign.extra import installed
from cmm_uq.certificate.sign.signer import TEST_NOTE, TEST_OID, TEST_WORDS, Signer, signing

TEST_DAYS = 365
"""How long a test key is valid."""

LONGEST_NAME = 64 - len(f"{TEST_WORDS} – ")
"""Characters of a name (X.520, ub-common-name)."""


def signer_of_file(path: Path, passphrase: str) -> Signer:
    """The key of a PKCS#12 file.

    Parameters
    ----------
    path : of the file.
    passphrase : that opens it.

    Raises
    ------
    CmmUqError : it cannot be read, the passphrase is another, it has no private key or no certificate, or the key is of a
        sort that does not sign here.
    """
    with installed():
        from cryptography.hazmat.primitives.serialization import pkcs12
    where = str(path)
    content = content_of(path, KEY_BYTES, "Name a PKCS#12 file; cmm-uq keys new makes one for trying")
    try:
        key, certificate, chain = pkcs12.load_key_and_certificates(content, passphrase.encode())
    except ValueError as error:
        wrong = "password" in str(error).lower() or "mac" in str(error).lower()
        problem = "the passphrase does not open it" if wrong else "is no PKCS#12 file"
        fix = "Give the passphrase it was made with" if wrong else "Name a file .p12 or .pfx with key and certificate"
        raise CmmUqError(problem, where=where, fix=fix) from None  # the cause could show what was tried
    if key is None:
        raise CmmUqError("has no private key", where=where, fix="Export key and certificate together")
    if certificate is None:
        raise CmmUqError("has no certificate of its key", where=where, fix="Export key and certificate together")
    return Signer(certificate, tuple(chain), *signing(key, where), where=where)


@dataclass(frozen=True)
class TrialKey:
    """A key for trying.

    Parameters
    ----------
    key : with its certificate, as a PKCS#12 file.
    certificate : alone, PEM.
    until : last day that it is valid.
    """

    key: bytes
    certificate: bytes
    until: dt.date


def trial_key(name: str, passphrase: str, at: dt.datetime) -> TrialKey:
    """A new key for trying, with a certificate that it signs itself and that says so.

    Parameters
    ----------
    name : of whom it is for.
    passphrase : that is to open it.
    at : when its certificate begins to be valid.

    Raises
    ------
    CmmUqError : the name is empty or too long, or the passphrase is empty.
    """
    if not 0 < len(name.strip()) <= LONGEST_NAME:
        raise CmmUqError(
            f"a name has 1 to {LONGEST_NAME} characters", where="--name", fix="Name the laboratory or person"
        )
    if not passphrase:
        raise CmmUqError("a key is not kept without a passphrase", fix="Choose one")
    with installed():
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec
        from cryptography.hazmat.primitives.serialization import pkcs12
        from cryptography.x509.oid import NameOID, ObjectIdentifier
    key = ec.generate_private_key(ec.SECP256R1())  # small, and opened at once
    subject = x509.Name([
        x509.NameAttribute(NameOID.COMMON_NAME, f"{TEST_WORDS} – {name.strip()}"),
        x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, f"{TEST_WORDS}, proves nothing"),
    ])  # fmt: skip
    usage = x509.KeyUsage(
        digital_signature=True, content_commitment=True, key_encipherment=False, data_encipherment=False, key_agreement=False,
        key_cert_sign=False, crl_sign=False, encipher_only=False, decipher_only=False,
    )  # fmt: skip
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject).issuer_name(subject).public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(at).not_valid_after(at + dt.timedelta(days=TEST_DAYS))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.UnrecognizedExtension(ObjectIdentifier(TEST_OID), _utf8(str(TEST_NOTE).encode())), critical=False)
    )  # fmt: skip
    certificate = builder.sign(key, hashes.SHA256())
    key_file = pkcs12.serialize_key_and_certificates(
        name.strip().encode(), key, certificate, None, serialization.BestAvailableEncryption(passphrase.encode())
    )
    pem = certificate.public_bytes(serialization.Encoding.PEM)
    return TrialKey(key_file, pem, certificate.not_valid_after_utc.date())


def _utf8(text: bytes) -> bytes:
    """A UTF8String of DER with fewer than 128 bytes."""
    return bytes((0x0C, len(text))) + text
