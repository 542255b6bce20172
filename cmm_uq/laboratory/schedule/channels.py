"""Ways of sending messages, as ``schedule.toml`` names them; their secrets stand in the environment or in a file."""

from __future__ import annotations

import hashlib
import hmac
import http.client
import json
import os
import smtplib
import ssl
import stat
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from email.message import EmailMessage
from email.utils import formatdate
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.files.content import content_of, text_of
from cmm_uq.base.files.limits import SECRET_BYTES
from cmm_uq.laboratory.schedule.notices import Channel, OutgoingMessage, UndeliveredError, within
from cmm_uq.laboratory.schedule.settings import PORTS, EmailTable, ScheduleFile, WebhookTable, web_address


def of_variable(name: str, key: str) -> str:
    """A secret in the environment."""
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


@dataclass(frozen=True)
class Mail:
    """An SMTP server and whom it is to reach; a login is asked for when it is needed."""

    to: tuple[str, ...]
    sender: str
    server: str  # and port: where it listens
    port: int
    security: str
    login: Callable[[], tuple[str, str]] | None
    ca_file: Path | None  # certificates to trust beside none other; those of the system where it is ``None``
    timeout_s: float
    events: frozenset[str]

    @property
    def name(self) -> str:
        return f"email to {', '.join(self.to)}"

    def send(self, message: OutgoingMessage) -> str:
        letter, login = self.letter(message), self.login() if self.login else None
        who = f"mail server {self.server}:{self.port}"
        try:
            return within(self.timeout_s, lambda: self._deliver(letter, login), who)
        except smtplib.SMTPAuthenticationError as error:
            raise UndeliveredError(f"{who} refused the login: {error.smtp_code}") from None
        except smtplib.SMTPResponseException as error:
            raise UndeliveredError(f"{who} answered {error.smtp_code} {_text(error.smtp_error)}") from None
        except smtplib.SMTPRecipientsRefused as error:
            raise UndeliveredError(f"{who} refused {', '.join(error.recipients)}") from None
        except (smtplib.SMTPException, OSError) as error:
            raise UndeliveredError(f"{who}: {printable(str(error)) or type(error).__name__}") from None

    def letter(self, message: OutgoingMessage) -> EmailMessage:
        """As it is sent; its Message-ID is the message's key, so that a repetition is known for one."""
        letter = EmailMessage()
        letter["From"], letter["To"] = self.sender, ", ".join(self.to)
        letter["Subject"] = printable(f"[cmm-uq] {message.title}")[:LONGEST_SUBJECT]
        letter["Date"] = formatdate()
        letter["Message-ID"] = f"<{message.key}@cmm-uq.invalid>"
        letter["Auto-Submitted"] = "auto-generated"
        letter["X-CMM-UQ-Event"] = message.event
        where = f"\nWhere to look: {message.where}\n" if message.where else ""
        letter.set_content(f"{message.text}\n{where}\nFound at {message.at} by cmm-uq {__version__}.\n")
        return letter

    def _deliver(self, letter: EmailMessage, login: tuple[str, str] | None) -> str:
        with self._connected() as smtp:
            if login is not None:
                smtp.login(*login)
            refused = smtp.send_message(letter)
        return f"the mail server refused {', '.join(refused)}" if refused else ""

    def _connected(self) -> smtplib.SMTP:
        context = None if self.security == "none" else self._trusted()
        if self.security == "tls":
            return smtplib.SMTP_SSL(self.server, self.port, timeout=self.timeout_s, context=context)
        smtp = smtplib.SMTP(self.server, self.port, timeout=self.timeout_s)
        if self.security == "starttls":
            try:
                smtp.starttls(context=context)
            except BaseException:
                smtp.close()
                raise
        return smtp

    def _trusted(self) -> ssl.SSLContext:
        return trusted(self.ca_file)


def trusted(ca_file: Path | None) -> ssl.SSLContext:
    """Certificates that a server is checked against: the system's, or those of one file."""
    try:
        return ssl.create_default_context(cafile=None if ca_file is None else str(ca_file))
    except (OSError, ssl.SSLError) as error:
        fix = "Give a file in PEM"
        raise CmmUqError(f"holds no certificates to trust: {error}", where=str(ca_file), fix=fix) from None


def _text(answer: bytes | str) -> str:
    return printable(answer.decode("utf-8", "replace") if isinstance(answer, bytes) else answer)[:200]


