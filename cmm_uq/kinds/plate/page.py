"""What a certificate shows of a plate: where each ball was found against where it belongs, before and after the model."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.documents.document import Block, Column, Paragraph, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.result import Result
from cmm_uq.documents.vector_plot import vector_plot
from cmm_uq.documents.wording import expanded
from cmm_uq.kinds.plate.observe import Plate
from cmm_uq.physics.rigid_body import SCALE
from cmm_uq.points import Floats
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE, PPM

_PLATES_SHOWN = 6
_CERTIFIED = ("Positions on the plate", "Found minus certified", "After the fitted model")
_COMPARED = ("What changed between the two dates", "Now minus then", "After the fitted change")
_STEEL = 11.5e-6
"""Expansion of a plate whose own is not stated, 1/K."""


def sections(result: Result) -> list[Section]:
    """Every placing by itself in numbers, and the first of them as arrows in the plate's own plane."""
    plate = cast("Plate", result.artefact)
    before = np.einsum("nij,ni->nj", plate.attitudes(plate.points.xyz), plate.deviations()) / MICROMETRE
    after = result.residuals.reshape(-1, 3) / MICROMETRE
    title, *arrows = _COMPARED if _compared(result) else _CERTIFIED
    blocks: list[Block] = [_table(result, plate, before, after), *_confounded(result)]
    blocks += [_picture(plate, number, before, after, arrows) for number in plate.placings.numbers[:_PLATES_SHOWN]]
    return [Section(title, tuple(blocks))]


def _compared(result: Result) -> bool:
    return result.job.facts.recording.earlier is not None


def _confounded(result: Result) -> list[Block]:
    """What else would look like the change that was found."""
    if not _compared(result):
        return []
    facts = result.job.facts
    since = f" of {facts.recording.earlier_date.isoformat()}" if facts.recording.earlier_date else ""
    texts = [
        f"References are the positions found by the earlier recording{since}; the error factors of this certificate are what "
        "changed since. Errors of machine and plate that were there on both dates cancel, as long as the plate stood in the "
        "same places."
    ]
    scales = [effect.name for effect in SCALE.values() if effect.name in result.parameters]
    if scales:
        columns = {unknown.key[0]: i for i, unknown in enumerate(result.posterior.unknowns)}
        draws = result.posterior.draws[:, [columns[name] for name in scales]].mean(axis=1)
        value, U, _ = expanded(Quantity.of_draws(draws, "ppm"))
        cte = facts.artefact.cte_per_k or _STEEL
        kelvin = rounded(abs(float(draws.mean())) * PPM / cte, 2 * float(draws.std()) * PPM / cte)[0]
        temperature, size = ("colder", "shrunk") if draws.mean() > 0 else ("warmer", "grown")
        texts.append(
            f"The common part of the scales changed by {value} ppm, U = {U} ppm. A plate that was {temperature} by {kelvin} K "
            f"(at {cte / PPM:.3g} ppm/K) than its recorded temperatures account for looks the same, and so does one that has "
            f"{size} by as much."
        )
    texts.append("A plate that has sheared or bent since looks like squareness or straightness of its plane.")
    return [Paragraph(" ".join(texts))]


def _picture(plate: Plate, number: int, before: Floats, after: Floats, titles: list[str]) -> Block:
    """Two largest extents of the references span the plane that is shown; repeats are averaged."""
    rows = plate.points.measurement == number
    plane = np.sort(np.argsort(np.ptp(plate.reference, axis=0))[1:])
    balls, index = np.unique(plate.points.point[rows], return_inverse=True)
    counts = np.bincount(index)[:, None]

    def mean(values: Floats) -> Floats:
        sums = np.zeros((len(balls), 2))
        np.add.at(sums, index, values[rows][:, plane])
        return sums / counts

    vectors = mean(before), mean(after)
    largest = [float(np.linalg.norm(v, axis=1).max()) for v in vectors]
    return vector_plot(
        mean(plate.reference), tuple(zip(titles, vectors, strict=True)),
        axis_labels=(f"Plate {'xyz'[plane[0]]} / mm", f"Plate {'xyz'[plane[1]]} / mm"),
        caption=f"Measurement {number}: displacement of each ball in the plane of the plate, placed by least squares.",
        alternative=(
            f"Arrows at {len(balls)} balls: up to {largest[0]:.1f} µm as recorded, up to {largest[1]:.1f} µm after the "
            "fitted model."
        ),
    )  # fmt: skip


def _table(result: Result, plate: Plate, before: Floats, after: Floats) -> Table:
    noise = result.noise.coordinate.value
    rows = []
    for number in plate.placings.numbers:
        chosen = plate.points.measurement == number
        figures = [
            rounded(float(value), noise)[0]
            for values in (before[chosen], after[chosen])
            for value in (np.sqrt(np.mean(values**2)), np.abs(values).max())
        ]
        rows.append((str(number), str(int(chosen.sum())), *figures))
    columns = (
        Column("Placing", numeric=False), Column("Balls"), Column("rms before", "µm"), Column("Largest before", "µm"),
        Column("rms after", "µm"), Column("Largest after", "µm"),
    )  # fmt: skip
    note = "Coordinates of every ball minus its reference position, before and after the fitted model; the placing is fitted."
    return Table("Deviation of a coordinate", columns, tuple(rows), (note,))


PAGE = Page(sections)
