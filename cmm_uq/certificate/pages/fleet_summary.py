"""A fleet in words and as data: which machines matter, and how sure that is.

The ``prior`` of ``fleet.json`` is all that is needed to judge a further machine by it; ``fleet.csv`` has the machines alone,
for a spreadsheet.
"""

from __future__ import annotations

import csv
import datetime as dt
import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmm_uq import __version__
from cmm_uq.base.files.csv_table import FORMULA
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, commas, day, holding, number, plural, say, signed
from cmm_uq.base.units import unit_as_written
from cmm_uq.certificate.document import Overview, Standing
from cmm_uq.certificate.origin import attributes
from cmm_uq.certificate.wording import Headline, Summary
from cmm_uq.laboratory.due.fleet import FleetResult, FleetValue, UsualRate, seen_again

MOST_SERIALS = 12  # machines in a line


def counted(count: int) -> Text:
    return plural(count, one=say("one machine"), many=say("{count} machines", count=count))


def serials(machines: Iterable[str]) -> Text:
    """Machines by name, the first of very many; nothing of none."""
    named = sorted(set(machines))
    shown = commas([Verbatim(each) for each in named[:MOST_SERIALS]])
    left = len(named) - MOST_SERIALS
    return say("{shown} and {count} more", shown=shown, count=left) if left > 0 else shown if named else NOTHING


def date_of(ordinal: float) -> Text:
    return day(dt.date.fromordinal(int(ordinal)))


def called(of: FleetValue) -> Text:
    return say("{quantity} ({name})", quantity=Verbatim(of.quantity), name=Verbatim(of.name))


def group_words(each: UsualRate) -> Text:
    if each.kind == "fleet":
        return say("Average machine")
    name = Verbatim(each.name) if each.name else say("not stated")
    return say("Model {name}", name=name) if each.kind == "model" else say("Place {name}", name=name)


def per_year(of: FleetValue) -> Text:
    return say("{unit}/year", unit=unit_as_written(of.unit) or Verbatim("1"))


def digits(of: FleetValue) -> str:
    """Format of rates: two digits of the usual standard uncertainty of a machine's."""
    u = float(np.median(of.fleet.estimates.u_rate))
    return f".{int(np.clip(1 - np.floor(np.log10(u)), 0, 9))}f" if u > 0 else ".3g"


def signed_rate(rate: float, spec: str) -> Number:
    return number(0.0, spec) if float(format(rate, spec)) == 0 else signed(rate, spec)


def rate_words(rate: float, U: float, of: FleetValue) -> Text:
    spec = digits(of)
    return say("{rate} ± {U} {unit}", rate=signed_rate(rate, spec), U=number(U, spec), unit=per_year(of))


def usual_rate(of: FleetValue) -> Text:
    average = of.fleet.usual[0]
    return rate_words(average.rate, 1.96 * average.u, of)


MOST_VERDICTS = 6  # machines and values that a terminal names as unlike their fleet


class _Standings(NamedTuple):
    """Machines that matter: unlike their fleet, beyond a limit, and beyond one within a year."""

    unlike: set[str]
    beyond: set[str]
    soon: set[str]


def _standings(found: FleetResult) -> _Standings:
    def named(which: Callable[[FleetValue], NDArray[np.bool_]]) -> set[str]:
        return {of.members[i].machine for of in found.values for i in np.flatnonzero(which(of))}

    beyond = named(lambda of: of.beyond)
    return _Standings(named(lambda of: ~of.belongs), beyond, named(lambda of: of.crosses_by(found.in_a_year)) - beyond)


def fleet_overview(found: FleetResult) -> Overview:
    machines = _standings(found)
    word, standing = _verdict(found, machines)
    rows = (
        (say("Compared"), _compared(found)),
        (say("Unlike the fleet"), serials(machines.unlike)),
        (say("Beyond a limit"), serials(machines.beyond)),
        (say("Beyond by {day}", day=date_of(found.in_a_year)), serials(machines.soon)),
    )
    return Overview(word, standing, tuple(row for row in rows if row[1]))


def fleet_summary(found: FleetResult) -> Summary:
    """The same for a terminal; models and places are its details."""
    machines = _standings(found)
    word, standing = _verdict(found, machines)
    outsiders = sorted(found.outsiders, key=lambda each: float(each[0].fleet.estimates.p[each[1]]))
    verdicts = tuple(
        Headline("DIFFERS", "open", say("machine {serial}", serial=Verbatim(of.members[i].machine)), (_differs(of, i),))
        for of, i in outsiders[:MOST_VERDICTS]
    )
    none = Headline("ALIKE" if found.compared else "UNKNOWN", standing, word, (_compared(found),))
    left, beyond = len(outsiders) - MOST_VERDICTS, len(machines.beyond)
    are = say("{count} machines are beyond a limit", count=beyond)
    remarks = holding(
        (left > 0, say("{count} more values of machines differ, less clearly: fleet.json has all", count=left)),
        (beyond, plural(beyond, one=say("One machine is beyond a limit"), many=are)),
        (machines.soon, say("{machines:capital} will probably be beyond a limit by {day}",
                            machines=counted(len(machines.soon)), day=date_of(found.in_a_year))),
    )  # fmt: skip
    return Summary(
        subject=counted(len(machines_of(found))), verdicts=verdicts or (none,),
        figures=tuple(
            (say("{quantity}: {group:small}", quantity=Verbatim(of.quantity), group=group_words(of.fleet.usual[0])),
             usual_rate(of), _counts(of, found.in_a_year))
            for of in found.values
        ),
        remarks=tuple(remarks),
        details=tuple(
            (say("{quantity}: {group:small}", quantity=Verbatim(of.quantity), group=group_words(each)),
             rate_words(each.rate, 1.96 * each.u, of), counted(each.machines))
            for of in found.values for each in of.fleet.usual[1:]
        ),
        warnings=fleet_warnings(found),
    )  # fmt: skip


