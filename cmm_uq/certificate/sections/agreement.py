"""Whether statements of one machine agree: what a certificate says of it, and a part of the certificate that it stands on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.agreement import Agreement, FigurePair, Figures, RecordedDraws, held_together
from cmm_uq.base.messages import Text, Verbatim, holding, number, say
from cmm_uq.certificate import wording
from cmm_uq.certificate.origin import attributes, quantity_data
from cmm_uq.certificate.wording import effect_title
from cmm_uq.maths.inference.posterior import Cause, Doubt

_TOLD = 3  # of what was read and contradicts the machine's errors, the worst


def _what(one: FigurePair) -> Text:
    if isinstance(one.of, tuple):
        return effect_title(one.of[0])
    if one.length_mm is None:
        return say("the slope of the line of measurement {number}", number=one.of)
    length = number(one.length_mm, ".4g")
    return say("the error of a length of {length} mm in measurement {number}", length=length, number=one.of)


def held(agreement: Agreement) -> Text:
    return say(
        "{count} figures were held against what all errors together say of them: error factors by the named errors alone, "
        "slopes of lines and errors of lengths as read. The largest difference is {percent} % of what their joint uncertainty "
        "allows.",
        count=sum(agreement.counts.values()),
        percent=number(100 * agreement.largest, ".2g"),
    )


def contradicted(agreement: Agreement) -> list[Text]:
    """What was read otherwise than all errors together expect it."""
    return [
        say(
            "No figure by a model of the machine's errors is given: {what} is {stated} {unit} as read, and {together} {unit} "
            "by all errors together, which their joint uncertainty does not allow. Decisions on values as read stand.",
            what=_what(one),
            stated=wording.with_uncertainty(one.stated),
            together=wording.with_uncertainty(one.together),
            unit=one.stated.unit,
        )
        for one in agreement.of_readings[:_TOLD]
    ]


def agreement_data(agreement: Agreement) -> dict[str, Any]:
    each = []
    for one in agreement.disagree:
        both = {"stated": quantity_data(one.stated), "all_errors": quantity_data(one.together)}
        each.append({"figure": one.name, **attributes(one, "length_mm", "ratio"), "unit": str(one.stated.unit), **both})
    return {"figures": dict(agreement.counts), "largest": agreement.largest, "disagree": each}


def against_certificate(
    results: Mapping[str, Any], drawn: RecordedDraws | None, causes: Sequence[Cause] = ()
) -> list[Text]:
    """What a part's machine has against the certificate that states it, or that has against itself.

    ``results``: of the certificate. ``drawn``: the errors that the part's uncertainty is made of, and its recording.
    ``causes``: what is stated to be in doubt about that.
    """
    regions = results.get("regions", {})
    names = [*regions.get("disagree", ()), *(one["figure"] for one in regions.get("agreement", {}).get("disagree", ()))]
    withdrawn = say(
        "Figures of the machine's certificate contradict each other, and it gives none that follow from a model of its "
        "errors: {figures}.",
        figures=Verbatim(", ".join(dict.fromkeys(names))),
    )
    texts = holding((names, withdrawn))
    if drawn is None:
        return texts
    found = [drawn.slopes(Doubt((), tuple(causes)))]
    if regions.get("of") == int(drawn.model.used.sum()):  # else its factors are of other set-ups, too
        found.append(_factors(regions.get("recorded", {}), drawn))
    return texts + [
        say(
            "By the machine's certificate {what} is {stated} {unit}, and {together} {unit} by the errors that the uncertainty "
            "of this part is made of, which their joint uncertainty does not allow.",
            what=_what(one),
            stated=wording.with_uncertainty(one.stated),
            together=wording.with_uncertainty(one.together),
            unit=one.stated.unit,
        )
        for one in held_together(found).disagree[:_TOLD]
    ]


def _factors(stated: Mapping[str, Mapping[str, Mapping[str, float]]], drawn: RecordedDraws) -> Figures:
    """As a certificate has them over its set-ups by all errors together, and as a part has them there."""
    unknowns = [drawn.model.unknowns[i] for i in drawn.which.tolist()]
    some = [i for i, one in enumerate(unknowns) if one.key[1] in stated.get(one.key[0], {})]
    keys, units = [unknowns[i].key for i in some], [unknowns[i].unit for i in some]
    given, draws = [stated[effect][name] for effect, name in keys], drawn.factors[:, some]
    value, u = (np.array([one[figure] for one in given]) for figure in ("value", "u"))
    return Figures("factor", keys, units, value, u, draws.mean(axis=0), draws.std(axis=0))
