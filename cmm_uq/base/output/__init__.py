"""Writes the files of a command as one set: all of them or none, and never over anything else.

A set is staged in a hidden folder beside its place, put in place file by file, and named in ``manifest.json``, which is
written last. What a kill left is completed or rolled back by the next command in that folder; readers go by the manifest.
"""

from __future__ import annotations

from cmm_uq.base.output.manifest import MANIFEST, Manifest, Owner, read_manifest, sha256_of
from cmm_uq.base.output.staging import InDoubtError, Ledger, Stage, finish_interrupted, is_pending, staged

__all__ = [
    "MANIFEST", "InDoubtError", "Ledger", "Manifest", "Owner", "Stage", "finish_interrupted", "is_pending", "read_manifest",
    "sha256_of", "staged",
]  # fmt: skip
