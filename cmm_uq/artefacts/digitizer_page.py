"""What the certificate of a laser digitizer aligned on a reference sphere states and shows beside the estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.digitizer import ANGLES, OFFSET, THREE, DigitizerArtefact, alignments, words, worst_direction
from cmm_uq.base.messages import DASH, Text, Verbatim, number, say, semicolons, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table, columns, figure_columns
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import length_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.digitizer import Alignment, MountOffset, mount_offset, three_alignment_offset
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, rounded

MEANING = say("The mount lies at [U1 V1 W1] in the digitizer's frame u, v, w, whose origin is that of the scan plane.")

_SAME_ATTITUDE = 0.01  # degrees within which an attitude is one of the source's three


@dataclass(frozen=True, eq=False)
class AttitudePose:
    measurement: int  # number
    angles_deg: Floats  # (3,) α, β, γ
    points: int  # recorded in it
    reading_mm: Floats  # (3,) [D0 E0 F0]
    off_um: Floats  # (3,) that reading minus the one that the result gives, µm
    rms_um: float | None  # root mean square of its residuals, µm; ``None`` where none of its observations are used


@dataclass(frozen=True, eq=False)
class OffsetFigures:
    """[U1 V1 W1] of whatever recording it was found from."""

    result: Result

    @property
    def offset(self) -> tuple[Quantity, ...]:
        return tuple(self.result.sizes[f"{name}_mm"] for name in OFFSET)

    @cached_property
    def covariance(self) -> Floats:
        """(3, 3) of U1, V1, W1, mm²."""
        sought = [(ARTEFACT, f"{name}_mm") for name in OFFSET]
        columns = [i for i, u in enumerate(self.result.posterior.unknowns) if u.key in sought]
        return np.cov(self.result.values[:, columns], rowvar=False)

    @property
    def correlation(self) -> Floats:
        """(3, 3) of U1, V1, W1."""
        u = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(u, u))

    def as_data(self) -> dict[str, Any]:
        return {
            "offset_mm": {name: quantity_data(one) for name, one in zip(OFFSET, self.offset, strict=True)},
            "covariance_mm2": self.covariance.tolist(),
            "correlation": self.correlation.tolist(),
        }

    def table(self, *further: Text) -> Table:
        rows = []
        for name, quantity, correlations in zip(OFFSET, self.offset, self.correlation, strict=True):
            row = (Verbatim(name), *expanded(quantity), unit("mm"), *(signed(one, ".2f") for one in correlations))
            rows.append(row)
        correlated = (say("Correlation with {name}", name=Verbatim(name)) for name in OFFSET)
        stated = figure_columns(say("Estimate"), say("U"), say("k"))
        heads = columns([say("Component"), *stated, say("Unit"), *figure_columns(*correlated)])
        meaning = say("U is the expanded uncertainty for a coverage probability of 95 %; k = U/u.")
        return Table(say("Offset of the mount"), heads, tuple(rows), (MEANING, meaning, *further))


@dataclass(frozen=True, eq=False)
class DigitizerFigures(OffsetFigures):
    @property
    def digitizer(self) -> DigitizerArtefact:
        return cast("DigitizerArtefact", self.result.artefact)

    @cached_property
    def sphere(self) -> tuple[float, ...]:
        """Centre of the reference sphere in the recorded frame, mm."""
        values = self.result.values.mean(axis=0)
        model, digitizer = self.result.model, self.digitizer
        return tuple(digitizer.centre(model.placed(values), values[len(values) - len(digitizer.sizes) :]).tolist())

    @cached_property
    def _true(self) -> Floats | None:
        """(n, 3) of the mount by the errors of the machine that are estimated, mm; ``None`` where the job names none."""
        model, values = self.result.model, self.result.values.mean(axis=0)
        xyz = self.digitizer.points.xyz
        return xyz + model.errors(xyz, values[: len(values) - len(self.digitizer.sizes)]) if model.effects else None

    @cached_property
    def alignments(self) -> tuple[Alignment, ...]:
        """Of each attitude by itself, on the axes that are estimated."""
        digitizer = self.digitizer
        return digitizer.alignments if self._true is None else alignments(digitizer.points.at(self._true), None)

    @cached_property
    def start(self) -> MountOffset:
        return self.digitizer.start if self._true is None else mount_offset(self.alignments)

    def _readings(self) -> list[Floats]:
        """[D0 E0 F0] of each attitude as the scales read: errors are linear over so little travel."""
        found = [one.reading for one in self.alignments]
        if self._true is None:
            return found
        middle, xyz = self._true.mean(axis=0), self.digitizer.points.xyz
        design = np.column_stack([self._true - middle, np.ones(len(xyz))])
        fitted = np.linalg.lstsq(design, self._true - xyz, rcond=None)[0]
        return [true - np.append(true - middle, 1.0) @ fitted for true in found]

    @cached_property
    def times(self) -> tuple[Floats, float]:
        """The direction that the attitudes tell least of, and its uncertainty in those of one centre."""
        return worst_direction(self.digitizer.alignments)

    @cached_property
    def poses(self) -> tuple[AttitudePose, ...]:
        digitizer, found = self.digitizer, []
        offset = np.array([one.value for one in self.offset])
        used = self.result.model.used
        each = zip(digitizer.poses.numbers.tolist(), self.alignments, self._readings(), strict=True)
        for i, (measurement, one, reading) in enumerate(each):
            of_it = (digitizer.measurement == measurement) & used
            residuals = self.result.residuals[of_it] / MICROMETRE
            rows = digitizer.poses.index == i
            angles = np.array([float(digitizer.points.columns[name][rows][0]) for name in ANGLES])
            off = (one.reading - one.attitude @ offset - self.sphere) / MICROMETRE
            rms = float(np.sqrt(np.mean(residuals**2))) if len(residuals) else None
            found.append(AttitudePose(measurement, angles, int(rows.sum()), reading, off, rms))
        return tuple(found)

    @cached_property
    def closed_form(self) -> Floats | None:
        """(3,) offset by the source's eq. 19–21, mm; ``None`` where the attitudes are not its three."""
        order = []
        for wanted in THREE:
            turned = [np.abs((pose.angles_deg - wanted + 180) % 360 - 180).max() for pose in self.poses]
            if min(turned) > _SAME_ATTITUDE:
                return None
            order.append(int(np.argmin(turned)))
        return three_alignment_offset(np.array([self.alignments[i].reading for i in order]), np.zeros(3))[0]


