"""What a certificate shows of a plate: where each ball was found against where it belongs, before and after the model."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.analysis.result import Result
from cmm_uq.artefacts.plate import Plate
from cmm_uq.certificate.document import Block, Column, Section, Table
from cmm_uq.certificate.vector_plot import vector_plot
from cmm_uq.points import Floats
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE

_PLATES_SHOWN = 6


def sections(result: Result) -> list[Section]:
    """Every placing by itself in numbers, and the first of them as arrows in the plate's own plane."""
    plate = cast("Plate", result.artefact)
    before = np.einsum("nij,ni->nj", plate.attitudes(plate.points.xyz), plate.deviations()) / MICROMETRE
    after = result.residuals.reshape(-1, 3) / MICROMETRE
    blocks: list[Block] = [_table(result, plate, before, after)]
    blocks += [_picture(plate, number, before, after) for number in plate.placings.numbers[:_PLATES_SHOWN]]
    return [Section("Positions on the plate", tuple(blocks))]


def _picture(plate: Plate, number: int, before: Floats, after: Floats) -> Block:
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
        mean(plate.reference), (("Found minus certified", vectors[0]), ("After the fitted model", vectors[1])),
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
    note = "Coordinates of every ball minus its certified position, before and after the fitted model; the placing is fitted."
    return Table("Deviation of a coordinate", columns, tuple(rows), (note,))
