"""How a command ends that wrote a recording made from another one: where it is, and what to do with it."""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping
from pathlib import Path

from cmm_uq.cli.files_told import folder_of
from cmm_uq.cli.printing import put_data, show_summary


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
    folder = folder_of(files)
    if json:
        manifest = json_text.loads(files["manifest.json"].read_bytes())
        put_data({**manifest, "folder": folder})
    elif not quiet:
        from cmm_uq.documents.in_short import Summary
        from cmm_uq.messages import Verbatim, say

        further = (say("Next: cmm-uq report {folder}", folder=Verbatim(folder)),) if is_job else ()
        show_summary(Summary(Verbatim(what), remarks=further), files, verbose=verbose)
