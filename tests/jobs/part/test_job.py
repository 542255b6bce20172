"""What a part's job refuses, in words that name file, line and key."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.jobs.part.checks import readings
from cmm_uq.jobs.part.job import TABLES, files_of_the_machine
from cmm_uq.jobs.part.machine_state import MachineStateFacts
from cmm_uq.jobs.source import FilesInMemory as InMemory
from tests.jobs.part.parts import plate, tables

PLANE_A, *_, BORE = TABLES["feature"]
SIZE = TABLES["characteristic"][0]
CLOUD = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def features(*changed: dict[str, Any]) -> dict[str, Any]:
    """The plate's features, those of a name that is given otherwise."""
    other = {one["name"]: one for one in changed}
    own = [other.pop(one["name"], one) for one in TABLES["feature"]]
    return {"feature": [*own, *other.values()]}


def without(table: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in keys}


def asked(**keys: Any) -> dict[str, Any]:
    return {"characteristic": [{"name": "1", **keys}]}


def target(name: str, x: float) -> dict[str, Any]:
    return {"name": name, "kind": "point", "point_mm": [x, 0.0, -5.0], "direction": [0.0, -1.0, 0.0]}


def styli(*tips: float) -> dict[str, Any]:
    return {"stylus": [{"name": f"tip {i}", "diameter_mm": tip} for i, tip in enumerate(tips)]}


