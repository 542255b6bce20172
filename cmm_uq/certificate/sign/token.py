"""Keys on a PKCS#11 token (a card, a stick, an HSM), named by a URI (RFC 7512); the private key never leaves it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, unquote

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.certificate.sign.extra import installed
from cmm_uq.certificate.sign.signer import Signer

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

SCHEME = "pkcs11:"
KNOWN = ("token", "object", "module-path")
_EXAMPLE = f"{SCHEME}token=LABORATORY;object=KEY?module-path=/usr/lib/libsofthsm2.so"


@dataclass(frozen=True)
class TokenPlace:
    """Where a key is."""

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
    with installed():
        from cryptography.x509 import load_der_x509_certificate
        from pkcs11 import Attribute, KeyType, ObjectClass
    token = _Token(place_of(uri), pin, uri)
    with token.opened() as session:
        sort = token.key(session).key_type
        kept = [(str(one[Attribute.LABEL]), load_der_x509_certificate(bytes(one[Attribute.VALUE])))
                for one in session.get_objects({Attribute.CLASS: ObjectClass.CERTIFICATE})]  # fmt: skip
    certificate = next((one for label, one in kept if label == token.place.key), None)
    if certificate is None:
        raise CmmUqError(f"the token has no certificate {token.place.key!r}", where=uri,
                         fix="Put the certificate of the key beside it, under the same label")  # fmt: skip
    chain = _above(certificate, [one for _, one in kept])
    if sort == KeyType.RSA:
        return Signer(certificate, chain, "rsa", token.by_rsa, where=uri)
    if sort == KeyType.EC:
        return Signer(certificate, chain, "ecdsa", token.by_ecdsa, where=uri)
    raise CmmUqError("the key is neither RSA nor ECDSA", where=uri, fix="Sign with an RSA or ECDSA key")


def _above(certificate: Certificate, others: Sequence[Certificate]) -> tuple[Certificate, ...]:
    """Certificates above another, nearest first."""
    found = [certificate]
    while len(found) <= len(others):
        issuer = next((one for one in others if one.subject == found[-1].issuer and one not in found), None)
        if issuer is None:
            break
        found.append(issuer)
    return tuple(found[1:])


class _Token:
    """A token that is opened for every use, so that nobody finds it open."""

    def __init__(self, place: TokenPlace, pin: str, uri: str) -> None:
        self.place, self._pin, self._uri = place, pin, uri

    @contextlib.contextmanager
    def opened(self) -> Iterator[Any]:
        """A session; whatever goes wrong in it in one line."""
        import pkcs11
        from pkcs11 import exceptions

        try:
            token = pkcs11.lib(self.place.module).get_token(token_label=self.place.token)
            with token.open(user_pin=self._pin) as session:
                yield session
        except exceptions.PinIncorrect:
            raise self._refused("the PIN does not open the token", "Mind how often it may be wrong") from None
        except (exceptions.NoSuchToken, exceptions.TokenNotPresent):
            raise self._refused(f"no token {self.place.token!r} is there", "Put it in") from None
        except exceptions.NoSuchKey:
            raise self._refused(f"the token has no key {self.place.key!r}", "Name the label of its key") from None
        except (exceptions.PKCS11Error, OSError, RuntimeError, ValueError) as error:
            why = str(error) or type(error).__name__
            fix = "Check module, token and the use of its key"
            raise self._refused(f"the token cannot be used: {why}", fix) from None

    def _refused(self, problem: str, fix: str) -> CmmUqError:
        return CmmUqError(problem, where=self._uri, fix=fix)

    def key(self, session: Any) -> Any:
        """The private key, which stays where it is."""
        from pkcs11 import ObjectClass

        return session.get_key(object_class=ObjectClass.PRIVATE_KEY, label=self.place.key)

    def by_rsa(self, data: bytes) -> bytes:
        from pkcs11 import Mechanism

        with self.opened() as session:
            return bytes(self.key(session).sign(data, mechanism=Mechanism.SHA256_RSA_PKCS))

    def by_ecdsa(self, data: bytes) -> bytes:
        """Signature of an ECDSA key, which draws a number for each."""
        from pkcs11 import Mechanism
        from pkcs11.util.ec import encode_ecdsa_signature

        with self.opened() as session:
            raw = self.key(session).sign(sha256(data).digest(), mechanism=Mechanism.ECDSA)
            return bytes(encode_ecdsa_signature(raw))
