"""A part's evaluation, step by step, and its page and ``results.json``, written as one set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.decision import PriorKnowledge
from cmm_uq.analysis.conformity.limits import LimitDecision, Limits, judge
from cmm_uq.analysis.parts import setup
from cmm_uq.analysis.parts.budget import DRAWS as SHARED, point_errors, variance_shares
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.methods.of_job import compare_methods, methods_of
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.reported import measured_of
from cmm_uq.analysis.parts.result import conforming, middle, stated, within_bounds
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual, prior_influence
from cmm_uq.analysis.parts.ways import spread, ways
from cmm_uq.app.commands.files import (
    NOT_RECORDED,
    REPORTS,
    RESULTS,
    Finished,
    Stage,
    Written,
    kept_in,
    ledger_of,
    results_at,
    silent,
    unchanged,
)
from cmm_uq.app.commands.parts.drift import further_of
from cmm_uq.app.commands.parts.machine import StatedMachine, state_machine, with_calibration, with_history
from cmm_uq.app.commands.parts.proposals import foresee
from cmm_uq.app.commands.reading import in_language
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.messages import NOTHING, Text, say
from cmm_uq.base.output import Owner, staged
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.origin import file_name
from cmm_uq.certificate.part.figures import part_summary
from cmm_uq.certificate.part.measurement import MATTERS, CertificateStatus, PartMeasurement, UnseenError
from cmm_uq.certificate.part.method import decided_without
from cmm_uq.certificate.plots.style import fonts_of
from cmm_uq.certificate.results.provenance import FILE as PROVENANCE, Behind, provenance_of
from cmm_uq.certificate.wording import effect_title
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob, read_part
from cmm_uq.jobs.tables.identification import SIMULATED
from cmm_uq.laboratory.records.facts import PART as COMMAND, Heads
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.maths.uncertainty.propagation import Simulated, Source, simulate, simulate_adaptively

if TYPE_CHECKING:
    from cmm_uq.certificate.document import Document

# virtual measurements: ten thousand over one less the probability of the interval (JCGM 101:2008, 7.2.2).
TRIALS = 200_000
KEPT = 100_000  # virtual measurements that are kept, for probabilities: one of 5 % is then known to 0.07 %.
# virtual measurements of each way that is compared: its u is then known to 0.9 %, and its part of the planned one better.
COMPARED = 6000
# points of a plan from which on fewer virtual measurements are made, as many points in all; a tenth of them at least
MANY = 1000
COVERAGE = 0.95
# points that one of a feature counts for that is found anew each time, not by a derivative: a zone, an inscribed element
ITERATED = 50


@dataclass(frozen=True)
class PartOptions:
    """How a part is evaluated."""

    seed: int = 0  # of everything random
    trials: int | None = None  # virtual measurements; ``None`` for :data:`TRIALS`, fewer of a plan of many points
    # of u that are to be known: then so many are made as that needs (JCGM 101:2008, 7.9), ``trials`` at least
    digits: int | None = None
    rerun: bool = False  # whether the machine's certificate is computed again from its inputs
    # files and folders of certificates that are trusted; ``None`` for nobody, and then nothing need be signed
    trust: tuple[Path, ...] | None = None
    records: str | Path | None = None  # of the machine's history, that its drift is read from; ``None`` for none
    history: bytes | None = None  # of the machine, that a report has inside; then no records are asked


@naming_package()
def evaluate_part(job: PartJob, options: PartOptions | None = None, stage: Stage = silent) -> PartMeasurement:
    """The uncertainty of what is measured on a part, and whether it conforms; nothing is written."""
    options = options or PartOptions()
    seed = options.seed
    setup.refuse_unfit(job)
    of_part = measured_of(job)
    job, measured = of_part.job, of_part.values
    plan = setup.plan_of(job)
    trials = affordable(TRIALS, plan) if options.trials is None else options.trials
    methods = methods_of(job, plan, measured)

    # the machine: its certificate verified, its errors on the day of the measurement
    machine = state_machine(
        job, rerun=options.rerun, trust=options.trust, records=options.records, history=options.history, seed=seed,
        stage=stage, fits=partial(setup.refuse_out_of_reach, job),
    )  # fmt: skip
    job = with_history(with_calibration(job, machine.job), machine.history)

    # the measurement made many times, with draws of every cause (JCGM 101)
    circumstances = replace(setup.circumstances_of(job, machine.state, plan, setup.PLACES), measured=job.measured)
    stage("Preparing the virtual measurements", 0.25)
    virtual = Virtual(plan, circumstances)
    either_side = never_negative(plan) & (job.reported is not None)
    simulated, errors = _simulate(virtual, trials, options.digits, seed, stage, either_side)

    # where the uncertainty comes from, and what would reduce it
    stage("Shares of each cause", 0.6)
    shares = variance_shares(virtual, min(affordable(SHARED, plan), trials), seed)
    stage("What would change the uncertainty", 0.7)

    def with_twice_the_points() -> tuple[Plan, MeasurementConditions]:
        other = setup.doubled(job)
        return (twice := setup.plan_of(other)), setup.circumstances_of(other, machine.state, twice, setup.PLACES)

    draws = min(affordable(COMPARED, plan), trials)
    standing = _with_without(machine, virtual, circumstances, draws, seed)
    reductions = ways(plan, circumstances, draws, seed, doubled=with_twice_the_points, planned=virtual)
    stage("What to measure on the machine", 0.8)
    unseen = tuple(  # what the calibration left free or did not see, by characteristic, the largest share first
        UnseenError(name, line, effect := line.partition(": ")[2], effect_title(effect), share, why)
        for name in shares.characteristics
        for line, share, why in shares.told(name, virtual.named, MATTERS)
    )
    further, files = further_of(machine.job, unseen)
    influence = prior_influence(virtual, circumstances.machine, simulated.u, seed)

    # values, limits, decisions (JCGM 106)
    stage("Decisions", 0.85)
    characteristics = stated(simulated, measured, plan, errors, widths_alone=job.reported is not None)
    decisions = decide_limits(job, plan, errors, measured)
    together = None if measured is None else _together(conforming(plan, errors, measured)[1], decisions)
    x, y, z = setup.origin_of(job, machine.state.machine).tolist()
    found = PartMeasurement(
        job, plan, circumstances, virtual, simulated, characteristics, measured, shares, unseen,
        further, decisions, together, tuple(reductions),
        point_errors(virtual, seed=seed), (x, y, z), standing, compare_methods(characteristics, shares, methods),
        digits=options.digits, seed=seed, asked=trials, warnings=(*of_part.warnings, *machine.warnings),
        files=files, influence=influence, recordings=machine.recordings,
    )  # fmt: skip
    if withheld := decided_without(found):
        judged = tuple(one and one.not_passing for one in decisions)
        found = replace(found, judged=judged, withheld=withheld, warnings=(*found.warnings, *withheld))
    return foresee(found, stage)


def _with_without(
    machine: StatedMachine, virtual: Virtual, given: MeasurementConditions, draws: int, seed: int
) -> CertificateStatus:
    """How the machine is known, with what tests that it passed do to u."""
    if machine.without is None:
        return machine.standing
    without = Virtual(virtual.plan, replace(given, machine=machine.without), virtual.known)
    ratio = tuple((spread(without, draws, seed) / spread(virtual, draws, seed)).tolist())
    passed = (replace(one, u_without=ratio) if one.used else one for one in machine.standing.passed)
    return replace(machine.standing, passed=tuple(passed))


def affordable(draws: int, plan: Plan) -> int:
    """So many virtual measurements, or fewer of a plan of many points, or of features that are found anew in each."""
    own = {one.name: one.association for one in plan.features}
    found_anew = {
        (name, how) for one in plan.characteristics for name in (*one.features, *one.datums)
        if (how := (name in one.features and one.association) or own.get(name, "least_squares")) != "least_squares"
    }  # fmt: skip
    points = len(plan.points) + ITERATED * sum(len(plan.feature(name).points) for name, _ in found_anew if name in own)
    return max(draws // 10, min(draws, draws * MANY // points))


def _together(together: float, decisions: Iterable[LimitDecision | None]) -> float | None:
    """The probability that all limits are kept, beside those of each as they are told: with a prior, and rare tails."""
    each = [one.probability for one in decisions if one is not None and one.probability is not None]
    return within_bounds(together, np.array(each)) if each else None


def _simulate(
    virtual: Virtual, trials: int, digits: int | None, seed: int, stage: Stage, either_side: NDArray[np.bool_]
) -> tuple[Simulated, Floats]:
    """Figures of the errors, and (N, c) errors of the first of the virtual measurements that they come from.

    ``either_side``: (c,) which errors are sizes that may have made the value larger or smaller.
    """
    blocks, made = list[Floats](), 0

    def draw(random: np.random.Generator, n: int) -> Floats:
        nonlocal made
        errors = virtual.errors(random, n)
        if either_side.any():
            errors[:, either_side] *= random.choice((-1.0, 1.0), (n, np.count_nonzero(either_side)))
        if made < KEPT:
            blocks.append(errors[: KEPT - made].copy())
        made += n
        stage(f"Virtual measurements: {made}", 0.3 + 0.3 * min(1.0, made / TRIALS))
        return np.ascontiguousarray(errors.T)

    source = Source(virtual.names, draw)
    if digits is None:
        return simulate(source, trials, COVERAGE, seed), np.concatenate(blocks)
    return simulate_adaptively(source, COVERAGE, digits, seed, fewest_trials=trials), np.concatenate(blocks)


def decide_limits(
    job: PartJob, plan: Plan, errors: Floats, measured: Floats | None
) -> tuple[LimitDecision | None, ...]:
    """What follows from each characteristic's limits, by the job's rule.

    Where nothing was measured, what would be accepted is told of a value that is not corrected for its mean error. A zone is
    then decided on by the root mean square of all errors as that of a normal distribution: errors about a perfect part are to
    one side and narrower than those about a part near its limit.

    ``errors``: (N, c) of virtual measurements. ``measured``: (c,) values; ``None`` where nothing was measured.
    """
    found: list[LimitDecision | None] = []
    sides = never_negative(plan) & (job.reported is not None)
    for i, (facts, one) in enumerate(zip(job.facts.characteristic, plan.characteristics, strict=True)):
        if one.lower is None and one.upper is None:
            found.append(None)
            continue
        zone = facts.asks.limits == "zone"
        mean = middle(errors[:, i]) if zone and measured is not None else float(errors[:, i].mean())
        if sides[i]:  # the larger half, to either side: beyond the median each tail is that of all sizes
            larger, mean = np.sort(np.abs(errors[:, i]))[len(errors) // 2 :], 0.0
            about = np.concatenate([larger, -larger])
        else:
            about = errors[:, i] - mean
        if measured is None and zone:
            size = float(np.sqrt(np.mean(errors[:, i] ** 2)))
            about = size * np.random.default_rng(0).standard_normal(len(errors))
        limits = Limits(one.lower, one.upper, about, zone, _prior(job, facts, one.lower, one.upper, zone=zone))
        value = None if measured is None else float(measured[i]) - mean
        found.append(judge(limits, job.facts.decision.rule, value))
    return tuple(found)


def _prior(
    job: PartJob, facts: CharacteristicFacts, lower: float | None, upper: float | None, *, zone: bool
) -> PriorKnowledge | None:
    """What is known of the value beforehand: about the middle of its limits, of a zone about zero."""
    given = job.facts.decision.prior
    if given is None:
        return None
    where = f"job.toml [decision] prior: characteristic {facts.name!r}"
    if zone:
        middle, limit = 0.0, upper or 0.0
    elif lower is None or upper is None:
        raise CmmUqError("a prior is about the middle of two limits, and there is one", where=where,
                         fix="Give both limits, or a rule without a prior")  # fmt: skip
    else:
        middle, limit = 0.5 * (lower + upper), 0.5 * (upper - lower)
    if given.share_of_limit is not None:
        return PriorKnowledge(middle, given.share_of_limit * limit)
    if facts.asks.limits == "angles":
        raise CmmUqError("a prior in µm is none of an angle", where=where, fix="Give share_of_limit")
    return PriorKnowledge(middle + MICROMETRE * given.mean_um, MICROMETRE * float(given.sd_um or 0.0))


DOCUMENTS = ("part.html", "part.pdf")


def write_part(
    folder: Path, out: Path | None = None, *, options: PartOptions | None = None, force: bool = False,
    stage: Stage = silent, language: Code | None = None, records: str | Path | None = NONE,
) -> Written[PartMeasurement]:  # fmt: skip
    """Evaluate a part's job and write ``part.html``, ``part.pdf``, ``results.json`` and what comes with them, all or none.

    ``out``: where to write; ``reports/<job id>`` by default. ``force``: keep what stands in the way as ``NAME.previous``
    instead of refusing. ``records``: that it is kept in, as of :func:`~cmm_uq.app.commands.report.write_report`.
    """
    stage("Reading the job", 0.0)
    job = in_language(read_part(folder), language)
    return written(job, lambda: evaluate_part(job, options, stage), out, force=force, stage=stage, records=records)


def written(
    job: PartJob, evaluate: Callable[[], PartMeasurement], out: Path | None = None, *, force: bool = False,
    stage: Stage = silent, records: str | Path | None = NONE,
) -> Written[PartMeasurement]:  # fmt: skip
    """Make sure of the folder, then evaluate, render and write, all or none, and record it with that."""
    facts = job.facts.job
    fonts_of(facts.language)  # refused before anything is computed
    folder = REPORTS / facts.id if out is None else out
    names = [file_name(name, facts.origin) for name in DOCUMENTS]
    owner, inputs = Owner(COMMAND, facts.id, facts.origin), tuple(job.folder / name for name in job.inputs)
    with (
        kept_in(records, out) as kept,
        staged(folder, owner, inputs=inputs, force=force, expected=(*names, RESULTS, PROVENANCE)) as place,
    ):
        measurement = evaluate()
        contents = contents_of(measurement, stage, heads=kept.heads(owner))
        stage(f"Writing: {len(contents)} files to {folder}", 0.95)
        ledger = kept.ledger(lambda history: ledger_of(history, job, COMMAND, folder, contents, RESULTS))
        files = place.write(contents, ledger=ledger)
    stage("Done", 1.0)
    ends = (part_summary(measurement), measurement.conforming, facts.id, facts.origin, kept.said())
    return Written(measurement, contents[RESULTS], files, *ends)


def contents_of(
    found: PartMeasurement, stage: Stage = silent, *, finished: Finished = unchanged, heads: Heads = NOT_RECORDED
) -> dict[str, bytes]:
    from cmm_uq.certificate.part.measurement import part_results
    from cmm_uq.certificate.render import render_html, render_pdf

    job = found.job
    if RESULTS in job.inputs:
        raise CmmUqError("has the name of a file that this command writes", where=str(job.folder / RESULTS),
                         fix="Put the machine's results into a folder of their own")  # fmt: skip
    html, pdf = (file_name(name, job.facts.job.origin) for name in DOCUMENTS)
    results = part_results(found)
    data, line = results_at(results, heads)
    stage("Composing the page", 0.88)
    document = document_of(found, line)
    stage("Rendering", 0.92)
    page = render_html(document).encode()
    facts, standing = job.facts, found.standing
    recording = "" if facts.recording is None else facts.recording.recorded
    behind = provenance_of(
        Behind(COMMAND, facts.job, facts.laboratory, facts.job.origin, job.inputs, recording,
               (standing.number, standing.laboratory)), results, {html: page, RESULTS: data},
    )  # fmt: skip
    further = {RESULTS: data, PROVENANCE: finished(PROVENANCE, behind)}
    return {html: page, pdf: render_pdf(document, {**job.inputs, **further}), **further, **found.files}


def document_of(found: PartMeasurement, records: Text = NOTHING) -> Document:
    """The page, in the job's language, marked where nobody measured; ``records``: how they stood, in words."""
    from cmm_uq.certificate.document import translated as said
    from cmm_uq.certificate.origin import marked_as
    from cmm_uq.certificate.part.page import part_document
    from cmm_uq.certificate.plots.style import lettered_in

    facts = found.job.facts.job
    with lettered_in(facts.language):
        document = replace(part_document(found), records=records)
    told = say(
        "Figures of this job are simulated or an example's: no part was measured, and nothing here certifies one."
    )
    return said(marked_as(document, facts.origin, facts.id, [told] * (facts.origin == SIMULATED)), facts.language)
