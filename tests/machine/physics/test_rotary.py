"""Errors of rotary axes against exact rigid motions, 4 × 4 matrices in which no formula of an effect is used."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.rotary import RotaryAxis, RotaryMachine
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Amount
from cmm_uq.machine.physics.superposition import Superposition

ARCSECOND, MICROMETRE = np.pi / 648000, 1e-3
ORIGIN, PIVOT = np.array([10.0, -20.0, 30.0]), np.array([350.0, 480.0, 55.0])
RANDOM = np.random.default_rng(7)
ON_TABLE = RANDOM.uniform(-300, 300, (40, 3)) + PIVOT - ORIGIN
ANGLES = RANDOM.uniform(-360, 720, 40)
OF_AXES = [name for name, effect in EVERY.items() if effect.mechanism == "rotary axis"]
STYLUS = np.array([12.0, -8.0, -190.0])
POINTS = {"a": PIVOT + np.array([9.0, 4.0, -30.0]), "b": PIVOT + np.array([-6.0, 2.0, 14.0]), "c": PIVOT}
ON_RAM = {"a": np.array([2.0, -5.0, -40.0]), "b": np.array([0.0, 3.0, -55.0]), "c": np.array([-1.0, 2.0, -7.0])}


def axes(letters: str, *, clockwise: bool = False) -> tuple[RotaryAxis, ...]:
    """Of a chain such as ``ac`` or ``c-ba``: tables from the bed on, then those of the head, from the ram on."""
    tables, _, head = letters.partition("-")
    return (
        *(RotaryAxis(letter, POINTS[letter], clockwise=clockwise) for letter in tables),
        *(RotaryAxis(letter, ON_RAM[letter], clockwise=clockwise, head=True) for letter in head),
    )


def points(letters: str, *, clockwise: bool = False, **columns: Floats) -> Points:
    """The same, at random angles of every axis."""
    random, rotary = np.random.default_rng(11), axes(letters, clockwise=clockwise)
    machine = RotaryMachine("m", origin_mm=ORIGIN, rotary=rotary, stylus_mm=STYLUS)
    number, read = np.arange(len(ON_TABLE)), {}
    for axis in rotary:
        read[axis.column] = ANGLES if len(rotary) == 1 else random.uniform(-180, 180, 40)
        read[f"{axis.letter}_approach"] = random.choice([-1.0, 1.0], 40)
    return Points(ON_TABLE, number, number, number, machine, {**read, **columns})


def shown(there: Points, name: str, coefficients: Floats) -> Floats:
    """Error along the coordinates, (n, 3) mm."""
    e = Superposition((EVERY[name],)).errors(there, coefficients)
    return there.on_artefact(e[:, :, None])[:, :, 0]


def matrix(rotation: Floats, shift: Floats) -> Floats:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = Rotation.from_rotvec(rotation).as_matrix(), shift
    return found


def turn(axis: RotaryAxis, angle: float) -> Floats:
    return matrix(np.sign(-1 if axis.clockwise else 1) * angle * np.eye(3)["abc".index(axis.letter)], np.zeros(3))


def erring(name: str, axis: RotaryAxis, angle: float, sense: float, values: Floats) -> Floats:
    """(4, 4) of an axis at this reading (rad), about its stated point, with errors of an effect, µm or ″, written out anew."""
    family, _, *which = name.split("_")[1:]
    c, order = (-angle if axis.clockwise else angle), "".join(which[-1:])
    um, arcsec, zero = MICROMETRE, ARCSECOND, np.zeros(3)
    one, other, own = (np.eye(3)["xyz".index(x)] for x in AXES_OF[axis.letter])
    if family == "location":
        o = um * values[0] * np.eye(3)["xyz".index(order)]
        return matrix(zero, o) @ turn(axis, angle) @ matrix(zero, -o)
    if family == "tilt":
        lean = matrix(arcsec * values[0] * np.eye(3)["xyz".index(order)], zero)
        return lean @ turn(axis, angle) @ np.linalg.inv(lean)
    if family == "play":
        way = -1.0 if axis.clockwise else 1.0
        return matrix(way * 0.5 * values[0] * sense * arcsec * own, zero) @ turn(axis, angle)

    def wave(k: int, a: float, b: float) -> float:
        return float(a * np.cos(k * c) - b * np.sin(k * c))

    across = family in ("radial", "wobble")
    if order == "n":
        parts = (one, other) if across else (own,)
        motion = zero
        for part, of in zip(parts, values.reshape(len(parts), -1, 2), strict=True):
            motion = motion + part * sum(a * np.cos(k * c) + b * np.sin(k * c) for k, (a, b) in enumerate(of, 3))
    elif across and order == "1":
        motion = wave(1, *values) * one - (values[0] * np.sin(c) + values[1] * np.cos(c)) * other
    else:
        motion = wave(int(order), *values) * (np.eye(3)["xyz".index(which[0])] if across else own)
    if family in ("wobble", "positioning"):
        return matrix(arcsec * motion, zero) @ turn(axis, angle)
    return matrix(zero, um * motion) @ turn(axis, angle)


SOME = np.arange(0, len(ON_TABLE), 3)


def by_rigid_motions(there: Points, name: str, values: Floats) -> Floats:
    """Where some points are on a table with these faults, less where a faultless one takes them to be; of a head its tip."""
    machine, found = there.machine, []
    assert isinstance(machine, RotaryMachine)
    head = name.startswith("head")
    for i in SOME:
        xyz = ON_TABLE[i]
        right, wrong = np.eye(4), np.eye(4)
        for axis in machine.head if head else machine.tables:
            point, angle = matrix(np.zeros(3), machine.pivot(axis)), np.radians(there.columns[axis.column][i])
            good = point @ turn(axis, angle) @ np.linalg.inv(point)
            bad = good
            if axis.letter == name.split("_")[2]:
                sense = float(there.columns[f"{axis.letter}_approach"][i])
                bad = point @ erring(name, axis, angle, sense, values) @ np.linalg.inv(point)
            right, wrong = right @ good, wrong @ bad
        if head:
            moved = ((wrong - right) @ np.append(machine.stylus_mm, 1.0))[:3]
            found.append(there.on_artefact(np.tile(moved, (40, 1))[:, :, None])[i, :, 0])
        else:
            found.append((np.linalg.solve(wrong, right @ np.append(xyz, 1.0)) - np.append(xyz, 1.0))[:3])
    return np.array(found)


AXES_OF = {"c": "xyz", "a": "yzx", "b": "zxy"}  # the two across it, and its own
CHAINS = ["a", "b", "c", "ac", "bc", "ca", "-c", "-ca", "-ab", "c-b", "ac-b"]


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("clockwise", [False, True])
def test_each_effect_is_the_derivative_of_exact_motions_of_the_whole_chain(chain: str, *, clockwise: bool) -> None:
    """Either way by one unit, the mean of both: what is left is of the third order in 1″."""
    there, random = points(chain, clockwise=clockwise), np.random.default_rng(2)
    seen = 0
    for name in OF_AXES:
        if EVERY[name].unfit(there) is None:
            values = random.normal(size=len(EVERY[name].coefficients))
            values /= np.abs(values).sum()
            exact = 0.5 * (by_rigid_motions(there, name, values) - by_rigid_motions(there, name, -values))
            np.testing.assert_allclose(shown(there, name, values)[SOME], exact, atol=1e-9, err_msg=name)
            assert np.abs(exact).max() > 1e-5
            seen += 1
    assert seen == 18 * len(chain.replace("-", ""))


@pytest.mark.parametrize("chain", CHAINS)
def test_no_effect_is_what_placing_the_artefact_could_be(chain: str) -> None:
    """All effects of all axes together are independent of one another, and of every place and attitude of the artefact."""
    there = points(chain)
    names = [name for name in OF_AXES if EVERY[name].unfit(there) is None]
    whole = there
    for seed in range(14):  # so many angles that all coefficients can be told apart
        random = np.random.default_rng(seed)
        again = {name: random.uniform(-180, 180, 40) for name in there.columns if name.endswith("_deg")}
        own = {**there.columns, **again}
        whole = replace(
            whole, xyz=np.vstack([whole.xyz, ON_TABLE]), columns={n: np.append(whole.columns[n], own[n]) for n in own},
            measurement=np.arange(len(whole) + 40),
        )  # fmt: skip
    machine = whole.machine
    assert isinstance(machine, RotaryMachine)
    if machine.head:  # with styli of many lengths and directions
        styli = np.random.default_rng(5).uniform(-200, 200, (len(whole), 3))
        tips = replace(machine, stylus_mm=styli).tip(whole.columns)
        whole = replace(
            whole, columns=whole.columns | {f"tip_{a}_mm": tip for a, tip in zip("xyz", tips.T, strict=True)}
        )
    columns = []
    for name in names:
        basis = whole.on_artefact(EVERY[name].basis(whole))
        columns.append(basis.reshape(-1, basis.shape[2]))
    about = whole.xyz - whole.xyz.mean(axis=0)
    placing = np.hstack([np.tile(np.eye(3), (len(about), 1)), *(np.cross(u, about).reshape(-1, 1) for u in np.eye(3))])
    every = np.hstack([*columns, placing])
    every /= np.linalg.norm(every, axis=0)
    assert np.linalg.matrix_rank(every, tol=1e-6) == every.shape[1]


@pytest.mark.parametrize(("name", "part"), [("radial", 0), ("radial", 1), ("axial", 2), ("positioning", 2)])
def test_higher_orders_are_a_sum_of_waves_whose_size_is_their_rms(name: str, part: int) -> None:
    effect = EVERY[f"rotary_{name}_c_n"]
    names = [c.name for c in effect.coefficients]
    coefficients = np.zeros(len(names))
    for order, cosine, sine in ((3, 2.0, -1.0), (12, 0.5, 1.5)):
        unit = "arcsec" if name == "positioning" else "um"
        coefficients[names.index(f"cosine_{'xyz'[part]}_{order}_{unit}")] = cosine
        coefficients[names.index(f"sine_{'xyz'[part]}_{order}_{unit}")] = sine

    one = by_rigid_motions(points("c"), effect.name, coefficients)
    other = by_rigid_motions(points("c"), effect.name, -coefficients)
    np.testing.assert_allclose(shown(points("c"), effect.name, coefficients)[SOME], 0.5 * (one - other), atol=1e-8)
    ((size, value),) = effect.to_reported(coefficients, np.zeros(0)).items()
    parts = 2 if name == "radial" else 1
    assert value == pytest.approx(np.sqrt(0.5 * (4 + 1 + 0.25 + 2.25) / parts), rel=1e-9)
    exact, _ = effect.from_reported({size: 2.5, "seed": 3})
    assert effect.to_reported(exact, np.zeros(0))[size] == pytest.approx(2.5, rel=1e-9)
    assert [c.prior_sd * k for c, k in zip(effect.coefficients[::2], range(3, 13), strict=False)] == pytest.approx(
        [3 * effect.coefficients[0].prior_sd] * 10
    )


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


@pytest.mark.parametrize("name", OF_AXES)
def test_an_effect_of_an_axis_asks_for_that_axis(name: str) -> None:
    letter, head = name.split("_")[2], name.startswith("head")
    there = points(f"-{letter}" if head else letter)
    assert EVERY[name].unfit(there) is None
    assert f"{letter}_deg" in EVERY[name].columns
    what, mark = ("head's axis", "-") if head else ("rotary table", "|")
    for machine in (
        Machine("m"),
        points(letter if head else f"-{letter}").machine,
        points("cab"["abc".index(letter)]).machine,
    ):
        other = replace(there, machine=machine)
        with pytest.raises(CmmUqError, match=rf"of a {what} {letter.upper()}.*XYZ{re.escape(mark)}{letter.upper()}"):
            EVERY[name].basis(other)
        assert str(EVERY[name].unfit(other)).startswith(f"job.toml [machine] chain: {name} is of a {what}")
