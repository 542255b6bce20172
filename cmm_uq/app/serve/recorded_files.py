"""The files of a certificate: those that its entry names, and of these only the very bytes that were recorded.

A name leads nowhere by itself: it must be one of the entry's, its path must stay in the certificate's folder without any
symbolic link, and what is read must have the recorded SHA-256. Anything else is refused in words.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple
from urllib.parse import quote

from cmm_uq.app.serve.exchange import OWN, RECORDED, RefusedRequest, WebResponse
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.output.manifest import plain_name, read_manifest
from cmm_uq.laboratory.records.facts import Entry

LARGEST = 128 * 2**20  # bytes of a file that the page hands out

# a browser's own viewer of PDF does not work in a sandbox
PDF = "default-src 'none'; object-src 'self'; style-src 'unsafe-inline'; base-uri 'none'; frame-ancestors 'none'"

MEDIA: Mapping[str, tuple[str, str]] = {  # what a browser may show, by the end of the name; all else it may only keep
    ".html": ("text/html; charset=utf-8", RECORDED), ".pdf": ("application/pdf", PDF),
    ".json": ("application/json", RECORDED), ".csv": ("text/plain; charset=utf-8", RECORDED),
    ".toml": ("text/plain; charset=utf-8", RECORDED), ".svg": ("image/svg+xml", RECORDED),
}  # fmt: skip


class RecordedFile(NamedTuple):
    """One file of a certificate: its name, and the SHA-256 that was recorded of it."""

    name: str
    sha256: str

    @property
    def shown(self) -> bool:
        """Whether a browser shows it."""
        return Path(self.name).suffix.lower() in MEDIA


def files_of(entry: Entry, folder: Path, signed: Mapping[str, str] = MappingProxyType({})) -> tuple[RecordedFile, ...]:
    """What an entry names, by name; of an entry that names none, what the manifest in the folder does.

    A manifest is believed only where it names the results.json that the entry does; ``signed``: SHA-256 of the files that
    were signed since, by name.
    """
    named = hashes(entry.data)
    results = str(entry.data.get("results_sha256") or "")
    if not named:
        manifest = read_manifest(folder)
        there = dict(manifest.files) if manifest is not None else {}
        named = there if results and there.get("results.json") == results else {}
    return tuple(RecordedFile(name, signed.get(name, named[name])) for name in sorted(named) if plain_name(name))


def hashes(data: Mapping[str, Any]) -> dict[str, str]:
    """SHA-256 by name, as an entry's content has them."""
    files = data.get("files")
    each = files.items() if isinstance(files, Mapping) else ()
    stated = ((str(name), one.get("sha256") if isinstance(one, Mapping) else one) for name, one in each)
    return {name: one for name, one in stated if isinstance(one, str)}


def content_of(file: RecordedFile, folder: Path) -> bytes:
    """The recorded bytes."""
    name, place = Verbatim(file.name), Verbatim(str(folder))

    def refused(problem: Text, fix: Text = NOTHING, status: HTTPStatus = HTTPStatus.CONFLICT) -> RefusedRequest:
        return RefusedRequest(status, problem, fix)

    if not plain_name(file.name):
        raise refused(say("{name} is no file of a certificate", name=name), status=HTTPStatus.NOT_FOUND)
    path = folder
    for part in file.name.split("/"):
        path = path / part
        if path.is_symlink():
            raise refused(say("{name} is a link to another place by now", name=name))
    try:
        if not path.is_file():
            raise refused(say("{name} is not in its folder any more", name=name),
                          say("The records name the folder {folder}", folder=place), HTTPStatus.GONE)  # fmt: skip
        if path.stat().st_size > LARGEST:
            raise refused(say("{name} is too large for a browser", name=name), say("It lies in {folder}", folder=place))
        content = path.read_bytes()
    except OSError as error:
        why = Verbatim(error.strerror or "the disk fails")
        raise refused(say("{name} cannot be read: {why}", name=name, why=why)) from None
    if sha256(content).hexdigest() != file.sha256:
        problem = say("{name} is not the file that was recorded: it was altered since", name=name)
        raise refused(problem, say("The page hands out recorded files only; this one lies in {folder}", folder=place))
    return content


def results_of(files: tuple[RecordedFile, ...], folder: Path) -> dict[str, Any]:
    """The recorded results.json; empty where it is not there as it was recorded."""
    for file in files:
        if file.name == "results.json":
            try:
                results = json.loads(content_of(file, folder))
            except (RefusedRequest, ValueError, RecursionError):
                return {}
            return results if isinstance(results, dict) else {}
    return {}


def sent(file: RecordedFile, content: bytes, *, keep: bool) -> WebResponse:
    """A recorded file as an answer."""
    media, policy = MEDIA.get(Path(file.name).suffix.lower(), ("application/octet-stream", OWN))
    how = "attachment" if keep or not file.shown else "inline"
    name = quote(file.name.rpartition("/")[2], safe="")
    headers = {"Content-Disposition": f"{how}; filename*=UTF-8''{name}"}
    return WebResponse(content, media, policy=policy, headers=headers)
