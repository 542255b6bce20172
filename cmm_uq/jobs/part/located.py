"""Where in job.toml a key stands, for what is found after its tables were read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.files.toml_file import line_of


@dataclass(frozen=True)
class Places:
    """The keys of a job.toml.

    Parameters
    ----------
    path : of the file.
    text : that it holds.
    """

    path: Path
    text: str

    def of(self, table: str, key: str = "", number: int | None = None) -> str:
        """A key as messages name it: file, line, table and key.

        Parameters
        ----------
        table : its name.
        key : in it.
        number : of the table, from 0, where there are several.
        """
        line = line_of([table, *([] if number is None else [str(number)]), *([key] if key else [])], self.text)
        head = f"[{table}]" if number is None else f"[[{table}]] {number + 1}"
        return f"{self.path}{f' line {line}' if line else ''}: {head} {key}".rstrip()
