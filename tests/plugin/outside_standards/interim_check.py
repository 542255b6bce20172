"""A laboratory's own procedure as a standard for cmm_uq, from a package of its own: mean errors of repeated lengths."""

import numpy as np

from cmm_uq.standard import (
    LENGTHS, MICROMETRE, Artefact, ArtefactFacts, Characteristic, Condition, Decided, Standard, Statement, Test, decide, say,
)  # fmt: skip

REPEATS = 3


def mean_errors(test: Test) -> Statement:
    """The mean error of the repeats of each length in each place against its limit."""
    found = test.indications()
    test.refuse_without_uncertainty(float(found.u.min()), "u_um")
    items = []
    for rows in _repeats(test.artefact):
        error, u = found.errors[rows].mean() / MICROMETRE, found.u[rows].mean() / MICROMETRE
        length = float(found.lengths[rows].mean())
        limit = float(test.limits_um(np.array([length]))[0])
        decision = decide(error, u, limit, test.facts.rule, signed=True)
        measurement = int(test.artefact.points.measurement[found.rows[rows[0], 0]])
        items.append(Decided(error, u, limit, decision, measurement, length_mm=length))
    remarks = [say("{count} lengths decided, each by the mean error of its repeats.", count=len(items))]
    quantity = say("mean error of repeated lengths, worst against its limit")
    return test.stated(quantity, say("lengths"), tuple(items), remarks)


def repeated(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Each length is measured three times."""
    counts = [len(rows) for rows in _repeats(artefact)]
    missing = sum(max(0, REPEATS - count) for count in counts)
    told = (say("{missing} repeats of {count} lengths", missing=missing, count=len(counts)),) if missing else ()
    return (Condition(say("{count} repeats of each length", count=REPEATS), told),)


def unstated(artefact: ArtefactFacts) -> str | None:
    """The key without which a length has no uncertainty."""
    return None if artefact.u_um else "u_um"


def _repeats(artefact: Artefact) -> list[np.ndarray]:
    found = artefact.indications()
    if found is None:
        return []
    keys = np.column_stack([artefact.points.measurement[found.rows[:, 0]], np.round(found.lengths)])
    _, of = np.unique(keys, axis=0, return_inverse=True)
    return [np.flatnonzero(of.ravel() == i) for i in range(int(of.max()) + 1)]


STANDARD = Standard("QP 7.2:2026", (Characteristic("mean error", LENGTHS, mean_errors, repeated, unstated),))
