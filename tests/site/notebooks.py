"""Runs the notebooks of the documentation: ``python -m tests.site.notebooks`` writes them anew, with what they found."""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def read(path: Path) -> nbformat.NotebookNode:
    return nbformat.read(path, as_version=4)


def executed(path: Path) -> nbformat.NotebookNode:
    """The notebook, run from its own folder by a kernel of this very Python, without its times and counts."""
    notebook = read(path)
    for cell in notebook.cells:
        cell.pop("outputs", None)
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(FOLDER)}}).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
    return notebook


def printed(notebook: nbformat.NotebookNode) -> list[str]:
    """What every cell printed or shows as text; pictures by nothing but that there is one."""
    return [
        output.get("text") or output.get("data", {}).get("text/plain") or output.output_type
        for cell in notebook.cells if cell.cell_type == "code"
        for output in cell.outputs
    ]  # fmt: skip


if __name__ == "__main__":
    for each in NOTEBOOKS:
        nbformat.write(executed(each), each)
