"""The standards that can be stated: what each compares with its limit, and on what recording; those of other packages too.

Another package offers one as an entry point of the group ``cmm_uq.standards``, of the standard's own name.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from types import MappingProxyType

import numpy as np

from cmm_uq.conformity.decision import decide
from cmm_uq.conformity.plan_conditions import conditions
from cmm_uq.conformity.plans import B89, ISO_10360_2, ISO_10360_5
from cmm_uq.conformity.standard import Characteristic, Standard, Test, characteristic_of
from cmm_uq.conformity.statement import Decided, Statement, least_favourable
from cmm_uq.errors import CmmUqError, suggestion
from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.conformity import ConformityFacts
from cmm_uq.messages import Text, plural, say
from cmm_uq.model.artefact import Artefact
from cmm_uq.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.plugins import STANDARDS, Plugin, named, offered
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import MICROMETRE


def statement(
    facts: ConformityFacts,
    artefact: Artefact,
    accuracy: Mapping[str, Quantity],
    key: str,
    tested: Collection[str],
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
    tested : what of this kind of artefact a standard may be decided on.

    Raises
    ------
    CmmUqError : there is no such standard, the recording is not what it is decided on, or the rule needs an uncertainty
        that is not stated.
    """
    standard = standard_named(facts.standard)
    if standard is None:
        raise CmmUqError(f"no standard {facts.standard!r} is decided", where=f"job.toml {key} standard",
                         fix=suggestion(facts.standard, names()))  # fmt: skip
    characteristic = characteristic_of(standard, facts, key)
    if characteristic.observed not in tested:
        raise CmmUqError(f"{facts.standard} is not decided on a {artefact.kind}", where=f"job.toml {key} standard",
                         fix="Leave the statement out, or record the artefact that the standard asks for")  # fmt: skip
    return characteristic.statement(
        Test(standard, characteristic, facts, artefact, recorded or artefact, accuracy, key)
    )  # fmt: skip


def _volumetric_performance(test: Test) -> Statement:
    """Range of the ballbar's lengths (ASME B89.4.1-1997, 5.5.2)."""
    facts, artefact, accuracy = test.facts, test.artefact, test.accuracy
    measured, bar = accuracy["b89_range_um"], artefact.sizes[0].nominal
    limit = float(test.limits_um(np.array([bar]))[0])
    decision = decide(measured.value, measured.u, limit, facts.rule, signed=False)
    item = Decided(measured.value, measured.u, limit, decision, length_mm=bar)
    return test.stated(say("range of the ballbar lengths"), say("lengths"), (item,), ())


def _errors_of_indication(test: Test) -> Statement:
    """Every error of indication against its own maximum permissible error (ISO 10360-2:2009, 6.3).

    Its uncertainty is the test uncertainty (ISO/TS 23165): that of the calibrated length; the machine's own scatter is part
    of what is tested. Copies are no measurements and are not decided.
    """
    facts, artefact, recorded = test.facts, test.artefact, test.recorded
    found = test.indications()
    points, first = artefact.points, found.rows[:, 0]
    errors, u, limits = found.errors / MICROMETRE, found.u / MICROMETRE, test.limits_um(found.lengths)
    test.refuse_without_uncertainty(float(u.min()), "u_um")
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
        (
            say("u is the test uncertainty (ISO/TS 23165), from the calibrated length: {u_um:.3g} µm.", u_um=worst.u_um)
            if worst.u_um > 0
            else say("u_um is not stated: no uncertainty is considered, and no probability can be given.")
        ),
        plural(
            len(items),
            one=say(
                "{count} length decided, each by its own u and limit; {worst}.", count=len(items), worst=_least(worst)
            ),
            many=say(
                "{count} lengths decided, each by its own u and limit; {worst}.", count=len(items), worst=_least(worst)
            ),
        ),
    ]
    quantity = say("error of indication of length, worst against its limit")
    return test.stated(quantity, say("lengths"), items, remarks)


def _least(worst: Decided) -> Text:
    return say(
        "least favourable: measurement {measurement}, repeat {repeat}, {length:.5g} mm",
        measurement=worst.measurement or 0, repeat=worst.repeat or 0, length=worst.length_mm or 0.0,
    )  # fmt: skip


def _length_unstated(artefact: ArtefactFacts) -> str | None:
    return "u_um" if artefact.certified and not artefact.u_um else None


def _form_error(test: Test) -> Statement:
    """Probing form error: the largest range of radial distances from a least-squares sphere (ISO 10360-5:2010, 6.2).

    Its uncertainty is the test uncertainty (ISO/TS 23165): half the form deviation of the test sphere.
    """
    facts, sphere, key, probed = test.facts, test.artefact, test.key, test.artefact.forms()
    if probed is None:
        raise CmmUqError(f"{facts.standard} compares the form of spheres, and the {sphere.kind} has none",
                         where=f"job.toml {key} standard", fix="Leave the statement out")  # fmt: skip
    worst = int(np.argmax(probed.form))
    value, u = float(probed.form[worst]) / MICROMETRE, probed.certified / 2 / MICROMETRE
    test.refuse_without_uncertainty(u, "form_um")
    limit = float(test.limits_um(np.array([sphere.sizes[0].nominal]))[0])
    decision = decide(value, u, limit, facts.rule, signed=False)
    item = Decided(value, u, limit, decision, int(probed.measurement[worst]), int(probed.repeat[worst]),
                   sphere.sizes[0].nominal)  # fmt: skip
    remarks = [
        (
            say("u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, {u:.2g} µm.", u=u)
            if u > 0
            else say("The test sphere is taken as perfectly round: its form deviation (form_um) is not given.")
        )
    ]
    if len(probed.form) > 1:
        remarks.append(
            say(
                "The largest of {count} spheres: measurement {measurement}.",
                count=len(probed.form),
                measurement=probed.measurement[worst],
            )
        )
    return test.stated(say("probing form error"), say("points"), (item,), remarks)


def _form_unstated(artefact: ArtefactFacts) -> str | None:
    key = artefact.form_key
    return key if key is not None and not getattr(artefact, key) else None


_E0 = Characteristic("E0", LENGTHS, _errors_of_indication, partial(conditions, ISO_10360_2), _length_unstated)

BUILT_IN: Mapping[str, Standard] = MappingProxyType({standard.name: standard for standard in (
    Standard("ASME B89.4.1-1997",
             (Characteristic("volumetric performance", BARS, _volumetric_performance, partial(conditions, B89)),)),
    Standard("ISO 10360-2:2009", (_E0,)),
    Standard("ISO 10360-5:2010",
             (Characteristic("P_FTU", FORMS, _form_error, partial(conditions, ISO_10360_5), _form_unstated),)),
    Standard("VDI/VDE 2617", (_E0,), (
        say("VDI/VDE 2617 is decided like ISO 10360-2:2009 here, with the same positions, lengths and repetitions."),
    )),
)})  # fmt: skip
"""The standards that are decided here, by name; VDI/VDE 2617 is held to the plan of ISO 10360-2."""


def standard_named(name: str) -> Standard | None:
    """A standard by its name; ``None`` where there is none. A built-in one cannot be replaced.

    Raises
    ------
    CmmUqError : another package offers it, but cannot be loaded, or two packages do.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    outside = named(offered(STANDARDS, Plugin), name)
    return None if outside is None else outside.loaded(Standard)


def names() -> tuple[str, ...]:
    """Of all standards, those of other packages last; none of these is imported."""
    return (*BUILT_IN, *(plugin.name for plugin in offered(STANDARDS, Plugin) if plugin.name not in BUILT_IN))
