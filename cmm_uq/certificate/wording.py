"""How figures, outcomes, effects and names are said in documents and on the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, foreign, lines, number, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Standing
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every, stated_effects
from cmm_uq.machine.physics.effect import Amount, Effect
from cmm_uq.machine.physics.stated import StatedEffect
from cmm_uq.maths.uncertainty.quantity import Quantity, figure, limit_in_full, rounded

if TYPE_CHECKING:
    from cmm_uq.analysis.conformity.statement import Statement
    from cmm_uq.certificate.result import Result

OUTCOME_WORDS: Mapping[str, Text] = {
    "pass": say("pass"), "fail": say("fail"), "undecided": say("undecided"), "incomplete": say("incomplete"),
    "conditional pass": say("conditional pass"), "conditional fail": say("conditional fail"), "remeasure": say("remeasure"),
}  # fmt: skip
"""What a statement of conformity comes to, in a table."""

SIGN = say("Sign rule: true coordinate = indicated coordinate + error.")

UNCERTAINTY = say(
    "U is the expanded uncertainty for a coverage probability of 95 %, from the 95 % coverage interval of the posterior "
    "distribution; k = U/u is its ratio to the standard uncertainty u."
)
TEMPERATURES: Mapping[str, Text] = {
    "temp_artefact_c": say("artefact"), "temp_x_c": say("scale of X"), "temp_y_c": say("scale of Y"),
    "temp_z_c": say("scale of Z"), "temp_air_c": say("air"), "temp_table_top_c": say("table, top"),
    "temp_table_bottom_c": say("table, bottom"),
}  # fmt: skip

NO_FACTOR = say("–")  # in place of a coverage factor that would mean nothing
_ONE_HILL = 1.6
"""Least U/u of a distribution with one hill: a rectangle has 1.645. A smaller one has several, between which nothing lies."""


def expanded(quantity: Quantity) -> tuple[Text, Text, Text]:
    """Value, U to two significant digits, and k where U/u is one; what has one side is its interval, without the other two."""
    if quantity.one_sided:
        return (interval_of(quantity), NO_FACTOR, NO_FACTOR)
    value, uncertainty = rounded(quantity.value, quantity.expanded)
    k = quantity.coverage_factor
    return (value, uncertainty, (NO_FACTOR if k is None or k < _ONE_HILL else number(k, ".2f")))


def stated(quantity: Quantity) -> tuple[Text, Text, Text]:
    """The same as a table states it: of what is skewed the interval stands in place of U, and there is no k."""
    value, U, k = expanded(quantity)
    return (value, interval_of(quantity), NO_FACTOR) if quantity.skewed and not quantity.one_sided else (value, U, k)


def interval_of(quantity: Quantity) -> Text:
    """Its 95 % interval, to the digits of U."""
    low, high = (rounded(end, quantity.expanded)[0] for end in quantity.interval95)
    return say("{low} to {high}", low=low, high=high)


def with_uncertainty(quantity: Quantity) -> Text:
    """Value ± U, or the interval of what has one side; its unit follows."""
    value, U, _ = expanded(quantity)
    return value if quantity.one_sided else say("{value} ± {U}", value=value, U=U)


def skewed_note(quantities: Iterable[Quantity]) -> tuple[Text, ...]:
    """What an interval in the column of U is; nothing where none is there."""
    note = say(
        "Two figures in place of U: the ends of the 95 % interval of a skewed distribution. Its sides differ by more than a "
        "tenth, so that value ± U does not say it (JCGM 101:2008, 5.3.4)."
    )
    return (note,) if any(one.skewed and not one.one_sided for one in quantities) else ()


CERTAIN = 1e-4  # A probability nearer to 0 or 1 than this is printed as less or more than it


TOO_UNCERTAIN = say("Not decided: the uncertainty is too large for any value to be accepted")


def probability(p: float) -> Text:
    """A probability in per cent that never claims certainty."""
    if p < CERTAIN:
        return say("<\u00a0{p}\u00a0%", p=number(100 * CERTAIN, "g"))
    if p > 1 - CERTAIN:
        return say(">\u00a0{p}\u00a0%", p=number(100 * (1 - CERTAIN), "g"))
    digits = 2 if p < 0.5 else 3 if p < 0.999 else 4
    return say("{p}\u00a0%", p=number(100 * p, f".{digits}g"))


def measured(statement: Statement) -> tuple[Text, Text]:
    """Value that a statement names and its expanded uncertainty (k = 2), as text; the latter empty where none is known."""
    if statement.u_um > 0:
        return rounded(statement.value_um, 2 * statement.u_um)
    return (number(statement.value_um, ".4g"), NOTHING)


def stated_value(value: float, U: float | None, *, signed: bool) -> Text:
    """Value ± U; of a size that is never negative (``signed`` false) and may be zero, its interval."""
    if not U:
        return number(value, ".4g")
    shown, expanded_ = rounded(value, U)
    if not signed and value < U:
        return say("{low} to {high}", low=rounded(0.0, U)[0], high=rounded(value + U, U)[0])
    return say("{value} ± {U}", value=shown, U=expanded_)


def stated_row(outcome: str, value: Text, unit: Text, limit: float | None = None) -> Text:
    """A statement of conformity in a line: outcome, value with what it is known to, limit."""
    word = OUTCOME_WORDS.get(outcome, say("undecided"))
    if limit is None:
        return say("{outcome}: {value} {unit}", outcome=word, value=value, unit=unit)
    return say("{outcome}: {value} {unit}, limit {limit} {unit}", outcome=word, value=value, unit=unit,
               limit=limit_in_full(limit))  # fmt: skip


def title_of(key: tuple[str, str], result: Result) -> Text:
    """A parameter in words: ``Squareness X–Y``; the effect alone where it has no other."""
    owner, name = key
    if owner == ARTEFACT:
        return next(size.title for size in result.artefact.sizes if size.name == name)
    return parameter_title(owner, name, result.model.effects)


def refusal(error: CmmUqError) -> Text:
    """Why something has no solution, as the error says it."""
    where, problem, fix = Verbatim(error.where or ""), foreign(error.problem), foreign(error.fix or "")
    told = say("{where}: {problem}. {fix}", where=where, problem=problem, fix=fix)
    return told if told == str(error) else Verbatim(str(error))


def numbered(measurement: int, repeat: int | None) -> Text:
    """A measurement by its number, with that of its repeat where there are several: ``12 (2)``."""
    if repeat is None:
        return number(measurement)
    return say("{measurement} ({repeat})", measurement=measurement, repeat=repeat)


def deviating(what: Text, reference: Text, before_um: Floats, after_um: Floats, spec: str = ".1f") -> Text:
    """The sentence in place of a picture of deviations: their range as recorded, and after the fitted model.

    ``what``: deviates, with a verb: ``12 lengths: as recorded they deviate``; ``before_um, after_um``: deviations, µm.
    """
    ends = (before_um.min(), before_um.max(), after_um.min(), after_um.max())
    low, high, low_after, high_after = (number(float(end), spec) for end in ends)
    if reference:
        return say(
            "{what} by {low} to {high} µm {reference}; after the fitted model {low_after} to {high_after} µm remain.",
            what=what, reference=reference, low=low, high=high, low_after=low_after, high_after=high_after,
        )  # fmt: skip
    return say(
        "{what} by {low} to {high} µm; after the fitted model {low_after} to {high_after} µm remain.",
        what=what, low=low, high=high, low_after=low_after, high_after=high_after,
    )  # fmt: skip


Figure = tuple[Text, Text, Text]  # name of a quantity, its value with U and unit, its coverage factor


@dataclass(frozen=True)
class Headline:
    """A decision, or what a diagnosis comes to."""

    word: str  # the outcome in capitals
    standing: Standing  # what that means for the machine
    subject: Text  # what was decided
    remarks: tuple[Text, ...]  # the figures it rests on, and what is missing


@dataclass(frozen=True)
class Summary:
    subject: Text = NOTHING  # what was measured
    date: Text = NOTHING
    verdicts: tuple[Headline, ...] = ()  # what it comes to
    figures: tuple[Figure, ...] = ()
    remarks: tuple[Text, ...] = ()
    details: tuple[tuple[Text, ...], ...] = ()  # rows of a table that only who asks for everything wants to see
    warnings: tuple[Text, ...] = ()  # what the reader must know before using a figure

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """The same, without the details, as rows of one table: what, figure, remark."""
        measured = (say("Measured"), self.subject, self.date) if self.date else (self.subject,)
        decided = ((each.subject, each.word, "; ".join(each.remarks)) for each in self.verdicts)
        told = ((text,) for text in self.remarks)
        warned = ((say("Warning"), text, NOTHING) for text in self.warnings)
        return (*((measured,) if self.subject else ()), *self.figures, *decided, *told, *warned)


def figure_row(name: Text, quantity: Quantity, *, known: bool = True) -> Figure:
    """A quantity with its expanded uncertainty; ``known`` is false where a recording says nothing of it."""
    if not known:
        return name, say("not determined"), NOTHING
    figure, k = say("{figure} {unit}", figure=with_uncertainty(quantity), unit=quantity.unit), stated(quantity)[2]
    if quantity.one_sided:
        return name, figure, say("95 % interval")
    if quantity.skewed:
        return name, figure, say("95 % interval {interval}", interval=interval_of(quantity))
    return name, figure, NOTHING if k == NO_FACTOR else say("k = {k}", k=k)


def effect_of(name: str, own: Iterable[Effect] = ()) -> Effect | None:
    """The effect of a name, first among a model's ``own``; ``None`` of what is no effect."""
    return next((effect for effect in own if effect.name == name), every().get(name))


