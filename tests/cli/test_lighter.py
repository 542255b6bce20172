"""Libraries come without what the command never uses: loaded when it is used, and computing and drawing the same."""

import re
import subprocess
import sys

COMMAND = """
import sys
from cmm_uq.cli.lighter import lighten
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
from cmm_uq.cli.lighter import lighten
lighten()
import scipy.interpolate, scipy.optimize, scipy.signal, scipy.sparse, scipy.spatial, scipy.stats
assert round(scipy.stats.norm.cdf(1.96), 3) == 0.975
"""
    run = subprocess.run([sys.executable, "-c", command], capture_output=True, check=False, text=True)
    assert (run.returncode, run.stderr) == (0, "")


def _without_ids(svg: str) -> str:
    """Matplotlib salts the names of its clip paths."""
    return re.sub(r"[pm][0-9a-f]{10}", "", svg)
