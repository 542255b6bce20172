"""Libraries come without what the command never uses: loaded when it is used, and computing and drawing the same."""

import re
import subprocess
import sys

COMMAND = """
import sys
from cmm_uq.app.cli.lighter import lighten
lighten()
import matplotlib.projections, numpy, emcee, scipy.linalg, scipy.special
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
assert not {"numpy.f2py.crackfortran", "numpy.testing._private", "h5py.h5", "fontTools.misc.textTools"} & {*sys.modules}
assert not {"scipy.stats", "mpl_toolkits.mplot3d.axes3d"} & {*sys.modules}
assert "polar" in matplotlib.projections.get_projection_names()
assert scipy.special.ndtri(0.975).round(4) == 1.96
assert scipy.linalg.expm([[0.0, 1.0], [0.0, 0.0]]).tolist() == [[1, 1], [0, 1]]
figure = Figure()
FigureCanvasSVG(figure)
line, = figure.subplots().plot([0, 1], [0, 1])
figure.savefig(sys.stdout.buffer, format="svg", metadata={"Date": None})
numpy.testing.assert_allclose(1.0, 1.0)
assert numpy.f2py.get_include()
assert {"numpy.f2py.crackfortran", "numpy.testing._private"} <= {*sys.modules}
"""


def test_what_is_not_used_is_not_loaded_until_it_is_and_nothing_else_changes() -> None:
    run = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, check=False, text=True)
    assert not run.stderr
    assert run.returncode == 0
    plain = COMMAND.replace("lighten()\n", "\n", 1).splitlines()
    drawn = subprocess.run(
        [sys.executable, "-c", "\n".join(line for line in plain if not line.startswith("assert"))],
        capture_output=True, check=True, text=True,
    )  # fmt: skip
    assert _without_ids(run.stdout) == _without_ids(drawn.stdout)
    assert run.stdout.count("<path") > 10


def test_all_of_scipy_that_is_needed_later_can_still_be_loaded() -> None:
    command = """
from cmm_uq.app.cli.lighter import lighten
lighten()
import scipy.interpolate, scipy.optimize, scipy.signal, scipy.sparse, scipy.spatial, scipy.stats
assert round(scipy.stats.norm.cdf(1.96), 3) == 0.975
"""
    run = subprocess.run([sys.executable, "-c", command], capture_output=True, check=False, text=True)
    assert (run.returncode, run.stderr) == (0, "")


def test_what_dataclasses_can_do_is_the_same_though_it_is_compiled_when_it_is_asked_for() -> None:
    """Of a class of this package, all of which is compiled later, and of another's; inherited, frozen, ordered, with slots."""
    command = """
import inspect
from cmm_uq.app.cli.lighter import lighten
lighten()
from dataclasses import FrozenInstanceError, dataclass, field, replace
for where in ("cmm_uq.outside", "outside"):
    __name__ = where

    @dataclass(frozen=True, order=True)
    class Point:
        x: float
        y: float = field(default=0.0, repr=False)

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Named(Point):
        name: str

        def __post_init__(self):
            assert self.name

    a, b = Point(1.0), Named(x=1.0, y=2.0, name="b")
    assert repr(a).endswith("Point(x=1.0)"), repr(a)
    assert a == Point(1.0, 0.0) != b and Point(1.0) < Point(1.0, 3.0) and hash(a) == hash(Point(1.0))
    assert (replace(b, name="c").name, b.name, {a: 1}[Point(1.0)]) == ("c", "b", 1)
    for change in (lambda: setattr(a, "x", 2.0), lambda: delattr(a, "x")):
        try:
            change()
        except FrozenInstanceError:
            continue
        raise AssertionError
    for wrong in (lambda: Point(), lambda: Point(1.0, z=2.0), lambda: Named(1.0, 2.0, "b")):
        try:
            wrong()
        except TypeError:
            continue
        raise AssertionError
assert list(inspect.signature(Point).parameters) == ["x", "y"]
"""
    run = subprocess.run([sys.executable, "-c", command], capture_output=True, check=False, text=True)
    assert (run.returncode, run.stderr) == (0, "")


def test_docstrings_of_scipy_that_are_asked_for_are_taken_apart() -> None:
    command = """
from cmm_uq.app.cli.lighter import lighten
lighten()
import scipy.linalg, scipy.stats
from scipy._lib._docscrape import FunctionDoc
assert "Compute the inverse of a matrix" in scipy.linalg.inv.__doc__
doc = FunctionDoc(scipy.linalg.inv)
doc["Notes"].append("left out")
assert [one.name for one in doc["Parameters"]][:1] == ["a"]
doc["Notes"] = ["taken in"]
assert "taken in" in str(doc) and "left out" not in str(doc)
assert "nan_policy" in scipy.stats.skew.__doc__
"""
    run = subprocess.run([sys.executable, "-c", command], capture_output=True, check=False, text=True)
    assert (run.returncode, run.stderr) == (0, "")


def _without_ids(svg: str) -> str:
    """Matplotlib salts the names of its clip paths."""
    return re.sub(r"[pm][0-9a-f]{10}", "", svg)
