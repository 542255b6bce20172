"""What the noise of a recording is like, in words for the certificate."""

from __future__ import annotations

from cmm_uq.documents.result import Component, Noise
from cmm_uq.documents.wording import listed

_SHOWN = 0.5
"""Probability from which a component is said to be there."""

_WIDER = 1.05

_NAMES = {
    "placing": "an offset of each set-up, shared by its repeats, of",
    "growth": "scatter that grows with length, at the longest",
    "slow": "slow noise in time of",
}


def noise_found(noise: Noise) -> str:
    """What was found, what could not show, and what it does to the uncertainties."""
    there = [
        f"{what} {_size(noise.components[name])}"
        for name, what in _NAMES.items()
        if name in noise.components and noise.components[name].probability > _SHOWN
    ]
    if noise.axes_apart > _SHOWN:
        axes = [f"{axis.upper()} {noise.components[axis].size.value:.2g}" for axis in "xyz"]
        there.insert(0, f"readings that scatter by axis ({', '.join(axes)} µm)")
    found = f"beside independent readings {listed(there)}" if there else "independent readings, nothing else"
    times = f"; standard uncertainties are up to {noise.wider:.2f} times those under white noise"
    wider = times if noise.wider >= _WIDER else ""
    hidden = [what for name, what in _COULD_NOT.items() if name not in noise.components]
    missing = f". Not to be seen in this recording: {listed(hidden)}" if hidden else ""
    return f"{found}{wider}{missing}"


_COULD_NOT = {"placing": "set-up offsets (no repeats)", "slow": "slow noise (no time)"}


def _size(component: Component) -> str:
    return f"{component.size.value:.2g} µm (probability {component.probability:.2f})"
