"""A fleet as a document, and in a few lines for a terminal."""

from __future__ import annotations

import datetime as dt

import numpy as np

from cmm_uq import __version__
from cmm_uq.documents.document import Block, Column, Document, Overview, Paragraph, Section, Standing, Table
from cmm_uq.documents.fleet_plot import fleet_plot
from cmm_uq.documents.in_short import Summary, Verdict
from cmm_uq.messages import DASH, NOTHING, Number, Text, Verbatim, commas, day, number, plural, say, signed
from cmm_uq.recertification.drift import PARTS
from cmm_uq.recertification.fleet import FALSE_DISCOVERIES, Spread, Usual
from cmm_uq.recertification.fleet_found import FleetFound, OfValue
from cmm_uq.units import unit_as_written

MOST_ROWS = 100
"""Machines in a table; fleet.json has all."""

SPREADS: dict[str, Text] = {
    "rate_sd": say("Rates of machines of one model and place differ by"),
    "model_sd": say("Rates of models differ by"),
    "place_sd": say("Rates of places differ by"),
    "walk": say("Wandering adds in a year"),
    "first_sd": say("Errors at the first certificate"),
    "as_left_sd": say("Errors after an adjustment"),
    "steps_per_year": say("Steps in a year"),
    "step_sd": say("Size of a step"),
}


def fleet_document(found: FleetFound) -> Document:
    """The page of a fleet."""
    word, standing, rows = _verdict(found)
    return Document(
        title=say("Drift of a fleet"),
        number=_newest(found),
        subject=say(
            "{machines}, {values}",
            machines=_machines(found),
            values=plural(len(found.values), one=say("one value"), many=say("{count} values", count=len(found.values))),
        ),
        issuer=(),
        particulars=(),
        warnings=tuple(_warnings(found)),
        sections=tuple(Section(_called(of), _blocks(of)) for of in found.values),
        statements=(),
        signatures=(),
        attachments=(Verbatim("fleet.json"),),
        produced_by=say("cmm-uq {version}, seed {seed}", version=Verbatim(__version__), seed=found.seed),
        end=say("End of page"),
        overview=Overview(
            word,
            standing,
            (
                *rows,
                *(
                    (say("{quantity}, average machine", quantity=Verbatim(of.quantity)), _usual_rate(of))
                    for of in found.values
                ),
            ),
        ),
    )


def fleet_summary(found: FleetFound) -> Summary:
    """The same for a terminal."""
    word, standing, _ = _verdict(found)
    verdicts = tuple(
        Verdict("DIFFERS", "open", say("machine {serial}", serial=Verbatim(of.members[i].machine)), (_differs(of, i),))
        for of, i in found.outsiders
    )
    good = Verdict("ALIKE", standing, word, ())
    return Summary(
        subject=_machines(found), verdicts=verdicts or (good,),
        figures=tuple((_group(of, each), _rate(each.rate, 1.96 * each.u, of), _counted(each.machines))
                      for of in found.values for each in of.fleet.usual),
        warnings=tuple(_warnings(found)),
    )  # fmt: skip


def _verdict(found: FleetFound) -> tuple[Text, Standing, tuple[tuple[Text, Text], ...]]:
    outsiders = sorted({of.members[i].machine for of, i in found.outsiders})
    if not outsiders:
        return say("No machine drifts unlike its fleet"), "good", ()
    one, many = (
        say("One machine drifts unlike its fleet"),
        say("{count} machines drift unlike their fleet", count=len(outsiders)),
    )
    serials = commas([Verbatim(serial) for serial in outsiders[:12]])
    return plural(len(outsiders), one=one, many=many), "open", ((say("Serial numbers"), serials),)


def _machines(found: FleetFound) -> Text:
    return _counted(len({member.machine for of in found.values for member in of.members}))


def _newest(found: FleetFound) -> Text:
    """Day of the newest certificate: what the page is as of."""
    newest = max(float(member.history.day[-1]) for of in found.values for member in of.members)
    return day(dt.date.fromordinal(int(newest)))


def _counted(count: int) -> Text:
    return plural(count, one=say("one machine"), many=say("{count} machines", count=count))


def _called(of: OfValue) -> Text:
    return say("{quantity} ({name})", quantity=Verbatim(of.quantity), name=Verbatim(of.name))


