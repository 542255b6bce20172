"""``cmm-uq verify``, ``sign``, ``release``, ``affected``, ``read``, ``qif``, ``keys``, ``standards``, ``schema``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmm_uq.app.cli import options as opt, terminal
from cmm_uq.app.cli.options import Ending, argument, examples, flag, option
from cmm_uq.app.cli.records import opened_records
from cmm_uq.app.cli.terminal import put_json, say
from cmm_uq.base.errors import CmmUqError, printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.again import AffectedCertificate, FigureChange
    from cmm_uq.app.commands.certificates.verification import Verification
    from cmm_uq.jobs.dcc.figures import CertificateView


FINDINGS_SHOWN = 20  # findings of a verification that are told one by one


def verify(
    files: list[Path] = argument(
        ..., "PDF, XML, HTML, results.json of one certificate, in any choice, or the folder of its report.", "FILE…"
    ),
    rerun: bool = flag(True, "--rerun/--no-rerun", "Compute everything again from the inputs, and compare."),
    trust: list[Path] | None = option(
        None, "Certificates that you trust, PEM or DER: a file or a folder; again for more.", "FILE|DIR", "nobody"
    ),
    schema: Path | None = option(None, "Folder with PTB's schemas of the DCC, that the XML is held to.", "DIR", "none"),
    records: str | None = option(
        None,
        "Records of the laboratory that must have the entry which the certificate states.",
        "WHERE",
        "none",
        "--records",
    ),
    end: Ending = opt.END,
) -> None:
    """Compare the forms of a certificate with each other, its figures, decisions and inputs, and compute it again.

    Exit code 0 where it is verified, 1 where something is wrong, 3 where nothing is but not all could be checked, 2 where a
    file cannot be read.
    """
    with end.progress() as stage:
        from cmm_uq.app.commands.certificates.verify import verify

        found = verify(files, rerun=rerun, trust=trust or None, schema=schema, records=records, stage=stage)
    data = {"schema": "cmm-uq/verification/1", "subject": found.subject, "said": found.said, **found.inquiry.as_data()}
    left = terminal.NOT_WHOLLY_CHECKED if found.inquiry.unchecked else 0
    end.put(data, _verified(found, verbose=end.verbose), terminal.NOT_VERIFIED if found.inquiry.findings else left)


def _verified(found: Verification, *, verbose: bool) -> list[str]:
    from cmm_uq.certificate.verify.given import CHECKS

    inquiry = found.inquiry
    shown = inquiry.findings if verbose else inquiry.findings[:FINDINGS_SHOWN]
    lines = [f"{inquiry.word}  {found.subject}", f"  {printable(found.said)}", *(f"  {one}" for one in shown)]
    if more := len(inquiry.findings) - len(shown):
        lines.append(f"  and {more} more: --verbose shows all")
    lines += [f"  not checked: {left}" for left in inquiry.unchecked]
    for name, what in CHECKS.items():
        wrong = any(one.check == name for one in inquiry.findings)
        count = inquiry.done.get(name, 0)
        if wrong or count:
            lines.append(f"  {name:<10}  {'✗' if wrong else '✓'}  {what} ({count})")
    return [*lines, *(f"  {note}" for note in inquiry.notes)]


def sign(
    files: list[Path] = argument(..., "certificate.pdf, certificate.xml.", "FILE..."),
    key: str = opt.KEY,
    time_server: str | None = opt.TIME_SERVER,
    level: str | None = opt.LEVEL,
    trust: list[Path] | None = opt.TRUSTED,
    out: Path | None = option(None, "Folder for signed copies.", "DIR", "signed where they are"),
    records: str | None = opt.RECORDS,
    end: Ending = opt.BRIEF,
) -> None:
    """Sign certificates, so that four eyes may look at them first: PDF by PAdES, XML by XAdES B-B.

    The set in their folder is written anew, all or none, and records that know the certificate are told.
    """
    signing = opt.open_key(key, time_server, level, trust)
    from cmm_uq.app.commands.certificates.signing import sign_files

    signed, place = sign_files(files, signing, out=out, records=records)
    recorded = [f"Recorded in {place}."] if place else []
    end.put({
        "signer": signing.signer.name, "test_key": signing.signer.test_key, "at": signing.at.isoformat(),
        "level": "B-B" if signing.stamping is None else signing.stamping.level,
        "files": [str(path) for path in signed], "records": place,
    }, [*recorded, *opt.signatures(signing, signed)])  # fmt: skip


def release(
    certificate: str = argument(..., "Number, id of the job, or number of its entry.", "CERTIFICATE"),
    by: str = option(..., "Who does it.", "NAME"),
    reason: str = option("", "Why; it stays in the records.", "TEXT"),
    despite: str = option(
        "", "Why it is released although a statement of it is no pass; it stays in the records.", "TEXT"
    ),
    withdraw: bool = flag(False, "--withdraw", "Withdraw it instead."),
    replaced_by: str | None = option(None, "Released certificate that takes its place.", "CERTIFICATE", "none"),
    records: str | None = opt.RECORDS,
    end: Ending = opt.BRIEF,
) -> None:
    """Release a certificate: until then it is a draft. By two persons where [laboratory] four_eyes = true.

    Refused for an artefact that was out of date on the day of the measurement, for what was simulated or compensated, and for
    what says DRAFT on its pages, since ISO/IEC 17025:2017, 7.8 asks for something that it does not state. One that states
    fail, undecided or incomplete needs a word why: --despite, or the answer to a question on a terminal.
    """
    if withdraw and replaced_by is not None:
        raise CmmUqError("a certificate is withdrawn or replaced, not both", where="--withdraw", fix="Leave out one")
    from cmm_uq.app.commands.certificates import release as releases

    with opened_records(records) as history:
        if withdraw or replaced_by is not None:
            done = releases.withdraw(history, certificate, by=by, reason=reason, replaced_by=replaced_by)
        else:
            ask = _ask_why if not end.silent and terminal.can_answer() else None
            done = releases.release(history, certificate, by=by, reason=reason, despite=despite, ask=ask)
        signatures = history.signatures(done.certificate.entry)
    now, waits = done.certificate, f"; {done.waiting} more must sign" if done.waiting else ""
    end.put({
        "certificate": now.number, "job": now.job, "entry": now.entry, "state": now.state, "waiting": done.waiting,
        "signatures": [{"what": one.what, "by": one.by, "reason": one.reason, "at": one.at.isoformat()} for one in signatures],
    }, [f"{now.number} of {now.day} ({now.machine}): {now.state}{waits}"])  # fmt: skip


def _ask_why(stated: str) -> str:
    """What the one who releases says of a certificate that states no pass."""
    say(printable(f"{stated}."))
    return str(typer.prompt("Why is it released all the same (nothing: it is not)", default="", show_default=False))


def affected(
    version: str = option(
        ..., "Oldest version of the package whose certificates are looked at.", "A", True, "--version"
    ),
    to: str | None = option(None, "Version that has the corrections.", "B", "the installed one", "--to"),
    only_list: bool = flag(False, "--list", "Only list them; compute nothing again."),
    write: Path | None = option(None, "Folder for a draft in place of each that changed.", "DIR", "none"),
    records: str | None = opt.RECORDS,
    end: Ending = opt.END,
) -> None:
    """Find the certificates that corrections touch, compute them again from the inputs in their PDF, compare figure by figure.

    Exit code 4 where a figure, a decision or a verdict is another one now, or a certificate could not be computed again.
    """
    if only_list and write is not None:
        raise CmmUqError("nothing is written of what is only listed", where="--list", fix="Leave out --list or --write")
    with end.progress() as stage:
        from cmm_uq import __version__
        from cmm_uq.app.commands.certificates.again import affected_certificates

        last = __version__ if to is None else to
        with opened_records(records, read_only=write is None) as history:
            certificates = list(affected_certificates(
                history, version, last, recompute=not only_list, out=write, where=str(history.place), stage=stage
            ))  # fmt: skip
    count = "1 certificate touched" if len(certificates) == 1 else f"{len(certificates)} certificates touched"
    changed = "" if only_list else f", {sum(one.changed for one in certificates)} changed"
    lines = [*(line for one in certificates for line in _affected(one)), f"{count}{changed}"]
    data = {"from": version, "to": last, "certificates": [_affected_data(one) for one in certificates]}
    wrong = any(one.changed or (one.problem and not only_list) for one in certificates)
    end.put(data, lines, terminal.NOT_CONFORMING if wrong else 0)


def _affected(one: AffectedCertificate) -> list[str]:
    c = one.certificate
    lines = [f"{c.number} of {c.day}, {c.machine}, version {c.version}, {c.state}"]
    lines += [f"  {correction.version}: {correction.what}" for correction in one.corrections]
    lines += [f"  not computed again: {one.problem}"] if one.problem else []
    lines += [f"  {change.quantity}: {_change(change)}" for change in one.changes or ()]
    if one.changed and one.decision != c.decision:
        lines.append(f"  decision: {c.decision} -> {one.decision}")
    if one.changed and one.diagnosis != c.diagnosis:
        lines.append(f"  diagnosis: {c.diagnosis or 'none'} -> {one.diagnosis or 'none'}")
    lines += ["  no figure changes"] if one.changes is not None and not one.changed else []
    return [*lines, *([f"  draft in {one.written}"] if one.written is not None else [])]


def _change(change: FigureChange) -> str:
    """With the ten digits of results.json: fewer would print a small change as none."""
    pair, unit = (change.before, change.after), change.unit
    words = ["none" if each is None else f"{each[0]:.10g} (u {each[1]:.10g}) {unit}" for each in pair]
    if words[0] == words[1]:
        words = ["none" if each is None else f"95 % interval {each[2]:.10g} to {each[3]:.10g} {unit}" for each in pair]
    return " -> ".join(words)


def _affected_data(one: AffectedCertificate) -> dict[str, Any]:
    c = one.certificate
    return {
        "certificate": c.number, "job": c.job, "entry": c.entry, "machine": c.machine, "day": c.day.isoformat(),
        "version": c.version, "state": c.state, "command": c.command,
        "corrections": [{"version": each.version, "what": each.what} for each in one.corrections],
        "computed": one.changes is not None, "changed": one.changed, "problem": one.problem or None,
        "decision": {"before": c.decision, "after": one.decision or None},
        "diagnosis": {"before": c.diagnosis, "after": one.diagnosis or None},
        "changes": [
            {"name": each.name, "unit": each.unit, "before": each.before, "after": each.after} for each in one.changes or ()
        ],
        "draft": None if one.written is None else str(one.written),
    }  # fmt: skip


def read(
    files: list[Path] = argument(..., "Certificates: DCC of version 3 (XML).", "FILE..."),
    schema: Path | None = option(
        None, "Folder with the schemas of DCC and D-SI (.xsd), to check the files by as well.", "DIR", "own checks"
    ),
    end: Ending = opt.BRIEF,
) -> None:
    """Print digital calibration certificates (DCC). Exit code 2 for a file that is none.

    Signatures are counted and not verified: cmm-uq verify does.
    """
    from cmm_uq.app.commands.jobs.exchange import read_certificate
    from cmm_uq.jobs.dcc.figures import data, shown

    certificates = [(file, read_certificate(file, schema)) for file in files]
    rows = [{"file": str(file), **data(one)} for file, one in certificates]
    lines = (line.rstrip() for file, one in certificates for line in _certificate(str(file), shown(one)))
    end.put({"schema": "cmm-uq/read/1", "certificates": rows}, lines)


def _certificate(file: str, certificate: CertificateView) -> list[str]:
    """Labels in a column, the lines of a text below each other; columns of a table as wide as their widest cell."""

    def labels(rows: tuple[tuple[str, str], ...]) -> list[str]:
        width = max((len(label) for label, _ in rows), default=0)
        each = ((label, number, line) for label, text in rows for number, line in enumerate(text.splitlines()))
        return [f"  {'' if number else label:<{width}}  {line}" for label, number, line in each]

    lines = [file, *labels(certificate.rows)]
    for title, rows, grids in certificate.parts:
        lines += ["", title, *labels(rows)]
        for grid in grids:
            cells = [grid.headings, *grid.rows]
            widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
            table = ("  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in cells)
            lines += ["", f"  {grid.title}", *(f"    {row}" for row in table)]
    return [*lines, ""]


def qif(
    report: Path = argument(..., "Folder of a report, or its results.json.", "REPORT"),
    out: Path | None = option(None, "File to write.", "FILE", "<job id>.qif"),
    quiet: bool = opt.QUIET,
) -> None:
    """Write every value that a standard decided on, and the error factors, as QIF 3.0. Nothing is overwritten."""
    from cmm_uq.app.commands.jobs.exchange import write_qif

    Ending(quiet).put({}, [str(write_qif(report, out))])


keys = opt.group(
    "Keys for electronic signatures: a new one for trying. Those that count come from a trust service.",
    examples("keys new test.p12 --name 'Calibration laboratory'"),
)


@opt.command(keys, "new", "keys new test.p12 --name 'Calibration laboratory'")
def new_key(
    file: Path = argument(..., "PKCS#12 file to be made.", "FILE"),
    name: str = option("cmm-uq", "Of whom it is for.", "NAME"),
    end: Ending = opt.BRIEF,
) -> None:
    """Make a test key with its certificate, FILE for signing and FILE.pem for whoever is to trust it.

    The passphrase is asked for, or read from CMM_UQ_SIGN_PASSPHRASE_FILE or CMM_UQ_SIGN_PASSPHRASE. Whatever is signed with
    it says that it is a test key.
    """
    from cmm_uq.app.commands.certificates.signing import new_test_key
    from cmm_uq.certificate.sign import TEST_NOTE

    certificate, until = new_test_key(file, name, lambda question: opt.ask_secret(question, twice=True))
    whom = f"{file} signs until {until}; {certificate} is for whoever is to trust it."
    data = {"key": str(file), "certificate": str(certificate), "test_key": True}
    end.put(data, [whom, f"TEST KEY: whatever it signs says: {TEST_NOTE}"])


def standards(
    name: str | None = argument(None, "Standard with its edition.", "[NAME]"),
    form: Path | None = option(None, "File to write its form to.", "FILE", "none"),
) -> None:
    """List the standards that are decided, or what is done of each clause of one.

    With --form a form is written that a laboratory fills in beside its own copy and names in [[conformity]] clauses.
    Nothing is overwritten.
    """
    from cmm_uq.app.commands.forms import clauses_of, listed_standards, write_form

    if name is None:
        if form is not None:
            raise CmmUqError("a form is of one standard", where="--form", fix="Name it: cmm-uq standards lists them")
        lines = [": ".join(filter(None, (standard, ", ".join(known)))) for standard, known in listed_standards()]
    elif form is not None:
        lines = [str(write_form(name, form))]
    else:
        lines = [line for one in clauses_of(name) for line in (
            f"{one.title}: {one.does}", f"    {'read' if one.read else 'not read'}; {one.source}")]  # fmt: skip
    Ending().put({}, lines)


def schema(
    name: str = argument("job", "job (with its plan), part, budget, truth, instrument or schedule.", "NAME"),
) -> None:
    """Print the JSON Schema of a file, with the kinds, effects and standards that are installed."""
    from cmm_uq.app.commands.forms import as_text, schema_named

    put_json(as_text(schema_named(name)))
