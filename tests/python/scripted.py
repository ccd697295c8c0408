"""A server that follows a script, and counts what it is asked. No client can tell it from one that is busy, breaks or moves."""

import contextlib
import hashlib
import http.server
import json
import socket
import threading

VOLUME = "5" * 64
UPLOAD = "/v1/uploads/7"
CUT = "cut"  # as a status: the connection breaks in the middle of the body
LOST = "lost"  # the body arrives, and its response does not
HALF = "half"  # the body arrives, and the connection breaks in the body of its response
SILENT = "silent"  # no response
MESH = b"mesh"
PROBLEM = "application/problem+json"


def volume():
    return {
        "id": VOLUME, "samples": VOLUME, "name": None, "format": "raw", "dims": [10, 10, 10], "type": "uint8",
        "spacing": [1.0, 1.0, 1.0], "origin": [0.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "range": [0.0, 1.0], "suggested_iso": 0.5, "bytes": 1000, "created": "2026-11-30T19:23:38.853Z", "modality": None,
        "presets": [], "ignored": [], "notes": [],
    }


FILE = {"bytes": len(MESH), "sha256": hashlib.sha256(MESH).hexdigest(), "href": "/v1/jobs/1/mesh.stl"}


def job():
    """A job that has succeeded, with the members that Python needs."""
    return {
        "id": "1", "state": "succeeded", "volume": VOLUME, "parameters": {"volume": VOLUME, "iso": 1.0}, "error": None,
        "mesh": {"empty": False, "files": {"stl": FILE}},
    }


def problem(status):
    fault = {"type": "about:blank", "title": "No", "status": status, "detail": "so says the script", "instance": "/"}
    return json.dumps(fault).encode()


class ScriptedServer:
    """Stores one volume in parts, and makes a mesh at once. `script` names what happens to the first requests of a method instead: a
    status with headers, in which OWN is the server's own address, or one of the words above. `calls` has each request with what it
    got, such as "PATCH 201". Parts of a body that are not its last are left out, because only some clients send any.
    `job` is what becomes of the volume's job, and `failing` has the status of paths that are not there or fail.
    """

    def __init__(self, script, job=None, failing=None, notes=()):
        self.job, self.failing, self.notes = job, failing or {}, list(notes)
        self.script = {method: list(steps) for method, steps in script.items()}
        self.calls, self.bytes, self.is_whole = [], b"", False
        self.silent = threading.Event()  # somebody waits for a response
        self.over = threading.Event()
        owner = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def answer(self):
                owner.serve(self)

            do_GET = do_POST = do_PATCH = do_DELETE = do_HEAD = answer

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.05,), daemon=True)
        self.thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.over.set()
        self.server.shutdown()
        self.server.server_close()
        self.thread.join(60)

    def serve(self, request):
        size = int(request.headers.get("Content-Length", 0))
        steps = self.script.get(request.command, [])
        if steps and steps[0][0] in (LOST, HALF) and request.headers.get("Upload-Complete") != "?1":
            steps = []  # the response to the last part
        step, headers = steps.pop(0) if steps else (None, {})
        request.close_connection = True
        if step is None:
            self.answer(request, *self.ordinary(request, request.rfile.read(size)))
        elif step == CUT:
            self.bytes += request.rfile.read(size // 3)
            self.cut(request, step)
        elif step == LOST:
            self.append(request, request.rfile.read(size))
            self.cut(request, step)
        elif step == HALF:
            self.append(request, request.rfile.read(size))
            request.wfile.write(b"HTTP/1.1 201 Created\r\nContent-Length: 500\r\nConnection: close\r\n\r\n{")
            self.cut(request, step)
        elif step == SILENT:
            request.rfile.read(size)
            self.calls.append(f"{request.command} {step}")
            self.silent.set()
            self.over.wait(60)
        else:
            request.rfile.read(size)
            if step == 503:
                self.silent.set()
            told = {name: text.replace("OWN", self.url) for name, text in headers.items()}
            self.answer(request, step, {"Content-Type": PROBLEM, **told}, b"" if request.command == "HEAD" else problem(step))

    def cut(self, request, step):
        self.calls.append(f"{request.command} {step}")
        with contextlib.suppress(OSError):
            request.connection.shutdown(socket.SHUT_RDWR)

    def append(self, request, body):
        assert int(request.headers["Upload-Offset"]) == len(self.bytes), "a part in the wrong place"
        self.bytes += body
        self.is_whole = request.headers["Upload-Complete"] == "?1"

    def ordinary(self, request, body):
        """Status, headers and body of the API's response."""
        path, _, query = request.path.partition("?")
        state = {"Upload-Offset": str(len(self.bytes)), "Upload-Complete": "?1" if self.is_whole else "?0"}
        stored = json.dumps({**volume(), "bytes": len(self.bytes), "notes": self.notes}).encode()
        if path in self.failing:
            return self.failing[path], {"Content-Type": PROBLEM}, problem(self.failing[path])
        if request.command == "HEAD":
            return 204, state, b""
        if request.command == "DELETE":
            return 204, {}, b""
        if request.command == "PATCH":
            self.append(request, body)
            return (201, {}, stored) if self.is_whole else (204, state, b"")
        if path == "/v1/volumes" and request.headers.get("Upload-Complete") == "?0":
            return 201, {"Location": UPLOAD}, b""
        if path == "/v1/volumes" and f"upload={UPLOAD[-1]}" in query:
            return 200, {}, stored
        if path == "/v1/volumes":
            self.bytes, self.is_whole = body, True
            return 201, {}, stored
        if path.startswith("/v1/volumes/"):
            return 200, {}, stored
        if path.endswith("/mesh.stl"):
            return 200, {}, MESH
        return 200, {}, json.dumps(self.job or job()).encode()

    def answer(self, request, status, headers, content):
        if status != 204 or request.command != "PATCH":
            self.calls.append(f"{request.command} {status}")
        with contextlib.suppress(ConnectionError):  # the client went away
            request.send_response_only(status)
            for name, value in headers.items():
                request.send_header(name, value)
            if status != 204:
                request.send_header("Content-Length", str(len(content)))
            request.send_header("Connection", "close")
            request.end_headers()
            request.wfile.write(content)
