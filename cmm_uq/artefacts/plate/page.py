"""What the certificate of a ball plate or hole plate states and shows beside the estimates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.plate.observe import Plate
from cmm_uq.base.messages import Text, Verbatim, day, number, say, sentences
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.vectors import vector_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.certificate.wording import expanded
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, rounded

STEEL = 11.5e-6  # expansion of a plate whose own is not stated, 1/K


@dataclass(frozen=True)
class Spread:
    """Coordinates of one placing, before and after the fitted model, µm: root mean square, and largest."""

    measurement: int
    count: int
    rms_before_um: float
    largest_before_um: float
    rms_after_um: float
    largest_after_um: float


@dataclass(frozen=True, eq=False)
class Arrows:
    """Balls of one placing in the plane of the plate, repeats averaged."""

    measurement: int  # its number
    axes: tuple[int, int]  # (2,) of the plate, that the plane is spanned by
    place: Floats  # (b, 2) reference positions, mm
    before: Floats  # before, after: (b, 2) displacements, µm
    after: Floats


@dataclass(frozen=True)
class CommonScale:
    """The common part of the scales between two dates, and the change of temperature of the plate that looks the same."""

    change: Quantity
    cte_per_k: float
    warmer: Quantity

    @property
    def colder(self) -> bool:
        """Whether it is a plate that was colder, or has shrunk, that looks so."""
        return self.change.value > 0


@dataclass(frozen=True, eq=False)
class PlateFigures:
    """Every placing in numbers, as arrows where that is asked for, and the common scale between two dates."""

    spread: tuple[Spread, ...]
    before_um: Floats
    after_um: Floats
    common: CommonScale | None


def figures(result: Result) -> PlateFigures:
    """Of a result; ``before_um`` and ``after_um`` are (n, 3) in the plate's own axes and the machine's."""
    plate = cast("Plate", result.artefact)
    before = np.einsum("nij,ni->nj", plate.attitudes(plate.points.xyz), plate.deviations()) / MICROMETRE
    after = result.residuals.reshape(-1, 3) / MICROMETRE
    spread = []
    for measurement in plate.placings.numbers:
        chosen = plate.points.measurement == measurement
        sizes = [
            float(value)
            for values in (before[chosen], after[chosen])
            for value in (np.sqrt(np.mean(values**2)), np.abs(values).max())
        ]
        spread.append(Spread(int(measurement), int(chosen.sum()), *sizes))
    return PlateFigures(tuple(spread), before, after, _common(result) if compared(result) else None)


def compared(result: Result) -> bool:
    """Whether the references are an earlier recording of the plate itself."""
    return result.job.facts.recording.earlier is not None


def arrows(plate: Plate, found: PlateFigures, number: int) -> Arrows:
    """One placing as arrows; the two largest extents of the references span the plane."""
    rows = plate.points.measurement == number
    axes = np.sort(np.argsort(np.ptp(plate.reference, axis=0))[1:])
    balls, index = np.unique(plate.points.point[rows], return_inverse=True)
    counts = np.bincount(index)[:, None]

    def mean(values: Floats) -> Floats:
        sums = np.zeros((len(balls), 2))
        np.add.at(sums, index, values[rows][:, axes])
        return sums / counts

    i, j = (int(axis) for axis in axes)
    return Arrows(int(number), (i, j), mean(plate.reference), mean(found.before_um), mean(found.after_um))


def results(result: Result) -> dict[str, Any]:
    found = figures(result)
    data: dict[str, Any] = {
        "placings": [
            {"measurement": one.measurement, "balls": one.count, "rms_before_um": one.rms_before_um,
             "largest_before_um": one.largest_before_um, "rms_after_um": one.rms_after_um,
             "largest_after_um": one.largest_after_um}
            for one in found.spread
        ]
    }  # fmt: skip
    if found.common is not None:
        common = found.common
        data["common_scale"] = {
            "ppm": quantity_data(common.change), "cte_per_k": common.cte_per_k,
            "plate_warmer_by_k": quantity_data(common.warmer),
        }  # fmt: skip
    return data


def _common(result: Result) -> CommonScale | None:
    scales = [effect.name for effect in SCALE.values() if effect.name in result.parameters]
    if not scales:
        return None
    columns = {unknown.key[0]: i for i, unknown in enumerate(result.posterior.unknowns)}
    draws = result.values[:, [columns[name] for name in scales]].mean(axis=1)
    cte = result.job.facts.artefact.cte_per_k or STEEL
    change = Quantity.of_draws(draws, unit("ppm"))
    return CommonScale(change, cte, change.times(-PPM / cte, unit("K")))


_PLATES_SHOWN = 6
_CERTIFIED = (say("Positions on the plate"), say("Found minus certified"), say("After the fitted model"))
_COMPARED = (say("What changed between the two dates"), say("Now minus then"), say("After the fitted change"))


def sections(result: Result) -> list[Section]:
    plate = cast("Plate", result.artefact)
    found = figures(result)
    title, *titles = _COMPARED if compared(result) else _CERTIFIED
    blocks: list[Block] = [_table(result, found), *_confounded(result, found)]
    blocks += [
        _picture(arrows(plate, found, measurement), titles) for measurement in plate.placings.numbers[:_PLATES_SHOWN]
    ]
    return [Section(title, tuple(blocks))]


def _confounded(result: Result, found: PlateFigures) -> list[Block]:
    if not compared(result):
        return []
    facts = result.job.facts
    earlier = facts.recording.earlier_date
    recording = say("the earlier recording of {date}", date=day(earlier)) if earlier else say("the earlier recording")
    texts: list[Text] = [
        say(
            "References are the positions found by {recording}; the error factors of "
            "this certificate are what changed since. Errors of machine and plate that were there on "
            "both dates cancel, as long as the plate stood in the same places.",
            recording=recording,
        )
    ]
    if found.common is not None:
        common, cte = found.common, found.common.cte_per_k / PPM
        value, U, _ = expanded(common.change)
        kelvin = rounded(abs(common.warmer.value), 2 * common.warmer.u)[0]
        told = say("The common part of the scales changed by {value} ppm, U = {U} ppm.", value=value, U=U)
        texts += [told, _alike(kelvin, cte, colder=common.colder)]
    texts.append(say("A plate that has sheared or bent since looks like squareness or straightness of its plane."))
    return [Paragraph(sentences(texts))]


def _alike(kelvin: Text, cte: float, *, colder: bool) -> Text:
    if colder:
        return say(
            "A plate that was colder by {kelvin} K (at {cte:.3g} ppm/K) than its recorded temperatures account for looks the "
            "same, and so does one that has shrunk by as much.",
            kelvin=kelvin,
            cte=cte,
        )
    return say(
        "A plate that was warmer by {kelvin} K (at {cte:.3g} ppm/K) than its recorded temperatures account for looks the "
        "same, and so does one that has grown by as much.",
        kelvin=kelvin,
        cte=cte,
    )


def _picture(one: Arrows, titles: Sequence[Text]) -> Block:
    before, after = alike(*(max(hypot(*arrow) for arrow in arrows.tolist()) for arrows in (one.before, one.after)))
    first, second = ("xyz"[axis] for axis in one.axes)
    return vector_plot(
        one.place,
        tuple(zip(titles, (one.before, one.after), strict=True)),
        axis_labels=(
            say("Plate {first} / mm", first=Verbatim(first)),
            say("Plate {second} / mm", second=Verbatim(second)),
        ),
        caption=say(
            "Measurement {measurement}: displacement of each ball in the plane of the plate, placed by least squares.",
            measurement=one.measurement,
        ),
        alternative=say(
            "Arrows at {count} balls: up to {before} µm as recorded, up to {after} µm after the fitted model.",
            count=len(one.place),
            before=before,
            after=after,
        ),
    )


def _table(result: Result, found: PlateFigures) -> Table:
    noise = result.noise.coordinate.value
    rows = []
    for one in found.spread:
        sizes = (one.rms_before_um, one.largest_before_um, one.rms_after_um, one.largest_after_um)
        rows.append((number(one.measurement), number(one.count), *(rounded(size, noise)[0] for size in sizes)))
    columns: tuple[Column, ...] = (Column(say("Placing"), numeric=False), Column(say("Balls")))
    columns += (Column(say("rms before"), unit("µm")), Column(say("Largest before"), unit("µm")))
    columns += (Column(say("rms after"), unit("µm")), Column(say("Largest after"), unit("µm")))
    note = say(
        "Coordinates of every ball minus its reference position, before and after the fitted model; "
        "the placing is fitted."
    )
    return Table(say("Deviation of a coordinate"), columns, tuple(rows), (note,))


PAGE = Page(sections, results)
