"""How large the recording of the calibration shows each family of errors to be, and what rests on what was known before."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, commas, number, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, section, table
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.sections.priors import changes_table, resting, sizes_table
from cmm_uq.certificate.wording import effect_title

_LITTLE = 0.01  # change that is not worth a line
_SHOWN = 0.005  # change that is not zero as printed


def priors_section(found: PartMeasurement) -> Section:
    """Sizes of the families, and what would change with other priors."""
    title = say("What the recording says of the machine's errors, and what it does not")
    if not found.influence:
        return section(title, _bounds(found))
    return section(
        title,
        Paragraph(priors_words(found), "warning" if resting_on_priors(found) else "plain"),
        sizes_table(found.given.machine.scales),
        _bounds(found),
        changes_table(found.influence, [Verbatim(one.name) for one in found.characteristics]),
    )


def resting_on_priors(found: PartMeasurement) -> list[str]:
    """Characteristics that rest on priors."""
    k = np.array([one.U / one.u if one.u else np.inf for one in found.stated])
    return [found.characteristics[i].name for i in resting(found.influence, k)]


def priors_words(found: PartMeasurement) -> Text:
    """What rests on priors, in a sentence."""
    names = resting_on_priors(found)
    if not names:
        return say(
            "Where priors of the machine's errors are half as wide, or twice, no figure changes by a tenth of U."
        )
    return say(
        "{count} of {all} characteristics rest on what was taken for the machine's errors before its recording: their value "
        "or U changes by a tenth of U or more where a prior is half as wide, or twice.",
        count=len(names), all=len(found.stated),
    )  # fmt: skip


def _bounds(found: PartMeasurement) -> Table | None:
    heads = (say("Errors"), Column(say("At most"), unit("µm")), say("Stated by"))
    rows = (
        (commas([effect_title(name) for name in one.errors]), number(one.largest_um, "g"), Verbatim(one.source))
        for one in found.job.facts.machine_state.bound
    )
    note = say(
        "Of play the gap, of a periodic error the amplitude, which 95 of 100 do not exceed. They are taken as stated: the "
        "recording of the calibration cannot show these errors by itself."
    )
    return table(say("Bounds that are stated"), heads, rows, note)
