"""A laboratory's own log of points as a format for cmm_uq, from a package of its own: ``P 1.1 = 10.0 20.0 30.0``."""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.base.messages import say
from cmm_uq.jobs.importing.format import Format, Sheet
from cmm_uq.jobs.importing.format import ImportKeys


class PointLog(Format):
    """A log."""

    name = "pointlog"
    title = say("log of points")

    def recognises(self, head: bytes) -> bool:
        """By its first letter and the sign after the name."""
        return head.startswith(b"P ") and b" = " in head

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """One sheet: name and coordinates."""
        lines = content.decode("ascii").splitlines()
        rows = [[line[2:].partition(" = ")[0], *line.partition(" = ")[2].split()] for line in lines]
        return [Sheet("", [["name", "x", "y", "z"], *rows], range(len(lines) + 1), listed=True, unit="mm", decimal=".")]
