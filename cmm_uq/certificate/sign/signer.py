"""Who signs: a certificate, those above it, and a key that only signs and is never shown, wherever it is kept."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say

if TYPE_CHECKING:
    from cryptography.x509 import Certificate, Name

TEST_WORDS = "TEST KEY"
"""What the subject of a test key begins with."""

TEST_OID = "2.25.252645135011245891322374512867431283711"
"""Of the extension that marks a test key, below the arc of numbers that anybody may draw (ITU-T X.667)."""

TEST_NOTE = say("signed with a test key: it proves nothing, and anybody can make one")

LEAST_RSA, LEAST_EC = 2048, 256
"""Bits of a key that still counts (ETSI TS 119 312, NIST SP 800-131A)."""

ONE_DIGEST = "sha256"
"""Digest of whatever is signed here."""


@dataclass(frozen=True)
class Signer:
    """A key and its certificate.

    Parameters
    ----------
    certificate : of the key.
    chain : certificates above it, nearest first; without the root where nobody gave it.
    algorithm : of the key.
    signed : signature of data with SHA-256: RSASSA-PKCS1-v1_5, or ECDSA as DER.
    where : the key is kept, for messages.
    """

    certificate: Certificate
    chain: tuple[Certificate, ...]
    algorithm: Literal["rsa", "ecdsa"]
    signed: Callable[[bytes], bytes] = field(repr=False)
    where: str = ""

    @property
    def name(self) -> str:
        """Who signs, as the certificate calls them."""
        return called(self.certificate.subject)

    @property
    def test_key(self) -> bool:
        """Whether it is for trying only."""
        return is_test(self.certificate)

    @property
    def bits(self) -> int:
        """Of the key."""
        size: int = getattr(self.certificate.public_key(), "key_size", 0)
        return size

    def check(self, at: dt.datetime) -> None:
        """Refuse to sign with what no one could accept.

        Parameters
        ----------
        at : time of the signature, with its zone.

        Raises
        ------
        CmmUqError : the certificate is not valid at this time, its key too short, or not for signing.
        """
        certificate = self.certificate
        if at < certificate.not_valid_before_utc:
            raise CmmUqError(f"its certificate is valid only from {_day(certificate.not_valid_before_utc)}",
                             where=self.where, fix="Wait, or sign with another key")  # fmt: skip
        if at > certificate.not_valid_after_utc:
            raise CmmUqError(f"its certificate expired on {_day(certificate.not_valid_after_utc)}", where=self.where,
                             fix="Renew it, or sign with another key")  # fmt: skip
        for why in unfit(certificate):
            raise CmmUqError(why, where=self.where, fix="Ask for a certificate for electronic signatures or seals")


def signing(key: object, where: str) -> tuple[Literal["rsa", "ecdsa"], Callable[[bytes], bytes]]:
    """How a private key in memory signs.

    Parameters
    ----------
    key : RSA or ECDSA; its signatures are the same for the same data.
    where : it is kept, for messages.

    Raises
    ------
    CmmUqError : it is of another sort.
    """
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa

    if isinstance(key, rsa.RSAPrivateKey):
        return "rsa", lambda data: key.sign(data, padding.PKCS1v15(), hashes.SHA256())
    if isinstance(key, ec.EllipticCurvePrivateKey):
        return "ecdsa", lambda data: key.sign(data, ec.ECDSA(hashes.SHA256(), deterministic_signing=True))
    raise CmmUqError("the key is neither RSA nor ECDSA", where=where, fix="Sign with an RSA or ECDSA key")


def unfit(certificate: Certificate) -> list[str]:
    """Why a certificate must not be used for signatures; nothing where it may."""
    from cryptography.hazmat.primitives.asymmetric import ec, rsa
    from cryptography.x509 import ExtensionNotFound, KeyUsage

    found, key = [], certificate.public_key()
    if isinstance(key, rsa.RSAPublicKey):
        if key.key_size < LEAST_RSA:
            found.append(f"an RSA key of {key.key_size} bits is too short, {LEAST_RSA} are the least")
    elif isinstance(key, ec.EllipticCurvePublicKey):
        if key.curve.key_size < LEAST_EC:
            found.append(f"an ECDSA key of {key.curve.key_size} bits is too short, {LEAST_EC} are the least")
    else:
        found.append("the key is neither RSA nor ECDSA")
    try:
        usage = certificate.extensions.get_extension_for_class(KeyUsage).value
    except ExtensionNotFound:
        return found
    if not (usage.digital_signature or usage.content_commitment):
        found.append("the certificate is not for signatures (its key usage)")
    return found


def is_test(certificate: Certificate) -> bool:
    """Whether a certificate is marked as a test's, by its extension or in its subject."""
    from cryptography.x509.oid import ObjectIdentifier

    marked = any(extension.oid == ObjectIdentifier(TEST_OID) for extension in certificate.extensions)
    return marked or TEST_WORDS in called(certificate.subject)


def called(name: Name) -> str:
    """The common name, else all of a name."""
    from cryptography.x509.oid import NameOID

    common = name.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(common[0].value) if common else name.rfc4514_string()


def _day(time: dt.datetime) -> str:
    return time.date().isoformat()
