"""The certificate of a real recording with all its forms, made once for all processes of a run of the tests."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from cmm_uq.app.commands.report import write_report
from tests.conftest import ROOT
from tests.shared import files_below, shared_files

JOB = ROOT / "examples" / "iota-1102-20C"


@shared_files
def iota_report() -> Mapping[str, bytes]:
    """What the command writes, by name."""
    with tempfile.TemporaryDirectory() as place:
        write_report(JOB, Path(place) / "out")
        return files_below(Path(place) / "out")