def _group(of: OfValue, each: Usual) -> Text:
    return say("{quantity}: {group:small}", quantity=Verbatim(of.quantity), group=group_words(each))


def group_words(each: Usual) -> Text:
    """What a group of machines is called."""
    if each.kind == "fleet":
        return say("Average machine")
    name = Verbatim(each.name) if each.name else say("not stated")
    return say("Model {name}", name=name) if each.kind == "model" else say("Place {name}", name=name)


def _per_year(of: OfValue) -> Text:
    return say("{unit}/year", unit=unit_as_written(of.unit) or Verbatim("1"))


def _digits(of: OfValue) -> str:
    """Format of rates: two digits of the usual standard uncertainty of a machine's."""
    u = float(np.median(of.fleet.estimates.u_rate))
    return f".{int(np.clip(1 - np.floor(np.log10(u)), 0, 9))}f" if u > 0 else ".3g"


def _signed(rate: float, spec: str) -> Number:
    """Without a sign where nothing is left of it."""
    text = format(rate, spec)
    return number(0.0, spec) if float(text) == 0 else signed(rate, spec)


def _rate(rate: float, U: float, of: OfValue) -> Text:
    spec = _digits(of)
    return say("{rate} ± {U} {unit}", rate=_signed(rate, spec), U=number(U, spec), unit=_per_year(of))


def _usual_rate(of: OfValue) -> Text:
    average = of.fleet.usual[0]
    return _rate(average.rate, 1.96 * average.u, of)


def _differs(of: OfValue, i: int) -> Text:
    e = of.fleet.estimates
    return say(
        "{quantity}: {rate}, where the others let expect {expected} (p = {p})", quantity=Verbatim(of.quantity),
        rate=_rate(e.rate[i], 1.96 * e.u_rate[i], of), expected=_rate(e.expected[i], 1.96 * e.u_expected[i], of),
        p=number(e.p[i], ".1g"),
    )  # fmt: skip


def _warnings(found: FleetFound) -> list[Text]:
    told: list[Text] = []
    for of in found.values:
        if not of.fleet.chains.converged:
            told.append(say("{value}: the sampling did not converge (R-hat {rhat}); take its figures as rough",
                            value=_called(of), rhat=number(of.fleet.chains.rhat_max, ".3f")))  # fmt: skip
        if of.left_out:
            one, many = say("One certificate states"), say("{count} certificates state", count=of.left_out)
            told.append(say("{value}: {certificates:small} no uncertainty and cannot be weighed", value=_called(of),
                            certificates=plural(of.left_out, one=one, many=many)))  # fmt: skip
        if len(of.members) == 1:
            told.append(say("{value}: one machine is no fleet; what machines have in common is assumed, not learnt",
                            value=_called(of)))  # fmt: skip
        if all(np.ptp(member.history.day) == 0 for member in of.members):
            told.append(say("{value}: no machine has certificates of two days; drift is assumed, not learnt",
                            value=_called(of)))  # fmt: skip
    return told


def _blocks(of: OfValue) -> tuple[Block, ...]:
    groups = _usual(of)
    picture = fleet_plot(
        of.fleet.usual[:40], [group_words(each) for each in of.fleet.usual[:40]],
        axis=say("Rate in {unit}, with 95 % interval", unit=_per_year(of)), caption=say("Usual drift of models and places."),
        alternative=say("Average machine: {rate}.", rate=_usual_rate(of)),
    )  # fmt: skip
    return (groups, picture, *_outsiders(of), _each(of), _spreads(of), Paragraph(_sampled(of), tone="note"))


def _usual(of: OfValue) -> Table:
    spec = _digits(of)
    columns = (
        Column(say("Machines"), numeric=False), Column(say("Number")), Column(say("Rate"), _per_year(of)),
        Column(say("U (95 %)"), _per_year(of)),
    )  # fmt: skip
    rows = tuple(
        (group_words(each), number(each.machines), _signed(each.rate, spec), number(1.96 * each.u, spec))
        for each in of.fleet.usual
    )
    note = say("A model at the fleet's average place; a place for the fleet's average machine.")
    return Table(say("Usual drift"), columns, rows, (note,))


