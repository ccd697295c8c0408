#!/usr/bin/env python3
"""A small S3 service for tests, that fails as it is told to.

Objects are in memory. Every request's signature is computed anew by botocore, which knows nothing of who
has made it, and so is every body's digest. Listens on a free port of loopback, which the first line of
standard output names. What tests tell it comes by POST /-/..., unsigned:

  /-/fail?what=KIND[&count=N][&method=M][&part=TEXT]   the next N requests (for ever without), or those of
                                               the method whose path and query hold the text, fail so
  /-/put?key=K     the body is an object, whatever it was
  /-/age?key=K&seconds=N                       as if it were older
  /-/reset                                     as at the beginning
  /-/set?page=N&conditions=yes|no              objects a page of a list; whether If-None-Match is known
  /-/keys lists keys; /-/count?method=M&part=TEXT says how many such requests came; /-/uploads how many
  uploads in parts are open

Kinds: status-503 and other numbers, also status-400-CODE; cut: half of the body, then the end; flip: one byte is another; drop: no
answer, the connection ends; hang: no answer for long; forget: answered as if it were stored; ignore-range; more:
bytes behind the object's; late: done, and then no answer.
"""
import datetime
import email.utils
import hashlib
import http.server
import sys
import threading
import time
import urllib.parse
import xml.sax.saxutils

try:
    from botocore.auth import S3SigV4Auth, S3SigV4QueryAuth
    from botocore.awsrequest import AWSRequest
    from botocore.credentials import Credentials
except ImportError:
    print("python3-botocore is missing", flush=True)
    sys.exit(3)

ACCESS, SECRET, REGION, BUCKET = "isomesh-test", "not/a+secret", "eu-test-1", "bucket"
HANG_SECONDS = 30


class State:
    lock = threading.RLock()

    def __init__(self):
        self.objects = {}  # key: (bytes, time of change)
        self.uploads = {}  # id: (key, {number: bytes})
        self.begun = 0  # uploads, also those that have ended
        self.faults = []
        self.requests = []  # (method, target)
        self.page = 1000
        self.conditions = True


state = State()


class Refused(Exception):
    def __init__(self, status, code):
        super().__init__(code)
        self.status, self.code = status, code


