"""What each client does when its server is busy, breaks, moves or rejects it. One table for the command, the Python package and the
JavaScript module: each is a program of its own that uploads a file in parts.

Pauses of a minute are not waited for here. That the time of a busy server is no outage is tested by PatienceTest (C++), test_resume.py
and resume.test.ts.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import unittest
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path

from scripted import CUT, FILE, HALF, LOST, MESH, SILENT, UPLOAD, VOLUME, ScriptedServer
from support import DAEMON, DaemonTest, ball

CONTENT = bytes(range(251)) * (9 << 12)  # is sent in parts
PYTHON = """
import sys, isomesh_client
client = isomesh_client.Client(sys.argv[1])
"""
JAVASCRIPT = """
import { readFile } from 'node:fs/promises';
import { Client } from './client.mjs';
const over = new AbortController();
process.on('SIGINT', () => over.abort());
const [server, file] = process.argv.slice(2);
const options = { name: 'head.nii', signal: over.signal };
try {
  const { volumes } = await new Client({ server }).upload(await readFile(file), options);
  console.log(volumes[0].volume.id);
} catch (error) {
  console.error(error);
  process.exitCode = 1;
}
"""


MESH_PYTHON = """
import sys, isomesh_client
server, file, target, allow_empty = sys.argv[1:]
client = isomesh_client.Client(server)
try:
    for result in client.mesh_all([file], to=lambda _: target, iso=1, allow_empty=allow_empty == "true"):
        if result.error: raise result.error
except isomesh_client.IsomeshError as error:
    sys.exit(str(error))
