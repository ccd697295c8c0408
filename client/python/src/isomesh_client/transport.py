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
from typing import Callable, Dict, Iterator, Optional
from urllib.parse import urlsplit

from . import busy
from .errors import Refused, Unreachable, WrongAnswer, refusal
from .stopping import Stop
from .uploads import Body

_TRIES = 4
_FIRST_PAUSE = 0.1
_PIECE = 1 << 18
_LONGEST_STALL = 60.0  # seconds without progress of a body, then the connection counts as broken
_LONGEST_TEXT = 64 << 20  # more than any response has that is no mesh


class _Connection(http.client.HTTPConnection):
    """A connection that `stop` of another thread ends, also while it is made."""

    def __init__(self, host: str, port: Optional[int], timeout: float, stop: Stop) -> None:
        super().__init__(host, port, timeout=timeout)
        self._stop = stop
        self._held: Optional[socket.socket] = None
        stop.watch(self)

    def stop(self) -> None:
        if self._held is not None:
            with contextlib.suppress(OSError):
                # That of ssl.SSLSocket would take the encryption away from the thread that reads.
                socket.socket.shutdown(self._held, socket.SHUT_RDWR)

    def connect(self) -> None:
        failure = OSError("the host has no address")
        for family, kind, protocol, _, address in socket.getaddrinfo(self.host, self.port, type=socket.SOCK_STREAM):
            try:
                self._open(socket.socket(family, kind, protocol), address)
                self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return
            except OSError as error:
                self.close()
                failure = error
        raise failure

    def _open(self, opened: socket.socket, address: object) -> None:
        self._hold(opened)
        opened.settimeout(self.timeout)
        opened.connect(address)  # type: ignore[arg-type]
        self._stop.check()  # `stop` ends no socket that was not connected yet

    def _hold(self, opened: socket.socket) -> None:
        # http.client forgets the socket as soon as a response begins after which the server closes it.
        self.sock = self._held = opened
        self._stop.check()


class _UnixConnection(_Connection):
    def __init__(self, path: str, timeout: float, stop: Stop) -> None:
        super().__init__("localhost", None, timeout, stop)
        self._path = path

    def connect(self) -> None:
        self._open(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), self._path)


class _TlsConnection(_Connection):
    default_port = http.client.HTTPS_PORT

    def __init__(self, host: str, port: Optional[int], timeout: float, stop: Stop, tls: ssl.SSLContext) -> None:
        super().__init__(host, port, timeout, stop)
        self._tls = tls

    def connect(self) -> None:
        super().connect()
        encrypted = self._tls.wrap_socket(self.sock, server_hostname=self.host, do_handshake_on_connect=False)
        self._hold(encrypted)
        encrypted.do_handshake()


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
    """A successful response. Its body is read whole, or once in pieces."""

    def __init__(self, connection: _Connection, response: http.client.HTTPResponse, stop: Stop) -> None:
        self._connection = connection
        self._response = response
        self._stop = stop
        self._text: Optional[bytes] = None
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
                self._stop.check()
                raise Broken(f"the connection broke: {error}") from error
            # `read` with a size reports no error when the connection ends.
            self._stop.check()
            if self._response.length:
                raise Broken("the connection broke: the response is incomplete")

    def text(self) -> bytes:
        """The whole body. Raises WrongAnswer for one that is longer than any of the API."""
        if self._text is None:
            text = bytearray()
            for piece in self.pieces():
                text += piece
                if len(text) > _LONGEST_TEXT:
                    raise WrongAnswer("the server's response is too long")
            self._text = bytes(text)
        return self._text


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
        self._end = math.inf  # then nothing that broke is repeated
        self._stop = Stop()
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
        # Without a port, http.client would take the last group of an IPv6 address for it.
        usual = http.client.HTTPS_PORT if parts.scheme == "https" else http.client.HTTP_PORT
        self._port = usual if parts.port is None else parts.port  # raises ValueError for an invalid port
        self._tls = _tls_context(authorities) if parts.scheme == "https" else None

    def within(self, seconds: float, patience: float = 0) -> Transport:
        """The same transport, which waits that long for a busy server, and little longer for a silent one. `patience` is that
        of its requests, which is part of the time."""
        other = copy.copy(self)
        other._retry_seconds = seconds
        other._timeout = min(self._timeout, max(seconds - patience, busy.PARTING_SILENCE))
        other._end = time.monotonic() + seconds
        return other

    def until(self, stop: Stop) -> Transport:
        """The same transport, whose requests and pauses raise Stopped as soon as `stop` is set."""
        other = copy.copy(self)
        other._stop = stop
        return other

    def parting(self) -> Transport:
        """The same transport for the last requests of a caller that wants to end, also one that was stopped."""
        return self.until(Stop()).within(busy.PARTING_SECONDS)

    def pause(self, seconds: float) -> None:
        self._stop.pause(seconds)

    def rest(self, attempt: int) -> None:
        """Waits before the `attempt`-th retry."""
        self.pause(_FIRST_PAUSE * 2 ** (attempt - 1))

    def send(self, request: Request, excuse: Callable[[float], None] = lambda seconds: None) -> Answer:
        """A successful response. Raises Refused for any other, and Unreachable without a response. While
        the server is busy, the request is sent again: every request of the API can be repeated. `excuse` gets
        the seconds of each of these pauses before it begins."""
        patience = busy.Patience(self._retry_seconds, self.pause)
        while True:
            try:
                return self._send_once(request)
            except Refused as error:
                patience.wait(error, excuse)

    def send_whole(self, request: Request, excuse: Callable[[float], None] = lambda seconds: None) -> Answer:
        """The same after the body has been read, so that no connection breaks later."""
        answer = self.send(request, excuse)
        answer.text()
        return answer

    def _send_once(self, request: Request) -> Answer:
        connection = self._connection(request)
        is_connected = False
        try:
            connection.connect()
            is_connected = True
            response = self._exchange(connection, request)
            if 200 <= response.status < 300:
                return Answer(connection, response, self._stop)
            body = response.read(_LONGEST_TEXT)
        except (OSError, http.client.HTTPException) as error:
            connection.close()
            self._stop.check()
            if not is_connected:
                raise Unreachable(f"{self._server} cannot be reached: {error}") from error
            raise Broken(f"{self._server}: the connection broke: {error}") from error
        except BaseException:
            connection.close()
            raise
        connection.close()
        self._stop.check()
        header = response.headers.get
        retry_after = busy.retry_after(header("Retry-After", ""), header("Date", ""))
        raise refusal(response.status, header("Content-Type", ""), body, retry_after)

    def repeat(self, request: Request) -> bytes:
        """The response body of a request that may be repeated; it is, if its connection breaks."""
        return self.repeated(request).text()

    def repeated(self, request: Request) -> Answer:
        """The same with the response, whose body has been read."""
        for attempt in range(1, _TRIES + 1):
            try:
                return self.send_whole(request)
            except Broken:
                if attempt == _TRIES or time.monotonic() >= self._end:
                    raise
            self.rest(attempt)
        raise AssertionError("unreachable")

    def _connection(self, request: Request) -> _Connection:
        timeout = self._timeout + request.patience
        if self._socket:
            return _UnixConnection(self._socket, timeout, self._stop)
        if self._tls is not None:
            return _TlsConnection(self._host, self._port, timeout, self._stop, self._tls)
        return _Connection(self._host, self._port, timeout, self._stop)

    def _exchange(self, connection: _Connection, request: Request) -> http.client.HTTPResponse:
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
