"""The tables of a part's job but features and characteristics, and the whole of its job.toml."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

from pydantic import Field

from cmm_uq.base.files.limits import INPUTS, LISTED
from cmm_uq.base.files.table import JobTable, Length, Limit, Position, Temperature, Triple, Uncertainty, key, required
from cmm_uq.base.files.toml_file import line_of
from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.part.feature import CharacteristicFacts, Count, Degrees, FeatureFacts, FormFacts, Name
from cmm_uq.jobs.part.machine_state import MachineStateFacts
from cmm_uq.jobs.tables.conformity import Declared, Prior, Rule, needs_prior
from cmm_uq.jobs.tables.identification import MEASURED, Identification, Laboratory, Origin

Expansion = Annotated[float, Field(ge=-1e-4, le=1e-3)]  # A coefficient of expansion, 1/K: steel has 11.5e-6.
SmallExpansion = Annotated[float, Field(ge=0, le=1e-4)]
Kelvins = Annotated[float, Field(ge=0, le=100)]
Uncertainties = Annotated[list[Uncertainty], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Degrees], Field(min_length=3, max_length=3)]
SmallAngles = Annotated[list[Annotated[float, Field(ge=0, le=10)]], Field(min_length=3, max_length=3)]
Lengths = Annotated[list[Annotated[float, Field(ge=0, le=1e6)]], Field(min_length=3, max_length=3)]


class PartJobFacts(Identification):
    """``[job]``: identification, and free text for the certificate."""

    origin: Origin = MEASURED
    """Where measured points come from; all that is made from points that were not measured says so."""


class PartFacts(JobTable):
    """``[part]``: what is measured."""

    name: Name = required("Name of the part.")
    drawing: str = key("", "Number of the drawing, with its revision.")
    serial: str = key("", "Serial number of the part.")
    owner: str = key("", "Owner of the part.")
    material: str = key("", "Material.")
    cte_per_k: Expansion = key(0.0, "Coefficient of thermal expansion of the part, 1/K.")
    u_cte_per_k: SmallExpansion = key(0.0, "Standard uncertainty of that coefficient, 1/K.")
    not_measured: Annotated[list[Name], Field(max_length=LISTED.most)] = []
    """What the drawing asks for besides and this job leaves out; the certificate says so."""


class StylusFacts(JobTable):
    """One ``[[stylus]]``: a tip, and what its qualification left uncertain."""

    name: Name = required("Name by which features name it.")
    diameter_mm: Annotated[float, Field(ge=0, le=1000)]
    """Diameter of the tip; 0 where a sensor does not touch."""
    offset_mm: Triple = [0.0, 0.0, 0.0]
    """Centre of the tip from the ram's reference point, along the axes of the machine."""
    u_diameter_um: Uncertainty = key(0.0, "Standard uncertainty of the tip's effective diameter, as qualified.")
    u_offset_um: Uncertainties = [0.0, 0.0, 0.0]
    """Standard uncertainties of the tip's offset against the tip to which the others are referred; 0 of that tip."""
    qualified_at_mm: Triple | None = None
    """Coordinates of the machine where the reference sphere stood; what the machine's errors do there, they do not do to the
    part again."""
    lobing_um: Uncertainty = 0.0
    """Standard deviation of the pre-travel over directions of probing, size and offset taken out of it."""


class AlignmentFacts(JobTable):
    """``[alignment]``: how coordinates of the part follow from measured points."""

    datums: Annotated[list[Name], Field(max_length=6)] = []
    """Names of features in order: each fixes what those before it left free (3-2-1). `"A-B"` is a common datum on both."""
    best_fit: bool = key(False, "By least squares of all points from the nominal surfaces instead.")

    def problems(self) -> Iterator[str]:
        if self.best_fit and self.datums:
            yield "give either datums or best_fit = true"


class PlacingFacts(JobTable):
    """``[placing]``: where the part lies in the machine."""

    origin_mm: Triple | None = None
    """Where the part's origin lies, in coordinates of the machine; where left out, the part is in the middle of the travel."""
    rotation_deg: Angles = [0.0, 0.0, 0.0]
    """How the part is turned about the axes of the machine: first about x, then y, then z."""
    u_origin_mm: Lengths = [0.0, 0.0, 0.0]
    """Standard deviations of where it is put, where its place is not the same each time."""
    u_rotation_deg: SmallAngles = [0.0, 0.0, 0.0]
    """Standard deviations of how it is turned, about the axes of the machine."""
    u_fixture_um: Uncertainty = key(0.0, "Standard uncertainty of each point by what clamping does to the part.")


