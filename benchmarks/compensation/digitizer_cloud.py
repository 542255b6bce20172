"""Whole chain of a digitizer (Harris 2004 eq. 35) on a cloud, beside plain NumPy and SciPy in one run, one core.

Run:  OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python benchmarks/compensation/digitizer_cloud.py [1e8]
The number is how many points to stream from disk to disk.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.digitizer import Digitizer, euler_313
from cmm_uq.machine.physics.error_map import ErrorMap, read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from cmm_uq.machine.physics.point_cloud import transform_cloud

MAPS = Path(__file__).parents[2] / "tests/machine/physics/harris2004"
OFFSET = np.array([1.001, 264.505, 129.575])
ATTITUDE = euler_313(np.pi / 2, np.pi / 2, -np.pi / 3)
N = 1_000_000


def published(temperature: int) -> ErrorMap:
    found = read_error_map(MAPS / f"error_map_{temperature}C.csv", temperature=temperature)
    return found.with_squareness_arcsec(-173, -19, 21)


def cloud(n: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform([-30, -30, 0, 0, -500], [30, 30, 900, 550, 0], (n, 5))


def chain_35(rows: np.ndarray, errors: np.ndarray, squareness: np.ndarray) -> np.ndarray:
    """Equations 11–13 and 29–35 on whole arrays, the axes at their exact angles; errors (n, 3, 6)."""
    D = rows[:, 2:]
    d, r = errors[:, :, :3].sum(axis=1), errors[:, :, 3:]
    y, z = D[:, 1], D[:, 2]
    xy, yz, zx = -np.sin(squareness)
    lean = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]])) - np.eye(3)
    along_y, along_z = np.outer(y + errors[:, 1, 1], lean[1]), np.outer(z + errors[:, 2, 2], lean[2])
    squareness_part = along_y + np.cross(r[:, 0], along_y) + along_z + np.cross(r[:, 0] + r[:, 1], along_z)
    e = np.column_stack(
        [
            d[:, 0] - y * r[:, 0, 2] + z * (r[:, 0, 1] + r[:, 1, 1]),
            d[:, 1] - z * (r[:, 0, 0] + r[:, 1, 0]),
            d[:, 2] + y * r[:, 0, 0],
        ]
    )
    tx, ty, tz = np.tan(r.sum(axis=1)).T
    Z = np.column_stack([ty, -tx, np.ones_like(tx)])
    Z /= np.linalg.norm(Z, axis=1)[:, None]
    X = np.column_stack([np.ones_like(tx), tz, tx * tz - ty])
    X /= np.linalg.norm(X, axis=1)[:, None]
    A = np.stack([X, np.cross(Z, X), Z], axis=2)
    q = (np.column_stack([rows[:, :2], np.zeros(len(rows))]) - OFFSET) @ ATTITUDE.T
    return np.einsum("nij,nj->ni", A, q) + D + e + squareness_part


def numpy_chain(rows: np.ndarray, error_map: ErrorMap) -> np.ndarray:
    errors = np.stack(
        [
            np.stack([np.interp(rows[:, 2 + i], c.positions, column) for column in c.errors.T], axis=1)
            for i, c in enumerate(error_map.axes)
        ],
        axis=1,
    )
    return chain_35(rows, errors, error_map.squareness)


def scipy_chain(rows: np.ndarray, error_map: ErrorMap) -> np.ndarray:
    splines = [make_interp_spline(c.positions, c.errors, k=1) for c in error_map.axes]
    return chain_35(rows, np.stack([s(rows[:, 2 + i]) for i, s in enumerate(splines)], axis=1), error_map.squareness)


def measured(run: Callable[[], np.ndarray]) -> tuple[float, float, np.ndarray]:
    """Million points per second, peak bytes per point beside the input, and the result."""
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        result = run()
        times.append(time.perf_counter() - begin)
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return N / np.median(times) / 1e6, peak / N, result


def main() -> None:
    one, several = ErrorMaps([published(20)]), ErrorMaps([published(t) for t in (20, 25, 30)])
    digitizer = Digitizer(ATTITUDE, OFFSET, Compensation(one))
    warmer = Digitizer(ATTITUDE, OFFSET, Compensation(several))
    if len(sys.argv) > 1:  # first, while the process is small
        stream(int(float(sys.argv[1])), digitizer)
    rows = cloud(N)
    each = np.random.default_rng(2).uniform(20, 30, (N, 3))
    runs: dict[str, Callable[[], np.ndarray]] = {
        "cmm_uq, one map": lambda: digitizer.coordinates(rows[:, :2], rows[:, 2:])[0],
        "cmm_uq, three maps, one temperature a scale": lambda: warmer.coordinates(
            rows[:, :2], rows[:, 2:], np.array([22.0, 22.4, 23.0])
        )[0],
        "cmm_uq, three maps, every point its own": lambda: warmer.coordinates(rows[:, :2], rows[:, 2:], each)[0],
        "NumPy, np.interp, whole arrays": lambda: numpy_chain(rows, one.maps[0]),
        "SciPy, make_interp_spline, whole arrays": lambda: scipy_chain(rows, one.maps[0]),
    }
    print(f"{N} points, input 40 bytes a point")
    reference = numpy_chain(rows, one.maps[0])
    for name, run in runs.items():
        rate, peak, result = measured(run)
        gap = "" if "three" in name else f"   differs from NumPy by {np.abs(result - reference).max():.0e} mm"
        print(f"  {name:45s} {rate:6.2f} million points/s   {peak:6.0f} bytes/point{gap}")


def stream(n: int, digitizer: Digitizer) -> None:
    with tempfile.TemporaryDirectory() as folder:
        chunks = Path(folder) / "cloud"
        chunks.mkdir()
        rows = cloud(min(n, 1_000_000))
        for i in range(-(-n // len(rows))):
            np.save(chunks / f"{i:04}.npy", rows[: n - i * len(rows)])
        del rows
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        begin = time.perf_counter()
        count = transform_cloud(chunks, Path(folder) / "xyz.npy", digitizer.transform())
        seconds = time.perf_counter() - begin
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print(f"from disk to disk: {count} points in {seconds:.0f} s, {count / seconds / 1e6:.1f} million points/s")
        print(f"  peak memory of the process before {before / 1024:.0f} MB, after {after / 1024:.0f} MB")


if __name__ == "__main__":
    main()
