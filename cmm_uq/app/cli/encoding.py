"""What is written where a stream cannot write a character: the nearest ASCII, so that no encoding stops a command."""

from __future__ import annotations

import codecs
import json
import sys

NEAREST = {
    "±": "+/-", "−": "-", "–": "-", "—": "-", "·": "*", "×": "x", "→": "->", "…": "...", "″": '"', "′": "'", "µ": "u",
    "μ": "u", "°": "deg", "α": "alpha", "β": "beta", "γ": "gamma", "ε": "epsilon", "λ": "lambda", "ν": "nu", "σ": "sigma",
    "φ": "phi", "√": "sqrt", "≤": "<=", "≥": ">=", "⁻": "^-", "²": "2", "³": "3", "⁶": "6", "\u00a0": " ", "\u202f": " ",
    "✓": "yes", "✗": "no", "“": '"', "”": '"', "„": '"', "’": "'", "━": "-", "╸": "-", "╺": "-", "⠋": "-", "▏": "|",
}  # fmt: skip
"""What this program prints beyond ASCII."""

HANDLER = "cmm_uq.nearest"


def any_character() -> None:
    """From now on standard output and standard error write everything, as well as their encodings allow."""
    codecs.register_error(HANDLER, _nearest)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=HANDLER)


def _nearest(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    written = (
        NEAREST.get(c) or c.encode("ascii", "backslashreplace").decode() for c in error.object[error.start : error.end]
    )
    return "".join(written), error.end


def json_for(encoding: str | None, text: str) -> str:
    r"""JSON as it is where an encoding has all of it, else with ``\uXXXX``, which says the same."""
    try:
        text.encode(encoding or "ascii")
    except UnicodeEncodeError:
        return "".join(c if c.isascii() else json.dumps(c)[1:-1] for c in text)
    return text
