"""What the noise of a recording is like, in words for the certificate."""

from __future__ import annotations

from cmm_uq.base.messages import Text, listed, say
from cmm_uq.certificate.result import Noise

_SHOWN = 0.8
"""Probability from which a component is said to be there; beforehand it is at most one half."""

_WIDER = 1.05


def noise_found(noise: Noise, *, heavy_tails: bool) -> Text:
    """What was found, what could not show, and what it does to the uncertainties.

    Parameters
    ----------
    noise : as estimated.
    heavy_tails : whether the diagnosis found heavy tails, which are no component of the estimate.
    """
    there = _found(noise)
    if heavy_tails:
        there.append(say("heavier tails than those of the normal distribution that the estimate assumes"))
    found: Text = (
        say("independent readings, and {what}", what=listed(there))
        if there
        else say("independent readings, nothing else")
    )
    if noise.wider >= _WIDER:
        found = say(
            "{found}; standard uncertainties are up to {times:.2f} times those under white noise",
            found=found, times=noise.wider,
        )  # fmt: skip
    hidden: list[Text] = []
    if "placing" not in noise.components:
        hidden.append(say("set-up offsets (no repeats)"))
    hidden.append(
        say("what had drifted before the first reading") if "slow" in noise.components else say("slow noise (no times)")
    )
    return say("{found}; not to be seen in this recording: {what}", found=found, what=listed(hidden))


def _found(noise: Noise) -> list[Text]:
    """The components that are probably there."""
    there: list[Text] = []
    components = noise.components
    if noise.axes_apart > _SHOWN:
        x, y, z = (components[axis].size.value for axis in "xyz")
        there.append(say("a scatter that differs by axis (X {x:.2g}, Y {y:.2g}, Z {z:.2g} µm)", x=x, y=y, z=z))
    if noise.display_um:
        there.append(say("the steps of the display, {step:.2g} µm", step=noise.display_um))
    size = {name: components[name].size.value for name in ("placing", "growth", "slow") if name in components}
    p = {name: components[name].probability for name in size}
    if p.get("placing", 0.0) > _SHOWN:
        there.append(
            say(
                "an offset of {size:.2g} µm of each set-up, shared by its repeats (probability {p:.2f})",
                size=size["placing"], p=p["placing"],
            )
        )  # fmt: skip
    if p.get("growth", 0.0) > _SHOWN:
        there.append(
            say(
                "scatter that grows with length to {size:.2g} µm (probability {p:.2f})",
                size=size["growth"],
                p=p["growth"],
            )
        )
    if p.get("slow", 0.0) > _SHOWN:
        there.append(say("slow noise in time of {size:.2g} µm (probability {p:.2f})", size=size["slow"], p=p["slow"]))
    return there
