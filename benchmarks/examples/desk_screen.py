"""Draws the screen of docs/desk.md: a dropped export, its cells coloured by what they mean.

    python -m benchmarks.examples.desk_screen

Needs Chromium and Playwright.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[2]
EXPORT = ROOT / "docs" / "tutorial" / "ballbar-export.xlsx"
PICTURE = ROOT / "docs" / "images" / "desk.png"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "cmm_uq", "desk", folder, "--no-open"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process, sync_playwright() as playwright:
            assert process.stdout is not None
            link = re.search(r"http\S+", process.stdout.readline())
            assert link is not None
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1100, "height": 760})
            page.goto(link[0])
            page.set_input_files("input[type=file]", EXPORT)
            page.wait_for_url("**/desk/read**")
            page.screenshot(path=PICTURE)
            browser.close()
            process.terminate()


if __name__ == "__main__":
    main()
