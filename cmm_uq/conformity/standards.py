"""What each standard compares with its limit."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.conformity.decision import Decision, decide
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ConformityFacts
from cmm_uq.model.artefact import Artefact, Forms
from cmm_uq.points import Floats
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import MICROMETRE

ISO_10360_2_LENGTHS = 105
"""Seven positions, five lengths, three repetitions (ISO 10360-2:2009, 6.3)."""

ISO_10360_2_NOMINALS = 5
"""Different nominal lengths of that test."""

ISO_10360_5_POINTS = 25
"""Points over a hemisphere of the test sphere (ISO 10360-5:2010, 6.2)."""

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


def statement(
    facts: ConformityFacts, artefact: Artefact, accuracy: Mapping[str, Quantity], key: str, standards: Collection[str]
) -> Statement:
    """Compare what the standard asks for with its limit, and decide.

    Parameters
    ----------
    facts : standard, limit and rule.
    artefact : with its recording.
    accuracy : figures with uncertainty.
    key : of job.toml, for messages.
    standards : that may be stated of this kind of artefact.

    Raises
    ------
    CmmUqError : the recording is not what the standard is decided on.
    """
    if facts.standard in standards:
        if facts.standard == "ASME B89.4.1-1997":
            return _volumetric_performance(facts, artefact, accuracy)
        if (forms := artefact.forms()) is not None:
            return _form_error(facts, artefact, forms)
        return _error_of_indication(facts, artefact, key)
    raise CmmUqError(f"{facts.standard} is not decided on a {artefact.kind}", where=f"job.toml {key} standard",
                     fix="Leave the statement out, or record the artefact that the standard asks for")  # fmt: skip


def _volumetric_performance(facts: ConformityFacts, artefact: Artefact, accuracy: Mapping[str, Quantity]) -> Statement:
    """Range of the ballbar's lengths (ASME B89.4.1-1997, 5.5.2)."""
    measured = accuracy["b89_range_um"]
    limit = _limits_um(facts, np.array([artefact.sizes[0].nominal]))[0]
    count = len(artefact.measurement)
    remark = f"The standard asks for at least {B89_LENGTHS} positions; {count} lengths were recorded."
    decision = decide(measured.value, measured.u, limit, facts.rule)
    return Statement(
        facts, "range of the ballbar lengths", measured.value, measured.u, limit, decision,
        () if count >= B89_LENGTHS else (remark,),
    )  # fmt: skip


def _error_of_indication(facts: ConformityFacts, artefact: Artefact, key: str) -> Statement:
    """The error of indication nearest to (or farthest beyond) its maximum permissible error (ISO 10360-2:2009, 6.3).

    Its uncertainty is the test uncertainty (ISO/TS 23165): that of the calibrated length; the machine's own scatter is part
    of what is tested.
    """
    found = artefact.indications()
    if found is None:
        raise CmmUqError(f"{facts.standard} compares with calibrated lengths, and the {artefact.kind} has none",
                         where=f"job.toml {key} standard",
                         fix="Give length_mm and u_um in [artefact], or leave the statement out")  # fmt: skip
    limits = _limits_um(facts, found.lengths)
    errors, u = np.abs(found.errors) / MICROMETRE, found.u / MICROMETRE
    worst = int(np.argmax(errors - limits))
    remarks = [f"u is the test uncertainty (ISO/TS 23165), from the calibrated length: {u[worst]:.3g} µm."]
    if len(errors) < ISO_10360_2_LENGTHS or found.nominal_lengths < ISO_10360_2_NOMINALS:
        remarks.append(
            f"{len(errors)} lengths of {found.nominal_lengths} nominal were recorded; a complete test has "
            f"{ISO_10360_2_LENGTHS} of {ISO_10360_2_NOMINALS}."
        )
    value, limit = float(errors[worst]), float(limits[worst])
    decision = decide(value, float(u[worst]), limit, facts.rule)
    return Statement(facts, "error of indication of length, worst against its limit", value, float(u[worst]), limit,
                     decision, tuple(remarks))  # fmt: skip


def _form_error(facts: ConformityFacts, sphere: Artefact, probed: Forms) -> Statement:
    """Probing form error: the largest range of radial distances from a least-squares sphere (ISO 10360-5:2010, 6.2).

    Its uncertainty is the test uncertainty (ISO/TS 23165): half the form deviation of the test sphere.
    """
    worst = int(np.argmax(probed.form))
    value, u = float(probed.form[worst]) / MICROMETRE, probed.certified / 2 / MICROMETRE
    limit = float(_limits_um(facts, np.array([sphere.sizes[0].nominal]))[0])
    remarks = [
        f"u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, {u:.2g} µm."
        if u > 0
        else "The test sphere is taken as perfectly round: its form deviation (form_um) is not given."
    ]
    if np.any(probed.count != ISO_10360_5_POINTS):
        counted = ", ".join(str(n) for n in sorted(set(probed.count.tolist())))
        remarks.append(f"The standard asks for {ISO_10360_5_POINTS} points on each sphere; recorded: {counted}.")
    if len(probed.form) > 1:
        remarks.append(f"The largest of {len(probed.form)} spheres: measurement {probed.measurement[worst]}.")
    return Statement(facts, "probing form error", value, u, limit, decide(value, u, limit, facts.rule), tuple(remarks))


def _limits_um(facts: ConformityFacts, lengths_mm: Floats) -> Floats:
    if facts.mpe is not None:
        return np.asarray(facts.mpe.a_um + lengths_mm / facts.mpe.k, dtype=np.float64)
    return np.full(len(lengths_mm), facts.limit_um, dtype=np.float64)
