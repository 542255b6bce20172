"""Patterns that are accepted read every text in steps that grow with its length; those known to explode are refused."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from hypothesis import assume, given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments import linear
from cmm_uq.laboratory.live.instruments.library import (
    ProfileDraft,
    drafted,
    numbers_in,
    profile_named,
    profile_of,
    ready,
)
from cmm_uq.laboratory.live.instruments.linear import MOST_RUNS, NotLinearError, Use, check_linear, most_runs
from cmm_uq.laboratory.live.instruments.parsing import FramedMessage, Parser
from cmm_uq.laboratory.live.instruments.profile import NUMBER, ProfileFile
from tests.laboratory.live.instruments.backtracking import Counting, check_against_re
from tests.laboratory.live.instruments.test_profile import HEAD, Path

EXPLODES = [
    r"\s*+.*.*x", r"a*+(bc|bc)*d",
    r"(a+)+", r"(a+)+b", r"(a*)*b", r"\s*\s*\s*x", r".*.*.*=", r"(a|a)*b", r"(\s*,?\s*)*", r"(a|ab)*(b|c)*b*d", r"(?:a|aa)+b",
    r"\s*\s*+x", r"\d+\.?\d*x", r"(?>a+a+)b", r"(x+x+)+y", r"(.*)(\d+)z", r"^(\w+\s?)*$", r"(?i)(ab|AB)*c", r"(?:a?){60}a{60}",
    r"([ab]*a[ab]*){3}c", r"(a{1,50}){1,50}b",
]  # fmt: skip
"""Each takes a time that grows faster than its text: exponentially, or with a power of it."""


@pytest.mark.long(but="a")
@pytest.mark.parametrize("pattern", EXPLODES)
def test_what_grows_faster_than_the_text_is_refused_however_it_is_used(pattern: str) -> None:
    for use in ("fullmatch", "search"):
        with pytest.raises(NotLinearError):
            most_runs(pattern, use)  # type: ignore[arg-type]


@pytest.mark.parametrize(("pattern", "text"), [
    (r"(a+)+b", "a"), (r" * * *x", " "), (r"(a|a)*b", "a"), (r"[01]+[.]?[01]*x", "0"), (r" * *+x", " "),
])  # fmt: skip
def test_those_really_take_more_than_twice_the_steps_for_twice_the_text(pattern: str, text: str) -> None:
    short, long = Counting(pattern, 6 * text), Counting(pattern, 12 * text)
    assert not short.fullmatch()
    assert not long.fullmatch()
    assert long.attempts > 2.5 * short.attempts


@pytest.mark.parametrize(("pattern", "use"), [
    (r"\d+x", "search"), (r"a.*b", "search"), (r"[^,]+,x", "search"), (r"\s*,\s*", "split"), (r",(?:.*;)?", "split"),
    (r"\s*;|\s", "split"),
])  # fmt: skip
def test_what_is_linear_at_one_place_may_not_be_from_every_place(pattern: str, use: Use) -> None:
    most_runs(pattern, "fullmatch")
    with pytest.raises(NotLinearError):
        most_runs(pattern, use)
    if use == "search":
        assert most_runs(f"^{pattern}", use) <= 2


@pytest.mark.parametrize(("pattern", "use"), [
    (NUMBER, "fullmatch"), (r"(?<!\d)\d+x", "search"), (r"[\d.]+", "search"), (r"[,;\s]+", "split"), (r"[,;\t]\s*", "split"),
    (r"\s*+\s*", "fullmatch"), (r"(?>\s*)\s*x", "fullmatch"), (r"\d++\.?\d*x", "fullmatch"), (r"(?m)^[^,\n]+,x", "search"),
    (r"(?:ab|cd)*e", "fullmatch"), (r"^\d+(?:\.\d*)?$", "search"), (r"a{3,7}b", "search"), (r"4 +(?!003\b)\d{3}\b", "search"),
])  # fmt: skip
def test_sound_patterns_are_accepted(pattern: str, use: Use) -> None:
    assert most_runs(pattern, use) <= 8


@pytest.mark.parametrize(("pattern", "told"), [
    (r"(?P<a>x)(?P=a)*", "backreference"), (r"(x)?(?(1)a|b)", "backreference or a condition"), (r"(?=.*x)y", "looks ahead"),
    (r"(?:(?:(?:^){9999}){9999}){9999}", "too large"), (r"a{5000}", "too large"), (r"(?:\b)*", "may be empty"),
])  # fmt: skip
def test_what_no_structure_bounds_is_refused(pattern: str, told: str) -> None:
    with pytest.raises(NotLinearError, match=told):
        most_runs(pattern, "fullmatch")


CHARACTERS = st.sampled_from(["a", "b", "[ab]", "[^a]", "."])
QUANTIFIERS = st.sampled_from(["*", "+", "?", "*+", "++", "?+", "*?", "{0,2}", "{2}", "{2,}", "{1,}+"])


def larger(part: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.builds("{}{}".format, part, part),
        st.builds("(?:{}|{})".format, part, part),
        st.builds("(?:{}){}".format, part, QUANTIFIERS),
        st.builds("(?>{})".format, part),
        st.builds("(?<!{}){}".format, CHARACTERS, part),
        st.builds("^{}".format, part),
    )


PATTERNS = st.recursive(CHARACTERS, larger, max_leaves=8)
TEXTS = st.one_of(
    st.text("abc", max_size=40),
    st.tuples(st.text("ab", min_size=1, max_size=3), st.integers(5, 15), st.text("c", max_size=1)).map(
        lambda of: of[0] * of[1] + of[2]
    ),
)  # fmt: skip


def followers(pattern: str) -> int:
    """Most characters of a pattern that may come next at a place of it, each as often as there are ways to it."""
    tree = linear._parser.parse(pattern)
    automaton = linear._Automaton(tree, tree.state.flags)
    out = Counter({-1: sum(automaton.whole.first.values())})
    for (place, _, _), ways in automaton.edges.items():
        out[place] += ways
    return max(1, *out.values())


@pytest.mark.long
@settings(max_examples=400, deadline=None)
@given(pattern=PATTERNS, text=TEXTS)
def test_an_accepted_pattern_tries_no_more_than_its_runs_have_followers(pattern: str, text: str) -> None:
    """Whatever the text: attempts to read a character, counted by a matcher of the tests over the same parsed tree."""
    try:
        runs = most_runs(pattern, "fullmatch")
    except NotLinearError:
        assume(False)
    counted = Counting(pattern, text)
    assert counted.fullmatch() == bool(re.fullmatch(pattern, text))
    looks = 1 + pattern.count("(?<!")  # each of them reads a character besides
    assert counted.attempts <= max(runs, 1) * (len(text) + 1) * followers(pattern) * looks


@pytest.mark.long
@settings(max_examples=400, deadline=None)
@given(pattern=PATTERNS, text=TEXTS)
def test_a_pattern_accepted_for_a_search_tries_no_more_from_all_places_together(pattern: str, text: str) -> None:
    try:
        runs = most_runs(pattern, "search")
    except NotLinearError:
        assume(False)
    counted = check_against_re(pattern, text)
    looks = 1 + pattern.count("(?<!")
    assert counted.attempts <= (max(runs, 1) + 1) * (len(text) + 1) * followers(pattern) * looks


@pytest.mark.long
@settings(max_examples=400, deadline=None)
@given(pattern=PATTERNS, text=TEXTS)
def test_a_separator_reads_nothing_again_and_again(pattern: str, text: str) -> None:
    assume(not re.search(pattern, ""))
    assume(all(found.group() for found in re.finditer(pattern, text)))
    try:
        runs = most_runs(pattern, "split")
    except NotLinearError:
        assume(False)
    counted = Counting(pattern, text)
    assert counted.split() == re.split(pattern, text)
    looks = 1 + pattern.count("(?<!")
    assert counted.attempts <= 2 * (max(runs, 1) + 1) * (len(text) + 1) * followers(pattern) * looks


def patterns_of(profile: ProfileFile) -> list[tuple[str, Use]]:
    parse, found = profile.parse, list[tuple[str | None, Use]]()
    if parse is not None:
        found += [(parse.pattern, "search"), (parse.separator, "split"), *((one, "fullmatch") for one in parse.ignore)]
    found += [(one.pattern, "search") for one in (*profile.ill, *profile.send.poll)]
    found += [(profile.identify.pattern, "search")] if profile.identify else []
    return [(pattern, use) for pattern, use in found if pattern]


@pytest.mark.parametrize("name", ready())
def test_every_pattern_of_a_ready_profile_is_linear_with_few_runs(name: str) -> None:
    for pattern, use in patterns_of(profile_named(name)):
        assert most_runs(pattern, use) <= MOST_RUNS / 5


SOUND = "pattern = '(?P<x_mm>1)'"


@pytest.mark.parametrize(("lines", "told"), [
    (["[parse]", r"pattern = '^T=\s*\s*(?P<temp_c>\d+)'"],
     r"a.toml line 4: [parse] pattern: '\s*\s*' reads many ' ' in many ways: let something stand between its repeats that"),
    (["[parse]", r"pattern = '(?P<temp_c>\d+) C'"],
     r"a.toml line 4: [parse] pattern: '(?P<temp_c>\d+) C' reads many '0' from each place of the message anew: begin it with"),
    (["[parse]", r"separator = '\s*,\s*'", "fields = ['x_mm']"],
     r"a.toml line 4: [parse] separator: '\s*,\s*' reads many ' ' whether or not a separator ends there"),
    (["[parse]", SOUND, "ignore = ['.*#.*#.*']"], "a.toml line 5: [parse] ignore.0: '.*#.*' reads many '#'"),
    (["[parse]", SOUND, "[[ill]]", "pattern = '(E|E)+R'", "says = 'x'"], "[[ill]] 1 pattern: '(E|E)+' reads many 'E'"),
    (["[parse]", SOUND, "[identify]", "send = '?'", "pattern = '(?P<maker>.+),(?P<serial>.+)'"], "[identify] pattern: "),
    (["[[send.poll]]", "send = '?'", "pattern = '(?P<x_mm>1)(a*)*'", "[parse]", SOUND], "may be empty: let it read"),
])  # fmt: skip
def test_a_profile_is_refused_with_file_key_part_and_remedy(lines: list[str], told: str) -> None:
    with pytest.raises(CmmUqError) as error:
        profile_of((HEAD + "\n".join(lines)).encode(), Path("a.toml"))
    assert told in str(error.value)


BEFORE = r"[-+]?\s*\d+\.?\d*(?:[Ee][-+]?\d+)?"


def test_a_pattern_that_an_earlier_version_wrote_reads_what_it_read() -> None:
    old = rf"^CH1=\s*(?P<temp1_c>{BEFORE})\s*C;\s*CH2=\s*(?P<temp2_c>{BEFORE})\s*C\s*$"
    made = profile_of((HEAD + f"[parse]\npattern = '{old}'\n").encode(), Path("a.toml"))
    assert made.parse is not None
    assert made.parse.pattern is not None
    check_linear(made.parse.pattern, "search")
    for line in (
        "CH1= 20.13 C; CH2= 20.15 C",
        "CH1=-  9.8C;CH2=+1e-3 C  ",
        "CH1=5. C; CH2=7 C",
        "CH1= C; CH2=7 C",
        "CH1=5;",
    ):
        found, before = re.search(made.parse.pattern, line), re.search(old, line)
        assert (found and found.groupdict()) == (before and {k: v.strip() for k, v in before.groupdict().items()})


@pytest.mark.parametrize(
    "line", ["20.1 20.2", "+12+13", "1.5.2", "5. E 7e3 ", "  3  ", "X -  5.", "1e5 2E", "a1 b 2 ;; 3"]
)
def test_what_is_drafted_from_any_line_is_linear_and_reads_it(line: str) -> None:
    found = numbers_in(line)
    names = {number: f"v{number}_mm" for number in range(1, len(found) + 1)}
    made = profile_of(drafted(ProfileDraft("a", "A", line, names, {})), Path("a.toml"))
    assert list(made.example[0].values.values()) == [float(number.replace(" ", "")) for number in found]


def test_no_number_is_read_as_two() -> None:
    made = profile_of(drafted(ProfileDraft("a", "A", "20 21", {1: "x_mm", 2: "y_mm"}, {})), Path("a.toml"))
    assert not Parser(made).read(FramedMessage(b"2021", b"2021")).values
