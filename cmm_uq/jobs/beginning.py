"""What a new job of a kind begins with, so that it can be reported at once and then be given the laboratory's own figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from cmm_uq.base.points import Machine, Points

# effects that a length standard in many places determines
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


@dataclass(frozen=True)
class Beginning:
    """What a new job of a kind begins with."""

    title: str  # what is measured, in words
    numbering: str  # what ``measurement`` and ``point`` number, in a sentence
    artefact: Mapping[str, Any] = field(default_factory=dict)  # keys of ``[artefact]`` beside its kind
    effects: tuple[str, ...] = SIX  # that the model names
    conformity: Mapping[str, Any] | None = None  # one statement, or none
    # tables of the circumstances that a pass needs beside it
    test: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    recorded: Mapping[str, float] = field(default_factory=dict)  # columns of the first recording at a constant value
    # keys of ``[plan]`` by which the kind's usual plan makes the set-ups of the first recording
    plan: Mapping[str, Any] = field(default_factory=dict)
    # that the recording must have beside those of every kind, with a sentence for those that are the kind's own
    columns: Mapping[str, str] = field(default_factory=dict)
    further: Mapping[str, str] = field(default_factory=dict)  # that it may have, likewise
    points: Callable[[Machine], Points] | None = None  # the set-ups, where the kind has no plan of placings
    # contents of files that the machine's table names, by name, where there is no recording; with ``machine``
    files: Callable[[Machine], Mapping[str, bytes]] | None = None
    machine: Mapping[str, Any] = field(default_factory=dict)  # keys of ``[machine]`` that name them
    noise_um: float = 0.5  # standard deviation of the readings of the first recording
    command: str = "report"  # that serves such a job


# ``[machine]`` of a new job of any kind
MACHINE: Mapping[str, Any] = MappingProxyType({
    "name": "Bridge machine", "travel_mm": {"x": [0.0, 700.0], "y": [0.0, 1000.0], "z": [-600.0, 0.0]},
})  # fmt: skip
AT_20_C: Mapping[str, float] = MappingProxyType({"temp_artefact_c": 20.0})  # in a first recording


def circumstances(**uncertainty: Any) -> Mapping[str, Mapping[str, Any]]:
    """Tables that a pass needs: these lines of the test uncertainty, and rated temperatures."""
    return {"test_uncertainty": uncertainty, "rated_conditions": {"temperature_c": [18.0, 22.0]}}
