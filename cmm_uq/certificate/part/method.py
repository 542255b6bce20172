"""By what method a part's uncertainty was found, what it does not cover, and other methods beside it.

Other methods stand on the page with figures, why they differ, what each sees, conditions and budgets; in ``results.json`` with
values and uncertainties in mm or °, shares from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, log

from cmm_uq import __version__
from cmm_uq.analysis.parts.budget import FAMILIES, family_of
from cmm_uq.analysis.parts.methods import method as other_methods
from cmm_uq.analysis.parts.methods.of_job import METHODS
from cmm_uq.analysis.parts.virtual import AGREES, CHECKED
from cmm_uq.base import messages
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, holding, number, plural, say
from cmm_uq.base.units import REFERENCE_TEMPERATURE, unit
from cmm_uq.certificate import document
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, columns, section, table
from cmm_uq.certificate.origin import NAME, further_table
from cmm_uq.certificate.part.figures import ANGLES, LENGTHS, figures_of
from cmm_uq.certificate.part.measurement import CertificateStatus, PartMeasurement, Source
from cmm_uq.certificate.wording import titles
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.maths.uncertainty.quantity import figure, rounded, significant


def method_section(found: PartMeasurement) -> Section:
    simulated = found.simulated
    facts = document.facts(
        (say("Virtual measurements"), number(simulated.trials)),
        (say("Places of the part"), number(len(found.virtual.places))), (say("Drawn together"), _drawn(found)),
        (say("Temperatures"), _temperatures(found)), (say("Evaluated"), _evaluated(found)),
        (say("Figures"), _stable(found)),
        (say("Coverage probability of intervals"), say("{coverage:g} %", coverage=100 * simulated.coverage)),
        (say("Seed"), number(found.seed)), (say("Program"), program_words()), (say("To do it again"), again(found)),
    )  # fmt: skip
    return section(say("Method"), Paragraph(_METHOD), facts, *map(Paragraph, _STANDARDS))


_METHOD = say(
    "The measurement is made many times in the computer: at the planned points of contact, with errors of the machine drawn "
    "from what its calibration says of all of them together, and with stylus, temperatures, form and place of the part drawn "
    "beside them. Every virtual measurement is associated, aligned and evaluated as the real one is. What it finds less what "
    "is true is an error; the standard deviation of the errors is u."
)

_STANDARDS = (
    say(
        "ISO/TS 15530-4 (uncertainty by simulation), by public descriptions of it: what is simulated, and what is not, is "
        "said here. The tests on the machine itself that it asks of such a program, with calibrated parts, are not made by "
        "this program; those by reference data and by simulated machines are published with it."
    ),
    say(
        "VDI/VDE 2617-7 (uncertainty by simulation): its idea is followed; no conformity with it is claimed, since its "
        "text was not at hand when this was written."
    ),
    say(
        "VDI/VDE 2617-11 (uncertainty budgets): the budget here has shares of simulated variances in place of the lines that "
        "it sets up by hand; no conformity with it is claimed."
    ),
    say(
        "Propagation of distributions by JCGM 101 and JCGM 102. Characteristics are those of ISO 1101, ISO 5459 and ISO "
        "14405-1 as far as the associations go that are named with the features: ISO 1101 asks for minimum zones, ISO 5459 "
        "for tangent datums."
    ),
)


def _drawn(found: PartMeasurement) -> Text:
    families = dict.fromkeys(family_of(line) for line in found.budget.causes)
    return messages.commas(say("{cause:small}", cause=FAMILIES.get(one, Verbatim(one))) for one in families)


def _temperatures(found: PartMeasurement) -> Text:
    given = found.job.facts.environment
    part, x, y, z = (messages.signed(each, "g") for each in (given.part_c, *given.scales_c))
    told = say("part {part} °C, scales of x, y, z {x}, {y}, {z} °C", part=part, x=x, y=y, z=z)
    if given.compensated:
        return say("{told}; lengths are computed at 20 °C", told=told)
    return say("{told}; lengths are not corrected to 20 °C", told=told)


def _evaluated(found: PartMeasurement) -> Text:
    if found.virtual.exact:
        return say("every feature by its association on the points of every draw")
    return say(
        "least-squares features by the derivative of their fit, all else on the points of every draw; {checked} draws "
        "evaluated on all points differ by {off} of u, less than {limit:g} %",
        checked=CHECKED,
        off=say("{off} %", off=number(100 * float(found.virtual.off.max(initial=0.0)), ".2g")),
        limit=100 * AGREES,
    )


def _stable(found: PartMeasurement) -> Text:
    if found.digits is None or found.simulated.stable is None:
        return NOTHING
    digits = plural(found.digits, one=say("one digit"), many=say("{count} digits", count=found.digits))
    if found.simulated.stable:
        return say("known to {digits} of u (JCGM 101:2008, 7.9)", digits=digits)
    return say("not known to {digits} of u: too few virtual measurements", digits=digits)


def program_words() -> Text:
    return say("{package} {version}", package=Verbatim(NAME), version=Verbatim(__version__))


def again(found: PartMeasurement) -> Text:
    """The command that gives this page again from the files that belong to it."""
    options = f" --seed {found.seed}" if found.seed else ""
    if found.digits is not None:
        options += f" --digits {found.digits}"
    return Verbatim(f"{NAME} part {found.job.facts.job.id}{options}")


def not_covered_section(found: PartMeasurement) -> Section:
    """What must not be read out of the figures: left out of this job, then of every one."""
    left, lacking, unstated = found.job.facts.part.not_measured, found.virtual.places[0].lacking, _unstated(found)
    return section(say("What is not covered"), *map(Paragraph, holding(
        (left, say("Of the drawing, these are not measured here: {names}.", names=messages.commas(messages.names(left)))),
        (lacking, say("Of the machine's errors, these could not be drawn, for lack of what they depend on: {names}.",
                      names=messages.commas(titles(sorted(lacking))))),
        (unstated, say("Not stated in the job, and so taken to be without uncertainty: {what}.",
                       what=messages.listed(unstated))),
        *((True, text) for text in _declared(found)),
        (any(one.stated.u == 0 for one in figures_of(found)),
         say("A characteristic with u = 0 is one to which nothing that is stated contributes.")),
        (True, say(
            "The noise of a reading is that of the calibration's points; a point that is probed in another way scatters "
            "otherwise. Scanning and its filters, parts that bend when they are held or probed, material conditions and "
            "profiles of surfaces are not modelled.")),
        (True, say(
            "Tried on simulated machines whose scales err as much as physics allows, by any period: 95 % intervals hold the "
            "truth in 94 to 96 of 100 cases.")),
    )))  # fmt: skip


_CAUSES: Mapping[str, Text] = {
    "lobing": say("pre-travel of the probe by direction"), "clamping": say("clamping"), "operators": say("operators"),
    "gradients": say("uneven and drifting temperatures"),
}  # fmt: skip


def _declared(found: PartMeasurement) -> list[Text]:
    """By whom and why causes are negligible."""
    return [
        say("{line:capital}: declared negligible by {by}: {reason}.", line=what, by=Verbatim(one.by),
            reason=Verbatim(one.reason.rstrip(". ")))
        for name, what in _CAUSES.items() if (one := getattr(found.job.facts.negligible, name))
    ]  # fmt: skip


def _unstated(found: PartMeasurement) -> list[Text]:
    """Causes of which no uncertainty is stated, or not of all of it, and that nobody declares negligible."""
    facts, room = found.job.facts, found.job.facts.environment
    styli, cold = facts.probing_styli, room.part_c == REFERENCE_TEMPERATURE
    touching = any(one.diameter_mm and not one.u_diameter_um for one in styli)
    apart = sum(not any(one.u_offset_um) for one in styli) > 1  # one is that to which the others are referred
    scales = "scales_cte_per_k" in room.model_fields_set and (room.u_scales_k or not room.scales_cte_per_k)
    return holding(
        (touching or apart, say("qualification of the styli")), (not (room.u_part_k and scales), say("temperatures")),
        (not (facts.part.cte_per_k and (facts.part.u_cte_per_k or cold)), say("expansion of the part")),
        (not found.given.forms, say("form and roughness of the part")),
        *((name in facts.neither_stated_nor_declared, what) for name, what in _CAUSES.items()),
    )  # fmt: skip


def decided_without(found: PartMeasurement) -> tuple[Text, ...]:
    """Why nothing is called conforming: an uncertainty that lacks some cause, a machine that nobody measured, or by itself."""
    if found.measured is None or not any(found.judged):
        return ()
    what, standing, of_part = messages.listed(_unstated(found)), found.standing, found.job.facts.job.origin
    return tuple(holding(
        (what, say("Nothing is called conforming, for the job states no uncertainty of these: {what}.", what=what)),
        (of_part == MEASURED != standing.origin,
         say("Nothing is called conforming, for nobody measured the machine: its calibration is no measurement.")),
        (standing.interim, say("Nothing is called conforming, for what states the machine is an interim check, and no "
                               "calibration.")),
        (standing.circular, say("Nothing is called conforming, for the artefact that calibrated the machine was itself "
                                "certified on that machine.")),
        (standing.against, say("Nothing is called conforming, for statements of the machine contradict each other.")),
    ))  # fmt: skip


_NOTHING = 5e-4  # share of a variance that is printed as none
# characteristics for which is told why methods differ, and whose budgets are listed: those that differ most
EXPLAINED = 6

FOLLOWED: Mapping[other_methods.Method, Text] = {
    "calibrated_part": say(
        "Calibrated part: by public descriptions of ISO 15530-3:2011, U = k √(u_cal² + u_p² + u_b² + u_w²) with k = 2; an "
        "error that is not corrected is added (ISO/TS 15530-3:2004). The text of the standard was not at hand. The "
        "uncertainty of the mean of the repeats is not in that formula."
    ),
    "orientations": say(
        "Several orientations: by the public summary of ISO/DTS 15530-2 (multiple orientations and repetitions, analysis of "
        "variance, standards of length and of the probe's qualification), which was not published when this was written. Its "
        "formulas were not at hand: the mean is corrected by the standards, and k is of the 95 % interval at the effective "
        "degrees of freedom."
    ),
}

SEEN: Mapping[other_methods.Seen, Text] = {
    "drawn": say("as known of it"), "varied": say("as scatter"), "systematic": say("as a systematic error"),
    "corrected": say("corrected by a standard"), "stated": say("as stated"), "unseen": say("not"),
}  # fmt: skip


def methods_section(comparison: other_methods.MethodComparison | None) -> Section:
    """All of it; a section of no blocks where the job has no other method."""
    title = say("Other methods beside it")
    if comparison is None or not comparison.characteristics:
        return section(title)
    told, methods, every = _most_apart(comparison), comparison.methods, comparison.characteristics
    by_angle = ([one for one in every if _angle(comparison, one) == angle] for angle in (False, True))
    of_most = plural(len(told), one=say("Told is of the characteristic whose methods differ most."), many=say(
        "Told is of the {count} characteristics whose methods differ most.", count=len(told)))  # fmt: skip
    return section(
        title, Paragraph(_APART), *(_figures(own, angle=bool(angle)) for angle, own in enumerate(by_angle) if own),
        *(Paragraph(say("Characteristic {name}: {why}", name=Verbatim(one.name), why=messages.sentences(one.why)))
          for one in told if one.why),
        Paragraph(of_most, "note") if len(told) < len(every) else None, _seen(methods), _conditions(methods),
        *(_budgets(method, [one.name for one in told]) for method in methods),
        *(Paragraph(FOLLOWED[method.method], "note") for method in methods),
    )  # fmt: skip


_APART = say(
    "The same characteristics by other methods, from recordings of their own. They ask different questions: virtual "
    "measurements draw all that the machine's certificate leaves open; the others see what varied while they measured, and "
    "what their standards tell."
)


def _angle(comparison: other_methods.MethodComparison, one: other_methods.ComparedCharacteristic) -> bool:
    return any(found.angle for method in comparison.methods if (found := method.of(one.name)) is not None)


def _most_apart(comparison: other_methods.MethodComparison) -> list[other_methods.ComparedCharacteristic]:
    """Those whose uncertainties differ by the largest factor, in the order of the plan."""

    def factor(one: other_methods.ComparedCharacteristic) -> float:
        positive = [stated.u for stated in one.stated if stated.u > 0]
        return log(max(positive) / min(positive)) if positive else 0.0

    kept = sorted(comparison.characteristics, key=factor, reverse=True)[:EXPLAINED]
    return [one for one in comparison.characteristics if one in kept]


def _figures(own: Sequence[other_methods.ComparedCharacteristic], *, angle: bool) -> Table | None:
    scale = ANGLES if angle else LENGTHS
    heads = (say("Characteristic"), say("Method"), Column(say("Value"), scale.value), Column(say("u"), scale.small),
             Column(say("U"), scale.small), Column(say("Eₙ")))  # fmt: skip
    rows = []
    for one in own:
        normalised = {pair.other: pair.normalised for pair in one.pairs if pair.one == "virtual"}
        for stated in one.stated:
            value: Text = DASH
            if stated.value is not None:
                value = rounded(stated.value / scale.per_value, stated.U / scale.per_value)[0]
            apart = messages.signed(normalised[stated.method], ".2f") if stated.method in normalised else DASH
            rows.append((Verbatim(one.name), _named(stated.method), value, significant(stated.u / scale.per_small),
                         significant(stated.U / scale.per_small), apart))  # fmt: skip
    note = say(
        "Eₙ: difference of the virtual measurement's value from this one over √(U₁² + U₂²) (ISO/IEC 17043); beyond 1 the "
        "methods contradict each other. Values that come from the same measured points have most of their error in "
        "common, so that theirs is small."
    )
    return table(say("Angles by each method") if angle else say("Lengths by each method"), heads, rows, note)


def _named(method: other_methods.Method) -> Text:
    return say("{method:capital}", method=METHODS[method])


def _seen(methods: Sequence[other_methods.MethodResult]) -> Table | None:
    heads = (say("Cause"), _named("virtual"), *(_named(one.method) for one in methods))
    rows = (
        (words, SEEN["drawn"], *(SEEN[one.seen.get(family, "unseen")] for one in methods))
        for family, words in FAMILIES.items()
    )
    return table(say("How each method takes hold of a cause"), heads, rows)


def _conditions(methods: Sequence[other_methods.MethodResult]) -> Table:
    met = {True: say("met"), False: say("not met"), None: say("not stated")}
    rows = tuple((_named(one.method), each.text, met[each.met]) for one in methods for each in one.conditions)
    heads = columns((say("Method"), say("What it asks for"), say("This test")))
    return Table(say("Conditions of the tests"), heads, rows)


def _budgets(method: other_methods.MethodResult, told: Sequence[str]) -> Table:
    heads = columns((say("Characteristic"), say("Contribution"), say("u, its part"), Column(say("ν")),
                     Column(say("Share"), unit("%"))))  # fmt: skip
    rows = tuple(row for name in told if (one := method.of(name)) is not None for row in _lines(one))
    caption = say("Budgets by {method}", method=METHODS[method.method])
    return Table(caption, heads, rows, tuple(_notes(method, told)))


def _lines(one: other_methods.MethodFigure) -> list[tuple[Text, ...]]:
    scale = ANGLES if one.angle else LENGTHS
    rows: list[tuple[Text, ...]] = []
    for depth, line, share in one.budget.flat():
        if not line.u or share < _NOTHING:
            continue
        part = say("{value} {unit}", value=significant(one.u * share**0.5 / scale.per_small), unit=scale.small)
        name = say("{indent}{name}", indent=Verbatim("\u2003" * depth), name=line.name)
        rows.append((Verbatim(one.name), name, part, _freedom(line.dof), number(100 * share, ".1f")))
    told = say("{value} {unit}", value=significant(one.u / scale.per_small), unit=scale.small)
    whole = say("together, k = {k}", k=number(one.budget.k, ".2f"))
    return [*rows, (Verbatim(one.name), whole, told, _freedom(one.budget.dof), number(100.0, ".1f"))]


def _freedom(dof: float) -> Text:
    return figure(dof, 3) if isfinite(dof) else messages.Number("∞")


def _notes(method: other_methods.MethodResult, told: Sequence[str]) -> list[Text]:
    """Systematic errors that were found, and what became of them."""
    notes: list[Text] = []
    for one in (found for name in told if (found := method.of(name)) is not None):
        if one.systematic is None or (method.method == "orientations" and not one.systematic):
            continue
        scale = ANGLES if one.angle else LENGTHS
        U, name = one.U / scale.per_small, Verbatim(one.name)
        error = rounded(one.systematic / scale.per_small, U)[0] if U else NOTHING
        taken_off = say("{name}: systematic error {error} {unit}, taken off.", name=name, error=error, unit=scale.small)
        added = say("{name}: systematic error {error} {unit}, not taken off; its size is added to U.", name=name, error=error,
                    unit=scale.small)  # fmt: skip
        notes.append(taken_off if one.corrected else added)
    return notes


_SOURCES: Mapping[Source, Text] = {
    "certificate": say("its certificate, with the recording of the calibration inside"),
    "results": say("the figures and draws of its certificate, without the recording of the calibration"),
    "job": say("the job of its calibration, analysed anew; no certificate is verified"),
}


def machine_section(found: PartMeasurement) -> Section:
    """What states the machine, and what of it was verified."""
    standing, celsius = found.standing, NOTHING
    if standing.temperature_c is not None:
        celsius = say("{value} °C", value=messages.number(standing.temperature_c, ".2f"))
    facts = document.facts(
        (say("Taken from"), _SOURCES[standing.source]), *certificate_rows(standing),
        (say("Files"), commas(messages.names(standing.files))), (say("Verified"), verified_words(standing)),
        (say("Signatures"), say("by trusted certificates") if standing.trusted else say("not asked for")),
        (say("Temperature of the scales at the calibration"), celsius), (say("Noise of a coordinate"), _noise(found)),
    )  # fmt: skip
    told = (Paragraph(text) for text in (standing.path, standing.drift) if text)
    return section(say("The machine and its certificate"), facts, *told, further_table(standing.further))


def certificate_rows(standing: CertificateStatus) -> tuple[tuple[Text, Text], ...]:
    """Machine, number, issuer, date with its age, validity of the certificate."""
    serial = say("serial number {serial}", serial=Verbatim(standing.serial)) if standing.serial else NOTHING
    number_of: Text = Verbatim(standing.number)
    named = say("Calibration of the machine") if standing.source == "job" else say("Certificate of the machine")
    if standing.draft:
        number_of = say("{number}, a draft", number=number_of)
    days, date = standing.age.days, messages.day(standing.date)
    age = plural(days, one=say("one day"), many=say("{count} days", count=days))
    on_the_day = say("{date}, the day of the measurement", date=date)
    calibrated = say("{date}, {age} before", date=date, age=age) if days else on_the_day
    return (
        (say("Machine"), commas(text for text in (Verbatim(standing.machine), serial) if text)),
        (named, number_of),
        (say("Issued by"), Verbatim(standing.laboratory)),
        (say("Calibrated on"), calibrated),
        (say("Valid until"), messages.day(standing.valid_until) if standing.valid_until else NOTHING),
    )


def verified_words(standing: CertificateStatus) -> Text:
    done = [one for one in standing.checked if one.count]
    if not done:
        return say("no: analysed anew") if standing.source == "job" else say("no")
    again = say("computed again from its inputs") if standing.again else say("not computed again")
    return say("{told}; {again}", again=again, told=say(
        "{count} comparisons of {sorts} sorts between its documents, figures, decisions and inputs, none of which failed",
        count=sum(one.count for one in done), sorts=len(done),
    ))  # fmt: skip


def _noise(found: PartMeasurement) -> Text:
    usual = found.given.machine.noise.usual_mm * 1e3
    x, y, z = (number(one, ".2g") for one in usual)
    return say("{x}, {y}, {z} µm along x, y, z", x=x, y=y, z=z) if usual.any() else NOTHING
