"""PACS as different vendors build them: Orthanc behind a proxy that answers as their conformance statements say.

Each is a row of the table in docs/hospital.md."""
import dataclasses
import gzip
import json
import re
import threading
import time
import urllib.parse

import peers

JSON = {"Content-Type": "application/dicom+json"}
MORE = {"Warning": '299 pacs "There are 7 additional results that can be requested"'}


@dataclasses.dataclass
class Dialect:
    """What differs from Orthanc."""
    largest_limit: int = None      # a search with a larger limit is answered 400
    largest_page: int = None       # a search returns no more, whatever its limit is
    default_limit: int = 100       # of a search that has none
    offset: bool = True            # False: it is ignored
    matching: bool = True          # False: UIDs in a query are ignored
    warns: bool = False            # a Warning header tells that there are more results
    no_content: bool = False       # 204 if nothing is found
    all_series: int = 200          # the status of a search for series of all studies
    lag: float = 0                 # seconds until a search finds what was stored
    duplicate: int = None          # the reason of 409 for an object that is there
    syntaxes: tuple = ("*", "")    # of Accept, that are not answered 406
    retrieve: str = "plain"        # how a series is sent


AZURE = Dialect(largest_limit=200, no_content=True, duplicate=45070)
GOOGLE = Dialect(no_content=True, warns=True)
AWS = Dialect(all_series=404, lag=4)
DCM4CHEE = Dialect(largest_page=50, warns=True, no_content=True)
KHEOPS = Dialect(all_series=404, warns=True, no_content=True)
DCMJS = Dialect(offset=False, default_limit=10_000)  # dicomweb-server
DICOMCLOUD = Dialect(largest_page=12, syntaxes=("",))
# None of these is one product: a sign of what others may do.
SMALL = Dialect(largest_limit=5)
NO_MATCHING = Dialect(matching=False, largest_page=5)
RELATIONAL_QUERY_REJECTED = Dialect(all_series=400)
SLOW_INDEX = Dialect(lag=4, duplicate=273)


class Proxy(peers.Proxy):
    """A proxy in front of Orthanc that speaks a dialect."""

    def __init__(self, port, dialect):
        self.dialect = dialect
        self.stored = {}  # when, by path of the instance's series
        self.lose_stored = 0  # that many answers to storing are lost
        self.lock = threading.Lock()
        super().__init__(port)

    def answer(self, method, path, headers, body):
        url = urllib.parse.urlsplit(path)
        query = urllib.parse.parse_qsl(url.query)
        if method == "POST":
            return self.store(path, headers, body)
        if url.query:
            return self.search(url.path, query)
        return self.retrieve(path, headers)

    def search(self, path, query):
        dialect = self.dialect
        if path.endswith("/dicom-web/series") and dialect.all_series != 200:
            return dialect.all_series, {}, b""
        options = dict(query)
        if dialect.largest_limit and int(options.get("limit", 0)) > dialect.largest_limit:
            return 400, {"Content-Type": "application/json"}, json.dumps(
                {"errors": {"Limit": [f"The field Limit must be between 1 and {dialect.largest_limit}."]}}).encode()
        dropped = ["limit", "offset"]
        if not dialect.matching:
            dropped += ["StudyInstanceUID", "SeriesInstanceUID", "SOPInstanceUID"]
        kept = urllib.parse.urlencode([(name, value) for name, value in query if name not in dropped])
        status, headers, text = peers.call(self.target, "GET", f"{path}?{kept}")
        if status != 200:
            return status, {}, text
        found = sorted(json.loads(text), key=lambda each: json.dumps(each, sort_keys=True))
        with self.lock:
            now = time.monotonic()
            late = {uid for uid, when in self.stored.items() if now < when + dialect.lag}
        found = [each for each in found if each.get("00080018", {}).get("Value", [""])[0] not in late]
        begin = int(options.get("offset", 0)) if dialect.offset else 0
        page = min(int(options.get("limit", dialect.default_limit)), dialect.largest_page or 10_000)
        more = MORE if dialect.warns and begin + page < len(found) else {}
        found = found[begin:begin + page]
        if not found and dialect.no_content:
            return 204, {}, b""
        return 200, {**JSON, **more}, json.dumps(found).encode()

    def store(self, path, headers, body):
        instance = instance_in(body)
        with self.lock:
            is_there = instance in self.stored
        if is_there and self.dialect.duplicate:
            return 409, JSON, json.dumps({"00081198": {"vr": "SQ", "Value": [{
                "00081155": {"vr": "UI", "Value": [instance]},
                "00081197": {"vr": "US", "Value": [self.dialect.duplicate]}}]}}).encode()
        status, _, text = peers.call(self.target, "POST", path, body, headers)
        with self.lock:
            self.stored.setdefault(instance, time.monotonic())
            self.lose_stored -= 1
            is_lost = self.lose_stored >= 0
        return (lambda connection: False) if is_lost else (status, JSON, text)

    def retrieve(self, path, headers):
        syntax = re.search("transfer-syntax=(.*)", headers["Accept"])
        if (syntax.group(1) if syntax else "") not in self.dialect.syntaxes:
            return 406, {}, b""
        status, found, text = peers.call(self.target, "GET", path, None, headers)
        kind = found.get("Content-Type", "")
        if status != 200:
            return status, {"Content-Type": kind}, text
        return FORMS[self.dialect.retrieve](kind, text)


def instance_in(body):
    at = body.index(b"\x08\x00\x18\x00UI") + 8
    return body[at:at + 64].split(b"\0")[0].split(b"\x08")[0].decode()


def parts_of(kind, text):
    boundary = b"--" + re.search("boundary=(.*?)(;|$)", kind).group(1).strip('"').encode()
    return [part.split(b"\r\n\r\n", 1)[1][:-2] for part in text.split(boundary)[1:-1]]


def joined(parts, line_break):
    body = b"".join(b"--b" + line_break + b"Content-Type: application/dicom" + 2 * line_break + part + line_break
                    for part in parts)
    return body + b"--b--" + line_break


MULTIPART = 'multipart/related; type="application/dicom"; boundary=b'

# How a series is sent: of the Content-Type and the body, the answer.
FORMS = {
    "plain": lambda kind, text: (200, {"Content-Type": kind}, text),
    "gzip": lambda kind, text: (200, {"Content-Type": kind, "Content-Encoding": "gzip"}, gzip.compress(text, 1)),
    "line feeds": lambda kind, text: (200, {"Content-Type": MULTIPART}, joined(parts_of(kind, text), b"\n")),
    "blanks": lambda kind, text: (200, {"Content-Type": MULTIPART.replace("boundary=b", 'boundary = "b"')},
                                  joined(parts_of(kind, text), b"\r\n")),
    "one file": lambda kind, text: (200, {"Content-Type": "application/dicom"}, parts_of(kind, text)[0]),
    "no boundary": lambda kind, text: (200, {"Content-Type": "multipart/related"}, text),
    "zip": lambda kind, text: (200, {"Content-Type": "application/zip"}, b"PK\3\4"),
    "unknown encoding": lambda kind, text: (200, {"Content-Type": kind, "Content-Encoding": "x-unknown"}, text),
}
