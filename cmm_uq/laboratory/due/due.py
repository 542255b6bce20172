"""When a machine is due, and why: by its rule, what its certificates and those of its model found, its checks, its artefact.

Where the history does not bear the method, the interval that the rule begins with is taken, and it is said why. No
certificate counts that is dated after the day asked about: a clock that was wrong would hide that a machine is overdue.
"""

from __future__ import annotations

import calendar
import datetime as dt
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Literal

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, day, foreign, number, say
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.verdicts import BEYOND, NONE
from cmm_uq.laboratory.due.rule import InterimCheck, Pool, Rule, calibrations, check_standings, months_of
from cmm_uq.laboratory.records.facts import ArtefactRow, RecordedCertificate, RecordedMachine

if TYPE_CHECKING:
    from cmm_uq.laboratory.due.drift import DriftPrior as Prior

METHOD_WORDS: Mapping[str, Text] = {
    "fixed": say("fixed"), "A3": Verbatim("A3"), "S2": Verbatim("S2"), "staircase": say("staircase"),
    "control chart": say("control chart"), "drift": say("drift"),
}  # fmt: skip
"""Methods as they are called."""


@dataclass(frozen=True)
class RecalibrationInterval:
    days: float | None  # ``None`` where it is a number of calendar months
    months: int | None  # that many; ``None`` where it is a number of days
    why: Text  # one sentence without a full stop


def interval_by(
    rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Mapping[str, Prior] | None = None
) -> RecalibrationInterval:
    """The interval after the last of a machine's calibrations, by day; the drift model takes later checks too."""
    if rule.method == "fixed":
        return _fixed(rule)
    from cmm_uq.laboratory.due.intervals import METHODS  # numpy and scipy: a fixed interval need not wait for them

    try:
        days, why = METHODS[rule.method](rule, certificates, pool, priors or {})
    except CmmUqError as error:
        why = say("{months}, as method {method} cannot say: {why}", months=months_of(rule),
                  method=METHOD_WORDS[rule.method], why=foreign(error.problem))  # fmt: skip
        return RecalibrationInterval(None, rule.every_months, why)
    return RecalibrationInterval(days, None, why)


@lru_cache(maxsize=100)
def _fixed(rule: Rule) -> RecalibrationInterval:
    """Cached: thousands of machines share a rule, and putting it into words takes longer than all else of it."""
    months = months_of(rule)
    stated = say("fixed interval of {months}", months=months)
    usual = say("{months}, as its job does not say otherwise", months=months)
    return RecalibrationInterval(None, rule.every_months, stated if rule.stated else usual)


State = Literal["overdue", "due", "later", "unknown"]


@dataclass(frozen=True)
class DueItem:
    """A machine or an artefact, when it is to be calibrated, and what is in the way of a certificate of it."""

    item: Literal["machine", "artefact"]
    serial: str
    name: str
    model: str
    place: str
    last: dt.date | None  # day of its last calibration
    due: dt.date | None  # day by which it is to be calibrated again; ``None`` where nothing says so
    why: Text
    remarks: tuple[Text, ...] = ()  # what else is to be known, a sentence each
    artefact: str = ""  # serial of the artefact that its last calibration was made with
    blocked: Text | None = None
    # whether its last certificate finds it beyond its limits, or a check out of control: it is overdue from that day on
    beyond: bool = False

    def state(self, on: dt.date, within: dt.timedelta) -> State:
        """Overdue before a day or beyond its limits, due within a time of it, later, or unknown."""
        if self.due is None:
            return "unknown"
        left = self.due - on  # and not on + within, which may lie beyond the calendar
        return "overdue" if left.days < 0 or self.beyond else "due" if left <= within else "later"


def after_months(start: dt.date, months: int) -> dt.date:
    years, month = divmod(start.month - 1 + months, 12)
    year = start.year + years
    if year > dt.MAXYEAR:
        return dt.date.max
    return dt.date(year, month + 1, min(start.day, calendar.monthrange(year, month + 1)[1]))


@dataclass(frozen=True)
class CalibrationRecord:
    """What is known of a machine on a day; of a fixed interval only since its last calibration."""

    machine: RecordedMachine  # and rule: as its newest certificate has them
    rule: Rule
    certificates: Sequence[RecordedCertificate]
    limited: bool = True  # whether the last calibration sets a limit, or decides on one
    late: dt.date | None = None  # last date of those that are dated after the day; ``None`` where none is
    priors: Mapping[str, Prior] = field(default_factory=dict)  # what its fleet taught of each value, by name


