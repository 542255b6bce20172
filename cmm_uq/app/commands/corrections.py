"""Corrections of the package: ``corrections.toml`` beside the changelog, and which certificates each touches."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Recorded
from cmm_uq.jobs.recording_file import header, is_own
from cmm_uq.laboratory.records.facts import Certificate

FILE = "corrections.toml"


@dataclass(frozen=True)
class Correction:
    """One; empty parts say nothing, and are then no reason to pass a certificate over.

    Parameters
    ----------
    version : that has it.
    what : it is.
    commands, kinds, effects, standards, keys, columns : that it touches.
    """

    version: str
    what: str
    commands: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    standards: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()

    def touches(self, certificate: Certificate, inputs: Inputs | None) -> bool:
        """Whether it may touch a certificate.

        Parameters
        ----------
        certificate : as recorded.
        inputs : of its job; ``None`` where they cannot be read, so that they are no reason to pass it over.
        """
        return self.concerns(certificate.command, certificate.kind, inputs)

    def concerns(self, command: str, kind: str, inputs: Inputs | None) -> bool:
        """Whether it may touch what a command made.

        Parameters
        ----------
        command : report or diagnose.
        kind : of measurement; empty where it is not known.
        inputs : of the job; ``None`` where they cannot be read, so that they are no reason to pass it over.
        """
        if self.commands and command not in self.commands:
            return False
        if self.kinds and kind and kind not in self.kinds:
            return False
        if inputs is None:
            return True
        asked = (
            (self.effects, lambda: inputs.effects & set(self.effects)),
            (self.standards, lambda: any(name.startswith(self.standards) for name in inputs.standards)),
            (self.keys, lambda: any(inputs.has(key) for key in self.keys)),
            (self.columns, lambda: inputs.columns is None or inputs.columns & set(self.columns)),
        )
        return all(found() for named, found in asked if named)


@dataclass(frozen=True)
class Inputs:
    """What of a job's inputs decides whether a correction touches it.

    Parameters
    ----------
    job : job.toml.
    columns : of its files; ``None`` where a recording is of another format, whose columns have other names.
    """

    job: Mapping[str, Any]
    columns: frozenset[str] | None = field(default_factory=frozenset)

    @property
    def effects(self) -> set[str]:
        """That the job names."""
        return set((self.job.get("model") or {}).get("effects") or ())

    @property
    def standards(self) -> tuple[str, ...]:
        """Of its statements of conformity."""
        return tuple(str(wish.get("standard")) for wish in self.job.get("conformity") or ())

    def has(self, key: str) -> bool:
        """Whether job.toml has a key, with its table."""
        table: Any = self.job
        for part in key.split("."):
            if not isinstance(table, Mapping) or part not in table:
                return False
            table = table[part]
        return True

    @classmethod
    def of(cls, files: Mapping[str, bytes]) -> Inputs:
        """Of the files of a job: a column of any of them counts."""
        job = tomllib.loads(files["job.toml"].decode("utf-8-sig"))
        recording = job.get("recording") or {}
        recordings = [files[name] for key in ("file", "earlier") if (name := str(recording.get(key))) in files]
        if not set(recording) <= set(Recorded.model_fields) or not all(map(is_own, recordings)):
            return cls(job, None)
        return cls(
            job, frozenset(name for file, content in files.items() if file != "job.toml" for name in header(content))
        )


@cache
def corrections() -> tuple[Correction, ...]:
    """All, as the package has them.

    Raises
    ------
    CmmUqError : the file is missing or no list of corrections.
    """
    path = Path(__file__).resolve().parents[2] / FILE
    if not path.is_file():
        raise CmmUqError(
            "the list of corrections is missing", where=str(path), fix="Install cmm-uq again, from a whole wheel"
        )
    return _read(path.read_text(encoding="utf-8"), str(path))


def between(first: str, last: str) -> tuple[Correction, ...]:
    """Corrections of versions after the first, that a certificate says of itself, up to the last."""
    return tuple(one for one in corrections() if said(first) < order(one.version) <= order(last))


def order(version: str) -> tuple[int, ...]:
    """A version for comparing: its numbers.

    Raises
    ------
    CmmUqError : it has other parts.
    """
    parts = version.split(".")
    if not all(part.isascii() and part.isdigit() for part in parts):
        raise CmmUqError(f"{version!r} is no version", fix="Give it as 0.5.0")
    return tuple(int(part) for part in parts)


def said(version: str) -> tuple[int, ...]:
    """The version that a certificate says of itself, for comparing: of ``0.5.0rc1`` 0.5, which is before 0.5.0; of none ()."""
    return tuple(map(int, takewhile(lambda part: part.isascii() and part.isdigit(), version.split("."))))


def _read(text: str, where: str) -> tuple[Correction, ...]:
    try:
        rows = tomllib.loads(text)["correction"]
        return tuple(
            Correction(row.pop("version"), row.pop("what"), **{key: tuple(names) for key, names in row.items()})
            for row in rows
        )
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise CmmUqError(f"is no list of corrections: {error}", where=where) from error
