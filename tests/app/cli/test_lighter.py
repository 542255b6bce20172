"""The sampler comes without what the command never uses, and all of scipy can still be loaded."""

import subprocess
import sys

COMMAND = """
import sys
from cmm_uq.app.cli import lighten
lighten()
import emcee
assert "scipy.stats" not in sys.modules
sampler = emcee.EnsembleSampler(4, 1, lambda x: -0.5 * x @ x)
sampler.run_mcmc([[0.1], [0.2], [0.3], [0.4]], 5)
import scipy.stats
assert round(scipy.stats.norm.cdf(1.96), 3) == 0.975
"""


def test_what_is_not_used_is_not_loaded_until_it_is() -> None:
    run = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, check=False, text=True)
    assert (run.returncode, run.stderr) == (0, "")
