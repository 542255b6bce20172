"""Twenty-four exports as laboratories have them, written by somebody who knew vendors' documents and nothing of the reader.

They were hashed (``SHA256SUMS``) before they were tried. At the first try 6 were read, or ended with a question that their
author allows, 16 were refused, one was asked about on a wrong reading, and one was a fault of the program; what is read since
is below. None may be read wrongly.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.exchange import read_export
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.recording import UnplacedError

FOLDER = Path(__file__).parent / "unseen_exports"
EXPECTED = {path.name.removesuffix(".expected.json"): path for path in sorted(FOLDER.glob("*.expected.json"))}
ASKED = {  # by number: what is not read at the first try, and the words
    "02": "has figures, and no length that they belong to", "03": "no coordinate of a feature", "08": "no column is x_mm",
    "10": "nothing says the unit", "12": "nothing says which lengths lie on one line", "15": "fet.txt",
    "16": "could all be x_mm", "18": "nothing says which points", "21": "has 12 cells", "24": "nothing says which points",
}  # fmt: skip
WITHOUT_REFERENCE = {"09"}  # one length for all stands in the head, and is no column


def in_order(values: list[Any]) -> list[float]:
    """Numbers as they are, names by the order in which they come; faces from 0 count from there."""
    known = {value: i for i, value in enumerate(dict.fromkeys(values), 1)}
    return [float(value) if not isinstance(value, str) else known[value] for value in values]


@pytest.mark.parametrize("name", [name for name in EXPECTED if name[:2] not in ASKED])
def test_it_is_read_as_its_author_reads_it(name: str) -> None:
    expected = json.loads(EXPECTED[name].read_text(encoding="utf-8"))
    if expected["kind"] == "points":
        found = read_export(FOLDER / name).columns
        rows = list(zip(*expected["points"], strict=True))
        wanted = np.column_stack([*(in_order(list(rows[k])) for k in range(3)), *rows[3:6]]).astype(float)
        repeat = found.get("repeat", np.ones(len(wanted)))
        got = np.column_stack(
            [found[key] for key in ("measurement", "point")] + [repeat] + [found[f"{a}_mm"] for a in "xyz"]
        )
        got[:, 1] += wanted[:, 1].min() - got[:, 1].min()
        sort = (np.lexsort(each.T[::-1]) for each in (got, wanted))
        np.testing.assert_allclose(got[next(sort)], wanted[next(sort)], atol=1e-4)
        return
    with pytest.raises(UnplacedError) as asked:
        read_export(FOLDER / name)
    each = [
        (0.0 if of is None or name[:2] in WITHOUT_REFERENCE else of, run, value)
        for one in asked.value.lengths
        for of, run, value in zip(one.reference, one.repeat, one.measured, strict=True)
    ]
    lines = {label for one in asked.value.lengths for label in one.names}
    assert len(lines) == len({row[0] for row in expected["lengths"]})
    wanted_rows = [
        (0.0 if row[1] is None or name[:2] in WITHOUT_REFERENCE else row[1], *row[2:]) for row in expected["lengths"]
    ]
    np.testing.assert_allclose(sorted(each), sorted(wanted_rows), atol=1.1e-4)


@pytest.mark.parametrize("name", [name for name in EXPECTED if name[:2] in ASKED])
def test_what_is_not_read_is_asked_or_refused_in_words(name: str) -> None:
    with pytest.raises(CmmUqError, match=re.escape(ASKED[name[:2]])) as refused:
        read_export(FOLDER / name)
    assert refused.value.fix
