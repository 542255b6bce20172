"""Recordings drawn from the priors, their ranks, and the page that is written of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse, stats

from benchmarks.coverage.study import waiting
from benchmarks.ranks.drawn import CASES, Design, drawn, latent
from benchmarks.ranks.measuring import Case, ranked
from benchmarks.ranks.page import gathered, page
from benchmarks.ranks.ranking import DRAWS, of_noise
from benchmarks.ranks.uniformity import RANKS
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, Components


def components(*possible: str) -> Components:
    """Four observations, two along x and two along y, of a coordinate whose noise is stated as 2 µm."""
    shares = np.repeat([[1.0, 0, 0, 1, 0.5, 1], [0, 1.0, 0, 1, 1, 1]], 2, axis=0)
    return Components(sparse.eye_array(4, format="csr"), shares, np.zeros((4, 0)), np.zeros(0), possible, stated=2e-3)


def test_the_noise_of_a_coordinate_is_drawn_from_the_density_that_the_sampler_takes_it_to_have() -> None:
    """A Kolmogorov–Smirnov test of ln σ against the package's prior, integrated; the first number of all may differ."""
    noise, random = components(AXES, PLACING, GROWTH), np.random.default_rng(1)
    sizes = noise.sizes(np.vstack([latent(noise, random) for _ in range(4000)]))
    at = np.log(2e-3) + np.linspace(-8, 8, 20_001)
    density = np.exp(noise.log_prior_of_sigma(at))
    distribution = np.cumsum(density) / density.sum()
    assert stats.kstest(np.log(sizes.coordinate), lambda x: np.interp(x, at, distribution)).pvalue > 1e-3
    # the moment that docs/noise.md gives, nine tenths of 0.2² and a tenth of 1², within four standard errors
    assert np.mean(np.log(sizes.coordinate / 2e-3) ** 2) == pytest.approx(0.9 * 0.2**2 + 0.1, abs=0.035)
    assert np.mean(sizes.placing == 0) == pytest.approx(0.5, abs=0.04)  # five standard errors


def test_parameters_are_drawn_from_their_priors_and_stay_where_nothing_is_known() -> None:
    known = Unknown(("scale_x", "ppm"), unit("ppm"), 3.0, 2.0, 1.0)
    anywhere = Unknown(("artefact", "length_mm"), unit("mm"), 400.0, np.inf, 1.0)
    linear = LinearModel(np.zeros(4), np.ones((4, 2)), (known, anywhere), np.zeros((4, 0)), np.ones(4), 2e-3)
    random = np.random.default_rng(2)
    made = [drawn(Design(linear, components()), random) for _ in range(4000)]
    values = np.array([each.values for each in made])
    assert stats.kstest((values[:, 0] - 3) / 2, "norm").pvalue > 1e-3
    assert np.all(values[:, 1] == 400)
    noise = [(each.linear.observed - each.values.sum()) / each.sizes.coordinate[0] for each in made]
    assert stats.kstest(np.ravel(noise), "norm").pvalue > 1e-3


def test_axes_that_do_not_differ_are_alike_and_so_ranked_in_random_order() -> None:
    noise = components(AXES)
    sizes = noise.sizes(
        np.array([[np.log(1e-3), 0.0, 1.0, 0.0], [np.log(1e-3), 1.5, 1.0, 0.0]])
    )  # spread: absent, present
    found = of_noise(noise, sizes)
    assert [found[f"noise.axis_{a}"][0] for a in "xyz"] == [1.0] * 3
    assert found["noise.axis_x"][1] > 1.1
    assert found["noise.ln_sigma"] == pytest.approx([np.log(1e-3)] * 2)
    assert set(of_noise(replace(noise, possible=()), sizes)) == {"noise.ln_sigma"}


def test_a_recording_is_drawn_and_every_parameter_and_size_ranked() -> None:
    found = ranked((Case("gauge blocks"), 1, 0))
    assert "fault" not in found
    assert set(found["ranks"]) == {
        *(f"scale_{a}.ppm" for a in "xyz"), "probe_radius.um", "artefact.length_mm", "noise.ln_sigma", "noise.likelihood",
        *(f"noise.axis_{a}" for a in "xyz"), "noise.placing", "noise.growth",
    }  # fmt: skip
    assert all(0 <= rank <= DRAWS for rank in found["ranks"].values())
    assert found == ranked((Case("gauge blocks"), 1, 0)) | {"seconds": found["seconds"]}


def record(number: int, cell: str = "plate", **ranks: int) -> dict[str, Any]:
    told = {name.replace("__", "."): rank for name, rank in ranks.items()}
    return {"cell": cell, "number": number, "seconds": 1.0, "ranks": told, "converged": number > 0}


def test_a_run_is_taken_up_where_it_was_stopped(tmp_path: Path) -> None:
    (tmp_path / "plate.jsonl").write_text(json.dumps(record(0)) + '\n{"cell": "pl', encoding="utf-8")
    assert waiting([Case("plate")], tmp_path, 3, 2) == [(Case("plate"), 3, 1)]


def test_the_page_names_the_quantity_that_is_not_uniform_and_no_other() -> None:
    even = [round(i * RANKS / 60) for i in range(60)]
    records = [record(i, cell, scale_x__ppm=even[i], noise__slow=9) for i in range(60) for cell in CASES[:2]]
    told = page(
        gathered([*records, records[0], {"cell": "plane", "number": 0, "seconds": 1.0, "fault": "ValueError: no"}])
    )
    assert "120 recordings." in told
    assert "- noise.slow, ballbar: p = " in told
    assert "- noise.slow, all artefacts: p = " in told
    assert "- scale_x.ppm" not in told
    assert "- plane: ValueError: no" in told
    assert "| ballbar | 60 | 2 | noise.slow | " in told
    assert page(gathered(records[:1])).count("–") > 3  # of a single recording nothing is told


def test_the_page_of_uniform_ranks_names_nothing() -> None:
    even = [round(i * RANKS / 60) for i in range(60)]
    told = page(gathered([record(i, scale_x__ppm=even[i], noise__slow=even[i]) for i in range(60)]))
    assert "No quantity departs from uniform ranks" in told
    assert "| plate | 60 | 2 | scale_x.ppm | 1 | 1 | 0 | 1.0" in told
    assert told.rstrip().endswith("h of one core.")
