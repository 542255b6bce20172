"""Authorities, keys and signed files made for the study, and signers whom nobody should believe."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

from asn1crypto import x509 as asn1
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID, ObjectIdentifier

from cmm_uq.certificate.render import render_pdf
from cmm_uq.certificate.sign import Stamping, Trust, sign_pdf, sign_xml
from cmm_uq.certificate.sign.signer import Signer
from tests.certificate.samples import ballbar_certificate
from tests.certificate.sign.authority import LAST, SIGNED, Held, curve_key, issued, root, usage
from tests.certificate.sign.responders import revocations, serving, stamps

STAMPED = SIGNED + dt.timedelta(seconds=7)
XML = """<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" schemaVersion="3.2.1">
  <dcc:administrativeData id="a">Prüfling</dcc:administrativeData>
  <si:real><si:value>73.2</si:value><si:unit>\\micro\\metre</si:unit></si:real>
</dcc:digitalCalibrationCertificate>
""".encode()


class Careless(Signer):
    """Signs whatever its certificate says."""

    def check(self, at: dt.datetime) -> None:
        pass


def careless(held: Held) -> Careless:
    return Careless(**{name: getattr(held.signer, name) for name in held.signer.__dataclass_fields__})


@dataclass(frozen=True)
class World:
    """An authority that is trusted, a signer and a time stamp server below it, and one of nobody."""

    url: str
    anchor: Held
    between: Held
    signer: Held
    stamper: Held
    pdf: bytes

    @property
    def trust(self) -> Trust:
        return Trust((self.anchor.certificate.public_bytes(Encoding.DER),))

    @cache  # noqa: B019 - one world lives as long as the study
    def signed(self, form: str, level: str = "B-B", twice: bool = False) -> bytes:
        """The document signed as it should be."""
        if form == "xml":
            return sign_xml(XML, self.signer.signer, at=SIGNED)
        stamping: Any = None if level == "B-B" else Stamping(f"{self.url}/stamps", level, self.trust)  # type: ignore[arg-type]
        signed = sign_pdf(self.pdf, self.signer.signer, seal=None, at=SIGNED, stamping=stamping)
        return sign_pdf(signed, self.signer.signer, seal=None, at=STAMPED) if twice else signed

    def by(self, held: Held, form: str, at: dt.datetime = SIGNED) -> bytes:
        """The document signed by whomever."""
        signer = careless(held)
        return sign_xml(XML, signer, at=at) if form == "xml" else sign_pdf(self.pdf, signer, seal=None, at=at)


def stamping(name: str, above: Held, key: Any, *further: tuple[Any, bool]) -> Held:
    purpose = (x509.ExtendedKeyUsage([ExtendedKeyUsageOID.TIME_STAMPING]), True)
    return issued(name, key, above, key_usage=usage(digital_signature=True), further=(*further, purpose))


@contextmanager
def world() -> Iterator[World]:
    """One, with its server; keys are new each time."""
    anchor, answers = root(), {}
    with serving(answers) as url:
        place = x509.DistributionPoint([x509.UniformResourceIdentifier(f"{url}/revocations")], None, None, None)
        listed = (x509.CRLDistributionPoints([place]), False)
        between = issued("Test Issuer", curve_key(), anchor, authority=True, further=(listed,))
        below = x509.DistributionPoint([x509.UniformResourceIdentifier(f"{url}/below")], None, None, None)
        signer = issued("A. Huber", curve_key(), between, further=((x509.CRLDistributionPoints([below]), False),))
        stamper = stamping("Time", anchor, rsa.generate_private_key(65537, 2048), listed)
        nobody = stamping("Time", root(), rsa.generate_private_key(65537, 2048))
        answers["/stamps"], answers["/nobody"] = stamps(stamper, STAMPED), stamps(nobody, STAMPED)
        answers["/revocations"] = lambda _: (200, "application/pkix-crl", revocations(anchor))
        answers["/below"] = lambda _: (200, "application/pkix-crl", revocations(between))
        pdf = render_pdf(ballbar_certificate(), {"job.toml": b"[job]", "results.json": b"{}"})
        yield World(url, anchor, between, signer, stamper, pdf)


Forged = tuple[bytes, Trust]
Impostor = Callable[[World, str], Forged]


def _of(make: Callable[[World], Held], at: dt.datetime = SIGNED) -> Impostor:
    return lambda world, form: (world.by(make(world), form, at), world.trust)


def another_of_the_same_name(world: World) -> Held:
    return issued("A. Huber", curve_key(), issued("Test Issuer", curve_key(), root(), authority=True))


def another_with_the_true_chain(world: World) -> Held:
    false = another_of_the_same_name(world)
    return Held(false.key, false.certificate, world.signer.chain)


def the_true_certificate_and_another_key(world: World) -> Held:
    return Held(curve_key(), world.signer.certificate, world.signer.chain)


def below_a_signer(world: World) -> Held:
    return issued("A. Huber", curve_key(), world.signer)


def below_an_authority_that_may_not_sign(world: World) -> Held:
    above = issued("Test Issuer", curve_key(), world.anchor, authority=True, key_usage=usage(digital_signature=True))
    return issued("A. Huber", curve_key(), above)


def below_what_is_no_authority(world: World) -> Held:
    above = issued("Issuer", curve_key(), world.anchor, key_usage=usage(key_cert_sign=True, digital_signature=True))
    return issued("A. Huber", curve_key(), above)


def below_an_expired_authority(world: World) -> Held:
    last = SIGNED - dt.timedelta(days=1)
    return issued("A. Huber", curve_key(), issued("Issuer", curve_key(), world.anchor, authority=True, last=last))


def expired(world: World) -> Held:
    return issued("A. Huber", curve_key(), world.between, last=SIGNED - dt.timedelta(hours=1))


def not_yet_valid(world: World) -> Held:
    return issued("A. Huber", curve_key(), world.between, first=SIGNED + dt.timedelta(hours=1))


def for_encryption(world: World) -> Held:
    return issued("A. Huber", curve_key(), world.between, key_usage=usage(key_encipherment=True))


def for_a_web_server(world: World) -> Held:
    purpose = (x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), True)
    return issued("A. Huber", curve_key(), world.between, key_usage=usage(key_agreement=True), further=(purpose,))


def signed_by_itself(world: World) -> Held:
    return issued("A. Huber", curve_key())


def an_authority_of_its_own(world: World) -> Held:
    return issued("Test Root", curve_key(), authority=True)


def of_a_short_key(world: World) -> Held:
    return issued("A. Huber", rsa.generate_private_key(65537, 1024), world.between)


def of_a_small_curve(world: World) -> Held:
    return issued("A. Huber", ec.generate_private_key(ec.SECP192R1()), world.between)


def with_an_unknown_critical_extension(world: World) -> Held:
    further = (x509.UnrecognizedExtension(ObjectIdentifier("1.3.6.1.4.1.99999.1"), b"\x05\x00"), True)
    return issued("A. Huber", curve_key(), world.between, further=(further,))


def beyond_the_constraints_of_names(world: World) -> Held:
    other = x509.Name([x509.NameAttribute(x509.NameOID.ORGANIZATION_NAME, "Another laboratory")])
    only = (x509.NameConstraints([x509.DirectoryName(other)], None), True)
    return issued("A. Huber", curve_key(), issued("Issuer", curve_key(), world.anchor, authority=True, further=(only,)))


def by_sha_1(world: World) -> Held:
    """Its certificate's signature is of SHA-1, as the libraries no longer make one."""
    made = asn1.Certificate.load(issued("A. Huber", curve_key(), world.between).certificate.public_bytes(Encoding.DER))
    key = curve_key()
    made = asn1.Certificate.load(issued("A. Huber", key, world.between).certificate.public_bytes(Encoding.DER))
    algorithm = asn1.SignedDigestAlgorithm({"algorithm": "sha1_ecdsa"})
    made["tbs_certificate"]["signature"] = algorithm
    made["signature_algorithm"] = algorithm
    made["signature_value"] = world.between.key.sign(made["tbs_certificate"].dump(force=True), ec.ECDSA(hashes.SHA1()))
    return Held(key, x509.load_der_x509_certificate(made.dump(force=True)), (world.between.certificate,))


