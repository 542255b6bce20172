"""What the uncertainty of a part's characteristics is made of, what the calibration did not see, and what would reduce it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cmm_uq.analysis.parts.budget import FAMILIES, family_of, line_in_words
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.foreseen import ForeseenMeasurement, foretold
from cmm_uq.base.messages import (
    DASH,
    NOTHING,
    Number,
    Text,
    Verbatim,
    after,
    commas,
    day,
    holding,
    number,
    plural,
    say,
    signed,
)
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, section, table
from cmm_uq.certificate.part.figures import CharacteristicFigures, by_margin, critical, figures_of
from cmm_uq.certificate.part.measurement import PartMeasurement, UnseenError
from cmm_uq.certificate.part.plots import shares_plots
from cmm_uq.certificate.sections.conformity import mpe_words
from cmm_uq.certificate.sections.regions import (
    UNMOVED,
    changes_table,
    readings_table,
    recording_words,
    resting,
    shrinking,
    sizes_table,
    smaller_by,
)
from cmm_uq.certificate.wording import effect_title

DETAILED = 10  # characteristics whose budgets are listed line by line: those of least margin
# lines of a budget that are listed at most, the share from which on, and that from which on a factor of one is
_LINES, _LEAST, _FACTOR = 6, 0.01, 0.05
_WAYS = 6  # characteristics for which every way is shown
_GAIN, _HELPS = 0.02, 0.1  # of u, below which a way is no gain; of U, below which a further measurement is none


def line_words(line: str) -> Text:
    """A line of the budget in words, errors of the machine by their titles."""
    _, _, factor = line.partition(": ")
    return line_in_words(line, {factor: effect_title(factor)} if factor else {})


def budget_section(found: PartMeasurement) -> Section:
    """Shares of the variance: a picture of all characteristics, and lines of those of least margin."""
    title, every = say("What the uncertainty is made of"), figures_of(found)
    if not found.budget.causes:
        return section(title)
    families, shares = by_family(found)
    causes = [FAMILIES.get(family, Verbatim(family)) for family in families]
    detailed = sorted(by_margin(found)[:DETAILED], key=lambda one: one.place)
    return section(
        title, Paragraph(say("{sentence}", sentence=largest_words(critical(found)))),
        *shares_plots([one.titled for one in every], causes, shares), _lines(detailed, len(every)), _factors(detailed),
    )  # fmt: skip


def by_family(found: PartMeasurement) -> tuple[list[str], Floats]:
    """Names of the causes, largest over all first, and their total shares (g, c) over the sum of these."""
    budget = found.budget
    names = list(dict.fromkeys(family_of(line) for line in budget.causes))
    of = np.array([names.index(family_of(line)) for line in budget.causes])
    total = budget.total.clip(0)
    sums = np.array([total[of == g].sum(axis=0) for g in range(len(names))])
    whole = sums.sum(axis=0)
    shares = sums / np.where(whole > 0, whole, 1.0)
    order = sorted(range(len(names)), key=lambda g: -float(shares[g].sum()))
    return [names[g] for g in order], shares[order]


def largest_words(one: CharacteristicFigures) -> Text:
    budget = one.found.budget
    line = budget.worst(one.stated.name)
    return say("The largest part of the uncertainty of {name} comes from {cause:small} ({share} % of the variance).",
               name=one.called, cause=line_words(line), share=_percent(budget.share(line, one.place)))  # fmt: skip


def _percent(share: float) -> Number:
    share = min(share, 1.0)  # as far as draws know it
    return signed(100 * share, ".0f") if abs(share) >= 0.1 else signed(100 * share, ".2g")


def _lines(detailed: list[CharacteristicFigures], count: int) -> Table | None:
    heads = (Column(say("No.")), say("Characteristic"), say("Cause"), Column(say("First order"), unit("%")),
             Column(say("Total"), unit("%")))  # fmt: skip
    notes = holding(
        (True, say(
            "Shares of the variance (Sobol): first order is what knowing this cause alone would take away, total what would "
            "remain if all else were known. They differ where causes do not simply add up, as in a position or a form; they "
            "are known to about 1 %.")),
        (len(detailed) < count, after(_chosen(detailed), say("results.json has all."))),
    )  # fmt: skip
    return table(say("Budget by cause"), heads, (row for one in detailed for row in _budget(one)), *notes)


def _chosen(shown: list[CharacteristicFigures]) -> Text:
    if shown[0].found.nearest is None:
        return say("Shown are the first {count} characteristics.", count=len(shown))
    return say("Shown are the {count} characteristics with the least margin.", count=len(shown))


def _budget(one: CharacteristicFigures) -> Iterable[tuple[Text, ...]]:
    budget = one.found.budget
    first, total = budget.first[:, one.place], budget.total[:, one.place]
    order = np.argsort(-total, kind="stable").tolist()
    kept = [g for g in order if total[g] >= _LEAST][:_LINES]
    for g in kept:
        name = one.beside if g == order[0] else NOTHING
        yield one.number, name, line_words(budget.causes[g]), _percent(max(first[g], 0.0)), _percent(total[g])
    rest = [g for g in order if g not in kept and total[g] > 0]
    if rest:
        others = plural(len(rest), one=say("another cause"), many=say("{count} other causes", count=len(rest)))
        below = say("each below {share}", share=_percent(_above(total[rest])))
        yield one.number, NOTHING if kept else one.beside, others, DASH, below


def _above(shares: Floats) -> float:
    """A share of one digit that all are below."""
    top = max(float(shares.max()), 1e-4)
    place = 10.0 ** np.floor(np.log10(top))
    return float((np.floor(top / place) + 1) * place)


def _factors(detailed: list[CharacteristicFigures]) -> Table | None:
    """Within the machine, what hangs together by its calibration."""
    budget, rows = detailed[0].found.budget, list[tuple[Text, ...]]()
    for one in detailed:
        within = budget.within[:, one.place]
        order = np.argsort(-np.abs(within), kind="stable").tolist()
        kept = [f for f in order[:_LINES] if abs(within[f]) >= _FACTOR]
        rows += [
            (one.number, NOTHING if i else one.beside, line_words(budget.factors[f]), _percent(within[f]))
            for i, f in enumerate(kept)
        ]
    heads = (Column(say("No.")), say("Characteristic"), say("Error"), Column(say("Share"), unit("%")))
    return table(
        say("Errors that are known together, by name"),
        heads,
        rows,
        say(
            "The calibration ties these errors together. Each share is what knowing this error alone would take away, with "
            "what it tells of the others, so that together they may be more than 100 % or less."
        ),
    )


def unseen_section(found: PartMeasurement) -> Section:
    """What the calibration left free or did not see, named, with its share and what to measure."""
    title, further = say("What the calibration did not see"), found.further
    if not found.unseen:
        return section(title)
    heads = (say("Error"), Column(say("Largest share"), unit("%")), say("Of"), say("Why"),
             Column(say("u smaller by"), unit("%")), say("What would show or bound it"))  # fmt: skip
    machine = found.given.machine.machine
    rows = (
        (own[0].title, _percent(own[0].share), _whose(own), say("{why:capital}", why=own[0].why),
         _percent(smaller_by(own[0].share)), shrinking(own[0].effect, machine) or DASH)
        for own in _by_effect(found.unseen)
    )  # fmt: skip
    known = say(
        "u smaller by: what knowing this error exactly would take off u of that characteristic, 1 − √(1 − share)."
    )
    by = NOTHING if further is None else Verbatim(further.command)
    planned = holding(
        (further, further.text if further else by), (by, say("The set-ups are planned by: {command}", command=by))
    )
    return section(
        title, Paragraph(unseen_words(found), "warning"),
        table(say("Errors that the calibration leaves open"), heads, rows, known), *map(Paragraph, planned),
    )  # fmt: skip


def _by_effect(unseen: Iterable[UnseenError]) -> list[list[UnseenError]]:
    """What is told of one effect together, each largest share first."""
    found: dict[str, list[UnseenError]] = {}
    for one in unseen:
        found.setdefault(one.line, []).append(one)
    return sorted((sorted(own, key=lambda one: -one.share) for own in found.values()), key=lambda own: -own[0].share)


def _whose(own: list[UnseenError]) -> Text:
    first, more = say("characteristic {name}", name=Verbatim(own[0].characteristic)), len(own) - 1
    several = say("{name}, and {count} more", name=first, count=more)
    return plural(more, one=say("{name}, and one more", name=first), many=several) if more else first


def unseen_words(found: PartMeasurement) -> Text:
    most = _by_effect(found.unseen)[0][0]
    return say("{share} % of the variance of {name} comes from {error:small}: {why}.", share=_percent(most.share),
               name=_whose([most]), error=most.title, why=most.why)  # fmt: skip


def ways_section(found: PartMeasurement) -> Section:
    """What would make the uncertainties smaller, each way alone."""
    title, ways = say("What would reduce it"), found.ways
    if len(ways) < 2:
        return section(title)
    shown = sorted(by_margin(found)[:_WAYS], key=lambda one: one.place)
    each = (Column(say("u of No. {number}", number=one.number), one.scale.small) for one in shown)
    heads: tuple[Text | Column, ...] = (say("Way"), *each)
    rows = (
        (say("{way:capital}", way=way.name), *(one.small(float(way.u[one.place])) for one in shown)) for way in ways
    )
    known, zones = (number(100 * ways[-1].known(inferred=inferred), ".1g") for inferred in (False, True))
    zoned = found.measured is not None and np.any(never_negative(found.plan)[[one.place for one in shown]])
    notes = holding(
        (True, say("Each way alone, by virtual measurements of its own; u is known to {known} %.", known=known)),
        (zoned, say("u of form, orientation, location and runout is known to {known} %.", known=zones)),
        (len(shown) < len(found.stated), _chosen(shown)),
    )
    planned = table(say("Ways to measure"), heads, rows, *notes)
    return section(
        title,
        Paragraph(best_words(critical(found))),
        planned,
        *map(Paragraph, foreseen_words(found)),
        foreseen_table(found),
    )


def foreseen_section(found: PartMeasurement) -> Section:
    """What the set-ups of a plan do."""
    title = say("What these set-ups do for the part {name}", name=Verbatim(found.job.facts.part.name))
    return section(title, *map(Paragraph, foreseen_words(found)), foreseen_table(found))


def foreseen_words(found: PartMeasurement) -> list[Text]:
    """What a further measurement of the machine does to the characteristic that it helps most; none without any."""
    for one in _foreseen_of(found):
        for way in _helpful(one)[:1]:
            now, then = one.small(one.expanded), one.small(float(way.U[1, one.place]))
            return [
                say(
                    "To bring U of {name} from {now} to {then} {unit}: {measurement}.",
                    name=one.called,
                    now=now,
                    then=then,
                    unit=one.scale.small,
                    measurement=way.name,
                )
            ]
    none = say("No further measurement of the machine that was tried makes U smaller by more than a tenth.")
    return [none] if found.foreseen else []


def _foreseen_of(found: PartMeasurement) -> list[CharacteristicFigures]:
    """What is too uncertain, or all where nothing is, of what is foretold; the least margin first."""
    told, places = foretold(found.plan), found.too_uncertain or range(len(found.stated))
    return [one for one in by_margin(found) if one.place in places and told[one.place]][:_WAYS]


def _helpful(one: CharacteristicFigures) -> list[ForeseenMeasurement]:
    some = [way for way in one.found.foreseen if way.U[1, one.place] < (1 - _HELPS) * one.expanded]
    return sorted(some, key=lambda way: float(way.U[1, one.place]))


def foreseen_table(found: PartMeasurement) -> Table | None:
    """What further measurements of the machine do to U."""
    rows = list[tuple[Text, ...]]()
    for one in _foreseen_of(found):
        for i, way in enumerate(_helpful(one)):
            low, then, high = map(one.small, way.U[:, one.place].tolist())
            own = (NOTHING, NOTHING, NOTHING) if i else (one.beside, one.small(one.expanded), one.scale.small)
            rows.append((one.number, *own, way.name, then, say("{low} to {high}", low=low, high=high)))
    heads = (
        Column(say("No.")),
        say("Characteristic"),
        Column(say("U")),
        say("Unit"),
        say("Further measurement"),
        Column(say("U then")),
        Column(say("In eight of ten cases")),
    )
    return table(say("What further measurements of the machine would do"), heads, rows, say(
        "U then follows from all recordings together, in the median of machines as this one may be by those that there are. "
        "How large its errors are the further recording shows: where they are larger than they seem, U becomes no smaller. "
        "U of form, orientation, location and runout goes by their value, and is not foretold."
    ))  # fmt: skip


def best_words(one: CharacteristicFigures) -> Text:
    """The way that helps a characteristic most, in a sentence."""
    planned, *others = one.found.ways
    now = float(planned.u[one.place])
    best = min(others, key=lambda way: float(way.u[one.place]), default=None)
    if best is None or not now or 1 - best.u[one.place] / now < _GAIN:
        return say(
            "None of the ways that were tried makes the uncertainty of {name} smaller by more than 2 %.",
            name=one.called,
        )
    told = say("{way:capital} would reduce the uncertainty of {name} most, by {gain} %.", way=best.name, name=one.called,
               gain=number(100 * (1 - float(best.u[one.place]) / now), ".0f"))  # fmt: skip
    helped = [other.name for other in figures_of(one.found)
              if other.place != one.place and best.u[other.place] < (1 - _GAIN) * planned.u[other.place]]  # fmt: skip
    too = plural(len(helped), one=say("It helps characteristic {names} too.", names=commas(helped)),
                 many=say("It helps characteristics {names} too.", names=commas(helped)))  # fmt: skip
    return after(told, too if 0 < len(helped) <= _WAYS else NOTHING)


def priors_section(found: PartMeasurement) -> Section:
    """Sizes of the families, and what would change with other priors."""
    title = say("What the recording says of the machine's errors, and what it does not")
    read_by = readings_table(found.given.machine.machine, found.given.machine.statements)
    stated = read_by, _stated_bounds(found), _passed_tests(found)
    if not found.influence:
        return section(title, *stated)
    told = Paragraph(priors_words(found), "warning" if resting_on_priors(found) else "plain")
    changes = changes_table(found.influence, [Verbatim(one.name) for one in found.characteristics])
    return section(title, told, sizes_table(found.given.machine.scales), *stated, changes)


def resting_on_priors(found: PartMeasurement) -> list[str]:
    k = np.array([one.U / one.u if one.u else np.inf for one in found.stated])
    return [found.characteristics[i].name for i in resting(found.influence, k)]


def priors_words(found: PartMeasurement) -> Text:
    if not (names := resting_on_priors(found)):
        return UNMOVED
    return say(
        "{count} of {all} characteristics rest on what was taken for the machine's errors before its recording: their value "
        "or U changes by a tenth of U or more where a prior is half as wide, or twice.",
        count=len(names),
        all=len(found.stated),
    )


def _stated_bounds(found: PartMeasurement) -> Table | None:
    heads = (say("Error"), Column(say("At most"), unit("µm")), say("Stated by"), say("The recording"))
    said = {one.of: one for one in found.given.machine.statements}
    rows = (
        (effect_title(name), number(one.largest_um, "g"), Verbatim(one.source), recording_words(said.get(name)))
        for one in found.job.facts.machine_state.bound
        for name in one.errors
    )
    note = say(
        "Of play the gap, of a periodic error the amplitude, which 95 of 100 do not exceed. They are taken as stated unless "
        "the recording of the calibration denies them."
    )
    return table(say("Bounds that are stated"), heads, rows, note)


def _passed_tests(found: PartMeasurement) -> Table | None:
    heads = (
        say("Stated by"),
        say("Date"),
        say("Limit of E0"),
        Column(say("Lengths")),
        Column(say("Least chance to keep it")),
        say("Reckoned with"),
        Column(say("u without it, times"), NOTHING),
        say("Of"),
    )
    names, rows = [Verbatim(one.name) for one in found.characteristics], list[tuple[Text, ...]]()
    for one in found.standing.passed:
        i = int(np.argmax(one.u_without)) if one.u_without else -1
        most = (number(one.u_without[i], ".2f"), names[i]) if one.u_without else (DASH, DASH)
        facts = Verbatim(one.facts.certificate), day(one.facts.date), mpe_words(one.facts.mpe), number(one.lengths)
        rows.append((*facts, number(one.chance, ".2g"), say("yes") if one.used else say("no"), *most))
    return table(
        say("Tests of lengths that the machine passed"),
        heads,
        rows,
        say(
            "No length erred by more than its limit, whatever its error was. Where the lengths are not listed, they are "
            "those of ISO 10360-2 through the middle of the travel. The chance is of the length that the machine, as its "
            "recordings have it, keeps worst. u without all such tests is over u with them, of the characteristic where "
            "that is the most."
        ),
    )