def results(result: Result) -> Mapping[str, Any]:
    """For results.json; ``cmm-uq compensate`` reads offset, covariance and poses back."""
    found = DigitizerFigures(result)
    closed, (direction, times) = found.closed_form, found.times
    return {
        "digitizer": {
            **found.as_data(),
            "sphere_mm": list(found.sphere),
            "poses": [
                {"pose": pose.measurement, **dict(zip(ANGLES, pose.angles_deg.tolist(), strict=True)),
                 "reading_mm": pose.reading_mm.tolist(), "off_um": pose.off_um.tolist(), "rms_um": pose.rms_um,
                 "points": pose.points}
                for pose in found.poses
            ],
            "by_centres_mm": found.start.offset.tolist(),
            "closed_form_mm": None if closed is None else closed.tolist(),
            "least_determined": {"direction_uvw": direction.tolist(), "u_over_u_of_a_centre": times},
        }
    }  # fmt: skip


def sections(result: Result) -> list[Section]:
    found = DigitizerFigures(result)
    return [
        Section(say("Offset of the mount"), (_offset(found), *_assumed(found.digitizer), _two_ways(found))),
        Section(say("Attitudes"), (_attitudes(found), _residuals(result, found.digitizer))),
    ]


def _offset(found: DigitizerFigures) -> Table:
    x, y, z = (signed(value, ".4f") for value in found.sphere)
    return found.table(say("Centre of the reference sphere: ({x}, {y}, {z}) mm in the recorded frame.", x=x, y=y, z=z))


def _assumed(digitizer: DigitizerArtefact) -> Iterator[Block]:
    """What is known of each attitude by itself, and of what U contains nothing."""
    known, missing = list[Text](), list[Text]()
    if digitizer.u_turn:
        known.append(say("attitude, u = {u:g}″ about each axis", u=digitizer.u_turn))
    else:
        missing.append(say("of the attitudes"))
    if any(digitizer.u_shift):
        x, y, z = digitizer.u_shift
        known.append(say("the sphere's centre as a whole, u = ({x:g}, {y:g}, {z:g}) µm along x, y, z", x=x, y=y, z=z))
    else:
        missing.append(say("of what shifts a whole scan: form of the ball, digitizer, scales"))
    if known:
        yield Paragraph(say("In each attitude by itself, U contains: {known}.", known=semicolons(known)))
    if len(missing) == 1:
        yield Paragraph(say("U contains no uncertainty {missing}.", missing=missing[0]), tone="note")
    elif missing:
        first, second = missing
        nothing = say("U contains no uncertainty {first} and none {second}.", first=first, second=second)
        yield Paragraph(nothing, tone="note")


