"""Keys on a PKCS#11 token (a card, a stick, an HSM), named by a URI (RFC 7512); the private key never leaves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import parse_qsl, unquote

from cmm_uq.errors import CmmUqError, suggestion
from cmm_uq.signing.extra import installed
from cmm_uq.signing.signer import Signer

SCHEME = "pkcs11:"
KNOWN = ("token", "object", "module-path")

_EXAMPLE = f"{SCHEME}token=LABORATORY;object=KEY?module-path=/usr/lib/libsofthsm2.so"


@dataclass(frozen=True)
class Place:
    """Where a key is.

    Parameters
    ----------
    module : library of the token's maker.
    token : label of the token.
    key : label of the key and its certificate.
    """

    module: str
    token: str
    key: str


def place_of(uri: str) -> Place:
    """Where a URI leads.

    Parameters
    ----------
    uri : ``pkcs11:token=LABEL;object=LABEL?module-path=FILE``; the PIN never stands in it.

    Raises
    ------
    CmmUqError : a part of it is missing or unknown, or it holds a PIN.
    """
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
    return Place(parts["module-path"], parts["token"], parts["object"])


def signer_of_token(uri: str, pin: str) -> Signer:
    """The key on a token.

    Parameters
    ----------
    uri : see :func:`place_of`.
    pin : that opens the token.

    Raises
    ------
    CmmUqError : there is no such module, token, key or certificate, or the PIN is another.
    """
    with installed():
        import pkcs11
        from cryptography.x509 import load_der_x509_certificate
        from pkcs11 import Attribute, ObjectClass, exceptions
    place = place_of(uri)
    try:
        session = pkcs11.lib(place.module).get_token(token_label=place.token).open(user_pin=pin)
        key = session.get_key(object_class=ObjectClass.PRIVATE_KEY, label=place.key)
        found = list(session.get_objects({Attribute.CLASS: ObjectClass.CERTIFICATE, Attribute.LABEL: place.key}))
        certificate = load_der_x509_certificate(found[0][Attribute.VALUE]) if found else None
    except exceptions.PinIncorrect:
        raise CmmUqError("the PIN does not open the token", where=uri, fix="Mind how often it may be wrong") from None
    except (exceptions.NoSuchToken, exceptions.TokenNotPresent):
        raise CmmUqError(f"no token {place.token!r} is there", where=uri, fix="Put it in") from None
    except exceptions.NoSuchKey:
        raise CmmUqError(f"the token has no key {place.key!r}", where=uri, fix="Name the label of its key") from None
    except (exceptions.PKCS11Error, OSError, RuntimeError, ValueError) as error:
        why = str(error) or type(error).__name__
        raise CmmUqError(f"the token cannot be used: {why}", where=uri, fix="Check module and token") from None
    if certificate is None:
        raise CmmUqError(f"the token has no certificate {place.key!r}", where=uri,
                         fix="Put the certificate of the key beside it, under the same label")  # fmt: skip
    algorithm, signed = _signing(key, uri)
    return Signer(certificate, (), algorithm, signed, where=uri)


def _signing(key: Any, uri: str) -> tuple[Literal["rsa", "ecdsa"], Callable[[bytes], bytes]]:
    """How a key of a token signs; an ECDSA key draws a number for every signature."""
    from hashlib import sha256

    from pkcs11 import KeyType, Mechanism, exceptions
    from pkcs11.util.ec import encode_ecdsa_signature

    def asked(sign: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
        def signed(data: bytes) -> bytes:
            try:
                return sign(data)
            except exceptions.PKCS11Error as error:
                why = str(error) or type(error).__name__
                raise CmmUqError(f"the token does not sign: {why}", where=uri, fix="Check the key's use") from None

        return signed

    if key.key_type == KeyType.RSA:
        return "rsa", asked(lambda data: bytes(key.sign(data, mechanism=Mechanism.SHA256_RSA_PKCS)))
    if key.key_type == KeyType.EC:
        return "ecdsa", asked(
            lambda data: bytes(encode_ecdsa_signature(key.sign(sha256(data).digest(), mechanism=Mechanism.ECDSA)))
        )
    raise CmmUqError("the key is neither RSA nor ECDSA", where=uri, fix="Sign with an RSA or ECDSA key")
