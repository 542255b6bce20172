"""A few hundred mutated inputs, each read or run as the command reads and runs it: nothing breaks, hangs or is lost."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from benchmarks.hostile.cases import case, lay_out
from benchmarks.hostile.pool import run_all
from benchmarks.hostile.seeds import seeds
from benchmarks.hostile.toml_text import dumps

DEAR = ("report", "diagnose", "plan")  # commands that compute for seconds: they are part of the whole study


@pytest.mark.long(but="1")
@pytest.mark.parametrize("seed", [1, 2])
def test_a_mutated_input_is_read_or_refused_in_one_line(seed: int, tmp_path: Path) -> None:
    numbers = [number for number in range(120) if not set(case(seed, number).command[:1]) & set(DEAR)]
    records = list(run_all(numbers, seed, 1, tmp_path))
    assert len(records) == len(numbers)
    assert [(r["number"], r["what"], r["found"], r["said"]) for r in records if r["found"]] == []
    assert {r["code"] for r in records} >= {0, 2}


def test_a_case_is_the_same_whenever_it_is_made() -> None:
    assert all(case(5, number) == case(5, number) for number in range(50))
    assert case(5, 1) != case(6, 1)


@pytest.mark.parametrize("name", [name for name, seed in seeds().items() if "job.toml" in seed.files])
def test_tables_written_and_read_again_are_the_same(name: str) -> None:
    tables = tomllib.loads(seeds()[name].files["job.toml"].decode())
    assert tomllib.loads(dumps(tables)) == tables


def test_a_case_of_an_odd_file_lays_out_that_kind(tmp_path: Path) -> None:
    odd = [found for found in (case(1, number) for number in range(800)) if found.odd]
    kinds = {kind for found in odd for kind in found.odd.values()}
    assert {"fifo", "loop", "folder", "zero"} <= kinds
    for found in odd[:20]:
        folder = tmp_path / str(found.number)
        lay_out(found, folder)
        (name, kind), *_ = found.odd.items()
        path = folder / "job" / name
        assert {"fifo": path.is_fifo, "folder": path.is_dir, "missing": lambda p=path: not p.exists(),
                "socket": path.is_socket, "unreadable": path.is_file}.get(kind, path.is_symlink)()  # fmt: skip