def revoked(world: World, form: str) -> Forged:
    entry = (world.signer.certificate.serial_number, SIGNED - dt.timedelta(hours=1))
    return world.by(world.signer, form), Trust(world.trust.anchors, (revocations(world.between, entry),))


def revoked_authority(world: World, form: str) -> Forged:
    lists = (revocations(world.anchor, (world.between.certificate.serial_number, SIGNED - dt.timedelta(hours=1))),
             revocations(world.between))  # fmt: skip
    return world.by(world.signer, form), Trust(world.trust.anchors, lists)


def of_a_later_day(world: World, form: str) -> Forged:
    return world.by(world.signer, form, LAST + dt.timedelta(days=2)), world.trust


IMPOSTORS: dict[str, Impostor] = {
    make.__name__: _of(make) for make in (
        another_of_the_same_name, another_with_the_true_chain, the_true_certificate_and_another_key, below_a_signer,
        below_an_authority_that_may_not_sign, below_what_is_no_authority, below_an_expired_authority, expired, not_yet_valid,
        for_encryption, for_a_web_server, signed_by_itself, an_authority_of_its_own, of_a_short_key, of_a_small_curve,
        with_an_unknown_critical_extension, beyond_the_constraints_of_names, by_sha_1,
    )
} | {"revoked": revoked, "revoked_authority": revoked_authority, "of_a_later_day": of_a_later_day}  # fmt: skip
"""Those who sign though they may not; nothing of the file itself is altered."""
