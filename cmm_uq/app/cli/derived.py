"""How a command ends that wrote a recording made from another one: where it is, and what to do with it."""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping
from pathlib import Path

from cmm_uq.app.cli.printing import put_data, show_summary
from cmm_uq.base.output import MANIFEST


def conclude_derived(
    files: Mapping[str, Path], what: str, *, json: bool, quiet: bool, verbose: bool, is_job: bool = True
) -> None:
    """Print what was written, or its manifest.

    Parameters
    ----------
    files : that were written, by name.
    what : they are.
    is_job : whether they are a job folder.

    Raises
    ------
    OutputError : nobody takes what is said.
    """
    if json:
        put_manifest(files)
    elif not quiet:
        from cmm_uq.app.cli.files_told import folder_of
        from cmm_uq.base.messages import Verbatim, say
        from cmm_uq.certificate.in_short import Summary

        folder = folder_of(files)
        further = (say("Next: cmm-uq report {folder}", folder=Verbatim(folder)),) if is_job else ()
        show_summary(Summary(Verbatim(what), remarks=further), files, verbose=verbose)


def put_manifest(files: Mapping[str, Path]) -> None:
    """The manifest of what was written, and the folder, as JSON.

    Raises
    ------
    OutputError : nobody takes it.
    """
    from cmm_uq.app.cli.files_told import folder_of

    put_data({**json_text.loads(files[MANIFEST].read_bytes()), "folder": folder_of(files)})
