"""What the tests run: Orthanc, isomeshd, and a proxy between them that has faults."""
import base64
import http.client
import json
import os
import signal
import socket
import subprocess
import tempfile
import threading
import time

ORTHANC = "/usr/sbin/Orthanc"
PLUGIN = "/usr/share/orthanc/plugins/libOrthancDicomWeb.so"


# The network is the tests' own, so nobody else listens. Linux takes the ports of connections from 32768 upwards.
PORTS = iter(range(20000, 32768))


def free_port():
    """One that nobody has and nobody is given by chance, also while nothing listens on it yet."""
    return next(PORTS)


def call(port, method, path, body=None, headers=None, timeout=60):
    """Returns status, headers and body."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=timeout)
    try:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        connection.close()


def until(what, seconds=60, every=0.1):
    """What `what` returns as soon as that is true."""
    end = time.monotonic() + seconds
    while True:
        value = what()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"not so within {seconds} s: {what}")
        time.sleep(every)


class Orthanc:
    """A PACS in a folder of its own."""

    def __init__(self, folder, user=None, port=None, plugins=(), more=None):
        self.folder = folder
        self.port = port or free_port()
        self.user = user
        os.makedirs(folder, exist_ok=True)
        configuration = {
            "Name": "test", "StorageDirectory": os.path.join(folder, "db"),
            "IndexDirectory": os.path.join(folder, "db"), "HttpPort": self.port,
            "DicomServerEnabled": True, "DicomAet": "ORTHANC", "DicomPort": free_port(),
            "DicomCheckCalledAet": True, "DicomAlwaysAllowStore": True, "Plugins": [PLUGIN, *plugins], "RemoteAccessAllowed": True,
            "AuthenticationEnabled": user is not None, "OverwriteInstances": False,
            "RegisteredUsers": {user[0]: user[1]} if user else {},
            "DicomWeb": {"Enable": True, "Root": "/dicom-web/"},
            **(more or {}),
        }
        self.dicom_port = configuration["DicomPort"]
        self.configuration = os.path.join(folder, "orthanc.json")
        with open(self.configuration, "w", encoding="utf-8") as file:
            json.dump(configuration, file)
        self.process = None
        self.start()

    def headers(self):
        if not self.user:
            return {}
        text = base64.b64encode(":".join(self.user).encode()).decode()
        return {"Authorization": "Basic " + text}

    def start(self):
        log = open(os.path.join(self.folder, "log"), "ab")
        self.process = subprocess.Popen([ORTHANC, self.configuration], stdout=log, stderr=log)
        log.close()

        def answers():
            assert self.process.poll() is None, "Orthanc has ended"
            try:
                return self.call("GET", "/system")[0] == 200
            except OSError:
                return False
        until(answers)

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self):
        self.process.terminate()
        self.process.wait()

    def call(self, method, path, body=None):
        return call(self.port, method, path, body, self.headers())

    def upload(self, files):
        for data in files:
            status, _, answer = self.call("POST", "/instances", data)
            assert status == 200, answer

    def objects(self, study, modality="M3D"):
        """What QIDO finds of that modality in the study: one entry an instance."""
        status, _, answer = self.call(
            "GET", f"/dicom-web/studies/{study}/instances?Modality={modality}")
        assert status == 200, answer
        return json.loads(answer) if answer else []

    def file(self, instance):
        _, _, found = self.call("POST", "/tools/lookup", instance)
        return self.call("GET", json.loads(found)[0]["Path"] + "/file")[2]


class Daemon:
    """isomeshd, with a hospital's file."""

    def __init__(self, program, folder, hospital, *options):
        self.program = program
        self.folder = folder
        self.options = options
        os.makedirs(folder, exist_ok=True)
        self.hospital = os.path.join(folder, "hospital.toml")
        with open(self.hospital, "w", encoding="utf-8") as file:
            file.write(hospital)
        self.log = os.path.join(folder, "log")
        self.data = os.path.join(folder, "data")
        if "--data" in options:
            self.data = options[options.index("--data") + 1]
            self.options = [each for each in options if each not in ("--data", self.data)]
        self.process = None
        self.port = None
        self.start()

    def start(self):
        log = open(self.log, "ab")
        self.process = subprocess.Popen(
            [self.program, "--listen", "127.0.0.1:0", "--data", self.data,
             "--hospital", self.hospital, "--threads", "1", "--log-level", "debug", *self.options],
            stdout=subprocess.PIPE, stderr=log)
        log.close()
        line = self.process.stdout.readline().decode()
        assert line.startswith("listening on "), self.logged()[-2000:]
        self.port = int(line.rsplit(":", 1)[1])

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.process.stdout.close()

    def stop(self):
        self.process.terminate()
        self.process.wait(120)
        self.process.stdout.close()
        return self.process.returncode

    def logged(self):
        with open(self.log, encoding="utf-8") as file:
            return file.read()

    def call(self, method, path, body=None, headers=None):
        headers = dict(headers or {})
        if body is not None:
            body = json.dumps(body)
            headers["Content-Type"] = "application/json"
        status, answer_headers, text = call(self.port, method, path, body, headers)
        return status, answer_headers, json.loads(text) if text else None

    def order(self, body, headers=None):
        status, _, order = self.call("POST", "/v1/orders", body, headers)
        assert status in (200, 202), order
        return order

    def get(self, identity):
        return self.call("GET", f"/v1/orders/{identity}")[2]

    def ended(self, identity, seconds=60):
        """The order, when it has ended."""
        def end():
            order = self.call("GET", f"/v1/orders/{identity}?wait=5")[2]
            return order if order["state"] in ("succeeded", "failed", "cancelled") else None
        return until(end, seconds)

    def audit(self):
        lines = subprocess.run(
            [self.program, "audit", "--data", self.data],
            check=True, capture_output=True, text=True).stdout
        return [json.loads(line) for line in lines.splitlines()]


