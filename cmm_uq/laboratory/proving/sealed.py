"""The truth of all cases, written down and hashed before the first of them is diagnosed.

The file is JSON in one canonical form, so that its SHA-256 is that of what it says: ``sha256sum truth.json`` gives it
again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmm_uq.laboratory.proving.cases import Case

SCHEMA = "cmm-uq/prove-truth/1"


def truth_file(cases: Sequence[Case], common: Mapping[str, Any]) -> bytes:
    """The truth as the bytes of a file.

    Parameters
    ----------
    cases : all of them, by number.
    common : what holds for all: job, hashes of its inputs, program, seed, options, true parameters of what the job
        names.
    """
    whole = {"schema": SCHEMA, **common, "cases": [case.as_data() for case in cases]}
    return canonical(whole)


def canonical(data: Any) -> bytes:
    """JSON with sorted keys, a line feed at its end and nowhere else, of finite numbers."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def sha256_of(content: bytes) -> str:
    """Of a file's bytes."""
    return hashlib.sha256(content).hexdigest()
