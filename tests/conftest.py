"""What tests of several rooms need."""

from __future__ import annotations

import gc
import inspect
import os
import shutil
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import CodeType
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import settings

from cmm_uq.app.cli import NEW_OBJECTS
from cmm_uq.base.messages import NOTHING
from cmm_uq.base.points import Machine, Points
from tests.recordings import TRAVEL, bars

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROOT = Path(__file__).parents[1]
MACHINE_JOBS = sorted(
    path.parent for path in (ROOT / "examples").glob("*/job.toml") if not path.parent.name.startswith("part-")
)
"""Folders of the example jobs of machines; those of parts are another sort of job."""

settings.register_profile("same", derandomize=True, deadline=None)  # one commit gives one answer, on every machine
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="leave out what takes more than some two seconds a test")


def pytest_configure(config: pytest.Config) -> None:
    """Workers of one run share what takes long to make: see tests/artefacts/simulated.py."""
    os.environ["CMM_UQ_RECORDS"] = "none"  # what is tested of records names them
    os.environ["CMM_UQ_DATES"] = "none"
    gc.disable()  # nothing of what is collected goes again
    if hasattr(config, "workerinput"):
        os.environ["CMM_UQ_TESTS_SHARE"] = str(Path(config.option.basetemp).parent)


FIRST = (
    "artefacts/test_certificate_figures.py", "app/commands/test_verify_part.py", "app/commands/test_verify_part_machine.py",
    "app/commands/test_reissue.py", "artefacts/test_contract.py", "analysis/parts/test_zones.py", "site/test_site.py",
    "hostile/test_kills_and_collisions.py", "jobs/importing/test_unseen_exports.py", "app/commands/parts/test_part.py",
    "analysis/diagnosis/test_equivalence.py", "analysis/conformity/by_hand/test_by_hand.py", "artefacts/test_poses.py",
    "artefacts/test_five_axes.py", "app/desk/test_exports.py", "analysis/diagnosis/test_doubt.py",
    "analysis/conformity/test_grid.py", "app/cli/test_packages.py", "site/test_notebooks.py", "hostile/test_kernels.py",
    "hostile/test_every_command.py", "app/commands/test_planning.py", "app/commands/test_batch.py",
    "laboratory/schedule/test_cluster.py", "app/commands/test_new.py", "laboratory/records/test_pending.py",
    "app/cli/test_report.py", "analysis/diagnosis/test_diagnosis.py",
)  # fmt: skip
"""Files that take longest, longest first: each runs on one core, so none is to be begun when the others are done."""
WAITING = (
    "laboratory/live/instruments/test_instrument.py", "base/output/test_staging.py",
    "laboratory/live/instruments/test_profile.py", "laboratory/live/instruments/test_pt104.py",
    "laboratory/live/instruments/test_ipp.py", "app/serve/test_slow_clients.py", "base/output/test_interruption.py",
    "app/serve/test_server.py", "laboratory/schedule/test_settings.py",
)  # fmt: skip
"""Files whose tests wait for clocks and disks: they do it while types are checked beside them, which then has their core."""
TOGETHER = {"tests.artefacts.simulated": "examples", "tests.part_": "parts", "tests.sources": "sources",
            "tests.catalogues": "sources"}  # fmt: skip
"""What runs in one process, by what a file says: what takes long to make, and only a process keeps, is made once."""


@cache
def scope_of(file: str) -> str:
    """The file itself, or with which others it runs."""
    text = (ROOT / file).read_text(encoding="utf-8")
    return next((scope for word, scope in TOGETHER.items() if word in text), file)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Two processes are kept busy by scopes, the longest of them first; more of them by files."""
    from xdist.scheduler import LoadFileScheduling

    class Scopes(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return scope_of(file) if self.numnodes <= 2 else file

    return Scopes(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Every other worker reads the files from the last on: what one has compiled, the other finds done."""
    report = yield
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    if isinstance(collector, pytest.Directory) and int(worker.removeprefix("gw")) % 2:
        report.result.reverse()
    return report


STARTERS = {
    "browser": {"browser"},
    "server": {"RecordsServer", "serving", "mail_server", "web_server", "hanging_server", "get_server", "NotebookClient"},
    "process": {"Popen", "subprocess.run", "ProcessPoolExecutor", "fork", "openpty", "get_server", "NotebookClient"},
}  # fmt: skip
"""What a test that starts a browser, a server or a process names, or what it calls does: such tests are marked so."""


