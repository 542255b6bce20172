"""A result as its laboratory may state it: no uncertainty below the laboratory's calibration and measurement capability."""

from __future__ import annotations

from dataclasses import replace

from cmm_uq.certificate.result import Result
from cmm_uq.certificate.stating import Stating


def with_capability(result: Result) -> tuple[Result, Stating]:
    """The result as a certificate states it, and what was raised.

    Lengths are taken at the artefact's longest dimension. The noise is a figure of the recording and stays.
    """
    longest = max((s.nominal for s in result.artefact.sizes if s.role == "dimension" and s.unit == "mm"), default=0.0)
    stating = Stating.of(result.job, longest)
    reported = [size.name for size in result.artefact.sizes if size.role != "set-up"]
    stated = replace(
        result,
        parameters={effect: stating.all(effect, found) for effect, found in result.parameters.items()},
        sizes=dict(result.sizes) | stating.all("artefact", {name: result.sizes[name] for name in reported}),
        accuracy=stating.all("accuracy", result.accuracy),
        stating=stating,
    )
    return stated, stating
