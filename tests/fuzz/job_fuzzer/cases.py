"""One case: a volume, a job on it, and what has to be true of every answer."""

import json
import os
import random
import re
import time
from urllib.parse import quote

import numpy

from job_fuzzer.readers import Unreadable
from job_fuzzer.schema import Maker
from job_fuzzer.volumes import Volume

# On a machine with nothing else to do a job may take this long, and its stages this much longer for each thousand triangles. Two
# busy processors simplify noise, with a limit of a thousand millimetres, at 100 ms a thousand; they certify it at 15.
JOB_MS = 10_000
STAGE_MS = 5_000
JOB_MS_OF_A_THOUSAND = 500
CERTIFY_MS_OF_A_THOUSAND = 60
TRIANGLES_OF_A_SAMPLE = 24
LARGE_VOLUMES = 0.001
WRONG_BODIES = 0.06
IN_ONE_REQUEST = 0.15
# Formats with the mesh's own vertices, each once.
EXACT = {"ply", "obj", "off", "3mf", "usda", "usdz", "vtk", "vtp", "gii"}
# Numbers of a reason, which would make kinds of it.
SPECIFIC = re.compile(r"-?[0-9][0-9.e+-]*(, -?[0-9][0-9.e+-]*)*")
# Statuses of what is asked for. Others would hide that nothing was tried.
REASONS = {400, 413, 414, 415, 422}
JSON = {"Content-Type": "application/json"}
RAW = {"Content-Type": "application/octet-stream"}


def others_load():
    """How many times as long everything takes, because more wants to run than there are processors."""
    return max(1.0, os.getloadavg()[0] / os.cpu_count())


class Bad(Exception):
    """A fault of the daemon."""


def agree(body, volume, rng):
    """Changes a body to keep most rules between members, which a schema does not tell."""
    formats = body.get("formats", ["drc"])
    if ("lods" in body or body.get("distances")) and "glb" not in formats:
        body["formats"] = formats = [*formats, "glb"]
    if "lods" in body:
        body["lods"] = sorted({1, *body["lods"][1:]}, reverse=True)
    if body.get("crop"):
        body["crop"] = volume.box()
    if body.get("max_error_mm") is not None and "certify" in body:
        body["certify"] = True
    if body.get("passes") == 0:
        body.pop("untangle", None)
    if body.get("smoothing") == "taubin" and body.get("lambda"):
        body["lambda"] = min(body["lambda"], 0.66)
    if "labels" in body:
        body.pop("components", None)
        if body.get("scheme") == "bcc":
            body["scheme"] = 6
        background = body.get("background", 0)
        if isinstance(body["labels"], list) and background in body["labels"]:
            body["labels"] = [each for each in body["labels"] if each != background] or [background + 1]
    else:
        if body.get("smoothing") == "labels":
            body["smoothing"] = rng.choice(["laplacian", "taubin", "angle", "optimize"])
        if "zip" in formats:
            body["formats"] = [each for each in formats if each != "zip"] or ["stl"]
    if "formats" in body:
        body["formats"] = list(dict.fromkeys(body["formats"]))