class ProbingFacts(JobTable):
    """``[probing]``: in which order, how fast and how often."""

    order: Annotated[list[Name], Field(max_length=LISTED.most)] = []
    """Names of all features in the order in which they are probed; as they stand where it is left out."""
    seconds_per_point: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    """Time from a point to the next, for noise that wanders; 0 where it is not known."""
    repeats: Count = key(1, "How often each point is probed; its mean counts.")
    u_operator_um: Uncertainty = 0.0
    """Standard uncertainty of each coordinate of each point by who measures and how, common to its repeats."""


class EnvironmentFacts(JobTable):
    """``[environment]``: temperatures while the part is measured, and what is known of them."""

    part_c: Temperature = key(20.0, "Temperature of the part.")
    scales_c: Annotated[list[Temperature], Field(min_length=3, max_length=3)] = [20.0, 20.0, 20.0]
    """Temperatures of the scales of x, y, z."""
    compensated: bool = True
    """Whether the machine computes lengths at 20 °C from these temperatures and the coefficients of expansion."""
    u_part_k: Kelvins = key(0.0, "Standard uncertainty of the part's temperature.")
    u_scales_k: Kelvins = key(0.0, "Standard uncertainty of each scale's temperature, on its own.")
    scales_cte_per_k: Expansion = key(0.0, "Coefficient of expansion of the scales, 1/K.")
    u_scales_cte_per_k: SmallExpansion = key(0.0, "Standard uncertainty of that coefficient, 1/K.")
    u_gradient_k_per_m: Annotated[list[Kelvins], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    """Standard uncertainties of the gradient of the part's temperature along the axes of the machine, K/m."""
    u_drift_k: Kelvins = 0.0
    """Standard uncertainty of how much part and scales have warmed from the first point to the last."""


class NegligibleCauses(JobTable):
    """``[negligible]``: causes that contribute nothing worth counting, each with by whom and why; the report prints both."""

    lobing: Declared | None = key(None, "Pre-travel of the probe by direction (`lobing_um` of a stylus).")
    clamping: Declared | None = key(None, "What clamping does to the part (`u_fixture_um`).")
    operators: Declared | None = key(None, "Who measures and how (`u_operator_um`).")
    gradients: Declared | None = None
    """Gradients of the part's temperature and its drift while it is measured (`u_gradient_k_per_m`, `u_drift_k`)."""


class DecisionFacts(JobTable):
    """``[decision]``: by which rule conformity with the drawing is decided."""

    rule: Rule = key("ISO 14253-1", "Decision rule, by name or by its figure.")
    prior: Prior | None = None
    """What is known of such parts beforehand, for rules that go by it (JCGM 106:2012, 7.2)."""

    def problems(self) -> Iterator[str]:
        if needs_prior(self.rule) and self.prior is None:
            yield (
                "this rule goes by what is known of such parts beforehand: "
                "give prior = { sd_um = … } or { share_of_limit = … }"
            )


class MeasuredFacts(JobTable):
    """``[recording]``: the points as they were measured, or the values that another program found of them."""

    file: Name | None = None
    """CSV with the columns `feature`, `point` (1, 2, … in the order of the plan), `x_mm`, `y_mm`, `z_mm`: contact points in
    the frame of the part, the tip's radius taken off."""
    values: Name | None = None
    """In place of points, the report of another program: results of QIF, a PC-DMIS text report, actual features of DMIS, or
    CSV with the columns `characteristic` and `value_mm` or `value_deg`, or `feature` with `x_mm`, `y_mm`, `z_mm`, `i`, `j`,
    `k`, `diameter_mm`."""

    def problems(self) -> Iterator[str]:
        if (self.file is None) == (self.values is None):
            yield "give either file with the measured points, or values with the report of another program"

    @property
    def recorded(self) -> str:
        """The file of points or of values."""
        return self.file or self.values or ""


Seconds = Annotated[float, Field(gt=0, le=1e6)]


class CalibratedFacts(JobTable):
    """One ``[[by_calibrated_part.characteristic]]``."""

    name: Name = required("Name of the characteristic, as in `[[characteristic]]`.")
    value_mm: Position | None = key(None, "Its value on the calibrated part, of lengths and zones.")
    u_um: Limit | None = key(None, "Standard uncertainty of that value.")
    value_deg: Degrees | None = key(None, "Its value on the calibrated part, of angles.")
    u_arcsec: Seconds | None = key(None, "Standard uncertainty of that angle.")
    u_part_um: Uncertainty = 0.0
    """Standard uncertainty by what differs between parts: form, roughness, elasticity."""
    u_part_arcsec: Annotated[float, Field(ge=0, le=1e6)] = key(0.0, "The same, of an angle.")

    def problems(self) -> Iterator[str]:
        length, angle = (self.value_mm, self.u_um), (self.value_deg, self.u_arcsec)
        if None in length and None in angle:
            yield "give value_mm and u_um, or value_deg and u_arcsec of an angle, of its certificate"
        if any(one is not None for one in length) and any(one is not None for one in angle):
            yield "give either value_mm and u_um, or value_deg and u_arcsec"

    @property
    def angle(self) -> bool:
        """Whether it is stated as one."""
        return self.value_deg is not None


class CalibratedPartFacts(JobTable):
    """``[by_calibrated_part]``: a calibrated part like this one, measured again and again (ISO 15530-3)."""

    file: Name
    """CSV with the column `cycle` (1, 2, …: the set-up), and `characteristic` with `value_mm` or `value_deg`, or else
    `feature`, `point`, `x_mm`, `y_mm`, `z_mm`; with `repeat` where a set-up was measured several times."""
    characteristic: Annotated[list[CalibratedFacts], Field(min_length=1, max_length=INPUTS.most)]
    """What the certificate of the calibrated part states."""
    certificate: str = key("", "Number of that certificate, and whose it is.")
    corrected: bool = True
    """Whether results of the part are corrected by the systematic error that the calibrated part shows."""
    temperature_c: Temperature = key(REFERENCE_TEMPERATURE, "Mean temperature of the calibrated part.")
    u_cte_per_k: SmallExpansion = key(0.0, "Standard uncertainty of its coefficient of expansion, 1/K.")
    same_procedure: bool | None = None
    """Whether it was measured as the part is: the same points, styli, speeds, clamping."""
    similar: bool | None = None
    """Whether it is like the part: size within 10 % (25 mm below 250 mm), angles within 5°, form, roughness and material
    alike."""
    conditions_varied: bool | None = None
    """Whether the repeats lie far enough apart to show what varies in use: times of day, temperatures, operators."""
    substitution: bool | None = None
    """Whether the part is measured in place of the calibrated part: where it lay, turned as it was, soon after it."""
    place_varied: bool = key(False, "Whether it lay in another place in each set-up, as parts do.")
    qualified_anew: bool = key(False, "Whether the styli were qualified anew for each set-up.")


class LengthStandardFacts(JobTable):
    """``[by_orientations.length_standard]``."""

    length_mm: Length = required("Calibrated length.")
    u_um: Limit = required("Standard uncertainty of the calibrated length.")
    file: Name
    """CSV with the columns `orientation`, `repeat`, `length_mm`: the standard as it was measured, best along directions of the
    part's lengths."""
    certificate: str = key("", "Number of its certificate, and whose it is.")
    temperature_c: Temperature = key(REFERENCE_TEMPERATURE, "Its mean temperature.")
    u_cte_per_k: SmallExpansion = key(0.0, "Standard uncertainty of its coefficient of expansion, 1/K.")


class ProbeStandardFacts(JobTable):
    """One ``[[by_orientations.probe_standard]]``."""

    stylus: str = key("", "Name of the stylus that measured it; may be left out where there is one.")
    diameter_mm: Length = required("Calibrated diameter.")
    u_um: Limit = required("Standard uncertainty of the calibrated diameter.")
    inner: bool = key(False, "Whether it is a ring; else a sphere or a plug.")
    file: Name = required("CSV with the columns `orientation`, `repeat`, `diameter_mm`.")
    certificate: str = key("", "Number of its certificate, and whose it is.")


class OrientationsFacts(JobTable):
    """``[by_orientations]``: the part in several orientations, with standards beside it (ISO/DTS 15530-2 as described)."""

    file: Name
    """CSV with the columns `orientation`, `repeat`, and `characteristic` with `value_mm` or `value_deg`, or else `feature`,
    `point`, `x_mm`, `y_mm`, `z_mm` in the frame of the part."""
    length_standard: LengthStandardFacts | None = None
    """A calibrated length: what all orientations have in common, the scale of the machine, is taken from it."""
    probe_standard: Annotated[list[ProbeStandardFacts], Field(max_length=INPUTS.most)] = []
    """A calibrated ring, sphere or plug for each stylus: the size of the tip is taken from it."""
    points_varied: bool = False
    """Whether contact points were others in each orientation, so that the part's form is seen."""
    place_varied: bool = key(True, "Whether the part lay in other places too.")
    qualified_anew: bool = key(False, "Whether the styli were qualified anew for each orientation.")


class PartFile(JobTable):
    """All of a part's job.toml."""

    job: PartJobFacts = required("Identification, and free text for the certificate.")
    laboratory: Laboratory = Laboratory.left_out("Who answers for the certificate.")
    part: PartFacts = required("What is measured.")
    machine_state: MachineStateFacts = required("The machine as its certificate states it.")
    stylus: Annotated[list[StylusFacts], Field(min_length=1, max_length=INPUTS.most)]
    """Styli that probe it, and what their qualification left uncertain."""
    feature: Annotated[list[FeatureFacts], Field(min_length=1, max_length=INPUTS.most)]
    """Features: where they are meant to be, and where they are probed."""
    alignment: AlignmentFacts = AlignmentFacts.left_out("How coordinates of the part follow from measured points.")
    placing: PlacingFacts = PlacingFacts.left_out("Where the part lies in the machine.")
    probing: ProbingFacts = ProbingFacts.left_out("In which order, how fast and how often the points are probed.")
    environment: EnvironmentFacts = EnvironmentFacts.left_out()
    """Temperatures while the part is measured, and what is known of them."""
    form: FormFacts = FormFacts.left_out("The part's own form and roughness, between the points that are probed.")
    negligible: NegligibleCauses = NegligibleCauses.left_out("Causes that are declared negligible, by whom and why.")
    characteristic: Annotated[list[CharacteristicFacts], Field(min_length=1, max_length=INPUTS.most)]
    """What the drawing asks for."""
    decision: DecisionFacts = DecisionFacts.left_out("By which rule conformity with the drawing is decided.")
    recording: MeasuredFacts | None = None
    """The points as they were measured; without them there are uncertainties alone."""
    by_calibrated_part: CalibratedPartFacts | None = None
    """A calibrated part like this one, measured again and again (ISO 15530-3): its uncertainty stands beside this one's."""
    by_orientations: OrientationsFacts | None = None
    """The part in several orientations with standards beside it (ISO/DTS 15530-2 as described): likewise."""

    @property
    def stated_and_declared(self) -> list[str]:
        """Causes that have a figure, and are declared negligible."""
        return [name for name, some in self._of_causes(any).items() if some and getattr(self.negligible, name)]

    @property
    def neither_stated_nor_declared(self) -> list[str]:
        """Causes of which nothing is known."""
        return [name for name, whole in self._of_causes(all).items() if not (whole or getattr(self.negligible, name))]

    def _of_causes(self, of: Callable[[list[float]], bool]) -> dict[str, bool]:
        """Of each that may be declared negligible whether all, or any, of its figures are stated."""
        room, common = self.environment, self.probing.u_operator_um
        return {
            "lobing": of([one.lobing_um for one in self.probing_styli if one.diameter_mm]),
            "clamping": bool(self.placing.u_fixture_um),
            "operators": of([common or one.u_operator_um or one.u_operator_deg for one in self.characteristic]),
            "gradients": of([max(room.u_gradient_k_per_m), room.u_drift_k]),
        }

    @property
    def probing_styli(self) -> list[StylusFacts]:
        """Those that probe a feature."""
        probing = {self.stylus_of(one).name for one in self.feature}
        return [one for one in self.stylus if one.name in probing]

    def stylus_of(self, feature: FeatureFacts) -> StylusFacts:
        """The stylus that probes a feature: the one that it names, else the first."""
        return next((one for one in self.stylus if one.name == feature.stylus), self.stylus[0])


@dataclass(frozen=True)
class Places:
    """The keys of a job.toml."""

    path: Path
    text: str  # that it holds

    def of(self, table: str, key: str = "", number: int | None = None) -> str:
        """A key as messages name it: file, line, table and key.

        ``number``: of the table, from 0, where there are several.
        """
        line = line_of([table, *([] if number is None else [str(number)]), *([key] if key else [])], self.text)
        head = f"[{table}]" if number is None else f"[[{table}]] {number + 1}"
        return f"{self.path}{f' line {line}' if line else ''}: {head} {key}".rstrip()
