"""A part on the desk: its plan and the machine's certificate make a job, and measured points that are dropped on it decide."""

from __future__ import annotations

import re
from collections.abc import Iterable

from cmm_uq.app.desk.drafts import Draft
from cmm_uq.app.desk.job_pages import DELETE, PART, JobState
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.page import Block, Cell, FormEntry, PageForm, PageNotice, WebPage
from cmm_uq.app.serve.rendering import DESK
from cmm_uq.base.messages import Text, Verbatim, say

PLAN = f"{DESK}/plan"
_RECORDING = re.compile(r"^\[recording\][^\n]*\n", re.MULTILINE)
_FILE = re.compile(r"^file = [^\n]*\n", re.MULTILINE)


def part_page(draft: Draft | None, machines: Iterable[JobState]) -> WebPage:
    """A plan to be dropped, then the certificate of the machine to be chosen."""
    certificates = tuple(
        (one.file(".pdf"), say("{id}: {machine}", id=Verbatim(one.id), machine=p.shown(one.machine)))
        for one in machines
        if one.file(".pdf") and not one.part
    )
    blocks: tuple[Block, ...]
    if draft is None:
        hint = say("QIF 3.0 with features and tolerances, a DMIS program, or a table of features.")
        blocks = (p.Drop(PLAN, say("Drop the plan of the part here, or choose it"), hint, say("Read it")),)
    elif not certificates:
        blocks = (PageNotice(say("No certificate of a machine lies in this folder yet: make one first"), "open"),)
    else:
        no_yes: tuple[tuple[str, Text], ...] = (
            ("", say("is refused by its name")),
            ("yes", say("is left out, and named")),
        )
        fields = (
            FormEntry("folder", say("Name of the job, and of its folder"), example="bracket-7"),
            FormEntry("certificate", say("Certificate of the machine"), "", "select", certificates),
            FormEntry("date", say("Date of the measurement"), "", "date"),
            FormEntry("not_measured", say("What of the plan is not understood"), "", "select", no_yes),
        )
        given = (("draft", draft.id),)
        delete = PageForm(DELETE, (), (("delete", say("Delete this plan")),), given)
        blocks = (PageForm(PART, fields, (("create", say("Make the job")),), given), delete)
    lead = say("Features and tolerances from its plan, errors from the certificate of the machine.")
    return WebPage(say("A part"), DESK, lead, blocks, above=(Cell(say("Desk"), DESK),))


def with_points(text: str, name: str) -> str:
    """job.toml with the file of its measured points; nothing else is changed."""
    line = f'file = "{name}"\n'
    found = _RECORDING.search(text)
    if found is None:
        return f"{text.rstrip()}\n\n[recording]\n{line}"
    end = text.find("\n[", found.end())
    block = text[found.end() : end + 1 if end >= 0 else len(text)]
    changed = _FILE.sub(lambda _: line, block, count=1) if _FILE.search(block) else line + block
    return text[: found.end()] + changed + text[found.end() + len(block) :]