def machine_due(of: CalibrationRecord, artefacts: Mapping[str, ArtefactRow], on: dt.date, pool: Pool) -> DueItem:
    """When a machine is to be calibrated again; artefacts by serial."""
    machine, known = of.machine, of.certificates
    by_name = say("It has no serial number and is recognised by its name alone.")
    remarks: list[Text] = [by_name] if machine.by_name else []
    if of.late is not None:
        remarks.append(say("A recording of {day} is dated after {on} and does not count: a clock or a date is wrong.",
                           day=day(of.late), on=day(on)))  # fmt: skip
    done = calibrations(known)
    item = partial(DueItem, "machine", machine.serial, machine.name, machine.model, machine.place)
    if not done:
        return item(None, None, say("never calibrated up to {on}", on=day(on)), tuple(remarks))
    last, released = done[-1], [one for one in done if one.state == "released"]
    waits = last.state == "draft" and bool(released)
    if last.state == "draft":
        at = day(last.day)
        none = say("Its certificate of {day} is a draft that nobody has released: it begins no interval.", day=at)
        remarks.append(none if waits else say("Its certificate of {day} is a draft that nobody has released.", day=at))
    if not of.limited:
        remarks.append(say("Its certificate has no limits, so that only time can say when it is due."))
    elif last.decision not in (*BEYOND, NONE, "pass"):
        decision = Verbatim(last.decision)
        remarks.append(say("Its last certificate does not state that it conforms: {decision}.", decision=decision))
    stated = (*machine.adjusted, *(one.adjusted_since for one in known))
    every = [one for one in stated if one is not None and one <= on]
    adjusted = [one for one in every if last.day < one]
    due, reason, beyond = _due_date(of, last, adjusted, pool)
    counts = last
    if waits:  # a draft may end an interval, and begins none
        before = _due_date(of, released[-1], [one for one in every if released[-1].day < one], pool)
        if before[0] < due:
            (due, reason, beyond), counts = before, released[-1]
    remarks += [_IN_DOUBT] if beyond else []
    blocked: Text | None = None
    if (used := artefacts.get(last.artefact)) is not None and used.due is not None and used.due < max(on, due):
        artefact, until = Verbatim(used.serial), day(used.due)
        if used.due < on:
            blocked = say(
                "its artefact {artefact} is out of date since {due}: no certificate can be made with it",
                artefact=artefact, due=until,
            )  # fmt: skip
        else:
            text = say("Its artefact {artefact} is itself due on {due}, before that.", artefact=artefact, due=until)
            remarks.append(text)
    return item(counts.day, due, reason, tuple(remarks), last.artefact, blocked, beyond)


_IN_DOUBT = say("What was measured on it since it was last in order is in doubt: its history lists it.")


def _due_date(
    of: CalibrationRecord, last: RecordedCertificate, adjusted: Sequence[dt.date], pool: Pool
) -> tuple[dt.date, Text, bool]:
    """By the first of: an adjustment since, a certificate that does not conform, an interim check, the rule.

    And whether the certificate, or a check, finds it beyond its limits or out of control.
    """
    if adjusted:
        return min(adjusted), say("adjusted on {day}, and not calibrated since", day=day(min(adjusted))), False
    if last.decision in BEYOND:
        return last.day, say("its last certificate finds it beyond its limits"), True
    rule, at = of.rule, of.certificates.index(last) + 1
    own, later = of.certificates[:at], [one for one in of.certificates[at:] if one.interim]
    seen = [own]
    if rule.method == "drift":  # takes checks after the calibration too; other methods count what calibrations found
        seen = [[*own, *later]]
        if last.state == "released" and any(one.state == "draft" for one in later):  # which make no day later
            seen.append([*own, *(one for one in later if one.state != "draft")])
    interval = min((interval_by(rule, each, pool, of.priors) for each in seen), key=lambda one: _ends(last.day, one))
    planned = _ends(last.day, interval)
    checks = check_standings(last, later)
    return *_checked(rule, last, planned, interval.why, checks), any(one.standing == "action" for one in checks)


def _ends(start: dt.date, interval: RecalibrationInterval) -> dt.date:
    if interval.months is not None:
        return after_months(start, interval.months)
    return dt.date.fromordinal(min(start.toordinal() + int(interval.days or 0), dt.date.max.toordinal()))


def _checked(
    rule: Rule, last: RecordedCertificate, planned: dt.date, why: Text, checks: Sequence[InterimCheck]
) -> tuple[dt.date, Text]:
    """What interim checks make of the date: an action ends the interval, a check in control may lengthen a fixed one."""
    if not checks:
        return planned, why
    one = next((one for one in checks if one.standing == "action"), checks[-1])
    at = day(one.certificate.day)
    if one.standing == "action":
        reason = say("the interim check of {day} is out of control ({what})", day=at, what=_furthest(one))
        return min(one.certificate.day, planned), reason
    if one.standing == "warning":
        what = _furthest(one)
        return planned, say("{why}; the interim check of {day} warns ({what}): repeat it", why=why, day=at, what=what)
    if one.standing == "nothing compared":
        why = say("{why}; the interim check of {day} has no value in common with the calibration", why=why, day=at)
        return planned, why
    extended, lengthens = planned, rule.method == "fixed" and rule.longest_months is not None
    lengthens = lengthens and not (one.certificate.state == "draft" and last.state == "released")
    if lengthens and not one.proves:
        return planned, say(
            "{why}; the interim check of {day}, in control, shows too little to lengthen it", why=why, day=at
        )
    if lengthens and rule.longest_months is not None:
        carried = RecalibrationInterval((planned - last.day).days, None, why)
        extended = min(_ends(one.certificate.day, carried), after_months(last.day, rule.longest_months))
    if extended <= planned:
        return planned, say("{why}; interim checks up to {day} in control", why=why, day=at)
    return extended, say("{why}; lengthened by the interim check of {day}, in control", why=why, day=at)


def _furthest(one: InterimCheck) -> Text:
    if not one.worst:
        return say("nothing in it can be compared")
    return say("{name}: {ratio} standard uncertainties from the calibration, limit {limit}", name=foreign(one.worst),
               ratio=number(abs(one.ratio), ".1f"), limit=number(one.action, ".1f"))  # fmt: skip


def artefact_due(artefact: ArtefactRow) -> DueItem:
    """When an artefact is to be calibrated again, as its own certificate says."""
    why: Text = say("as the jobs that use it say")
    if artefact.certificate:
        why = say("as its certificate {number} says", number=Verbatim(artefact.certificate))
    if artefact.due is None:
        why = say("no job says when its calibration ends")
    return DueItem("artefact", artefact.serial, artefact.kind, "", "", artefact.calibrated, artefact.due, why)


def in_order(found: Sequence[DueItem]) -> list[DueItem]:
    """By day; those that nothing is known of come last."""
    return sorted(found, key=lambda one: (one.due is None, one.due or dt.date.max, one.item, one.serial))
