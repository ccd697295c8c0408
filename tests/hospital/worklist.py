"""A worklist by the text of PS3.18, chapter 11 and PS3.4, CC; its faults are set by the tests."""
import http.server
import json
import threading

INPUT, PROCEDURE, OUTPUTS = "00404021", "00404018", "00404033"
TRANSACTION, STATE, PROGRESS, PERFORMED = "00081195", "00741000", "00741002", "00741216"
NEXT = {"SCHEDULED": ("IN PROGRESS",), "IN PROGRESS": ("COMPLETED", "CANCELED")}

# The rule of a daemon that performs workitems.
RULE = """
[[pacs]]
name = "ups"
dicomweb = "http://127.0.0.1:{port}{path}"
timeout-seconds = 10
[[rules]]
name = "mesh"
worklist = "ups"
procedures = ["MESH^99HOSP"]
images = "main"
parameters = {{ iso = 500 }}
send = [ {{ pacs = "main" }}, {{ pacs = "main", format = "sr" }} ]
"""


def value(item, tag):
    return item.get(tag, {}).get("Value", [None])[0]


def sequence(*items):
    return {"vr": "SQ", "Value": list(items)}


def code(text):
    number, scheme, meaning = text.split("^")
    return {"00080100": {"vr": "SH", "Value": [number]},
            "00080102": {"vr": "SH", "Value": [scheme]},
            "00080104": {"vr": "LO", "Value": [meaning]}}


class Worklist:
    def __init__(self):
        self.items = {}  # workitems by UID
        self.secrets = {}  # their transactions
        self.refused = []  # requests that broke a rule
        self.progress = {}  # descriptions by UID, in the order of their coming
        self.claims = {}  # by UID: how often it was claimed
        self.fault = None  # called with (method, path): "before" or "after" breaks the connection
        self.lock = threading.Lock()
        worklist = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do(self):
                length = int(self.headers.get("Content-Length", 0))
                body = self.rfile.read(length)
                fault = worklist.fault and worklist.fault(self.command, self.path)
                if fault == "before":
                    return self.connection.close()
                with worklist.lock:
                    answer = worklist.answer(self.command, self.path, body, self.headers)
                if fault == "after":
                    return self.connection.close()
                status, data = fault if isinstance(fault, tuple) else answer
                self.send_response(status)
                self.send_header("Content-Type", "application/dicom+json")
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            do_GET = do_PUT = do_POST = do

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self):
        self.server.shutdown()
        self.server.server_close()

    def schedule(self, uid, series, procedure="MESH^99HOSP^Mesh of bone", **more):
        self.items[uid] = {
            "00080018": {"vr": "UI", "Value": [uid]}, STATE: {"vr": "CS", "Value": ["SCHEDULED"]},
            "00404041": {"vr": "CS", "Value": ["READY"]}, PROCEDURE: sequence(code(procedure)),
            INPUT: sequence({"0020000D": {"vr": "UI", "Value": [series.study]},
                             "0020000E": {"vr": "UI", "Value": [series.uid]}}), **more}

    def state(self, uid):
        return value(self.items[uid], STATE)

    def answer(self, method, path, body, headers):
        path, _, query = path.partition("?")
        parts = path.strip("/").split("/")
        if parts[0] != "workitems":
            return 404, b""
        if method == "GET" and len(parts) == 1:
            found = [item for item in self.items.values() if value(item, STATE) == "SCHEDULED"]
            offset = int(dict(each.split("=") for each in query.split("&")).get("offset", 0))
            found = found[offset:]
            return (200, json.dumps(found).encode()) if found else (204, b"")
        item = self.items.get(parts[1])
        if item is None:
            return 404, b""
        if method == "GET":
            return 200, json.dumps([item]).encode()
        if headers.get("Content-Type") != "application/dicom+json":
            return 415, b""
        changes, = json.loads(body)
        answer = self.change(parts, method, query, changes, item)
        if answer[0] >= 400:
            self.refused.append((method, path, answer[0]))
        return answer

    def change(self, parts, method, query, changes, item):
        uid, state = parts[1], value(item, STATE)
        if method == "PUT" and parts[2:] == ["state"]:
            wanted, transaction = value(changes, STATE), value(changes, TRANSACTION)
            if not transaction:
                return 400, b""
            if wanted not in NEXT.get(state, ()):
                return 409, b""
            if state == "IN PROGRESS" and transaction != self.secrets[uid]:
                return 400, b""
            if wanted == "COMPLETED" and not self.is_complete(item):
                return 409, b""
            if wanted == "IN PROGRESS":
                self.secrets[uid] = transaction
                self.claims[uid] = self.claims.get(uid, 0) + 1
            item[STATE]["Value"] = [wanted]
            return 200, b""
        if method == "POST" and len(parts) == 2:
            if state != "IN PROGRESS" or query != self.secrets[uid] or STATE in changes:
                return 400, b""
            item.update({tag: each for tag, each in changes.items() if tag != TRANSACTION})
            if PROGRESS in changes:
                self.progress.setdefault(uid, []).append(
                    value(value(changes, PROGRESS), "00741006"))
            return 200, b""
        return 405, b""

    @staticmethod
    def is_complete(item):
        """The attributes that PS3.4, table CC.2.5-3 requires in the final state COMPLETED."""
        performed = value(item, PERFORMED) or {}
        return all(performed.get(tag, {}).get("Value") is not None
                   for tag in ("00404019", "00404028", "00404033", "00404050", "00404051"))
