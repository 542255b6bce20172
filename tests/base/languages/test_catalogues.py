"""Every sentence that a document may show is in every catalogue, translated, with the same placeholders."""

from __future__ import annotations

import ast
import os
import re
import subprocess
from collections import Counter
from functools import cache
from shutil import which

import polib
import pytest

from cmm_uq.base.languages.translation import Code, catalogue, file_of
from tests.catalogues import (
    FORMS,
    PACKAGE,
    TRANSLATED,
    forms_of,
    key_of,
    merged,
    patterns,
    plural_forms,
    problems,
    read,
    sentences,
)
from tests.sources import tree_of

wanted_sentences = cache(sentences)


@pytest.mark.parametrize("code", TRANSLATED)
def test_no_sentence_is_missing_guessed_empty_or_left_over_and_placeholders_agree(code: Code) -> None:
    assert problems(read(file_of(code)), wanted_sentences(), int(FORMS[code][9])) == []


@pytest.mark.parametrize("code", TRANSLATED)
def test_a_catalogue_stands_in_the_order_of_the_files(code: Code) -> None:
    assert [key_of(entry) for entry in read(file_of(code))] == list(wanted_sentences())


@pytest.mark.parametrize("code", TRANSLATED)
def test_the_program_reads_a_catalogue_as_gettext_does(code: Code) -> None:
    found, entries = catalogue(code), read(file_of(code))
    assert found.single == {entry.msgid: entry.msgstr for entry in entries if not entry.msgid_plural}
    assert found.plural == {key_of(entry): tuple(forms_of(entry)) for entry in entries if entry.msgid_plural}


@pytest.mark.parametrize("code", TRANSLATED)
def test_other_programs_read_a_catalogue_too(code: Code) -> None:
    """No ``msgid`` stands twice, not even as the singular of another; and gettext's own compiler has nothing against it."""
    said = [entry.msgid for entry in read(file_of(code))]
    assert [one for one, count in Counter(said).items() if count > 1] == []
    if (program := which("msgfmt")) is not None:
        done = subprocess.run([program, "-c", "-o", os.devnull, file_of(code)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_french_signs_of_two_parts_stand_behind_a_space_that_does_not_break() -> None:
    """And apostrophes are those of print."""
    forms = [form for entry in read(file_of("fr")) for form in forms_of(entry)]
    assert [
        form for form in forms if re.search(r"'|«(?![\u00a0\u202f])|(?<![\u00a0\u202f])[;:!?»](?=\s|$)", form)
    ] == []


def test_no_sentence_begins_or_ends_with_a_blank_that_a_translator_would_lose() -> None:
    assert [pattern for key in wanted_sentences() for pattern in key if pattern != pattern.strip()] == []


@pytest.mark.long
def test_every_plural_has_both_forms_where_it_is_called() -> None:
    """Else each form would be an entry by itself, without the forms that a language has for it."""
    trees = [(path.name, tree_of(path)) for path in sorted(PACKAGE.rglob("*.py"))]
    calls = [(name, call, tree) for name, tree in trees for call in ast.walk(tree)
             if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "plural"]  # fmt: skip
    assert len(calls) > 40
    assert [(name, call.lineno) for name, call, tree in calls if not plural_forms(call, tree)] == []


def test_the_sentences_are_those_of_the_calls() -> None:
    source = (
        "a = say('one {x}')\nb = plural(n, one=say('a thing'), many=say('{n} things', n=n))\nc = say(f'no {literal}')\n"
        "d = plural(n, many=say('{n} more', n=n), one=word)\n"
    )
    assert list(patterns(ast.parse(source))) == [("one {x}",), ("a thing", "{n} things"), ("{n} more",)]
    assert len(wanted_sentences()) > 2000


SMALL = {("a {x:.2f} b",): ["a.py"], ("one", "{n} many"): ["b.py"]}


def small(x: str = "A {x:.2f}", one: str = "eins", many: str = "{n} viele") -> polib.POFile:
    file = polib.POFile()
    file.append(polib.POEntry(msgid="a {x:.2f} b", msgstr=x))
    file.append(polib.POEntry(msgid="one", msgid_plural="{n} many", msgstr_plural={0: one, 1: many}))
    return file


@pytest.mark.parametrize(("file", "told"), [
    (small(), []),
    (small(x=""), ["empty: 'a {x:.2f} b'"]),
    (small(x="A {x:.3f}"), ["placeholders: 'A {x:.3f}' of 'a {x:.2f} b'"]),
    (small(x="A"), ["placeholders: 'A' of 'a {x:.2f} b'"]),
    (small(x="A {x:.2f} {y}"), ["placeholders: 'A {x:.2f} {y}' of 'a {x:.2f} b'"]),
    (small(x="A {x:.2f"), ["placeholders: 'A {x:.2f' of 'a {x:.2f} b'"] ),
    (small(one="{n} eins"), []),
    (small(many="viele"), ["placeholders: 'viele' of '{n} many'"]),
    (polib.POFile(), ["missing: 'a {x:.2f} b'", "missing: '{n} many'"]),
])  # fmt: skip
def test_what_is_wrong_with_a_catalogue_is_found(file: polib.POFile, told: list[str]) -> None:
    assert sorted(set(problems(file, SMALL, 2))) == sorted(told)


def test_a_changed_sentence_keeps_its_translation_to_be_looked_at_and_one_said_nowhere_is_dropped() -> None:
    wanted = {("a {x:.2f} c",): ["a.py"], ("quite another sentence",): ["a.py"]}
    made = merged(small(), wanted, "de")
    assert [(entry.msgid, entry.msgstr, entry.fuzzy) for entry in made] == [
        ("a {x:.2f} c", "A {x:.2f}", True), ("quite another sentence", "", False),
    ]  # fmt: skip
    assert problems(made, wanted, 2) == ["fuzzy: 'a {x:.2f} c'", "empty: 'quite another sentence'"]
    assert problems(made, {}, 2)[:1] == ["said nowhere: 'a {x:.2f} c'"]