class StoreScp:
    """DCMTK's storescp, which has no DICOMweb: what it has stored lies in its folder."""

    def __init__(self, folder, *options):
        self.folder = folder
        self.port = free_port()
        os.makedirs(folder, exist_ok=True)
        self.process = None
        self.start(*options)

    def start(self, *options):
        self.process = subprocess.Popen(
            ["storescp", "--output-directory", self.folder, "--accept-all", *options,
             str(self.port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        def listens():
            assert self.process.poll() is None, "storescp has ended"
            try:
                socket.create_connection(("127.0.0.1", self.port)).close()
                return True
            except OSError:
                return False
        until(listens)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def files(self):
        return sorted(os.path.join(self.folder, name) for name in os.listdir(self.folder))


def fill_disk(path):
    """Writes a file until its disk is full."""
    # A buffer's rest would be written, and fail, when the file is closed.
    with open(path, "wb", buffering=0) as file:
        try:
            while file.write(bytes(1 << 12)):
                pass
        except OSError:
            pass


class Listener:
    """Takes connections on a free port; each is passed to `_take` in the listening thread."""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def close(self):
        self.listener.shutdown(socket.SHUT_RDWR)  # or the thread would take one more
        self.listener.close()

    def _serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self._take(connection)


class Relay(Listener):
    """Passes bytes on to a port, and may cut connections: after so many bytes of what comes, or of
    what is answered."""

    def __init__(self, port):
        self.target = port
        self.cut_after = None
        self.cut_answer_after = None
        self.cuts = 0
        super().__init__()

    def _take(self, connection):
        there = socket.create_connection(("127.0.0.1", self.target))
        for source, sink, most in [(connection, there, self.cut_after),
                                   (there, connection, self.cut_answer_after)]:
            threading.Thread(target=self._pass, args=(source, sink, most), daemon=True).start()

    def _pass(self, source, sink, most):
        passed = 0
        try:
            while data := source.recv(65536):
                if most is not None and passed + len(data) > most:
                    self.cuts += 1
                    break
                passed += len(data)
                sink.sendall(data)
        except OSError:
            pass
        for each in (source, sink):
            try:
                each.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Proxy(Listener):
    """Passes HTTP on to a PACS. `fault`, when it is set, is called with each request and the answer
    and returns bytes to answer with, an answer (status, headers, body) or None to pass it on."""

    def __init__(self, port):
        self.target = port
        self.fault = None  # before the request is passed on: (method, path, body) -> answer or None
        self.twist = None  # after: (method, path, answer) -> answer
        self.requests = []
        super().__init__()

    def answer(self, method, path, headers, body):
        answer = self.fault(method, path, body) if self.fault else None
        if answer is not None:
            return answer
        status, answer_headers, text = call(self.target, method, path, body or None, headers)
        answer = (status, {"Content-Type": answer_headers.get("Content-Type", "")}, text)
        return self.twist and self.twist(method, path, answer) or answer

    def _take(self, connection):
        threading.Thread(target=self._one, args=(connection,), daemon=True).start()

    def _one(self, connection):
        with connection:
            try:
                while self._request(connection):
                    pass
            except OSError:
                pass

    def _request(self, connection):
        data = b""
        while b"\r\n\r\n" not in data:
            piece = connection.recv(65536)
            if not piece:
                return False
            data += piece
        head, body = data.split(b"\r\n\r\n", 1)
        lines = head.decode().split("\r\n")
        method, path, _ = lines[0].split(" ")
        headers = dict(line.split(": ", 1) for line in lines[1:])
        length = int(headers.get("Content-Length", 0))
        while len(body) < length:
            piece = connection.recv(1 << 20)
            if not piece:
                return False
            body += piece
        self.requests.append((method, path))
        headers.pop("Host", None)
        answer = self.answer(method, path, headers, body)
        if callable(answer):
            return answer(connection)
        status, answer_headers, text = answer
        text_head = f"HTTP/1.1 {status} X\r\nContent-Length: {len(text)}\r\n"
        text_head += "".join(f"{name}: {value}\r\n" for name, value in answer_headers.items())
        connection.sendall(text_head.encode() + b"\r\n" + text)
        return True


def temporary_folder():
    return tempfile.TemporaryDirectory(prefix="isomesh-hospital-")
