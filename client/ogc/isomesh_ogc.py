"""OGC API - Processes, Part 1: Core 1.0 (OGC 18-062r2) in front of an isomesh daemon: one process, `mesh`.

    python3 isomesh_ogc.py [--port 8090] [--server http://127.0.0.1:8080] [--url https://ogc.example.org]

It keeps nothing: jobs are the daemon's, and so are the rights. `Authorization` is passed on. A job's number ends with the form of
its results that the execute request asked for.
"""

import argparse
import http.client
import json
import re
import urllib.error
import urllib.parse
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

LARGEST_REQUEST = 1 << 20
TIMEOUT = 60
CONFORMANCE = [f"http://www.opengis.net/spec/ogcapi-processes-1/1.0/conf/{each}" for each in ("core", "ogc-process-description", "json", "dismiss")]
EXCEPTION = "http://www.opengis.net/def/exceptions/ogcapi-processes-1/1.0/"
STATES = {"queued": "accepted", "running": "running", "succeeded": "successful", "failed": "failed", "cancelled": "dismissed"}
JSON = "application/json"
PROBLEM = "application/problem+json"
NAMES = r"[A-Za-z0-9_-]+"

SUMMARY = {
    "id": "mesh",
    "title": "Surface of a volume",
    "description": "Makes the surface of an iso-value or of labels of a volume that is stored in the daemon.",
    "version": "1",
    "jobControlOptions": ["async-execute", "dismiss"],
    "outputTransmission": ["reference"],
}
INPUTS = {
    "volume": ("The id of a volume, as POST /v1/volumes of the daemon returns it.", {"type": "string", "pattern": "^[0-9a-f]{64}$"}, 1),
    "format": ("The format of the file.", {"type": "string", "enum": ["glb", "stl", "ply", "obj", "3mf", "vtk", "vtp", "off", "gii", "drc"]}, 1),
    "parameters": (
        "Other members of the daemon's JobRequest (openapi.yaml), such as iso, labels, max_error_mm.",
        {"type": "object", "not": {"anyOf": [{"required": ["volume"]}, {"required": ["formats"]}]}},
        0,
    ),
}
REFERENCE = {"transmissionMode": "reference"}
MESH = {"title": "The mesh", "schema": {"type": "string", "format": "binary"}}


class Failure(Exception):
    def __init__(self, status, title, detail="", kind="about:blank", headers=None):
        super().__init__(title)
        self.status = status
        self.headers = headers or {}
        self.problem = {"type": kind, "title": title, "status": status, "detail": detail}


class NoRedirects(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_):
        return None


# Tokens are for the daemon only: not for a proxy of the environment, nor for where a response leads.
DIRECTLY = urllib.request.build_opener(urllib.request.ProxyHandler({}), NoRedirects)


def failure_of(error, missing):
    """What this service says of a daemon's error."""
    with error:
        try:
            said = json.loads(error.read()) if PROBLEM in error.headers.get("Content-Type", "") else {}
        except (OSError, ValueError, http.client.HTTPException):
            said = {}  # the status is known, at least
    if error.code < 400:
        return Failure(502, "The daemon does not respond as one", f"It leads to another address (status {error.code}).")
    problem = said if isinstance(said, dict) else {}
    kind = missing if error.code == 404 and missing else problem.get("type", "about:blank")
    kept = {name: error.headers[name] for name in ("WWW-Authenticate", "Retry-After") if name in error.headers}
    return Failure(error.code, problem.get("title", error.reason), problem.get("detail", ""), kind, kept)


def description():
    inputs = {
        name: {"title": name, "description": text, "schema": schema, "minOccurs": least, "maxOccurs": 1}
        for name, (text, schema, least) in INPUTS.items()
    }
    return {**SUMMARY, "inputs": inputs, "outputs": {"mesh": MESH}, "links": []}


