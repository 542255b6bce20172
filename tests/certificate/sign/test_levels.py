"""Levels of PAdES: what a time stamp server and revocation lists on this machine make of a signature; wrong answers."""

from __future__ import annotations

import datetime as dt
import io
import socket
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import AuthorityInformationAccessOID, ExtendedKeyUsageOID

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign import FileSignature, Level, Stamping, Trust, sign_pdf, signatures_of_pdf
from tests.certificate.sign.authority import LAST, SIGNED, Held, curve_key, issued, root, usage
from tests.certificate.sign.responders import REPLY, revocations, serving, stamps, status

STAMPED = SIGNED + dt.timedelta(seconds=7)


@dataclass(frozen=True)
class World:
    """An authority whose revocation lists are served, a signer and a time stamp server below it."""

    url: str
    anchor: Held
    signer: Held
    trust: Trust

    def signed(self, pdf: bytes, level: Level) -> bytes:
        stamping = Stamping(f"{self.url}/stamps", level, self.trust)
        return sign_pdf(pdf, self.signer.signer, seal=None, at=SIGNED, stamping=stamping)


@pytest.fixture(scope="module")
def world(rsa_key: rsa.RSAPrivateKey) -> Iterator[World]:
    anchor, answers = root("Served Root"), {}
    with serving(answers) as url:
        listed = (x509.CRLDistributionPoints([
            x509.DistributionPoint([x509.UniformResourceIdentifier(f"{url}/revocations")], None, None, None)
        ]), False)  # fmt: skip
        signer = issued("C. Schmid", curve_key(), anchor, further=(listed,))
        stamper = issued("Time", rsa_key, anchor, key_usage=usage(digital_signature=True),
                         further=(listed, (x509.ExtendedKeyUsage([ExtendedKeyUsageOID.TIME_STAMPING]), True)))  # fmt: skip
        answers["/stamps"] = stamps(stamper, STAMPED)
        answers["/revocations"] = lambda _: (200, "application/pkix-crl", revocations(anchor))
        answers["/nonsense"] = lambda _: (200, REPLY, b"nonsense")
        answers["/page"] = lambda _: (200, "text/html", b"<p>Welcome")
        answers["/broken"] = lambda _: (503, "text/html", b"")
        yield World(url, anchor, signer, Trust((anchor.certificate.public_bytes(Encoding.DER),)))


@pytest.mark.parametrize("level", ["B-T", "B-LT", "B-LTA"])
def test_a_level_is_reached_and_found(level: Level, pdf: bytes, world: World) -> None:
    (found,) = signatures_of_pdf(world.signed(pdf, level), world.trust)
    assert found.good
    assert found.level == f"PAdES {level}"
    assert (found.time, found.time_proven) == (STAMPED, True)
    assert found.revocation == ("not known" if level == "B-T" else "good")
    proofs = {} if level == "B-T" else {"1 list of what was revoked": None}
    assert {"a time stamp by Time of 2026-03-02 09:30 UTC": STAMPED, **proofs}.items() <= found.beside.items()


@pytest.mark.parametrize("level", ["B-LT", "B-LTA"])
def test_pyhanko_confirms_it_without_a_network(level: Level, pdf: bytes, world: World) -> None:
    from asn1crypto import x509 as asn1
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature, validate_pdf_timestamp
    from pyhanko.sign.validation.dss import DocumentSecurityStore

    reader = PdfFileReader(io.BytesIO(world.signed(pdf, level)))
    given = {"trust_roots": [asn1.Certificate.load(anchor) for anchor in world.trust.anchors], "allow_fetching": False,
             "moment": STAMPED, "revocation_mode": "require", "retroactive_revinfo": True}  # fmt: skip
    context = DocumentSecurityStore.read_dss(reader).as_validation_context(given)
    status = validate_pdf_signature(reader.embedded_regular_signatures[0], context)
    assert status.bottom_line
    assert status.timestamp_validity.trusted
    for stamp in reader.embedded_timestamp_signatures:
        proven = validate_pdf_timestamp(stamp, context)
        assert (proven.intact, proven.valid, proven.trusted) == (True, True, True)
    assert len(reader.embedded_timestamp_signatures) == (level == "B-LTA")


