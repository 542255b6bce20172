"""The words of an effect: blanks that stand for its axes and for the reported amount, and that amount as printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cmm_uq.base.messages import Argument, Message, Text, Verbatim, fields_of

# blanks in words: the axes, and of the reported amount its size, side and sense, and the size of a second parameter
_BLANKS = ("axis", "other", "size", "side", "sense", "second")
AXIS, OTHER, SIZE, SIDE, SENSE, SECOND = (Verbatim(f"‹{blank}›") for blank in _BLANKS)
# what stands for them in a pattern
_NAMES: Mapping[str, Text] = {
    "axis": AXIS, "other": OTHER, "direction": OTHER, "about": OTHER, "size": SIZE, "amplitude": SIZE, "side": SIDE,
    "sense": SENSE, "more": SENSE, "wrong": SENSE, "where": SECOND, "period": SECOND, "settling": SECOND,
}  # fmt: skip


def say(pattern: str, /, **arguments: Argument) -> Message:
    """Words of an effect: what its pattern names without an argument is a blank."""
    known = {**_NAMES, **arguments}
    return Message(pattern, {name: known[name] for name in sorted(fields_of(pattern))})


def filled(text: Text, blanks: Mapping[Text, Text]) -> Text:
    """A message with its blanks filled in."""
    if not isinstance(text, Message):
        return text
    given = text.arguments.items()
    return Message(text.pattern, {k: blanks.get(v, v) if isinstance(v, Text) else v for k, v in given})


@dataclass(frozen=True)
class Amount:
    """How much of a parameter, for a sentence: without its sign, with unit and uncertainty, as printed; and the sign."""

    size: Text
    negative: bool = False

    @property
    def side(self) -> Text:
        """Towards which end of an axis the sign points."""
        return say("minus") if self.negative else say("plus")

    def more(self, more: Text, less: Text) -> Text:
        """The one word for a positive amount, the other for a negative one."""
        return less if self.negative else more
