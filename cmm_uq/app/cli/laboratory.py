"""``cmm-uq acquire``, ``batch``, ``due``, ``fleet``, ``history`` and ``serve``: a laboratory over time.

``cmm-uq desk``: the desk in the browser, until Ctrl-C.
"""

from __future__ import annotations

import getpass
import ipaddress
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.options import Ending, argument, flag, option
from cmm_uq.app.cli.summary import COLOURS, HEADING, folder_of, screen_layout, summary_lines
from cmm_uq.app.cli.terminal import BAD_INPUT, Line, can_answer, say, say_now
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import check_permitted
from cmm_uq.base.output.interruption import keeping

if TYPE_CHECKING:
    from cmm_uq.app.commands.laboratory.batch import Batch

LATER_S = 0.7  # s after which the worker is begun


def desk(
    folder: Path = argument(Path(), "Folder that the desk works in.", "FOLDER", "the working folder"),
    port: int = option(0, "Port to listen on.", "N", "a free one", min=0, max=65535),
    bind: str = option(
        "127.0.0.1", "Address to listen on; for any but 127.0.0.1 give --tls and --accounts.", "ADDRESS"
    ),
    name: list[str] | None = opt.HOST,
    tls: Path | None = opt.TLS,
    tls_key: Path | None = opt.TLS_KEY,
    accounts: Path | None = opt.ACCOUNTS,
    add_account: str | None = opt.ADD_ACCOUNT,
    open_: bool = option(True, "Open it in a browser.", None, True, "--open/--no-open"),
    quiet: bool = opt.QUIET,
) -> None:
    """Make certificates in a browser: drop an export, choose the artefact, fill in a dozen fields.

    The link is opened once, on this machine, by whoever started the desk. All that is done there lies in FOLDER, as files that
    the other commands read. For other machines there are accounts: cmm-uq desk --accounts FILE --add-account anna:work.
    """
    from cmm_uq.app.desk.desk import Desk
    from cmm_uq.app.serve import accounts as own, server as http

    if add_account is not None:
        put_account(accounts, add_account)
        return
    if not folder.is_dir():
        raise CmmUqError("is no folder", where=str(folder), fix="Name a folder that is there")
    check_permitted(folder, "Mend its permissions, or name another folder")
    context = own.tls_of(tls, tls_key, accounts)
    if accounts is None and bind != "localhost" and not _loopback(bind):
        fix = "Give --tls and --accounts; or cmm-uq serve --bind, which shows the records, to be read"
        problem = "the desk writes files and runs commands: without accounts it is for this machine alone"
        raise CmmUqError(problem, where=f"--bind {bind}", fix=fix)
    place = Desk(folder, say_now)
    address = "127.0.0.1" if bind == "localhost" else bind
    with (
        http.RecordsServer(place.answer, address, port, name or (), context) as server,
        keeping(lambda: "the desk is closed"),
    ):
        link = place.open_at(server.url, server.server_port, accounts)
        if not quiet:
            say_now(f"{place.root} at {link} until Ctrl-C")
        later = threading.Timer(LATER_S, place.begin)  # the first page first
        later.daemon = True
        later.start()
        _browse(link, open_)
        try:
            server.serve_forever()
        finally:
            later.cancel()
            place.close()


def put_account(accounts: Path | None, stated: str) -> None:
    """Ask for a password on the terminal, and write the account."""
    from cmm_uq.app.serve.accounts import add_account

    if accounts is None:
        raise CmmUqError("says no file for the account", where="--add-account", fix="Give it with --accounts FILE")
    add_account(accounts, stated, _password)
    say(f"{accounts}: {stated.replace(':', ', role ')}")


def _password() -> str:
    if not can_answer():
        raise CmmUqError("nobody can type a password here", where="--add-account", fix="Run it in a terminal")
    first, second = getpass.getpass("Password: "), getpass.getpass("The same again: ")
    if first != second:
        raise CmmUqError("both are not the same", where="password", fix="Type it again")
    return first


def _browse(url: str, wanted: bool) -> None:
    if wanted:
        import webbrowser

        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


