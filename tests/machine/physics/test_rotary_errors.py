"""What corrects a machine with rotary axes: exact rigid motions, draws of its coefficients, and files that are none."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.catalogue import EVERY, effects
from cmm_uq.machine.physics.compensation import RotaryErrors, blocks, compensate_points, parse_rotary_errors
from cmm_uq.machine.physics.map_interpolation import factor_file
from tests.machine.physics.test_rotary import OF_AXES, ON_TABLE, erring, matrix, points, turn

NONE = np.zeros(3)


def errors_of(there: Points, size: float, seed: int = 3) -> RotaryErrors:
    """Of every axis of a chain, all its errors."""
    named = effects([name for name in OF_AXES if EVERY[name].unfit(there) is None])
    count = sum(len(effect.coefficients) for effect in named)
    random = np.random.default_rng(seed)
    return RotaryErrors(named, random.normal(0, size, count), random.normal(0, 0.2 * size, (count, 7)))


def indicated(there: Points, errors: RotaryErrors) -> Floats:
    """What a machine with all these errors at once indicates of the places on its table, by one product of matrices."""
    machine, found = there.machine, []
    parts, start = {}, 0
    for effect in errors.effects:
        parts[effect.name] = errors.values[start : (start := start + len(effect.coefficients))]
    for i, xyz in enumerate(ON_TABLE):
        right, wrong = np.eye(4), np.eye(4)
        for axis in machine.tables:
            point, angle = matrix(NONE, machine.pivot(axis)), np.radians(there.columns[axis.column][i])
            bad, sense = turn(axis, angle), float(there.columns[f"{axis.letter}_approach"][i])
            for name, values in parts.items():
                if name.split("_")[2] == axis.letter:  # each about the exact turn, one after the other
                    bad = erring(name, axis, angle, sense, values) @ turn(axis, -angle) @ bad
            right = right @ point @ turn(axis, angle) @ np.linalg.inv(point)
            wrong = wrong @ point @ bad @ np.linalg.inv(point)
        found.append(np.linalg.solve(right, wrong @ np.append(xyz, 1.0))[:3])
    return np.array(found)


@pytest.mark.parametrize(("chain", "size"), [("c", 5.0), ("ac", 5.0), ("bc", 5.0), ("ac", 0.5)])
def test_known_errors_of_all_axes_at_once_are_corrected_to_their_second_order(chain: str, size: float) -> None:
    """5 µm and 5″ of every error of both tables leave nanometres of hundreds of micrometres, a tenth of them a hundredth."""
    there = points(chain)
    errors = errors_of(there, size)
    off = indicated(there, errors)
    corrected = compensate_points(there.at(off), None, errors)
    before, after = (np.abs(xyz - ON_TABLE).max() for xyz in (off, corrected.xyz))
    assert before > 0.005 * size
    assert after < 1e-5 * size**2
    np.testing.assert_array_equal(corrected.columns["c_deg"], there.columns["c_deg"])


@pytest.mark.parametrize("chain", ["ac", "-ca", "c-b"])
def test_u_of_points_and_of_what_lies_between_them_is_that_of_draws(chain: str) -> None:
    """Factor and formula against corrections by coefficients drawn from the covariance."""
    there = points(chain)
    errors = errors_of(there, 3.0)
    random, drawn = np.random.default_rng(5), []
    for _ in range(500):
        values = errors.values + errors.factor @ random.standard_normal(errors.factor.shape[1])
        drawn.append(RotaryErrors(errors.effects, values, errors.factor).errors(there))
    moved = np.array(drawn)
    np.testing.assert_allclose(errors.standard_uncertainty(there), moved.std(axis=0), rtol=0.12, atol=1e-9)
    root = errors.root(there)
    apart = moved[:, 1:] - moved[:, :-1]
    np.testing.assert_allclose(np.linalg.norm(root[1:] - root[:-1], axis=2), apart.std(axis=0), rtol=0.12)
    assert [len(rows) for rows in blocks(2500)] == [1024, 1024, 452]


def test_a_file_of_errors_is_read_as_it_was_written() -> None:
    there = points("ac")
    errors = errors_of(there, 3.0)
    text = ("# made of something\n" + errors.csv()).encode()
    found = parse_rotary_errors(text, factor_file(errors.factor), "e.csv", "e.npy", "e.csv")
    assert [one.name for one in found.effects] == [one.name for one in errors.effects]
    np.testing.assert_array_equal(found.values, errors.values)
    np.testing.assert_array_equal(found.factor, errors.factor)
    line = text.decode().splitlines()[2].split(",")
    assert line[:2] == ["rotary_location_c_x", "um"]
    assert float(line[3]) == pytest.approx(np.linalg.norm(errors.factor[0]), rel=1e-5)


HEAD = "effect,coefficient,value,u\n"
PLACE = "rotary_location_c_x,um,1.0,0.1\n"
WAVE = "rotary_positioning_c_1,cosine_arcsec,1.0,0.1\n"


@pytest.mark.parametrize(
    ("text", "problem", "where"),
    [
        ("effect,value\n" + PLACE, "column coefficient is missing", "e.csv line 1"),
        (HEAD + PLACE.replace("1.0", "one"), "'one' is not a number", "e.csv line 2, column value"),
        (HEAD + PLACE.replace("c_x", "c_q"), "unknown effect 'rotary_location_c_q'", "e.csv"),
        (HEAD + WAVE, "the coefficients of rotary_positioning_c_1 are not all there", "e.csv line 2"),
        (HEAD + WAVE.replace("cosine", "sine"), "not all there in their order", "e.csv line 2"),
        (HEAD + PLACE + PLACE, "not all there in their order", "e.csv line 3"),
        (HEAD + "periodic_scale_x,sine_um,1.0,0.1\n", "no error that such a file corrects", "e.csv"),
        (HEAD, "has no rows", "e.csv"),
        (HEAD + PLACE + PLACE.replace("c_x", "c_y"), "has 1 rows, the file e.csv has 2 coefficients", "e.npy"),
    ],
)
def test_what_is_no_file_of_errors_is_refused(text: str, problem: str, where: str) -> None:
    with pytest.raises(CmmUqError) as told:
        parse_rotary_errors(text.encode(), factor_file(np.ones((1, 1))), "e.csv", "e.npy", "e.csv")
    assert problem in str(told.value)
    assert str(told.value.where) == where
