"""Whether a certificate leads to somebody trusted, was in date, for signing and not revoked; nothing is fetched for it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from asn1crypto import cms, crl, ocsp, x509
from cryptography import x509 as certificates
from cryptography.exceptions import InvalidSignature
from pyhanko.sign.validation.generic_cms import validate_tst_signed_data
from pyhanko_certvalidator import CertificateValidator, ValidationContext
from pyhanko_certvalidator.errors import InvalidCertificateError, PathBuildingError, PathValidationError, RevokedError

from cmm_uq.base.messages import Text, Verbatim, day, say
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


def judged(signature: FileSignature, certificate: x509.Certificate, evidence: Evidence, trust: Trust) -> FileSignature:
    """A signature with whom its certificate names, and what holds of them when it was made; its own problems stand first."""
    subject, at, found = certificate.subject, signature.time, list(signature.problems)
    signature = replace(
        signature, subject=subject.human_friendly, issuer=certificate.issuer.human_friendly,
        name=str(subject.native.get("common_name", subject.human_friendly)),
    )  # fmt: skip
    try:
        signer = certificates.load_der_x509_certificate(certificate.dump())
        reasons, test = unfit(signer), is_test(signer)
    except ValueError:
        return replace(signature, problems=(*found, UNREADABLE))
    found += map(Verbatim, reasons)
    if _spoilt(evidence, trust):
        found.append(SPOILT)
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


def _spoilt(evidence: Evidence, trust: Trust) -> bool:
    """Whether a certificate that no signature covers is not as its issuer, who is known here too, has signed it."""

    def signed(certificate: certificates.Certificate, issuer: certificates.Certificate) -> bool:
        try:
            certificate.verify_directly_issued_by(issuer)
        except (ValueError, TypeError, InvalidSignature):
            return False
        return True

    encoded = [certificate.dump() for certificate in evidence.certificates]
    try:
        known = [certificates.load_der_x509_certificate(data) for data in {*encoded, *trust.anchors}]
        for certificate in map(certificates.load_der_x509_certificate, encoded):
            issuers = [issuer for issuer in known if issuer.subject == certificate.issuer]
            if issuers and not any(signed(certificate, issuer) for issuer in issuers):
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
    return any(
        revoked["user_certificate"] == certificate.serial_number
        for one in _lists(evidence, trust)
        if one.issuer == certificate.issuer
        for revoked in one["tbs_cert_list"]["revoked_certificates"].native or ()
    )


def stamped_time(
    token: cms.SignedData, imprint: Callable[[str], bytes], evidence: Evidence, trust: Trust
) -> tuple[dt.datetime | None, bool]:
    """Time of a time stamp, where that fits what it is to be of, and whether somebody trusted made it."""
    at = token["encap_content_info"]["content"].parsed["gen_time"].native
    status = ran(validate_tst_signed_data(token, context(evidence, trust, at), imprint))
    if not (status["intact"] and status["valid"]):
        return None, False
    return at, bool(status.get("trust_problem_indic") is None and status.get("validation_path") is not None)
