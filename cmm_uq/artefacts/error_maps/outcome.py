"""The diagnosis of error maps as a page."""

from __future__ import annotations

from cmm_uq.artefacts.error_maps.analysis import MapsDiagnosed, diagnose_error_maps
from cmm_uq.artefacts.error_maps.overview import told
from cmm_uq.artefacts.error_maps.page import maps_document, maps_results
from cmm_uq.certificate.diagnosis.overview import summary_of
from cmm_uq.certificate.outcome import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.plots.style import lettered_in


def outcome(found: MapsDiagnosed, seed: int) -> Outcome:
    verdict = found.diagnosis.verdict
    short = summary_of(found.job.facts, verdict, told(found), found.findings)
    with lettered_in(found.job.facts.job.language):
        document = maps_document(found, seed)
    consistent = verdict == "consistent"
    return Outcome(found, lambda: document, maps_results(found, seed), short, document.warnings, in_order=consistent)


OWN = OwnAnalysis(diagnose=Recipe(diagnose_error_maps, outcome))
