"""TOML within its limits is what the standard library reads; beyond them it is refused at once, with line or key."""

from __future__ import annotations

import time
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import DEPTH, NUMERAL, TEXT, TOML_KEY, WORD
from cmm_uq.base.files.toml_file import checked, toml_of
from cmm_uq.jobs.job import JobFacts


@given(st.text("ab=\"'[]{}.,#\\\n 1_", max_size=60))
def test_short_text_is_read_as_the_standard_library_does(text: str) -> None:
    try:
        expected = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        with pytest.raises((tomllib.TOMLDecodeError, CmmUqError)):
            toml_of(text, "t.toml")
        return
    try:
        assert toml_of(text, "t.toml") == expected
    except CmmUqError as error:
        assert "nested too deeply" in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    "text",
    [
        f"a = {'[' * 20}1{']' * 20}",
        f'a = "{"[ " * 3000}"  # {"[" * 3000}',
        f"a = '''\n{'[ ' * 3000}'''\nb = \"\"\"{'{ ' * 3000}\\\"\"\"\"\"\nc = '{'[ ' * 3000}'",
        "a." * 19 + "a = 1",
        "\n".join(f"k{i} = [1.5, 2.5]" for i in range(1000)),
        f"a = {'9' * NUMERAL.most}",
        f'a = "{"w " * (TEXT.most // 2)}"\n{"k" * TOML_KEY.most} = "{"w" * WORD.most}"',
        'a = "Grüße,\\n שלום \\u200f\\u200d"',
    ],
)
def test_what_is_within_the_limits_is_read(text: str) -> None:
    assert toml_of(text, "t.toml") == tomllib.loads(text)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("\na = " + "[" * 3000 + "]" * 3000, "line 2: is nested too deeply"),
        ("a = " + "{a=" * 3000 + "1" + "}" * 3000, "nested too deeply"),
        ("[" + "a." * 3000 + "a]", "nested too deeply"),
        ("a . " * 200_000 + "a = 1", "nested too deeply"),
        ("'a' .\t" * 200_000 + "a = 1", "nested too deeply"),
        (".".join("a" * (DEPTH.most - 1)) + " = [[[1]]]", "nested too deeply"),
        ("a = " + "9" * 5000, "has 5000 characters: as a number"),
        ("a = " + "1_" * 3000 + "1", "has 6001 characters"),
        ("k" * 100_000 + " = 1", "has 100000 characters"),
        ('"' + "k" * 101 + '" = 1', "a key of 101 characters"),
        ('a = "' + "w " * TEXT.most + '"', "a: a text of 20000 characters"),
        ('[x]\na = ["' + "w" * (WORD.most + 1) + '"]', "x.a: a word of 501 characters"),
        ('a = "b\\u202ec"', r"a: has the control character U\+202E"),
        ('a = "b\\u0000"', r"U\+0000"),
        ('"a\\u001b" = 1', r"U\+001B"),
        ("a = [" + "1," * 10_001 + "]", "a: has 10001 entries"),
    ],
    ids=range(16),
)
def test_what_goes_beyond_a_limit_is_refused(text: str, says: str) -> None:
    with pytest.raises(CmmUqError, match=says) as caught:
        toml_of(text, "t.toml")
    assert str(caught.value).startswith("t.toml")


@pytest.mark.parametrize("unit", ['"""', "'''", '"', '\\"', "a.b ", "[", "]", "'a' .", "#", "a" * 90 + " "])
def test_time_grows_no_faster_than_the_text(unit: str) -> None:
    """Quadratic reading of a megabyte would take many minutes."""
    start = time.monotonic()
    with pytest.raises((tomllib.TOMLDecodeError, CmmUqError)):
        toml_of('a = "' + unit * (300_000 // len(unit)) + "\n =", "t.toml")
    with pytest.raises((tomllib.TOMLDecodeError, CmmUqError)):
        toml_of(unit * (300_000 // len(unit)) + "\n =", "t.toml")
    assert time.monotonic() - start < 30


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[artefact]\nkind = "x"\ncertificate = { file = "a" }\n\n[artefact.certificate]\nnumber = "1"\n',
         "job.toml line 5: states artefact.certificate twice: in line 3 and in line 5. Keep one of both: write all keys of "
         "[artefact.certificate] below its heading, or all of them in the line of its key"),
        ('[artefact.certificate]\nnumber = "1"\n[artefact]\ncertificate = { a = 1 }\n',
         "job.toml line 4: states artefact.certificate twice: in line 1 and in line 4. Keep one of both"),
        ("[job]\nid = 1\nid = 2\n", "job.toml line 3: states job.id twice: in line 2 and in line 3. Keep one of them"),
        ("[job]\nid = 1\n[job]\nname = 2\n", "job.toml line 3: states job twice: in line 1 and in line 3"),
        ("[job\n", "job.toml: is not valid TOML: "),
    ],
)  # fmt: skip
def test_what_is_stated_twice_is_told_with_both_lines(text: str, said: str) -> None:
    with pytest.raises(CmmUqError) as refused:
        checked(text.encode(), Path("job.toml"), JobFacts)
    assert str(refused.value).startswith(said)
