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
    """What a new job of a kind begins with.

    title : what is measured, in words.
    numbering : what ``measurement`` and ``point`` number, in a sentence.
    artefact : keys of ``[artefact]`` beside its kind.
    effects : that the model names.
    conformity : one statement, or none.
    test : tables of the circumstances that a pass needs beside it.
    recorded : columns of the first recording at a constant value.
    plan : keys of ``[plan]`` by which the kind's usual plan makes the set-ups of the first recording.
    columns : that the recording must have beside those of every kind, with a sentence for those that are the kind's own.
    further : that it may have, likewise.
    points : the set-ups, where the kind has no plan of placings.
    files : contents of files that the machine's table names, by name, where there is no recording; with ``machine``.
    machine : keys of ``[machine]`` that name them.
    noise_um : standard deviation of the readings of the first recording.
    command : that serves such a job.
    """

    title: str
    numbering: str
    artefact: Mapping[str, Any] = field(default_factory=dict)
    effects: tuple[str, ...] = SIX
    conformity: Mapping[str, Any] | None = None
    test: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    recorded: Mapping[str, float] = field(default_factory=dict)
    plan: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    further: Mapping[str, str] = field(default_factory=dict)
    points: Callable[[Machine], Points] | None = None
    files: Callable[[Machine], Mapping[str, bytes]] | None = None
    machine: Mapping[str, Any] = field(default_factory=dict)
    noise_um: float = 0.5
    command: str = "report"


# ``[machine]`` of a new job of any kind
MACHINE: Mapping[str, Any] = MappingProxyType({
    "name": "Bridge machine", "travel_mm": {"x": [0.0, 700.0], "y": [0.0, 1000.0], "z": [-600.0, 0.0]},
})  # fmt: skip
AT_20_C: Mapping[str, float] = MappingProxyType({"temp_artefact_c": 20.0})  # in a first recording


def circumstances(**uncertainty: float) -> Mapping[str, Mapping[str, Any]]:
    """Tables that a pass needs: these lines of the test uncertainty, and rated temperatures."""
    return {"test_uncertainty": uncertainty, "rated_conditions": {"temperature_c": [18.0, 22.0]}}
