"""What tests of several rooms need."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.points import Machine, Points
from tests.recordings import TRAVEL, bars

ROOT = Path(__file__).parents[1]


def pytest_configure(config: pytest.Config) -> None:
    """Workers of one run share what takes long to make: see tests/kinds/simulated.py."""
    if hasattr(config, "workerinput"):
        os.environ["CMM_UQ_TESTS_SHARE"] = str(Path(config.option.basetemp).parent)


@pytest.fixture
def iota() -> Path:
    """The example job of a real recording."""
    return ROOT / "examples" / "iota-1102-20C"


@pytest.fixture
def job(iota: Path, tmp_path: Path) -> Path:
    """A copy of that job to spoil."""
    return Path(shutil.copytree(iota, tmp_path / "job"))


@pytest.fixture
def machine() -> Machine:
    return Machine("test machine", "XYZ", TRAVEL)


@pytest.fixture
def ballbar_points(machine: Machine) -> Points:
    """A bar of 400 mm in forty random places of the machine, without any error."""
    return bars(np.random.default_rng(20), 40, 400.0, machine)
