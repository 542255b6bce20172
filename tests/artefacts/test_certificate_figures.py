"""Every number in a certificate's tables stands in results.json: rounded as printed, in the record of its own row."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from itertools import chain
from typing import Any

import numpy as np
import pytest

from cmm_uq.artefacts.shift.plane_page import EVERY
from cmm_uq.certificate.document import Document, Table
from tests.artefacts.reading import tables
from tests.artefacts.simulated import document, results as results_of
from tests.conftest import MACHINE_JOBS

Record = Sequence[Any]
Results = Mapping[str, Any]

EXAMPLES = sorted(
    folder.name for folder in MACHINE_JOBS
    if not folder.name.startswith("plan-") and folder.name != "iota-1102-maps"  # which is diagnosed, not certified
)  # fmt: skip


def columns(data: Mapping[str, Any], *names: str) -> list[Record]:
    """Rows of lists of one length."""
    return list(zip(*(data[name] for name in names), strict=True))


def parameters(results: Results) -> list[Record]:
    return [
        [quantity, results.get("least_squares", {}).get("estimates", {}).get(effect, {}).get(name)]
        for effect, found in results["estimates"].items() for name, quantity in found.items()
    ]  # fmt: skip


def beside_estimates(results: Results, found: Mapping[str, Any]) -> list[Record]:
    return [[value, results["estimates"].get(effect)] for effect, value in found.items()]


def axis_figures(results: Results) -> list[Record]:
    return [*([quantity] for found in results["estimates"].values() for quantity in found.values()),
            [results["noise"]["coordinate_um"]]]  # fmt: skip


def curves_of(axis: str) -> Callable[[Results], list[Record]]:
    def rows(results: Results) -> list[Record]:
        own = [curve for name, curve in results["curves"].items() if name.split("_")[1] == axis]
        units = ["um" if "error_um" in curve else "arcsec" for curve in own]
        values = [columns(c, "position_mm", f"error_{u}", f"U_{u}") for c, u in zip(own, units, strict=True)]
        return list(zip(*values, strict=True))[::EVERY]

    return rows


def surfaces(results: Results) -> list[Record]:
    return [[plane] for plane in results["planes"] if plane["surface"]]


def standard(results: Results) -> list[Record]:
    found = results["standard"]
    return [[record] for record in (*found["sides_mm"].values(), *found["angles"].values(), found["height_mm"])]


def ball_places(results: Results) -> list[Record]:
    return columns(results["artefact"], "point", "first_mm", "U_first_mm", "second_mm", "U_second_mm")


def offset(results: Results) -> list[Record]:
    found = results["digitizer"]
    return list(zip(found["offset_mm"].values(), found["correlation"], strict=True))


def offset_by_other_ways(results: Results) -> list[Record]:
    found = results["digitizer"]
    return list(zip(found["offset_mm"].values(), found["by_centres_mm"], found["closed_form_mm"], strict=True))


def beside_integrations(results: Results) -> list[Record]:
    pitch, improved = (results["integrations"][method] for method in ("pitch", "improved"))
    joint = results["beside_integrations"]
    curves = [one[name] for one in (pitch, improved, joint) for name in ("error_um", "u_um")]
    return list(zip(pitch["position_mm"], *curves, strict=True))


def selections(results: Results) -> list[Record]:
    """Of some points what each integration leaves of the error by the joint fit."""
    found = []
    for one in results["selections"]:
        joint, steps = one["joint_um"], np.abs(np.diff(one["pitch"]["position_mm"])).round(1)
        left = [one[method][name] for method in ("pitch", "improved") for name in ("left_um", "u_left_um")]
        found.append([len(one["points"]), steps.min(), steps.max(), max(joint) - min(joint), *left])
    return found


def decided(name: str) -> Callable[[Results], list[Record]]:
    """Values of one length in one measurement, as a row has them, in the order of the first, by standard and quantity."""

    def of(results: Results) -> list[Record]:
        (stated,) = (one for one in results["conformity"] if name == f"{one['standard']}, {one['characteristic']}")
        rows: dict[tuple[Any, ...], list[Any]] = {}
        for one in stated["errors"]:
            key = (one["measurement"], one["length_mm"], one["u_um"], one["limit_um"], one["standing"])
            rows.setdefault(key, []).append(one)
        return list(rows.values())

    return of


def by_region(results: Results) -> list[Record]:
    """Of each factor the mean over the recorded set-ups, over the range, and the ends in its eighths."""
    ends = results["regions"]["eighths"]
    return [
        [results["estimates"][effect][name], one, ends.get(effect, {}).get(name, [])]
        for effect, found in results["over_range"].items() for name, one in found.items()
    ]  # fmt: skip


def other_priors(results: Results) -> list[Record]:
    """Those that change anything by a hundredth."""
    return [
        [{key: one[key] for key in ("times", "u_percent", "value_percent")}] for one in results["regions"]["priors"]
        if max(abs(one["u_percent"]), abs(one["value_percent"])) >= 1
    ]  # fmt: skip


def of_test_value(results: Results) -> list[Record]:
    """Lines that contribute, in µm as printed."""
    (stated,) = results["conformity"]
    lines = stated["test_uncertainty"]["budget"]
    scale = 1e3 if any(line["unit"] == "mm" for line in lines) else 1.0
    return [[line | {"contribution": scale * line["contribution"]}] for line in lines if line["contribution"]]


def runs(results: Results) -> list[Record]:
    """Of each run its figures with U, and how often it was repeated."""
    return [[run, len(run["drift_of_repeats"])] for run in results["runs"] if "targets_mm" in run]


def targets(measurement: int) -> Callable[[Results], list[Record]]:
    """Of each target of a run the mean and s of both directions, and the reversal."""

    def of(results: Results) -> list[Record]:
        (run,) = (one for one in results["runs"] if one["measurement"] == measurement)
        ways = [values for way in run["directions"] for values in (way["mean"], way["s"]) if values is not None]
        return list(zip(run["targets_mm"], *ways, run["reversal"], strict=True))

    return of


RUNS = [f"{axis}{kind}{about}" for axis in "xyz" for kind in "tr" for about in "xyz"][:-1]
"""Of the simulated runs, in their order; nothing reads the roll of Z."""


def stations(results: Results) -> list[Record]:
    """Of each station its place, the largest U of its coordinates, dead path, readings and residual."""
    return [[one | {"U_position_um": [max(one["U_position_um"])]}] for one in results["stations"]]


def of_targets(results: Results) -> list[Record]:
    """Root mean squares along each axis of what is told of every target."""
    names, each = ("error_um", "left_um", "U_um"), results["targets"]["each"]
    return [[{name: float(np.sqrt(np.mean([one[name][i] ** 2 for one in each]))) for name in names}] for i in range(3)]


STATED = (
    "ASME B89.4.1-1997, volumetric performance",
    "ISO 10360-2:2009, E0",
    "ISO 10360-5:2010, P_FTU",
    "VDI/VDE 2617, E0",
)

RECORDS: dict[str, Callable[[Results], Sequence[Record]]] = {
    "Figures of performance": lambda r: [
        [quantity, *([own[name]["interval95"]] if name in (own := r.get("performance_of_machine", {})) else [])]
        for name, quantity in r["accuracy_uncertainty"].items()
    ],
    "Error factors of the machine": parameters,
    "Where the error factors hold": by_region,
    "Sizes of errors, root mean square": lambda r: [[family] for family in r["regions"]["families"]],
    "Influence of the priors": other_priors,
    "Differences that are determined": lambda r: [[one] for one in r["differences"]],
    "What to turn and what to enter": lambda r: [[one] for one in r["adjustments"]],
    "The six factors by the distance equations, a second way":
        lambda r: beside_estimates(r, r["distance_equations"]["factors"]),
    "Lengths brought to 20 °C": lambda r: [[one] for one in r["lengths"]["each"]],
    "Contributions to the deviation of one length": lambda r: [[line] for line in r["length_budget"]["budget"]],
    "Each line by itself, at 20 °C": lambda r: [[line] for line in r["lines"]],
    "Flatness as recorded": lambda r: [[plane] for plane in r["planes"]],
    **{name: lambda r: [[ring] for ring in r["rings"]] for name in ("Diameter and roundness", "Roundness by lobes")},
    "Surface, compensated for the probe's offset": surfaces,
    "Deviation of a coordinate": lambda r: [[placing] for placing in r["placings"]],
    "Probing errors": lambda r: [[sphere] for sphere in r["spheres"]],
    "Articulation": lambda r: [[seat] for seat in r["seats"]],
    "Parameters and tolerances": lambda r: beside_estimates(r, r["tolerances"]),
    "Sides and angles of the standard at 20 °C": standard,
    "Scale, squareness, pitch, yaw and roll": lambda r: beside_estimates(r, r["equations"]),
    "Axis figures": axis_figures,
    "Error by position": lambda r: columns(r["curves"]["linearity_x"], "position_mm", "error_um", "U_um", "band_um"),
    "The artefact's own dimensions": lambda r: columns(r["artefact"], "point", "distance_mm", "U_mm"),
    "Plane figures": axis_figures,
    "Errors of axis X": curves_of("x"),
    "Errors of axis Y": curves_of("y"),
    "Set-ups, as found from the readings": lambda r: [[placing] for placing in r["placings"]],
    "The plate's own geometry": ball_places,
    "Offset of the mount": offset,
    "Beside the integrations of the method's source": beside_integrations,
    "Integrations from some of the points": selections,
    "Euler angles": lambda r: [
        [pose["pose"], pose[name], indexed] for pose in r["attitudes"]
        for name, indexed in zip(("alpha_deg", "beta_deg", "gamma_deg"), pose["indexed_deg"], strict=True)
    ],
    "Centres of the balls": lambda r: [[ball] for ball in r["balls"]],
    "The offset by other ways": offset_by_other_ways,
    "Every attitude": lambda r: [[pose] for pose in r["digitizer"]["poses"]],
    "Both directions, by ISO 230-2:2014": runs,
    "Stations": stations,
    "Errors of the targets along each axis": of_targets,
    "Each direction by itself": runs,
    **{f"{name}, by ISO 230-4": lambda r: [[run] for run in r["runs"] if "angles_deg" in run]
       for name in ("Circles", "Radial deviations")},
    **{f"Measurement {i}: {name}": targets(i) for i, name in enumerate(RUNS, 1)},
    **{f"Measurement {i}: {name}": targets(i) for i, name in ((4, "xty"), (5, "ytx"))},
    "Ranges": lambda results: [list(one.values()) for one in results["spheres"]],
    "Distance from where the reference instrument saw the point": lambda results: [
        [*one.values(), *(100 * one[name] for name in ("coordinates_within_U", "points_within_ellipsoid") if name in one)]
        for one in results["positions"].values()
    ],
    "Rows of the arm as found": lambda results: [list(row.values()) for row in results["rows"]],
    **{f"Contributions to the uncertainty of the test value named, {name}": of_test_value for name in STATED},
}  # fmt: skip
"""Where in results.json the rows of a table stand, in their order, by the table's caption."""

