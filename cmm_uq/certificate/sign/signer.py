"""Who signs: a certificate and a key that only signs, of a PKCS#12 file, on a PKCS#11 token (RFC 7512), or made for trying."""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import parse_qsl, unquote

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import KEY_BYTES, content_of
from cmm_uq.base.messages import say
from cmm_uq.base.values import dataclass, field
from cmm_uq.certificate.sign.found import installed

if TYPE_CHECKING:
    from cryptography.x509 import Certificate, Name

TEST_WORDS = "TEST KEY"  # what the subject of a test key begins with
TEST_OID = "2.25.252645135011245891322374512867431283711"
"""Of the extension that marks a test key, below the arc of numbers that anybody may draw (ITU-T X.667)."""

TEST_NOTE = say("signed with a test key: it proves nothing, and anybody can make one")
LEAST_RSA, LEAST_EC = 2048, 256  # bits of a key that still counts (ETSI TS 119 312, NIST SP 800-131A)
ONE_DIGEST = "sha256"  # digest of whatever is signed here


@dataclass(frozen=True)
class Signer:
    certificate: Certificate
    chain: tuple[Certificate, ...]  # certificates above it, nearest first; without the root where nobody gave it
    algorithm: Literal["rsa", "ecdsa"]
    # signature of data with SHA-256: RSASSA-PKCS1-v1_5, or ECDSA as DER
    signed: Callable[[bytes], bytes] = field(repr=False)
    where: str = ""  # the key is kept, for messages

    @property
    def name(self) -> str:
        """Who signs, as the certificate calls them."""
        return called(self.certificate.subject)

    @property
    def test_key(self) -> bool:
        return is_test(self.certificate)

    @property
    def bits(self) -> int:
        size: int = getattr(self.certificate.public_key(), "key_size", 0)
        return size

    def check(self, at: dt.datetime) -> None:
        """Refuse to sign with what no one could accept."""
        first, last = self.certificate.not_valid_before_utc, self.certificate.not_valid_after_utc
        if at < first:
            raise CmmUqError(f"its certificate is valid only from {first.date().isoformat()}", where=self.where,
                             fix="Wait, or sign with another key")  # fmt: skip
        if at > last:
            raise CmmUqError(f"its certificate expired on {last.date().isoformat()}", where=self.where,
                             fix="Renew it, or sign with another key")  # fmt: skip
        for why in unfit(self.certificate):
            raise CmmUqError(why, where=self.where, fix="Ask for a certificate for electronic signatures or seals")


def signing(key: object, where: str) -> tuple[Literal["rsa", "ecdsa"], Callable[[bytes], bytes]]:
    """How a private key in memory signs."""
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


TEST_DAYS = 365  # how long a test key is valid
LONGEST_NAME = 64 - len(f"{TEST_WORDS} – ")  # characters of a name (X.520, ub-common-name)


def signer_of_file(path: Path, passphrase: str) -> Signer:
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
    key: bytes  # with its certificate, PKCS#12
    certificate: bytes  # PEM
    until: dt.date  # last day that it is valid


def trial_key(name: str, passphrase: str, at: dt.datetime) -> TrialKey:
    """A new key for trying, with a certificate that it signs itself and that says so."""
    if not 0 < len(name.strip()) <= LONGEST_NAME:
        problem = f"a name has 1 to {LONGEST_NAME} characters"
        raise CmmUqError(problem, where="--name", fix="Name the laboratory or person")
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
    note = str(TEST_NOTE).encode()
    marked = bytes((0x0C, len(note))) + note  # a UTF8String of DER with fewer than 128 bytes
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject).issuer_name(subject).public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(at).not_valid_after(at + dt.timedelta(days=TEST_DAYS))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.UnrecognizedExtension(ObjectIdentifier(TEST_OID), marked), critical=False)
    )  # fmt: skip
    certificate = builder.sign(key, hashes.SHA256())
    key_file = pkcs12.serialize_key_and_certificates(
        name.strip().encode(), key, certificate, None, serialization.BestAvailableEncryption(passphrase.encode())
    )
    pem = certificate.public_bytes(serialization.Encoding.PEM)
    return TrialKey(key_file, pem, certificate.not_valid_after_utc.date())


SCHEME = "pkcs11:"
KNOWN = ("token", "object", "module-path")
_EXAMPLE = f"{SCHEME}token=LABORATORY;object=KEY?module-path=/usr/lib/libsofthsm2.so"


