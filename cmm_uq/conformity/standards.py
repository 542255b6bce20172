"""What each standard compares with its limit, and on what recording."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from cmm_uq.conformity.copies import copies_in_words
from cmm_uq.conformity.decision import decide, needs_uncertainty
from cmm_uq.conformity.plan_conditions import conditions
from cmm_uq.conformity.plans import PLANS
from cmm_uq.conformity.statement import Decided, Statement, least_favourable
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ConformityFacts, needed
from cmm_uq.model.artefact import Artefact, Forms
from cmm_uq.points import Floats
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import MICROMETRE

NOT_CONSIDERED = (
    "Simple acceptance takes no account of the uncertainty: at the limit itself conforming is as likely as not."
)


def statement(
    facts: ConformityFacts,
    artefact: Artefact,
    accuracy: Mapping[str, Quantity],
    key: str,
    standards: Collection[str],
    recorded: Artefact | None = None,
) -> Statement:
    """Compare what the standard asks for with its limit, and decide.

    Parameters
    ----------
    facts : standard, limit and rule.
    artefact : with its recording.
    accuracy : figures with uncertainty.
    key : of job.toml, for messages.
    recorded : the artefact as it was recorded, where ``artefact`` has been corrected: that makes no copy a measurement.
    standards : that may be stated of this kind of artefact.

    Raises
    ------
    CmmUqError : the recording is not what the standard is decided on, or the rule needs an uncertainty that is not stated.
    """
    recorded = recorded or artefact
    if facts.standard in standards:
        if facts.standard == "ASME B89.4.1-1997":
            return _volumetric_performance(facts, artefact, accuracy, recorded)
        if (forms := artefact.forms()) is not None:
            return _form_error(facts, artefact, forms, key, recorded)
        return _errors_of_indication(facts, artefact, key, recorded)
    raise CmmUqError(f"{facts.standard} is not decided on a {artefact.kind}", where=f"job.toml {key} standard",
                     fix="Leave the statement out, or record the artefact that the standard asks for")  # fmt: skip


def _volumetric_performance(
    facts: ConformityFacts, artefact: Artefact, accuracy: Mapping[str, Quantity], recorded: Artefact
) -> Statement:
    """Range of the ballbar's lengths (ASME B89.4.1-1997, 5.5.2)."""
    measured, bar = accuracy["b89_range_um"], artefact.sizes[0].nominal
    limit = float(_limits_um(facts, np.array([bar]))[0])
    decision = decide(measured.value, measured.u, limit, facts.rule, signed=False)
    item = Decided(measured.value, measured.u, limit, decision, length_mm=bar)
    return _stated(facts, "range of the ballbar lengths", "lengths", (item,), recorded, ())


def _errors_of_indication(facts: ConformityFacts, artefact: Artefact, key: str, recorded: Artefact) -> Statement:
    """Every error of indication against its own maximum permissible error (ISO 10360-2:2009, 6.3).

    Its uncertainty is the test uncertainty (ISO/TS 23165): that of the calibrated length; the machine's own scatter is part
    of what is tested. Copies are no measurements and are not decided.
    """
    found = artefact.indications()
    if found is None:
        raise CmmUqError(f"{facts.standard} compares with calibrated lengths, and the {artefact.kind} has none",
                         where=f"job.toml {key} standard",
                         fix="Give length_mm and u_um in [artefact], or leave the statement out")  # fmt: skip
    points, first = artefact.points, found.rows[:, 0]
    errors, u, limits = found.errors / MICROMETRE, found.u / MICROMETRE, _limits_um(facts, found.lengths)
    _refuse_without_uncertainty(facts, float(u.min()), "u_um", key)
    copies = list(recorded.points.copies)
    items = tuple(
        Decided(
            float(errors[i]), float(u[i]), float(limits[i]),
            decide(float(errors[i]), float(u[i]), float(limits[i]), facts.rule, signed=True),
            int(points.measurement[first[i]]), int(points.repeat[first[i]]), float(found.lengths[i]),
        )
        for i in np.flatnonzero(~np.isin(recorded.points.group[first], copies))
    )  # fmt: skip
    worst = least_favourable(items)
    remarks = [
        f"u is the test uncertainty (ISO/TS 23165), from the calibrated length: {worst.u_um:.3g} µm."
        if worst.u_um > 0
        else "u_um is not stated: no uncertainty is considered, and no probability can be given.",
        f"{len(items)} {'length' if len(items) == 1 else 'lengths'} decided, each by its own u and limit; least favourable: "
        f"measurement {worst.measurement}, repeat {worst.repeat}, {worst.length_mm:.5g} mm.",
    ]
    return _stated(facts, "error of indication of length, worst against its limit", "lengths", items, recorded, remarks)


def _form_error(
    facts: ConformityFacts, sphere: Artefact, probed: Forms, key: str, recorded: Artefact
) -> Statement:  # fmt: skip
    """Probing form error: the largest range of radial distances from a least-squares sphere (ISO 10360-5:2010, 6.2).

    Its uncertainty is the test uncertainty (ISO/TS 23165): half the form deviation of the test sphere.
    """
    worst = int(np.argmax(probed.form))
    value, u = float(probed.form[worst]) / MICROMETRE, probed.certified / 2 / MICROMETRE
    _refuse_without_uncertainty(facts, u, "form_um", key)
    limit = float(_limits_um(facts, np.array([sphere.sizes[0].nominal]))[0])
    decision = decide(value, u, limit, facts.rule, signed=False)
    item = Decided(value, u, limit, decision, int(probed.measurement[worst]), int(probed.repeat[worst]),
                   sphere.sizes[0].nominal)  # fmt: skip
    remarks = [
        f"u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, {u:.2g} µm."
        if u > 0
        else "The test sphere is taken as perfectly round: its form deviation (form_um) is not given."
    ]
    if len(probed.form) > 1:
        remarks.append(f"The largest of {len(probed.form)} spheres: measurement {probed.measurement[worst]}.")
    return _stated(facts, "probing form error", "points", (item,), recorded, remarks)


def _stated(
    facts: ConformityFacts, quantity: str, measured: str, items: tuple[Decided, ...], recorded: Artefact,
    remarks: Sequence[str],
) -> Statement:  # fmt: skip
    """With what the test lacks, and what the rule leaves out."""
    missing = tuple(
        text for condition in conditions(PLANS[facts.standard], recorded, recorded=True) for text in condition.missing
    )
    more = []
    if facts.rule == "simple" and items[0].u_um > 0:
        more.append(NOT_CONSIDERED)
    if facts.standard == "VDI/VDE 2617":
        more.append(
            "VDI/VDE 2617 is decided like ISO 10360-2:2009 here, with the same positions, lengths and repetitions."
        )
    if copies := copies_in_words(recorded.points):
        more.append(copies)
    return Statement(facts, quantity, measured, items, missing, (*remarks, *more))


def _refuse_without_uncertainty(facts: ConformityFacts, u: float, name: str, key: str) -> None:
    if u <= 0 and needs_uncertainty(facts.rule):
        problem, fix = needed(name, facts)
        raise CmmUqError(problem, where=f"job.toml {key} rule", fix=fix)


def _limits_um(facts: ConformityFacts, lengths_mm: Floats) -> Floats:
    if facts.mpe is not None:
        return np.asarray(facts.mpe.a_um + lengths_mm / facts.mpe.k, dtype=np.float64)
    return np.full(len(lengths_mm), facts.limit_um, dtype=np.float64)