SCHEMA = "cmm-uq/message/1"
SIGNATURE, TIMESTAMP, REPETITION = "X-CMM-UQ-Signature", "X-CMM-UQ-Timestamp", "Idempotency-Key"


@dataclass(frozen=True)
class Webhook:
    """An address that takes messages."""

    address: Callable[[], str]  # gives the URL, which may be a secret itself
    secret: Callable[[], str] | None  # gives the key of the signature; ``None`` where there is none
    ca_file: Path | None  # certificates to trust; those of the system where it is ``None``
    timeout_s: float
    events: frozenset[str]
    name: str  # what tells it from others
    clock: Callable[[], float] = time.time  # seconds since 1970

    def send(self, message: OutgoingMessage) -> str:
        body = json.dumps({"schema": SCHEMA, **message.as_data()}, ensure_ascii=False).encode()
        address, stamp = self.address(), str(int(self.clock()))
        headers = {
            "Content-Type": "application/json", "User-Agent": f"cmm-uq/{__version__}", REPETITION: message.key,
            TIMESTAMP: stamp,
        }  # fmt: skip
        if self.secret is not None:
            headers[SIGNATURE] = signature(self.secret(), stamp, body)
        who = f"web address at {urlsplit(address).hostname}"
        request = urllib.request.Request(address, body, headers, method="POST")  # noqa: S310 - checked to be http(s)
        try:
            return within(self.timeout_s, lambda: self._post(request), who)
        except urllib.error.HTTPError as error:
            with error:
                raise UndeliveredError(f"{who} answered {error.code} {printable(str(error.reason))[:200]}") from None
        except (OSError, http.client.HTTPException, ValueError) as error:
            why = getattr(error, "reason", error)
            raise UndeliveredError(f"{who}: {printable(str(why))[:200] or type(error).__name__}") from None

    def _post(self, request: urllib.request.Request) -> str:
        opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=trusted(self.ca_file)), _StayHere())
        with opener.open(request, timeout=self.timeout_s):
            return ""


class _StayHere(urllib.request.HTTPRedirectHandler):
    """A redirection is an answer, not a place to send to."""

    def redirect_request(self, *_: Any) -> None:
        """None is followed."""
        return


def signature(secret: str, stamp: str, body: bytes) -> str:
    """HMAC-SHA-256 over the time stamp (seconds since 1970), a full stop and the body, as the header has it."""
    return "sha256=" + hmac.new(secret.encode(), f"{stamp}.".encode() + body, hashlib.sha256).hexdigest()


def channels(schedule: ScheduleFile, folder: Path) -> list[Channel]:
    """Every way of sending that is named; secrets are asked for when a message is sent."""
    by_mail = [_mail(table, folder) for table in schedule.email]
    return [*by_mail, *(_webhook(table, folder) for table in schedule.webhook)]


def _mail(table: EmailTable, folder: Path) -> Mail:
    port = PORTS[table.security] if table.port is None else table.port
    return Mail(
        tuple(table.to), table.sender, table.server, port, table.security, _login(table, folder),
        None if table.ca_file is None else folder / table.ca_file, table.timeout_s, frozenset(table.on),
    )  # fmt: skip


def _login(table: EmailTable, folder: Path) -> Callable[[], tuple[str, str]] | None:
    user = table.user_variable
    if user is None:
        return None

    def login() -> tuple[str, str]:
        if table.password_file is not None:
            password = of_file(folder / table.password_file, "[[email]] password_file")
        else:
            password = of_variable(str(table.password_variable), "[[email]] password_variable")
        return of_variable(user, "[[email]] user_variable"), password

    return login


def _webhook(table: WebhookTable, folder: Path) -> Webhook:
    secret = table.secret_variable
    if table.url is not None:
        digest = hashlib.sha256(table.url.encode()).hexdigest()[:8]  # the path of an address may be a secret
        name = f"webhook at {urlsplit(table.url).hostname} ({digest})"
    else:
        name = f"webhook of {table.url_variable}"

    def address() -> str:
        if table.url is not None:
            return table.url
        key = "[[webhook]] url_variable"
        url = of_variable(str(table.url_variable), key)
        try:
            return web_address(url)
        except ValueError:
            fix = "Put one into it, as https://example.org/cmm"
            raise CmmUqError(f"the variable {table.url_variable} holds no web address", where=key, fix=fix) from None

    return Webhook(
        address, None if secret is None else lambda: of_variable(secret, "[[webhook]] secret_variable"),
        None if table.ca_file is None else folder / table.ca_file, table.timeout_s, frozenset(table.on), name,
    )  # fmt: skip
