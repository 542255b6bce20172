"""The examples of the documents run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "uncertainty"


@pytest.mark.parametrize("name", sorted(path.name for path in FOLDER.glob("*.md")))
def test_examples_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = (FOLDER / name).read_text(encoding="utf-8")
    scope: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL):
        exec(compile(block, name, "exec"), scope)
    capsys.readouterr()


def test_the_model_file_of_the_document_is_read(tmp_path: Path) -> None:
    from cmm_uq.uncertainty.model_file import read_model_file

    text = (FOLDER / "model-file.md").read_text(encoding="utf-8")
    path = tmp_path / "model.toml"
    path.write_text(re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)[0], encoding="utf-8")
    assert read_model_file(path).title == "Power loss"


def test_links_lead_somewhere() -> None:
    for page in FOLDER.glob("*.md"):
        for target in re.findall(r"\]\(([^)#]+\.md)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
