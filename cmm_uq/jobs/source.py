"""Where the files of a job are read from: a folder, or memory, for a job that lies in no folder yet."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import Limit
from cmm_uq.jobs.file_names import check_name, inside


class Source(Protocol):
    """Files by name, as job.toml names them."""

    @property
    def toml(self) -> Path:
        """Of job.toml; for messages where it lies in no folder."""
        ...

    def has(self, name: str, *, written: bool = False) -> bool:
        """Whether the file is there; see :meth:`content`."""
        ...

    def job_file(self, limit: Limit, fix: str) -> bytes:
        """Bytes of job.toml.

        Raises
        ------
        CmmUqError : it is missing or too large.
        """
        ...

    def content(self, name: str, limit: Limit, fix: str, *, written: bool = False) -> bytes:
        """Bytes of a file that it names.

        Raises
        ------
        CmmUqError : its name cannot be that of a job's file, it is missing or too large.
        """
        ...


@dataclass(frozen=True)
class InFolder:
    """Files beside a job.toml."""

    toml: Path

    def has(self, name: str, *, written: bool = False) -> bool:
        """See :meth:`Source.has`."""
        return os.path.lexists(inside(self.toml.parent, name, str(self.toml), written=written))

    def job_file(self, limit: Limit, fix: str) -> bytes:
        """See :meth:`Source.job_file`."""
        return content_of(self.toml, limit, fix)

    def content(self, name: str, limit: Limit, fix: str, *, written: bool = False) -> bytes:
        """See :meth:`Source.content`."""
        return content_of(inside(self.toml.parent, name, str(self.toml), written=written), limit, fix)


@dataclass(frozen=True)
class InMemory:
    """Files by name."""

    files: Mapping[str, bytes]

    @property
    def toml(self) -> Path:
        """See :attr:`Source.toml`."""
        return Path("job.toml")

    def has(self, name: str, *, written: bool = False) -> bool:
        """See :meth:`Source.has`."""
        return name in self.files

    def job_file(self, limit: Limit, fix: str) -> bytes:
        """See :meth:`Source.job_file`."""
        return self._content(self.toml.name, limit, fix)

    def content(self, name: str, limit: Limit, fix: str, *, written: bool = False) -> bytes:
        """See :meth:`Source.content`."""
        check_name(name, str(self.toml), written=written)
        return self._content(name, limit, fix)

    def _content(self, name: str, limit: Limit, fix: str) -> bytes:
        if name not in self.files:
            raise CmmUqError("no such file", where=name, fix=fix)
        content = self.files[name]
        if len(content) > limit.most:
            raise CmmUqError(f"is larger than the {limit.most} {limit.unit} that are read of such a file", where=name,
                             fix="Give less of it")  # fmt: skip
        return content