def stated_physics() -> tuple[tuple[Text, Text], ...]:
    """A row with the formulas and parameters that the job at hand states of its own; none where it states none."""
    told = lines(one.words for one in stated_effects().values() if isinstance(one, StatedEffect))
    return ((say("Physics stated by the job"), told),) if told else ()


def effect_title(name: str, own: Iterable[Effect] = ()) -> Text:
    """An effect in words; what is none, as it stands."""
    effect, told = effect_of(name, own), name if isinstance(name, Text) else Verbatim(name)
    return told if effect is None else effect.title


def titles(names: Iterable[str], own: Iterable[Effect] = ()) -> list[Text]:
    known = tuple(own)
    return [effect_title(name, known) for name in names]


def parameter_title(owner: str, name: str, own: Iterable[Effect] = ()) -> Text:
    """A parameter of an effect in words: ``Periodic scale error of X, amplitude``; of what is no effect by its names."""
    effect = effect_of(owner, own)
    if effect is not None and len(effect.reported) == 1:
        return effect.title
    return say("{title}, {what}", title=effect_title(owner, own), what=_what(effect, name))


def size_of(effect: Effect | None, parameters: Mapping[str, Quantity], *, factors: bool = True) -> Text:
    """How large an effect is, and what that means: ``the angle between X and Y is 90° minus 36 ± 4 ″``."""
    quantities = {
        name: quantity.times(1e6, unit("10⁻⁶/K")) if quantity.unit == "1/K" else quantity
        for name, quantity in parameters.items()
    }
    if effect is not None:
        positive = {name: q.times(-1.0, q.unit) if q.value < 0 else q for name, q in quantities.items()}
        amounts = {name: Amount(_figures(q, factors), quantities[name].value < 0) for name, q in positive.items()}
        if meaning := effect.meaning(amounts):
            return meaning
    sizes = {name: _figures(quantity, factors) for name, quantity in quantities.items()}
    if len(sizes) == 1:
        return next(iter(sizes.values()))
    return commas(say("{what} {size}", what=_what(effect, name), size=size) for name, size in sizes.items())


def _what(effect: Effect | None, name: str) -> Text:
    parameters = () if effect is None else (*effect.reported, *effect.coefficients)
    unitless = re.sub("_(um|mm|arcsec|rad|ppm)$", "", name)  # its unit stands beside it
    return next((p.what for p in parameters if p.name == name and p.what), Verbatim(unitless))


def _figures(quantity: Quantity, factors: bool) -> Text:
    if not quantity.u > 0:
        return say("{value}\u00a0{unit}", value=figure(quantity.value), unit=quantity.unit)
    shown, k = with_uncertainty(quantity), stated(quantity)[2]
    if not factors or k == NO_FACTOR:
        return say("{stated}\u00a0{unit}", stated=shown, unit=quantity.unit)
    return say("{stated}\u00a0{unit} (k\u00a0=\u00a0{k})", stated=shown, unit=quantity.unit, k=k)
