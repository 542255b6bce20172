"""From a model file to its written budget."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmm_uq.uncertainty.evaluation import Evaluation
from cmm_uq.uncertainty.model_file import read_model_file
from cmm_uq.writing import staging, write_whole


@dataclass(frozen=True, eq=False)
class WrittenBudget:
    """What was found, contents of results.json, and what was written, by name."""

    evaluation: Evaluation
    results: bytes
    files: dict[str, Path]


def write_budget(file: Path, out: Path | None = None, *, seed: int | None = None) -> WrittenBudget:
    """Evaluate a model file and write ``budget.html``, ``budget.pdf`` and ``results.json``, all or none.

    Parameters
    ----------
    file : the model, in TOML.
    out : where to write; ``reports/<name of the file>`` by default.
    seed : instead of the file's.

    Raises
    ------
    CmmUqError : the model cannot be evaluated, or the folder cannot be written to.
    """
    model = read_model_file(file)
    folder = out or Path("reports") / file.stem
    with staging(folder) as place:
        evaluation = model.evaluate(seed)
        from cmm_uq.certificate.budget_page import budget_document
        from cmm_uq.certificate.html import render_html
        from cmm_uq.certificate.pdf import render_pdf
        from cmm_uq.certificate.results_file import as_json
        from cmm_uq.uncertainty.budget_results import results_of

        data = as_json({**results_of(evaluation), "inputs_sha256": {file.name: model.sha256}})
        document = budget_document(model, evaluation, file.name)
        pdf = render_pdf(document, {file.name: model.content, "results.json": data})
        contents = {"budget.html": render_html(document).encode(), "budget.pdf": pdf, "results.json": data}
        files = write_whole(place, folder, contents)
    return WrittenBudget(evaluation, data, files)
