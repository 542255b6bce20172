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
