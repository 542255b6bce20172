"""The desk in a real browser: from an empty folder to a certificate, by keyboard, on a telephone, without a script."""

from __future__ import annotations

import re
import ssl
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from axe_playwright_python.sync_playwright import Axe

from cmm_uq.app.serve.accounts import add_account, tls_of
from tests.app.desk.conftest import Visitor, opened
from tests.app.desk.test_questions import ANSWERS, EXPORT
from tests.laboratory.schedule.servers import certificate

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.long


class Sitting:
    """One browser at one desk; ``wrong``: what it complains of, requests elsewhere, and what axe finds."""

    def __init__(self, page: Page, visitor: Visitor) -> None:
        self.page, self.visitor, self.wrong = page, visitor, list[object]()
        self.url = visitor.server.url.rstrip("/")
        page.on("console", lambda message: self.wrong.append(message.text))
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("request", lambda request: None if request.url.startswith(self.url) else self.wrong.append(request.url))

    def look(self, *, axe: bool = True) -> None:
        """At what is shown, wide and narrow."""
        for width in (360, 1280):
            self.page.set_viewport_size({"width": width, "height": 900})
            wide = self.page.evaluate("document.documentElement.scrollWidth")
            self.wrong += [(self.page.url, width, wide)] if wide > width else []
        options = {"resultTypes": ["violations"], "rules": {"frame-tested": {"enabled": False}}}
        found = Axe().run(self.page, options=options).response["violations"] if axe else []
        self.wrong += [(self.page.url, one["id"], [node["html"][:120] for node in one["nodes"]][:2]) for one in found]

    def state(self, name: str, value: str) -> None:
        """Fill in a field, or choose of its list."""
        field = self.page.locator(f'[name="{name}"]')
        field.select_option(value) if field.evaluate("one => one.tagName") == "SELECT" else field.fill(value)

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def tab_to(self, attribute: str, value: str, most: int = 90) -> None:
        for _ in range(most):
            self.page.keyboard.press("Tab")
            found = self.page.evaluate("a => [document.activeElement.getAttribute(a)]", attribute)
            if value in found:
                assert self.page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"
                return
        raise AssertionError(f"no Tab leads to {value!r}")


def sat(
    browser: Browser, root: Path, accounts: Path | None = None, tls: ssl.SSLContext | None = None, **how: object
) -> Iterator[Sitting]:
    for visitor in opened(root, accounts, tls):
        context = browser.new_context(viewport={"width": 1280, "height": 900}, **how)  # type: ignore[arg-type]
        yield Sitting(context.new_page(), visitor)
        context.close()


@pytest.fixture
def sitting(browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Sitting]:
    monkeypatch.setenv("CMM_UQ_RECORDS", "reports/records.db")
    (tmp_path / "root").mkdir()
    yield from sat(browser, tmp_path / "root")


def test_from_an_empty_folder_to_a_certificate_the_same_as_the_command_s(sitting: Sitting, tmp_path: Path) -> None:
    page, root = sitting.page, sitting.visitor.desk.root
    page.goto(sitting.visitor.link)
    assert page.url == f"{sitting.url}/desk"
    assert "No job lies here yet" in page.inner_text("main")
    sitting.look()
    page.set_input_files("input[type=file]", EXPORT)
    page.wait_for_url("**/desk/read**")
    assert "x -496.6823 mm" in page.locator(".notice").inner_text()
    assert page.locator("td.m-x").first.inner_text() == "-496.6823"
    assert "cmm-uq import ballbar-export.xlsx" in page.locator("pre").inner_text()
    sitting.look()
    sitting.press("It is right: choose the artefact")
    sitting.look()
    page.get_by_role("link", name=re.compile("Ballbar")).first.click()
    page.fill("[name=folder]", "K-1")
    for name, value in ANSWERS.items():
        sitting.state(name, value)
    page.locator(".says .open").wait_for()
    assert "Nothing would stop" in page.locator(".says").inner_text()
    page.fill('[name="artefact.length_mm"]', "399")
    page.locator(".says .bad").wait_for()
    assert "404.205" in page.locator(".says").inner_text()
    page.fill('[name="artefact.length_mm"]', ANSWERS["artefact.length_mm"])
    sitting.look()
    sitting.press("Make the job")
    assert page.url.endswith("/desk/job?name=K-1")
    page.reload()
    page.go_back()
    page.go_forward()
    sitting.look()
    page.get_by_role("link", name="Change it by fields").click()
    assert page.input_value('[name="machine.travel_mm.x"]') == "-600 to 900"
    sitting.look()
    page.go_back()
    sitting.press("Make the certificate")
    page.locator("progress").wait_for()
    sitting.look()
    page.wait_for_url("**/desk/certificate**", timeout=60_000)
    sitting.look()
    frame = page.frames[1]
    assert frame.locator("h1").inner_text() == "Calibration certificate"
    assert page.locator("iframe").get_attribute("sandbox") == ""
    assert frame.evaluate("origin") == "null"
    page.locator("figcaption", has_text="Residuals as vectors where they were measured").wait_for()
    before, canvas = page.locator("canvas").screenshot(), page.locator("canvas")
    canvas.focus()
    page.keyboard.press("ArrowRight")
    assert canvas.screenshot() != before, "it does not turn"
    page.goto(f"{sitting.url}/")
    assert "1102" in page.inner_text("main")
    page.get_by_role("link", name="Desk", exact=True).click()
    assert page.locator("tbody tr").count() == 1
    assert [one for one in sitting.wrong if "Failed to load resource" not in str(one)] == []
    other = tmp_path / "other"
    other.mkdir()
    subprocess.run(["cp", "-r", str(root / "K-1"), str(other)], check=True)
    subprocess.run([sys.executable, "-m", "cmm_uq", "report", "K-1", "--quiet"], cwd=other, check=True)
    names = {path.name for path in (other / "reports" / "K-1").iterdir() if path.name[0] != "."}
    assert {"results.json", "certificate.pdf", "certificate.html", "certificate.xml"} <= names
    for name in names:
        assert (root / "reports" / "K-1" / name).read_bytes() == (other / "reports" / "K-1" / name).read_bytes(), name