@cache
def names_in(function: Callable[..., object]) -> frozenset[str]:
    """Names in the code of a function, and of all that it calls of the tests and the benchmarks."""
    found, left = set[str](), [inspect.unwrap(function)]
    seen = set(left)
    while left:
        function = left.pop()
        codes = [function.__code__]
        for code in codes:
            codes += [const for const in code.co_consts if isinstance(const, CodeType)]
            found |= {*code.co_names, *(["subprocess.run"] if {"subprocess", "run"} <= {*code.co_names} else [])}
        named = {name for code in codes for name in code.co_names}
        values = [function.__globals__.get(name) for name in named]
        values += [vars(value).get(name) for value in values if inspect.ismodule(value) for name in named]
        called = {inspect.unwrap(value) for value in values if inspect.isfunction(value)} - seen
        left += [each for each in called if each.__module__.startswith(("tests", "benchmarks"))]
        seen |= called
    return frozenset(found)


def left_out(item: pytest.Item) -> bool:
    """Whether a quick run does without a test: one that takes long, or, of a grid, all but the cases named by its mark."""
    mark = item.get_closest_marker("long")
    if mark is None:
        return False
    word = mark.kwargs.get("but")
    return word is None or word not in item.name.partition("[")[2]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what starts a browser, a server or a process, where marks choose, and begin with the files that take longest.

    Files of a folder otherwise stay in their order, in every worker.
    """
    if config.getoption("quick"):
        config.hook.pytest_deselected(items=[item for item in items if left_out(item)])
        items[:] = [item for item in items if not left_out(item)]
    for item in items if config.option.markexpr else ():
        if isinstance(item, pytest.Function):
            fixtures = [made[-1].func for made in item._fixtureinfo.name2fixturedefs.values()]
            named = {*item.fixturenames, *(name for each in (item.function, *fixtures) for name in names_in(each))}
            for mark, starters in STARTERS.items():
                if named & starters:
                    item.add_marker(mark)
    order = (*FIRST[:1], *WAITING, *FIRST[1:])  # of two processes one begins with the longest, and the other waits
    first = {ROOT / "tests" / name: place for place, name in enumerate(order)}
    items.sort(key=lambda item: (first.get(item.path, len(order)), item.path.parts))


def pytest_collection_finish() -> None:
    """Look for what refers to itself as seldom as the command does, and not at all through what the tests themselves are."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(NEW_OBJECTS)


@pytest.fixture
def iota() -> Path:
    """The example job of a real recording."""
    return ROOT / "examples" / "iota-1102-20C"


@pytest.fixture
def job(iota: Path, tmp_path: Path) -> Path:
    """A copy of that job to spoil."""
    return Path(shutil.copytree(iota, tmp_path / "job"))


@pytest.fixture
def no_regions(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that analyse a job of their own, and are not about where in the machine its errors hold."""
    monkeypatch.setattr("cmm_uq.app.commands.report.factor_regions", lambda *_: NOTHING)


@contextmanager
def without_diagnosis() -> Iterator[None]:
    """As if nothing were missing in the model: the search for it is more than half of a report.

    Nothing that is kept for tests elsewhere is to be made meanwhile.
    """
    alike = np.zeros(1)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("cmm_uq.analysis.diagnosis.comparison.search.lack_of_fit", lambda *_: (1.0, alike, alike))
        patched.setattr("cmm_uq.analysis.diagnosis.comparison.search.lack_of_form", lambda *_: 1.0)
        patched.setattr("cmm_uq.app.commands.diagnose.smallest_effects", lambda *_: ())
        yield


@pytest.fixture
def no_diagnosis() -> Iterator[None]:
    """For tests that analyse a job of their own, and are not about what its model leaves out."""
    with without_diagnosis():
        yield


@pytest.fixture
def machine() -> Machine:
    return Machine("test machine", "XYZ", TRAVEL)


@pytest.fixture
def ballbar_points(machine: Machine) -> Points:
    """A bar of 400 mm in forty random places of the machine, without any error."""
    return bars(np.random.default_rng(20), 40, 400.0, machine)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The installed Chromium; tests that need it are skipped without one, unless CMM_UQ_REQUIRE_BROWSER=1 asks for it."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        if os.environ.get("CMM_UQ_REQUIRE_BROWSER") == "1":
            pytest.fail("CMM_UQ_REQUIRE_BROWSER=1, but no Chromium is installed")
        pytest.skip("no Chromium is installed")
    from playwright.sync_api import sync_playwright

    quiet = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
             "--disable-sync", "--no-first-run"]  # fmt: skip
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=quiet)
        yield chromium
        chromium.close()