class Case:
    """Made from the seed and its number alone."""

    def __init__(self, api, seed, number):
        self.api = api
        self.rng = random.Random(f"{seed}/{number}")
        self.number = number
        is_large = self.rng.random() < LARGE_VOLUMES
        self.volume = Volume(self.rng, is_large)
        self.maker = Maker(api, self.rng, self.volume)
        request = api.named("#/components/schemas/JobRequest")
        self.schema = api.schema(request)
        self.body = self.maker.value(request)
        self.body["volume"] = ""
        self.body.pop("callback", None)  # its addresses are the operator's, not of a schema
        if self.rng.random() < 0.92:
            agree(self.body, self.volume, self.rng)
        self.wrong_field = None
        if self.rng.random() < WRONG_BODIES:
            self.spoil()
        self.in_one = self.wrong_field is None and len(self.body.get("formats", ["drc"])) == 1 and self.rng.random() < IN_ONE_REQUEST

    def spoil(self):
        """Gives one member, maybe of an object within, a value that the schema does not allow."""
        properties = self.schema["properties"]
        name = self.rng.choice([each for each in properties if each not in ("volume", "callback")])
        node = self.api.schema(properties[name])
        inner = node.get("properties")
        if inner and self.rng.random() < 0.7:
            member = self.rng.choice(list(inner))
            value = {**(self.body.get(name) or {}), member: self.maker.wrong(inner[member])}
        else:
            value = self.maker.wrong(node)
        if self.api.faults(value, node):
            self.body[name] = value
            self.wrong_field = name

    def text(self):
        return json.dumps({name: value for name, value in self.body.items() if name != "volume"}, ensure_ascii=True)

    def query(self):
        """The body as the query of POST /v1/mesh; None if it has members that no query has."""
        names = {self.api.resolved(each)["name"] for each in self.api.document["paths"]["/v1/mesh"]["post"]["parameters"]}
        texts = []

        def add(members, node):
            for name, value in members.items():
                schema = self.api.schema(self.api.schema(node)["properties"][name])
                if isinstance(value, dict) and "properties" in schema:
                    if not add(value, schema):
                        return False
                elif schema.get("x-query", name) not in names:
                    return False
                elif value is not None:
                    flat = numpy.ravel(value).tolist() if isinstance(value, list) else [value]
                    text = ",".join(each if isinstance(each, str) else json.dumps(each) for each in flat)
                    texts.append(f"{schema.get('x-query', name)}={quote(text, safe=',')}")
            return True

        members = {name: value for name, value in self.body.items() if name != "volume"}
        return "&".join(texts) if add(members, self.schema) else None


