"""The page that decides: the verdict with value, U and limit of each statement, and the picture of errors against limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from cmm_uq.analysis.conformity.decision import rule_words
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.messages import Text, plural, say, semicolons
from cmm_uq.certificate.conformity_section import has_picture, named, picture
from cmm_uq.certificate.document import Overview, Plot, Section, Table
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.summary import subject_of
from cmm_uq.certificate.wording import OUTCOME_WORDS, stated_row, stated_value
from cmm_uq.jobs.verdicts import GRAVEST, NONE, Verdict, gravest, standing_of

_MOST = 8
"""Statements in the box; of more the gravest, all are behind the page."""

_ROWS = 16
"""Of a table that the first page has room for."""

_WORDS: Mapping[str, Text] = {
    "fail": say("Does not conform"),
    "conditional fail": say("Does not conform, within the uncertainty of the measurement"),
    "remeasure": say("Not decided: the standard asks for further readings"),
    "undecided": say("Not decided: the value is nearer to its limit than its uncertainty"),
    "incomplete": say("Incomplete: conformity is not stated"),
    "conditional pass": say("Conforms, within the uncertainty of the measurement"),
}


def overview_of(result: Result) -> Overview | None:
    """The verdict on the whole and each statement behind it; nothing where nothing is stated."""
    verdicts = result.verdicts
    if verdicts.overall == NONE:
        return None
    signed = {i: statement.signed for i, statement in enumerate(result.statements)}
    rows = [(subject_of(one), _row(one, signed=signed.get(i, True))) for i, one in enumerate(verdicts)]
    if len(rows) > _MOST:
        order = sorted(range(len(rows)), key=lambda i: _gravity(verdicts[i].outcome))[:_MOST]
        more = len(rows) - _MOST
        rows = [
            *(rows[i] for i in sorted(order)),
            (say("Further statements"), say("{count}, behind this page", count=more)),
        ]
    return Overview(_verdict(verdicts), standing_of(verdicts.overall), (*rows, *_lacking(verdicts), *_rules(result)))


def _gravity(outcome: str) -> int:
    return GRAVEST.index(outcome) if outcome in GRAVEST else GRAVEST.index("undecided")


def _verdict(verdicts: Sequence[Verdict]) -> Text:
    overall, count = gravest(one.outcome for one in verdicts), len(verdicts)
    if overall == "pass":
        return plural(
            count, one=say("Conforms"), many=say("Conforms: all {count} statements of conformity", count=count)
        )
    words = _WORDS.get(overall, OUTCOME_WORDS.get(overall, say("Not decided")))
    alike = sum(one.outcome == overall for one in verdicts)
    if count == 1:
        return words
    return say("{words}: {alike} of {count} statements of conformity", words=words, alike=alike, count=count)


def _row(one: Verdict, *, signed: bool) -> Text:
    if one.value is None:
        outcome = OUTCOME_WORDS.get(one.outcome, say("undecided"))
        return say("{outcome}: not determined by this recording", outcome=outcome)
    return stated_row(
        one.outcome, stated_value(one.value, one.U, signed=signed), one.unit, one.limit if one.by else None
    )


def _lacking(verdicts: Sequence[Verdict]) -> list[tuple[Text, Text]]:
    """The first of what statements lack, and how much more there is."""
    lacking = list(dict.fromkeys(what for one in verdicts if one.value is not None for what in one.missing))
    if not lacking:
        return []
    shown = semicolons(lacking[:2])
    return [(say("Missing"), shown if len(lacking) < 3 else say("{shown}; {count} more behind this page", shown=shown,
                                                                 count=len(lacking) - 2))]  # fmt: skip


def _rules(result: Result) -> list[tuple[Text, Text]]:
    told = [rule_words(one.facts.rule) for one in result.statements]
    if len(result.verdicts) > len(result.statements):
        told.append(say("tolerances: the whole 95 % interval must lie within"))
    return [(say("Decision rule"), semicolons(dict.fromkeys(told)))]


def with_first(result: Result, sections: Sequence[Section]) -> list[Section]:
    """Sections with what of them the first page shows marked, and a picture taken there from where it stood.

    That is the picture of the gravest statement that has one, else that of the tolerances; without any the main figures, where
    the page has room for them.
    """
    shown = min((s for s in result.statements if has_picture(s)), key=lambda s: _gravity(s.outcome), default=None)
    plot: Plot | None = None
    if shown is not None:
        plot = picture(shown)
    elif len(result.verdicts) > len(result.statements):
        plot = next((b for s in sections if s.title == _TOLERANCES for b in s.blocks if isinstance(b, Plot)), None)
    if plot is None:
        first, *others = (section for section in sections if section.blocks)
        rows = sum(len(block.rows) for block in first.blocks if isinstance(block, Table))
        return [replace(first, first=rows <= _ROWS), *others]
    rest = [replace(section, blocks=tuple(b for b in section.blocks if not (isinstance(b, Plot) and b.svg == plot.svg)))
            for section in sections]  # fmt: skip
    title = named(shown) if isinstance(shown, Statement) else _TOLERANCES
    return [Section(say("{what} against the limits", what=title), (plot,), first=True), *rest]


_TOLERANCES = say("Tolerances by parameter")