def host_of(authority):
    """The name before a port; None without one, and for what is no authority, such as `[`."""
    try:
        return urllib.parse.urlsplit("//" + authority).hostname
    except ValueError:
        return None


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = TIMEOUT
    server_version = "isomesh-ogc"

    def log_message(self, *_):
        pass

    def do_GET(self):
        self._answer(
            {
                r"/": self._landing,
                r"/conformance": lambda: self._send(200, {"conformsTo": CONFORMANCE}),
                r"/processes": lambda: self._send(200, {"processes": [SUMMARY], "links": [self._link("/processes", "self")]}),
                rf"/processes/({NAMES})": lambda name: self._send(200, self._process(name)),
                rf"/jobs/({NAMES})\.(raw|document)": lambda job, form: self._send(200, self._status(self._job(job), form)),
                rf"/jobs/({NAMES})\.(raw|document)/results": self._results,
            }
        )

    def do_POST(self):
        self._answer({rf"/processes/({NAMES})/execution": self._execute})

    def do_DELETE(self):
        self._answer({rf"/jobs/({NAMES})\.(raw|document)": self._dismiss})

    def _answer(self, routes):
        try:
            # A name that a stranger's DNS leads to this machine.
            if host_of(self.headers.get("Host", "")) not in self.server.names:
                raise Failure(421, "Unknown host", "Start the service with --url ADDRESS if clients know it by another name.")
            # An unread body would be taken for the next request.
            if "Transfer-Encoding" in self.headers or (self.command != "POST" and self.headers.get("Content-Length", "0") != "0"):
                raise Failure(400, "Unexpected body", "Only POST has a body, and that has a Content-Length.")
            path = self.path.partition("?")[0]
            for pattern, run in routes.items():
                found = re.fullmatch(pattern, path)
                if found:
                    run(*found.groups())
                    return
            kind = "no-such-job" if path.startswith("/jobs/") else "no-such-process" if path.startswith("/processes/") else "not-found"
            raise Failure(404, "Not found", f"There is no {path}.", EXCEPTION + kind)
        except Failure as failure:
            self._send(failure.status, failure.problem, {"Content-Type": PROBLEM, **failure.headers})

    def _send(self, status, value=None, headers=None):
        body = b"" if value is None else json.dumps(value).encode()
        self.send_response(status)
        for name, text in {"Content-Type": JSON, **(headers or {})}.items():
            self.send_header(name, text)
        if status >= 400:  # the request's body may be unread
            self.send_header("Connection", "close")
            self.close_connection = True
        if status != 204:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _daemon(self, method, path, value=None, missing=""):
        """The daemon's JSON. Its problems become this service's."""
        headers = {"Content-Type": JSON}
        if self.headers.get("Authorization"):
            headers["Authorization"] = self.headers["Authorization"]
        body = None if value is None else json.dumps(value).encode()
        request = urllib.request.Request(self.server.daemon + path, body, headers, method=method)
        try:
            with DIRECTLY.open(request, timeout=TIMEOUT) as response:
                answer = json.load(response)
            if not isinstance(answer, dict):
                raise ValueError("its JSON is no object")
            return answer
        except urllib.error.HTTPError as error:
            raise failure_of(error, missing) from None
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise Failure(502, "The daemon does not respond as one", str(error)) from None

    def _link(self, path, relation, kind=JSON):
        base = self.server.url or f"http://{self.headers['Host']}"
        return {"href": base + path, "rel": relation, "type": kind}

    def _landing(self):
        links = [
            self._link("/", "self"),
            self._link("/conformance", "http://www.opengis.net/def/rel/ogc/1.0/conformance"),
            self._link("/processes", "http://www.opengis.net/def/rel/ogc/1.0/processes"),
            {"href": f"{self.server.daemon}/openapi.yaml", "rel": "service-desc", "type": "application/yaml", "title": "The daemon's own API"},
        ]
        self._send(200, {"title": "isomesh", "description": "Surface meshes of medical volumes", "links": links})

    def _process(self, name):
        if name != "mesh":
            raise Failure(404, "No such process", f"There is no process {name}; the only one is mesh.", EXCEPTION + "no-such-process")
        return description()

    def _execute(self, name):
        self._process(name)
        # A page of another site can send other types without asking.
        if self.headers.get_content_type() != JSON:
            raise Failure(415, "Not JSON", f"The request's Content-Type must be {JSON}.")
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch("[0-9]+", length):
            raise Failure(411, "The request needs a length", "Its header Content-Length is missing.")
        if len(length) > len(str(LARGEST_REQUEST)) or int(length) > LARGEST_REQUEST:
            raise Failure(413, "The request is too large", f"At most {LARGEST_REQUEST} bytes are read.")
        try:
            request = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError) as error:
            raise Failure(400, "No JSON", str(error)) from None
        inputs = request.get("inputs") if isinstance(request, dict) else None
        if not isinstance(inputs, dict):
            raise Failure(400, "No inputs", "The request needs the member inputs, an object.")
        unknown = sorted(set(inputs) - set(INPUTS))
        missing = sorted(name for name, (_, _, least) in INPUTS.items() if least and name not in inputs)
        parameters = inputs.get("parameters", {})
        form = request.get("response", "raw")
        if unknown or missing or not isinstance(parameters, dict) or {"volume", "formats"} & set(parameters):
            raise Failure(400, "Wrong inputs", f"Unknown: {unknown}. Missing: {missing}. parameters is an object without volume and formats.")
        formats = INPUTS["format"][1]["enum"]
        if inputs["format"] not in formats:
            raise Failure(400, "Wrong format", f"format is one of {', '.join(formats)}.")
        if form not in ("raw", "document"):
            raise Failure(400, "Wrong response", "response is raw or document.")
        if request.get("outputs", {}) not in ({}, {"mesh": {}}, {"mesh": REFERENCE}):
            raise Failure(400, "Wrong outputs", "The only output is mesh, and its transmissionMode is reference.")
        job = self._daemon("POST", "/v1/jobs", {**parameters, "volume": inputs["volume"], "formats": [inputs["format"]]})
        status = self._status(job, form)
        self._send(201, status, {"Location": self._link(f"/jobs/{status['jobID']}", "self")["href"], "Preference-Applied": "respond-async"})

    def _job(self, job):
        return self._daemon("GET", f"/v1/jobs/{job}", missing=EXCEPTION + "no-such-job")

    def _status(self, job, form):
        path = f"/jobs/{job['id']}.{form}"
        status = {
            "jobID": f"{job['id']}.{form}",
            "processID": "mesh",
            "type": "process",
            "status": STATES[job["state"]],
            "progress": int(100 * job["progress"]),
            "links": [self._link(path, "self")],
        }
        status.update({name: job[name] for name in ("created", "started", "finished") if job.get(name)})
        if job.get("error"):
            status["message"] = job["error"].get("detail") or job["error"]["title"]
        if job.get("mesh") and job["mesh"]["empty"]:
            status["message"] = f"The surface is empty: {job['mesh'].get('empty_reason', 'the file has no triangles')}"
        if job["state"] == "succeeded":
            status["links"].append(self._link(f"{path}/results", "http://www.opengis.net/def/rel/ogc/1.0/results"))
        return status

    def _results(self, job, form):
        made = self._job(job)
        if made["state"] in ("queued", "running"):
            raise Failure(404, "The result is not ready", f"The job is {made['state']}.", EXCEPTION + "result-not-ready")
        if made["state"] != "succeeded":
            error = made.get("error") or {}
            raise Failure(error.get("status", 410), f"The job is {made['state']}", error.get("detail", ""), error.get("type", "about:blank"))
        # Beside the format there may be an archive: of labels, for formats that hold one label.
        files = made["mesh"]["files"]
        asked = files.get(made["parameters"]["formats"][0]) or next(iter(files.values()), None)
        if asked is None:
            raise Failure(404, "The surface is empty", "So there is no file.", EXCEPTION + "result-not-ready")
        address = self.server.daemon + asked["href"]
        if form == "document":
            self._send(200, {"mesh": {"href": address}})
        else:
            self._send(204, headers={"Link": f'<{address}>; rel="mesh"'})

    def _dismiss(self, job, form):
        made = self._daemon("DELETE", f"/v1/jobs/{job}?erase=false", missing=EXCEPTION + "no-such-job")
        self._send(200, self._status(made, form))


def serve(port, daemon, url=""):
    server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    server.daemon = daemon.rstrip("/")
    server.url = url.rstrip("/")
    server.names = {"localhost", "127.0.0.1", urllib.parse.urlsplit(url).hostname} - {None}
    return server


if __name__ == "__main__":
    options = argparse.ArgumentParser(description="OGC API - Processes in front of an isomesh daemon")
    options.add_argument("--port", type=int, default=8090)
    options.add_argument("--server", default="http://127.0.0.1:8080", help="the daemon's address, which clients get for results")
    options.add_argument("--url", default="", help="the address of this service for clients, if a proxy stands in front of it")
    given = options.parse_args()
    with serve(given.port, given.server, given.url) as running:
        print(f"listening on http://127.0.0.1:{running.server_port}", flush=True)
        running.serve_forever()
