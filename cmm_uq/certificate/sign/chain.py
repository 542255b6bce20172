"""Whether a certificate leads to somebody trusted, was in date, for signing and not revoked; nothing is fetched for it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from asn1crypto import cms, crl, ocsp, x509
from cryptography import x509 as certificates
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.padding import PKCS1v15
from cryptography.x509 import ocsp as responses
from pyhanko.sign.general import extract_certificate_info
from pyhanko.sign.validation.generic_cms import validate_tst_signed_data
from pyhanko_certvalidator import CertificateValidator, ValidationContext
from pyhanko_certvalidator.errors import InvalidCertificateError, PathBuildingError, PathValidationError, RevokedError

from cmm_uq.base.messages import Text, Verbatim, commas, day, say
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.sign.found import NOBODY, FileSignature, Revocation, Trust, ran
from cmm_uq.certificate.sign.signer import is_test, unfit

NO_TIME = say("the signature says no time, so that nobody knows whether its certificate was in date")
UNTRUSTED = say("no chain of certificates leads from the signer to anybody who is trusted")
REVOKED = say("the certificate was revoked")
UNREADABLE = say("the certificate cannot be read")
SPOILT = say("a certificate that comes with the signature was changed")


@dataclass(frozen=True)
class Evidence:
    """What a file brings along for its signatures."""

    certificates: tuple[x509.Certificate, ...] = ()  # above the signers'
    revocations: tuple[crl.CertificateList, ...] = ()
    answers: tuple[ocsp.OCSPResponse, ...] = ()
    others: tuple[cms.SignedData, ...] = ()  # time stamps and further signatures that it is for as well


def judged(signature: FileSignature, certificate: x509.Certificate, evidence: Evidence, trust: Trust) -> FileSignature:
    """A signature with whom its certificate names, and what holds of them when it was made; its own problems stand first."""
    subject, at, found = certificate.subject, signature.time, list(signature.problems)
    signature = replace(
        signature, subject=subject.human_friendly, issuer=certificate.issuer.human_friendly, name=_named(subject),
        beside=dict(_beside(evidence)),
    )  # fmt: skip
    try:
        signer = certificates.load_der_x509_certificate(certificate.dump())
        reasons, test = unfit(signer), is_test(signer)
    except ValueError:
        return replace(signature, problems=(*found, UNREADABLE))
    found += map(Verbatim, reasons)
    if _spoilt(evidence, trust):
        found.append(SPOILT)
    elif further := list(dict.fromkeys(_unaccounted(certificate, evidence, trust))):
        what = commas([Verbatim(name) for name in further])
        found.append(say("what comes with the signature belongs to no chain of its certificates: {what}", what=what))
    if at is None:
        return replace(signature, test_key=test, problems=(*found, NO_TIME))
    if not signer.not_valid_before_utc <= at <= signer.not_valid_after_utc:
        first, last = day(signer.not_valid_before_utc.date()), day(signer.not_valid_after_utc.date())
        found.append(say("the certificate was not valid on {day}: it is from {first} to {last}", day=day(at.date()),
                         first=first, last=last))  # fmt: skip
    trusted, revocation, why = _path(certificate, evidence, trust, at)
    if revocation != "revoked" and not signature.time_proven and _listed(certificate, evidence, trust):
        revocation = "revoked"
    if not trusted:
        found.append(why)
    if revocation == "revoked" and REVOKED not in found:
        found.append(REVOKED)
    return replace(signature, trusted=trusted and revocation != "revoked", revocation=revocation, test_key=test,
                   problems=tuple(found))  # fmt: skip


def _named(subject: x509.Name) -> str:
    return str(subject.native.get("common_name", subject.human_friendly))


def _beside(evidence: Evidence) -> Iterator[tuple[str, dt.datetime | None]]:
    """What a file may bring along beside its signatures, in words."""
    for one in evidence.others:
        if (inner := one["encap_content_info"])["content_type"].native == "tst_info":
            by, at = extract_certificate_info(one).signer_cert.subject, inner["content"].parsed["gen_time"].native
            yield f"a time stamp by {_named(by)} of {at:%Y-%m-%d %H:%M} UTC", at
    counts = {"certificate": evidence.certificates, "list of what was revoked": evidence.revocations,
              "answer on what was revoked": evidence.answers}  # fmt: skip
    for what, several in counts.items():
        if several:
            first, _, rest = what.partition(" ")
            yield f"{len(several)} {first}{'s' if len(several) > 1 else ''} {rest}".rstrip(), None


def _issued(certificate: certificates.Certificate, issuer: certificates.Certificate) -> bool:
    try:
        certificate.verify_directly_issued_by(issuer)
    except (ValueError, TypeError, InvalidSignature, UnsupportedAlgorithm):
        return False
    return True


def _unaccounted(certificate: x509.Certificate, evidence: Evidence, trust: Trust) -> Iterator[str]:
    """Names of what no signature covers and no chain from a signer, a time stamp or a responder needs; of issuers of lists."""
    load = certificates.load_der_x509_certificate
    yield from (name for one in evidence.others for name in _further(one))
    signed = [extract_certificate_info(one) for one in evidence.others if len(one["certificates"])]
    answers = [answer for one in evidence.answers if (answer := _answer(one)) is not None]
    known = {load(certificate.dump()), *(load(one.signer_cert.dump()) for one in signed)}
    beside = {load(one.dump()) for one in (*evidence.certificates, *(c for one in signed for c in one.other_certs))}
    beside |= {one for answer in answers for one in answer.certificates}
    lists = [certificates.load_der_x509_crl(one.dump()) for one in evidence.revocations]
    anchors = set(map(load, trust.anchors))

    def speaks(one: certificates.Certificate) -> bool:
        """Whether somebody known had it issued to answer or to list what was revoked, and it does."""
        by = any(_issued(one, issuer) for issuer in known | anchors)
        return by and (
            any(_answered(answer, one) for answer in answers) or any(_listed_by(one, each) for each in lists)
        )

    while more := {one for one in beside - known if any(_issued(below, one) for below in known) or speaks(one)}:
        known |= more
    yield from (one.subject.rfc4514_string() for one in beside - known)
    above = known | anchors
    unnamed = set() if anchors else {one.issuer for one in known} - {one.subject for one in known}  # nobody can look
    strange = (one for one in lists if one.issuer not in unnamed and not any(_listed_by(by, one) for by in above))
    yield from (one.issuer.rfc4514_string() for one in strange)
    serials = {one.serial_number for one in above}
    owned = [one for one in answers if one.serial_number in serials and any(_answered(one, by) for by in above)]
    yield from ["OCSP"] * (len(evidence.answers) - len(owned))


def _further(signed: cms.SignedData) -> Iterator[str]:
    """Parts of a CMS that its signature does not cover, but for certificates and one time stamp (RFC 5652, 5)."""
    inner = signed["encap_content_info"]["content_type"].native == "tst_info"
    allowed = () if inner else ("signature_time_stamp_token",)
    for info in signed["signer_infos"]:
        kinds = [one["type"].native for one in info["unsigned_attrs"]]
        yield from (
            "unsignedAttrs"
            for one, kind in zip(info["unsigned_attrs"], kinds, strict=True)
            if kind not in allowed or kinds.count(kind) > 1 or len(one["values"]) > 1
        )
    digests = [signed["signer_infos"][0]["digest_algorithm"], *signed["digest_algorithms"]]
    if len(digests) != 2 or any(one["parameters"].native is not None for one in digests):
        yield "digestAlgorithms"
    if len(signed["signer_infos"]) > 1:
        yield "signerInfos"
    if len(signed["crls"]) or any(one.name != "certificate" for one in signed["certificates"]):
        yield "crls"


def _answer(response: ocsp.OCSPResponse) -> responses.OCSPResponse | None:
    """An answer about one certificate; ``None`` for what answers nothing."""
    try:
        answer = responses.load_der_ocsp_response(response.dump())
        return answer if answer.serial_number else None
    except ValueError:
        return None


def _listed_by(issuer: certificates.Certificate, revoked: certificates.CertificateRevocationList) -> bool:
    key: Any = issuer.public_key()
    try:
        return revoked.issuer == issuer.subject and revoked.is_signature_valid(key)
    except (TypeError, ValueError, UnsupportedAlgorithm):
        return False


def _answered(answer: responses.OCSPResponse, responder: certificates.Certificate) -> bool:
    key, digest = responder.public_key(), answer.signature_hash_algorithm or hashes.SHA256()
    how: tuple[Any, ...] = (ec.ECDSA(digest),) if isinstance(key, ec.EllipticCurvePublicKey) else (PKCS1v15(), digest)
    try:
        key.verify(answer.signature, answer.tbs_response_bytes, *how)  # type: ignore[union-attr]
    except (InvalidSignature, TypeError, ValueError, AttributeError, UnsupportedAlgorithm):
        return False
    return True


def _spoilt(evidence: Evidence, trust: Trust) -> bool:
    """Whether a certificate that no signature covers is not as its issuer, who is known here too, has signed it."""
    encoded = [certificate.dump() for certificate in evidence.certificates]
    try:
        known = [certificates.load_der_x509_certificate(data) for data in {*encoded, *trust.anchors}]
        for certificate in map(certificates.load_der_x509_certificate, encoded):
            issuers = [issuer for issuer in known if issuer.subject == certificate.issuer]
            if issuers and not any(_issued(certificate, issuer) for issuer in issuers):
                return True
    except ValueError:
        return True
    return False


def _path(
    certificate: x509.Certificate, evidence: Evidence, trust: Trust, at: dt.datetime
) -> tuple[bool, Revocation, Text]:
    """Whether a chain holds at a time, what is known of revocation, and why it does not hold."""
    if not trust.anchors:
        return False, "not known", NOBODY

    def validate(mode: str) -> None:
        validator = CertificateValidator(certificate, validation_context=context(evidence, trust, at, mode))
        ran(validator.async_validate_path())

    try:
        validate("require")
    except RevokedError:
        return False, "revoked", REVOKED
    except InvalidCertificateError:  # signed by itself, and not trusted
        return False, "not known", UNTRUSTED
    except (PathBuildingError, PathValidationError):
        pass
    else:  # a certificate that is trusted itself has nobody above it who could revoke it
        return True, "not known" if certificate.dump() in trust.anchors else "good", UNTRUSTED
    try:
        validate("soft-fail")
    except RevokedError:
        return False, "revoked", REVOKED
    except PathBuildingError:
        return False, "not known", UNTRUSTED
    except PathValidationError as error:
        why = Verbatim(str(error).rstrip("."))
        return False, "not known", say("the chain of certificates does not hold: {why}", why=why)
    return True, "not known", UNTRUSTED


def context(evidence: Evidence, trust: Trust, at: dt.datetime, mode: str = "soft-fail") -> ValidationContext:
    """What certificates are judged by at a time; nothing is fetched."""
    return ValidationContext(
        trust_roots=[x509.Certificate.load(anchor) for anchor in trust.anchors],
        other_certs=list(evidence.certificates), crls=[one.dump() for one in _lists(evidence, trust)],
        ocsps=[one.dump() for one in evidence.answers], allow_fetching=False, moment=at, revocation_mode=mode,
        retroactive_revinfo=True, weak_hash_algos={"md2", "md5", "sha1"},
    )  # fmt: skip


def _lists(evidence: Evidence, trust: Trust) -> Sequence[crl.CertificateList]:
    return [*evidence.revocations, *(crl.CertificateList.load(data) for data in trust.revocations)]


def _listed(certificate: x509.Certificate, evidence: Evidence, trust: Trust) -> bool:
    """Whether a list of the issuer names the certificate, whenever that was."""
    lists = (one["tbs_cert_list"] for one in _lists(evidence, trust) if one.issuer == certificate.issuer)
    revoked = (each for one in lists for each in one["revoked_certificates"].native or ())
    return any(each["user_certificate"] == certificate.serial_number for each in revoked)


def stamped_time(
    token: cms.SignedData, imprint: Callable[[str], bytes], evidence: Evidence, trust: Trust
) -> tuple[dt.datetime | None, bool]:
    """Time of a time stamp, where that fits what it is to be of, and whether somebody trusted made it."""
    at = token["encap_content_info"]["content"].parsed["gen_time"].native
    status = ran(validate_tst_signed_data(token, context(evidence, trust, at), imprint))
    if not (status["intact"] and status["valid"]):
        return None, False
    return at, bool(status.get("trust_problem_indic") is None and status.get("validation_path") is not None)
