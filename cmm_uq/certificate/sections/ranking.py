"""The errors of a machine by what each made of the recording, as a picture: what to correct first."""

from __future__ import annotations

from cmm_uq.analysis.machine.ranking import contributions
from cmm_uq.base.messages import Text, commas, say, signed
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots.residuals import budget_bars
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.quantity import significant


def ranking_plot(result: Result) -> Plot:
    """Share of every named error in what the recording deviates by, the largest first."""
    ranked = contributions(result.model, result.posterior.draws.mean(axis=0))
    names = [say("{what}, {rms} µm", what=_called(one.owner, result), rms=significant(one.rms_um)) for one in ranked]
    shares = [one.share for one in ranked]
    parts = ((name, signed(100 * share, ".0f")) for name, share in zip(names, shares, strict=True))
    told = commas(say("{name}: {share} %", name=name, share=share) for name, share in parts)
    caption = say(
        "What each error makes of the recorded deviations: its share of their sum of squares, and its root mean square in one "
        "coordinate. A share below zero takes away from what others make."
    )
    return budget_bars(names, shares, caption=caption, alternative=told)


def _called(owner: str | None, result: Result) -> Text:
    if owner is None:
        return say("What no named error explains")
    return say("Sizes of the artefact") if owner == ARTEFACT else effect_title(owner, result.model.effects)
