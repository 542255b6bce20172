"""Which instrument it is, by what it says of itself, and whether it is the one that was meant."""

from __future__ import annotations

import re

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.framing import Framed
from cmm_uq.laboratory.live.instruments.profile import Identify
from cmm_uq.laboratory.live.instruments.source import Identity

_TOLD = ("maker", "model", "serial", "firmware")


class Introduction:
    """The lines that follow the question who it is.

    Parameters
    ----------
    wanted : question and pattern.
    """

    def __init__(self, wanted: Identify) -> None:
        self._pattern = re.compile(wanted.pattern)
        self._lines: list[str] = []
        self._span = (0, 0)
        self.found: Identity | None = None
        """What it said; ``None`` until it did."""

    def hear(self, message: Framed) -> None:
        """A message came."""
        self._lines.append(message.body.decode("latin-1").strip("\r\n"))
        found = self._pattern.search("\n".join(self._lines))
        if found is not None and self.found is None:
            given = {key: text.strip() for key, text in found.groupdict().items() if key in _TOLD and text}
            self.found = Identity("", **given)
            whole = "\n".join(self._lines)
            self._span = whole.count("\n", 0, found.start()), whole.count("\n", 0, max(found.start(), found.end() - 1))

    def tells(self, place: int) -> bool:
        """Whether a message is part of the introduction, counted from 0."""
        return self.found is not None and self._span[0] <= place <= self._span[1]


def another(known: Identity, found: Identity, declared: Identity) -> CmmUqError | None:
    """What is wrong where the serial number is another than that of the job, or of the instrument that was there before."""
    for expected, whose in ((declared.serial, "the job names"), (known.serial, "before it was")):
        if expected and found.serial and expected.casefold() != found.serial.casefold():
            return CmmUqError(
                f"another instrument answers: it says serial number {found.serial!r}, {whose} {expected!r}",
                where=declared.name, fix="Connect the right one, or correct its serial number",
            )  # fmt: skip
    return None
