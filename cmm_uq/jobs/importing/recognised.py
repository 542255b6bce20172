"""What was recognised of a file that was imported: printed before it is used, kept in the results, said on the certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cmm_uq.base.messages import Text, Verbatim, commas, say, semicolons
from cmm_uq.jobs.importing.sheet import Fact


@dataclass(frozen=True)
class Recognised:
    """How a file was read.

    Parameters
    ----------
    file : its name.
    format : its format's name.
    title : of the format, as printed.
    facts : encoding, unit, decimal sign, …
    columns : heading of the file by column of the recording.
    points : in the table.
    """

    file: str
    format: str
    title: Text
    facts: tuple[Fact, ...]
    columns: Mapping[str, str]
    points: int

    @property
    def unused(self) -> tuple[str, ...]:
        """Headings of columns that are not used, the first of them."""
        return tuple(
            name for fact in self.facts if fact.key == "not_used" for name in str.__str__(fact.value).split(", ")
        )

    @property
    def rows(self) -> list[tuple[Text, Text]]:
        """Everything, for a table."""
        head = [(say("File"), Verbatim(self.file)), (say("Format"), self.title)]
        columns: list[tuple[Text, Text]] = [
            (say("Column {name}", name=Verbatim(name)), Verbatim(heading)) for name, heading in self.columns.items()
        ]
        count = (say("Rows read"), say("{points}", points=self.points))
        return [*head, *((fact.label, fact.value) for fact in self.facts), *columns, count]

    @property
    def sentence(self) -> Text:
        """The same in one cell of a certificate."""
        taken = commas([say("{name} from {heading}", name=Verbatim(name), heading=Verbatim(heading))
                        for name, heading in self.columns.items()])  # fmt: skip
        facts = semicolons([say("{label:small}: {value}", label=fact.label, value=fact.value) for fact in self.facts])
        return say("read from {file} ({title}): {columns}; {facts}", file=Verbatim(self.file), title=self.title,
                   columns=taken, facts=facts)  # fmt: skip

    @property
    def data(self) -> dict[str, Any]:
        """For results.json."""
        return {
            "file": self.file, "format": self.format, **{fact.key: str.__str__(fact.value) for fact in self.facts},
            "columns": dict(self.columns), "points": self.points,
        }  # fmt: skip
