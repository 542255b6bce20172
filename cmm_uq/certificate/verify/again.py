"""A certificate beside what its inputs give when they are computed again: every figure, every form.

Equal to the byte by the same version on the same kernels of linear algebra. Other kernels change the last bits, and with them
which draws a sampler takes: then nearly every sampled figure differs a little, all within Monte Carlo error and printed
digits. A single figure that differs where its neighbours do not is no such thing. Pages of an earlier version are made again
to the byte by that version, and by no other: of it figures and decisions are compared.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from cmm_uq.base.values import dataclass
from cmm_uq.certificate.verify.figures import quantities
from cmm_uq.certificate.verify.given import AGAIN, RESULTS, Given, Inquiry
from cmm_uq.certificate.verify.opened import read_html
from cmm_uq.certificate.verify.texts import canonical, strict_json
from cmm_uq.certificate.verify.views import Difference, differing_parts, first_difference
from cmm_uq.maths.uncertainty.quantity import rounded


def check_results(inquiry: Inquiry, given: Given) -> None:
    """``results.json`` given and attached, and as this program writes it."""
    if given.results is None:
        return
    name, data, content = given.results
    inquiry.looked("forms")
    if content != (should := canonical(data)):
        inquiry.wrong("files", name, f"line {_first_line(content, should)[0]}", "is not as cmm-uq writes it")
    if given.pdf is None:
        return
    inside = given.pdf[1].files.get(RESULTS)
    if inside is None:
        inquiry.wrong("forms", given.pdf[0], "", f"has no {RESULTS} inside")
    elif inside != content:
        place = f"attachment {RESULTS}: line {_first_line(inside, content)[0]}"
        inquiry.wrong("forms", given.pdf[0], place, f"is not {name}")


_NUMBER = re.compile(r"[−-]?\d+(?:[.,]\d+)*")
_OTHER_KERNELS = 0.5  # share of sampled figures from which on their differences are taken for those of other kernels
_OF_ONE = ("sampling", "diagnosis", "budget", "correlation", "unseen", "decision")
"""Parts whose figures are compared with one and not with themselves: shares, probabilities, statistics of a sampler."""

FEWEST_OF_A_PART = 4000  # draws behind a share of a part's variance, or behind what another way of measuring would give
_ERRORS = 6.0  # standard errors of a Monte Carlo that two of it may differ by, beyond which one figure in 10⁸ lies


@dataclass(frozen=True)
class Again:
    files: Mapping[str, bytes]  # all that the command writes, by name, without the PDF
    pdf: bytes | None = None  # with the files attached that the given one has; ``None`` where the program is another
    why_no_pdf: str = ""
    kept: tuple[str, ...] = ()  # files that say on what platform they were made, and are otherwise what the inputs give
    beside: tuple[str, ...] = ()  # names of files that lie beside the documents and are not inside the PDF


def compare_again(inquiry: Inquiry, given: Given, again: Again) -> bool:
    """Keep every difference of a certificate by this version of the package; whether documents are the same to the byte."""
    if given.results is None:
        return False
    name, data, content = given.results
    new = strict_json(again.files[RESULTS], RESULTS)
    inquiry.looked("again", sum(1 for _ in leaves(data)))
    same = content == again.files[RESULTS]
    kernels = not same and by_other_kernels(data, new)
    if kernels:
        inquiry.notes.append(
            "Figures differ in their last digits from those computed here, as by another processor or library: compared "
            "within printed digits and Monte Carlo error."
        )
    found = differences(data, new)
    for path, stands, should in found if not kernels else beyond_sampling(data, new, found):
        inquiry.wrong("again", name, path, "is not what its inputs give", stands, should)
    if not (same or kernels or found):
        inquiry.wrong("again", name, "", "is written otherwise than its inputs give it, though its figures are equal")
    for kept in again.kept:
        why = "they are others than here, and nothing else tells them"
        inquiry.left(f"platform and versions of packages in {kept}", why)
    alike = _compare_html(inquiry, given, again, kernels=kernels)
    _compare_attached(inquiry, given, again, kernels=kernels)
    return same and _compare_pdf(inquiry, given, again) and alike


def leaves(data: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every figure and word of plain data, with its path."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from leaves(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from leaves(value, f"{path}[{i}]")
    else:
        yield path, data


def differences(data: Any, new: Any) -> list[tuple[str, Any, Any]]:
    """Whatever differs, or stands in one alone: JSON path, what stands there, and what it should be."""
    a, b = dict(leaves(data)), dict(leaves(new))
    found = [(path, a.get(path, ""), b.get(path, "")) for path in {**a, **b}
             if path not in a or path not in b or type(a[path]) is not type(b[path]) or a[path] != b[path]]  # fmt: skip
    if not found and data != new:
        return [("", "other parts", "")]
    if not found and list(a) != list(b):
        return [(list(a)[first_difference(list(a), list(b))], "another order", "")]
    return found


def by_other_kernels(data: Any, new: Any) -> bool:
    """Whether so many figures differ that no single one was altered."""
    a, b = dict(leaves(data)), dict(leaves(new))
    figures = [path for path, value in a.items() if isinstance(value, float) and not value.is_integer() and path in b]
    return bool(figures) and sum(a[path] != b[path] for path in figures) > _OTHER_KERNELS * len(figures)


def beyond_sampling(
    data: Any, new: Any, found: list[tuple[str, Any, Any]], *, sampled: bool = True
) -> Iterator[tuple[str, Any, Any]]:
    """Of some differences those that neither printed digits nor, of what was ``sampled``, Monte Carlo error explain."""
    draws = min(filter(None, map(_draws, (data, new))), default=0.0) if sampled else 0.0
    part = _ERRORS * math.sqrt(2.0 / draws) if draws > 0 else 1e-6
    uncertain = dict(quantities(new, inner=True))
    for path, stands, should in found:
        if not (isinstance(stands, (int, float)) and isinstance(should, (int, float))):
            if not (isinstance(stands, str) and isinstance(should, str) and _words_alike(stands, should, part)):
                yield path, stands, should
            continue
        owner = path.rpartition(".interval95" if "interval95" in path else ".")[0]
        scale = max(abs(stands), abs(should))
        if owner in uncertain:
            u = uncertain[owner]["u"] if path.endswith((".value", "]", ".u", ".U")) else scale
            room = part * u + _place(uncertain[owner])
        else:
            room = part * max(scale, 1.0 if path.startswith(_OF_ONE) else 0.0)
        if abs(stands - should) > room:
            yield path, stands, should


def _draws(data: Mapping[str, Any]) -> float:
    """Independent draws behind the figures that have fewest of them."""
    if "simulation" in data:
        return float(min(data["simulation"]["virtual_measurements"], FEWEST_OF_A_PART))
    return float((data.get("sampling") or {}).get("ess_min") or 0.0)


def _place(quantity: Mapping[str, Any]) -> float:
    """Half a unit of the last digit that is printed."""
    if quantity["value"] is None or not quantity["U"]:
        return 0.0
    return float(0.5 * 10.0 ** -len(rounded(0.0, quantity["U"])[1].partition(".")[2]))


def _words_alike(stands: str, should: str, part: float) -> bool:
    """Whether two sentences differ in the last digits of their numbers alone."""
    if _NUMBER.sub("#", stands) != _NUMBER.sub("#", should):
        return False
    numbers = ([float(figure.replace("−", "-").replace(",", ".")) for figure in _NUMBER.findall(text)]
               for text in (stands, should))  # fmt: skip
    return all(abs(a - b) <= 4 * part * max(abs(a), abs(b), 1.0) for a, b in zip(*numbers, strict=True))


def _compare_html(inquiry: Inquiry, given: Given, again: Again, *, kernels: bool) -> bool:
    if given.html is None:
        return True
    name, page, content = given.html
    should = next((data for file, data in again.files.items() if file.endswith(".html")), None)
    if should is None:
        inquiry.left(name, "none is written of these inputs")
        return False
    inquiry.looked("again")
    if content == should:
        return True
    if kernels:
        here, there = (_NUMBER.sub("#", " ".join(text.split())) for text in (page.text, read_html(should, name).text))
        if here == there:
            why = "the figures differ in their last digits, and with them the pictures"
            inquiry.left(f"figures and pictures of {name}", why)
            return False
    line, stands, wanted = _first_line(content, should)
    inquiry.wrong("again", name, f"line {line}", "is not what its inputs give", stands, wanted)
    return False


def _first_line(stands: bytes, should: bytes) -> tuple[int, str, str]:
    """Number of the first line that differs, and what differs in it."""
    a, b = (content.decode("utf-8", "replace").split("\n") for content in (stands, should))
    at = first_difference(a, b)
    line, other = a[at] if at < len(a) else "", b[at] if at < len(b) else ""
    begin = max(0, first_difference(line, other) - 20)
    return at + 1, line[begin : begin + 60], other[begin : begin + 60]


def _compare_attached(inquiry: Inquiry, given: Given, again: Again, *, kernels: bool) -> None:
    """Files inside the PDF, or beside it, that the command writes: none missing, none more, none other."""
    inputs = given.results[1]["job"]["inputs_sha256"] if given.results else {}
    for name, data in again.files.items():
        if name == RESULTS or name.endswith((".html", ".xml")):
            continue
        stands = given.files.get(name)
        inquiry.looked("again")
        if stands is None and given.pdf is not None and name not in again.beside:
            inquiry.wrong("again", given.pdf[0], f"attachment {name}", "is missing, and the inputs give it")
        elif stands is not None and stands != data and not kernels:
            inquiry.wrong("again", name, "", "is not what the inputs give")
    if given.pdf is None:
        return
    pdf, there = given.pdf[0], given.pdf[1].files
    missing = [name for name in again.files if name.endswith(".xml") and name not in there]
    problems = [(name, "is missing, and the inputs give it") for name in missing]
    further = there.keys() - {*inputs, *again.files}
    problems += [(name, "belongs to nothing that the inputs give") for name in further]
    problems += [(name, "is missing") for name in (*inputs, RESULTS) if name not in there]
    for name, problem in problems:
        inquiry.wrong("again", pdf, f"attachment {name}", problem)


def _compare_pdf(inquiry: Inquiry, given: Given, again: Again) -> bool:
    """The first revision of the PDF to the byte; signatures come behind it."""
    if given.pdf is None:
        return True
    name, pdf = given.pdf
    if again.pdf is None:
        inquiry.left(f"pages of {name}", again.why_no_pdf)
        return False
    inquiry.looked("again")
    stands, should = pdf.content[: pdf.ends[0]], again.pdf
    if stands == should:
        return True
    parts: list[Difference] = differing_parts(stands, should)
    for where, here, there in parts:
        inquiry.wrong("again", name, where, "is not what its inputs give", here, there)
    if not parts:
        problem = "was written anew, or changed where nothing is stated: it is not the file that was made"
        inquiry.wrong("again", name, f"byte {first_difference(stands, should)}", problem)
    return False


_STATED = re.compile(
    r"(?:accuracy|accuracy_uncertainty|estimates|differences|conformity|verdicts|characteristics|decision)\b|diagnosis\.verdict$"
)
_DECIDED = re.compile(r"(?:^|[.])(?:decision|outcome|overall|verdict)$")
_NAMED = 6  # figures that a sentence names


def compare_figures(inquiry: Inquiry, given: Given, again: Again, made: str) -> None:
    """Keep every figure and decision of a certificate by an earlier version that its inputs do not give by this one."""
    if given.results is None:
        return
    name, data, _ = given.results
    new = strict_json(again.files[RESULTS], RESULTS)
    stated, computed = _figures(data), _figures(new)
    both = [path for path in stated if path in computed]
    inquiry.looked("again", len(both))
    found = [(path, stated[path], computed[path]) for path in both if stated[path] != computed[path]]
    sampled = 2 * len(found) > len(both)  # by other kernels or draws, not of one that was altered
    beyond = list(beyond_sampling(data, new, found, sampled=sampled))
    for path, stands, should in beyond:
        inquiry.wrong("again", name, path, "is not what its inputs give", stands, should)
    moved = [path for path, *_ in found if path not in {place for place, *_ in beyond}]
    if moved:
        how = "within Monte Carlo error" if sampled else "within their last digit"
        inquiry.notes.append(f"{len(moved)} of {len(both)} figures moved {how} since version {made}: {_some(moved)}.")
    for only, other in ((stated, computed), (computed, stated)):
        if further := [path for path in only if path not in other]:
            of = f"version {made}" if only is stated else "this version"
            inquiry.left(f"{len(further)} figures", f"only {of} states them: {_some(further)}")


def _figures(data: Any) -> dict[str, Any]:
    """Figures and decisions by their path; no words, and nothing of how they were computed."""
    return {
        path: value
        for path, value in leaves(data)
        if _STATED.match(path)
        and (_DECIDED.search(path) if isinstance(value, str) else isinstance(value, (int, float)))
    }


def _some(paths: Sequence[str]) -> str:
    return ", ".join([*paths[:_NAMED], *(["…"] if len(paths) > _NAMED else [])])


def plugins_missing(inquiry: Inquiry, data: Mapping[str, Any]) -> bool:
    """Packages that took part and are not here as they were then."""
    missing = False
    for package, wanted in (data["software"].get("plugins") or {}).items():
        try:
            here = version(str(package))
        except PackageNotFoundError:
            here = ""
        if here != wanted:
            missing = True
            told = f"version {here} is installed" if here else "it is not installed"
            inquiry.left(AGAIN, f"{package} {wanted} took part, and {told}")
    return missing