def _loopback(bind: str) -> bool:
    try:
        return ipaddress.ip_address(bind).is_loopback
    except ValueError:
        return False


FAILED_SHOWN = 20  # failed jobs that are named where not everything is asked for


def acquire(
    job: Path = opt.job_folder(..., "Job folder; its instruments are named in [acquire]."),
    simulate: bool = option(False, "Try it without instruments: simulated ones, in a job so marked."),
    out: Path | None = option(
        None, "With --simulate: folder for a copy of the job, so marked.", "DIR", "the job itself"
    ),
    seed: int = option(0, "Seed of what simulated instruments say.", "N", min=0),
    plain: bool = flag(False, "--plain", "Lines instead of a screen, as without a terminal."),
    skip_damaged: bool = flag(
        False, "--skip-damaged", "Go on behind damaged lines of earlier journals; the recording then says so."
    ),
    quiet: bool = opt.QUIET,
) -> None:
    """Take the recording of a job from its instruments, a folder of results or the keyboard, point by point of its plan.

    Type help for the words; the same command goes on where the last session ended.
    """
    from cmm_uq.app.cli.instruments import operated
    from cmm_uq.app.commands.laboratory.acquire import begin_acquisition, write_trial

    if out is not None and not simulate:
        fix = "Add --simulate, or leave --out away: the recording goes into the job"
        raise CmmUqError("--out is for a trial", fix=fix)
    folder = job if out is None else write_trial(job, out)
    session = begin_acquisition(folder, simulate=simulate, seed=seed, skip_damaged=skip_damaged)
    operated(session, plain=plain, quiet=quiet)


def batch(
    folders: list[Path] = argument(
        ..., "Job folders, or folders with job folders anywhere below.", "FOLDER...", autocompletion=opt.job_folders
    ),
    out: Path | None = opt.out(None, "reports"),
    workers: int | None = option(
        None, "Processes at once; no byte depends on it.", "N", "as many as there are processors"
    ),
    scheduler: str | None = option(None, "Address of a Dask cluster that computes instead.", "tcp://HOST:PORT"),
    results_only: bool = flag(
        False, "--results-only", "Write results.json alone: the same bytes, no document, no picture."
    ),
    parquet: Path | None = option(None, "Write a Parquet file, too: a row for each value.", "FILE"),
    resume: bool = flag(
        False, "--resume", "Leave jobs alone whose report is there, from the same files by this version."
    ),
    time_limit: float = option(1800.0, "Seconds that one job may take before it is stopped.", "S"),
    tries: int = option(3, "Processes that one job may end (killed, out of memory) before it is given up.", "N"),
    seed: int = opt.seed(),
    end: Ending = opt.ending("force strict quiet verbose json"),
    records: str | None = opt.RECORDS,
) -> None:
    """Write the report of every job as `report` does; one that fails never stops the others. Exit code 2 when one failed."""
    with end.progress() as stage:
        from cmm_uq.app.commands.laboratory.batch import BatchOptions, write_batch

        options = BatchOptions(workers, scheduler, results_only, seed, resume, end.force, time_limit, tries)
        done = write_batch(folders, out, options, parquet=parquet, stage=stage, records=records)
    lines = _batch_lines(done, verbose=end.verbose)
    end.put(done.as_data(), lines, BAD_INPUT if done.failed else 0, bool(done.not_conforming))