REFUSED: list[tuple[dict[str, Any], str]] = [
    # features with too few points, or without what their kind needs
    (features({**BORE, "strategy": {"pattern": "points", "points": 4}}),
     r"\[\[feature\]\] 4: 4 points are too few for a cylinder"),
    (features({**without(PLANE_A, "strategy"), "points_mm": [[0.0, 0.0, 0.0]] * 5}), "1 of 5 points lie apart"),
    (features({**without(BORE, "strategy"), "points_mm": CLOUD * 2}),
     r"points_mm: point 1 lies 57\.1 mm from the nominal cylinder"),
    (features(without(BORE, "inner")), "a cylinder needs diameter_mm, and inner: true of a hole"),
    (features(without(PLANE_A, "direction")), "a plane needs a direction"),
    (features({**PLANE_A, "angle_deg": 3.0}), "a plane has no angle_deg"),
    (features({**PLANE_A, "direction": [0.0, 0.0, 0.0]}), "has no direction"),
    (features({**PLANE_A, "along": [0.0, 0.0, 2.0]}), "along lies along the direction"),
    (features(without(PLANE_A, "strategy")), "give either strategy"),
    (features({**PLANE_A, "strategy": {"pattern": "grid", "rows": 3}}), "the pattern 'grid' needs columns"),
    (features({**PLANE_A, "strategy": {"pattern": "sections", "sections": 3, "points": 8}}), "give one of points, grid"),
    (features({**PLANE_A, "strategy": {"pattern": "grid", "rows": 3, "columns": 3, "start_deg": 4.0}}), "has no start_deg"),
    (features(without(BORE, "length_mm")), "needs length_mm"),
    (features({**PLANE_A, "association": "maximum_inscribed"}), "a plane has no association 'maximum_inscribed'"),
    (features({**PLANE_A, "kind": "plan"}), "Did you mean 'plane'"),
    (features({"name": "tip", "kind": "cone", "point_mm": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0], "diameter_mm": 2.0,
               "angle_deg": 90.0, "inner": False, "length_mm": 4.0, "strategy": {"pattern": "points", "points": 9}}),
     "the cone ends before its length does"),
    # names
    (features({**BORE, "stylus": "up"}), "there is no stylus 'up'"),
    (styli(4.0, 2.0), "there are 2 styli, and 'A' does not say which probes it"),
    ({"feature": [*TABLES["feature"], BORE]}, "the feature 'bore' stands there twice"),
    (asked(what="flatness", features=["AA"]), r"\[\[characteristic\]\] 1 features: there is no feature 'AA'"),
    ({"alignment": {"datums": ["A", "B", "D"]}}, r"\[alignment\] datums: there is no feature 'D'"),
    ({"probing": {"order": ["A", "B", "C"]}}, "leaves 'bore' out"),
    (styli(30.0), "a tip of 30 mm does not fit into 'bore'"),
    # datums
    ({"alignment": {"datums": ["A", "B"]}}, "they leave free shift along x"),
    ({"alignment": {"datums": ["A", "bore"]}}, "they leave free rotation about z"),
    ({"alignment": {"datums": ["A"], "best_fit": True}}, "give either datums or best_fit"),
    ({"alignment": {}, **asked(what="position", features=["bore"], tolerance_mm=0.1)},
     "has no datums, and there is no alignment"),
    (asked(what="x", features=["bore"], datums=["A", "bore"]), "'bore' cannot be its own datum"),
    (asked(what="x", features=["bore"], datums=["A", "B"], upper_mm=61.0),
     "x of 'bore' is to datums that leave free shift along x"),
    (asked(what="position", features=["bore"], datums=["A", "B"], tolerance_mm=0.1),
     "position of 'bore' is to datums that leave free shift along x, which is not modelled"),
    (asked(what="position", features=["bore"], datums=["A", "B(M)", "C"], tolerance_mm=0.1),
     r"the datum 'B\(M\)' holds at maximum material condition"),
    # two targets of one face are no plane, though with all others they fix the part
    ({**features(*(target(f"t{i}", x) for i, x in enumerate((10.0, 90.0)))), "alignment": {"datums": ["A", "t0-t1", "C"]}},
     r"\[alignment\] datums: the datum 't0-t1' is on 2 points of one face"),
    # a point on its own fixes all of its place: after two of them nothing is left to a third
    ({**features(*(target(f"t{i}", x) for i, x in enumerate((10.0, 90.0, 50.0)))),
      "alignment": {"datums": ["A", "t0", "t1", "t2"]}}, "the datum 't2' fixes nothing"),
    # characteristics
    ({"feature": [{**PLANE_A, "strategy": None, "points_mm": [[5.0, 5.0, 0.0], [115.0, 5.0, 0.0], [60.0, 75.0, 0.0]]},
                  *TABLES["feature"][1:]]}, "3 points determine 'A' and show nothing of its form"),
    (asked(what="size", features=["bore"], association="tangent"), "'bore' is a cylinder, which has no association 'tangent'"),
    (asked(what="symmetry", features=["A"], datums=["B"], tolerance_mm=0.1), "is a symmetry: the median plane"),
    (asked(what="concentricity", features=["bore"], datums=["A"], tolerance_mm=0.1), 'ask for "coaxiality"'),
    (asked(what="size", lower_mm=29.0), "names no feature: give features"),
    (asked(what="distance", features=["A"]), "a distance is of 2 features"),
    (asked(what="flatness", features=["bore"], tolerance_mm=0.1), "a flatness is of a plane, and 'bore' is a cylinder"),
    (asked(what="parallelism", features=["A"], tolerance_mm=0.1), "parallelism is about a datum"),
    (asked(what="parallelism", features=["A"], datums=["B"], tolerance_mm=0.1), "'A' lies at 90° to 'B' by their nominals"),
    (asked(what="perpendicularity", features=["A"], datums=["bore"], tolerance_mm=0.1, lower_mm=1.0), "has no lower_mm"),
    (asked(what="size", features=["bore"], lower_mm=-0.1, upper_mm=0.1),
     "limits of -0.1 to 0.1 mm, where 'bore' has a nominal"),
    (asked(what="size", features=["bore"], lower_mm=30.1, upper_mm=29.9), "is not below its upper limit"),
    (asked(what="flatness", features=["A"], tolerance_um=20.0), "Give tolerance_mm = tolerance_um / 1000"),
    (asked(what="flat", features=["A"]), "Did you mean 'flatness'"),
    (asked(what="circular_runout", features=["bore"], datums=["A"], tolerance_mm=0.1), "is about a line or cylinder or cone"),
    # the machine
    ({"placing": {"origin_mm": [650.0, 450.0, -500.0]},
      "machine_state": {"certificate": "m", "travel_mm": {"x": [0.0, 700.0]}}},
     r"\[placing\] origin_mm: axis x would have to go to 765 mm for 'A'"),
    ({"machine_state": {"certificate": "m", "job": "../m"}}, "give either certificate or job"),
    ({"machine_state": {}}, "give either certificate or job"),
    ({"machine_state": {"certificate": "m", "chain": "XXY"}}, "give X, Y, Z once each"),
    ({"decision": {"rule": "JCGM 106"}}, "goes by what is known of such parts beforehand"),
    ({"form": {"harmonics_um": {"1": 0.5}}}, "give numbers of lobes from 2"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_what_a_job_of_a_part_cannot_say_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(CmmUqError, match=words) as raised:
        plate(**changes)
    assert "job.toml" in str(raised.value.where)


def test_all_that_is_wrong_is_told_with_its_line() -> None:
    changes = features({**BORE, "strategy": {"pattern": "points", "points": 3}}, {**PLANE_A, "along": [0.0, 0.0, 1.0]})
    text = as_toml(tables(**changes), "job.toml").decode().splitlines()
    with pytest.raises(CmmUqError) as raised:
        plate(**changes)
    told = [raised.value, *raised.value.also]
    lines = [i + 1 for i, line in enumerate(text) if line == "[[feature]]"]
    assert [error.where for error in told] == [
        f"job.toml line {lines[0]}: [[feature]] 1",
        f"job.toml line {lines[3]}: [[feature]] 4",
    ]


def test_axes_read_where_the_ram_stands() -> None:
    """Tip radius outwards, then the stylus back, then the scales' origin; a quarter turn about z takes x to y."""
    job = plate(
        placing={"origin_mm": [300.0, 450.0, -500.0], "rotation_deg": [0.0, 0.0, 90.0]},
        machine_state={"certificate": "m", "origin_mm": [1.0, 2.0, 3.0]},
    )
    top = job.features[0]
    x, y, z = top.points[0]
    np.testing.assert_allclose(readings(top, job.facts)[0], [300 - y + 1, 450 + x + 2, -500 + z + 2 + 150 + 3])


SIMULATED = b'{"posterior": {"file": "posterior-simulated.npz"}}'
OUTSIDE = b'{"posterior": {"file": "../posterior.npz"}}'


@pytest.mark.parametrize(("given", "there", "names"), [
    ({"certificate": "machine"}, {}, ("machine/results.json", "machine/posterior.npz")),
    ({"certificate": "machine/results.json"}, {}, ("machine/results.json", "machine/posterior.npz")),
    ({"certificate": "machine/"}, {"machine/results.json": SIMULATED},
     ("machine/results.json", "machine/posterior-simulated.npz")),
    ({"certificate": "machine/"}, {"machine/results.json": OUTSIDE}, ("machine/results.json", "machine/posterior.npz")),
    ({"certificate": "m"}, {"m/results.json": b"{", "m/certificate.pdf": b""},
     ("m/results.json", "m/posterior.npz", "m/certificate.pdf")),
    ({"certificate": "m"}, {"m/certificate-simulated.pdf": b""}, ("m/certificate-simulated.pdf",)),
    ({"certificate": "m/results.json", "posterior": "draws.npz"}, {}, ("m/results.json", "draws.npz")),
    ({"certificate": "m/certificate.pdf"}, {}, ("m/certificate.pdf",)),
    ({"job": "../m"}, {}, ()),
])  # fmt: skip
def test_a_machine_is_stated_by_its_certificate_or_by_results_with_draws_or_by_a_job(
    given: Any, there: dict[str, bytes], names: tuple[str, ...]
) -> None:
    assert files_of_the_machine(MachineStateFacts.model_validate(given), InMemory(there)) == names
