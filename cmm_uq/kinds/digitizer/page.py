"""What a certificate shows of a digitizer: the offset of its mount, every attitude, and the offset by other ways."""

from __future__ import annotations

import numpy as np

from cmm_uq.documents.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import expanded
from cmm_uq.kinds.digitizer.analysis import DigitizerFigures, results
from cmm_uq.kinds.digitizer.attitudes import words
from cmm_uq.kinds.digitizer.observe import OFFSET, Digitizer
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE

MEANING = "The mount lies at [U1 V1 W1] in the digitizer's frame u, v, w, whose origin is that of the scan plane."


def sections(result: Result) -> list[Section]:
    """The offset, the attitudes, the residuals."""
    found = DigitizerFigures(result)
    return [
        Section("Offset of the mount", (_offset(found), *_assumed(found.digitizer), _two_ways(found))),
        Section("Attitudes", (_attitudes(found), _residuals(result, found.digitizer))),
    ]


def _offset(found: DigitizerFigures) -> Table:
    rows = []
    for i, (name, quantity) in enumerate(zip(OFFSET, found.offset, strict=True)):
        value, U, k = expanded(quantity)
        rows.append((name, value, U, k, "mm", *(f"{one:.2f}".replace("-", "−") for one in found.correlation[i])))
    columns = (
        Column("Component", numeric=False), Column("Estimate"), Column("U"), Column("k"), Column("Unit", numeric=False),
        *(Column(f"Correlation with {name}") for name in OFFSET),
    )  # fmt: skip
    notes = (
        MEANING,
        "U is the expanded uncertainty for a coverage probability of 95 %; k = U/u.",
        "Centre of the reference sphere: ({:.4f}, {:.4f}, {:.4f}) mm in the recorded frame.".format(
            *found.sphere
        ).replace("-", "−"),
    )
    return Table("Offset of the mount", columns, tuple(rows), notes)


def _assumed(digitizer: Digitizer) -> list[Block]:
    """What of the set-ups enters the uncertainty, and what does not."""
    known, missing = [], []
    if digitizer.u_turn:
        known.append(f"attitude, u = {digitizer.u_turn:g}″ about each axis")
    else:
        missing.append("of the attitudes (u_attitude_arcsec)")
    if any(digitizer.u_shift):
        each = ", ".join(f"{one:g}" for one in digitizer.u_shift)
        known.append(f"the sphere's centre as a whole, u = ({each}) µm along x, y, z")
    else:
        missing.append("of what shifts a whole scan: form of the ball, digitizer, scales (u_centre_um)")
    said: list[Block] = []
    if known:
        said.append(Paragraph(f"In each attitude by itself, U contains: {'; '.join(known)}."))
    if missing:
        said.append(Paragraph(f"U contains no uncertainty {' and none '.join(missing)}.", tone="note"))
    return said


def _two_ways(found: DigitizerFigures) -> Table:
    start, closed = found.digitizer.start.offset, found.closed_form
    rows = []
    for i, (name, quantity) in enumerate(zip(OFFSET, found.offset, strict=True)):
        value, _ = rounded(quantity.value, quantity.expanded)
        each, _ = rounded(float(start[i]), quantity.expanded)
        by_source = "–" if closed is None else rounded(float(closed[i]), quantity.expanded)[0]
        rows.append((name, value, each, by_source, "mm"))
    columns = (
        Column("Component", numeric=False), Column("Fitted model"), Column("By centres"), Column("Closed form"),
        Column("Unit", numeric=False),
    )  # fmt: skip
    notes = (
        "By centres: the centre of the sphere in each attitude by itself, then all equations by weighted least squares. "
        "Closed form: Harris 2004 eq. 19–21, for its three attitudes.",
    )
    return Table("The offset by other ways", columns, tuple(rows), notes)


def _attitudes(found: DigitizerFigures) -> Table:
    rows = [
        (
            str(pose.measurement), *(f"{angle:g}".replace("-", "−") for angle in pose.angles_deg), str(pose.points),
            *(f"{value:.4f}".replace("-", "−") for value in pose.reading_mm),
            *(f"{value:.1f}".replace("-", "−") for value in pose.off_um), "–" if pose.rms_um is None else f"{pose.rms_um:.1f}",
        )
        for pose in found.poses
    ]  # fmt: skip
    columns = (
        Column("No."), *(Column(name, "°") for name in "αβγ"), Column("Points"),
        *(Column(f"{name}0", "mm") for name in "DEF"), *(Column(f"Off {axis}", "µm") for axis in "xyz"),
        Column("Rms", "µm"),
    )  # fmt: skip
    direction, times = found.times
    notes = (
        "D0, E0, F0: scale reading with the origin of the scan plane at the centre of the sphere, from this attitude by "
        "itself. Off: this minus what the fitted offset gives. Rms: of the residuals.",
        f"These attitudes tell least of the offset along {words(direction)}: {times:.2g} times the uncertainty of one centre.",
    )
    return Table("Every attitude", columns, tuple(rows), notes)


def _residuals(result: Result, digitizer: Digitizer) -> Plot:
    after = result.residuals / MICROMETRE
    before = _before(digitizer) / MICROMETRE
    expanded_um = 2 * result.noise.coordinate.value
    what = "radial distance of each point of the sphere" if digitizer.scanned else "each coordinate of the centre"
    return length_plot(
        digitizer.measurement.astype(float), before, after, expanded_before_um=expanded_um, expanded_after_um=expanded_um,
        reference="fitted sphere" if digitizer.scanned else "common centre", flagged=result.flagged,
        position_label="Attitude (its observations side by side)", before_label="With the offset by centres",
        caption=f"Residuals, {what}, with U (k = 2) of a coordinate.",
        alternative=(
            f"{len(after)} observations: with the offset by centres they deviate by {before.min():.1f} to {before.max():.1f} "
            f"µm; after the fitted model {after.min():.1f} to {after.max():.1f} µm remain."
        ),
    )  # fmt: skip


def _before(digitizer: Digitizer) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Residuals (m,), mm, about the offset from the centres, without any effect of the machine."""
    nominal = np.array([size.nominal for size in digitizer.sizes])
    xyz = digitizer.points.xyz
    fitted = digitizer.fit(xyz, nominal)
    return digitizer.project(fitted, (xyz - fitted)[:, :, None])[:, 0]


PAGE = Page(sections, results)
