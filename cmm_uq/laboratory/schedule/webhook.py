"""Messages to a web address: JSON by POST, signed, so that the receiver knows from whom it is and that nobody changed it."""

from __future__ import annotations

import hashlib
import hmac
import http.client
import json
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from cmm_uq import __version__
from cmm_uq.base.errors import printable
from cmm_uq.laboratory.schedule.mail import trusted
from cmm_uq.laboratory.schedule.message import Message, UndeliveredError, within

SCHEMA = "cmm-uq/message/1"
SIGNATURE, TIMESTAMP, REPETITION = "X-CMM-UQ-Signature", "X-CMM-UQ-Timestamp", "Idempotency-Key"


@dataclass(frozen=True)
class Webhook:
    """An address that takes messages.

    Parameters
    ----------
    address : gives the URL, which may be a secret itself.
    secret : gives the key of the signature; ``None`` where there is none.
    ca_file : certificates to trust; those of the system where it is ``None``.
    timeout_s : for one message, altogether.
    events : that are told.
    name : what tells it from others.
    clock : seconds since 1970.
    """

    address: Callable[[], str]
    secret: Callable[[], str] | None
    ca_file: Path | None
    timeout_s: float
    events: frozenset[str]
    name: str
    clock: Callable[[], float] = time.time

    def send(self, message: Message) -> str:
        """See :meth:`~cmm_uq.laboratory.schedule.message.Channel.send`; no redirection is followed."""
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
        opener = urllib.request.build_opener(
            urllib.request.HTTPSHandler(context=trusted(self.ca_file)), _StayHere()
        )  # fmt: skip
        with opener.open(request, timeout=self.timeout_s):
            return ""


class _StayHere(urllib.request.HTTPRedirectHandler):
    """A redirection is an answer, not a place to send to."""

    def redirect_request(self, *_: Any) -> None:
        """None is followed."""
        return


def signature(secret: str, stamp: str, body: bytes) -> str:
    """HMAC-SHA-256 over the time stamp, a full stop and the body, as the header has it.

    Parameters
    ----------
    secret : that both sides have.
    stamp : seconds since 1970, as its header has it.
    body : bytes of the JSON.
    """
    return "sha256=" + hmac.new(secret.encode(), f"{stamp}.".encode() + body, hashlib.sha256).hexdigest()
