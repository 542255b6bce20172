"""The inputs of a certificate, and it beside what they give when they are computed again: every figure, every form.

Equal to the byte by the same version on the same kernels of linear algebra. Other kernels change the last bits, and with them
which draws a sampler takes: then nearly every sampled figure differs a little, all within Monte Carlo error and printed
digits. A single figure that differs where its neighbours do not is no such thing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.certificate.part.results import standing_data
from cmm_uq.certificate.verify.figures import quantities
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import JOB, RESULTS, Given, canonical, strict_json
from cmm_uq.certificate.verify.html_page import read_html
from cmm_uq.certificate.verify.views import Difference, differing_parts, first_difference
from cmm_uq.jobs.chain import certified_on_this_machine, dates_out_of_order
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.maths.uncertainty.quantity import rounded

if TYPE_CHECKING:
    from cmm_uq.base.points import Floats
    from cmm_uq.certificate.part.measurement import CertificateStatus

Stated = tuple[str, object, object]  # JSON path, what stands there, what should


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


def inputs_of(inquiry: Inquiry, given: Given) -> dict[str, bytes] | None:
    """The inputs by name, each with the hash that results.json says; ``None`` where one is missing or another."""
    if given.results is None:
        return None
    name, data, _ = given.results
    wanted, files = data["job"]["inputs_sha256"], given.files

    def is_sound(file: str, digest: str, source: str, missing: str) -> bool:
        if file not in files:
            if given.pdf is not None:
                inquiry.wrong("inputs", given.pdf[0], f"attachment {file}", missing)
            return False
        stands = sha256(files[file]).hexdigest()
        if stands != digest:
            where = f"{file} in {given.pdf[0]}" if given.pdf is not None and file in given.pdf[1].files else file
            inquiry.wrong("inputs", where, "", f"is not the file whose hash {source} has", stands, digest)
        return stands == digest

    inquiry.looked("inputs", len(wanted))
    missing = f"is missing, and {name} names it as an input"
    sound = sum(is_sound(file, digest, name, missing) for file, digest in wanted.items()) == len(wanted)
    if given.pdf is None and not sound and not (wanted.keys() & files.keys()):
        inquiry.left("inputs", "neither a PDF that has them inside nor the files themselves are given")
    elif given.pdf is None and not sound:
        inquiry.left("inputs", f"not given: {', '.join(sorted(wanted.keys() - files.keys()))}")
    if entry := data.get("posterior"):
        draws = str(entry["file"])
        inquiry.looked("inputs", draws in files)
        is_sound(draws, entry["sha256"], RESULTS, f"is missing, and {RESULTS} names it")
    return {file: files[file] for file in wanted} if sound and JOB in wanted else None


def check_job(inquiry: Inquiry, job: Job, data: Mapping[str, Any], file: str) -> None:
    """Whether results.json speaks of this job: its name, dates, machine, and what it wishes to be decided."""
    said, facts = data["job"], job.facts
    stated: list[Stated] = [
        ("job.id", said.get("id"), facts.job.id), ("job.origin", said.get("origin"), facts.job.origin),
        ("job.date", said.get("date"), facts.job.date.isoformat()), ("job.machine", said.get("machine"), facts.machine.name),
        ("job.serial", said.get("serial") or "", facts.machine.serial or ""),
        ("job.altered", said.get("altered") or [], list(job.altered)),
        ("job.inputs_sha256", sorted(said["inputs_sha256"]), sorted(job.inputs)),
    ]  # fmt: skip
    entries = data.get("conformity") or ()
    if "estimates" in data and len(entries) != len(facts.conformity):
        stated.append(("conformity", len(entries), len(facts.conformity)))
    for i, (entry, wish) in enumerate(zip(entries, facts.conformity, strict=False)):
        wished: dict[str, object] = {
            "standard": wish.standard, "rule": rule_name(wish.rule), "mpe": wish.mpe and wish.mpe.model_dump(),
            "prior": wish.prior and wish.prior.model_dump(),
        }  # fmt: skip
        if wish.characteristic is not None:
            wished["characteristic"] = wish.characteristic
        if wish.limit_um is not None:
            wished["limit_um"] = float(f"{wish.limit_um:.10g}")
        stated += [(f"conformity[{i}].{key}", entry.get(key), should) for key, should in wished.items()]
    _compare_stated(inquiry, stated, file, f"is not what {JOB} says")


def check_dates(inquiry: Inquiry, job: Job) -> None:
    """Whether every artefact was in date on the day of the measurement, and the other dates are in order."""
    inquiry.looked("dates")
    for text in dates_out_of_order(job):
        inquiry.wrong("dates", JOB, "", str.__str__(text))
    chain = job.facts.artefact.certificate
    if certified_on_this_machine(job.facts):
        inquiry.notes.append("The artefact was certified on the machine that it tests; the certificate says so.")
    if chain is not None and chain.number and chain.until is None:
        note = "The artefact's certificate has no date by which it is due: that it was in date is not shown."
        inquiry.notes.append(note)


_OF_THE_MACHINE = (
    "source", "files", "number", "laboratory", "machine", "serial", "origin", "date", "age_days", "valid_until", "draft",
    "inputs_sha256",
)  # fmt: skip
"""Of ``machine``, what its certificate says; what was verified of it depends on the version that did."""

_SAME = 1e-9
_NEAR_MM = 1e-7  # features that are found by going on from a start agree so well on any processor


def check_part_job(
    inquiry: Inquiry, job: PartJob, plan: Plan, measured: Floats | None, data: Mapping[str, Any], file: str
) -> None:
    """Keep what the job says otherwise; ``measured``: (c,) values of the measured points, mm and rad."""
    facts, said, problem = job.facts, data["job"], f"is not what {JOB} says"
    part, decision, prior = data["part"], data["decision"], facts.decision.prior
    stated: list[Stated] = [
        ("job.id", said["id"], facts.job.id), ("job.number", said.get("number") or "", facts.job.number or ""),
        ("job.origin", said["origin"], facts.job.origin), ("job.date", said["date"], facts.job.date.isoformat()),
        ("part.name", part["name"], facts.part.name), ("part.drawing", part["drawing"] or "", facts.part.drawing),
        ("part.serial", part["serial"] or "", facts.part.serial),
        ("part.not_measured", part["not_measured"], list(facts.part.not_measured)),
        ("decision.rule", decision["rule"], rule_name(facts.decision.rule)),
        ("decision.prior", decision["prior"], prior and prior.model_dump()),
        ("simulation.points", data["simulation"]["points"], len(plan.points)),
        ("characteristics", len(data["characteristics"]), len(facts.characteristic)),
    ]  # fmt: skip
    each = zip(data["characteristics"], facts.characteristic, plan.characteristics, strict=False)
    for i, (one, wish, known) in enumerate(each):
        where, angle = f"characteristics[{i}]", wish.asks.limits == "angles"
        wished = {"name": wish.name, "what": wish.what, "features": list(wish.features), "datums": list(wish.datums),
                  "association": known.association, "unit": "°" if angle else "mm"}  # fmt: skip
        stated += [(f"{where}.{key}", one[key], should) for key, should in wished.items()]
        limits = one["limits"] or {"lower": None, "upper": None}
        value = None if measured is None else float(measured[i])
        for key, stands, should, room, otherwise in (
            ("limits.lower", limits["lower"], known.lower, _SAME, problem),
            ("limits.upper", limits["upper"], known.upper, _SAME, problem),
            ("measured", one["measured"], value, _NEAR_MM, "is not the value of the measured points"),
        ):
            inquiry.looked("inputs")
            inside = None if should is None else math.degrees(should) if angle else should
            near = stands is inside if stands is None or inside is None else (
                abs(stands - inside) <= room * max(1.0, abs(inside)))  # fmt: skip
            if not near:
                inquiry.wrong("inputs", file, f"{where}.{key}", otherwise, stands, f"{inside}")
    _compare_stated(inquiry, stated, file, problem)


def check_standing(inquiry: Inquiry, standing: CertificateStatus, data: Mapping[str, Any], file: str) -> None:
    """Keep what the machine's certificate says otherwise."""
    should, said = standing_data(standing), data["machine"]
    stated = [(f"machine.{key}", said[key], should[key]) for key in _OF_THE_MACHINE]
    _compare_stated(inquiry, stated, file, "is not what the machine's certificate says")


def _compare_stated(inquiry: Inquiry, stated: Sequence[Stated], file: str, problem: str) -> None:
    for place, stands, should in stated:
        inquiry.compare("inputs", file, place, problem, stands, should)


_NUMBER = re.compile(r"[−-]?\d+(?:[.,]\d+)*")
_OTHER_KERNELS = 0.5  # share of sampled figures from which on their differences are taken for those of other kernels
_OF_ONE = ("sampling", "diagnosis", "budget", "correlation", "unseen", "decision")
"""Parts whose figures are compared with one and not with themselves: shares, probabilities, statistics of a sampler."""

FEWEST_OF_A_PART = 4000  # draws behind a share of a part's variance, or behind what another way of measuring would give
_ERRORS = 6.0  # standard errors of a Monte Carlo that two of it may differ by, beyond which one figure in 10⁸ lies


@dataclass(frozen=True)
class Again:
    """What was computed again."""

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
            inquiry.left(
                f"figures and pictures of {name}", "the figures differ in their last digits, and with them the pictures"
            )
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
