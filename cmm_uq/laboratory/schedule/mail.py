"""Messages by e-mail: SMTP, with STARTTLS or TLS from the first byte, and a time limit over the whole of it."""

from __future__ import annotations

import smtplib
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from email.message import EmailMessage
from email.utils import formatdate
from pathlib import Path

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.laboratory.schedule.message import Message, UndeliveredError, within

LONGEST_SUBJECT = 150


@dataclass(frozen=True)
class Mail:
    """An SMTP server and whom it is to reach.

    Parameters
    ----------
    to, sender : addresses.
    server, port : where it listens.
    security : starttls, tls or none.
    login : user and password, asked for when they are needed; ``None`` where the server wants none.
    ca_file : certificates to trust beside none other; those of the system where it is ``None``.
    timeout_s : for one message, altogether.
    events : that are told.
    """

    to: tuple[str, ...]
    sender: str
    server: str
    port: int
    security: str
    login: Callable[[], tuple[str, str]] | None
    ca_file: Path | None
    timeout_s: float
    events: frozenset[str]

    @property
    def name(self) -> str:
        """See :attr:`~cmm_uq.laboratory.schedule.message.Channel.name`."""
        return f"email to {', '.join(self.to)}"

    def send(self, message: Message) -> str:
        """See :meth:`~cmm_uq.laboratory.schedule.message.Channel.send`."""
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

    def letter(self, message: Message) -> EmailMessage:
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
    """Certificates that a server is checked against: the system's, or those of one file.

    Raises
    ------
    CmmUqError : the file cannot be read, or holds none.
    """
    try:
        return ssl.create_default_context(cafile=None if ca_file is None else str(ca_file))
    except (OSError, ssl.SSLError) as error:
        raise CmmUqError(f"holds no certificates to trust: {error}", where=str(ca_file),
                         fix="Give a file in PEM") from None  # fmt: skip


def _text(answer: bytes | str) -> str:
    return printable(answer.decode("utf-8", "replace") if isinstance(answer, bytes) else answer)[:200]