def _outsiders(of: OfValue) -> tuple[Block, ...]:
    which = np.flatnonzero(~of.belongs)
    if not len(which):
        return (Paragraph(say("No machine drifts unlike the others.")),)
    note = say(
        "Compared with what all other machines let expect, before its own certificates; of all machines and values named so, "
        "about {part:.0f} % are by chance (Benjamini and Hochberg).", part=100 * FALSE_DISCOVERIES,
    )  # fmt: skip
    return (Table(say("Machines that do not belong"), _columns(of), tuple(_row(of, int(i)) for i in which), (note,)),)


def _each(of: OfValue) -> Table:
    """Machines, first those that will first cross their limit."""
    e = of.fleet.estimates
    when = np.full(len(of.members), np.inf) if e.crossing is None else e.crossing.last + e.crossing.quantile(0.5)
    order = np.lexsort((-np.abs(e.rate), when))[:MOST_ROWS]
    notes = [
        say("Rate with the fleet as prior: little history of its own is filled up from models and places like it.")
    ]
    if len(order) < len(of.members):
        notes.append(say("The first {count} of {total}; fleet.json has all.", count=len(order), total=len(of.members)))
    return Table(say("Machines"), _columns(of), tuple(_row(of, int(i)) for i in order), tuple(notes))


def _columns(of: OfValue) -> tuple[Column, ...]:
    return (
        Column(say("Machine"), numeric=False), Column(say("Model"), numeric=False), Column(say("Place"), numeric=False),
        Column(say("Certificates")), Column(say("Rate"), _per_year(of)), Column(say("U (95 %)"), _per_year(of)),
        Column(say("Expected"), _per_year(of)), Column(say("p")), Column(say("Limit crossed"), numeric=False),
        Column(say("90 % interval"), numeric=False),
    )  # fmt: skip


def _row(of: OfValue, i: int) -> tuple[Text, ...]:
    e, member, spec = of.fleet.estimates, of.members[i], _digits(of)
    return (
        Verbatim(member.machine), Verbatim(member.model) if member.model else DASH,
        Verbatim(member.place) if member.place else DASH, number(len(member.history.day)), _signed(e.rate[i], spec),
        number(1.96 * e.u_rate[i], spec), _signed(e.expected[i], spec), number(e.p[i], ".2g"), *_crossed(of, i),
    )  # fmt: skip


def _crossed(of: OfValue, i: int) -> tuple[Text, Text]:
    """Median day, and the interval."""
    crossing = of.fleet.estimates.crossing
    if crossing is None or of.members[i].limit is None:
        return DASH, DASH
    one = crossing.one(i)
    if one.already >= 0.5:
        return say("already"), DASH
    low, middle, high = map(one.quantile, PARTS)
    when = say("not in 40 years") if middle is None else day(middle)
    if low is None or high is None:
        return when, DASH if low is None else say("from {low}", low=day(low))
    return when, say("{low} to\n{high}", low=day(low), high=day(high))


def _spreads(of: OfValue) -> Table:
    columns = (Column(say("Quantity"), numeric=False), Column(say("Median")), Column(say("95 % interval"), numeric=False),
               Column(say("Unit"), numeric=False))  # fmt: skip
    return Table(say("How machines differ"), columns, tuple(_spread(of, each) for each in of.fleet.spreads))


def _spread(of: OfValue, each: Spread) -> tuple[Text, ...]:
    own = unit_as_written(of.unit)
    units = {"rate_sd": _per_year(of), "model_sd": _per_year(of), "place_sd": _per_year(of), "steps_per_year": NOTHING}
    return (
        SPREADS[each.name], number(each.median, ".2g"),
        say("{low} to {high}", low=number(each.lower, ".2g"), high=number(each.upper, ".2g")), units.get(each.name, own),
    )  # fmt: skip


def _sampled(of: OfValue) -> Text:
    chains = of.fleet.chains
    return say(
        "Hyper-parameters sampled by {sampler} from {machines}: R-hat at most {rhat}, at least {ess} effective samples, "
        "{steps} steps.", sampler=Verbatim(chains.sampler), machines=_counted(of.fleet.learnt_from),
        rhat=number(chains.rhat_max, ".3f"), ess=number(chains.ess_min, ".0f"), steps=chains.steps,
    )  # fmt: skip
