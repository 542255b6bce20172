"""``schedule.toml``: what a scheduled run goes by, and the ways of sending messages; no secret stands in it."""

from __future__ import annotations

import hashlib
import hmac
import http.client
import json
import os
import re
import smtplib
import ssl
import stat
import time
import urllib.error
import urllib.request
from email.message import EmailMessage
from email.utils import formatdate
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, model_validator

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.files.limits import JOB_BYTES, SECRET_BYTES, content_of, text_of
from cmm_uq.base.files.table import JobTable
from cmm_uq.base.files.toml_file import checked
from cmm_uq.laboratory.schedule.notices import EVENTS, Channel, Event, OutgoingMessage, UndeliveredError, within

FILE = "schedule.toml"
_ADDRESS = re.compile(r"[^\s@<>,;:\"()\[\]\\]+@[^\s@<>,;:\"()\[\]\\]+")
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
PORTS = {"starttls": 587, "tls": 465, "none": 25}  # usual ports of a mail server


def _address(text: str) -> str:
    if not _ADDRESS.fullmatch(text):
        raise ValueError("is no e-mail address, as quality@example.org")
    return text


def _variable(text: str) -> str:
    if not _VARIABLE.fullmatch(text):
        raise ValueError("is no name of a variable; the secret itself stands in the environment, not here")
    return text


def web_address(text: str) -> str:
    """An address of the web without a secret in it."""
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ValueError("is no web address, as https://example.org/cmm")
    if parts.username is not None or parts.password is not None:
        raise ValueError("has a user or a password in it; give url_variable, with the whole address in the environment")
    return text


Address = Annotated[str, Field(max_length=254), AfterValidator(_address)]
Variable = Annotated[str, Field(max_length=100), AfterValidator(_variable)]
Events = Annotated[list[Event], Field(min_length=1, max_length=len(EVENTS))]
Day = Literal["MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN"]
Seconds = Annotated[float, Field(gt=0, le=600)]


class RunTable(JobTable):
    """``[run]``: where things go, and when a job folder is taken. Paths are relative to schedule.toml."""

    out: Annotated[str, Field(min_length=1)] = "reports"
    """Folder of the reports, with a folder for each job in it."""
    records: str = ""
    """Records of the laboratory: a file, a URL, or `none`; `records.db` in the folder of the reports where it is left out."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of everything random."""
    quiet_s: Annotated[float, Field(ge=0, le=3600)] = 60.0
    """Time for which nothing in a job folder may have changed: a folder that is still being copied is left alone."""
    tries: Annotated[int, Field(ge=1, le=10)] = 3
    """Attempts at what may pass: locked records, a full disk, a mail server that does not answer."""
    back_off_s: Annotated[float, Field(ge=0, le=600)] = 10.0
    """Wait before the second attempt; twice as long before each further one."""
    may_be_empty: bool = False
    """Whether a folder without a single job is all well; otherwise it is bad input, as a drive that is not there would be."""
    due_within_days: Annotated[int, Field(ge=0, le=3650)] = 30
    """How long before a due date a message goes out."""
    at: Annotated[str, Field(pattern=r"^(([01]\d|2[0-3]):[0-5]\d)?$")] = ""
    """Time of day at which runs are started, as `06:15`, by the clock on the wall: a missed one is named by the next run."""
    days: Annotated[list[Day], Field(max_length=7)] = Field(default=[])
    """Days of the week on which they are, as `MON`; every day where it is left out."""


class LogTable(JobTable):
    """``[log]``: what was done, a line each, for a person."""

    file: str = "schedule.log"
    """The file, in the folder of the reports; an empty text for none."""
    largest_bytes: Annotated[int, Field(ge=1000, le=1_000_000_000)] = 1_000_000
    """Size at which a new one is begun."""
    kept: Annotated[int, Field(ge=1, le=100)] = 5
    """Former ones that are kept, as schedule.log.1 and so on."""


class EmailTable(JobTable):
    """``[[email]]``: messages by e-mail."""

    to: Annotated[list[Address], Field(min_length=1, max_length=100)]
    """Addresses of those who are told."""
    sender: Address
    """Address that it comes from."""
    server: Annotated[str, Field(min_length=1, max_length=253, pattern=r"^[A-Za-z0-9.:_-]+$")]
    """Name of the mail server."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Its port; 587 with starttls, 465 with tls, 25 with none where it is left out."""
    security: Literal["starttls", "tls", "none"] = "starttls"
    """How the connection is made safe; `none` only within the house, and never with a password."""
    user_variable: Variable | None = None
    """Variable of the environment with the user's name, where the server wants a login."""
    password_variable: Variable | None = None
    """Variable of the environment with the password."""
    password_file: Annotated[str, Field(min_length=1)] | None = None
    """File with the password in place of a variable; nobody but its owner may read it."""
    ca_file: Annotated[str, Field(min_length=1)] | None = None
    """Certificates in PEM that the server's is checked against; those of the system where it is left out."""
    timeout_s: Seconds = 20.0
    """Time for one message, altogether."""
    on: Events = Field(default=list(EVENTS))
    """What is told."""

    @model_validator(mode="after")
    def _login(self) -> Self:
        secrets = (self.password_variable is not None) + (self.password_file is not None)
        if secrets > 1:
            raise ValueError("password_variable and password_file are two ways to say the same: give one")
        if bool(secrets) != (self.user_variable is not None):
            raise ValueError("a login needs user_variable, and password_variable or password_file")
        if secrets and self.security == "none":
            raise ValueError('a password is not sent over an open line: security is "starttls" or "tls"')
        return self


