"""``cmm-uq selftest``: what a laboratory files as evidence."""

from __future__ import annotations

import re
import subprocess
import sys


def test_every_published_figure_is_reproduced_and_named_with_its_source() -> None:
    done = subprocess.run([sys.executable, "-m", "cmm_uq", "selftest"], capture_output=True, text=True, check=False,
                          encoding="utf-8")  # fmt: skip
    assert done.returncode == 0, done.stdout
    passed, total = map(int, re.search(r"(\d+) of (\d+) figures", done.stdout).groups())
    assert passed == total > 100
    rows = [line.split("\t") for line in done.stdout.splitlines() if "\t" in line]
    assert rows[0] == ["Case", "Expected", "Tolerance", "Got", "Source", "Result"]
    assert all(row[4] and row[5] == "pass" for row in rows[1:])
    assert any("JCGM 101" in row[4] for row in rows[1:])