def _batch_lines(batch: Batch, *, verbose: bool) -> Iterator[Line]:
    """What came of it, and which jobs failed, the first of them or all."""
    from cmm_uq.base.messages import Text, Verbatim, plural, say
    from cmm_uq.certificate.wording import Headline, Summary
    from cmm_uq.laboratory.schedule.processes import duration, pace

    counts = ((batch.already, say("{count} there already", count=batch.already)),
              (batch.planned, say("{count} still to be measured", count=batch.planned)),
              (batch.not_conforming, say("{count} not conforming or inconsistent", count=batch.not_conforming)),
              (len(batch.failed), say("{count} failed", count=len(batch.failed))))  # fmt: skip
    counted = (say("{count} written", count=batch.written), *(text for count, text in counts if count))
    jobs = plural(batch.count, one=say("1 job"), many=say("{count} jobs", count=batch.count))
    verdict = Headline("FAILED" if batch.failed else "DONE", "bad" if batch.failed else "good", jobs, counted)
    remarks: list[Text] = [say("Reports: {folder}", folder=Verbatim(batch.out))]
    remarks += [say("Recorded in {records}", records=Verbatim(batch.records))] if batch.records else []
    remarks += [say("Values: {file}", file=Verbatim(batch.parquet))] if batch.parquet is not None else []
    if batch.written and batch.seconds > 0:
        took, rate = Verbatim(duration(batch.seconds)), Verbatim(pace(batch.written / batch.seconds))
        remarks.append(say("{took}, {rate}", took=took, rate=rate))
    if batch.ended:
        one = say("1 process ended over a job, which was then given to another.")
        many = say("{count} processes ended over a job, which was then given to another.", count=batch.ended)
        remarks.append(plural(batch.ended, one=one, many=many))
    warnings: list[Text] = [Verbatim(each) for each in batch.failed[: None if verbose else FAILED_SHOWN]]
    if more := len(batch.failed) - len(warnings):
        warnings.append(say("{more} more failed; --verbose names them all, --json as data.", more=more))
    summary = Summary(verdicts=(verdict,), remarks=tuple(remarks), warnings=tuple(warnings))
    yield from screen_layout(verbose=verbose).screen(summary)


def due(
    machines: list[str] | None = argument(
        None, "Serial numbers or names; all machines and artefacts without.", "[MACHINE]..."
    ),
    records: str | None = opt.READ_RECORDS,
    on: str | None = opt.ON,
    fleet: Path | None = opt.FLEET,
    within: str | None = option(None, "Only what is due that soon (90d, 12w, 3m, 1y), or has no date.", "TIME", "all"),
    out: Path | None = option(None, "Folder for due.html and due.json.", "DIR", "none"),
    end: Ending = opt.ending("force strict quiet json", "where anything is overdue"),
) -> None:
    """Say which machines and artefacts are due for calibration, when, and why."""
    from cmm_uq.app.commands.laboratory.due import what_is_due, write_due

    found = what_is_due(records, machines or (), on=opt.day_of(on), within=opt.time_of(within), fleet=fleet)
    files = {} if out is None else write_due(found, out, force=end.force)

    def lines() -> Iterator[Line]:
        from cmm_uq.certificate.pages.fleet import counts, due_row

        text, standing = counts(found.items, found.on, found.within)
        yield (f"{found.on.isoformat()}: ", HEADING), (text, COLOURS[standing])
        # every reason whole: a list that says why is what is asked for
        yield from screen_layout(verbose=True).table(due_row(one, found.on, found.within) for one in found.items)
        yield from _written(files)

    end.put(found.data(), lines(), strict=bool(found.of("overdue")))


def fleet(
    records: str | None = opt.READ_RECORDS,
    name: list[str] | None = option(
        None, "Value to look at, such as scale_x.ppm; may be repeated.", "NAME", "all with a limit", "--name"
    ),
    out: Path | None = option(None, "Folder for fleet.html, fleet.json and fleet.csv.", "DIR", "none"),
    seed: int = opt.seed(1),
    end: Ending = opt.ending("force strict quiet verbose json", "where a machine does not belong"),
) -> None:
    """Learn from all machines of the records what drift is usual for models and places, and which do not belong."""
    with end.progress() as stage:
        from cmm_uq.app.commands.laboratory.due import fleet, write_fleet
        from cmm_uq.certificate.pages.fleet_summary import fleet_data, fleet_summary

        found = fleet(records, name or (), seed=seed, stage=stage)
        files = {} if out is None else write_fleet(found, out, force=end.force)
    lines = () if end.silent else summary_lines(fleet_summary(found), files, verbose=end.verbose)
    end.put(fleet_data(found), lines, strict=bool(found.outsiders))


