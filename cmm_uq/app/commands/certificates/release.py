"""A certificate released, withdrawn or replaced by a named person, with date and reason in the chain."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.certificates.reissue import refuse_denial, refuse_unlike
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.jobs.verdicts import NONE, Verdicts
from cmm_uq.laboratory.records.facts import STANDING, RecordedCertificate, spelled

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

TWO_EYES, FOUR_EYES = 1, 2  # how many persons release a certificate
_NONE_YET = "No certificate is recorded yet"
_TOLD, _NEWEST = 4, 2000  # entries that a message names, and certificates that an unknown name is compared with


@dataclass(frozen=True)
class Release:
    """A certificate as it is now, and how many persons more must release it."""

    certificate: RecordedCertificate
    waiting: int = 0


def certificate_named(records: Records, name: str, states: Collection[str]) -> RecordedCertificate:
    """The certificate of a number, entry, job, folder or hash of results.json; where none is in these states, the newest."""
    found = [one for one in records.named(name) if one.command == "report"]
    if not found:
        known = records.certificates(origin=None, values=False, limit=_NEWEST)
        near = suggestion(name, {word for one in known for word in (one.number, one.job) if word}) if known else ""
        if not near.startswith("Did you mean"):
            near = "Give its number, the id of its job, or the number of its entry" if known else _NONE_YET
        raise CmmUqError(f"no certificate {name!r} is recorded", where=records.shown, fix=near)
    asked = [one for one in found if one.state in states]
    if len(asked) > 1:
        entries = ", ".join(f"{one.entry} ({one.machine}, {one.day}, {one.state})" for one in asked[:_TOLD])
        more = f" and {len(asked) - _TOLD} more" if len(asked) > _TOLD else ""
        raise CmmUqError(f"{len(asked)} certificates are called {name!r}", where=records.shown,
                         fix=f"Give the number of the entry: {entries}{more}")  # fmt: skip
    return (asked or found)[-1]


def release(
    records: Records, name: str, *, by: str, reason: str = "", despite: str = "",
    ask: Callable[[str], str] | None = None,
) -> Release:  # fmt: skip
    """Release a certificate, or sign it as the first of two persons."""
    certificate, person = certificate_named(records, name, ("draft",)), _person(by)
    if (why := blocked(certificate)) is not None:
        raise CmmUqError(f"{certificate.number} cannot be released: {why}", where=records.shown)
    content = next(records.entries(certificate.entry)).data
    if missing := content.get("missing"):
        raise CmmUqError(f"{certificate.number} says DRAFT on every page: it does not state {', '.join(missing)}",
                         where=records.shown, fix="State it in job.toml and report again")  # fmt: skip
    refuse_unlike(records, certificate)
    needed = FOUR_EYES if content.get("four_eyes") else TWO_EYES
    maker = str(content.get("operator") or "")
    if needed == FOUR_EYES and spelled(maker) == spelled(person):
        raise CmmUqError(f"{person} made the certificate {certificate.number}, and another must release it",
                         where=records.shown, fix="[laboratory] four_eyes = true asks for others")  # fmt: skip
    signed = {spelled(one.by) for one in records.signatures(certificate.entry) if one.what == "release"}
    if spelled(person) in signed:
        raise CmmUqError(f"{person} has signed the certificate {certificate.number} already", where=records.shown,
                         fix="A second person must")  # fmt: skip
    waiting, further = needed - len(signed) - 1, {}
    if stated := no_pass(certificate, content):
        word = despite.strip() or (ask(f"{certificate.number} states {stated}").strip() if ask else "")
        if not word:
            raise CmmUqError(f"{certificate.number} states {stated}", where=records.shown,
                             fix='Say why it is released all the same: --despite "TEXT"')  # fmt: skip
        further = {"outcome": certificate.decision, "despite": word}
    _sign(records, "release", certificate, person, reason, complete=waiting <= 0, **further)
    return Release(records.certificate(certificate.entry), max(0, waiting))


def withdraw(records: Records, name: str, *, by: str, reason: str, replaced_by: str | None = None) -> Release:
    """Withdraw a certificate, or put another in its place."""
    certificate, person = certificate_named(records, name, STANDING), _person(by)
    if not reason.strip():
        raise CmmUqError(
            "a certificate is withdrawn for a reason", where="--reason", fix="Say it: it stays in the records"
        )
    if certificate.state not in STANDING:
        raise CmmUqError(f"{certificate.number} is {certificate.state} already", where=records.shown)
    if replaced_by is None:
        _sign(records, "withdrawal", certificate, person, reason)
        return Release(records.certificate(certificate.entry))
    other = certificate_named(records, replaced_by, ("released",))
    if other.entry == certificate.entry:
        raise CmmUqError("a certificate does not replace itself", where="--replaced-by", fix="Name the new one's entry")
    if other.state != "released" or other.machine != certificate.machine:
        why = f"is {other.state}" if other.state != "released" else f"is of {other.machine}, not {certificate.machine}"
        raise CmmUqError(
            f"{other.number} {why}", where="--replaced-by", fix="Name a released certificate of this machine"
        )
    refuse_denial(records, certificate, other, reason)
    _sign(records, "replacement", certificate, person, reason, replaced_by=other.entry)
    return Release(records.certificate(certificate.entry))


def blocked(certificate: RecordedCertificate) -> str | None:
    """Why a certificate must not be released; ``None`` where nothing stands against it."""
    if certificate.origin != "measured":
        return f"its recording is {certificate.origin}"
    if certificate.interim:
        return "it is an interim check and no certificate"
    if certificate.state != "draft":
        return f"it is {certificate.state} already"
    if certificate.artefact_overdue:
        return f"its artefact {certificate.artefact} was due for calibration on {certificate.artefact_due}"
    return None


def no_pass(certificate: RecordedCertificate, content: Mapping[str, Any]) -> str:
    """What a certificate states that is no pass, in words; empty where nobody has to say a word of it."""
    if certificate.decision in ("pass", "conditional pass", NONE):
        return ""
    each = [f"{one.called}: {one.outcome}" for one in Verdicts.of_results(content) if one.standing != "good"]
    return f"{certificate.decision} ({'; '.join(each)})" if each else certificate.decision


def _person(name: str) -> str:
    person = " ".join(name.split())
    if not person:
        raise CmmUqError("a person must be named", where="--by", fix='--by "NAME"')
    return person


def _sign(
    records: Records, kind: str, certificate: RecordedCertificate, by: str, reason: str, **further: bool | int | str
) -> None:  # fmt: skip
    content = {"certificate": certificate.entry, "by": by, "reason": reason.strip(), **further}
    records.append(kind, content | {"results_sha256": certificate.results_sha256})
