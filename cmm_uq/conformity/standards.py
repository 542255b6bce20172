"""What each standard compares with its limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.artefacts.artefact import Artefact
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.conformity.decision import Decision, decide
from cmm_uq.conformity.quantity import Quantity
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ConformityFacts
from cmm_uq.units import MICROMETRE

ISO_10360_2_LENGTHS = 105
"""Seven positions, five lengths, three repetitions (ISO 10360-2:2009, 6.3)."""

B89_LENGTHS = 20
"""Positions of the ballbar for a near-cubic volume (ASME B89.4.1-1997, 5.5.2)."""


@dataclass(frozen=True)
class Statement:
    """A statement of conformity with all it rests on.

    Parameters
    ----------
    facts : the job's wish.
    quantity : what is compared, in words.
    value_um, u_um, limit_um : measured value, its standard uncertainty, limit.
    decision : what follows.
    remarks : what the reader must know of this use of the standard.
    """

    facts: ConformityFacts
    quantity: str
    value_um: float
    u_um: float
    limit_um: float
    decision: Decision
    remarks: tuple[str, ...]


def statement(facts: ConformityFacts, artefact: Artefact, accuracy: Mapping[str, Quantity], key: str) -> Statement:
    """Compare what the standard asks for with its limit, and decide.

    Parameters
    ----------
    facts : standard, limit and rule.
    artefact : with its recording.
    accuracy : figures with uncertainty.
    key : of job.toml, for messages.

    Raises
    ------
    CmmUqError : the recording is not what the standard is decided on.
    """
    if not isinstance(artefact, Ballbar) or facts.standard == "ISO 10360-5:2010":
        raise CmmUqError(f"{facts.standard} is not decided on a {artefact.kind}", where=f"job.toml {key} standard",
                         fix="Leave the statement out, or record the artefact that the standard asks for")  # fmt: skip
    if facts.standard == "ASME B89.4.1-1997":
        return _volumetric_performance(facts, artefact, accuracy)
    return _error_of_indication(facts, artefact, key)


def _volumetric_performance(facts: ConformityFacts, bar: Ballbar, accuracy: Mapping[str, Quantity]) -> Statement:
    """Range of the ballbar's lengths (ASME B89.4.1-1997, 5.5.2)."""
    measured = accuracy["b89_range_um"]
    limit = _limit_um(facts, bar.sizes[0].nominal)
    count = len(bar.lengths())
    remarks = () if count >= B89_LENGTHS else (
        f"The standard asks for at least {B89_LENGTHS} positions; {count} lengths were recorded.",)  # fmt: skip
    decision = decide(measured.value, measured.u, limit, facts.rule)
    return Statement(facts, "range of the ballbar lengths", measured.value, measured.u, limit, decision, remarks)


def _error_of_indication(facts: ConformityFacts, bar: Ballbar, key: str) -> Statement:
    """Largest error of indication against the maximum permissible error (ISO 10360-2:2009, 6.3; VDI/VDE 2617-2.1).

    Its uncertainty is the test uncertainty (ISO/TS 23165): that of the calibrated length; the machine's own scatter is part
    of what is tested.
    """
    size = bar.sizes[0]
    if not size.certified:
        raise CmmUqError(f"{facts.standard} compares with a calibrated length, and the bar has none",
                         where=f"job.toml {key} standard", fix="Give length_mm and u_um of the bar in [artefact]")  # fmt: skip
    errors = np.abs(bar.lengths() - size.nominal) / MICROMETRE
    value, u = float(errors.max()), size.sd / MICROMETRE
    limit = _limit_um(facts, size.nominal)
    remarks = [f"The uncertainty is the test uncertainty (ISO/TS 23165): u of the calibrated length, {u:.3g} µm."]
    if len(errors) < ISO_10360_2_LENGTHS:
        remarks.append(
            f"{len(errors)} lengths of one nominal length were recorded; a complete test has {ISO_10360_2_LENGTHS} of five."
        )
    decision = decide(value, u, limit, facts.rule)
    return Statement(facts, "largest error of indication of a length", value, u, limit, decision, tuple(remarks))


def _limit_um(facts: ConformityFacts, length_mm: float) -> float:
    return facts.limit_um or (facts.mpe.a_um + length_mm / facts.mpe.k if facts.mpe else float("inf"))
