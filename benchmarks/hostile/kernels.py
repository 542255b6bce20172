"""The same certificate on other BLAS kernels: ``python -m benchmarks.hostile.kernels``.

OpenBLAS takes another kernel when ``OPENBLAS_CORETYPE`` names one. Figures in closed form must then agree to what is printed,
and sampled ones within a tenth of their u; the same kernel gives the same bytes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from benchmarks.hostile.processes import PROGRAM, environment

EXAMPLES = ("gauge-blocks-simulated", "iota-1102-20C")
KERNELS = ("Prescott", "Nehalem", "Sandybridge", "Haswell", "SkylakeX", "Cooperlake", "Zen")
RELATIVE = 1e-9
"""Agreement of closed forms: far below the last digit of any printed figure."""
SAMPLED = (
    ".estimates", ".noise", ".accuracy_uncertainty", ".artefact", ".adjustments", ".differences", ".tolerances", ".over_range",
    ".regions.recorded",
)  # fmt: skip
"""What follows from a posterior whose noise is sampled."""
WITHOUT_NOISE = "without_noise"
"""In the name of a figure of the machine by draws of the field, beside the one that is decided."""
SPREADS = (
    ".u_um", ".guard_band_um", ".prior_share", ".probability_conforming", ".covariance.", ".lengths.", ".length_budget.",
    ".posterior.", ".k", ".regions.",
)  # fmt: skip
"""Standard deviations and variances of the draws, and what follows from them."""
OF_SPREAD = 0.04
"""How far those may move: three standard errors of a variance, √(2/N), of N = 13 000 effective draws."""
UNSEEN, OF_UNSEEN = ".diagnosis.unseen", 1e-3
"""Smallest errors that would have shown, and how far they may move: among trials that are alike but for rounding one is taken;
they are stated as good to 15 %."""
OF_U = 0.1
"""Part of its u by which a sampled figure may move."""
ASK = """
import ctypes, pathlib
import scipy.linalg
import numpy.linalg, scipy.linalg.cython_blas
matrix = numpy.add.outer(numpy.arange(300.0), numpy.ones(300)) + 300 * numpy.eye(300)
numpy.linalg.svd(matrix @ matrix), scipy.linalg.cho_factor(matrix @ matrix.T), scipy.linalg.qr(matrix)
lines = pathlib.Path("/proc/self/maps").read_text().splitlines()
for path in sorted({line.split()[-1] for line in lines if "openblas" in line}):
    library = ctypes.CDLL(path)
    for name in ("scipy_openblas", "openblas"):
        for bits in ("64_", ""):
            ask = getattr(library, f"{name}_get_corename{bits}", None)
            if ask:
                ask.restype = ctypes.c_char_p
                print(ask().decode())
"""
"""Names the kernel of every OpenBLAS that numpy and scipy load; a processor that lacks its instructions ends this first."""


def honoured(kernel: str) -> bool:
    """Whether every OpenBLAS loaded, numpy's and scipy's own, computes with this kernel when asked to."""
    asked = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, check=False,
                           env=environment({"OPENBLAS_CORETYPE": kernel}))  # fmt: skip
    return bool(asked.stdout.split()) and {name.lower() for name in asked.stdout.split()} == {kernel.lower()}


def kernels() -> list[str]:
    """The kernels that this processor and these libraries can be told to use."""
    return [kernel for kernel in KERNELS if honoured(kernel)]


def reported(example: str, kernel: str, folder: Path) -> bytes:
    """``results.json`` of an example's report, computed with a kernel."""
    root = Path(__file__).parents[2]
    subprocess.run([*PROGRAM, "report", str(root / "examples" / example), "--out", str(folder), "--quiet"], check=True,
                   env=environment({"OPENBLAS_CORETYPE": kernel}))  # fmt: skip
    return (folder / "results.json").read_bytes()


def differences(one: object, other: object, where: str = "") -> Iterator[str]:
    """Where two results disagree by more than their kind allows."""
    if isinstance(one, Mapping) and isinstance(other, Mapping) and one.keys() == other.keys():
        u = one.get("u") if where.startswith(SAMPLED) or WITHOUT_NOISE in where else None
        for key in one:
            if isinstance(u, float) and key != "k":
                yield from _sampled(one[key], other[key], u, f"{where}.{key}")
            else:
                yield from differences(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for i, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{where}[{i}]")
    elif isinstance(one, float) and isinstance(other, float):
        part = OF_UNSEEN if where.startswith(UNSEEN) else OF_SPREAD if any(name in where for name in SPREADS) else None
        if abs(one - other) > (RELATIVE * max(1.0, abs(one)) if part is None else part * abs(one)):
            yield f"{where}: {one!r} and {other!r}"
    elif one != other and where != ".posterior.sha256":  # the draws themselves are not the same bytes
        yield f"{where}: {one!r} and {other!r}"


def _sampled(one: object, other: object, u: float, where: str) -> Iterator[str]:
    """A value, its u or the ends of its interval, each within a tenth of u."""
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for pair in zip(one, other, strict=True):
            yield from _sampled(*pair, u, where)
    elif isinstance(one, float) and isinstance(other, float):
        if abs(one - other) > OF_U * u:
            yield f"{where}: {one!r} and {other!r}, u = {u!r}"
    elif one != other:
        yield f"{where}: {one!r} and {other!r}"


def compared(example: str, kernel: str, others: Sequence[str], folder: Path) -> Iterator[tuple[str, bool, list[str]]]:
    """The report of an example by one kernel, twice, and by others: kernel, whether the bytes are the same, what differs."""
    first = reported(example, kernel, folder / "first")
    for name in (kernel, *others):
        again = reported(example, name, folder / name)
        yield name, again == first, list(differences(json.loads(first), json.loads(again)))


def main() -> None:
    *others, kernel = kernels()
    print(f"kernels: {kernel}, against {', '.join(others)}")
    with tempfile.TemporaryDirectory() as place:
        for example in EXAMPLES:
            for name, same, listed in compared(example, kernel, others, Path(place) / example):
                print(
                    f"{example}, {name}: {'same' if same else 'other'} bytes, {len(listed)} differ by more than allowed"
                )
                for line in listed[:20]:
                    print(f"  {line}")


if __name__ == "__main__":
    main()
