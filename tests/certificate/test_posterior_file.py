"""The posterior beside results.json: what results.json says of the file is true of it."""

from __future__ import annotations

import hashlib
import io

import numpy as np
import pytest

from cmm_uq.certificate.results.plain import MOST_NUMBERS, posterior_file
from cmm_uq.maths.inference.draws import Draws


def drawn(chains: int, draws: int, quantities: int) -> Draws:
    values = np.random.default_rng(2).standard_normal((chains, draws, quantities))
    return Draws({f"q{i}": "µm" for i in range(quantities)}, values)


@pytest.mark.parametrize("shape", [(128, 300, 8), (336, 300, 22), (128, 30, 3)])
def test_it_stays_below_what_a_certificate_can_carry_and_says_what_it_holds(shape: tuple[int, int, int]) -> None:
    draws = drawn(*shape)
    file = posterior_file(draws, "measured")
    assert len(file.content) < 4 * MOST_NUMBERS + 5_000  # what the archive adds
    assert file.entry["sha256"] == hashlib.sha256(file.content).hexdigest()
    with np.load(io.BytesIO(file.content)) as read:
        assert read["draws"].shape == (file.entry["chains"], file.entry["draws"], len(file.entry["parameters"]))
        assert np.allclose(read["centre"] + read["draws"], draws.array[:, :: file.entry["every"]], rtol=0, atol=1e-6)
        assert read["names"].tolist() == file.entry["parameters"] == list(file.entry["units"])


def test_draws_of_a_recording_that_was_not_measured_say_so_in_their_name() -> None:
    assert posterior_file(drawn(4, 20, 1), "measured").name == "posterior.npz"
    assert posterior_file(drawn(4, 20, 1), "simulated").name == "posterior-simulated.npz"


def test_a_quantity_that_never_varies_leaves_no_figure_that_is_not_finite() -> None:
    entry = posterior_file(Draws({"q": "mm"}, np.ones((4, 20, 1))), "measured").entry
    assert entry["rhat_max"] is None
    assert entry["ess_bulk_min"] == 80