def test_a_responder_may_say_that_nothing_was_revoked(pdf: bytes, rsa_key: rsa.RSAPrivateKey) -> None:
    """OCSP in place of revocation lists; kept in the file, and read from it when the responder is gone."""
    anchor, answers = root("Answering Root"), {}
    trusting = Trust((anchor.certificate.public_bytes(Encoding.DER),))
    with serving(answers) as url:
        place = x509.AccessDescription(
            AuthorityInformationAccessOID.OCSP, x509.UniformResourceIdentifier(f"{url}/status")
        )
        asked = (x509.AuthorityInformationAccess([place]), False)
        signer = issued("D. Wolf", curve_key(), anchor, further=(asked,))
        stamper = issued("Time", rsa_key, anchor, key_usage=usage(digital_signature=True),
                         further=(asked, (x509.ExtendedKeyUsage([ExtendedKeyUsageOID.TIME_STAMPING]), True)))  # fmt: skip
        answers |= {"/stamps": stamps(stamper, STAMPED), "/status": status(anchor, signer, stamper)}
        stamping = Stamping(f"{url}/stamps", "B-LTA", trusting)
        signed = sign_pdf(pdf, signer.signer, seal=None, at=SIGNED, stamping=stamping)
    (found,) = signatures_of_pdf(signed, trusting)
    assert found.good
    assert (found.level, found.revocation) == ("PAdES B-LTA", "good")


def test_who_does_not_trust_the_time_stamp_has_only_the_signers_word(
    pdf: bytes, world: World, rsa_key: rsa.RSAPrivateKey
) -> None:
    other = root("Root of the time stamps")
    stamper = issued("Time", rsa_key, other, key_usage=usage(digital_signature=True),
                     further=((x509.ExtendedKeyUsage([ExtendedKeyUsageOID.TIME_STAMPING]), True),))  # fmt: skip
    with serving({"/": stamps(stamper, STAMPED)}) as url:
        signed = sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED, stamping=Stamping(f"{url}/"))
    (found,) = signatures_of_pdf(signed, world.trust)
    assert not found.time_proven
    assert found.time == SIGNED
    assert found.trusted


def revoked(pdf: bytes, world: World, level: Level, since: dt.datetime) -> FileSignature:
    given = Trust(world.trust.anchors, (revocations(world.anchor, (world.signer.certificate.serial_number, since)),))
    signed = world.signed(pdf, level) if level != "B-B" else sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED)
    (found,) = signatures_of_pdf(signed, given)
    return found


def test_a_certificate_that_was_revoked_before_does_not_count(pdf: bytes, world: World) -> None:
    found = revoked(pdf, world, "B-T", SIGNED - dt.timedelta(hours=1))
    assert found.revocation == "revoked"
    assert not found.trusted


def test_one_that_was_revoked_afterwards_counts_only_where_a_time_stamp_proves_it(pdf: bytes, world: World) -> None:
    later = SIGNED + dt.timedelta(hours=1)
    assert revoked(pdf, world, "B-T", later).trusted
    assert not revoked(pdf, world, "B-B", later).trusted


def test_a_list_that_names_nobody_says_that_the_certificate_is_good(pdf: bytes, world: World) -> None:
    given = Trust(world.trust.anchors, (revocations(world.anchor),))
    (found,) = signatures_of_pdf(sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED), given)
    assert found.revocation == "good"
    assert found.good


@pytest.mark.parametrize(("path", "why"), [
    ("/nonsense", "something else than a time stamp"), ("/page", "something else than a time stamp"),
    ("/broken", "answers 503"),
])  # fmt: skip
def test_a_server_that_answers_wrongly_is_named(path: str, why: str, pdf: bytes, world: World) -> None:
    stamping = Stamping(world.url + path, "B-T", world.trust)
    with pytest.raises(CmmUqError, match=why) as refused:
        sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED, stamping=stamping)
    assert refused.value.where == world.url + path


def test_a_server_that_is_not_there_is_named(pdf: bytes, world: World) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, and never listening
        url = f"http://127.0.0.1:{taken.getsockname()[1]}/"
        with pytest.raises(CmmUqError, match="does not answer"):
            sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED, stamping=Stamping(url))


def test_proof_for_the_long_term_needs_somebody_trusted(pdf: bytes, world: World) -> None:
    with pytest.raises(CmmUqError, match="cannot be proven"):
        sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED, stamping=Stamping(f"{world.url}/stamps", "B-LT"))


def test_a_stamp_proves_that_it_was_signed_while_the_certificate_was_in_date(
    pdf: bytes, world: World, rsa_key: rsa.RSAPrivateKey
) -> None:
    """The signer's own date lies inside, the stamp's after the end."""
    stamper = issued("Time", rsa_key, world.anchor, key_usage=usage(digital_signature=True),
                     last=LAST + dt.timedelta(days=900),
                     further=((x509.ExtendedKeyUsage([ExtendedKeyUsageOID.TIME_STAMPING]), True),))  # fmt: skip
    late = LAST + dt.timedelta(days=10)
    with serving({"/": stamps(stamper, late)}) as url:
        signed = sign_pdf(pdf, world.signer.signer, seal=None, at=SIGNED, stamping=Stamping(f"{url}/"))
    (found,) = signatures_of_pdf(signed, world.trust)
    assert found.time == late
    assert "was not valid on" in found.problems[0]
