"""The catalogues in step with the sentences of the program: ``python -m tests.catalogues`` brings in what is new.

A sentence that was changed keeps its translation, marked fuzzy; a new one is empty; what is no longer said is dropped. Both
are found by ``tests/base/languages/test_catalogues.py`` until somebody has translated them, and stay English in documents.
"""

from __future__ import annotations

import ast
import string
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import get_args

import polib

from cmm_uq.base.languages.translation import ENGLISH, Code, file_of
from tests.conftest import ROOT
from tests.sources import tree_of

PACKAGE = ROOT / "cmm_uq"
SHOWN_ELSEWHERE = (
    "app/cli/", "app/commands/budget.py", "app/serve/", "app/desk/", "laboratory/live/", "laboratory/schedule/", "jobs/dcc/",
    "certificate/sign/", "certificate/verify/",
)  # fmt: skip
"""Rooms whose texts no document shows: those of a terminal, of the pages of records, and of messages that are sent."""
SHOWN = {"certificate/sign/signer.py"}
"""Modules of these rooms with a text that a document shows: the seal's, of a test key."""
TRANSLATED = [code for code in get_args(Code) if code != ENGLISH]
FORMS: Mapping[str, str] = {
    "de": "nplurals=2; plural=(n != 1);", "fr": "nplurals=2; plural=(n > 1);", "ja": "nplurals=1; plural=0;",
}  # fmt: skip

Key = tuple[str, ...]
"""A pattern, or the two of a plural."""


