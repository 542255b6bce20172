"""docs/tampering-study.md, of the records of the study alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

ALTERED, GOOD, COMMANDS = 2000, 10_000, 500
"""How many are wanted."""
FOUND = ("NOT VERIFIED", "REFUSED")


def written(
    altered: Sequence[dict[str, Any]], good: Sequence[dict[str, Any]], commands: Sequence[dict[str, Any]], *, seed: int
) -> str:  # fmt: skip
    """The page; what there are fewer of than are wanted is said."""
    found = [one for one in altered if _told(one)]
    neutral = [one for one in altered if one["said"] == "VERIFIED" and one["how"] == "forged_hash"]
    missed = [one for one in altered if not _told(one) and one not in neutral]
    without = [one for one in found if one["checks"] != ["again"]]
    refused = [one for one in (*good, *commands) if one["said"] != "VERIFIED" or one["findings"]]
    lines = [
        "# Alterations of certificates", "",
        "Written by `python benchmarks/tampering/study.py`, which reruns all of it; `--only 17` repeats one case.",
        f"Seed {seed}. Each case alters one thing of one certificate or diagnosis and verifies what",
        "an auditor has of it: the PDF alone, the PDF with further forms, or everything but the PDF.",
        "The generator of alterations knows files, not the package.", "",
        "| | cases | found | without computing again | changes nothing stated | not found | seconds, median | at |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        f"| altered | {len(altered)} | {len(found)} | {len(without)} | {len(neutral)} | {len(missed)} | {_median(altered)} "
        f"| {_versions(altered)} |",
        "", "What changes nothing that is stated is an input altered together with its hash, so that the files are a",
        "certificate of that input; computed again from it, every figure and the page are the same to the byte, as of a",
        "coordinate that the kind does not use, or of the order of two keys.", "",
        *(f"{len(some)} of the {wanted} {what} that are wanted were run."
          for some, wanted, what in ((altered, ALTERED, "alterations"), (good, GOOD, "good certificates"),
                                     (commands, COMMANDS, "good certificates by the command")) if len(some) < wanted),
        "", "## Good certificates", "",
        "Examples with noise of 0.01 µm to 1 µm more on their readings, another seed, other words, in a language by lot,",
        "signed or not, made and verified with computing again in full: in a process that goes on to the next one, and by",
        "the commands.", "", "| | certificates | signed | refused or not wholly verified | seconds, median | at |",
        "| --- | --- | --- | --- | --- | --- |",
        *(f"| {what} | {len(some)} | {sum(one['signed'] for one in some)} | "
          f"{sum(one in refused for one in some)} | {_median(some)} | {_versions(some)} |"
          for what, some in (("in process", good), ("by the commands", commands))), "",
        *_of_good([*good, *commands]), "", "## By form and alteration", "",
        "| form | alteration | cases | found | without computing again |", "| --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    count = Counter((one["form"], one["how"]) for one in altered)
    hit = Counter((one["form"], one["how"]) for one in found)
    plain = Counter((one["form"], one["how"]) for one in without)
    for (form, how), n in sorted(count.items()):
        lines.append(f"| {form} | {how} | {n} | {hit[form, how]} | {plain[form, how]} |")
    if neutral:
        lines += [
            "",
            "## Changes nothing that is stated",
            "",
            "| case | certificate | file | alteration |",
            "| --- | --- | --- | --- |",
        ]
        lines += [f"| {one['number']} | {one['base']} | {one['file']} | {_cell(one['what'])} |" for one in neutral]
    if missed:
        lines += ["", "## Not found", "", "| case | certificate | form | alteration | said | not checked |",
                  "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
        lines += [f"| {one['number']} | {one['base']} | {one['form']} | {one['how']}: {_cell(one['what'])} | {one['said']} | "
                  f"{_cell('; '.join(one['not_checked']))} |" for one in missed[:50]]  # fmt: skip
    if refused:
        lines += ["", "## Good certificates not verified", ""]
        for one in refused[:20]:
            what = f"{one['number']}, {one['base']}, {one['language']}{', signed' if one['signed'] else ''}"
            lines.append(f"- {what}: {one['said']}: {'; '.join(one['findings'] + one['not_checked'])[:200]}")
    return "\n".join(lines) + "\n"


def _of_good(records: Sequence[dict[str, Any]]) -> list[str]:
    """How many of each kind and language there are."""
    count = Counter((f"{one['base']}, {one['command']}", one["language"]) for one in records)
    languages = sorted({language for _, language in count})
    lines = [f"| certificate | {' | '.join(languages)} |", "| --- |" + " --- |" * len(languages)]
    return lines + [
        f"| {name} | {' | '.join(str(count[name, language]) for language in languages)} |"
        for name in sorted({name for name, _ in count})
    ]


def _told(one: dict[str, Any]) -> bool:
    """Whether it was found, or said to be what nothing can tell: the platform in a provenance."""
    return one["said"] in FOUND or any(what.startswith("platform") for what in one["not_checked"])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")[:120]


def _versions(records: Sequence[dict[str, Any]]) -> str:
    """At which commits, and how many at each."""
    return ", ".join(f"`{commit}` ({count})" for commit, count in Counter(one["commit"] for one in records).items())


def _median(records: Sequence[dict[str, Any]]) -> str:
    times = sorted(one["seconds"] for one in records)
    return f"{times[len(times) // 2]:.1f}" if times else "–"