class WebhookTable(JobTable):
    """``[[webhook]]``: messages as JSON by POST to a web address."""

    url: Annotated[str, Field(max_length=400), AfterValidator(web_address)] | None = None
    """The address."""
    url_variable: Variable | None = None
    """Variable of the environment with the address, where it is a secret itself."""
    secret_variable: Variable | None = None
    """Variable of the environment with the key that messages are signed with (HMAC-SHA-256); unsigned where left out."""
    ca_file: Annotated[str, Field(min_length=1)] | None = None
    """Certificates in PEM that the server's is checked against; those of the system where it is left out."""
    timeout_s: Seconds = 20.0
    """Time for one message, altogether."""
    on: Events = Field(default=list(EVENTS))
    """What is told."""

    @model_validator(mode="after")
    def _one_address(self) -> Self:
        if (self.url is None) == (self.url_variable is None):
            raise ValueError("needs one of url and url_variable")
        return self


class ScheduleFile(JobTable):
    """The whole of ``schedule.toml``; every table may be left out."""

    run: RunTable = RunTable()
    """Where things go, and when a job folder is taken."""
    log: LogTable = LogTable()
    """What was done, a line each, for a person."""
    email: Annotated[list[EmailTable], Field(max_length=20)] = Field(default=[])
    """Messages by e-mail."""
    webhook: Annotated[list[WebhookTable], Field(max_length=20)] = Field(default=[])
    """Messages as JSON by POST to a web address."""


def read_schedule(path: Path) -> ScheduleFile:
    """The contents of a ``schedule.toml``."""
    content = content_of(path, JOB_BYTES, "cmm-uq schedule new FILE writes one with every key explained")
    return checked(content, path, ScheduleFile)


def of_variable(name: str, key: str) -> str:
    secret = os.environ.get(name, "")
    if not secret:
        fix = "Set it where the run is started, as in EnvironmentFile= of systemd"
        raise CmmUqError(f"the variable {name} is not set", where=key, fix=fix)
    return secret


def of_file(path: Path, key: str) -> str:
    """A secret in a file, without the end of its line."""
    content = content_of(path, SECRET_BYTES, f"Write the secret into it, or mend {key}")
    if os.name != "nt" and path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise CmmUqError("others may read it", where=str(path), fix=f"chmod 600 {path}")
    secret = text_of(content, str(path)).strip("\r\n")
    if not secret:
        raise CmmUqError("is empty", where=str(path), fix="Write the secret into it")
    return secret


LONGEST_SUBJECT = 150


class Mail:
    """An SMTP server and whom it is to reach; a login is asked for when it is needed."""

    def __init__(self, table: EmailTable, folder: Path) -> None:
        self._table, self._folder = table, folder
        self.events: frozenset[str] = frozenset(table.on)
        self.name = f"email to {', '.join(table.to)}"
        self.port = PORTS[table.security] if table.port is None else table.port

    def send(self, message: OutgoingMessage) -> str:
        letter, login = self._letter(message), self._login()
        who = f"mail server {self._table.server}:{self.port}"
        try:
            return within(self._table.timeout_s, lambda: self._deliver(letter, login), who)
        except smtplib.SMTPAuthenticationError as error:
            raise UndeliveredError(f"{who} refused the login: {error.smtp_code}") from None
        except smtplib.SMTPResponseException as error:
            said = error.smtp_error
            text = printable(said.decode("utf-8", "replace") if isinstance(said, bytes) else said)[:200]
            raise UndeliveredError(f"{who} answered {error.smtp_code} {text}") from None
        except smtplib.SMTPRecipientsRefused as error:
            raise UndeliveredError(f"{who} refused {', '.join(error.recipients)}") from None
        except (smtplib.SMTPException, OSError) as error:
            raise UndeliveredError(f"{who}: {printable(str(error)) or type(error).__name__}") from None

    def _login(self) -> tuple[str, str] | None:
        """User and password; ``None`` where the server wants none."""
        table = self._table
        if table.user_variable is None:
            return None
        if table.password_file is not None:
            password = of_file(self._folder / table.password_file, "[[email]] password_file")
        else:
            password = of_variable(str(table.password_variable), "[[email]] password_variable")
        return of_variable(table.user_variable, "[[email]] user_variable"), password

    def _letter(self, message: OutgoingMessage) -> EmailMessage:
        """As it is sent; its Message-ID is the message's key, so that a repetition is known for one."""
        letter = EmailMessage()
        letter["From"], letter["To"] = self._table.sender, ", ".join(self._table.to)
        letter["Subject"] = printable(f"[cmm-uq] {message.title}")[:LONGEST_SUBJECT]
        letter["Date"] = formatdate()
        letter["Message-ID"] = f"<{message.key}@cmm-uq.invalid>"
        letter["Auto-Submitted"] = "auto-generated"
        letter["X-CMM-UQ-Event"] = message.event
        where = f"\nWhere to look: {message.where}\n" if message.where else ""
        letter.set_content(f"{message.text}\n{where}\nFound at {message.at} by cmm-uq {__version__}.\n")
        return letter

    def _deliver(self, letter: EmailMessage, login: tuple[str, str] | None) -> str:
        server, port, timeout_s, security = self._table.server, self.port, self._table.timeout_s, self._table.security
        context = None if security == "none" else trusted(self._table.ca_file, self._folder)
        smtp = (
            smtplib.SMTP_SSL(server, port, timeout=timeout_s, context=context)
            if security == "tls"
            else smtplib.SMTP(server, port, timeout=timeout_s)
        )
        if security == "starttls":
            try:
                smtp.starttls(context=context)
            except BaseException:
                smtp.close()
                raise
        with smtp:
            if login is not None:
                smtp.login(*login)
            refused = smtp.send_message(letter)
        return f"the mail server refused {', '.join(refused)}" if refused else ""


