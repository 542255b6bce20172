"""When a machine was in doubt, and which parts were measured on it then.

A calibration that finds a machine beyond its limits, or an interim check out of control, puts in doubt what was measured since
it was last found in order (ISO/IEC 17025:2017, 7.10): by the last calibration that does not find it so, or a check in
control. Only a later calibration in order ends that. What nobody has released finds a machine out of order, and in order only
where nothing of it is ever released. Parts are those of the records, and of reports beside them that these do not have.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from hashlib import sha256
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.verdicts import BEYOND
from cmm_uq.laboratory.due.rule import check_standings
from cmm_uq.laboratory.records.facts import MeasuredPart, RecordedCertificate, RecordedMachine, spelled

_OPEN = ("undecided", "remeasure")  # decisions by which a machine is neither in order nor out of it
SCHEMA = "cmm-uq/part/"


@dataclass(frozen=True)
class DoubtfulPeriod:
    """From the last day that found a machine in order to the calibration that did so again."""

    after: dt.date | None  # ``None`` where nothing before found it in order
    found: RecordedCertificate  # the first that found it out of order
    until: dt.date | None = None  # ``None`` where nothing since found it in order
    parts: tuple[MeasuredPart, ...] = ()

    def holds(self, part: MeasuredPart) -> bool:
        """Whether a part was measured in it, by no certificate of after it; on the first day too, at whatever hour."""
        renewed = self.until is not None and part.calibrated >= self.until
        return not renewed and (self.after is None or part.day >= self.after)


def doubtful_periods(certificates: Sequence[RecordedCertificate]) -> tuple[DoubtfulPeriod, ...]:
    """Of certificates and interim checks of one machine that stand, with their values, by day."""
    released = any(one.state == "released" for one in certificates)
    found, good, checks = list[DoubtfulPeriod](), None, list[RecordedCertificate]()
    base: RecordedCertificate | None = None
    for one in certificates:
        beyond, in_order = one.decision in BEYOND, not one.interim and one.decision not in (*BEYOND, *_OPEN)
        if one.interim and base is not None:
            checks.append(one)
            standing = check_standings(base, checks)[-1].standing
            beyond, in_order = standing == "action", standing == "in control"
        elif not one.interim:
            base, checks = one, []
        lasts = bool(found) and found[-1].until is None
        if beyond and not lasts:
            found.append(DoubtfulPeriod(good, one))
        elif in_order and (one.state == "released" or not released) and not (lasts and one.interim):
            good = one.day
            if lasts:
                found[-1] = replace(found[-1], until=good)
    return tuple(found)


def parts_measured(
    machine: RecordedMachine, reports: Iterable[Path], known: Callable[[str], object | None] = lambda digest: None
) -> Iterator[MeasuredPart]:
    """Of files ``results.json`` those of parts that were measured on a machine, by its serial number, else by its name.

    ``known``: what records have of a file, by its SHA-256, which is then passed over; ``None`` for nothing. A report of a
    part that cannot be read is refused.
    """
    name, maker = spelled(machine.name), spelled(f"({machine.manufacturer})")
    serial = "" if machine.by_name else spelled(machine.serial).removesuffix(maker)
    for file in reports:
        content = content_of(file, TABLE_BYTES, "Mend it, or name other folders with --parts")
        try:
            data = json.loads(content)
            if not str(data["schema"]).startswith(SCHEMA) or data["job"]["origin"] != "measured":
                continue
            values = [one["value"] for one in data.get("characteristics") or ()]
            if (values and not any(value is not None for value in values)) or known(
                sha256(content).hexdigest()
            ) is not None:
                continue  # a part that was only planned, or is recorded
            job, part, by = data["job"], data["part"], data["machine"]
            own = spelled(str(by["serial"] or "")) if serial else ""
            if own == serial if own else spelled(str(by["machine"])) == name:
                number, outcome = job.get("number") or job["id"], data["decision"]["outcome"]
                yield MeasuredPart.of(
                    part,
                    by["date"],
                    by["number"],
                    day=job["date"],
                    folder=str(file.parent),
                    number=number,
                    outcome=outcome,
                )
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            if b'"cmm-uq/part/' in content:
                raise CmmUqError(
                    "is no results.json of a part", where=str(file), fix="Ask for the report anew"
                ) from None


def with_parts(
    periods: Sequence[DoubtfulPeriod], parts: Iterable[MeasuredPart], on: dt.date
) -> tuple[DoubtfulPeriod, ...]:
    """Periods with the parts that were measured in them up to a day, by day."""
    known = sorted((one for one in parts if one.day <= on), key=lambda one: (one.day, one.number))
    return tuple(replace(one, parts=tuple(part for part in known if one.holds(part))) for one in periods)