WORDS = {"", "–", "∞", "not determined", "set aside", "see warnings", "yes"}
"""What stands in a numeric column, or in the place of a figure, and is none."""

NUMBER = re.compile(r"−?\d+(?:\.\d+)?")
FIGURE = re.compile(r"(?:[(,]?\s?−?\d+(?:\.\d+)?\)?(?:″| %)?)+")


def numbers_in(data: object) -> Iterator[float]:
    if isinstance(data, Mapping):
        data = list(data.values())
    if isinstance(data, (list, tuple)):
        yield from chain.from_iterable(map(numbers_in, data))
    elif isinstance(data, (int, float)) and not isinstance(data, bool):
        yield float(data)


def printed(table: Table, row: tuple[str, ...]) -> Iterator[tuple[Decimal, Decimal]]:
    """Figures of a row, with half of the last place to which each is rounded."""
    for column, cell in zip(table.columns, row, strict=True):
        if cell in WORDS:
            continue
        if not all(FIGURE.fullmatch(end) for end in re.split(" to | ± ", cell)):  # an interval, a figure with U, or one
            assert not column.numeric, f"{table.caption}: {cell!r} is no figure"
            continue
        for text in NUMBER.findall(cell):
            value = Decimal(text.replace("−", "-"))
            # zeros before the point may only fill the places that an uncertainty does not support
            place = value.as_tuple().exponent if "." in text else len(text) - len(text.rstrip("0")) if value else 0
            part = Decimal("0.01") if "%" in cell else Decimal(1)
            yield value * part, part * Decimal(10) ** int(place) / 2


