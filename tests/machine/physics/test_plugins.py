"""Effects of other packages: by name, imported when needed, and refused in words where they cannot be used."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import unit
from cmm_uq.machine.physics import catalogue
from cmm_uq.machine.physics.catalogue import EVERY, effects, every, plugins, register
from cmm_uq.machine.physics.effect import Effect, Parameter
from tests.plugin.packages import OUTSIDE_EFFECTS, describe, install
from tests.recordings import TRAVEL, bars

MACHINE = Machine("m", "XYZ", TRAVEL)
POINTS = bars(np.random.default_rng(3), 20, 300.0, MACHINE)

WORDS = 'title = formula = mechanism = points_to = "said"'
EFFECT = """
import numpy as np
from cmm_uq.machine.physics.effect import Effect, Parameter
class Made(Effect):
    name = "made_up"
    {words}
    coefficients = (Parameter("um", "µm", 1.0),)
    def basis(self, points, shape=()):
        {body}
"""
Offer = Callable[..., None]


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that packages are looked for in; what is imported from it is forgotten afterwards."""
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("outside_effects", "other", "another"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


@pytest.fixture
def offer(site: Path) -> Offer:
    def offered(code: str, name: str = "made_up", package: str = "other", where: str | None = None) -> None:
        (site / f"{package}.py").write_text(code, encoding="utf-8")
        describe(site, f"{package}-effects", "2.1", {"cmm_uq.effects": {name: where or f"{package}:Made"}})

    return offered


def made(body: str = "return np.zeros((len(points), 3, 1))", words: str = WORDS) -> str:
    return EFFECT.format(body=body, words=words)


def test_without_other_packages_there_are_the_built_in_effects() -> None:
    assert dict(every()) == dict(EVERY)
    assert plugins() == {}


def test_an_outside_effect_stands_in_the_catalogue_behind_the_others(site: Path) -> None:
    install(OUTSIDE_EFFECTS, site)
    assert list(every()) == [*EVERY, "beam_twist"]
    assert plugins() == {"outside-effects": "0.1.0"}


def test_an_outside_effect_moves_points_as_its_own_code_says(site: Path) -> None:
    """10″ in the middle of Y turn the ram about Y: x moves by z · 10″, and nothing at the ends."""
    install(OUTSIDE_EFFECTS, site)
    _, y, z = POINTS.carriages.T
    e = effects(["beam_twist"])[0].displacement(POINTS, {"twist_arcsec": 10.0})
    expected = z * np.radians(10 / 3600) * (1 - ((y - 275) / 275) ** 2)
    np.testing.assert_allclose(e, np.column_stack([expected, 0 * y, 0 * y]), atol=1e-15)


def test_a_package_is_imported_when_its_effect_is_named(site: Path) -> None:
    install(OUTSIDE_EFFECTS, site)
    effects(["scale_x", "thermal_scale_y"])
    assert "outside_effects" not in sys.modules
    effects(["beam_twist"])
    assert "outside_effects" in sys.modules


def test_a_name_that_is_nearly_that_of_an_outside_effect_is_answered_with_it(site: Path) -> None:
    install(OUTSIDE_EFFECTS, site)
    with pytest.raises(CmmUqError, match=r"unknown effect 'beam_twst'.*'beam_twist'"):
        effects(["beam_twst"])


def test_the_name_of_a_built_in_effect_is_refused_with_both_packages(offer: Offer) -> None:
    offer(made(), name="scale_x")
    with pytest.raises(CmmUqError, match="'scale_x' comes from cmm-uq and from other-effects"):
        effects(["squareness_xy"])


def test_two_packages_with_one_name_are_refused_with_both(offer: Offer) -> None:
    offer(made())
    offer(made(), package="another")
    with pytest.raises(CmmUqError, match="'made_up' comes from another-effects and from other-effects"):
        every()


@pytest.mark.parametrize(("code", "where", "said"), [
    ("import nowhere", None, "ModuleNotFoundError: No module named 'nowhere'"),
    ("Made = 1 / 0", None, "ZeroDivisionError"),
    (made(), "other:Missing", "AttributeError"),
    ("Made = 3", None, "is no Effect but int"),
    (made().replace("made_up", "made_down"), None, "calls itself 'made_down'"),
    (made(words='title = formula = mechanism = "said"'), None, "says no points_to"),
    (made(words='title = formula = mechanism = "said"; points_to = ""'), None, "says no points_to"),
    ("from cmm_uq.machine.physics.effect import Effect\nclass Made(Effect):\n    name = 'made_up'", None, "TypeError"),
])  # fmt: skip
def test_a_broken_package_is_named_with_its_effect(offer: Offer, code: str, where: str | None, said: str) -> None:
    offer(code, where=where)
    with pytest.raises(
        BrokenPluginError, match=r"package other-effects 2\.1: the effect 'made_up'.*uninstall"
    ) as refused:
        every()
    assert said in str(refused.value)


@pytest.mark.parametrize(("body", "said"), [
    ("return points.nothing", "AttributeError"),
    ("return np.zeros((len(points), 3))", r"\(40, 3, 1\)"),
    ("return np.zeros((len(points), 3, 2))", r"\(40, 3, 1\)"),
    ("return np.full((len(points), 3, 1), np.nan)", "finite"),
    ("return None", "float64"),
])  # fmt: skip
def test_an_effect_that_fails_at_work_is_named_with_its_package(offer: Offer, body: str, said: str) -> None:
    offer(made(body))
    effect = every()["made_up"]
    with pytest.raises(BrokenPluginError, match=rf"other-effects 2\.1: the effect 'made_up' .*{said}"):
        effect.basis(POINTS)


def test_what_the_user_has_to_give_is_no_fault_of_the_package(offer: Offer) -> None:
    offer(made("return points.column('nothing')[:, None, None]"))
    with pytest.raises(CmmUqError, match="no column 'nothing'") as refused:
        every()["made_up"].basis(POINTS)
    assert not isinstance(refused.value, BrokenPluginError)


def test_an_instance_serves_as_well_as_a_class(offer: Offer) -> None:
    offer(made() + "\nINSTANCE = Made()", where="other:INSTANCE")
    assert every()["made_up"].title == "said"


class Bulge(Effect):
    """A quarter of a millionth of x² along z."""

    name = "bulge"
    title, points_to = Verbatim("Bulge"), Verbatim("its middle")
    formula, mechanism = "e_z = b·x²", "frame"
    coefficients = (Parameter("um_per_m2", unit("µm/m²"), 4.0),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return np.asarray(1e-9 * points.readings["x"][:, None, None] ** 2 * np.array([[0.0], [0.0], [1.0]]))


@pytest.fixture
def none_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "_REGISTERED", {})


@pytest.mark.usefixtures("none_registered")
def test_a_class_is_registered_without_a_package_and_named_with_where_it_comes_from() -> None:
    assert register(Bulge) is Bulge
    register(Bulge)  # as a cell of a notebook that is run again does
    assert list(every()) == [*EVERY, "bulge"]
    assert plugins() == plugins(["bulge"]) == {__name__: "(registered)"}
    assert plugins(["scale_x"]) == {}
    (found,) = effects(["bulge"])
    x = POINTS.carriages[:, 0]
    np.testing.assert_allclose(found.displacement(POINTS, {"um_per_m2": 3.0})[:, 2], 3e-9 * x**2, rtol=1e-14)


@pytest.mark.usefixtures("none_registered")
@pytest.mark.parametrize(("wrong", "said"), [
    (3, "is no Effect but int"), (dict, "is no Effect but dict"), (type("Bare", (Bulge,), {"name": ""}), "has no name"),
    (type("Silent", (Bulge,), {"points_to": ""}), "says no points_to"),
    (type("Asking", (Bulge,), {"__init__": lambda self, axis: None}), "fails with TypeError"),
    (type("Known", (Bulge,), {"name": "scale_x"}), "there is a 'scale_x' already"),
    (type("Again", (Bulge,), {}), "there is a 'bulge' already"),
])  # fmt: skip
def test_what_cannot_be_registered_is_refused_as_a_package_s_would_be(wrong: Any, said: str) -> None:
    register(Bulge())
    with pytest.raises(CmmUqError, match=said):
        register(wrong)
    assert list(every()) == [*EVERY, "bulge"]


@pytest.mark.usefixtures("none_registered")
def test_a_registered_effect_that_fails_at_work_is_named_with_where_it_comes_from() -> None:
    register(type("Failing", (Bulge,), {"basis": lambda *_: np.zeros(3), "__module__": __name__}))
    with pytest.raises(
        BrokenPluginError, match=rf"registered by {__name__}: the effect 'Failing' gives a basis .*class"
    ):
        every()["bulge"].basis(POINTS)
