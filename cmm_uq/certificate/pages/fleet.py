"""Pages of many machines: which are due for calibration, and how those of a fleet drift, of however many those that matter."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, number, plural, say, semicolons, sentences
from cmm_uq.base.points import Ints
from cmm_uq.base.units import unit_as_written
from cmm_uq.certificate import document as doc
from cmm_uq.certificate.document import Column, Document, Overview, Paragraph, Plot, Section, Standing, Table, columns
from cmm_uq.certificate.pages import fleet_summary as words
from cmm_uq.certificate.plots.style import ACCENT, INK, dots, drawn, named_rows, picture, strokes
from cmm_uq.laboratory.due.drift import PARTS
from cmm_uq.laboratory.due.due import DueItem, State
from cmm_uq.laboratory.due.fleet import FALSE_DISCOVERIES, FleetResult, FleetValue, UsualRate

STATE_WORDS: Mapping[State, Text] = {
    "overdue": say("overdue"), "due": say("due soon"), "later": say("later"), "unknown": say("no date"),
}  # fmt: skip


def due_document(items: Sequence[DueItem], on: dt.date, within: dt.timedelta) -> Document:
    each = [(say("Machines"), [one for one in items if one.item == "machine"]),
            (say("Artefacts"), [one for one in items if one.item == "artefact"])]  # fmt: skip
    sections = tuple(Section(title, (_table(rows, on, within, title),)) for title, rows in each if rows)
    (_, machines), (_, artefacts) = each
    count, blocked = len(artefacts), sum(one.blocked is not None for one in items)
    counted_artefacts = plural(count, one=say("one artefact"), many=say("{count} artefacts", count=count))
    looked_at = say("{machines} and {artefacts}", machines=words.counted(len(machines)), artefacts=counted_artefacts)
    out_of_date = ((say("Artefact out of date"), words.counted(blocked)),) if blocked else ()
    overview = Overview(*counts(items, on, within), ((say("Looked at"), looked_at), *out_of_date))
    subject = say("on {on}, and within {days} days", on=day(on), days=within.days)
    nothing = Section(say("Machines"), (Paragraph(say("Nothing is due.")),))
    return doc.program_page(say("What is due for calibration"), day(on), subject, sections or (nothing,), "due.json",
                            end=say("End of list"), overview=overview)  # fmt: skip


def counts(items: Iterable[DueItem], on: dt.date, within: dt.timedelta) -> tuple[Text, Standing]:
    """How many are overdue, due soon and without a date, in words; and what that means."""
    found = Counter(one.state(on, within) for one in items)
    words: tuple[tuple[State, Text], ...] = (
        ("overdue", say("{count} overdue", count=found["overdue"])),
        ("due", say("{count} due within {days} days", count=found["due"], days=within.days)),
        ("unknown", say("{count} without a date", count=found["unknown"])),
    )
    parts = [text for state, text in words if found[state]]
    standing: Standing = "bad" if found["overdue"] else "open" if parts else "good"
    return (commas(parts) if parts else say("Nothing due within {days} days", days=within.days)), standing


def _table(rows: Sequence[DueItem], on: dt.date, within: dt.timedelta, title: Text) -> Table:
    cells = tuple(
        (
            DASH if one.due is None else day(one.due), STATE_WORDS[one.state(on, within)], Verbatim(one.serial),
            Verbatim(one.name) if one.name else DASH, Verbatim(one.place) if one.place else DASH,
            DASH if one.last is None else day(one.last), reason(one),
        )
        for one in rows
    )  # fmt: skip
    # dates are not broken at their hyphens
    heads = (Column(say("Due")), say("State"), say("Serial number"), say("Name"), say("Place"), Column(say("Last calibrated")),
             say("Why"))  # fmt: skip
    return Table(title, columns(heads), cells)


def reason(one: DueItem) -> Text:
    """Why an item is due then, with all that is remarked of it."""
    parts = semicolons([one.why, *((one.blocked,) if one.blocked else ())])
    return sentences((say("{parts:capital}.", parts=parts), *one.remarks))


def due_row(one: DueItem, on: dt.date, within: dt.timedelta) -> tuple[Text, ...]:
    date: Text = DASH
    left: Text = NOTHING
    if one.due is not None:
        date, days = day(one.due), (one.due - on).days
        left = say("in {days} d", days=number(days)) if days >= 0 else say("{days} d ago", days=number(-days))
    serial = Verbatim(one.serial)
    what = say("machine {serial}", serial=serial) if one.item == "machine" else say("artefact {serial}", serial=serial)
    return date, STATE_WORDS[one.state(on, within)], left, what, reason(one)


def fleet_plot(
    rows: Sequence[UsualRate], names: Sequence[Text], *, axis: Text, caption: Text, alternative: Text
) -> Plot:
    rate, low, high = (np.array([getattr(row, name) for row in rows]) for name in ("rate", "lower", "upper"))
    at, height = np.arange(len(rows), dtype=np.float64), 14 + 5.5 * len(rows)
    with picture(height, left=0.3, right=0.985, bottom=9 / height, top=1 - 2 / height) as (figure, ax):
        ax.axvline(0, color=INK, lw=0.7, zorder=1)
        strokes(ax, low, high, at, at, lw=1.6, color=ACCENT, solid_capstyle="butt", zorder=2)
        dots(ax, rate, at, 4.0, ACCENT)
        named_rows(ax, at, names)
        ax.set(xlabel=axis)
        return drawn(figure, caption, alternative, "rates")


MOST_GROUPS = 12  # models and places of a value, those with most machines
MOST_MACHINES = 15
"""Machines of a value that do not belong, that are beyond their limit, and that cross it soonest: so many each."""

SPREADS: dict[str, Text] = {
    "rate_sd": say("Rates of machines of one model and place differ by"), "model_sd": say("Rates of models differ by"),
    "place_sd": say("Rates of places differ by"), "walk": say("Wandering adds in a year"),
    "first_sd": say("Errors at the first certificate"), "as_left_sd": say("Errors after an adjustment"),
    "steps_per_year": say("Steps in a year"), "step_sd": say("Size of a step"),
}  # fmt: skip


def all_values(found: FleetResult) -> Table:
    """A row a value: what is usual, and how many machines matter."""
    until, rows = found.in_a_year, []
    for of in found.values:
        unlike = number(int((~of.belongs).sum())) if of.compared else say("not compared")
        due: tuple[Text, Text] = DASH, DASH
        if of.fleet.estimates.crossing is not None:
            due = number(int(of.beyond.sum())), number(int(of.crosses_by(until).sum()))
        rows.append((words.called(of), number(len(of.members)), words.usual_rate(of), unlike, *due))
    figures = (Column(head) for head in (say("Unlike the fleet"), say("Beyond the limit"), say("Beyond within a year")))
    note = say(
        "Beyond: at a machine's last certificate, and by {day}, a year after the newest of all, each with a probability of "
        "50 % or more.",
        day=words.date_of(until),
    )
    heads = columns((say("Value"), Column(say("Machines")), say("Average drift, U (95 %)"), *figures))
    return Table(say("What is usual, and how many machines matter"), heads, tuple(rows), (note,))


def groups_shown(of: FleetValue) -> tuple[UsualRate, ...]:
    """The average machine, and the models and places with most machines, in their order."""
    average, *groups = of.fleet.usual
    most = sorted(groups, key=lambda each: -each.machines)[:MOST_GROUPS]
    return average, *(each for each in groups if each in most)


def usual_table(of: FleetValue) -> Table:
    spec, shown, per_year = words.digits(of), groups_shown(of), words.per_year(of)
    heads = (say("Machines"), Column(say("Number")), Column(say("Rate"), per_year), Column(say("U (95 %)"), per_year))
    rate = words.signed_rate
    rows = (
        (words.group_words(one), number(one.machines), rate(one.rate, spec), number(1.96 * one.u, spec))
        for one in shown
    )
    notes: list[Text] = [say("A model at the fleet's average place; a place for the fleet's average machine.")]
    if left := len(of.fleet.usual) - len(shown):
        notes.append(plural(
            left, one=say("One more model or place has fewer machines; fleet.json has all."),
            many=say("{count} more models and places have fewer machines; fleet.json has all.", count=left),
        ))  # fmt: skip
    return Table(say("Usual drift"), columns(heads), tuple(rows), tuple(notes))


def outsiders(of: FleetValue) -> doc.Block:
    """Machines that do not belong, the clearest first; or that there are none, or that nobody can know."""
    if not of.compared:
        return Paragraph(say("Not enough history to compare machines: two at least need certificates of two days."))
    which = np.flatnonzero(~of.belongs)
    if not len(which):
        return Paragraph(say("No machine drifts unlike the others."))
    e, spec = of.fleet.estimates, words.digits(of)
    shown = which[np.argsort(e.p[which], kind="stable")][:MOST_MACHINES]
    heads = (*_own(of), Column(say("Expected"), words.per_year(of)), Column(say("p")))
    rows = tuple(
        (*_own_row(of, i), words.signed_rate(e.expected[i], spec), number(e.p[i], ".2g")) for i in map(int, shown)
    )
    note = say(
        "Compared with what all other machines let expect, before its own certificates; of all machines and values named so, "
        "about {part:.0f} % are by chance (Benjamini and Hochberg).",
        part=100 * FALSE_DISCOVERIES,
    )
    left = () if len(shown) == len(which) else (_left_out(len(shown), len(which)),)
    return Table(say("Machines that do not belong"), heads, rows, (note, *left))


def soonest(of: FleetValue) -> Table:
    """Machines beyond their limit, and those that cross it soonest; where none does, those that drift fastest."""
    N, shown = len(of.members), _soonest(of)
    heads = (*_own(of), *columns((say("Limit crossed"), say("90 % from"), say("90 % to"))))
    notes: list[Text] = [
        say("Rate with the fleet as prior: little history of its own is filled up from models and places like it.")
    ]
    caption: Text = say("Machines")
    if len(shown) < N:
        caption = say("Machines that drift fastest")
        if np.isfinite(of.median[shown]).all():
            caption = say("Machines beyond their limit, and those that cross it soonest")
        notes.append(_left_out(len(shown), N))
    return Table(caption, heads, tuple((*_own_row(of, i), *_crossed(of, i)) for i in map(int, shown)), tuple(notes))


def _soonest(of: FleetValue) -> Ints:
    """Rows of the machines, those farthest beyond their limit first."""
    crossing = of.fleet.estimates.crossing
    limit = np.array([member.limit or np.inf for member in of.members])
    excess = np.zeros(len(limit)) if crossing is None else np.abs(crossing.level) / limit
    when = np.where(of.beyond, -excess, of.crosses)
    order = np.lexsort((-np.abs(of.fleet.estimates.rate), when, ~of.beyond))
    beyond, ahead = order[of.beyond[order]], order[~of.beyond[order]]
    if len(order) > MOST_MACHINES and np.isfinite(of.median).any():
        ahead = ahead[np.isfinite(of.median[ahead])]
    return np.concatenate([beyond[:MOST_MACHINES], ahead[:MOST_MACHINES]])


def _left_out(shown: int, total: int) -> Text:
    return say("{count} of {total} machines; fleet.json and fleet.csv have all.", count=shown, total=total)


def _own(of: FleetValue) -> tuple[Column, ...]:
    rate = Column(say("Rate, U (95 %)"), words.per_year(of))
    return columns((say("Machine"), say("Model"), say("Place"), Column(say("Certificates")), rate))


def _own_row(of: FleetValue, i: int) -> tuple[Text, ...]:
    e, member, spec = of.fleet.estimates, of.members[i], words.digits(of)
    return (
        Verbatim(member.machine), Verbatim(member.model) if member.model else DASH,
        Verbatim(member.place) if member.place else DASH, number(len(member.history.day)),
        say("{rate} ± {U}", rate=words.signed_rate(e.rate[i], spec), U=number(1.96 * e.u_rate[i], spec)),
    )  # fmt: skip


def _crossed(of: FleetValue, i: int) -> tuple[Text, Text, Text]:
    crossing = of.fleet.estimates.crossing
    if crossing is None or of.members[i].limit is None:
        return DASH, DASH, DASH
    if of.beyond[i]:
        return say("already"), DASH, DASH
    days = (crossing.one(i).quantile(part) for part in PARTS)
    low, middle, high = (say("not in 40 years") if when is None else day(when) for when in days)
    return middle, low, high


def spreads_table(of: FleetValue) -> Table:
    rate = words.per_year(of)
    yearly = {"rate_sd": rate, "model_sd": rate, "place_sd": rate, "steps_per_year": NOTHING}
    rows = tuple(
        (SPREADS[each.name], number(each.median, ".2g"),
         say("{low} to {high}", low=number(each.lower, ".2g"), high=number(each.upper, ".2g")),
         yearly.get(each.name, unit_as_written(of.unit)))
        for each in of.fleet.spreads
    )  # fmt: skip
    heads = columns((say("Quantity"), Column(say("Median")), say("95 % interval"), say("Unit")))
    return Table(say("How machines differ"), heads, rows)


def fleet_document(found: FleetResult) -> Document:
    values = plural(len(found.values), one=say("one value"), many=say("{count} values", count=len(found.values)))
    subject = say("{machines}, {values}", machines=words.counted(len(words.machines_of(found))), values=values)
    each = (Section(words.called(of), _blocks(of)) for of in found.values)
    return doc.program_page(
        say("Drift of a fleet"), words.date_of(found.newest), subject,
        (Section(say("All values"), (all_values(found),)), *each), "fleet.json", "fleet.csv", seed=found.seed,
        warnings=words.fleet_warnings(found), end=say("End of page"), overview=words.fleet_overview(found),
    )  # fmt: skip


def _blocks(of: FleetValue) -> tuple[doc.Block, ...]:
    shown, fleet = groups_shown(of), of.fleet
    plot = fleet_plot(
        shown,
        [words.group_words(each) for each in shown],
        axis=say("Rate in {unit}, with 95 % interval", unit=words.per_year(of)),
        caption=say("Usual drift of models and places."),
        alternative=say("Average machine: {rate}.", rate=words.usual_rate(of)),
    )
    sampled = say(
        "Hyper-parameters by importance sampling from {machines}: {draws} draws, worth {worth} independent ones.",
        machines=words.counted(fleet.learnt_from), draws=fleet.draws, worth=number(fleet.worth, ".0f"),
    )  # fmt: skip
    return usual_table(of), plot, outsiders(of), soonest(of), spreads_table(of), Paragraph(sampled, tone="note")