"""
MESH_JAVASCRIPT = """
import { readFile, writeFile } from 'node:fs/promises';
import { Client } from './client.mjs';
const [server, file, target, allowEmpty] = process.argv.slice(2);
const client = new Client({ server });
try {
  const { volumes } = await client.upload(await readFile(file), { name: 'head.nii' });
  for (const { code, detail } of volumes[0].volume.notes) console.error(detail, code);
  const { id } = await client.submitJob({ volume: volumes[0].volume.id, iso: 1, formats: ['stl'] });
  const job = await client.follow(id);
  if (job.state !== 'succeeded') throw new Error(job.error?.detail ?? job.state);
  await writeFile(target, new Uint8Array(await client.meshOf(job, 'stl', undefined, { allowEmpty: allowEmpty === 'true' })));
} catch (error) {
  console.error(error.message);
  process.exitCode = 1;
}
// The stream of events may still be open.
process.exit();
"""


@dataclass
class Ending:
    """The end of a job, and what each client says of it. A client that fails leaves no file."""

    says: str = "^"
    job: dict = field(default_factory=dict)  # members that differ from those of a job that succeeds
    mesh: dict = field(default_factory=dict)  # the same of its mesh
    failing: dict = None
    notes: tuple = ()
    allow_empty: bool = False
    succeeds: bool = False


FAULT = {"type": "urn:isomesh:problem:too-large", "title": "Too large", "status": 413, "detail": "so says the script", "instance": "/v1/jobs/1"}
EMPTY = {"empty": True, "empty_reason": "so says the script"}
NOTE = {"code": "forms-differ", "detail": "so says the script"}
ENDINGS = {
    "well": Ending(succeeds=True),
    "a volume with a note": Ending("so says the script.*forms-differ", notes=(NOTE,), succeeds=True),
    "an empty surface": Ending("[Tt]he surface is empty: so says the script", mesh=EMPTY),
    "an empty surface that is allowed": Ending(mesh=EMPTY, allow_empty=True, succeeds=True),
    "an empty surface of an older server": Ending("[Tt]he surface is empty", mesh={"empty": True}),
    "a job that fails": Ending("so says the script", {"state": "failed", "mesh": None, "error": FAULT}),
    "a job that was cancelled": Ending("cancelled", {"state": "cancelled", "mesh": None}),
    "parameters that are rejected": Ending("so says the script", failing={"/v1/jobs": 422}),
    "a volume that is rejected": Ending("so says the script", failing={"/v1/volumes": 422}),
    "a mesh that has expired": Ending("so says the script", failing={"/v1/jobs/1/mesh.stl": 410}),
    "a job that has expired": Ending("so says the script", failing={"/v1/jobs/1": 410, "/v1/jobs/1/mesh.stl": 410}),
    "a mesh that cannot be read": Ending("so says the script", failing={"/v1/jobs/1/mesh.stl": 500}),
}


@dataclass
class Case:
    script: dict  # as ScriptedServer takes it; OTHER and OWN stand for the addresses of another server and this one
    calls: list  # what the server is asked
    succeeds: bool = True
    interrupted: bool = False  # Ctrl-C when the server is silent or busy
    may_end: list = field(default_factory=list)  # calls that may follow: a client tells the server that it has given up
    proxy: bool = False  # the environment names a proxy


CASES = {
    "well": Case({}, ["POST 201", "PATCH 201"]),
    "busy": Case(
        {"POST": [(503, {})], "PATCH": [(429, {"Retry-After": "soon"})]},
        ["POST 503", "POST 201", "PATCH 429", "PATCH 201"],
    ),
    "broken": Case({"PATCH": [(CUT, {})]}, ["POST 201", "PATCH cut", "HEAD 204", "PATCH 201"]),
    "broken and then busy": Case(
        {"PATCH": [(CUT, {})], "HEAD": [(503, {"Retry-After": "1"})]},
        ["POST 201", "PATCH cut", "HEAD 503", "HEAD 204", "PATCH 201"],
    ),
    "broken at the beginning": Case({"POST": [(CUT, {}), (CUT, {})]}, ["POST cut", "POST cut", "POST 201", "PATCH 201"]),
    "a response is lost": Case({"PATCH": [(LOST, {})]}, ["POST 201", "PATCH lost", "HEAD 204", "POST 200"]),
    "a response breaks": Case({"PATCH": [(HALF, {})]}, ["POST 201", "PATCH half", "HEAD 204", "POST 200"]),
    "a gateway does not reach the server": Case({"PATCH": [(502, {})]}, ["POST 201", "PATCH 502", "HEAD 204", "PATCH 201"]),
    "another daemon": Case({"PATCH": [(410, {})]}, ["POST 201", "PATCH 410", "POST 201"]),
    "revoked": Case({"PATCH": [(401, {})]}, ["POST 201", "PATCH 401"], succeeds=False, may_end=["DELETE 204"]),
    "rejected": Case({"PATCH": [(413, {})]}, ["POST 201", "PATCH 413"], succeeds=False, may_end=["DELETE 204"]),
    "redirected": Case({"POST": [(307, {"Location": "OTHER/v1/volumes"})]}, ["POST 307"], succeeds=False),
    "redirected later": Case(
        {"PATCH": [(308, {"Location": f"OTHER{UPLOAD}"})]}, ["POST 201", "PATCH 308"], succeeds=False, may_end=["DELETE 204"]
    ),
    "an address that a gateway made whole": Case({"POST": [(201, {"Location": f"OWN{UPLOAD}"})]}, ["POST 201", "PATCH 201"]),
    "an address elsewhere": Case({"POST": [(201, {"Location": "OTHER/elsewhere"})]}, ["POST 201"], succeeds=False),
    **{
        f"what has arrived is {text!r}": Case(
            {"PATCH": [(CUT, {})], "HEAD": [(204, {"Upload-Offset": text} if text else {})]},
            ["POST 201", "PATCH cut", "HEAD 204"], succeeds=False, may_end=["DELETE 204"],
        )
        for text in ("", "-1", "\xb2", "1e3", str(1 << 40), "9" * 30)
    },
    "a proxy in the environment": Case({}, ["POST 201", "PATCH 201"], proxy=True),
    "interrupted while the server is silent": Case(
        {"PATCH": [(SILENT, {})]}, ["POST 201", "PATCH silent", "DELETE 204"], succeeds=False, interrupted=True
    ),
    "interrupted while the server is busy": Case(
        {"PATCH": [(503, {"Retry-After": "60"})]}, ["POST 201", "PATCH 503", "DELETE 204"], succeeds=False, interrupted=True
    ),
}


class Untouched:
    """Another server, which nobody may connect to."""

    def __enter__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        return self

    def __exit__(self, *_):
        self.listener.close()

    def is_untouched(self):
        self.listener.setblocking(False)
        try:
            self.listener.accept()[0].close()
        except BlockingIOError:
            return True
        return False


class Clients(DaemonTest):
    """The daemon serves the JavaScript module."""

    limit_s = 200

    @classmethod
    def prepare(cls, folder):
        (folder / "head.nii").write_bytes(CONTENT)
        (folder / "upload.mjs").write_text(JAVASCRIPT)
        (folder / "mesh.mjs").write_text(MESH_JAVASCRIPT)
        (folder / "few.nii").write_bytes(CONTENT[:1000])

    @classmethod
    def start(cls):
        super().start()
        with urllib.request.urlopen(f"{cls.url}/client.js") as response:
            (cls.folder / "client.mjs").write_bytes(response.read())
        # With all members, which the command needs.
        cls.job = cls.client.mesh(ball(), iso=-8, formats=["stl"]).job

    def run_client(self, command, case):
        """The exit status and the output of a client, with the server that it talked to."""
        with Untouched() as other:
            script = {
                method: [(step, {name: text.replace("OTHER", other.url) for name, text in headers.items()}) for step, headers in steps]
                for method, steps in case.script.items()
            }
            with ScriptedServer(script) as server:
                environment = {name: text for name, text in os.environ.items() if "proxy" not in name.lower()}
                if case.proxy:
                    names = ("http_proxy", "HTTP_PROXY", "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY")
                    environment.update(dict.fromkeys(names, other.url))
                process = subprocess.Popen(
                    [part.replace("SERVER", server.url) if isinstance(part, str) else part for part in command],
                    cwd=self.folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                )
                try:
                    if case.interrupted:
                        self.assertTrue(server.silent.wait(30))
                        process.send_signal(signal.SIGINT)
                    out, err = process.communicate(timeout=20)
                finally:
                    process.kill()
                    process.wait()
            return process.returncode, out, err, server, other.is_untouched()

    def assert_table(self, command, mesh=()):
        """`mesh`: the calls of a client that makes a mesh of the volume."""
        for name, case in CASES.items():
            with self.subTest(name):
                status, out, err, server, is_alone = self.run_client(command, case)
                self.assertTrue(is_alone, "another server was asked")
                self.assertEqual(status == 0, case.succeeds, err)
                ends = [[*case.calls, *mesh]] if case.succeeds else [case.calls, [*case.calls, *case.may_end]]
                self.assertIn(server.calls, ends, err)
                if case.succeeds:
                    self.assertIn(VOLUME, out)
                    self.assertTrue(server.bytes == CONTENT)

    def assert_endings(self, command_of):
        """`command_of`: the command line for a server, the file to write and if it may be without triangles."""
        for name, ending in ENDINGS.items():
            mesh = {**self.job["mesh"], "files": {"stl": FILE}, **ending.mesh}
            job = {**self.job, "id": "1", "volume": VOLUME, "mesh": mesh, **ending.job}
            target = self.folder / "mesh.stl"
            earlier = b"an earlier mesh"
            for is_there in (False, True):
                with self.subTest(name, is_there=is_there):
                    target.unlink(missing_ok=True)
                    if is_there:
                        target.write_bytes(earlier)
                    with ScriptedServer({}, job, ending.failing, ending.notes) as server:
                        ran = subprocess.run(
                            command_of(server.url, target, ending.allow_empty),
                            cwd=self.folder, check=False, capture_output=True, text=True, timeout=30,
                        )
                    self.assertEqual(ran.returncode, 0 if ending.succeeds else 1, ran.stderr)
                    self.assertRegex(ran.stderr, ending.says)
                    self.assertNotIn("Traceback", ran.stderr)
                    found = target.read_bytes() if target.exists() else None
                    self.assertEqual(found, MESH if ending.succeeds else earlier if is_there else None)
                    self.assertEqual([each for each in os.listdir(self.folder) if each.endswith(".part")], [])

    def test_endings_of_a_job_with_the_command(self):
        def command(server, target, allow_empty):
            options = ["--allow-empty"] if allow_empty else []
            return [DAEMON.with_name("isomesh"), "--server", server, "mesh", "few.nii", "--iso", "1", *options, "-o", target]

        self.assert_endings(command)

    def test_endings_of_a_job_with_the_python_package(self):
        def command(server, target, allow_empty):
            return [sys.executable, "-c", MESH_PYTHON, server, "few.nii", target, str(allow_empty).lower()]

        self.assert_endings(command)

    def test_endings_of_a_job_with_the_javascript_module(self):
        def command(server, target, allow_empty):
            return [shutil.which("node"), "mesh.mjs", server, "few.nii", target, str(allow_empty).lower()]

        self.assert_endings(command)

    def test_the_command(self):
        self.assert_table([DAEMON.with_name("isomesh"), "--server", "SERVER", "upload", "head.nii"])

    def test_the_python_package(self):
        self.assert_table([sys.executable, "-c", PYTHON + "print(client.upload('head.nii')['id'])", "SERVER"])

    def test_a_batch_of_the_python_package(self):
        """The upload runs in another thread than the interrupt."""
        batch = "result, = client.mesh_all(['head.nii'], to='out/{name}.stl', iso=1)\n"
        told = "if result.error: raise result.error\nprint(result.job['volume'])\n"
        self.assert_table([sys.executable, "-c", PYTHON + batch + told, "SERVER"], ["POST 200", "GET 200", "GET 200"])

    def test_the_javascript_module(self):
        self.assert_table([shutil.which("node"), "upload.mjs", "SERVER", "head.nii"])


if __name__ == "__main__":
    unittest.main()
