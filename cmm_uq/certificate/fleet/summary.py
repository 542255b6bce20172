"""What a fleet comes to: the verdict, in the overview of its page and in a few lines for a terminal, however many machines."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import Text, Verbatim, commas, number, plural, say
from cmm_uq.certificate.document import Overview, Standing
from cmm_uq.certificate.fleet.words import called, counted, date_of, group_words, rate_words, serials, usual_rate
from cmm_uq.certificate.in_short import Summary, Verdict
from cmm_uq.laboratory.due.fleet import FleetResult, FleetValue, seen_again

MOST_VERDICTS = 6
"""Machines and values that a terminal names as unlike their fleet."""


def fleet_overview(found: FleetResult) -> Overview:
    """What comes before everything else on the page."""
    word, standing = _verdict(found)
    rows = (
        (say("Compared"), _compared(found)),
        (say("Unlike the fleet"), serials(_unlike(found))),
        (say("Beyond a limit"), serials(_beyond(found))),
        (say("Beyond by {day}", day=date_of(found.in_a_year)), serials(_soon(found))),
    )
    return Overview(word, standing, tuple(row for row in rows if row[1]))


def fleet_summary(found: FleetResult) -> Summary:
    """The same for a terminal; models and places are its details."""
    word, standing = _verdict(found)
    outsiders = sorted(found.outsiders, key=lambda each: float(each[0].fleet.estimates.p[each[1]]))
    verdicts = tuple(
        Verdict("DIFFERS", "open", say("machine {serial}", serial=Verbatim(of.members[i].machine)), (_differs(of, i),))
        for of, i in outsiders[:MOST_VERDICTS]
    )
    none = Verdict("ALIKE" if found.compared else "UNKNOWN", standing, word, (_compared(found),))
    left = len(outsiders) - MOST_VERDICTS
    more = say("{count} more values of machines differ, less clearly: fleet.json has all", count=left)
    return Summary(
        subject=counted(len(machines_of(found))), verdicts=verdicts or (none,),
        figures=tuple((_group(of), usual_rate(of), _counts(of, found.in_a_year)) for of in found.values),
        remarks=(*((more,) if left > 0 else ()), *_due(found)),
        details=tuple(
            (say("{quantity}: {group:small}", quantity=Verbatim(of.quantity), group=group_words(each)),
             rate_words(each.rate, 1.96 * each.u, of), counted(each.machines))
            for of in found.values for each in of.fleet.usual[1:]
        ),
        warnings=fleet_warnings(found),
    )  # fmt: skip


def machines_of(found: FleetResult) -> set[str]:
    """All, by name."""
    return {member.machine for of in found.values for member in of.members}


def _named(of: FleetValue, which: NDArray[np.bool_]) -> Iterable[str]:
    return (of.members[i].machine for i in np.flatnonzero(which))


def _unlike(found: FleetResult) -> set[str]:
    return {name for of in found.values for name in _named(of, ~of.belongs)}


def _beyond(found: FleetResult) -> set[str]:
    return {name for of in found.values for name in _named(of, of.beyond)}


def _soon(found: FleetResult) -> set[str]:
    """That are not beyond a limit yet, and will be beyond one within a year."""
    crossing = {name for of in found.values for name in _named(of, of.crosses_by(found.in_a_year))}
    return crossing - _beyond(found)


def _verdict(found: FleetResult) -> tuple[Text, Standing]:
    """Good only where nothing is left to do: a machine that drifts as all do may be beyond its limit with all."""
    if not found.compared:
        return say("Not enough history to compare machines"), "unknown"
    unlike = len(_unlike(found))
    if not unlike:
        due = _beyond(found) or _soon(found)
        return say("No machine drifts unlike its fleet"), "open" if due else "good"
    told = plural(
        unlike, one=say("One machine drifts unlike its fleet"),
        many=say("{count} machines drift unlike their fleet", count=unlike),
    )  # fmt: skip
    return told, "open"


def _compared(found: FleetResult) -> Text:
    """What the verdict rests on."""
    again = {member.machine for of in found.values for member in of.members if seen_again(member)}
    return plural(
        len(again), one=say("one machine of {total} has certificates of two days", total=len(machines_of(found))),
        many=say("{count} machines of {total} have certificates of two days", count=len(again),
                 total=len(machines_of(found))),
    )  # fmt: skip


def _due(found: FleetResult) -> tuple[Text, ...]:
    beyond, soon = len(_beyond(found)), len(_soon(found))
    are = plural(
        beyond, one=say("One machine is beyond a limit"), many=say("{count} machines are beyond a limit", count=beyond)
    )
    will = say("{machines:capital} will probably be beyond a limit by {day}", machines=counted(soon),
               day=date_of(found.in_a_year))  # fmt: skip
    return (*((are,) if beyond else ()), *((will,) if soon else ()))


def _group(of: FleetValue) -> Text:
    return say("{quantity}: {group:small}", quantity=Verbatim(of.quantity), group=group_words(of.fleet.usual[0]))


def _counts(of: FleetValue, until: float) -> Text:
    """Machines of a value, and how many of them matter."""
    unlike, beyond, soon = (int(which.sum()) for which in (~of.belongs, of.beyond, of.crosses_by(until)))
    parts = [
        counted(len(of.members)),
        *([say("{count} unlike the fleet", count=unlike)] if unlike else []),
        *([say("{count} beyond the limit", count=beyond)] if beyond else []),
        *([say("{count} within a year", count=soon)] if soon else []),
    ]
    return commas(parts)


def _differs(of: FleetValue, i: int) -> Text:
    e = of.fleet.estimates
    return say(
        "{quantity}: {rate}, where the others let expect {expected} (p = {p})", quantity=Verbatim(of.quantity),
        rate=rate_words(e.rate[i], 1.96 * e.u_rate[i], of), expected=rate_words(e.expected[i], 1.96 * e.u_expected[i], of),
        p=number(e.p[i], ".1g"),
    )  # fmt: skip


def fleet_warnings(found: FleetResult) -> tuple[Text, ...]:
    """What the reader must know before using a figure."""
    return tuple(text for of in found.values for text in _warnings(of))


def _warnings(of: FleetValue) -> list[Text]:
    told: list[Text] = []
    if not of.fleet.chains.converged:
        told.append(say("{value}: the sampling did not converge (R-hat {rhat}); take its figures as rough",
                        value=called(of), rhat=number(of.fleet.chains.rhat_max, ".3f")))  # fmt: skip
    if of.left_out:
        told.append(plural(
            of.left_out,
            one=say("{value}: one certificate states no uncertainty and cannot be weighed", value=called(of)),
            many=say("{value}: {count} certificates state no uncertainty and cannot be weighed", value=called(of),
                     count=of.left_out),
        ))  # fmt: skip
    if len(of.members) == 1:
        told.append(say("{value}: one machine is no fleet; what machines have in common is assumed, not learnt",
                        value=called(of)))  # fmt: skip
    again = sum(seen_again(member) for member in of.members)
    if not again:
        told.append(say("{value}: no machine has certificates of two days; drift is assumed, not learnt",
                        value=called(of)))  # fmt: skip
    elif again == 1 < len(of.members):
        told.append(say("{value}: only one machine has certificates of two days; no other shows a drift to compare it with",
                        value=called(of)))  # fmt: skip
    return told
