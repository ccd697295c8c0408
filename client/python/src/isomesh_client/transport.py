"""HTTP requests with the standard library, one connection each."""

from __future__ import annotations

import contextlib
import copy
import http.client
import math
import socket
import ssl
import time
from dataclasses import dataclass, field
from typing import Dict, Iterator, Optional
from urllib.parse import urlsplit

from . import busy
from .errors import Refused, Unreachable, refusal
from .uploads import Body

_TRIES = 4
_FIRST_PAUSE = 0.1
_PIECE = 1 << 18
_LONGEST_STALL = 60.0  # seconds without progress of a body, then the connection counts as broken
_LONGEST_TEXT = 64 << 20  # more than any error response has


class _UnixConnection(http.client.HTTPConnection):
    def __init__(self, path: str, timeout: Optional[float]) -> None:
        super().__init__("localhost", timeout=timeout)
        self._path = path

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self._path)


class Broken(Unreachable):
    """The connection broke: a retry may succeed."""


@dataclass
class Request:
    method: str
    target: str
    headers: Dict[str, str] = field(default_factory=dict)
    body: Optional[Body] = None
    patience: float = 0  # how many seconds longer than usual the server may be silent


class Answer:
    """A successful response. Its body is read once, whole or in pieces."""

    def __init__(self, connection: http.client.HTTPConnection, response: http.client.HTTPResponse) -> None:
        self._connection = connection
        self._response = response
        self.status = response.status

    def header(self, name: str) -> str:
        return self._response.getheader(name) or ""

    def pieces(self) -> Iterator[bytes]:
        """The body's bytes as they arrive. Raises Broken if the body ends too early."""
        with contextlib.closing(self._connection):
            try:
                while piece := self._response.read(_PIECE):
                    yield piece
            except (OSError, http.client.HTTPException) as error:
                raise Broken(f"the connection broke: {error}") from error
            # `read` with a size reports no error when the connection ends.
            if self._response.length:
                raise Broken("the connection broke: the response is incomplete")

    def text(self) -> bytes:
        return b"".join(self.pieces())


class Transport:
    """Constant after construction, so several threads may share it. Every request has its own
    connection, directly to the server. Proxies of the environment are not used and redirects are not
    followed, because volumes and tokens are for the named machine only."""

    def __init__(
        self, server: str, token: str, authorities: Optional[str], timeout: float, retry_seconds: float
    ) -> None:
        if not math.isfinite(retry_seconds) or retry_seconds < 0:
            raise ValueError(f"retry_seconds must be a number of seconds from 0 up, not {retry_seconds!r}")
        if not token.isascii() or any(c <= " " or c == "\x7f" for c in token):
            raise ValueError("the token must be printable ASCII characters without spaces")
        self._server = server
        self._token = token
        self._timeout = timeout
        self._retry_seconds = retry_seconds
        self._socket = server[len("unix:") :] if server.startswith("unix:") else ""
        parts = urlsplit("http://localhost" if self._socket else server)
        if (
            parts.scheme not in ("http", "https")
            or not parts.hostname
            or parts.username is not None
            or parts.path not in ("", "/")
            or parts.query
            or parts.fragment
        ):
            raise ValueError(f"{server!r} must be http://HOST:PORT, https://HOST:PORT or unix:PATH")
        self._host = parts.hostname
        self._port = parts.port  # raises ValueError for an invalid port
        self._tls = _tls_context(authorities) if parts.scheme == "https" else None

    def within(self, retry_seconds: float) -> Transport:
        """The same transport, which waits that long for a busy server."""
        other = copy.copy(self)
        other._retry_seconds = retry_seconds
        return other

    def send(self, request: Request) -> Answer:
        """A successful response. Raises Refused for any other, and Unreachable without a response. While
        the server is busy, the request is sent again: every request of the API can be repeated."""
        patience = busy.Patience(self._retry_seconds)
        while True:
            try:
                return self._send_once(request)
            except Refused as error:
                patience.wait(error)

    def _send_once(self, request: Request) -> Answer:
        connection = self._connection(request)
        try:
            connection.connect()
        except OSError as error:
            connection.close()
            raise Unreachable(f"{self._server} cannot be reached: {error}") from error
        try:
            response = self._exchange(connection, request)
            if 200 <= response.status < 300:
                return Answer(connection, response)
            body = response.read(_LONGEST_TEXT)
        except (OSError, http.client.HTTPException) as error:
            connection.close()
            raise Broken(f"{self._server}: the connection broke: {error}") from error
        except BaseException:
            connection.close()
            raise
        connection.close()
        header = response.headers.get
        retry_after = busy.retry_after(header("Retry-After", ""), header("Date", ""))
        raise refusal(response.status, header("Content-Type", ""), body, retry_after)

    def repeat(self, request: Request) -> bytes:
        """The response body of a request that may be repeated; it is, if its connection breaks."""
        for attempt in range(1, _TRIES + 1):
            try:
                return self.send(request).text()
            except Broken:
                if attempt == _TRIES:
                    raise
            pause(attempt)
        raise AssertionError("unreachable")

    def _connection(self, request: Request) -> http.client.HTTPConnection:
        timeout = self._timeout + request.patience
        if self._socket:
            return _UnixConnection(self._socket, timeout)
        if self._tls is not None:
            return http.client.HTTPSConnection(self._host, self._port, timeout=timeout, context=self._tls)
        return http.client.HTTPConnection(self._host, self._port, timeout=timeout)

    def _exchange(self, connection: http.client.HTTPConnection, request: Request) -> http.client.HTTPResponse:
        headers = dict(request.headers)
        if self._token:
            headers["Authorization"] = f"Bearer {self._token}"
        if request.body is not None:
            headers["Content-Length"] = str(request.body.size)
        pieces = None if request.body is None else request.body.pieces()
        if pieces is not None and connection.timeout is not None:
            connection.sock.settimeout(min(connection.timeout, _LONGEST_STALL))
        try:
            connection.request(request.method, request.target, pieces, headers)
        except (BrokenPipeError, ConnectionResetError):
            # A server may reject an upload before it has all of it, and close the connection.
            try:
                return connection.getresponse()
            except (OSError, http.client.HTTPException):
                pass
            raise
        connection.sock.settimeout(connection.timeout)
        return connection.getresponse()


def _tls_context(authorities: Optional[str]) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=authorities)
    except ssl.SSLError as error:
        raise ValueError(f"authorities: {authorities} is not a PEM file of certificates") from error
    except OSError as error:
        raise ValueError(f"authorities: {authorities} cannot be read: {error.strerror}") from error


def pause(attempt: int) -> None:
    """Waits before the `attempt`-th retry."""
    time.sleep(_FIRST_PAUSE * 2 ** (attempt - 1))
