"""What a new set may replace: what the same command wrote for the same job and nobody has changed since. Nothing else."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.manifest import MANIFEST, Manifest, Owner, read_manifest, sha256_of
from cmm_uq.base.output.placing import Journal, free_name

WAY_OUT = "Choose another folder with --out, or give --force to keep what is there as NAME.previous"


def journal_for(
    folder: Path, owner: Owner, files: Mapping[str, str], *, inputs: Iterable[Path], force: bool, token: str = ""
) -> Journal:
    """What has to happen to the files of a folder for a new set to take their place.

    Parameters
    ----------
    folder : of the set.
    owner : of the new set.
    files : SHA-256 of each new file, by name; empty texts where it is not known yet.
    inputs : that nothing may happen to.
    force : whether what is not the owner's may be renamed.
    token : of the stage.

    Raises
    ------
    CmmUqError : something in the way may not be replaced.
    """
    old = read_manifest(folder)
    stranger = old is not None and old.owner != owner
    if stranger and old is not None and not force:
        raise CmmUqError(f"holds what {old.owner} wrote", where=str(folder), fix=WAY_OUT)
    names = (*files, MANIFEST)
    mine = {} if old is None or stranger else _unchanged(folder, old)
    in_the_way = [name for name in names if os.path.lexists(folder / name) and name not in mine]
    if old is not None and stranger:
        in_the_way += [name for name in old.files if name not in in_the_way and os.path.lexists(folder / name)]
    elif old is not None and MANIFEST in in_the_way:
        in_the_way.remove(MANIFEST)
    _spare_inputs(folder, (*names, *in_the_way), inputs)
    if in_the_way and not force:
        name = in_the_way[0]
        why = (
            "was changed after it was written"
            if old is not None and name in old.files
            else f"was not written by {owner}"
        )
        raise CmmUqError(why, where=str(folder / name), fix=WAY_OUT)
    kept = {name: free_name(folder, name) for name in in_the_way}
    stale = {name: digest for name, digest in mine.items() if name not in files}
    return Journal(token, dict(files), {name: mine[name] for name in files if name in mine}, kept, stale)


def _unchanged(folder: Path, manifest: Manifest) -> dict[str, str]:
    return {name: digest for name, digest in manifest.files.items() if sha256_of(folder / name) == digest}


def _spare_inputs(folder: Path, names: Iterable[str], inputs: Iterable[Path]) -> None:
    given = [path for path in inputs if path.exists()]
    for name in names:
        target = folder / name
        if target.exists() and any(target.samefile(path) for path in given):
            raise CmmUqError("is an input of this command, and would be replaced", where=str(target),
                             fix="Choose another folder with --out")  # fmt: skip
