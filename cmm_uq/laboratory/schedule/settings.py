"""``schedule.toml``: what a scheduled run goes by, and whom it tells of what. No secret stands in it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, model_validator

from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import JOB_BYTES
from cmm_uq.base.files.table import JobTable
from cmm_uq.base.files.toml_file import checked
from cmm_uq.laboratory.schedule.notices import EVENTS, Event

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
