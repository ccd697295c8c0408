"""Orthanc: "Mesh this series" in Orthanc Explorer. It orders a mesh from isomesh, which stores it in the study of the series.

A script for Orthanc's Python plugin. It needs nothing but Python's standard library. README.md says how it is installed.
"""

import http.client
import json
import pathlib
import re
import urllib.error
import urllib.parse
import urllib.request

import orthanc

TIMEOUT_S = 10
MOST_BYTES = 1 << 20
UID = re.compile(r"[0-9][0-9.]{0,63}")
CONFIGURATION = json.loads(orthanc.GetConfiguration()).get("Isomesh")


class Failure(Exception):
    """What the page shows: a status and a sentence."""

    def __init__(self, status, detail):
        super().__init__(detail)
        self.status = status


def checked(configuration):
    """The section "Isomesh" of Orthanc's configuration. Raises ValueError if it is wrong."""
    needed, optional = {"Url", "Pacs", "Rules"}, {"Page", "Token"}
    if not isinstance(configuration, dict):
        raise ValueError('isomesh: Orthanc\'s configuration has no section "Isomesh"')
    for name in sorted(needed - set(configuration)):
        raise ValueError(f'isomesh: "Isomesh" needs the key "{name}"')
    for name in sorted(set(configuration) - needed - optional):
        raise ValueError(f'isomesh: "Isomesh" has the unknown key "{name}"')
    for name in sorted(set(configuration) - {"Rules"}):
        if not isinstance(configuration[name], str):
            raise ValueError(f'isomesh: "{name}" must be a text')
    for name in sorted({"Url", "Page"} & set(configuration)):
        if urllib.parse.urlsplit(configuration[name]).scheme not in ("http", "https"):
            raise ValueError(f'isomesh: "{name}" must begin with http:// or https://')
    rules = configuration["Rules"]
    if not isinstance(rules, list) or not rules or not all(isinstance(each, str) for each in rules):
        raise ValueError('isomesh: "Rules" must be a list of names of rules')
    return configuration


class NoRedirects(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_):
        return None


# The token is for isomesh only: not for a proxy of the environment, nor for where a response leads.
DIRECTLY = urllib.request.build_opener(urllib.request.ProxyHandler({}), NoRedirects)


def ask(method, path, body=None):
    """What isomesh answers. Raises Failure with its reason."""
    headers = {"Content-Type": "application/json"} if body is not None else {}
    if CONFIGURATION.get("Token"):
        headers["Authorization"] = "Bearer " + CONFIGURATION["Token"]
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(CONFIGURATION["Url"].rstrip("/") + path, data, headers, method=method)
    try:
        with DIRECTLY.open(request, timeout=TIMEOUT_S) as response:
            return json.loads(response.read(MOST_BYTES))
    except urllib.error.HTTPError as error:
        try:
            detail = str(json.loads(error.read(MOST_BYTES))["detail"])
        except (OSError, ValueError, KeyError, TypeError, http.client.HTTPException):
            detail = f"isomesh answered with status {error.code}"
        # The browser is logged in at Orthanc. It is Orthanc that isomesh does not let in, or leads elsewhere.
        raise Failure(502 if error.code in (401, 403) or error.code < 400 else error.code, detail) from None
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise Failure(502, f"isomesh gave no answer: {getattr(error, 'reason', error)}") from None


def uid_of(path, tag):
    """A UID of a series or study of this Orthanc."""
    try:
        value = json.loads(orthanc.RestApiGet(path))["MainDicomTags"].get(tag, "")
    except orthanc.OrthancException:
        raise Failure(404, "Orthanc has no such series") from None
    if not UID.fullmatch(value):
        raise Failure(400, f"The {tag} of the series is not a UID: only digits and dots are allowed")
    return value


def order(series, request):
    """POST of {"rule": NAME}: orders a mesh of the series by the rule."""
    # Other sites can make a browser send a form, but not JSON.
    if request["headers"].get("content-type", "").split(";")[0] != "application/json":
        raise Failure(415, "The body must be JSON")
    try:
        rule = json.loads(request["body"])["rule"]
    except (ValueError, KeyError, TypeError):
        raise Failure(400, 'The body must be {"rule": NAME}') from None
    if rule not in CONFIGURATION["Rules"]:
        raise Failure(400, 'The rule is not in "Rules" of Orthanc\'s configuration')
    source = {
        "pacs": CONFIGURATION["Pacs"],
        "study": uid_of(f"/series/{series}/study", "StudyInstanceUID"),
        "series": uid_of(f"/series/{series}", "SeriesInstanceUID"),
    }
    return seen(ask("POST", "/v1/orders", {"source": source, "rule": rule}))


def progress_of(job):
    """How far the order's job is, 0 to 1. None if isomesh does not have the job any more."""
    try:
        return ask("GET", "/v1/jobs/" + urllib.parse.quote(job, safe=""))["progress"]
    except Failure as failure:
        if failure.status == 404:
            return None
        raise


def seen(answer):
    """What the page needs of an order."""
    job = answer["job"]
    page = CONFIGURATION.get("Page", CONFIGURATION["Url"]).rstrip("/")
    return {
        "id": answer["id"],
        "state": answer["state"],
        "progress": progress_of(job) if job and answer["state"] == "meshing" else None,
        "error": answer["error"]["detail"] if answer["error"] else None,
        "results": len(answer["results"]),
        "link": f"{page}/#/jobs/{urllib.parse.quote(job, safe='')}" if job else None,
    }


def route(method, handle):
    def answer(output, _, **request):
        if request["method"] != method:
            output.SendMethodNotAllowed(method)
            return
        try:
            status, body = 200, handle(request["groups"][0], request)
        except Failure as failure:
            status, body = failure.status, {"error": str(failure)}
        text = json.dumps(body)
        if status == 200:
            output.AnswerBuffer(text, "application/json")
        else:
            output.SetHttpHeader("Content-Type", "application/json")
            output.SendHttpStatus(status, text, len(text))

    return answer


CONFIGURATION = checked(CONFIGURATION)
orthanc.RegisterRestCallback("/isomesh/series/([0-9a-f-]{44})", route("POST", order))
orthanc.RegisterRestCallback(
    "/isomesh/orders/([A-Za-z0-9_-]{1,64})", route("GET", lambda identity, _: seen(ask("GET", "/v1/orders/" + identity)))
)
PAGE = pathlib.Path(__file__).with_name("isomesh_orthanc.js").read_text(encoding="utf-8")
orthanc.ExtendOrthancExplorer(PAGE.replace("RULES_OF_CONFIGURATION", json.dumps(CONFIGURATION["Rules"])))
