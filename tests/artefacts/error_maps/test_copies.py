"""Columns of error maps that repeat another map's figures."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts.error_maps.columns import columns_of, copies
from cmm_uq.artefacts.error_maps.diagnosis import diagnose_maps
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.tables.machine import ErrorMapFile
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap

PLACE = np.arange(0, 601, 25.0)
COURSE = 0.02 * np.sin(PLACE / 130) + 2e-5 * PLACE
SIGMA = 0.5 * MICROMETRE


def maps(count: int = 3, seed: int = 1) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.round(COURSE + SIGMA * random.standard_normal((count, len(PLACE))), 4)


def test_maps_that_were_measured_are_no_copies() -> None:
    assert all(copies(maps(4, seed), MICROMETRE) == [] for seed in range(50))


def test_a_copy_is_found_with_what_it_is_a_copy_of() -> None:
    values = maps(5)
    values[3], values[4] = values[1], values[0] + 0.3
    assert copies(values, MICROMETRE) == [(0, 4), (1, 3)]


def test_a_copy_with_a_few_readings_changed_is_one() -> None:
    values = maps()
    values[1] = values[0]
    values[1, [3, 9, 17]] += 0.02
    assert copies(values, MICROMETRE) == [(0, 1)]


def test_a_copy_in_fewer_digits_is_one() -> None:
    """Figures of 0.1 µm, rounded to whole micrometres."""
    values = maps()
    values[2] = np.round(values[1], 3)
    assert copies(values, MICROMETRE) == [(1, 2)]


def test_another_run_in_fewer_digits_is_none() -> None:
    """Two runs with a noise of 0.5 µm each agree within half a micrometre in half of 25 readings, not in all."""
    assert not any(
        copies(np.vstack([one[0], np.round(one[1], 3)]), MICROMETRE) for one in (maps(2, seed) for seed in range(40))
    )


def test_maps_of_few_whole_figures_are_alike_without_being_copies() -> None:
    """Straightnesses of −1, 0 and 1 µm."""
    random = np.random.default_rng(4)
    values = 1e-3 * random.integers(-1, 2, (3, 25)).astype(float)
    values[1] = values[0]
    values[1, ::4] += 1e-3
    assert copies(values, MICROMETRE) == []


def test_a_column_of_nothing_is_no_copy_of_another() -> None:
    assert copies(np.zeros((3, 25)), MICROMETRE) == []


def machine_map(temperature: float, **columns: np.ndarray) -> ErrorMap:
    """A map of X alone."""
    table = np.zeros((len(PLACE), 6))
    for name, values in columns.items():
        table[:, ("dx", "dy", "dz", "rx", "ry", "rz").index(name)] = values
    rest = AxisErrors(PLACE, np.zeros((len(PLACE), 6)))
    return ErrorMap((AxisErrors(PLACE, table), rest, rest), temperature=temperature)


def three_with_a_copy(expansion: float) -> list[ErrorMap]:
    """20, 25 and 30 °C; the scale's figures at 25 °C are those of 20 °C."""
    values = maps() + expansion * np.outer([0, 5, 10], PLACE)
    values[1] = values[0]
    return [machine_map(t, dx=v, dy=maps(seed=2)[i]) for i, (t, v) in enumerate(zip((20, 25, 30), values, strict=True))]


def test_a_scale_whose_figures_stand_above_two_temperatures_accuses_no_third_map_and_gives_no_expansion() -> None:
    """Whether 54 µm came with 5 K or with 10 K nobody knows."""
    columns, findings = columns_of(three_with_a_copy(9e-6))
    assert [c.title for c in columns] == ["straightness of X along Y"]
    copied = next(f for f in findings if f.kind == "copied")
    assert copied.why.startswith("scale error of X: the maps at 20, 25 °C give the same figures")
    found = diagnose_maps(columns, (), alpha=0.01, seed=0)
    assert found.verdict == "consistent"
    assert not found.effects


def test_two_pairs_of_copies_are_told_apart() -> None:
    values = maps(4)
    values[1], values[3] = values[0], values[2]
    given = [machine_map(t, dy=v) for t, v in zip((18, 20, 22, 24), values, strict=True)]
    told = [f.why for f in columns_of(given)[1] if f.kind == "copied"]
    assert [why.split("maps at ")[1].split(" °C")[0] for why in told] == ["18, 20", "22, 24"]


def test_a_map_at_a_temperature_in_kelvin_is_refused() -> None:
    assert ErrorMapFile(file="a.csv", temperature_c=25.0).temperature_c == 25.0
    with pytest.raises(ValueError, match=r"298\.15 K are 25 °C"):
        ErrorMapFile(file="a.csv", temperature_c=298.15)
    with pytest.raises(ValueError, match="no machine is mapped at 150 °C"):
        ErrorMapFile(file="a.csv", temperature_c=150.0)


def test_the_error_names_the_key(tmp_path: object) -> None:
    import cmm_uq

    with pytest.raises(CmmUqError, match=r"error_map\.0\.temperature_c"):
        cmm_uq.job(
            machine={"name": "M", "error_map": [{"file": "a.csv", "temperature_c": 293.15}]}, artefact="error_map", effects=[],
        )  # fmt: skip
