"""A format of files: whether it is that of a file, and the sheets that the file holds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from cmm_uq.base.messages import Text
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Sheet

HEAD = 65_536
"""Bytes of a file by which it is recognised."""


class Format(ABC):
    """A format; those of other packages are entry points of the group ``cmm_uq.imports``, of the format's name.

    Attributes
    ----------
    name : of the entry point, and in results.json.
    title : as printed.
    """

    name: str
    title: Text

    @abstractmethod
    def recognises(self, head: bytes) -> bool:
        """Whether a file is of this format.

        Parameters
        ----------
        head : its first :data:`HEAD` bytes.
        """

    @abstractmethod
    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """Sheets of a file, at least one.

        Parameters
        ----------
        content : of the file.
        where : its name, for messages.
        keys : what the job says beside.

        Raises
        ------
        CmmUqError : it is damaged, hostile, or holds nothing that can be read.
        """
