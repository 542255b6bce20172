"""The model that all contenders evaluate: a length by interferometer in air by Ciddor's equation, at 20 °C; ten inputs.

Written once as a function of whatever numbers and functions a package brings, once as an expression for packages that
parse text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

INPUTS: Mapping[str, tuple[float, float]] = {
    "v": (400.0, 1e-5),  # counted in vacuum wavelengths, mm
    "dead": (100.0, 1.0),  # dead path, mm
    "n0": (2.7137e-4, 1e-8),  # refractivity when zeroed
    "th": (1e-4, 3e-5),  # angle, rad
    "tm": (20.5, 0.05),  # material, °C
    "al": (11.5e-6, 1e-6),  # 1/K
    "t": (20.0, 0.05),  # air, °C
    "p": (101325.0, 15.0),  # Pa
    "h": (50.0, 2.0),  # %
    "c": (450.0, 30.0),  # ppm CO2
}
NAMES = list(INPUTS)
WAVELENGTH_NM = 632.9908
SIGMA2 = 1e6 / WAVELENGTH_NM**2

STEPS = f"""
T = t + 273.15
om = T - 0.238555575678/(T - 650.175348448)
a = om*om + 1167.05214528*om - 724213.167032
b = -17.0738469401*om*om + 12020.8247025*om - 3232555.03223
cc = 14.9151086135*om*om - 4823.26573616*om + 405113.405421
x = -b + sqrt(b*b - 4*a*cc)
q = 2*cc/x
xw = (1.00062 + 3.14e-8*p + 5.6e-7*t*t)*0.01*h*1e6*q*q*q*q/p
ras = {1e-8 * (5792105.0 / (238.0185 - SIGMA2) + 167917.0 / (57.362 - SIGMA2))!r}*(1 + 5.34e-7*(c - 450))
rvs = {1.022e-8 * (295.235 + 2.6422 * SIGMA2 - 0.03238 * SIGMA2**2 + 0.004028 * SIGMA2**3)!r}
pt = p/T
z = 1 - pt*(1.58123e-6 - 2.9331e-8*t + 1.1043e-10*t*t + (5.707e-6 - 2.051e-8*t)*xw + (1.9898e-4 - 2.376e-6*t)*xw*xw) \
+ pt*pt*(1.83e-11 - 0.765e-8*xw*xw)
da = pt*(1 - xw)/(z*8.314472)
dv = pt*xw*0.018015/(z*8.314472)
n1 = da/{101325.0 / (0.9995922115 * 8.314472 * 288.15)!r}*ras + dv/0.00985938*rvs
len = (v - dead*(n1 - n0))/((1 + n1)*cos(th)*(1 + al*(tm - 20)))
""".strip()


def _steps() -> list[tuple[str, str]]:
    return [(name.strip(), text.strip()) for name, text in (line.split("=", 1) for line in STEPS.splitlines())]


def expression() -> str:
    """The whole model as one expression of the inputs."""
    from ast import Name, NodeTransformer, parse, unparse

    known: dict[str, Any] = {}

    class Substitute(NodeTransformer):
        def visit_Name(self, node: Name) -> Any:
            return known.get(node.id, node)

    for name, text in _steps():
        known[name] = Substitute().visit(parse(text, mode="eval").body)
    return unparse(known["len"])


def statements() -> str:
    """The model as a list of statements, in the language of OpenTURNS."""
    return "; ".join(f"var {name}_ := {_suffixed(text)}" for name, text in _steps()).replace("var len_", "length")


def _suffixed(text: str) -> str:
    """Names of intermediate quantities get a mark of their own (two of them are words of that language)."""
    known = {name for name, _ in _steps()}
    return re.sub(r"\b[A-Za-z]\w*\b", lambda m: m[0] + "_" if m[0] in known else m[0], text)


def model(functions: Mapping[str, Callable[..., Any]]) -> Callable[..., Any]:
    """The model as a function of the inputs in order, with the given sqrt and cos."""
    body = "\n    ".join(f"{name} = {text}" for name, text in _steps())
    scope: dict[str, Any] = dict(functions)
    exec(f"def length({', '.join(NAMES)}):\n    {body}\n    return len", scope)
    return scope["length"]


def points(n: int) -> tuple[list[np.ndarray], list[float]]:
    """First n of 10,000 different estimates of every input, and the standard uncertainties."""
    rng, whole = np.random.default_rng(1), 10_000
    spread = {"v": 50.0, "dead": 10.0, "tm": 0.5, "t": 0.5, "p": 300.0, "h": 5.0}
    estimates = [mean + spread.get(name, 0.0) * rng.uniform(-1, 1, whole)[:n] for name, (mean, _) in INPUTS.items()]
    return estimates, [u for _, u in INPUTS.values()]
