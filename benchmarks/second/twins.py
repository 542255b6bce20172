"""Which effects a fault of an artefact is: how every effect that may be said of it displaces the artefact's points.

A twin of a machine's error is what that error would make of the artefact in its reference set-up, the one least turned
against its own axes, and it turns with the artefact.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.concealed.physics import PLACE, Error, component, kind_of, place
from benchmarks.second.artefacts import Placed

if TYPE_CHECKING:
    from benchmarks.second.cases import Seen

GEOMETRY: dict[str, Error] = {
    **{name: error for name, error in PLACE.items() if kind_of(name) != "periodic_scale"},
    **{
        f"scale_curvature_{a}": (lambda p, c, i=i: component(i, 1e-3 * (1 - (2 * place(p, i) - 1) ** 2)))
        for i, a in enumerate("xyz")
    },
}
"""Errors of a machine that an artefact of several places may look like; turns of the ram move nothing that it carries."""


def right(seen: Seen, kind: str, words: str, moved: np.ndarray, unseen: float) -> dict[str, list[str]]:
    """Names of effects of the artefact that a fault is, of those that leave less than ``unseen`` of it, and of which are one.

    Parameters
    ----------
    seen : the recording.
    kind, words : of the fault, as :func:`benchmarks.second.faults.fault` draws it.
    moved : (n, 3) displacements of the artefact's points, mm.
    unseen : √λ below which nobody could tell what is left.
    """
    signal, among = seen.of_fault(moved), fields(seen.design)
    left = {name: seen.left(signal, _columns(seen, field)) for name, field in among.items()}
    twins = {name: left[name] for name in left if name.removeprefix("artefact_") in GEOMETRY}
    if kind == "geometry":
        own = [name for name in twins if twins[name] <= min(twins.values()) + 1e-6 * float(np.linalg.norm(signal))]
    elif seen.design.kind == "sphere":
        own = ["artefact_form"]
    else:
        own = _parts(seen, kind, words, moved, unseen)
    return {"is": own, "alike": [name for name in left if left[name] < unseen and name not in own],
            "same": _same(seen, {name: field for name, field in among.items() if name in twins})}  # fmt: skip


def _same(seen: Seen, twins: dict[str, np.ndarray]) -> list[list[str]]:
    """Classes of twins that are one and the same deformation in this recording: a plate out of square is also one turned."""
    classes: list[tuple[np.ndarray, list[str]]] = []
    for name, field in twins.items():
        (column,) = _columns(seen, field)
        length = float(np.linalg.norm(column))
        if length <= 1e-9 * float(np.linalg.norm(field)):
            continue
        form = column / length
        of = next((names for other, names in classes if 1 - abs(float(form @ other)) < 1e-9), None)
        if of is None:
            classes.append((form, [name]))
        else:
            of.append(name)
    return [names for _, names in classes if len(names) > 1]


def _parts(seen: Seen, kind: str, words: str, moved: np.ndarray, unseen: float) -> list[str]:
    """A fault without form is two effects: a scale of all, the artefact's temperature, where it is seen; and the rest."""
    rest = "artefact_pattern" if kind == "pattern" else "artefact_set_up_temperature"
    if kind == "temperature" and "every" not in words:
        return ["artefact_temperature"]
    longer = _turned(seen.design, seen.design.own - seen.design.own.mean(axis=0))
    scale = float(np.sum(longer * moved) / np.sum(longer**2))
    large = float(np.linalg.norm(seen.of_fault(scale * longer))) >= unseen
    return [rest, "artefact_temperature"] if large or seen.design.kind == "ballbar" else [rest]


def fields(placed: Placed) -> dict[str, np.ndarray]:
    """Displacements (n, 3, r), mm, of the artefact's points for each coefficient of what may be wrong with it itself."""
    if placed.kind == "sphere":
        return _form(placed)
    found = {"artefact_temperature": _turned(placed, placed.own)[:, :, None]}
    if placed.kind == "ballbar":
        return found
    by = (placed.measurement[:, None] == np.unique(placed.measurement)).astype(float)
    if by.shape[1] > 1:
        away = by - by.mean(axis=1, keepdims=True)
        found["artefact_set_up_temperature"] = np.einsum("nj,nq->njq", _turned(placed, placed.own), away)
    nodes = (placed.node[:, None] == np.unique(placed.node)).astype(float)
    axes = 1 if placed.kind == "step_gauge" else 3
    found["artefact_pattern"] = np.einsum("nij,nq->njqi", placed.axes[:, :axes], nodes).reshape(len(nodes), 3, -1)
    if placed.kind == "step_gauge":
        return found | {"artefact_scale_curvature_x": _twin(placed, GEOMETRY["scale_curvature_x"])}
    found |= {f"artefact_{name}": _twin(placed, error) for name, error in GEOMETRY.items()}
    normal, across = placed.axes[:, 2], placed.own[:, :2] - placed.own[:, :2].mean(axis=0)
    u, v = (across / np.linalg.norm(across, axis=1).max()).T
    found["artefact_bending"] = (normal[:, 2] * (1 - u**2 - v**2))[:, None, None] * normal[:, :, None]
    bends = np.einsum("nk,nq->nkq", np.column_stack([u**2, v**2, u * v]), by).reshape(len(by), -1)
    return found | {"artefact_fixture": normal[:, :, None] * bends[:, None, :]}


def _columns(seen: Seen, field: np.ndarray) -> list[np.ndarray]:
    return [seen.of_fault(field[:, :, i]) for i in range(field.shape[2])]


def _turned(placed: Placed, own: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("ni,nij->nj", own, placed.axes))


def _twin(placed: Placed, error: Callable[[np.ndarray, dict], np.ndarray]) -> np.ndarray:
    """What an error of the machine makes of the artefact in its reference set-up, (n, 3, 1)."""
    _, first = np.unique(placed.measurement, return_index=True)
    turned = np.round(np.einsum("qii->qi", placed.axes[first]).sum(axis=1), 2)
    starts = placed.true[first] - _turned(placed, placed.own)[first]
    _, of_node = np.unique(placed.node, return_index=True)
    middle = placed.own[of_node].mean(axis=0)
    centres = starts + np.einsum("i,qij->qj", middle, placed.axes[first])
    row = np.lexsort((*np.round(centres.T, 0), -turned))[0]
    there = starts[row] + placed.own @ placed.axes[first[row]]
    field = error(there, {})
    return _turned(placed, field @ placed.axes[first[row]].T)[:, :, None]


def _form(placed: Placed) -> dict[str, np.ndarray]:
    """Of a sphere: three lobes; harmonics of the degrees 2 to 5, as polynomials in the normal without size and place."""
    n = placed.axes[:, 0]
    angle = 3 * np.arctan2(n[:, 1], n[:, 0])
    lobes = np.column_stack([np.cos(angle), np.sin(angle)])
    powers = [(i, j, k) for i in range(6) for j in range(6 - i) for k in (0, 1) if 2 <= i + j + k <= 5]
    form = np.column_stack([n[:, 0] ** i * n[:, 1] ** j * n[:, 2] ** k for i, j, k in powers])
    return {"artefact_lobing": n[:, :, None] * lobes[:, None, :], "artefact_form": n[:, :, None] * form[:, None, :]}
