"""By what method a part's uncertainty was found, which standards it follows how far, and what it does not cover."""

from __future__ import annotations

from cmm_uq import __version__
from cmm_uq.analysis.parts.in_words import FAMILIES, family_of
from cmm_uq.analysis.parts.virtual import AGREES, CHECKED
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, listed, names, number, plural, say, signed
from cmm_uq.certificate.document import Block, Facts, Paragraph, Section
from cmm_uq.certificate.origin import NAME
from cmm_uq.certificate.part.figures import figures_of
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.wording import titles


def method_section(found: PartMeasurement) -> Section:
    """What was drawn, how often, and how to do it again."""
    simulated = found.simulated
    rows = (
        (say("Virtual measurements"), number(simulated.trials)),
        (say("Places of the part"), number(len(found.virtual.places))),
        (say("Drawn together"), _drawn(found)),
        (say("Temperatures"), _temperatures(found)),
        (say("Evaluated"), _evaluated(found)),
        (say("Figures"), _stable(found)),
        (say("Coverage probability of intervals"), say("{coverage:g} %", coverage=100 * simulated.coverage)),
        (say("Seed"), number(found.seed)),
        (say("Program"), program_words()),
        (say("To do it again"), again(found)),
    )
    paragraphs = [Paragraph(text) for text in (_METHOD, *_STANDARDS)]
    return Section(say("Method"), (paragraphs[0], Facts(tuple(row for row in rows if row[1])), *paragraphs[1:]))


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
    return commas(say("{cause:small}", cause=FAMILIES.get(one, Verbatim(one))) for one in families)


def _temperatures(found: PartMeasurement) -> Text:
    given = found.job.facts.environment
    x, y, z = (signed(each, "g") for each in given.scales_c)
    told = say("part {part} °C, scales of x, y, z {x}, {y}, {z} °C", part=signed(given.part_c, "g"), x=x, y=y, z=z)
    if given.compensated:
        return say("{told}; lengths are computed at 20 °C", told=told)
    return say("{told}; lengths are not corrected to 20 °C", told=told)


def _evaluated(found: PartMeasurement) -> Text:
    if found.virtual.exact:
        return say("every feature by its association on the points of every draw")
    return say(
        "least-squares features by the derivative of their fit, all else on the points of every draw; {checked} draws "
        "evaluated on all points differ by {off} of u, less than {limit:g} %",
        checked=CHECKED, off=say("{off} %", off=number(100 * float(found.virtual.off.max(initial=0.0)), ".2g")),
        limit=100 * AGREES,
    )  # fmt: skip


def _stable(found: PartMeasurement) -> Text:
    if found.digits is None or found.simulated.stable is None:
        return NOTHING
    digits = plural(found.digits, one=say("one digit"), many=say("{count} digits", count=found.digits))
    if found.simulated.stable:
        return say("known to {digits} of u (JCGM 101:2008, 7.9)", digits=digits)
    return say("not known to {digits} of u: too few virtual measurements", digits=digits)


def program_words() -> Text:
    """Name and version."""
    return say("{package} {version}", package=Verbatim(NAME), version=Verbatim(__version__))


def again(found: PartMeasurement) -> Text:
    """The command that gives this page again from the files that belong to it."""
    options = f" --seed {found.seed}" if found.seed else ""
    if found.digits is not None:
        options += f" --digits {found.digits}"
    return Verbatim(f"{NAME} part {found.job.facts.job.id}{options}")


def not_covered_section(found: PartMeasurement) -> Section:
    """What must not be read out of the figures."""
    blocks: list[Block] = [Paragraph(text) for text in not_covered(found)]
    return Section(say("What is not covered"), tuple(blocks))


def not_covered(found: PartMeasurement) -> tuple[Text, ...]:
    """Left out of this job, then of every one."""
    facts, told = found.job.facts, list[Text]()
    if facts.part.not_measured:
        told.append(
            say("Of the drawing, these are not measured here: {names}.", names=commas(names(facts.part.not_measured)))
        )
    if found.virtual.places[0].lacking:
        told.append(say("Of the machine's errors, these could not be drawn, for lack of what they depend on: {names}.",
                        names=commas(titles(sorted(found.virtual.places[0].lacking)))))  # fmt: skip
    if unstated := _unstated(found):
        told.append(
            say("Not stated in the job, and so taken to be without uncertainty: {what}.", what=listed(unstated))
        )
    if any(one.stated.u == 0 for one in figures_of(found)):
        told.append(say("A characteristic with u = 0 is one to which nothing that is stated contributes."))
    told.append(
        say(
            "The noise of a reading is that of the calibration's points; a point that is probed in another way scatters "
            "otherwise. Scanning and its filters, parts that bend when they are held or probed, material conditions and "
            "profiles of surfaces are not modelled."
        )
    )
    told.append(
        say(
            "Tried on simulated machines whose scales err as much as physics allows, by any period: 95 % intervals hold the "
            "truth in 94 to 96 of 100 cases."
        )
    )
    return tuple(told)


def _unstated(found: PartMeasurement) -> list[Text]:
    facts = found.job.facts
    surroundings = facts.environment
    lacking = (
        (
            any(s.u_diameter_um or s.lobing_um or any(s.u_offset_um) for s in facts.stylus),
            say("qualification of the styli"),
        ),
        (bool(surroundings.u_part_k or surroundings.u_scales_k), say("temperatures")),
        (bool(facts.part.u_cte_per_k), say("expansion of the part")),
        (bool(found.given.forms), say("form and roughness of the part")),
        (bool(facts.placing.u_fixture_um), say("clamping")),
        (_operators(found), say("operators")),
    )
    return [what for stated, what in lacking if not stated]


def _operators(found: PartMeasurement) -> bool:
    """Whether anything is stated of what operators do differently."""
    facts = found.job.facts
    return bool(facts.probing.u_operator_um) or any(
        one.u_operator_um or one.u_operator_deg for one in facts.characteristic
    )
