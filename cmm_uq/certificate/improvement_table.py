"""What a diagnosis gained, as a table: residuals before and after, and how well it predicts what it was not fitted to."""

from __future__ import annotations

from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.base.messages import NOTHING, Text, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Table
from cmm_uq.maths.uncertainty.rounding import alike


def improvement_table(gain: Improvement, rms: Text, heldout: Text, note: Text) -> Table:
    """Rms in µm, and the gain in log predictive density.

    Parameters
    ----------
    gain : that was found.
    rms, heldout : names of the rows.
    note : what was held out, and what ± is.
    """
    rows = (
        (rms, *alike(gain.rms_before_um, gain.rms_after_um, decimals=2), unit("µm")),
        (heldout, *alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um, decimals=2), unit("µm")),
        (
            say("Gain in log predictive density"),
            NOTHING,
            say("{elpd_gain:.1f} ± {elpd_gain_se:.1f}", elpd_gain=gain.elpd_gain, elpd_gain_se=gain.elpd_gain_se),
            NOTHING,
        ),
    )
    heads = (
        Column(say("Quantity"), numeric=False),
        Column(say("Before")),
        Column(say("After")),
        Column(say("Unit"), numeric=False),
    )
    return Table(say("Improvement"), heads, rows, (note,))
