"""Tokens and volumes reach the server that a client was told, and nobody else: no proxy of the environment, nor where a response leads."""

import json
import os
import re
import shutil
import subprocess
import sys
import urllib.request

from support import DAEMON, ROOT, DaemonTest, FakeServer

TOKEN = "a-secret-of-this-test"
COMMAND = DAEMON.with_name("isomesh")

PACKAGE = """
import isomesh_client
isomesh_client.Client(URL, token=TOKEN, retry_seconds=0).upload(FILE)
"""

OGC = """
import http.client, importlib.util, threading
spec = importlib.util.spec_from_file_location("isomesh_ogc", ROOT + "/client/ogc/isomesh_ogc.py")
ogc = importlib.util.module_from_spec(spec)
spec.loader.exec_module(ogc)
with ogc.serve(0, URL) as server:
    threading.Thread(target=server.serve_forever, daemon=True).start()
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port)
    connection.request("GET", "/jobs/one.raw", headers={"Authorization": "Bearer " + TOKEN})
    print(connection.getresponse().status)
    server.shutdown()
"""

ORTHANC = """
import json, runpy, types
orthanc = types.ModuleType("orthanc")
section = {"Url": URL, "Token": TOKEN, "Pacs": "main", "Rules": ["bone"]}
orthanc.GetConfiguration = lambda: json.dumps({"Isomesh": section})
orthanc.RegisterRestCallback = orthanc.ExtendOrthancExplorer = lambda *_: None
sys.modules["orthanc"] = orthanc
runpy.run_path(ROOT + "/client/orthanc/isomesh_orthanc.py")["ask"]("POST", "/v1/orders", {"rule": "bone"})
"""

SLICER = """
import runpy
from test_slicer import stub
sys.modules.update(stub())
runpy.run_path(ROOT + "/client/slicer/Isomesh.py")["IsomeshLogic"](URL, TOKEN).upload(FILE)
"""

PARAVIEW = """
import os, runpy, types
class Any:
    def __getattr__(self, _):
        return lambda *_, **__: lambda decorated: decorated
class Algorithm:
    def __init__(self, **_): pass
    def Modified(self): pass
paraview = types.ModuleType("paraview")
paraview.print_error = print
decorators = types.ModuleType("paraview.util.vtkAlgorithm")
decorators.VTKPythonAlgorithmBase = Algorithm
decorators.smdomain = decorators.smhint = decorators.smproperty = decorators.smproxy = Any()
sys.modules.update({"paraview": paraview, "paraview.util": types.ModuleType("paraview.util"), "paraview.util.vtkAlgorithm": decorators})
os.environ.setdefault("ISOMESH_SERVER", URL)
os.environ["ISOMESH_TOKEN"] = TOKEN
reader = runpy.run_path(ROOT + "/client/paraview/isomesh_paraview.py")["IsomeshReader"]()
reader.SetServer(URL)
reader.made("a key", lambda client: client.upload(FILE))
"""

JAVASCRIPT = """
import { readFile } from 'node:fs/promises';
const [url, token, file, module] = process.argv.slice(2);
const { Client } = await import(module);
await new Client({ server: url, token, retrySeconds: 0 }).upload(await readFile(file), { name: 'ball.nrrd' });
"""

# The files of clients and examples that have to do with tokens, and the client that the tests try of each.
SENDERS = {
    "client/cli/options.cpp": "command",
    "client/cli/options.h": "command",
    "client/isomesh/client.h": "command",
    "client/isomesh/transport.cpp": "command",
    "client/ogc/isomesh_ogc.py": "ogc",
    "client/orthanc/isomesh_orthanc.py": "orthanc",
    "client/paraview/isomesh_paraview.py": "paraview",
    "client/python/src/isomesh_client/client.py": "package",
    "client/python/src/isomesh_client/transport.py": "package",
    "client/slicer/Isomesh.py": "slicer",
    "client/web/src/api/connection.ts": "javascript",
    "client/web/src/job/snippets.ts": None,  # shows commands
    "examples/curl/mesh.sh": "curl",
    "examples/javascript/mesh.mjs": "javascript",
}


