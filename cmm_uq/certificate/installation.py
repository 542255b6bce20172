"""On what a certificate was computed: versions of packages, platform, and the kernels of linear algebra.

These decide over the last bits of a figure and nothing else, so they stand in the provenance alone: ``results.json`` is
the same on every machine.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

PACKAGES = ("emcee", "jinja2", "matplotlib", "numpy", "pandas", "pydantic", "scipy", "typst")
"""Those that a figure, or a page that shows it, rests on."""

_CORE = ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename")
"""What the library of linear algebra in the packages of NumPy calls the question for its kernels."""


@cache
def packages() -> dict[str, str]:
    """Versions, by name; without those that are not installed as packages."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def machine() -> dict[str, str]:
    """Python, operating system and processor by kind, library and kernels of linear algebra; nothing that names a machine."""
    import numpy as np

    told: Mapping[str, Any] = np.show_config(mode="dicts") or {}
    blas = told.get("Build Dependencies", {}).get("blas", {})
    return {
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": platform.system(),
        "processor": platform.machine(),
        "instructions": " ".join(sorted(map(str, told.get("SIMD Extensions", {}).get("found", ())))),
        "blas": " ".join(str(blas[key]) for key in ("name", "version") if blas.get(key)),
        "kernels": _kernels(),
    }


def _kernels() -> str:
    """For which processor the library of linear algebra chose its kernels; empty where it does not say."""
    import ctypes

    from numpy.linalg import _umath_linalg

    try:
        library = ctypes.CDLL(_umath_linalg.__file__)
    except OSError:
        return ""
    for name in _CORE:
        if (asked := getattr(library, name, None)) is not None:
            asked.restype = ctypes.c_char_p
            return (asked() or b"").decode("ascii", "replace")
    return ""
