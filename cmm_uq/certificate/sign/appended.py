"""What may be appended to a signed PDF: time stamps, evidence, and further signatures with their place in the structure.

The library's policy knows all but the last: it takes a further signature of a tagged PDF for a change of its structure. The
rule here lets the structure grow by form controls of signatures, at its end, and by nothing else.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any

from pyhanko.pdf_utils.generic import ArrayObject, DictionaryObject, IndirectObject
from pyhanko.sign.diff_analysis import DEFAULT_DIFF_POLICY, ModificationLevel, StandardDiffPolicy
from pyhanko.sign.diff_analysis.rules_api import ReferenceUpdate, WhitelistRule

_ELEMENT = {"/Type", "/S", "/P", "/Alt", "/Pg", "/K"}
_GROWING = {"/K", "/ParentTree", "/ParentTreeNextKey"}


class Tagged(WhitelistRule):  # type: ignore[misc]
    """Approves a structure tree that differs by form controls of signatures at its end."""

    def apply(self, old: Any, new: Any) -> Iterable[ReferenceUpdate]:
        """References of what grew, or none where anything else differs."""
        try:
            return [ReferenceUpdate(one) for one in _grown(old, new)]
        except (KeyError, IndexError, TypeError, AttributeError, ValueError):
            return []


POLICY = StandardDiffPolicy(
    [*DEFAULT_DIFF_POLICY.global_rules, Tagged().as_qualified(ModificationLevel.FORM_FILLING)],
    DEFAULT_DIFF_POLICY.form_rule,
)


def _grown(old: Any, new: Any) -> list[Any]:
    """References of what grew; none where the tree is a part of an object that holds more, or differs otherwise."""
    if not isinstance(new.root.raw_get("/StructTreeRoot"), IndirectObject):
        return []
    before, after = old.root["/StructTreeRoot"], new.root["/StructTreeRoot"]
    top_before, top_after = _top(before), _top(after)
    numbers_before, numbers_after = before["/ParentTree"]["/Nums"], after["/ParentTree"]["/Nums"]
    kids = _added(_list(top_before), _list(top_after))
    numbers = _added(numbers_before, numbers_after)
    elements = [one.reference for one in kids]
    listed = [one.reference for one in numbers[1::2]]
    same = (
        _same(before, after, _GROWING) and _same(top_before, top_after, {"/K"})
        and _same(before["/ParentTree"], after["/ParentTree"], {"/Nums"})
        and _text(before.raw_get("/K")) == _text(after.raw_get("/K"))
        and elements == listed and all(old.is_ref_unassignable(one) and _is_control(new(one)) for one in elements)
    )  # fmt: skip
    if not same or not elements:
        return []
    holders = [after, top_after, after["/ParentTree"], numbers_after, _list(top_after)]
    held = [one.container_ref for one in holders if one.container_ref is not None]
    return [*elements, *held]


def _top(root: Any) -> Any:
    """The element that all others are below."""
    return root["/K"][0] if isinstance(root["/K"], ArrayObject) else root["/K"]


def _list(element: Any) -> Any:
    held = element["/K"]
    return held if isinstance(held, ArrayObject) else ArrayObject([element.raw_get("/K")])


def _added(before: Any, after: Any) -> list[Any]:
    """What stands behind the end of a list that is otherwise the same.

    Raises
    ------
    ValueError : it is not the same.
    """
    if [_text(one) for one in before] != [_text(after.raw_get(i)) for i in range(len(before))]:
        raise ValueError
    return [after.raw_get(i) for i in range(len(before), len(after))]


def _same(before: Any, after: Any, but: set[str]) -> bool:
    keys = set(before) - but
    return set(after) - but == keys and all(_text(before.raw_get(key)) == _text(after.raw_get(key)) for key in keys)


def _is_control(element: Any) -> bool:
    """Whether an element of the structure is that of a signature's field, and of nothing else."""
    target = element["/K"]
    return bool(
        isinstance(element, DictionaryObject) and set(element) <= _ELEMENT and element["/S"] == "/Form"
        and target["/Type"] == "/OBJR" and target["/Obj"]["/FT"] == "/Sig"
    )  # fmt: skip


def _text(held: Any) -> bytes:
    """An object as a file has it, references by their numbers."""
    if isinstance(held, IndirectObject):
        return b"%d %d R" % (held.idnum, held.generation)
    output = io.BytesIO()
    held.write_to_stream(output)
    return output.getvalue()
