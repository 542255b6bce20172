"""Ways of sending messages, as ``schedule.toml`` names them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule import credentials
from cmm_uq.laboratory.schedule.mail import Mail
from cmm_uq.laboratory.schedule.message import Channel
from cmm_uq.laboratory.schedule.settings import PORTS, EmailTable, ScheduleFile, WebhookTable, web_address
from cmm_uq.laboratory.schedule.webhook import Webhook


def channels(schedule: ScheduleFile, folder: Path) -> list[Channel]:
    """Every way of sending that is named; secrets are asked for when a message is sent.

    Parameters
    ----------
    schedule : contents of schedule.toml.
    folder : that paths in it are relative to.
    """
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
            password = credentials.of_file(folder / table.password_file, "[[email]] password_file")
        else:
            password = credentials.of_variable(str(table.password_variable), "[[email]] password_variable")
        return credentials.of_variable(user, "[[email]] user_variable"), password

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
        url = credentials.of_variable(str(table.url_variable), key)
        try:
            return web_address(url)
        except ValueError:
            raise CmmUqError(f"the variable {table.url_variable} holds no web address", where=key,
                             fix="Put one into it, as https://example.org/cmm") from None  # fmt: skip

    return Webhook(
        address, None if secret is None else lambda: credentials.of_variable(secret, "[[webhook]] secret_variable"),
        None if table.ca_file is None else folder / table.ca_file, table.timeout_s, frozenset(table.on), name,
    )  # fmt: skip
