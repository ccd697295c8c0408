"""A daemon in a folder of its own, its log, and connections to it."""

import http.client
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

# More than an ordinary daemon needs for a thousand small volumes, and less than a leak makes of them.
MOST_DAEMON_KIB = 1 << 20
RUN_LINE = re.compile(r"job ([0-9a-f-]{36}), attempt (\d+) failed: (.*)", re.DOTALL)


class Daemon:
    def __init__(self, program):
        self.folder = tempfile.mkdtemp(prefix="isomesh-fuzz-")
        self.log = os.path.join(self.folder, "log")
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ISOMESH")}
        command = [program, "--listen", "127.0.0.1:0", "--data", os.path.join(self.folder, "data"), "--log-level", "warn",
                   "--log-format", "json", "--max-disk", "4GiB"]
        with open(self.log, "wb") as log:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=environment)
        line = self.process.stdout.readline()
        if not line.startswith("listening on http://"):
            raise SystemExit(f"{program} did not start: {Path(self.log).read_text(encoding='utf-8')}")
        host, port = line.split()[-1].removeprefix("http://").rsplit(":", 1)
        self.address = (host, int(port))

    def end_faults(self):
        """Ends the daemon. Returns what was wrong with it at the end."""
        faults = []
        if self.process.poll() is not None:
            return [f"the daemon ended with {self.process.returncode}"]
        status, body, _ = Connection(self.address).ask("GET", "/readyz")
        if status != 200:
            faults.append(f"the daemon is not ready: {body.decode('utf-8', 'replace')}")
        text = Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8")
        kib = int(re.search(r"VmHWM:\s+(\d+) kB", text)[1])
        if kib > MOST_DAEMON_KIB:
            faults.append(f"the daemon used {kib} KiB of memory")
        self.process.send_signal(signal.SIGTERM)
        try:
            if self.process.wait(60) != 0:
                faults.append(f"the daemon ended with {self.process.returncode}")
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(60)
            faults.append("the daemon did not end")
        return faults

    def remove(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(60)
        self.process.stdout.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def log_faults(self):
        """What the log says of jobs that ran more than once or ended badly, as (job or None, line)."""
        faults = []
        for line in Path(self.log).read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                message = json.loads(line)
            except ValueError:
                message = {"event": line}
            run = RUN_LINE.search(line if "event" not in message else " ".join(str(value) for value in message.values()))
            if run is None:
                faults.append((None, line))
            elif int(run[2]) > 1 or re.search(r"signal|process|exception|internal", run[3], re.IGNORECASE):
                faults.append((run[1], line))
        return faults


class Connection:
    """Kept alive between requests. Not for several threads."""

    def __init__(self, address, limit_s=60):
        self.connection = http.client.HTTPConnection(*address, timeout=limit_s)

    def ask(self, method, target, body=None, headers=()):
        """The status, the bytes and the headers of a response. A kept connection that the daemon closed is opened again."""
        for again in (True, False):
            try:
                self.connection.request(method, target, body, dict(headers))
                response = self.connection.getresponse()
                return response.status, response.read(), response.headers
            except (http.client.RemoteDisconnected, ConnectionResetError, BrokenPipeError):
                self.connection.close()
                if not again:
                    raise
            except Exception:
                self.connection.close()
                raise

    def close(self):
        self.connection.close()
