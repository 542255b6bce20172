"""The results.json of a diagnosis of error maps."""

from __future__ import annotations

from typing import Any

from cmm_uq.artefacts.error_maps.analysis import MapsDiagnosed
from cmm_uq.artefacts.error_maps.diagnosis import Difference
from cmm_uq.artefacts.error_maps.search import ColumnComparison
from cmm_uq.artefacts.error_maps.squareness import squareness_data
from cmm_uq.artefacts.error_maps.words import next_words
from cmm_uq.certificate.results.contents import effect_data, false_alarms, finding_data, head, improvement_data
from cmm_uq.certificate.results.plain import quantity_data


def maps_results(found: MapsDiagnosed, seed: int) -> dict[str, Any]:
    """results.json of a diagnosis of error maps."""
    d, noise = found.diagnosis, found.diagnosis.displacement
    squareness = squareness_data(found.maps)
    nothing = {"value": None, "u": None, "interval95": None}
    return {
        **head(found.job, effects=False),
        "sampling": {
            "sampler": None,
            "seed": seed,
            "ess_min": None,
            "rhat_max": None,
            "converged": True,
        },
        "diagnosis": {
            "verdict": d.verdict,
            "p_value": d.p_value,
            **false_alarms(d.alpha),
            "where": [_where(item) for item in d.differences],
            "effects": [effect_data(item, d.improvement) for item in d.effects],
            "indistinguishable": [],
            "suggested_measurements": [
                {"separates": list(names), "what": what, "repetitions": 1, "odds": None}
                for names, what in next_words(d)
            ],
            "noise": {
                "stated_coordinate_um": None,
                "coordinate_um": nothing if noise is None else quantity_data(noise),
                "rotation_arcsec": nothing if d.rotation is None else quantity_data(d.rotation),
                "placing_um": nothing,
                "correlated_in_time": False,
                "heavy_tails": False,
                "contradicts_stated": False,
            },
            "screening": [finding_data(finding, "") for finding in found.findings],
            "improvement": improvement_data(d.improvement),
            "compared": [_compared(compared, d.p_of(compared)) for compared in d.comparisons],
            **({"squareness_arcsec": squareness} if squareness else {}),
        },
    }


def _where(item: Difference) -> dict[str, Any]:
    return {
        "covariate": f"{item.column.axis}_mm",
        "region": list(item.region),
        "p_value": min(1.0, item.p_value),
        "amplitude_um": item.amplitude_um,
        "what": item.rival.name,
        "probability": item.probability,
        "instead": list(item.instead),
        "sign_turned": item.turned,
    }


def _compared(compared: ColumnComparison, p_value: float) -> dict[str, Any]:
    return {
        "what": compared.column.title,
        "positions": len(compared.column.positions),
        "temperatures_c": compared.column.temperatures.tolist(),
        "p_value": p_value,
        "explanations": [
            {"together": [compared.rivals[i].name for i in key], "probability": p}
            for key, p in sorted(compared.combinations.probability.items(), key=lambda item: -item[1])[:6]
        ],
    }