class Seen(FakeServer):
    """Keeps whether a token came with each request."""

    def __init__(self, status, headers=None):
        self.tokens = []

        def respond(handler, _):
            self.tokens.append(TOKEN in handler.headers.get("Authorization", ""))
            body = json.dumps({"type": "about:blank", "title": "No", "status": status, "detail": "No."}).encode()
            return status, {"Content-Type": "application/problem+json", **(headers(handler) if headers else {})}, body

        super().__init__(respond)


class Direct(DaemonTest):
    @classmethod
    def prepare(cls, folder):
        (folder / "ball.nrrd").write_bytes(b"NRRD0004\n")

    def commands(self, url):
        """Each client with a request that has a token; most send a volume, too."""
        file = self.folder / "ball.nrrd"

        def python(code):
            head = f"import sys\nURL, TOKEN, FILE, ROOT = {url!r}, {TOKEN!r}, {str(file)!r}, {str(ROOT)!r}\n"
            return [sys.executable, "-c", head + code]

        module, script = self.folder / "client.mjs", self.folder / "upload.mjs"
        with urllib.request.urlopen(self.url + "/client.js", timeout=30) as response:
            module.write_bytes(response.read())
        script.write_text(JAVASCRIPT)
        return {
            "command": [COMMAND, "--server", url, "--token", TOKEN, "--retry-seconds", "0", "upload", file],
            "package": python(PACKAGE),
            "ogc": python(OGC),
            "orthanc": python(ORTHANC),
            "slicer": python(SLICER),
            "paraview": python(PARAVIEW),
            "curl": [ROOT / "examples/curl/mesh.sh", file, "60", self.folder / "mesh.stl"],
            "javascript": [shutil.which("node"), script, url, TOKEN, file, module],
        }

    def try_each(self, named, other, environment):
        for client, command in self.commands(named.url).items():
            with self.subTest(client):
                named.tokens.clear()
                other.tokens.clear()
                own = {"ISOMESH_SERVER": named.url, "ISOMESH_TOKEN": TOKEN} if client == "curl" else {}
                clean = {name: value for name, value in os.environ.items() if not name.upper().startswith(("ISOMESH", "NO_PROXY"))}
                ran = subprocess.run(
                    command, env={**clean, **own, **environment}, check=False, capture_output=True, text=True, timeout=60
                )
                said = ran.stdout + ran.stderr
                self.assertTrue(named.tokens and all(named.tokens), said)
                self.assertEqual(other.tokens, [], said)
                self.assertTrue(ran.returncode != 0 or client == "ogc", said)
                if client == "ogc":
                    self.assertIn(ran.stdout.strip(), ("404", "502"))

    def test_where_a_response_leads(self):
        with Seen(404) as other, Seen(307, lambda handler: {"Location": other.url + handler.path}) as named:
            self.try_each(named, other, {})

    def test_a_proxy_of_the_environment(self):
        with Seen(404) as other, Seen(404) as named:
            names = [name for each in ("http_proxy", "https_proxy", "all_proxy") for name in (each, each.upper())]
            self.try_each(named, other, {"NODE_USE_ENV_PROXY": "1", **dict.fromkeys(names, other.url)})

    def test_a_server_that_a_state_file_of_paraview_names(self):
        with Seen(404) as other, Seen(404) as named:
            command = self.commands(other.url)["paraview"]
            subprocess.run(command, env={**os.environ, "ISOMESH_SERVER": named.url}, check=False, capture_output=True, timeout=60)
            self.assertTrue(other.tokens)
            self.assertFalse(any(other.tokens))

    def test_no_client_is_forgotten(self):
        kinds = (".py", ".sh", ".js", ".mjs", ".ts", ".cpp", ".h")
        found = set()
        for place in ("client", "examples"):
            for file in (ROOT / place).rglob("*"):
                if "node_modules" in file.parts or file.suffix not in kinds or not file.is_file():
                    continue
                if re.search("Authorization|Bearer|ISOMESH_TOKEN", file.read_text("utf-8")):
                    found.add(str(file.relative_to(ROOT)))
        self.assertEqual(found, set(SENDERS))
        self.assertLessEqual({client for client in SENDERS.values() if client}, set(self.commands(self.url)))