def test_a_column_is_corrected_by_the_keyboard_alone(sitting: Sitting) -> None:
    page = sitting.page
    page.goto(sitting.visitor.link)
    content = b"Position;Ball;X [mm];Y [mm];Z [mm];X corr [mm]\n1;1;10.5;0;0;10.7\n1;2;110.5;0;0;110.7\n"
    content += b"2;1;12;0;5;12.2\n2;2;112;0;5;112.2\n"
    page.set_input_files("input[type=file]", {"name": "a.csv", "mimeType": "text/csv", "buffer": content})
    page.wait_for_url("**/desk/read**")
    sitting.tab_to("name", "c2")
    page.keyboard.type("not used")
    sitting.tab_to("name", "c5")
    page.keyboard.type("x")
    sitting.tab_to("value", "read")
    with page.expect_navigation():
        page.keyboard.press("Enter")
    assert "x_mm=X corr [mm]" in page.locator("pre").inner_text()
    assert "x 10.7000 mm" in page.locator(".notice").inner_text()
    assert page.locator("td.m-x").first.inner_text() == "10.7"
    sitting.tab_to("value", "on")
    with page.expect_navigation():
        page.keyboard.press("Enter")
    assert page.url.partition("?")[0].endswith("/desk/artefact")


def test_a_cancelled_certificate_leaves_nothing(sitting: Sitting) -> None:
    from tests.app.desk.test_desk import made

    page, root = sitting.page, sitting.visitor.desk.root
    page.goto(sitting.visitor.link)
    cookie = page.context.cookies()[0]
    sitting.visitor.cookie = f"{cookie['name']}={cookie['value']}"  # type: ignore[typeddict-item]
    made(sitting.visitor)
    page.goto(f"{sitting.url}/desk/job?name=K-1")
    sitting.press("Make the certificate")
    sitting.press("Cancel")
    page.locator(".notice", has_text="Cancelled: nothing was written").wait_for()
    assert not list(root.glob("reports/K-1/*"))
    sitting.look()


def test_without_a_script_the_way_is_the_same(browser: Browser, tmp_path: Path) -> None:
    for sitting in sat(browser, tmp_path, java_script_enabled=False):
        page = sitting.page
        page.goto(sitting.visitor.link)
        page.set_input_files("input[type=file]", EXPORT)
        sitting.press("Read it")
        sitting.press("It is right: choose the artefact")
        page.get_by_role("link", name=re.compile("Ballbar")).first.click()
        page.fill("[name=folder]", "K-1")
        for name, value in ANSWERS.items():
            sitting.state(name, value)
        page.fill('[name="artefact.length_mm"]', "399")
        sitting.press("Check")
        assert "404.205" in page.locator(".notice").inner_text()
        page.fill('[name="artefact.length_mm"]', ANSWERS["artefact.length_mm"])
        sitting.press("Make the job")
        sitting.press("Make the certificate")
        first = page.get_attribute("progress", "value")
        page.wait_for_function(
            "first => document.querySelector('progress').value > first", arg=float(first or 0), timeout=30_000
        )
        sitting.press("Cancel")  # its page came anew by itself
        assert "Cancelled" in page.locator(".notice").inner_text()
        assert sitting.wrong == []


def test_from_another_machine_somebody_signs_in_and_out(browser: Browser, tmp_path: Path) -> None:
    accounts, root = tmp_path / "accounts.toml", tmp_path / "root"
    root.mkdir()
    add_account(accounts, "ben:read", lambda: "staple of the reader")
    for sitting in sat(browser, root, accounts, tls_of(*certificate(tmp_path), accounts), ignore_https_errors=True):
        page = sitting.page
        page.goto(sitting.visitor.link)
        assert page.url == f"{sitting.url}/account"
        page.fill("[name=name]", "ben")
        page.fill("[name=password]", "something else")
        page.keyboard.press("Enter")
        page.locator(".notice", has_text="Name or password is wrong").wait_for()
        sitting.look()
        page.fill("[name=name]", "ben")
        page.fill("[name=password]", "staple of the reader")
        page.keyboard.press("Enter")
        page.wait_for_url("**/desk")
        assert "No job lies here yet" in page.inner_text("main")
        page.get_by_role("link", name="Account").click()
        assert "ben may look at everything" in page.inner_text("main")
        sitting.look()
        sitting.press("Sign out")
        page.wait_for_url("**/account")
        page.goto(f"{sitting.url}/desk")
        assert page.url == f"{sitting.url}/account"
        assert [one for one in sitting.wrong if "Failed to load resource" not in str(one)] == []