def trusted(ca_file: str | None, folder: Path) -> ssl.SSLContext:
    """Certificates that a server is checked against: the system's, or those of one file."""
    path = None if ca_file is None else str(folder / ca_file)
    try:
        return ssl.create_default_context(cafile=path)
    except (OSError, ssl.SSLError) as error:
        raise CmmUqError(f"holds no certificates to trust: {error}", where=path, fix="Give a file in PEM") from None


SCHEMA = "cmm-uq/message/1"
SIGNATURE, TIMESTAMP, REPETITION = "X-CMM-UQ-Signature", "X-CMM-UQ-Timestamp", "Idempotency-Key"


class Webhook:
    """An address that takes messages; it may be a secret itself, and a signature's key is one."""

    def __init__(self, table: WebhookTable, folder: Path) -> None:
        self._table, self._folder = table, folder
        self.events: frozenset[str] = frozenset(table.on)
        self.name = f"webhook of {table.url_variable}"
        if table.url is not None:
            digest = hashlib.sha256(table.url.encode()).hexdigest()[:8]  # the path of an address may be a secret
            self.name = f"webhook at {urlsplit(table.url).hostname} ({digest})"

    def send(self, message: OutgoingMessage) -> str:
        table, stamp = self._table, str(int(time.time()))
        body = json.dumps({"schema": SCHEMA, **message.as_data()}, ensure_ascii=False).encode()
        address = table.url or self._secret_address()
        headers = {
            "Content-Type": "application/json", "User-Agent": f"cmm-uq/{__version__}", REPETITION: message.key,
            TIMESTAMP: stamp,
        }  # fmt: skip
        if table.secret_variable is not None:
            secret = of_variable(table.secret_variable, "[[webhook]] secret_variable")
            headers[SIGNATURE] = signature(secret, stamp, body)
        who = f"web address at {urlsplit(address).hostname}"
        request = urllib.request.Request(address, body, headers, method="POST")  # noqa: S310 - checked to be http(s)
        try:
            return within(table.timeout_s, lambda: self._post(request), who)
        except urllib.error.HTTPError as error:
            with error:
                raise UndeliveredError(f"{who} answered {error.code} {printable(str(error.reason))[:200]}") from None
        except (OSError, http.client.HTTPException, ValueError) as error:
            why = getattr(error, "reason", error)
            raise UndeliveredError(f"{who}: {printable(str(why))[:200] or type(error).__name__}") from None

    def _secret_address(self) -> str:
        key = "[[webhook]] url_variable"
        url = of_variable(str(self._table.url_variable), key)
        try:
            return web_address(url)
        except ValueError:
            problem = f"the variable {self._table.url_variable} holds no web address"
            raise CmmUqError(problem, where=key, fix="Put one into it, as https://example.org/cmm") from None

    def _post(self, request: urllib.request.Request) -> str:
        https = urllib.request.HTTPSHandler(context=trusted(self._table.ca_file, self._folder))
        with urllib.request.build_opener(https, _StayHere()).open(request, timeout=self._table.timeout_s):
            return ""


class _StayHere(urllib.request.HTTPRedirectHandler):
    """A redirection is an answer, not a place to send to."""

    def redirect_request(self, *_: Any) -> None: ...


def signature(secret: str, stamp: str, body: bytes) -> str:
    """HMAC-SHA-256 over the time stamp (seconds since 1970), a full stop and the body, as the header has it."""
    return "sha256=" + hmac.new(secret.encode(), f"{stamp}.".encode() + body, hashlib.sha256).hexdigest()


def channels(schedule: ScheduleFile, folder: Path) -> list[Channel]:
    """Every way of sending that is named; secrets are asked for when a message is sent."""
    by_mail = [Mail(table, folder) for table in schedule.email]
    return [*by_mail, *(Webhook(table, folder) for table in schedule.webhook)]
