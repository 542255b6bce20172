"""Draws the screens of docs/tutorial.md, and the certificate that it ends with.

Its commands are run one after the other in an empty folder, as a terminal of 80 columns shows them.

    python -m benchmarks.examples.screens

Needs a system with pseudo-terminals, and pdftoppm.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import tomlkit
from rich.console import Console
from rich.terminal_theme import TerminalTheme
from rich.text import Text

import cmm_uq
from benchmarks.examples.gallery import first_page_of

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorial.md"
PICTURES = ROOT / "docs" / "images" / "tutorial"
COLUMNS = 80
SHOWN = ("import", "check", "report")
COLOURS = TerminalTheme(
    (255, 255, 255), (36, 41, 46),
    [(36, 41, 46), (179, 29, 40), (23, 110, 50), (138, 90, 0), (3, 87, 150), (111, 66, 193), (0, 110, 120), (80, 88, 96)],
    [(88, 96, 105), (179, 29, 40), (23, 110, 50), (138, 90, 0), (3, 87, 150), (111, 66, 193), (0, 110, 120), (36, 41, 46)],
)  # fmt: skip
FORM = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" aria-label="Terminal">
<style>{styles}
text {{ font-family: ui-monospace, "DejaVu Sans Mono", Consolas, Menlo, monospace; font-size: {char_height}px; }}
</style>
<rect width="100%" height="100%" rx="6" fill="#fff" stroke="#c9d1d9"/>
<defs>{lines}</defs>
<g transform="translate(9, 9)">{backgrounds}<g class="{unique_id}-matrix">{matrix}</g></g>
</svg>
"""


def commands(page: Path) -> list[str]:
    """Those of the page that are not excerpts, each on one line."""
    blocks = re.findall(r"^```console\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [re.sub(r"\s+", " ", line.removeprefix("$ ")) for line in lines if line.startswith("$ ")]


def shown(command: str, folder: Path) -> str:
    """What a terminal shows of standard output; what a command says while it works is on standard error."""
    import pty  # not on Windows

    words = shlex.split(command)
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(COLUMNS), "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-m", "cmm_uq", *words[1:]],
        cwd=folder,
        env=environment,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
    )
    os.close(theirs)
    told = b""
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        told += part
    os.close(ours)
    assert process.wait() == 0, (command, told.decode())
    return told.decode().replace("\r\n", "\n")


def picture(command: str, told: str) -> str:
    """A screen as SVG, with text that can be selected."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True, highlight=False)
    console.print(Text("$ " + command, style="bold"))
    console.print(Text.from_ansi(told.rstrip("\n")))
    return console.export_svg(theme=COLOURS, code_format=FORM, unique_id="screen")


def complete(job: Path) -> None:
    """Put into job.toml what the tutorial says should stand there."""
    added = re.search(r"^```toml excerpt\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert added is not None
    document = tomlkit.parse(job.read_text(encoding="utf-8"))
    for table, keys in tomllib.loads(added[1]).items():
        document.setdefault(table, tomlkit.table()).update(keys)
    job.write_text(tomlkit.dumps(document), encoding="utf-8")


def main() -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(ROOT / "docs" / "tutorial" / "ballbar-export.xlsx", folder)
        for command in commands(PAGE):
            told = shown(command, folder)
            subcommand = command.split()[1]
            if subcommand in SHOWN:
                path = PICTURES / f"{subcommand}.svg"
                path.write_text(picture(command, told), encoding="utf-8")
                print(path.name, path.stat().st_size)
        complete(folder / "iota" / "job.toml")
        written = cmm_uq.report(folder / "iota").write(folder / "complete")
        first_page_of(written["certificate.pdf"], PICTURES / "certificate.png")


if __name__ == "__main__":
    main()