class Runner:
    """Runs cases on one connection. `jobs` has the case of each job."""

    def __init__(self, api, connection, readers):
        self.api = api
        self.connection = connection
        self.readers = readers
        self.jobs = {}

    def ask_json(self, method, target, body=None, headers=()):
        status, answer, _ = self.connection.ask(method, target, body, headers)
        try:
            parsed = json.loads(answer)
        except ValueError as error:
            raise Bad(f"{method} {target.split('?')[0]}: {status} and no JSON: {answer[:500]!r}") from error
        return status, parsed

    def problem(self, status, problem, what):
        """The kind of a problem that names its reason. Anything else is a fault."""
        if status not in REASONS or problem.get("status") != status:
            raise Bad(f"{what}: {status}, {json.dumps(problem)}")
        if faults := self.api.faults(problem, {"$ref": "#/components/schemas/Problem"}):
            raise Bad(f"{what}: {faults}, {json.dumps(problem)}")
        kind = problem["type"].rsplit(":", 1)[1]
        fields = [f"{each['field'].split('.')[0]} {each['message']}" for each in problem.get("errors", [])]
        if not problem["detail"] or (kind == "invalid-parameter" and not fields):
            raise Bad(f"{what} names no reason: {json.dumps(problem)}")
        reason = fields[0] if fields else problem["detail"]
        return f"{what} {status} {kind}: {SPECIFIC.sub('N', reason.split(':')[0])[:90]}"

    def run(self, case):
        """What became of the case, as counts. Throws Bad."""
        query = case.query() if case.in_one else None
        if query is not None:
            return self.run_in_one(case, query)
        status, volume = self.ask_json("POST", f"/v1/volumes?{case.volume.query()}", case.volume.bytes(), RAW)
        if status not in (200, 201):
            return [self.problem(status, volume, "volume")]
        case.body["volume"] = volume["id"]
        status, job = self.ask_json("POST", "/v1/jobs?wait=30", json.dumps(case.body), JSON)
        self.remember(case, job.get("id"))
        if status >= 400:
            kind = self.problem(status, job, "job")
            self.check_names(case, job)
            return [kind]
        if case.wrong_field is not None:
            raise Bad(f"{case.wrong_field} is wrong and was accepted: {status}, {json.dumps(job)}")
        most_ms = JOB_MS + JOB_MS_OF_A_THOUSAND * TRIANGLES_OF_A_SAMPLE * case.volume.samples.size / 1000
        most_s = others_load() * most_ms / 1000
        until = time.monotonic() + most_s
        while job["state"] in ("queued", "running") and time.monotonic() < until:
            _, job = self.ask_json("GET", f"/v1/jobs/{job['id']}?wait=30")
        return self.check_job(case, job)

    def check_names(self, case, problem):
        """A wrong member is named."""
        if case.wrong_field is None:
            return
        fields = [each["field"] for each in problem.get("errors", [])]
        if not any(each == case.wrong_field or each.startswith(case.wrong_field + ".") or each.startswith(case.wrong_field + "[") for each in fields):
            raise Bad(f"{case.wrong_field} is wrong, but the problem does not name it: {json.dumps(problem)}")

    def run_in_one(self, case, query):
        target = f"/v1/mesh?{case.volume.query()}&{query}"
        status, answer, headers = self.connection.ask("POST", target, case.volume.bytes(), RAW)
        if status != 200:
            try:
                problem = json.loads(answer)
            except ValueError as error:
                raise Bad(f"mesh: {status} and no JSON: {answer[:500]!r}") from error
            self.remember(case, headers.get("Location"))
            if problem.get("type", "").endswith(":empty-surface") and not self.ask_json("GET", headers["Location"])[1]["mesh"]["empty"]:
                raise Bad(f"mesh: there is a surface, but {json.dumps(problem)}")
            return [self.problem(status, problem, "mesh")]
        job_path = headers["Location"]
        self.remember(case, job_path)
        _, job = self.ask_json("GET", job_path)
        if job["mesh"]["empty"]:
            raise Bad("mesh: an empty surface that nobody has accepted")
        return self.check_job(case, job, {case.body.get("formats", ["drc"])[0]: answer})

    def remember(self, case, path):
        if path:
            self.jobs[path.rsplit("/", 1)[-1]] = case.number

    def check_job(self, case, job, read=()):
        """A job that has succeeded, with its files, or failed with a reason. `read` has files that are there already."""
        what = f"job {job['id']}"
        if job["state"] == "failed":
            return [self.problem(job["error"]["status"], job["error"], "failed job")]
        if job["state"] != "succeeded":
            self.connection.ask("DELETE", f"/v1/jobs/{job['id']}")  # so that it delays no other case
            raise Bad(f"{what} took too long and is {job['state']} in its stage {job['stage']}")
        # The numbers of a mesh are finite, or JSON has no way to tell them.
        if faults := self.api.faults(job, {"$ref": "#/components/schemas/Job"}):
            raise Bad(f"{what}: {faults}")
        mesh = job["mesh"]
        thousands = max(mesh["triangles"], mesh.get("simplified", {}).get("triangles_before", 0)) / 1000
        certify, taken = job["timing"]["certify"], job["timing"]["total"] - job["timing"]["queue"]
        slowness = others_load()
        if taken > slowness * (JOB_MS + JOB_MS_OF_A_THOUSAND * thousands) or certify > slowness * (STAGE_MS + CERTIFY_MS_OF_A_THOUSAND * thousands):
            raise Bad(f"{what} took too long for {thousands} thousand triangles: {job['timing']}")
        Files(self, job, case.volume).check(dict(read))
        return [f"succeeded {name}" for name in mesh["files"]] + (["succeeded without a triangle"] if mesh["empty"] else [])


def kind_of(error):
    """What a fault of a shorter body must be to count as the same."""
    return SPECIFIC.sub("", str(error))[:80]


def shorten(runner, case, error):
    """Leaves out members of a failed case's body as long as it fails in the same way. Returns the last error."""
    kind = kind_of(error)
    for name in [each for each in case.body if each not in ("volume", "iso", "labels")]:
        value = case.body[name]
        others = [None] + ([[each] for each in value] if isinstance(value, list) and name == "formats" else [])
        for other in others:
            case.body = {**case.body, name: other}
            if other is None:
                del case.body[name]
            try:
                runner.run(case)
            except Bad as again:
                if kind_of(again) == kind:
                    error = again
                    break
            case.body = {**case.body, name: value}
    return error