def history(
    machine: str = argument(..., "Serial number of the machine, or its name.", "MACHINE"),
    records: str | None = opt.READ_RECORDS,
    on: str | None = opt.ON,
    fleet: Path | None = opt.FLEET,
    parts: list[Path] | None = option(
        None, "Folder with reports of parts, anywhere below; may be repeated.", "DIR", "beside the records", "--parts"
    ),
    out: Path | None = option(None, "Folder for history.html, with pictures, and history.json.", "DIR", "none"),
    end: Ending = opt.FORCED,
) -> None:
    """Say how every error factor and figure of a machine has gone, what changed last, and when a limit will be crossed.

    After a calibration or a check that it failed: since when it is in doubt, and the parts that were measured on it since.
    """
    from cmm_uq.app.commands.laboratory.due import history_of, write_history
    from cmm_uq.certificate.pages.doubt import doubt_words, doubtful_parts, part_rows
    from cmm_uq.certificate.pages.history import history_data, step_notes, summary_row, terminal_note

    found = history_of(machine, records, on=opt.day_of(on), fleet=fleet, parts=parts or ())
    files = {} if out is None else write_history(found, out, force=end.force)

    def lines() -> Iterator[Line]:
        serial = "" if found.machine.by_name else f", serial number {found.machine.serial}"
        count = len(found.certificates)
        recordings = "one recording" if count == 1 else f"{count} recordings"
        yield (f"{found.machine.name}{serial}", HEADING), (f": {recordings} up to {found.on.isoformat()}", "")
        yield from screen_layout(verbose=end.verbose).table(summary_row(found, one) for one in found.values)
        yield from [((terminal_note(found), ""),)] if found.values else []
        yield from (((doubt_words(one), COLOURS["bad"]),) for one in found.doubtful)
        yield from screen_layout(verbose=True).table(part_rows(doubtful_parts(found)))
        for last in found.parts[-1:]:
            measured = "One part" if len(found.parts) == 1 else f"{len(found.parts)} parts"
            yield ((f"{measured} measured on it, as recorded; the newest is {last.number} of {last.day}.", ""),)
        yield from (((text, COLOURS["open"]),) for text in (*step_notes(found), *found.remarks))
        yield from _written(files)

    end.put(history_data(found), lines())


def _written(files: dict[str, Path]) -> list[Line]:
    return [(("Written to ", HEADING), (folder_of(files), ""))] if files else []


def serve(
    records: str | None = opt.READ_RECORDS,
    port: int = option(8765, "Port to listen on; 0 takes a free one.", "N", min=0, max=65535),
    bind: str = option(
        "127.0.0.1",
        "Address to listen on; 0.0.0.0 is every network. Without --accounts whoever reaches it reads the records.",
        "ADDRESS",
    ),
    name: list[str] | None = opt.HOST,
    tls: Path | None = opt.TLS,
    tls_key: Path | None = opt.TLS_KEY,
    accounts: Path | None = opt.ACCOUNTS,
    add_account: str | None = opt.ADD_ACCOUNT,
    open_: bool = flag(False, "--open", "Open the page in a browser."),
    quiet: bool = opt.QUIET,
) -> None:
    """Show the records in a browser: what is due or fails, trends, certificates, artefacts. Nothing can be changed there."""
    from cmm_uq.app.serve import accounts as own, server as http, site as pages

    if add_account is not None:
        put_account(accounts, add_account)
        return
    context = own.tls_of(tls, tls_key, accounts)
    site = pages.Site(records)
    with (
        http.RecordsServer(site.answer, bind, port, name or (), context) as server,
        keeping(lambda: "the page is closed"),
    ):
        if accounts is not None:
            site.guard = own.Accounts(accounts, server.server_port, say_now)
        if not quiet:
            say_now(f"{site.place} at {server.url} until Ctrl-C")
            if not server.alone and accounts is None:
                say_now("Whoever reaches this address can read the records: there are no passwords")
        threading.Thread(target=site.warm, daemon=True).start()
        _browse(server.url, open_)
        server.serve_forever()
