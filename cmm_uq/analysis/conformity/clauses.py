"""What this program takes each clause of a standard to ask, where that comes from, and whether anyone read the text."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from cmm_uq.base.messages import Text, Verbatim, commas, day, say
from cmm_uq.jobs.tables.circumstances import ClausesForm, HeldClause

REPORTED = "as commonly reported"
CHOSEN = "this project"


@dataclass(frozen=True)
class Clause:
    """One clause."""

    name: str
    title: Text
    does: str
    source: str  # where that comes from
    read: bool = (
        False  # whether the words of the standard were read for it, in its text or as its publisher quotes them
    )
    of: tuple[str, ...] = ()  # characteristics that it is for; all of the standard's by default


_LENGTHS = ("E0", "E150")

_UNCERTAINTY = (
    Clause("test_uncertainty", say("test uncertainty"), "Calibration, expansion, temperature, alignment and fixturing of "
           "the artefact, root of the sum of squares; the machine's own errors and scatter are no part of it.",
           "ISO/TS 23165:2006, as commonly reported")
)  # fmt: skip
_RULE = (
    Clause("decision_rule", say("default decision rule"), "ISO 14253-1, where the job names no other.",
           "publisher's words on ISO 10360-8:2013, of the series: its default rules apply unless otherwise specified", True)
)  # fmt: skip
_ASME_RULE = (
    Clause("decision_rule", say("default decision rule"), 'ISO 14253-1, where the job names no other; "ASME B89.7.3.1" '
           "is simple acceptance at 4 : 1.", "that 4 : 1 by ASME B89.7.3.1 is its own default: as commonly reported; ISO "
           "14253-1 is the stricter for whoever states a pass")
)  # fmt: skip
_SET_ASIDE = (
    Clause("data_rejection", say("readings that are left out"), "None is left out of a decision: what is set aside "
           "counts as outside.", "ASME B89.7.3.1-2001, 2, as quoted publicly: rejected only by a documented policy or "
           "with a physical cause", True)
)  # fmt: skip
_ISO_10360_2 = (
    Clause("scope", say("scope"), "Cartesian machines with contacting probes, point by point; an optical probe is "
           "refused.", "its publisher's abstract", True),
    Clause("positions", say("positions"), "Four space diagonals and a line parallel to each axis. Three other positions "
           "that the user may choose in place of the axes are not accepted.", "seven: Harris 2004, of the edition of "
           "2000; which: as commonly reported", of=("E0", "R0")),
    Clause("positions_offset", say("positions with the offset tip"), "Both face diagonals of Y–Z, or of X–Z, with the "
           "stylus tip 150 mm to the side.", REPORTED, of=("E150",)),
    Clause("space_diagonal", say("what a space diagonal is"), "Produced to the ends of travel it crosses 75 % of the "
           "travel of every axis; parallel to an axis is within 10°.", CHOSEN, of=("E0", "R0")),
    Clause("longest", say("longest length"), "At least 66 % of the travel along a line through it.", "Harris 2004, of the "
           "edition of 2000, there of the diagonal; that 66 % of the longest body diagonal are asked for: publisher's "
           "words on VDI/VDE 2617-2.3"),
    Clause("shortest", say("shortest length"), "At most 30 mm in every position.", "Harris 2004, of the edition of 2000; "
           "whether the edition of 2009 asks for it is not known"),
    Clause("lengths_and_repeats", say("lengths and repeats"), "Five lengths, more than 1 mm apart, in each position, "
           "each three times.", "five, three and seven positions: Harris 2004 and summaries of manufacturers; 1 mm: this "
           "project"),
    Clause("bidirectional", say("bidirectional lengths"), "Ends approached in opposite senses; distances of balls with a "
           "short gauge beside them.", REPORTED),
    Clause("expansion", say("normal expansion"), "8 to 13 × 10⁻⁶ /K.", REPORTED, of=_LENGTHS),
    Clause("short_gauge", say("short gauge beside centre distances"), "Its error is added to that of the length, repeat "
           "by repeat; at most 30 mm, three times in every position, within 10° and 100 mm of the line.", CHOSEN),
    Clause("remeasuring", say("measuring again"), "At most five lengths may have one of their three values outside; each "
           "is measured ten times more, all inside; two of three, or a sixth length, fail.", "as commonly reported: ten "
           "of the edition of 2001, three of that of 2009 by some; ten is asked for, the stricter of both", of=_LENGTHS),
    Clause("range", say("range of repeats"), "Range of the first three repeats of each length, not measured again.",
           REPORTED, of=("R0",)),
    _UNCERTAINTY,
    _RULE,
)  # fmt: skip
_ISO_10360_5 = (
    Clause("scope", say("scope"), "Contacting probes, point by point.", "its publisher's abstract", True),
    Clause("points", say("points on the sphere"), "25 on every sphere recorded, neither more nor fewer, all different.",
           "25: names of the characteristics, and summaries of manufacturers; neither more nor fewer: this project"),
    Clause("pattern", say("where on the sphere the points lie"), "No direction of the hemisphere is farther than 45° "
           "from the nearest point.", CHOSEN),
    Clause("sphere_size", say("size of the sphere"), "10 to 50 mm.", "Harris 2004, 2.6.3, of ISO 10360-2:2000; not less "
           "than 10 mm: clause 6.2.1 of the edition of 2020, as quoted by a reseller"),
    Clause("every_sphere", say("every sphere by itself"), "Every sphere recorded is decided, form and size from the same "
           "points; nothing is measured again.", CHOSEN),
    _UNCERTAINTY,
    _RULE,
)  # fmt: skip
_B89 = (
    Clause("positions", say("positions of the bar"), "Twenty in a nearly cubic volume (up to 2 : 1), ten for each "
           "further cube; three axes, six face and four space diagonals, within 10°, ends 10 mm apart.", "twenty and the "
           "directions: Harris 2004, 6.3, by figure 26 of the standard; the rest: this project",
           of=("volumetric performance",)),
    Clause("range_of_bar", say("range of the bar's lengths"), "Of all lengths recorded.", "5.5.2, Harris 2004",
           of=("volumetric performance",)),
    Clause("repeatability", say("repeatability"), "Ten repeats of a fixed sphere, largest range along an axis.",
           "fixed ball, range: Harris 2004, 2.6.1; ten: this project", of=("repeatability",)),
    Clause("linear", say("linear displacement accuracy"), "Lines parallel to X, Y, Z; ten lengths, three repeats, 66 % "
           "of the travel.", "each axis: Harris 2004, 2.6.1; the rest: this project", of=("linear displacement accuracy",)),
    Clause("offset", say("offset probe performance"), "Face diagonals of Y–Z and X–Z, each with the tip to opposite "
           "sides.", "Harris 2004, 2.6.1; which diagonals: this project", of=("offset probe performance",)),
    Clause("bidirectional", say("bidirectional length"), "A length of at most 50 mm in four orientations, three repeats.",
           "four orientations: Harris 2004, 2.6.1; the rest: this project", of=("bidirectional length",)),
    Clause("test_uncertainty", say("test uncertainty"), "That of the artefact alone.", CHOSEN),
    _SET_ASIDE,
    _RULE,
)  # fmt: skip
_VDI = (
    Clause("positions", say("positions"), "U1: the axes; U2: all six face diagonals; U3: all four space diagonals.",
           "Harris 2004, 2.6.2, and the guideline's abstract; that all are asked for: this project"),
    Clause("lengths_and_repeats", say("lengths and repeats"), "Five lengths, three repeats, the longest 66 % of the "
           "travel, the shortest at most 30 mm, as of ISO 10360-2.", CHOSEN),
    Clause("share_outside", say("share of values outside"), "None may lie outside, and none is measured again.", CHOSEN),
    _UNCERTAINTY,
    _RULE,
)  # fmt: skip
_RULES = {
    "ISO/TS 23165:2006": (
        Clause("budget", say("terms of the budget"), "Calibration, expansion, temperature, alignment and fixturing of "
               "the artefact, root of the sum of squares; the machine's own errors and scatter are no part of it.", REPORTED),
        Clause("form", say("test uncertainty of a form"), "√((F/2)² + u(F)²)", REPORTED),
        Clause("range", say("test uncertainty of a range"), "What of the artefact changes between the repeats; nothing "
               "of its calibration.", CHOSEN),
    ),
    "ISO/TS 17865:2016": (
        Clause("size", say("test uncertainty of a size"), "As of a length.", REPORTED),
    ),
    "ASME B89.7.3.1-2001": (
        Clause("ratio", say("N : 1"), "The whole zone of the specification is N times as wide as ±U, k = 2.",
               "its definition, as quoted publicly", True),
        Clause("one_limit", say("N : 1 with one limit"), "The zone goes from 0 to the limit.", CHOSEN),
        _SET_ASIDE,
    ),
    "ISO 14253-1:2017": (
        Clause("probability", say("probability of conforming"), "95 %.", "5.2, as commonly reported"),
    ),
    "ANSI/NCSL Z540.3-2006": (
        Clause("share", say("share of false acceptance"), "2 % of all items.", "5.3 b, as quoted in public papers", True),
        Clause("between", say("between acceptance limit and limit"), "Undecided.", CHOSEN),
    ),
}  # fmt: skip


def _sphere(scope: str) -> tuple[Clause, ...]:
    first = Clause("scope", say("scope"), scope, "its publisher's abstract", True)
    return (first, *(one for one in _ISO_10360_5[1:] if one.name != "sphere_size"))


# Of each standard that is decided here, and of the documents that decisions and budgets go by
CLAUSES: Mapping[str, tuple[Clause, ...]] = MappingProxyType({
    "ISO 10360-2:2009": _ISO_10360_2,
    "ASME B89.4.10360.2-2008": (
        Clause("additions", say("what it adds to ISO 10360-2"), "Not tested.", "its abstract: it incorporates the entire ISO "
               "document"),
        *_ISO_10360_2[1:-1], _SET_ASIDE, _ASME_RULE,
    ),
    "ISO 10360-5:2010": _ISO_10360_5,
    "ISO 10360-5:2020": _ISO_10360_5,
    "ISO 10360-8:2013": _sphere("Cartesian machines with optical distance sensors."),
    "ASME B89.4.1-1997": _B89,
    "VDI/VDE 2617-2.1": _VDI,
    "VDI/VDE 2617": _ISO_10360_2[1:],
    **_RULES,
})  # fmt: skip


def in_words(standard: str, asked: Sequence[Clause], form: ClausesForm | None) -> tuple[list[Text], tuple[Text, ...]]:
    """What a certificate says of the clauses that a statement goes by, and what the test lacks by the laboratory's copy."""
    held = {} if form is None else {one.name: given for one in asked if (given := _held(one, form)) is not None}
    said: list[Text] = []
    who: dict[tuple[str, dt.date, str], list[Text]] = {}
    for one in asked:
        if form is not None and one.name in held:
            given = held[one.name]
            key = (given.checked_by or form.checked_by, given.on or form.on, given.edition or form.edition)
            who.setdefault(key, []).append(one.title)
    for (name, when, edition), titles in who.items():
        said.append(say("Clauses checked by {name} on {day}, edition {edition}: {titles}.", name=Verbatim(name), day=day(when),
                        edition=Verbatim(edition), titles=commas(titles)))  # fmt: skip
    differing = [(one, held[one.name]) for one in asked if one.name in held and held[one.name].agrees is False]
    said += [
        say(
            "By the laboratory's copy this differs, {title}: {how}.",
            title=one.title, how=Verbatim(given.differs.rstrip(". ")),
        )
        for one, given in differing
    ]  # fmt: skip
    unread = [one.title for one in asked if one.name not in held and not one.read]
    if unread:
        said.append(say("Clauses of {standard} that nobody has held against its text: {titles}.", standard=Verbatim(standard),
                        titles=commas(unread)))  # fmt: skip
    lacking = tuple(
        say("{title} as the laboratory's copy has it", title=one.title)
        for one, given in differing
        if not given.stricter
    )
    return said, lacking


def _held(clause: Clause, form: ClausesForm) -> HeldClause | None:
    """What the form says of a clause; ``None`` where nobody looked, or the program does something else by now."""
    given = form.clauses.get(clause.name)
    return None if given is None or given.agrees is None or given.does != clause.does else given