@dataclass(frozen=True)
class TokenPlace:
    module: str  # library of the token's maker
    token: str  # label
    key: str  # label of the key and its certificate


def place_of(uri: str) -> TokenPlace:
    path, _, query = uri.removeprefix(SCHEME).partition("?")
    pairs = [*parse_qsl(path.replace(";", "&")), *parse_qsl(query)]
    parts = {name: unquote(value) for name, value in pairs}
    for name in parts:
        if name in ("pin-value", "pin-source"):
            raise CmmUqError("a PIN does not stand on the command line", where=name,
                             fix="Leave it out: it is asked for, or read from CMM_UQ_SIGN_PASSPHRASE_FILE")  # fmt: skip
        if name not in KNOWN:
            raise CmmUqError(f"{name!r} is not known in the place of a key", where=SCHEME, fix=suggestion(name, KNOWN))
    for name in KNOWN:
        if not parts.get(name):
            raise CmmUqError(f"says no {name}", where=uri, fix=f"As {_EXAMPLE}")
    return TokenPlace(parts["module-path"], parts["token"], parts["object"])


def signer_of_token(uri: str, pin: str) -> Signer:
    """The token is opened for every use, so that nobody finds it open; the private key stays where it is."""
    with installed():
        from cryptography.x509 import load_der_x509_certificate
        from pkcs11 import Attribute, KeyType, Mechanism, ObjectClass
        from pkcs11.util.ec import encode_ecdsa_signature
    place = place_of(uri)
    opened = partial(_opened, place, pin, uri)

    def by_rsa(data: bytes) -> bytes:
        with opened() as (_, key):
            return bytes(key.sign(data, mechanism=Mechanism.SHA256_RSA_PKCS))

    def by_ecdsa(data: bytes) -> bytes:
        """Signature of an ECDSA key, which draws a number for each."""
        with opened() as (_, key):
            return bytes(encode_ecdsa_signature(key.sign(sha256(data).digest(), mechanism=Mechanism.ECDSA)))

    with opened() as (session, key):
        sort = key.key_type
        kept = [(str(one[Attribute.LABEL]), load_der_x509_certificate(bytes(one[Attribute.VALUE])))
                for one in session.get_objects({Attribute.CLASS: ObjectClass.CERTIFICATE})]  # fmt: skip
    certificate = next((one for label, one in kept if label == place.key), None)
    if certificate is None:
        raise CmmUqError(f"the token has no certificate {place.key!r}", where=uri,
                         fix="Put the certificate of the key beside it, under the same label")  # fmt: skip
    chain = [certificate]  # nearest first
    while issuer := next((one for _, one in kept if one.subject == chain[-1].issuer and one not in chain), None):
        chain.append(issuer)
    if sort == KeyType.RSA:
        return Signer(certificate, tuple(chain[1:]), "rsa", by_rsa, where=uri)
    if sort == KeyType.EC:
        return Signer(certificate, tuple(chain[1:]), "ecdsa", by_ecdsa, where=uri)
    raise CmmUqError("the key is neither RSA nor ECDSA", where=uri, fix="Sign with an RSA or ECDSA key")


@contextlib.contextmanager
def _opened(place: TokenPlace, pin: str, uri: str) -> Iterator[tuple[Any, Any]]:
    """A session and its private key; whatever goes wrong in it in one line."""
    import pkcs11
    from pkcs11 import exceptions

    def refused(problem: str, fix: str) -> CmmUqError:
        return CmmUqError(problem, where=uri, fix=fix)

    try:
        token = pkcs11.lib(place.module).get_token(token_label=place.token)
        with token.open(user_pin=pin) as session:
            yield session, session.get_key(object_class=pkcs11.ObjectClass.PRIVATE_KEY, label=place.key)
    except exceptions.PinIncorrect:
        raise refused("the PIN does not open the token", "Mind how often it may be wrong") from None
    except (exceptions.NoSuchToken, exceptions.TokenNotPresent):
        raise refused(f"no token {place.token!r} is there", "Put it in") from None
    except exceptions.NoSuchKey:
        raise refused(f"the token has no key {place.key!r}", "Name the label of its key") from None
    except (exceptions.PKCS11Error, OSError, RuntimeError, ValueError) as error:
        problem = f"the token cannot be used: {str(error) or type(error).__name__}"
        raise refused(problem, "Check module, token and the use of its key") from None
