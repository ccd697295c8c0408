"""A real daemon for each test class, and a server that breaks."""

import contextlib
import http.server
import json
import os
import shutil
import socket
import subprocess
import tempfile
import threading
from pathlib import Path

import isomesh_client
import numpy
from limits import LimitedTest, limited

ROOT = Path(__file__).resolve().parents[2]
DAEMON = Path(os.environ.get("ISOMESHD", ROOT / "build" / "release" / "bin" / "isomeshd"))


class DaemonTest(LimitedTest):
    """Every class has a daemon of its own; `options` are added to its command line."""

    options = ()
    listen = "127.0.0.1:0"

    @classmethod
    def setUpClass(cls):
        with limited(cls.limit_s, f"setUpClass of {cls.__qualname__}"):
            cls.start()

    @classmethod
    def start(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="isomesh-python-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ISOMESH")}
        listen = cls.listen.replace("FOLDER", str(cls.folder))
        command = [DAEMON, "--listen", listen, "--data", cls.folder / "data", "--log-level", "error"]
        options = [option.replace("FOLDER", str(cls.folder)) for option in cls.options]
        cls.prepare(cls.folder)
        cls.daemon = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True, env=environment)
        cls.addClassCleanup(cls.end)
        line = cls.daemon.stdout.readline()
        if not line.startswith("listening on "):
            raise RuntimeError(f"{DAEMON} did not start")
        cls.url = line.split()[-1]
        cls.client = isomesh_client.Client(cls.url)

    @classmethod
    def prepare(cls, folder):
        """Before the daemon starts."""

    @classmethod
    def end(cls):
        cls.daemon.terminate()
        cls.daemon.stdout.close()
        try:
            cls.daemon.wait(60)
        except subprocess.TimeoutExpired:
            cls.daemon.kill()
            cls.daemon.wait(10)
            raise


def thin_shell():
    """A mask of a hollow ball whose wall is so thin that `scheme` 6 opens its cavity."""
    at = numpy.indices((32, 32, 32)) - numpy.reshape([15.6, 15.3, 15.8], (3, 1, 1, 1))
    return (numpy.abs(numpy.linalg.norm(at, axis=0) - 12) <= 0.75).astype("uint8")


class Relay:
    """Passes connections on to a server. The first `cuts` responses that are longer than `after`
    bytes are cut there."""

    def __init__(self, url, cuts, after):
        self.target = url.removeprefix("http://").rsplit(":", 1)
        self.cuts, self.after = cuts, after
        self.requests = []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        self.thread.join(60)

    def serve(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            with client, socket.create_connection((self.target[0], int(self.target[1]))) as server:
                try:
                    self.pass_on(client, server)
                except OSError:
                    pass  # one side ended the connection, and the other side sees its end

    def pass_on(self, client, server):
        """For requests without a long body."""
        request = b""
        while b"\r\n\r\n" not in request:
            request += client.recv(65536)
        self.requests.append(request)
        server.sendall(request)
        passed = 0
        while piece := server.recv(65536):
            if self.cuts > 0 and passed + len(piece) > self.after:
                client.sendall(piece[: max(0, self.after - passed)])
                self.cuts -= 1
                return
            client.sendall(piece)
            passed += len(piece)


class UploadRelay(Relay):
    """The same for requests, which are recorded without their headers."""

    def pass_on(self, client, server):
        answer = threading.Thread(target=self.answer, args=(client, server))
        answer.start()
        self.send(client, server)
        answer.join(60)

    @staticmethod
    def answer(client, server):
        try:
            while piece := server.recv(65536):
                client.sendall(piece)
            client.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # it was cut

    def send(self, client, server):
        passed = 0
        try:
            while piece := client.recv(65536):
                if passed == 0:
                    self.requests.append(piece.split(b" HTTP", 1)[0].decode())
                passed += len(piece)
                server.sendall(piece)
                if self.cuts > 0 and passed > self.after:
                    self.cuts -= 1
                    break
            else:
                return
        except OSError:
            return
        for side in (client, server):
            side.shutdown(socket.SHUT_RDWR)


class FakeServer:
    """A server that answers each request with the status, headers and body that `respond(handler, body)` returns."""

    def __init__(self, respond):
        class Handler(http.server.BaseHTTPRequestHandler):
            def answer(self):
                status, headers, content = respond(self, self.rfile.read(int(self.headers.get("Content-Length", 0))))
                self.send_response_only(status)
                for name, value in headers.items():
                    if name.lower() not in ("transfer-encoding", "content-length", "connection"):
                        self.send_header(name, value)
                self.send_header("Content-Length", str(len(content)))
                with contextlib.suppress(ConnectionError):  # the client went away
                    self.end_headers()
                    if self.command != "HEAD":
                        self.wfile.write(content)

            do_GET = do_POST = do_PATCH = do_DELETE = do_HEAD = answer

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        self.thread = threading.Thread(target=self.server.serve_forever, daemon=True)
        self.thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()
        self.thread.join(60)


class Canned(FakeServer):
    """A server whose response to every request is the same JSON."""

    def __init__(self, value):
        super().__init__(lambda *_: (200, {}, json.dumps(value).encode()))


def ball(size=(40, 32, 24), radius=9.0, spacing=(1.0, 1.0, 1.0)):
    """The negative distances from the centre: the iso-value -r gives a ball of radius r."""
    axes = [(numpy.arange(n) - (n - 1) / 2) * step for n, step in zip(size, spacing)]
    x, y, z = numpy.meshgrid(*axes, indexing="ij")
    return -numpy.sqrt(x * x + y * y + z * z).astype("float32")


def turned(spacing=(0.5, 0.75, 1.25), origin=(12.0, -40.0, 7.5), angle=0.4):
    """An affine with a rotation about z."""
    affine = numpy.eye(4)
    turn = numpy.array(
        [[numpy.cos(angle), -numpy.sin(angle), 0], [numpy.sin(angle), numpy.cos(angle), 0], [0, 0, 1]]
    )
    affine[:3, :3] = turn @ numpy.diag(spacing)
    affine[:3, 3] = origin
    return affine
