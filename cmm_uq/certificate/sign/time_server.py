"""A time stamp server (RFC 3161), asked over HTTP: it stamps what it was asked to, or there is an error in one line."""

from __future__ import annotations

import http.client
import urllib.error
import urllib.request
from typing import Any

from asn1crypto import tsp
from pyhanko.sign.timestamps import TimeStamper, TimestampRequestError

from cmm_uq.base.errors import CmmUqError

TIMEOUT_S = 10.0
MOST_BYTES = 1_000_000

_FIX = "Try again, name another server, or sign at level B-B without one"


class Server(TimeStamper):  # type: ignore[misc]
    """Asks a server for time stamps."""

    def __init__(self, url: str) -> None:
        super().__init__()
        self.url = url

    async def async_request_tsa_response(self, req: tsp.TimeStampReq) -> tsp.TimeStampResp:
        """What the server answers.

        Raises
        ------
        CmmUqError : it does not answer, or with something else than a time stamp.
        """
        headers = {"Content-Type": "application/timestamp-query", "Accept": "application/timestamp-reply"}
        request = urllib.request.Request(self.url, req.dump(), headers)  # noqa: S310 - the scheme was looked at
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310 - the same
                sort, data = answer.headers.get_content_type(), answer.read(MOST_BYTES + 1)
        except urllib.error.HTTPError as error:
            raise CmmUqError(f"the time stamp server answers {error.code}", where=self.url, fix=_FIX) from None
        except (OSError, http.client.HTTPException) as error:
            why = getattr(error, "reason", error)
            raise CmmUqError(f"the time stamp server does not answer: {why}", where=self.url, fix=_FIX) from None
        if sort != "application/timestamp-reply" or len(data) > MOST_BYTES:
            raise CmmUqError("the server answers something else than a time stamp", where=self.url, fix=_FIX)
        return tsp.TimeStampResp.load(data)

    async def async_timestamp(self, message_digest: bytes, md_algorithm: str) -> Any:
        """A time stamp of a digest.

        Raises
        ------
        CmmUqError : the server refuses, or stamps something else.
        """
        try:
            token = await super().async_timestamp(message_digest, md_algorithm)
            stamped = (
                token["content"]["encap_content_info"]["content"].parsed["message_imprint"]["hashed_message"].native
            )
        except TimestampRequestError as error:
            raise CmmUqError(f"the time stamp server refuses: {error}", where=self.url, fix=_FIX) from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise CmmUqError("the server answers something else than a time stamp", where=self.url, fix=_FIX) from None
        if stamped != message_digest:
            raise CmmUqError("the server stamped something else than it was asked", where=self.url, fix=_FIX)
        return token
