"""A certificate released, withdrawn or replaced by a named person, with date and reason in the chain.

Of one that replaces another both results are compared, figure by figure as printed, and what differs is said. The results of
the replaced one are an input of the job: a file that it names, or what the records have of it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.files import called, opened
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.messages import NOTHING, Text, Verbatim, foreign, number, say, semicolons
from cmm_uq.base.output.manifest import sha256_of
from cmm_uq.base.units import UNITS, printed_unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.result import Outcome
from cmm_uq.certificate.results.provenance import KEY, ChangedFigure, Reissue
from cmm_uq.certificate.wording import OUTCOME_WORDS, with_uncertainty
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reports import results_named
from cmm_uq.jobs.source import RESULTS
from cmm_uq.jobs.tables.identification import MEASURED, REPLACED as FILE, denies_a_change
from cmm_uq.jobs.verdicts import NONE, Verdicts
from cmm_uq.laboratory.records.content import values
from cmm_uq.laboratory.records.facts import PART, STANDING, RecordedCertificate, spelled
from cmm_uq.maths.uncertainty.quantity import Quantity, rounded

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

_ENTRY = "cmm-uq/replaced/1"
"""Layout of what the records have of a certificate whose results.json is not there any more."""

_FIX = "Name the results.json that cmm-uq report wrote of the certificate that is replaced, or the folder it lies in"

_ELSEWHERE = frozenset({
    "schema", "software", "job", "import", "acquisition", "sampling", "identifiability", "diagnosis", "screening", "posterior",
    "conformity", "verdicts", "covariance", "iso17025", "traceability", "least_squares", "as_found", "cmc", "estimates",
    "artefact", "accuracy", "accuracy_uncertainty", "tolerances", "noise", "records", KEY,
})  # fmt: skip
"""Keys of results.json that are no figures of the certificate, or are read by themselves."""

Shown = tuple[Text, Text, Text]  # what a decision or a figure is, how it is printed, and its unit


def with_replaced(job: Job, where: str | Path | None, out: Path | None) -> Job:
    """The job with the results of the certificate that it replaces, from the records where it names no file of them."""
    replaces = job.facts.job.replaces
    if replaces is None or job.origin != MEASURED or _name(job) is not None:
        return job
    with opened(where, out, make=False, create=False) as records:
        found = None if records is None else replaced_in(records, replaces.number, job.facts.machine.serial)
        if records is None or found is None:
            return job
        return replace(job, inputs={**job.inputs, FILE: results_of(records, found)})


def replaced_in(records: Records, number: str, serial: str) -> RecordedCertificate | None:
    """The certificate of a number as it was issued: the newest that anybody released, else the newest.

    serial : of the machine; empty where it has none.
    """
    found = [
        one for one in records.named(number)
        if one.command == "report" and one.number == number and one.origin == MEASURED
        and (not serial or spelled(serial) in spelled(one.machine))
    ]  # fmt: skip
    issued = [one for one in found if one.state != "draft"]
    return max(issued or found, key=lambda one: one.entry, default=None)


def results_of(records: Records, certificate: RecordedCertificate) -> bytes:
    """Its results.json where it is there as it was recorded, else what the records themselves have of it."""
    file = Path(certificate.folder) / RESULTS
    if file.is_file() and sha256_of(file) == certificate.results_sha256:
        return content_of(file, TABLE_BYTES, "")
    entry = records.entry(certificate.entry).data
    keys = ("job", "number", "decision", "verdicts", "values", "results_sha256")
    kept = {key: entry[key] for key in keys if key in entry}
    return (json.dumps({"schema": _ENTRY, **kept}, indent=2, ensure_ascii=False, sort_keys=True) + "\n").encode()


def reissued(outcome: Outcome) -> Outcome:
    """The outcome with the comparison, where the certificate replaces another."""
    job = outcome.found.job
    replaces = job.facts.job.replaces
    if replaces is None or job.origin != MEASURED:
        return outcome
    name = _name(job)
    comparison = Reissue(replaces.number)
    if name is not None:
        comparison = compared(replaces.number, _read(job.inputs[name], str(job.folder / name), job), outcome.results)
    if replaces.denies:
        refuse_denied(comparison, "[job.replaces] " + ("changed" if replaces.denies_in_words else "figures_changed"))
    results = {**outcome.results, KEY: comparison.data}
    return replace(outcome, results=results, composed=lambda: comparison.on(outcome.composed()))


def compared(number: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> Reissue:
    differences, added, count = list[ChangedFigure](), list[ChangedFigure](), 0
    for shown in (_decisions, _figures):
        then, now = shown(before), shown(after)
        count += len(then)
        differences += [
            ChangedFigure(what, printed, now[name][1] if name in now else NOTHING, unit)
            for name, (what, printed, unit) in then.items() if name not in now or str(now[name][1]) != str(printed)
        ]  # fmt: skip
        if before["schema"] != _ENTRY:
            new = [each for name, each in now.items() if name not in then]
            added += [ChangedFigure(what, NOTHING, printed, unit) for what, printed, unit in new]
    return Reissue(number, count, tuple(differences), tuple(added))


def refuse_denied(comparison: Reissue, where: str) -> None:
    if comparison.differences:
        told = semicolons([one.sentence for one in comparison.differences[:3]])
        count = len(comparison.differences)
        raise CmmUqError(f"says that no figure is changed against certificate {comparison.number}, and {count} "
                         f"{'differs' if count == 1 else 'differ'}: {told}{' …' if count > 3 else ''}", where=where,
                         fix="Say what is changed; the certificate prints every difference")  # fmt: skip


def refuse_unlike(records: Records, certificate: RecordedCertificate) -> None:
    """Refuse to release a certificate that replaces another of these records, and was not compared with it."""
    file = Path(certificate.folder) / RESULTS
    if not file.is_file() or sha256_of(file) != certificate.results_sha256:
        return
    data = json.loads(content_of(file, TABLE_BYTES, ""))
    comparison, replaces = Reissue.of_results(data), data["job"].get("replaces")
    if replaces is None or (comparison is not None and comparison.compared is not None):
        return
    other = replaced_in(records, replaces["number"], "")
    if other is not None and other.entry != certificate.entry:
        raise CmmUqError(
            f"{certificate.number} replaces {other.number}, which these records have, and does not say what differs",
            where=records.shown, fix="Report it again with these records: it is then compared",
        )  # fmt: skip


def refuse_denial(records: Records, before: RecordedCertificate, after: RecordedCertificate, reason: str) -> None:
    """Refuse a reason for a replacement that says that nothing is changed where anything is."""
    if denies_a_change(reason):
        then, now = (json.loads(results_of(records, one)) for one in (before, after))
        refuse_denied(compared(before.number, then, now), "--reason")


def _name(job: Job) -> str | None:
    """Input that has the results of the certificate that is replaced."""
    replaces = job.facts.job.replaces
    named = None if replaces is None else results_named(replaces.results)
    return named if named is not None else FILE if FILE in job.inputs else None


def _read(content: bytes, where: str, job: Job) -> Mapping[str, Any]:
    """Results of the certificate that is replaced; those of another machine, or of nothing measured, are refused."""
    try:
        data = json.loads(content)
        schema, of = data["schema"], data["job"]
        if schema == _ENTRY:
            return {**data, "job": {"id": of}}
        then, now = of.get("serial") or of["machine"], job.facts.machine.serial or job.facts.machine.name
        origin = of["origin"]
    except (ValueError, TypeError, KeyError, AttributeError):
        raise CmmUqError("is no results.json of a report", where=where, fix=_FIX) from None
    if schema != "cmm-uq/results/1" or "estimates" not in data:
        raise CmmUqError("is no results.json of a report", where=where, fix=_FIX)
    if origin != MEASURED or spelled(str(then)) not in (spelled(now), spelled(job.facts.machine.name)):
        raise CmmUqError(f"is of {then}, {origin}, and this job of {now}", where=where, fix=_FIX)
    return data if isinstance(data, dict) else {}


def _decisions(results: Mapping[str, Any]) -> dict[str, Shown]:
    """The gravest outcome, and each outcome and limit, by standard and characteristic or by what has a tolerance."""
    found: dict[str, Shown] = {}
    verdicts = Verdicts.of_results(results)
    overall = str(results["decision"]) if "decision" in results else verdicts.overall
    found["overall"] = (say("conformity"), OUTCOME_WORDS.get(overall, Verbatim(overall)), NOTHING)
    for one in verdicts:
        name = _free(found, one.called)
        found[name] = (Verbatim(one.called), OUTCOME_WORDS.get(one.outcome, Verbatim(one.outcome)), NOTHING)
        if one.limit is not None:
            what = say("{what}, limit", what=Verbatim(one.called))
            found[f"{name}\nlimit"] = (what, number(one.limit, ".6g"), foreign(one.unit))
    return found


def _figures(results: Mapping[str, Any]) -> dict[str, Shown]:
    """Every figure by its name in results.json, value and U as printed."""
    rows = results["values"] if results["schema"] == _ENTRY else values(results, called)
    free = {name for one in (results.get("identifiability") or {}).get("undetermined") or () for name in one}
    found: dict[str, Shown] = {}
    for name, title, unit, value, u, lower, upper, *_ in rows:
        if name not in free:
            printed = _printed(value, u, (lower, upper))
            found[_free(found, name)] = (Verbatim(title), printed, foreign(str(UNITS.get(unit, unit))))
    for key in sorted(results.keys() - _ELSEWHERE):
        for name, printed in _walked(results[key], key):
            unit = printed_unit(name.rpartition("[")[0] if name.endswith("]") else name)
            found[name] = (Verbatim(name), printed, unit)
    for one in results.get("conformity") or ():
        title = f"{one.get('standard')} {one.get('characteristic') or ''}".strip()
        for error in one.get("errors") or ():
            what = say(
                "{title}, {length:.6g} mm, measurement {measurement}, repeat {repeat}", title=Verbatim(title),
                length=error["length_mm"], measurement=error["measurement"], repeat=Verbatim(str(error.get("repeat") or "–")),
            )  # fmt: skip
            if error.get("error_um") is not None:
                printed = rounded(error["error_um"], error.get("U_um") or 0.0)[0]
                found[_free(found, f"{title}\n{what}\n{error.get('position') or ''}")] = (what, printed, UNITS["µm"])
    return found


def _walked(node: Any, name: str) -> Iterator[tuple[str, Text]]:
    """What else is a figure with its u, wherever a kind has it; of curves each point."""
    if isinstance(node, list):
        for i, inner in enumerate(node):
            yield from _walked(inner, f"{name}[{i}]")
    elif isinstance(node, Mapping):
        if _number(node.get("value")) and _number(node.get("u")):
            ends = node.get("interval95") or (node["value"] - 2 * node["u"], node["value"] + 2 * node["u"])
            yield name, _printed(node["value"], node["u"], (ends[0], ends[1]))
            return
        errors, U = node.get("error_um"), node.get("U_um")
        if isinstance(errors, list) and isinstance(U, list) and len(errors) == len(U):
            for i, (error, one) in enumerate(zip(errors, U, strict=True)):
                if _number(error) and _number(one):
                    yield f"{name}.error_um[{i}]", rounded(error, one)[0]
            return
        for key, inner in node.items():
            yield from _walked(inner, f"{name}.{key}")


def _printed(value: float, u: float, ends: tuple[float, float]) -> Text:
    return with_uncertainty(Quantity(value, u, ends, UNITS["µm"])) if u > 0 else rounded(value, 0.0)[0]


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _free(found: Mapping[str, object], name: str) -> str:
    """The name, or the next with a number behind it where it is taken."""
    count = 2
    free = name
    while free in found:
        free, count = f"{name}\n{count}", count + 1
    return free


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
    found = [one for one in records.named(name) if one.command in ("report", PART)]
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
    certificate, person = certificate_named(records, name, ("draft",)), _person(by)
    if (why := blocked(certificate)) is not None:
        raise CmmUqError(f"{certificate.number} cannot be released: {why}", where=records.shown)
    content = records.entry(certificate.entry).data
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
    certificate, person = certificate_named(records, name, STANDING), _person(by)
    if not reason.strip():
        fix = "Say it: it stays in the records"
        raise CmmUqError("a certificate is withdrawn for a reason", where="--reason", fix=fix)
    if certificate.state not in STANDING:
        raise CmmUqError(f"{certificate.number} is {certificate.state} already", where=records.shown)
    if replaced_by is None:
        _sign(records, "withdrawal", certificate, person, reason)
        return Release(records.certificate(certificate.entry))
    other = certificate_named(records, replaced_by, ("released",))
    if other.entry == certificate.entry:
        raise CmmUqError("a certificate does not replace itself", where="--replaced-by", fix="Name the new one's entry")
    alike = PART not in (certificate.command, other.command) and other.machine == certificate.machine
    if other.state != "released" or not (alike or other.command == certificate.command == PART):
        why = f"is {other.state}" if other.state != "released" else f"is of {other.machine}, not {certificate.machine}"
        if PART in (certificate.command, other.command):  # which may be measured again on another machine
            why = f"is {'a' if other.command == PART else 'no'} report of a part" if other.state == "released" else why
        fix = "Name a released certificate of this machine"
        raise CmmUqError(f"{other.number} {why}", where="--replaced-by", fix=fix)
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
) -> None:
    content = {"certificate": certificate.entry, "by": by, "reason": reason.strip(), **further}
    records.append(kind, content | {"results_sha256": certificate.results_sha256})
