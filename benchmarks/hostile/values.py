"""Odd numbers, words and shapes: what a hand, a spreadsheet or an adversary could leave where a value belongs."""

from __future__ import annotations

import random


class Raw(str):
    """Text that goes into a TOML file as it is, without quotes."""

    __slots__ = ()


NUMBERS = ("0", "-0.0", "1", "-1", "2", "1e-9", "1e-300", "5e-324", "1e9", "1e16", "1e70", "1.7e308", "-1.7e308",
           "1e400", "nan", "-nan", "inf", "-inf", "9223372036854775807", "9223372036854775808",
           "-9223372036854775809", "1" + "0" * 400, "9" * 5000, "0x7fffffffffffffff", "1_000", "-2_11.1357", "+5",
           "0.1000000000000000055511151231257827", "3.0", "20.0", "404.2357", "1e-3", "-1e-3", "360", "1.5")  # fmt: skip

WORDS = ("", " ", "x", "a" * 300, "b" * 5_000, "c" * 100_000, "=HYPERLINK(\"http://x\")", "+1+1", "@SUM(A1)", "-cmd|' /C'!A0",
         "<script>alert(1)</script>", "{{ 7 * 7 }}", "[bold]x[/bold]", "[/]", "%s%n", "../../etc/passwd", "/etc/passwd",
         "/dev/zero", "/dev/stdin", ".", "..", "a/b", "a\\b", "con", "job.toml", "results.json", "manifest.json",
         "certificate.pdf", "truth.toml", ".placing", ".unfinished-x", "\0", "a\0b", "line\nbreak", "\r", "\x1b[31mred",
         "\u202etxt", "\u2028", "\ufeff", "\u0301" * 50, "µm", "Å", "💥" * 20, "ﬀ", "１２", "٣", "nul", "None", "NaN",
         "#", "*", "_", "`", "$x$", "\\", "\"", "'", ",", ";", "a,b", "1,5", "ISO 10360-2", "ballbar", "x_mm", "XYZ",
         "scale_x", "squareness_xy", "artefact_sag", "probe_lobing", "periodic_scale_x", "1e5", "true",
         "2026-02-30")  # fmt: skip

EXPRESSIONS = ("x1", "1", "", "x1 / (x1 - x1)", "tan(x1 * 1e300)", "sqrt(-1 - x1 ** 2)", "x1 ** x1 ** 9", "9 ** 9 ** 9 ** 9",
               "2 ** 100000 * x1", "log(x1 - x1)", "exp(exp(exp(x1)))", "((((((((((x1))))))))))", "(" * 300 + "x1" + ")" * 300,
               "-" * 3000 + "x1", "x1" + " + x1" * 3000, "x1(x2)", "x1[0]", "x1.real", "lambda: 0", "__import__('os')",
               "x1 if x2 else 0", "x1 < x2", "abs(x1, x2)", "atan2(x1)", "pi", "π * x1", "x1 // 2", "x1 % 2", "x1 @ x2",
               "1e400 * x1", "0 * x1", "x1 - x1", "asin(2 + x1)", "x1; x2", "'a' * 99", "x1\n", "x1 #", "10 ** 308 * 10 * x1",
               "9" * 5000, "1_0 * x1", "0x10 * x1", "1j * x1", "x1 ** 0.5", "abs(x1) ** 1e9", "f(x1)", "y", "x9")  # fmt: skip


def scalar(random_: random.Random) -> object:
    """A number, a word, a truth value or a date."""
    kind = random_.random()
    if kind < 0.45:
        return Raw(random_.choice(NUMBERS))
    if kind < 0.55:
        return round(random_.uniform(-1000, 1000), random_.choice((0, 3, 15))) * 10.0 ** random_.choice((0, 0, -6, 6))
    if kind < 0.88:
        return random_.choice(WORDS)
    if kind < 0.91:
        return random_.choice(EXPRESSIONS)
    return Raw(random_.choice(("true", "false", "2026-01-01", "0001-01-01", "9999-12-31", "07:32:00", "2026-01-01T00:00:00Z",
                               "2026-13-01", "{}", "[]")))  # fmt: skip


def value(random_: random.Random) -> object:
    """A scalar, or a shape that no key expects."""
    if random_.random() < 0.8:
        return scalar(random_)
    inner = scalar(random_)
    shapes: tuple[object, ...] = (
        [inner], [inner] * 3, {"a": inner}, [[inner]], [{}], {"x": [0, inner]}, [inner] * 2000,
        Raw("[" * 60 + "]" * 60), Raw("[" * 3000), Raw("[" * 3000 + "]" * 3000),
        Raw("{a=" * 200 + "1" + "}" * 200), [float(i) for i in range(500)], Raw('"unclosed'), Raw(""),
    )  # fmt: skip
    return random_.choice(shapes)