class Files:
    """The files of one job, against what the job tells of them."""

    def __init__(self, runner, job, volume):
        self.runner = runner
        self.volume = volume
        self.job = job
        self.mesh = job["mesh"]
        self.bounds = numpy.array(self.mesh["bounds"], float)
        self.space = job["parameters"].get("space", "lps")

    def get(self, href):
        status, data, _ = self.runner.connection.ask("GET", href)
        if status != 200:
            raise Bad(f"GET {href}: {status}, {data[:500]!r}")
        return data

    def check(self, read):
        parameters = self.job["parameters"]
        by_labels = "labels" in parameters
        labels = self.labels() if by_labels else []
        for name in read.keys() - self.mesh["files"].keys():  # the one label's, which the ZIP holds, too
            self.check_file(name, read[name], labels[0]["triangles"], labels[0]["vertices"])
        for name, file in self.mesh["files"].items():
            data = read[name] if name in read else self.get(file["href"])
            if len(data) != file["bytes"]:
                raise Bad(f"{name} has {len(data)} bytes, not {file['bytes']}")
            if name == "zip":
                self.check_zip(data, labels)
            elif by_labels:
                self.check_file(name, data, sum(label["triangles"] for label in labels), None)
            else:
                self.check_file(name, data, self.mesh["triangles"], self.mesh["vertices"])

    def labels(self):
        listed = []
        cursor = ""
        while True:
            _, page = self.runner.ask_json("GET", f"/v1/jobs/{self.job['id']}/labels{cursor}")
            listed += page["labels"]
            if page["next"] is None:
                return listed
            cursor = f"?cursor={quote(page['next'])}"

    def check_zip(self, data, labels):
        for label in labels:
            for name, file in label["files"].items():
                self.check_file(name, data[file["offset"] : file["offset"] + file["bytes"]], label["triangles"], label["vertices"])

    def is_exact(self, name):
        """True if the format has the mesh's own vertices, each once."""
        return name in EXACT or (name == "glb" and self.job["parameters"].get("glb_codec") == "none")

    def tolerance(self, name):
        """How far a file's points may lie outside the bounds: by its rounding."""
        rounding = float(numpy.max(numpy.abs(self.bounds))) * 2.0**-21
        if name not in ("drc", "glb") or self.is_exact(name):
            return rounding
        bits = self.job["parameters"]["draco"]["position_bits"]
        # The grid is a cube around the cells that the surface crosses: at most the volume, and two and a half samples more on each side.
        size = float(numpy.linalg.norm((numpy.array(self.volume.dims) + 5) * self.volume.spacing))
        # With max_error_mm the job chooses the bits.
        return rounding + size / 2 ** (7 if self.job["parameters"].get("max_error_mm") is not None else bits)

    def check_file(self, name, data, triangles, vertices):
        try:
            parts = self.runner.readers.read(name, data, self.space)
        except Unreadable as error:
            raise Bad(f"{name} cannot be read: {error}") from error
        for part in parts:
            self.check_part(name, part)
        found = sum(len(part.triangles) for part in parts if part.finest)
        if found != triangles:
            raise Bad(f"{name} has {found} triangles, the job tells {triangles}")
        points = sum(len(part.points) for part in parts if part.finest)
        if self.is_exact(name) and vertices is not None and points != vertices:
            raise Bad(f"{name} has {points} vertices, the job tells {vertices}")

    def check_part(self, name, part):
        for what in ("points", "normals", "distances"):
            values = getattr(part, what)
            if values is None:
                continue
            if not numpy.all(numpy.isfinite(values)):
                raise Bad(f"{name} has {what} that are not finite")
            if len(values) != len(part.points):
                raise Bad(f"{name} has {len(values)} {what} for {len(part.points)} points")
        if part.normals is not None and part.normals.size:
            lengths = numpy.linalg.norm(part.normals.astype(float), axis=1)
            if not numpy.all(numpy.abs(lengths - 1) < 0.05):
                raise Bad(f"{name} has normals of lengths from {lengths.min()} to {lengths.max()}")
        if part.distances is not None and part.distances.size and part.distances.min() < 0:
            raise Bad(f"{name} has the distance {part.distances.min()}")
        if part.triangles.size and (part.triangles.min() < 0 or part.triangles.max() >= len(part.points)):
            raise Bad(f"{name} has an index beyond its {len(part.points)} points")
        if part.points.size:
            slack = self.tolerance(name)
            outside = numpy.max([self.bounds[0] - part.points.min(axis=0), part.points.max(axis=0) - self.bounds[1]])
            if outside > slack:
                raise Bad(f"{name} has a point {outside:g} mm outside the bounds {self.mesh['bounds']}, of which rounding explains {slack:g}")
