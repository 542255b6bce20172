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
    """What every cell printed, in however many pieces a kernel sent it, and shows as text; pictures that there is one."""
    found = list[str]()
    for cell in (one for one in notebook.cells if one.cell_type == "code"):
        found.append("".join(one["text"] for one in cell.outputs if one.output_type == "stream"))
        shown = [one for one in cell.outputs if one.output_type != "stream"]
        found += [one.get("data", {}).get("text/plain") or one.output_type for one in shown]
    return found


if __name__ == "__main__":
    for each in NOTEBOOKS:
        nbformat.write(executed(each), each)
