"""What the certificate of a probed sphere states beside the estimates: form and size of each, and where its points lie."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.sphere.observe import Sphere
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.result import Result


def deviations_um(sphere: Sphere) -> Floats:
    """(n,) distance of each point from its best centre minus the certified or mean radius, µm."""
    radius = sphere.sizes[0].nominal * sphere.per_size * sphere.expansion
    return np.asarray((sphere.distances(sphere.points.xyz, None) - radius) / MICROMETRE, dtype=np.float64)


def about_centre(sphere: Sphere) -> Floats:
    """(n, 3) places of the points about their centres, on the sphere of the nominal size, mm."""
    return np.asarray(
        sphere.size_change() * sphere.sizes[0].nominal * sphere.directions(sphere.points.xyz), dtype=np.float64
    )


def results(result: Result) -> dict[str, Any]:
    """Form and size errors for results.json."""
    sphere = cast("Sphere", result.artefact)
    probed, certified = sphere.probed(), sphere.sizes[0].certified
    return {
        "spheres": [
            {"measurement": int(measurement), "repeat": int(repeat), "points": int(count), "form_error_um": form,
             "size_error_um": size if certified else None}
            for measurement, repeat, count, form, size in zip(
                probed.measurement, probed.repeat, probed.count, (probed.form / MICROMETRE).tolist(),
                (probed.size / MICROMETRE).tolist(), strict=True,
            )
        ]
    }  # fmt: skip
