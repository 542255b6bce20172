"""Where in a file a mistake is, for errors that do not know it."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.base.errors import CmmUqError


@dataclass(frozen=True)
class Located:
    """Adds the place to an error that does not know it."""

    where: str

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if isinstance(error, CmmUqError):
            where = f"{self.where} {error.where}" if error.where else self.where
            raise CmmUqError(error.problem, where=where, fix=error.fix) from error