def missing(table: Table, records: Sequence[Record]) -> list[str]:
    """Figures that their record does not have."""
    lost = []
    for row, record in zip(table.rows, records[: len(table.rows)], strict=True):
        held = [Decimal(repr(number)) for number in numbers_in(record)]
        for value, half in printed(table, row):
            if not any(abs(value - number) <= half * Decimal("1.000001") for number in held):
                lost.append(f"{row[0]}: {value}")
    return lost


def records(caption: str) -> Callable[[Results], Sequence[Record]]:
    _, decision, name = caption.partition("All values decided by ")
    return decided(name) if decision else RECORDS[caption]


@pytest.mark.long(but="bryan")
@pytest.mark.parametrize("example", EXAMPLES)
def test_every_printed_number_stands_in_results_json(example: str) -> None:
    results = results_of(example)
    for caption, table in tables(document(example)).items():
        assert missing(table, records(caption)(results)) == [], caption


def test_a_figure_that_is_off_by_its_last_place_is_not_found() -> None:
    """The comparison itself can fail, in each column."""
    table = tables(document("sphere-simulated"))["Probing errors"]
    records = RECORDS["Probing errors"](results_of("sphere-simulated"))
    assert missing(table, records) == []
    for key in ("points", "form_error_um", "size_error_um"):
        (sphere,) = records[0]
        off = [[{**sphere, key: sphere[key] * 1.05 + 0.02}], *records[1:]]
        assert len(missing(table, off)) == 1, key


