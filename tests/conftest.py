"""What tests of several rooms need."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.points import Machine, Points
from tests.recordings import TRAVEL, bars

ROOT = Path(__file__).parents[1]
EXAMPLES = frozenset(path.name for path in (ROOT / "examples").iterdir())


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of one example go to one process, which analyses it once for all of them (``--dist loadgroup``)."""
    for item in items:
        parameters = (
            item.callspec.params.values() if isinstance(item, pytest.Function) and hasattr(item, "callspec") else ()
        )
        for name in {value for value in parameters if isinstance(value, str)} & EXAMPLES:
            item.add_marker(pytest.mark.xdist_group(name))


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
