"""From a model file to its written budget."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from cmm_uq.app.commands.files import Stage, Written, silent
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import ENGLISH, Code
from cmm_uq.base.messages import Verbatim, plural, say
from cmm_uq.base.output import Owner, staged
from cmm_uq.certificate.plots.style import fonts_of
from cmm_uq.certificate.wording import Headline, Summary
from cmm_uq.maths.uncertainty.evaluation import Evaluation
from cmm_uq.maths.uncertainty.models.model_file import read_model_file

FILES = ("budget.html", "budget.pdf", "results.json")


def write_budget(
    file: Path, out: Path | None = None, *, seed: int | None = None, force: bool = False,
    stage: Stage = silent, language: Code = ENGLISH,
) -> Written[Evaluation]:  # fmt: skip
    """Evaluate a model file and write ``budget.html``, ``budget.pdf`` and ``results.json``, all or none."""
    fonts_of(language)  # refused before anything is computed
    model = read_model_file(file)
    folder = out or Path("reports") / file.stem
    if file.name in FILES:
        raise CmmUqError("has the name of a file that this command writes", where=str(file), fix="Rename it")
    owner = Owner("budget", _identity(file))
    with staged(folder, owner, inputs=(file,), force=force, expected=FILES) as place:
        stage("Propagating the uncertainty", 0.0)
        evaluation = model.evaluate(seed)
        stage("Rendering", 0.7)
        from cmm_uq.certificate.document import translated as said
        from cmm_uq.certificate.origin import as_json
        from cmm_uq.certificate.pages.budget import budget_document
        from cmm_uq.certificate.plots.style import lettered_in
        from cmm_uq.certificate.render import render_html, render_pdf
        from cmm_uq.maths.uncertainty.budget_results import results_of

        data = as_json({**results_of(evaluation), **model.further(), "inputs_sha256": {file.name: model.sha256},
                        **({"language": language} if language != ENGLISH else {})})  # fmt: skip
        with lettered_in(language):
            document = said(budget_document(model, evaluation, file.name), language)
        pdf = render_pdf(document, {file.name: model.content, "results.json": data})
        contents = {"budget.html": render_html(document).encode(), "budget.pdf": pdf, "results.json": data}
        files = place.write(contents)
    return Written(evaluation, data, files, summary_of(evaluation), evaluation.stable, file.name)


def summary_of(evaluation: Evaluation) -> Summary:
    """Each output as a certificate could state it; in full as the row of a table too."""
    from cmm_uq.maths.uncertainty.budget_results import SUMMARY, statement, summary_rows

    names = tuple(evaluation.stated)
    unstable = () if evaluation.stable else tuple(
        Headline("NOT STABLE", "open", Verbatim(name), (evaluation.stated[name].reason,)) for name in names
    )  # fmt: skip
    return Summary(
        plural(len(names), one=say("one output"), many=say("{count} outputs", count=len(names))), verdicts=unstable,
        remarks=tuple(statement(evaluation, name) for name in names), details=(SUMMARY, *summary_rows(evaluation)),
    )  # fmt: skip


def _identity(file: Path) -> str:
    """Two models of one name are two: the path from the working folder, which moves with its reports, or a mark of another."""
    path = file.absolute()
    if path.is_relative_to(Path.cwd()):
        return path.relative_to(Path.cwd()).as_posix()
    return f"{file.stem}-{hashlib.sha256(os.fsencode(path.parent)).hexdigest()[:8]}"
