"""The covariance of an error map's figures, at the points that it corrects and between them."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.compensation import Compensation, PointConditions
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap
from cmm_uq.machine.physics.map_interpolation import (
    ErrorMaps,
    MapCovariance,
    SampledPoints,
    covariance_file,
    figure_units,
    parse_covariance,
)

POSITIONS = (np.array([0.0, 200.0, 500.0, 900.0]), np.array([0.0, 300.0, 600.0]), np.array([-500.0, -100.0, 0.0]))
READINGS = np.array([[100.0, 50.0, -400.0], [820.0, 590.0, -20.0], [200.0, 300.0, -100.0], [455.0, 10.0, -333.0]])
TIP = np.array([30.0, -80.0, -150.0])


def error_map(figures: Floats) -> ErrorMap:
    """Of figures (m,), the squarenesses last."""
    ends = np.cumsum([6 * len(each) for each in POSITIONS])
    x, y, z = (
        AxisErrors(at, part.reshape(-1, 6)) for at, part in zip(POSITIONS, np.split(figures, ends)[:3], strict=True)
    )
    return ErrorMap((x, y, z), squareness=figures[-3:])


COUNT = 6 * sum(map(len, POSITIONS)) + 3
NOTHING = error_map(np.zeros(COUNT))
PAIRS = (np.array([0, 0, 1]), np.array([1, 2, 3]))


def random_factor(columns: int = 5) -> Floats:
    return 2e-3 * np.random.default_rng(3).standard_normal((COUNT, columns)) * figure_units(NOTHING)[:, None] / 1e-3


@pytest.mark.long
@pytest.mark.parametrize("chain", ["XYZ", "YXZ", "XFYZ"])
def test_u_of_a_point_and_of_a_distance_is_the_scatter_of_corrections_by_maps_that_are_drawn(chain: str) -> None:
    """Monte Carlo (JCGM 101) of the compensation itself; 20 000 maps, 0.5 % of a standard deviation; three times that."""
    factor, beside = random_factor(), np.array([1e-3, 2e-3, 0.0])
    covariance, random = MapCovariance(factor, beside), np.random.default_rng(4)
    when, corrected = PointConditions(tip=TIP), []
    for draw in random.standard_normal((20_000, factor.shape[1])):
        found, _ = Compensation(ErrorMaps([error_map(factor @ draw)]), chain).compensate(READINGS, when)
        corrected.append(found + beside * random.standard_normal(READINGS.shape))
    drawn = np.array(corrected)
    u = covariance.standard_uncertainty(NOTHING, READINGS, tip=TIP, chain=chain)
    np.testing.assert_allclose(u, drawn.std(axis=0), rtol=0.015)
    distances = np.linalg.norm(drawn[:, PAIRS[1]] - drawn[:, PAIRS[0]], axis=2)
    root = covariance.root(NOTHING, READINGS, tip=TIP, chain=chain)
    np.testing.assert_allclose(covariance.of_distances(root, READINGS, PAIRS), distances.std(axis=0), rtol=0.015)


def test_what_displaces_all_points_alike_is_in_no_distance() -> None:
    factor = np.zeros((COUNT, 1))
    factor[0 : 6 * len(POSITIONS[0]) : 6] = 0.004  # carriage x off by 4 µm along x, wherever it stands
    covariance = MapCovariance(factor, np.zeros(3))
    np.testing.assert_allclose(covariance.standard_uncertainty(NOTHING, READINGS), [[0.004, 0, 0]] * 4)
    root = covariance.root(NOTHING, READINGS)
    np.testing.assert_allclose(covariance.of_distances(root, READINGS, PAIRS), 0.0, atol=1e-15)


def test_a_file_of_the_covariance_is_read_as_it_was_written() -> None:
    covariance = MapCovariance(random_factor(), np.array([1e-4, 0.0, 3e-4]))
    content = covariance_file(covariance, NOTHING)
    found = parse_covariance(content, "map.npy", NOTHING, covariance.beside)
    np.testing.assert_allclose(found.factor, covariance.factor, rtol=1e-15)
    assert np.load(io.BytesIO(content))[0, 0] == pytest.approx(covariance.factor[0, 0] / 1e-3)  # µm


def saved(array: Floats) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is no .npy file"),
        (b"\x93NUMPY\x01\x00\x10\x00{'descr': '<f8'", "is no .npy file"),
        (b"measurement,point\n1,2\n", "is no .npy file"),
        (saved(np.zeros((COUNT, 2), dtype=np.float32)), "not rows of 64-bit floats"),
        (saved(np.zeros(COUNT)), "not rows of 64-bit floats"),
        (saved(np.asfortranarray(np.zeros((COUNT, 2)))), "not rows of 64-bit floats"),
        (saved(np.zeros((COUNT - 6, 2))), f"has {COUNT - 6} rows, the map .* has {COUNT} figures"),
        (saved(np.zeros((COUNT, 2)))[:-8], "bytes hold no"),
        (saved(np.zeros((COUNT, 0))), "bytes hold no"),
        (
            saved(np.where(np.arange(2 * COUNT).reshape(COUNT, 2) == 5, np.nan, 0.0)),
            "row 3, column 2 is no finite number",
        ),
    ],
)
def test_what_is_no_covariance_of_the_map_is_refused(content: bytes, problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem) as told:
        parse_covariance(content, "map.npy", replace(NOTHING, source="map.csv"), np.zeros(3))
    assert told.value.where == "map.npy"
    assert told.value.fix


def test_an_array_of_objects_is_not_read() -> None:
    file = io.BytesIO()
    np.save(file, np.array([[print]], dtype=object), allow_pickle=True)
    with pytest.raises(CmmUqError, match="not rows of 64-bit floats"):
        parse_covariance(file.getvalue(), "map.npy", NOTHING, np.zeros(3))


def test_distances_are_told_of_points_from_all_of_a_cloud_however_many_come() -> None:
    """In blocks or at once the same points are kept; a scale error known to 10 ppm makes u in proportion to the length."""
    factor = np.zeros((COUNT, 1))
    factor[0 : 6 * len(POSITIONS[0]) : 6, 0] = 10e-6 * POSITIONS[0]
    covariance = MapCovariance(factor, np.zeros(3))
    readings = np.column_stack([np.linspace(0, 900, 1001), np.full(1001, 100.0), np.full(1001, -50.0)])
    whole, parts = SampledPoints(100), SampledPoints(100)
    whole.add(readings, readings)
    for part in np.array_split(readings, 37):
        parts.add(part, part)
    told = whole.distances(NOTHING, covariance, "XYZ")
    assert told == parts.distances(NOTHING, covariance, "XYZ")
    assert [row["largest_u_um"] for row in told] == pytest.approx([1e-2 * row["up_to_mm"] for row in told], rel=1e-3)
    assert told[-1]["up_to_mm"] > 800
    assert SampledPoints(10).distances(NOTHING, covariance, "XYZ") == []
