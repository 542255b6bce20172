"""A result as its laboratory may state it: no uncertainty below the laboratory's calibration and measurement capability."""

from __future__ import annotations

from dataclasses import replace

from cmm_uq.documents.result import Result
from cmm_uq.documents.stating import Stating
from cmm_uq.messages import Text, Verbatim, say
from cmm_uq.uncertainty.rounding import significant
from cmm_uq.units import unit


def with_capability(result: Result) -> tuple[Result, Stating]:
    """The result as a certificate states it, and what was raised.

    Lengths are taken at the artefact's longest dimension. The noise is a figure of the recording and stays.
    """
    longest = max((s.nominal for s in result.artefact.sizes if s.role == "dimension" and s.unit == "mm"), default=0.0)
    stating = Stating.of(result.job, longest)
    reported = [size.name for size in result.artefact.sizes if size.role != "set-up"]
    stated = replace(
        result,
        parameters={effect: stating.all(effect, found) for effect, found in result.parameters.items()},
        sizes=dict(result.sizes) | stating.all("artefact", {name: result.sizes[name] for name in reported}),
        accuracy=stating.all("accuracy", result.accuracy),
    )
    return stated, stating


def decided_below(result: Result, stating: Stating) -> list[Text]:
    """Statements of conformity that rest on a smaller uncertainty than the laboratory may state."""
    if stating.capability is None:
        return []
    found: list[Text] = []
    for statement in result.statements:
        length = statement.named.length_mm or stating.length_mm
        least = stating.capability.least(unit("µm"), length)
        if 0 < 2 * statement.u_um < least:
            found.append(
                say(
                    "{standard} was decided with U = {U} µm, less than the laboratory's calibration and measurement "
                    "capability of {least} µm ([laboratory.cmc]).",
                    standard=Verbatim(statement.facts.standard), U=significant(2 * statement.u_um), least=significant(least),
                )
            )  # fmt: skip
    return found
