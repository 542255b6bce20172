"""Features of measured points: line, plane, circle, sphere, cylinder and cone.

The fits minimise the sum of squared orthogonal distances, as ISO 10360-6 tests it, and return the feature with its
full covariance, its residuals and its form deviation. :func:`associate` asks for a feature as drawings do, by minimum zone,
inscribed, circumscribed or tangent too; :class:`Repeated` does least squares and minimum zones of many measurements at
the same nominal points at once. This room knows points and nothing of machines.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cmm_uq.maths.geometry.association import Associated, Association, associate
    from cmm_uq.maths.geometry.axial import Cone, Cylinder, fit_cone, fit_cylinder
    from cmm_uq.maths.geometry.feature import BallForm, Feature, cap_directions
    from cmm_uq.maths.geometry.fits import Circle, Line, Plane, Sphere, fit_circle, fit_line, fit_plane, fit_sphere
    from cmm_uq.maths.geometry.placed import FeatureKind
    from cmm_uq.maths.geometry.repeated import Drawn, Repeated

__all__ = [
    "Associated", "Association", "BallForm", "Circle", "Cone", "Cylinder", "Drawn", "Feature", "FeatureKind", "Line",
    "Plane", "Repeated", "Sphere", "associate", "cap_directions", "fit_circle", "fit_cone", "fit_cylinder", "fit_line",
    "fit_plane", "fit_sphere",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Loaded when it is first used: whoever needs a rotation needs no fit of a cone."""
    # each imports none but those before it
    for place in ("feature", "fits", "axial", "placed", "association", "repeated") if name in __all__ else ():
        module = import_module(f"{__name__}.{place}")
        if hasattr(module, name):
            globals()[name] = found = getattr(module, name)
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