def _two_ways(found: DigitizerFigures) -> Table:
    start, closed = found.start.offset, found.closed_form
    rows = []
    for i, (name, quantity) in enumerate(zip(OFFSET, found.offset, strict=True)):
        values = (quantity.value, float(start[i]), *(() if closed is None else (float(closed[i]),)))
        ways = [rounded(value, quantity.expanded)[0] for value in values]
        rows.append((Verbatim(name), *ways, *(() if closed is not None else (DASH,)), unit("mm")))
    figures = figure_columns(say("Fitted model"), say("By centres"), say("Closed form"))
    note = say(
        "By centres: the centre of the sphere in each attitude by itself, then all equations by weighted least "
        "squares. Closed form: Harris 2004 eq. 19–21, for its three attitudes."
    )
    heads = columns([say("Component"), *figures, say("Unit")])
    return Table(say("The offset by other ways"), heads, tuple(rows), (note,))


def _attitudes(found: DigitizerFigures) -> Table:
    rows = tuple(
        (
            number(pose.measurement), *(signed(angle, "g") for angle in pose.angles_deg), number(pose.points),
            *(signed(value, ".4f") for value in pose.reading_mm), *(signed(value, ".1f") for value in pose.off_um),
            DASH if pose.rms_um is None else number(pose.rms_um, ".1f"),
        )
        for pose in found.poses
    )  # fmt: skip
    off = (say("Off {axis}", axis=Verbatim(axis)) for axis in "xyz")
    heads = (
        Column(say("No.")), *figure_columns(*map(Verbatim, "αβγ"), unit=unit("°")), Column(say("Points")),
        *figure_columns(*(Verbatim(f"{name}0") for name in "DEF"), unit=unit("mm")),
        *figure_columns(*off, say("Rms"), unit=unit("µm")),
    )  # fmt: skip
    direction, times = found.times
    meaning = say(
        "D0, E0, F0: scale reading with the origin of the scan plane at the centre of the sphere, from this attitude "
        "by itself. Off: this minus what the fitted offset gives. Rms: of the residuals."
    )
    least = say(
        "These attitudes tell least of the offset along {direction}: {times:.2g} times the uncertainty of one centre.",
        direction=words(direction),
        times=times,
    )
    return Table(say("Every attitude"), heads, rows, (meaning, least))


def _residuals(result: Result, digitizer: DigitizerArtefact) -> Plot:
    after = result.residuals / MICROMETRE
    xyz = digitizer.points.xyz  # before: about the offset from the centres, without any effect of the machine
    fitted = digitizer.fit(xyz, np.array([size.nominal for size in digitizer.sizes]))
    before = digitizer.project(fitted, (xyz - fitted)[:, :, None])[:, 0] / MICROMETRE
    radial, each = say("radial distance of each point of the sphere"), say("each coordinate of the centre")
    what, k = radial if digitizer.scanned else each, number(result.noise.coverage_factor, ".2f")
    low, high, low_after, high_after = alike(before.min(), before.max(), after.min(), after.max())
    return length_plot(
        digitizer.measurement.astype(float), before, after, expanded_before_um=result.noise.expanded,
        reference=say("fitted sphere") if digitizer.scanned else say("common centre"), flagged=result.flagged,
        position_label=say("Attitude (its observations side by side)"), before_label=say("With the offset by centres"),
        caption=say("Residuals, {what}, with U (k = {k}) of a coordinate.", what=what, k=k),
        alternative=say(
            "{count} observations: with the offset by centres they deviate by {low} to {high} µm; after the "
            "fitted model {low_after} to {high_after} µm remain.",
            count=len(after), low=low, high=high, low_after=low_after, high_after=high_after,
        ),
    )  # fmt: skip


PAGE = Page(sections, results)