def machines_of(found: FleetResult) -> set[str]:
    return {member.machine for of in found.values for member in of.members}


def _verdict(found: FleetResult, machines: _Standings) -> tuple[Text, Standing]:
    """Good only where nothing is left to do: a machine that drifts as all do may be beyond its limit with all."""
    if not found.compared:
        return say("Not enough history to compare machines"), "unknown"
    if not machines.unlike:
        return say("No machine drifts unlike its fleet"), "open" if machines.beyond or machines.soon else "good"
    count = len(machines.unlike)
    many = say("{count} machines drift unlike their fleet", count=count)
    return plural(count, one=say("One machine drifts unlike its fleet"), many=many), "open"


def _compared(found: FleetResult) -> Text:
    count = len({member.machine for of in found.values for member in of.members if seen_again(member)})
    total = len(machines_of(found))
    return plural(
        count,
        one=say("one machine of {total} has certificates of two days", total=total),
        many=say("{count} machines of {total} have certificates of two days", count=count, total=total),
    )


def _counts(of: FleetValue, until: float) -> Text:
    unlike, beyond, soon = (int(which.sum()) for which in (~of.belongs, of.beyond, of.crosses_by(until)))
    parts = ((unlike, say("{count} unlike the fleet", count=unlike)), (beyond, say("{count} beyond the limit", count=beyond)),
             (soon, say("{count} within a year", count=soon)))  # fmt: skip
    return commas((counted(len(of.members)), *(text for count, text in parts if count)))


def _differs(of: FleetValue, i: int) -> Text:
    e = of.fleet.estimates
    return say(
        "{quantity}: {rate}, where the others let expect {expected} (p = {p})", quantity=Verbatim(of.quantity),
        rate=rate_words(e.rate[i], 1.96 * e.u_rate[i], of), expected=rate_words(e.expected[i], 1.96 * e.u_expected[i], of),
        p=number(e.p[i], ".1g"),
    )  # fmt: skip


def fleet_warnings(found: FleetResult) -> tuple[Text, ...]:
    return tuple(text for of in found.values for text in _warnings(of))


def _warnings(of: FleetValue) -> list[Text]:
    value, fleet, again = called(of), of.fleet, sum(seen_again(member) for member in of.members)
    rough = say("{value}: the draws are worth only {worth} independent ones; take its figures as rough", value=value,
                worth=number(fleet.worth, ".0f"))  # fmt: skip
    left_out = plural(
        of.left_out, one=say("{value}: one certificate states no uncertainty and cannot be weighed", value=value),
        many=say("{value}: {count} certificates state no uncertainty and cannot be weighed", value=value, count=of.left_out),
    )  # fmt: skip
    alone = say("{value}: one machine is no fleet; what machines have in common is assumed, not learnt", value=value)
    assumed = say("{value}: no machine has certificates of two days; drift is assumed, not learnt", value=value)
    single = say(
        "{value}: only one machine has certificates of two days; no other shows a drift to compare it with", value=value
    )
    return holding(
        (not fleet.converged, rough), (of.left_out, left_out), (len(of.members) == 1, alone), (not again, assumed),
        (again == 1 < len(of.members), single),
    )  # fmt: skip


SCHEMA = "cmm-uq/fleet/1"


def fleet_data(found: FleetResult) -> dict[str, Any]:
    """All that was found, rates per year in the unit of the value."""
    return {
        "schema": SCHEMA, "software": {"name": "cmm-uq", "version": __version__}, "seed": found.seed,
        "values": [_value(each) for each in found.values],
    }  # fmt: skip


def _value(of: FleetValue) -> dict[str, Any]:
    fleet = of.fleet
    return {
        "name": of.name, "quantity": of.quantity, "unit": of.unit, "machines": _machines(of),
        "certificates_left_out": of.left_out, "compared": of.compared,
        "usual": list(map(asdict, fleet.usual)), "spreads": list(map(asdict, fleet.spreads)),
        "convergence": {
            "converged": fleet.converged, "worth": fleet.worth, "draws": fleet.draws, "machines": fleet.learnt_from,
        },
        "prior": fleet.data(),
    }  # fmt: skip


def _machines(of: FleetValue) -> list[dict[str, Any]]:
    e = of.fleet.estimates
    return [
        {
            **attributes(member, "machine", "model", "place"),
            "certificates": len(member.history.day), "rate": float(e.rate[i]), "u": float(e.u_rate[i]),
            "expected": float(e.expected[i]), "u_expected": float(e.u_expected[i]), "p": float(e.p[i]),
            "belongs": bool(of.belongs[i]), "limit": member.limit,
            "crossing": None if e.crossing is None or member.limit is None else e.crossing.one(i).data(),
        }
        for i, member in enumerate(of.members)
    ]  # fmt: skip


def fleet_csv(data: Mapping[str, Any]) -> bytes:
    """A row a machine and value of :func:`fleet_data`; a name that a spreadsheet would compute has an apostrophe."""
    rows = [
        {"value": of["name"], "quantity": of["quantity"], "unit": of["unit"], **one} | (one["crossing"] or {})
        for of in data["values"]
        for one in of["machines"]
    ]
    text = io.StringIO()
    columns = [*(name for name in rows[0] if name not in ("crossing", *_CROSSING)), *_CROSSING]
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for row in rows:
        named = {name: f"'{cell}" for name, cell in row.items() if isinstance(cell, str) and cell.startswith(FORMULA)}
        writer.writerow(row | named)
    return text.getvalue().encode()


_CROSSING = ("last", "day_5", "day_50", "day_95", "already", "within_a_year")