def sentences() -> dict[Key, list[str]]:
    """Every pattern that a document may show, with the files that it stands in, in their order."""
    found: dict[Key, list[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        within = path.relative_to(PACKAGE).as_posix()
        if not within.startswith(SHOWN_ELSEWHERE) or within in SHOWN:
            for key in patterns(tree_of(path)):
                files = found.setdefault(key, [])
                files += [name] * (name not in files)
    return found


def patterns(tree: ast.AST) -> Iterator[Key]:
    """Of the calls of ``say`` and ``plural`` in a module, as they stand in it; a plural of two literals is one."""
    calls = sorted((node for node in ast.walk(tree) if isinstance(node, ast.Call)), key=_place)
    pairs = {one: many for call in calls if _named(call, "plural") for one, many in plural_forms(call, tree)}
    for call in calls:
        if call not in pairs.values() and (own := _pattern(call)) is not None:
            yield (own, str(_pattern(pairs[call]))) if call in pairs else (own,)


def _place(node: ast.expr) -> tuple[int, int]:
    return node.lineno, node.col_offset


def plural_forms(plural: ast.Call, tree: ast.AST) -> list[tuple[ast.Call, ast.Call]]:
    """The literals of one and of many, in the call itself or in what its names were given before it in the same block."""
    given = {keyword.arg: keyword.value for keyword in plural.keywords}
    found = [_literals(given[form], plural, tree) for form in ("one", "many") if form in given]
    return list(zip(*found, strict=False)) if len(found) == 2 else []


def _literals(value: ast.expr, plural: ast.Call, tree: ast.AST) -> list[ast.Call]:
    if _pattern(value) is not None and isinstance(value, ast.Call):
        return [value]
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and plural in ast.walk(node)]
    earlier = [node for function in functions[-1:] for node in ast.walk(function)
               if isinstance(node, ast.Assign) and node.lineno < plural.lineno]  # fmt: skip
    since = max((node.end_lineno or 0 for node in ast.walk(tree) if _named(node, "plural") and _place(node) < _place(plural)
                 and isinstance(node, ast.Call)), default=0)  # fmt: skip
    return [
        node.value
        for node in sorted(earlier, key=lambda n: n.lineno)
        if node.lineno > since and isinstance(node.value, ast.Call) and _pattern(node.value) is not None
        and isinstance(value, ast.Name) and [t.id for t in node.targets if isinstance(t, ast.Name)] == [value.id]
    ]  # fmt: skip


def _named(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name


def _pattern(node: ast.AST) -> str | None:
    """Of a call of ``say`` with a literal."""
    if not _named(node, "say") or not isinstance(node, ast.Call) or not node.args:
        return None
    first = node.args[0]
    return first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else None


def key_of(entry: polib.POEntry) -> Key:
    """The English of an entry."""
    return (entry.msgid, entry.msgid_plural) if entry.msgid_plural else (entry.msgid,)


def forms_of(entry: polib.POEntry) -> list[str]:
    """Its translation: one text, or a form for each of the plurals."""
    return [form for _, form in sorted(entry.msgstr_plural.items())] if entry.msgid_plural else [entry.msgstr]


def problems(catalogue: polib.POFile, wanted: Mapping[Key, Sequence[str]], plurals: int) -> list[str]:
    """What is wrong with a catalogue: sentences missing, empty, fuzzy or left over, and placeholders that do not agree."""
    entries = {key_of(entry): entry for entry in catalogue if not entry.obsolete}
    told = [f"missing: {key[-1]!r}" for key in wanted if key not in entries]
    told += [f"said nowhere: {key[-1]!r}" for key in entries if key not in wanted]
    for key, entry in entries.items():
        forms = forms_of(entry)
        if entry.fuzzy:
            told.append(f"fuzzy: {key[-1]!r}")
        if not all(forms):
            told.append(f"empty: {key[-1]!r}")
        elif len(forms) != (1 if len(key) == 1 else plurals):
            told.append(f"{len(forms)} forms: {key[-1]!r}")
        else:
            told += [f"placeholders: {form!r} of {key[-1]!r}" for form in disagreeing(key, forms)]
    return told


def disagreeing(key: Key, forms: Sequence[str]) -> list[str]:
    """Forms that name what English does not, round otherwise, or leave out what is said of many."""
    known, needed = set[tuple[str, str]](), {name for name, _ in fields(key[-1])}
    for pattern in key:
        known |= fields(pattern)
    known |= {(name, "") for name, spec in known if spec in ("capital", "small")} | {
        (name, change) for name, spec in known if not spec for change in ("capital", "small")
    }
    odd = [form for form in forms if not fields(form) <= known]
    return odd + [form for form in forms[-1:] if needed - {name for name, _ in fields(form)}]


def fields(pattern: str) -> set[tuple[str, str]]:
    """Placeholders with how they are rounded; one that cannot be read stands for itself."""
    try:
        return {(name, spec or "") for _, name, spec, _ in string.Formatter().parse(pattern) if name is not None}
    except ValueError:
        return {(pattern, "unreadable")}


def merged(catalogue: polib.POFile, wanted: Mapping[Key, Sequence[str]], code: Code) -> polib.POFile:
    """A catalogue with an entry for each sentence, in the order of the files that they stand in."""
    old = {key_of(entry): entry for entry in catalogue if not entry.obsolete}
    left = {key[-1]: entry for key, entry in old.items() if key not in wanted}
    made = polib.POFile(wrapwidth=120)
    made.metadata = {
        "Project-Id-Version": "cmm_uq", "MIME-Version": "1.0", "Content-Type": "text/plain; charset=utf-8",
        "Content-Transfer-Encoding": "8bit", "Language": code, "Plural-Forms": FORMS[code],
    }  # fmt: skip
    for key, files in wanted.items():
        entry = old.get(key) or _new(key, left, int(FORMS[code][9]))
        entry.occurrences = [(name, "") for name in files]
        made.append(entry)
    return made


def _new(key: Key, left: Mapping[str, polib.POEntry], plurals: int) -> polib.POEntry:
    """With the translation of the sentence that it seems to have been, for somebody to look at."""
    close = get_close_matches(key[-1], left, 1, 0.75)
    before = left[close[0]] if close and len(key_of(left[close[0]])) == len(key) else None
    forms = forms_of(before) if before is not None else [""] * (1 if len(key) == 1 else plurals)
    flags = ["fuzzy"] if before is not None else []
    if len(key) == 1:
        return polib.POEntry(msgid=key[0], msgstr=forms[0], flags=flags)
    return polib.POEntry(msgid=key[0], msgid_plural=key[1], msgstr_plural=dict(enumerate(forms)), flags=flags)


def read(path: Path) -> polib.POFile:
    """A catalogue; an empty one where the file is still to be made."""
    return polib.pofile(str(path), wrapwidth=120) if path.exists() else polib.POFile(wrapwidth=120)


def main() -> None:
    """Bring all catalogues in step and say what is to be done."""
    wanted = sentences()
    for code in TRANSLATED:
        path = file_of(code)
        made = merged(read(path), wanted, code)
        made.save(str(path))
        told = problems(made, wanted, int(FORMS[code][9]))
        print(f"{path.name}: {len(made)} sentences, {len(told)} to look at")


if __name__ == "__main__":
    main()