def stated(data: object, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], float]]:
    """Every expanded uncertainty of an effect's parameter, by where it stands; adjustments have the effect in a key."""
    if isinstance(data, Mapping):
        named = (str(data["effect"]),) if isinstance(data.get("effect"), str) else ()
        for key, value in data.items():
            if isinstance(value, Mapping) and isinstance(value.get("U"), float):
                yield (*path, *named, key), value["U"]
            yield from stated(value, (*path, *named, key))
    elif isinstance(data, list):
        for one in data:
            yield from stated(one, path)


def disagreeing(results: Results) -> list[str]:
    """Parts of results.json that state another U of an estimated parameter than the estimates, and no reason.

    The turn by which an axis is adjusted is not the angle between two axes: they differ by products of the angles, 10⁻³ of U.
    """
    own = {path[-2:]: U for path, U in stated(results["estimates"])}
    return [
        ".".join(path)
        for path, U in stated(results)
        if path[-2:] in own
        and not math.isclose(own[path[-2:]], U, rel_tol=1e-3 if path[0] == "adjustments" else 0)
        and not results["conditional"].get(path[0])
    ]


def two_uncertainties(document: Document) -> list[str]:
    """Rows of which two tables print different U, where no note of either says what one of them is conditional on."""
    seen: dict[str, list[tuple[str, bool]]] = {}
    for table in tables(document).values():
        reason = any("conditional on" in note for note in table.notes)
        for row in table.rows:
            if NUMBER.fullmatch(row[0]):  # a position or a line, of which the columns are several quantities
                continue
            cells = zip(table.columns, row, strict=True)
            for U in {cell for column, cell in cells if column.heading == "U" and cell not in WORDS}:
                seen.setdefault(row[0], []).append((U, reason))
    return [name for name, found in seen.items() if len({U for U, _ in found}) > 1 and not any(r for _, r in found)]


@pytest.mark.long(but="step-gauge")
@pytest.mark.parametrize("example", EXAMPLES)
def test_no_quantity_has_two_uncertainties_without_a_reason(example: str) -> None:
    results = {"conditional": {}, **results_of(example)}
    assert disagreeing(results) == []
    assert two_uncertainties(document(example)) == []


def test_two_uncertainties_of_one_quantity_are_seen() -> None:
    """Without its reason, the second way to the factors of a ballbar is one, and so are they over the measuring range."""
    results = results_of("iota-1102-20C")
    paths = [path.split(".")[0] for path in disagreeing({**results, "conditional": {}})]
    assert {one: paths.count(one) for one in paths} == {"over_range": 6, "regions": 6, "distance_equations": 6}
    found = document("iota-1102-20C")
    bare = [
        replace(section, blocks=tuple(replace(b, notes=()) if isinstance(b, Table) else b for b in section.blocks))
        for section in found.sections
    ]
    # 16″ of the angle X–Y are the same as printed
    expected = [*(f"Scale error of {axis}" for axis in "XYZ"), *(f"Squareness {plane}" for plane in ("X–Y", "Y–Z", "Z–X")),
                "Angle Y–Z − 90°", "Angle Z–X − 90°"]  # fmt: skip
    assert two_uncertainties(replace(found, sections=tuple(bare))) == expected


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_covariance_has_the_variance_of_every_estimate(example: str) -> None:
    results = results_of(example)
    covariance = results["covariance"]
    stated = {f"{effect}.{name}": quantity["u"] for effect, found in results["estimates"].items()
              for name, quantity in found.items()}  # fmt: skip
    if "certified" in results:
        stated |= {f"artefact.{name}": quantity["u"] for name, quantity in results["artefact"].items()}
    assert set(covariance["parameters"]) == set(stated)
    for i, (name, row) in enumerate(zip(covariance["parameters"], covariance["matrix"], strict=True)):
        assert row[i] == pytest.approx(stated[name] ** 2, rel=1e-8)
        assert row == [other[i] for other in covariance["matrix"]]
        assert len(covariance["units"]) == len(row)


def test_the_covariance_gives_the_uncertainty_of_a_difference() -> None:
    """The scales of an uncalibrated bar share one free part: a difference is far better known than either of them."""
    results = results_of("bryan-simulated")
    names, matrix = results["covariance"]["parameters"], results["covariance"]["matrix"]
    for one in results["differences"]:
        i, j = names.index(one["of"]), names.index(one["minus"])
        variance = matrix[i][i] + matrix[j][j] - 2 * matrix[i][j]
        assert one["ppm"]["u"] == pytest.approx(variance**0.5, rel=1e-4)
        assert one["ppm"]["u"] < 0.1 * matrix[i][i] ** 0.5
