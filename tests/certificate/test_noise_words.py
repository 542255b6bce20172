"""What the certificate says of the noise."""

from __future__ import annotations

from dataclasses import replace

from cmm_uq.base.units import unit
from cmm_uq.certificate.result import NoiseComponent, RecordingNoise
from cmm_uq.certificate.sections.method import noise_found
from cmm_uq.maths.uncertainty.quantity import Quantity


def size(value: float, probability: float = 1.0) -> NoiseComponent:
    return NoiseComponent(Quantity(value, 0.1, (value - 0.2, value + 0.2), unit("µm")), probability)


def noise(components: dict[str, NoiseComponent], *, apart: float = 0.2, wider: float = 1.0) -> RecordingNoise:
    return RecordingNoise(size(1.2).size, components, apart, wider, None, None)


def test_white_noise_is_said_to_be_nothing_else_and_what_could_not_show_is_named() -> None:
    assert noise_found(noise({}), heavy_tails=False) == (
        "independent readings, nothing else; not to be seen in this recording: "
        "set-up offsets (no repeats) and slow noise (no times)"
    )


def test_what_is_probably_there_is_named_with_its_size_and_what_it_does_to_the_uncertainties() -> None:
    components = {"placing": size(2.3, 0.97), "slow": size(0.4, 0.3), "x": size(1), "y": size(1), "z": size(3)}
    said = noise_found(noise(components, apart=0.99, wider=1.84), heavy_tails=False)
    assert "differs by axis (X 1, Y 1, Z 3 µm)" in said
    assert "an offset of 2.3 µm of each set-up, shared by its repeats (probability 0.97)" in said
    assert "slow noise" not in said
    assert "up to 1.84 times" in said


def test_with_times_too_it_says_which_drift_it_cannot_have_seen() -> None:
    """Under a walk that has gone most of its way at the beginning intervals hold too seldom: docs/coverage-study.md."""
    said = noise_found(noise({"placing": size(0.1, 0.1), "slow": size(0.1, 0.1)}), heavy_tails=False)
    assert said == (
        "independent readings, nothing else; not to be seen in this recording: what had drifted before the first reading"
    )


def test_the_steps_of_a_display_are_named() -> None:
    assert "and the steps of the display, 5 µm" in noise_found(replace(noise({}), display_um=5.0), heavy_tails=False)


def test_heavy_tails_are_named_as_what_the_estimate_does_not_reckon_with() -> None:
    said = noise_found(noise({"growth": size(0.9, 0.9)}), heavy_tails=True)
    assert said.startswith(
        "independent readings, and scatter that grows with length to 0.9 µm (probability 0.90) and heavier tails than those "
        "of the normal distribution that the estimate assumes; not to be seen"
    )
