"""Errors of a rotary table against exact rigid motions, in which no formula of an effect is used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.rotary import Turntable
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Amount
from cmm_uq.machine.physics.superposition import Superposition

ARCSECOND, MICROMETRE = np.pi / 648000, 1e-3
ORIGIN, PIVOT = np.array([10.0, -20.0, 30.0]), np.array([350.0, 480.0, 55.0])
RANDOM = np.random.default_rng(7)
ON_TABLE = RANDOM.uniform(-300, 300, (40, 3)) + PIVOT - ORIGIN
ANGLES = RANDOM.uniform(-360, 720, 40)
ROTARY = [name for name, effect in EVERY.items() if name.startswith("rotary")]


def points(letter: str, *, clockwise: bool = False, **columns: Floats) -> Points:
    machine = Turntable("m", origin_mm=ORIGIN, letter=letter, axis_mm=PIVOT, clockwise=clockwise)
    number = np.arange(len(ON_TABLE))
    return Points(ON_TABLE, number, number, number, machine, {f"{letter}_deg": ANGLES, **columns})


def shown(there: Points, name: str, coefficients: Floats) -> Floats:
    """Error along the coordinates, (n, 3) mm."""
    e = Superposition((EVERY[name],)).errors(there, coefficients)
    return there.on_artefact(e[:, :, None])[:, :, 0]


def by_rigid_motions(
    letter: str, turn: Floats, *, offset: Floats | None = None, tilt: Floats | None = None,
    moved: Callable[[float], Floats] | None = None, rotated: Callable[[float], Floats] | None = None,
) -> Floats:  # fmt: skip
    """Of points that a faultless machine probes: where they are on a table with these faults, less where it takes them to be.

    ``offset, tilt``: of the axis, mm and rad. ``moved, rotated``: mm, rad, of the turn (rad) by the right hand.
    """
    about, zero, found = np.eye(3)["abc".index(letter)], np.zeros(3), []
    lean = Rotation.from_rotvec(zero if tilt is None else tilt)
    for xyz, c in zip(ON_TABLE, turn, strict=True):
        q = xyz + ORIGIN - PIVOT
        there = Rotation.from_rotvec(c * about).apply(q)  # where the probe was, from p
        o = zero if offset is None else offset
        e = zero if moved is None else moved(c)
        error = Rotation.from_rotvec(zero if rotated is None else rotated(c))
        # of what stands at w: about the true axis by c, from the place that it has at c = 0
        whole = error * lean * Rotation.from_rotvec(c * about) * lean.inv()
        w = whole.inv().apply(there - e - error.apply(o)) + o
        found.append(w - q)
    return np.array(found)


def close(found: Floats, exact: Floats) -> None:
    """But for products of errors: 20 ″ of 20 ″, and the difference of the turn about p or about the true axis."""
    assert np.abs(exact).max() > 1e-4
    np.testing.assert_allclose(found, exact, atol=3e-3 * np.abs(exact).max())


AXES_OF = {"c": "xyz", "a": "yzx", "b": "zxy"}  # the two across it, and its own


@pytest.mark.parametrize("letter", ["a", "b", "c"])
@pytest.mark.parametrize("clockwise", [False, True])
def test_location_and_tilt_are_those_of_a_rigid_turn_about_another_axis(letter: str, clockwise: bool) -> None:
    there, turn = points(letter, clockwise=clockwise), np.radians(-ANGLES if clockwise else ANGLES)
    for name in AXES_OF[letter][:2]:
        unit = np.eye(3)["xyz".index(name)]
        close(
            shown(there, f"rotary_location_{letter}_{name}", np.array([20.0])),
            by_rigid_motions(letter, turn, offset=20 * MICROMETRE * unit),
        )
        close(
            shown(there, f"rotary_tilt_{letter}_{name}", np.array([20.0])),
            by_rigid_motions(letter, turn, tilt=20 * ARCSECOND * unit),
        )


A, PHASE = 6.0, 0.7
WAVE = np.array([A * np.cos(PHASE), A * np.sin(PHASE)])


@pytest.mark.parametrize("letter", ["a", "b", "c"])
@pytest.mark.parametrize("clockwise", [False, True])
def test_motions_are_those_of_a_rigid_table(letter: str, clockwise: bool) -> None:
    there, turn = points(letter, clockwise=clockwise), np.radians(-ANGLES if clockwise else ANGLES)
    one, other, own = (np.eye(3)["xyz".index(name)] for name in AXES_OF[letter])

    def along(order: int, unit: Floats, size: float) -> Callable[[float], Floats]:
        return lambda c: size * A * np.cos(order * c + PHASE) * unit

    def circle(size: float) -> Callable[[float], Floats]:
        return lambda c: size * A * (np.cos(c + PHASE) * one - np.sin(c + PHASE) * other)

    um, arcsec = MICROMETRE, ARCSECOND
    for order in (1, 2):
        name = f"{letter}_{order}"
        close(shown(there, f"rotary_axial_{name}", WAVE), by_rigid_motions(letter, turn, moved=along(order, own, um)))
        close(
            shown(there, f"rotary_positioning_{name}", WAVE),
            by_rigid_motions(letter, turn, rotated=along(order, own, arcsec)),
        )
    close(shown(there, f"rotary_radial_{letter}_1", WAVE), by_rigid_motions(letter, turn, moved=circle(um)))
    close(shown(there, f"rotary_wobble_{letter}_1", WAVE), by_rigid_motions(letter, turn, rotated=circle(arcsec)))
    for axis, unit in zip(AXES_OF[letter][:2], (one, other), strict=True):
        name = f"{letter}_{axis}_2"
        close(shown(there, f"rotary_radial_{name}", WAVE), by_rigid_motions(letter, turn, moved=along(2, unit, um)))
        close(
            shown(there, f"rotary_wobble_{name}", WAVE), by_rigid_motions(letter, turn, rotated=along(2, unit, arcsec))
        )


@pytest.mark.parametrize("clockwise", [False, True])
def test_play_is_half_of_the_gap_to_either_side_of_the_reading(clockwise: bool) -> None:
    approach = np.where(np.arange(40) % 2, 1.0, -1.0)
    there = points("c", clockwise=clockwise, c_approach=approach)
    read = iter(approach * (-1 if clockwise else 1))
    turn = np.radians(-ANGLES if clockwise else ANGLES)
    exact = by_rigid_motions("c", turn, rotated=lambda c: 0.5 * 8 * ARCSECOND * next(read) * np.array([0, 0, 1.0]))
    close(shown(there, "rotary_play_c", np.array([8.0])), exact)


@pytest.mark.parametrize(("name", "part"), [("radial", 0), ("radial", 1), ("axial", 2), ("positioning", 2)])
def test_higher_orders_are_a_sum_of_waves_whose_size_is_their_rms(name: str, part: int) -> None:
    effect = EVERY[f"rotary_{name}_c_n"]
    names = [c.name for c in effect.coefficients]
    coefficients = np.zeros(len(names))
    for order, cosine, sine in ((3, 2.0, -1.0), (12, 0.5, 1.5)):
        unit = "arcsec" if name == "positioning" else "um"
        coefficients[names.index(f"cosine_{'xyz'[part]}_{order}_{unit}")] = cosine
        coefficients[names.index(f"sine_{'xyz'[part]}_{order}_{unit}")] = sine

    def wave(c: float) -> Floats:
        f = 2 * np.cos(3 * c) - np.sin(3 * c) + 0.5 * np.cos(12 * c) + 1.5 * np.sin(12 * c)
        return np.asarray(f * np.eye(3)[part] * (ARCSECOND if name == "positioning" else MICROMETRE))

    turn = np.radians(ANGLES)
    motion = {"rotated": wave} if name == "positioning" else {"moved": wave}
    close(shown(points("c"), effect.name, coefficients), by_rigid_motions("c", turn, **motion))
    ((size, value),) = effect.to_reported(coefficients, np.zeros(0)).items()
    parts = 2 if name == "radial" else 1
    assert value == pytest.approx(np.sqrt(0.5 * (4 + 1 + 0.25 + 2.25) / parts), rel=1e-9)
    exact, _ = effect.from_reported({size: 2.5, "seed": 3})
    assert effect.to_reported(exact, np.zeros(0))[size] == pytest.approx(2.5, rel=1e-9)
    assert [c.prior_sd * k for c, k in zip(effect.coefficients[::2], range(3, 13), strict=False)] == pytest.approx(
        [3 * effect.coefficients[0].prior_sd] * 10
    )


def test_no_effect_is_what_a_place_or_an_attitude_on_the_table_could_be() -> None:
    """Of the whole space of rigid placings of the artefact on the table none is an effect, nor a sum of them."""
    there = points("c", c_approach=np.where(np.arange(40) % 3, 1.0, -1.0))
    names = [name for name in ROTARY if name.split("_")[2] == "c"]
    columns = []
    for name in names:
        basis = there.on_artefact(EVERY[name].basis(there))
        columns.append(basis.reshape(-1, basis.shape[2]))
    about = ON_TABLE - ON_TABLE.mean(axis=0)
    placing = np.hstack([np.tile(np.eye(3), (40, 1)), *(np.cross(u, about).reshape(-1, 1) for u in np.eye(3))])
    every = np.hstack([*columns, placing])
    every /= np.linalg.norm(every, axis=0)
    assert np.linalg.matrix_rank(every, tol=1e-6) == every.shape[1]


def meant(name: str, parameter: str, *, negative: bool = False) -> str:
    return str(EVERY[name].meaning({parameter: Amount(Verbatim("20"), negative)}))


def test_what_an_amount_means_is_what_the_rigid_table_did() -> None:
    """With the signs of the motions above: + is towards plus, and turned by the right hand, which is clockwise along plus."""
    assert (
        meant("rotary_location_c_y", "um")
        == "the axis of the table stands 20 further towards plus Y than it is taken to"
    )
    assert "towards minus X" in meant("rotary_location_c_x", "um", negative=True)
    assert (
        meant("rotary_tilt_a_z", "angle_arcsec")
        == "the axis of the table is turned clockwise about Z by 20, seen along plus"
    )
    assert "turned anticlockwise" in meant("rotary_tilt_c_x", "angle_arcsec", negative=True)
    assert "20 further towards plus when it comes from minus" in meant("rotary_play_c", "gap_arcsec")


@pytest.mark.parametrize("name", ROTARY)
def test_an_effect_of_a_table_asks_for_that_table(name: str) -> None:
    letter = name.split("_")[2]
    there = points(letter, **{f"{letter}_approach": np.ones(40)})
    assert EVERY[name].unfit(there) is None
    assert f"{letter}_deg" in EVERY[name].columns
    for machine in (Machine("m"), Turntable("m", letter="cab"["abc".index(letter)])):
        other = replace(there, machine=machine)
        with pytest.raises(CmmUqError, match=rf"of a rotary table {letter.upper()}.*XYZ\|{letter.upper()}"):
            EVERY[name].basis(other)
        assert str(EVERY[name].unfit(other)).startswith(f"job.toml [machine] chain: {name} is of a rotary table")
