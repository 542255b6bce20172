"""What must hold after every run, whatever it was given: each function lists what does not, in words that group."""

from __future__ import annotations

import hashlib
import json
import re
import stat
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

CODES = (0, 2, 3, 4, 130, 143)
LONGEST = 300
"""Characters that a refusal may have."""
SECONDS = 10.0
"""That anything refused, or only read, may take."""
STOPS = 2.0
"""Seconds within which an interrupted command ends."""
STAGED = (".unfinished-", ".placing")
MANIFEST = "manifest.json"
BIDI = frozenset("\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


@dataclass(frozen=True)
class Outcome:
    """How one run ended.

    Parameters
    ----------
    code : exit code; negative when a signal ended it, None when it had to be stopped.
    stdout, stderr : what it said.
    seconds : it took.
    """

    code: int | None
    stdout: str
    stderr: str
    seconds: float


def problems(outcome: Outcome, *, quiet: bool = True) -> list[str]:
    """What a run said or did that none may, whatever its input.

    Parameters
    ----------
    quiet : it ran with ``--quiet``, so that it has nothing to say on stderr but a refusal.
    """
    code, said = outcome.code, outcome.stderr
    if code is None:
        return ["hangs"]
    found = []
    if "Traceback (most recent call last)" in said:
        found.append(f"traceback: {_origin(said)}")
    elif fault := re.search(r"a fault of the program: (\w+)", said):
        found.append(f"fault: {fault[1]}")
    elif code not in CODES:
        found.append(f"exit code {code}")
    if warning := re.search(r"\b[A-Z]\w*Warning\b", said):
        found.append(f"warning: {warning[0]}")
    if code == 2 and outcome.seconds > SECONDS:
        found.append(f"refuses only after more than {SECONDS:g} s")
    if not found:
        found += (
            refusal_problems(said, progress=not quiet)
            if code in (2, 3)
            else ["speaks on stderr"]
            if quiet and not code and said
            else []
        )
    return found


def refusal_problems(said: str, *, progress: bool = False) -> list[str]:
    """What is wrong with the words of a refusal: one line, short, without control characters; ``progress`` may precede it."""
    lines = said.removesuffix("\n").split("\n")
    if progress:
        lines = lines[-1:]  # what was being done is said line by line before
    if not said:
        return ["refuses without a word"]
    if len(lines) > 1:
        usage = any(line.startswith("Usage:") for line in lines)
        return ["refusal of several lines (usage)" if usage else "refusal of several lines"]
    found = ["refusal longer than 300 characters"] if len(lines[0]) > LONGEST else []
    if any(unicodedata.category(character) == "Cc" or character in BIDI for character in lines[0]):
        found.append("control characters in a refusal")
    return found if lines[0].startswith("cmm-uq: ") else [*found, "refusal that does not name the program"]


def _origin(said: str) -> str:
    """Kind of the last exception, and the innermost line of this project."""
    frames = re.findall(r'File "[^"]*?(cmm_uq/[^"]+)", line (\d+)', said)
    kinds = re.findall(r"^([A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Exit|Warning)?)(?::.*)?$", said, re.MULTILINE)
    where = ":".join(frames[-1]) if frames else "outside the project"
    return f"{kinds[-1].rpartition('.')[2] if kinds else 'unknown'} at {where}"


def snapshot(folder: Path) -> dict[str, str]:
    """Every entry below a folder: kind, and of files the hash of their bytes."""
    found = {}
    for path in sorted(folder.rglob("*")) if folder.is_dir() else []:
        mode = path.lstat().st_mode
        name = path.relative_to(folder).as_posix()
        if stat.S_ISREG(mode):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
        else:
            found[name] = f"link to {path.readlink()}" if stat.S_ISLNK(mode) else f"kind {stat.S_IFMT(mode):o}"
    return found


def lost(before: Mapping[str, str], after: Mapping[str, str], *, own: frozenset[str] = frozenset()) -> list[str]:
    """Files of before that are gone or have other bytes, and of which no ``.previous`` keeps the old ones.

    Parameters
    ----------
    own : files that the command may replace, since it wrote them itself.
    """
    kept = {seal for name, seal in after.items() if name.endswith(".previous")}
    return [f"lost: {Path(name).name}" for name, seal in before.items()
            if name not in own and after.get(name) != seal and seal not in kept]  # fmt: skip


def set_problems(folder: Path) -> list[str]:
    """Why a folder is no complete set by its manifest, with finite figures and nothing staged left over."""
    found = [f"left over: {name}*" for name in STAGED if any(path.name.startswith(name) for path in folder.glob(".*"))]
    try:
        listed = json.loads((folder / MANIFEST).read_bytes())["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return [*found, "no manifest", *_infinite(folder)]
    for name, facts in listed.items():
        path = folder / name
        content = path.read_bytes() if path.is_file() else None
        if content is None:
            found.append("a file of the manifest is missing")
        elif (hashlib.sha256(content).hexdigest(), len(content)) != (facts["sha256"], facts["bytes"]):
            found.append("a file has other bytes than its manifest")
    return [*found, *_infinite(folder)]


def _infinite(folder: Path) -> list[str]:
    def refuse(word: str) -> float:
        raise ValueError(word)

    path = folder / "results.json"
    try:
        json.loads(path.read_bytes(), parse_constant=refuse) if path.is_file() else None
    except ValueError:
        return ["results.json is not finite JSON"]
    return []