def signature_of(auth, request):
    text = auth.string_to_sign(request, auth.canonical_request(request))
    return auth.signature(text, request)


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    wbufsize = -1

    def log_message(self, *arguments):
        pass

    def handle_expect_100(self):
        go_on = super().handle_expect_100()
        self.wfile.flush()  # or the client waits for it
        return go_on

    # --- signatures

    def check_signature(self, body):
        parts = urllib.parse.urlsplit(self.path)
        query = urllib.parse.parse_qs(parts.query, keep_blank_values=True)
        url = "http://" + self.headers["Host"] + self.path
        if "X-Amz-Signature" in query:
            self.check_query(query, url)
            return
        given = self.headers.get("Authorization", "")
        if not given.startswith("AWS4-HMAC-SHA256 "):
            raise Refused(403, "AccessDenied")
        fields = dict(field.strip().split("=", 1) for field in given[17:].split(","))
        signed = fields["SignedHeaders"].split(";")
        stamp = self.headers["X-Amz-Date"]
        if fields["Credential"] != f"{ACCESS}/{stamp[:8]}/{REGION}/s3/aws4_request":
            raise Refused(403, "InvalidAccessKeyId")
        made = datetime.datetime.strptime(stamp, "%Y%m%dT%H%M%SZ")
        if abs((datetime.datetime.utcnow() - made).total_seconds()) > 900:
            raise Refused(403, "RequestTimeTooSkewed")
        for name in self.headers:
            if name.lower().startswith("x-amz-") and name.lower() not in signed:
                raise Refused(403, "AccessDenied")
        request = AWSRequest(method=self.command, url=url,
                             headers={name: self.headers[name] for name in signed if name != "host"})
        request.context["timestamp"] = stamp
        expected = signature_of(S3SigV4Auth(Credentials(ACCESS, SECRET), "s3", REGION), request)
        if "host" not in signed or fields["Signature"] != expected:
            raise Refused(403, "SignatureDoesNotMatch")
        if hashlib.sha256(body).hexdigest() != self.headers["x-amz-content-sha256"]:
            raise Refused(400, "XAmzContentSHA256Mismatch")

    def check_query(self, query, url):
        stamp = query["X-Amz-Date"][0]
        bare, given = url.split("&X-Amz-Signature=")
        request = AWSRequest(method=self.command, url=bare)
        request.context["timestamp"] = stamp
        auth = S3SigV4QueryAuth(Credentials(ACCESS, SECRET), "s3", REGION)
        if signature_of(auth, request) != given:
            raise Refused(403, "SignatureDoesNotMatch")
        made = datetime.datetime.strptime(stamp, "%Y%m%dT%H%M%SZ")
        age = (datetime.datetime.utcnow() - made).total_seconds()
        if age > int(query["X-Amz-Expires"][0]):
            raise Refused(403, "AccessDenied")

    # --- answers

    def answer(self, status, body=b"", headers=None, fault=None):
        self.send_response(status)
        headers = headers or {}
        if fault == "more":
            body += b"more"
        length = headers.pop("Content-Length", str(len(body)))
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", length)
        self.end_headers()
        if self.command == "HEAD":
            return
        if fault == "cut":
            self.wfile.write(body[:len(body) // 2])
            self.wfile.flush()
            self.close_connection = True
            self.connection.shutdown(2)
            return
        if fault == "flip" and body:
            body = bytes([body[0] ^ 1]) + body[1:]
        self.wfile.write(body)

    def answer_xml(self, text, status=200):
        self.answer(status, b'<?xml version="1.0" encoding="UTF-8"?>\n' + text.encode(),
                    {"Content-Type": "application/xml"})

    def refuse(self, status, code):
        self.answer_xml(f"<Error><Code>{code}</Code><Message>{code}</Message></Error>", status)

    # --- what tests say

    def take_fault(self):
        with state.lock:
            state.requests.append((self.command, self.path))
            for fault in state.faults:
                if fault["method"] not in ("", self.command) or fault["part"] not in self.path:
                    continue
                if fault["count"] is not None:
                    fault["count"] -= 1
                    if fault["count"] == 0:
                        state.faults.remove(fault)
                return fault["what"]
        return None

    def tell(self, body):
        parts = urllib.parse.urlsplit(self.path)
        query = {k: v[0] for k, v in urllib.parse.parse_qs(parts.query).items()}
        with state.lock:
            if parts.path == "/-/reset":
                state.__init__()
            elif parts.path == "/-/fail":
                state.faults = [] if query["what"] == "nothing" else state.faults + [{
                    "what": query["what"], "method": query.get("method", ""),
                    "part": query.get("part", ""),
                    "count": int(query["count"]) if "count" in query else None}]
            elif parts.path == "/-/put":
                state.objects[query["key"]] = (body, time.time())
            elif parts.path == "/-/age":
                content, changed = state.objects[query["key"]]
                state.objects[query["key"]] = (content, changed - float(query["seconds"]))
            elif parts.path == "/-/set":
                state.page = int(query.get("page", state.page))
                state.conditions = query.get("conditions", "yes") == "yes"
            text = ""
            if parts.path == "/-/keys":
                text = "".join(key + "\n" for key in sorted(state.objects))
            elif parts.path == "/-/count":
                text = str(sum(1 for method, target in state.requests
                               if query.get("method", "") in ("", method)
                               and query.get("part", "") in target))
            elif parts.path == "/-/uploads":
                text = str(len(state.uploads))
        self.answer(200, text.encode())

    # --- S3

    def handle_any(self):
        length = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(length)
        if len(body) < length:
            self.close_connection = True
            return
        if self.path.startswith("/-/"):
            self.tell(body)
            return
        fault = self.take_fault()
        if fault == "drop":
            self.close_connection = True
            self.connection.shutdown(2)
            return
        if fault == "hang":
            time.sleep(HANG_SECONDS)
            self.close_connection = True
            return
        if fault and fault.startswith("status-"):
            status, _, code = fault[7:].partition("-")
            self.refuse(int(status), code or "Told")
            return
        try:
            self.check_signature(body)
            self.serve(body, fault)
        except Refused as refused:
            self.refuse(refused.status, refused.code)

    do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = handle_any

    def serve(self, body, fault):
        parts = urllib.parse.urlsplit(self.path)
        query = {k: v[0] for k, v in
                 urllib.parse.parse_qs(parts.query, keep_blank_values=True).items()}
        place = urllib.parse.unquote(parts.path).split("/", 2)
        if place[1] != BUCKET:
            raise Refused(404, "NoSuchBucket")
        key = place[2] if len(place) > 2 else ""
        if not key:
            self.list_objects(query)
        elif self.command in ("GET", "HEAD"):
            self.get(key, query, fault)
        elif self.command == "PUT":
            self.put(key, query, body, fault)
        elif self.command == "POST":
            self.post(key, query, body)
        else:
            with state.lock:
                if "uploadId" in query:
                    state.uploads.pop(query["uploadId"], None)
                elif fault != "forget":
                    state.objects.pop(key, None)
            if fault == "late":
                self.close_connection = True
                self.connection.shutdown(2)
                return
            self.send_response(204)
            self.end_headers()

    def list_objects(self, query):
        prefix = query.get("prefix", "")
        with state.lock:
            keys = sorted(key for key in state.objects if key.startswith(prefix))
            keys = [key for key in keys if key > query.get("start-after", "")]
            most = min(state.page, int(query.get("max-keys", 1000)))
            shown = [(key, *state.objects[key]) for key in keys[:most]]
        text = "".join(
            "<Contents><Key>%s</Key><LastModified>%s</LastModified><Size>%d</Size></Contents>" % (
                xml.sax.saxutils.escape(key),
                datetime.datetime.utcfromtimestamp(changed).strftime("%Y-%m-%dT%H:%M:%S.000Z"),
                len(content)) for key, content, changed in shown)
        rest = len(keys) > most
        self.answer_xml('<ListBucketResult xmlns="http://s3.amazonaws.com/doc/2006-03-01/">'
                        f"<IsTruncated>{'true' if rest else 'false'}</IsTruncated>{text}"
                        "</ListBucketResult>")

    def get(self, key, query, fault):
        with state.lock:
            found = state.objects.get(key)
        if found is None:
            raise Refused(404, "NoSuchKey")
        content, changed = found
        headers = {"Last-Modified": email.utils.formatdate(changed, usegmt=True),
                   "ETag": '"%s"' % hashlib.md5(content).hexdigest()}
        if "response-content-type" in query:
            headers["Content-Type"] = query["response-content-type"]
        if "response-content-disposition" in query:
            headers["Content-Disposition"] = query["response-content-disposition"]
        if self.command == "HEAD":
            headers["Content-Length"] = str(len(content))
        asked = self.headers.get("Range", "")
        if asked and fault != "ignore-range":
            first = int(asked.removeprefix("bytes=").split("-")[0])
            headers["Content-Range"] = f"bytes {first}-{len(content) - 1}/{len(content)}"
            self.answer(206, content[first:], headers, fault)
        else:
            self.answer(200, content, headers, fault)

    def put(self, key, query, body, fault):
        with state.lock:
            if self.headers.get("If-None-Match") == "*":
                if not state.conditions:
                    raise Refused(501, "NotImplemented")
                if key in state.objects:
                    raise Refused(412, "PreconditionFailed")
            if "uploadId" in query:
                if query["uploadId"] not in state.uploads:
                    raise Refused(404, "NoSuchUpload")
                state.uploads[query["uploadId"]][1][int(query["partNumber"])] = body
            elif fault != "forget":
                state.objects[key] = (body, time.time())
        if fault == "late":
            self.close_connection = True
            self.connection.shutdown(2)
            return
        self.answer(200, b"", {"ETag": '"%s"' % hashlib.md5(body).hexdigest()})

    def post(self, key, query, body):
        if "uploads" in query:
            with state.lock:
                state.begun += 1
                number = "upload~%d/=" % state.begun
                state.uploads[number] = (key, {})
            self.answer_xml("<InitiateMultipartUploadResult><UploadId>%s</UploadId>"
                            "</InitiateMultipartUploadResult>" % number)
            return
        with state.lock:
            if query["uploadId"] not in state.uploads:
                raise Refused(404, "NoSuchUpload")
            _, pieces = state.uploads.pop(query["uploadId"])
            numbers = sorted(pieces)
            for number in numbers:
                tag = hashlib.md5(pieces[number]).hexdigest()
                named = f'<PartNumber>{number}</PartNumber><ETag>"{tag}"</ETag>'
                if named.encode() not in body:
                    self.answer_xml("<Error><Code>InvalidPart</Code></Error>")  # with status 200
                    return
            state.objects[key] = (b"".join(pieces[number] for number in numbers), time.time())
        self.answer_xml("<CompleteMultipartUploadResult><Key>k</Key></CompleteMultipartUploadResult>")


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 128


if __name__ == "__main__":
    server = Server(("127.0.0.1", 0), Handler)
    print(f"http://127.0.0.1:{server.server_address[1]}", flush=True)
    server.serve_forever()
