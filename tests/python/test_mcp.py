"""`isomesh mcp`, by a client that speaks the protocol line by line."""

import base64
import contextlib
import http.server
import json
import os
import signal
import socket
import subprocess
import threading
import time
import unittest
from pathlib import Path

import isomesh_client
from isomesh_client.api import JobOptions
from support import DAEMON, DaemonTest, ball

COMMAND = Path(DAEMON).with_name("isomesh")


class OddServer:
    """Answers each request with these bytes, as JSON, and those of `silent` methods never."""

    def __init__(self, body, silent=()):
        self.asked = threading.Event()
        self.over = threading.Event()
        odd = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def answer(self):
                odd.asked.set()
                if self.command in silent:
                    odd.over.wait()
                self.send_response(200)
                self.send_header("Content-Type", "application/json")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                with contextlib.suppress(OSError):
                    self.wfile.write(body)

            do_GET = do_POST = do_DELETE = answer

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.over.set()
        self.server.shutdown()
        self.server.server_close()


class Session:
    """A client of the protocol. `ask` returns the response, `call` the result of a tool."""

    def __init__(self, url, folder):
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ISOMESH")}
        command = [COMMAND, "--server", url, "--retry-seconds", "0", "mcp", "--folder", folder]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        self.number = 0
        self.notifications = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.status = self.process.wait(60)
        self.process.stdout.close()

    def write(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def read(self):
        return json.loads(self.process.stdout.readline())

    def send(self, method, **params):
        self.number += 1
        self.write(json.dumps({"jsonrpc": "2.0", "id": self.number, "method": method, "params": params}))
        return self.number

    def notify(self, method, **params):
        self.write(json.dumps({"jsonrpc": "2.0", "method": method, "params": params}))

    def ask(self, method, **params):
        number = self.send(method, **params)
        while "id" not in (message := self.read()):
            self.notifications.append(message)
        assert message["id"] == number, message
        return message

    def call(self, tool, **arguments):
        return self.ask("tools/call", name=tool, arguments=arguments)["result"]


class Mcp(DaemonTest):
    def setUp(self):
        self.place = self.folder / self._testMethodName
        self.place.mkdir()
        (self.place / "ball.raw").write_bytes(ball().tobytes(order="F"))
        (self.place / "ball.mhd").write_text(
            "ObjectType = Image\nNDims = 3\nDimSize = 40 32 24\nElementSpacing = 1 1 1\nElementType = MET_FLOAT\n"
            "ElementByteOrderMSB = False\nElementDataFile = ball.raw\n"
        )

    def session(self):
        return Session(self.url, self.place)

    def test_from_a_file_to_a_mesh(self):
        with self.session() as client:
            begun = client.ask("initialize", protocolVersion="2025-06-18", capabilities={}, clientInfo={"name": "test"})
            self.assertEqual(begun["result"]["protocolVersion"], "2025-06-18")
            self.assertEqual(set(begun["result"]["capabilities"]), {"tools", "resources"})
            client.notify("notifications/initialized")
            volume = client.call("upload", files=["ball.mhd"])["structuredContent"]
            self.assertEqual(volume["dims"], [40, 32, 24])
            self.assertEqual(client.call("info", volume=volume["id"])["structuredContent"]["range"], volume["range"])
            listed = client.call("volumes")["structuredContent"]["volumes"]
            self.assertIn(volume["id"], [each["id"] for each in listed])
            iso = volume["suggested_iso"]
            made = client.call("mesh", volume=volume["id"], parameters={"iso": iso, "passes": 0}, output=["ball.stl"])
            self.assertFalse(made["isError"])
            job = made["structuredContent"]
            size = 84 + 50 * job["mesh"]["triangles"]
            self.assertEqual((self.place / "ball.stl").stat().st_size, size)
            link = made["content"][1]
            self.assertEqual((link["type"], link["mimeType"], link["size"]), ("resource_link", "model/stl", size))
            self.assertEqual(json.loads(made["content"][0]["text"]), job)
            # The mesh as a resource.
            resources = client.ask("resources/list")["result"]["resources"]
            self.assertIn(link["uri"], [each["uri"] for each in resources])
            (content,) = client.ask("resources/read", uri=link["uri"])["result"]["contents"]
            self.assertEqual(base64.b64decode(content["blob"]), (self.place / "ball.stl").read_bytes())
            self.assertEqual(client.ask("resources/read", uri="isomesh://jobs/no/mesh.stl")["error"]["code"], -32002)
            jobs = client.call("jobs", volume=volume["id"])["structuredContent"]["jobs"]
            self.assertEqual([each["id"] for each in jobs], [job["id"]])
            files = client.call("fetch", job=job["id"], output=["again.stl"])["structuredContent"]["files"]
            self.assertEqual(files, [{"file": "again.stl", "bytes": size}])
        self.assertEqual(client.status, 0)

    def test_an_empty_surface_is_an_error_unless_it_is_allowed(self):
        # Another volume than that of the other tests, which count its jobs.
        text = (self.place / "ball.mhd").read_text()
        (self.place / "wide.mhd").write_text(text.replace("ElementSpacing = 1 1 1", "ElementSpacing = 2 1 1"))
        wanted = {"files": ["wide.mhd"], "parameters": {"iso": 1000}}
        with self.session() as client:
            refused = client.call("mesh", **wanted, output=["none.stl"])
            self.assertTrue(refused["isError"])
            self.assertRegex(refused["content"][0]["text"], "the surface is empty: the iso-value 1000 separates none .*allow_empty accepts")
            job = client.call("jobs")["structuredContent"]["jobs"][0]["id"]
            self.assertTrue(client.call("fetch", job=job, output=["none.stl"])["isError"])
            self.assertFalse((self.place / "none.stl").exists())
            self.assertFalse(client.call("mesh", **wanted, output=["made.stl"], allow_empty=True)["isError"])
            self.assertFalse(client.call("fetch", job=job, output=["fetched.stl"], allow_empty=True)["isError"])
        for name in ("made.stl", "fetched.stl"):
            self.assertEqual((self.place / name).stat().st_size, 84)

    def test_labels_and_masks(self):
        folder = self.place / "masks"
        folder.mkdir()
        for name, planes in (("low", 8), ("high", 16)):
            (folder / f"{name}.raw").write_bytes(bytes(int(z < planes) for z in range(24) for _ in range(40 * 32)))
            text = (self.place / "ball.mhd").read_text().replace("ball.raw", f"{name}.raw")
            (folder / f"{name}.mhd").write_text(text.replace("MET_FLOAT", "MET_UCHAR"))
        with self.session() as client:
            made = client.call("mesh", files=["masks"], masks=True, output=["all.glb"])["structuredContent"]
            names = [each["name"] for each in client.call("labels", job=made["id"])["structuredContent"]["labels"]]
            self.assertEqual(names, ["high", "low"])
            of_volume = client.call("labels", volume=made["volume"])["structuredContent"]["labels"]
            self.assertEqual([each["name"] for each in of_volume], names)
            self.assertEqual((self.place / "all.glb").read_bytes()[:4], b"glTF")

    def test_the_colours_beside_an_obj_replace_no_file_and_stay_in_the_folder(self):
        folder = self.place / "masks"
        folder.mkdir()
        samples = bytes(int(z < 8) for z in range(24) for _ in range(40 * 32))
        (folder / "low.raw").write_bytes(samples)
        text = (self.place / "ball.mhd").read_text().replace("ball.raw", "low.raw")
        (folder / "low.mhd").write_text(text.replace("MET_FLOAT", "MET_UCHAR"))
        (self.place / "left_hip.mtl").write_text("a user's")
        outside = self.folder / "outside.mtl"
        (self.place / "link.mtl").symlink_to(outside)
        with self.session() as client:
            for names, told in (
                (["left hip.obj"], "left hip.obj: its materials left_hip.mtl: exists already"),
                (["link.obj"], "link.mtl: exists already"),
                (["new.obj", "new.OBJ"], "new.OBJ: another output writes new.mtl"),
                (["new.stl", "./new.stl"], "./new.stl: another output writes new.stl"),
            ):
                refused = client.call("mesh", files=["masks"], masks=True, output=names)
                self.assertTrue(refused["isError"])
                self.assertIn(told, refused["content"][0]["text"])
            job = client.call("mesh", files=["masks"], masks=True, output=["new.obj"])["structuredContent"]["id"]
            self.assertIn("newmtl", (self.place / "new.mtl").read_text())
            self.assertTrue(client.call("fetch", job=job, output=["left hip.obj"])["isError"])
            # Without labels there are no colours.
            made = client.call("mesh", files=["ball.mhd"], parameters={"iso": -8}, output=["left hip.obj"])
            self.assertFalse(made["isError"], made)
            (self.place / "other.mtl").write_text("a user's")
            fetched = client.call("fetch", job=made["structuredContent"]["id"], output=["other.obj"])
            self.assertFalse(fetched["isError"], fetched)
        self.assertEqual((self.place / "left_hip.mtl").read_text(), "a user's")
        self.assertFalse(outside.exists())

    def test_schemas_come_from_the_table_of_parameters(self):
        with self.session() as client:
            tools = {each["name"]: each for each in client.ask("tools/list")["result"]["tools"]}
        self.assertEqual(set(tools), {"upload", "volumes", "info", "mesh", "labels", "jobs", "cancel", "fetch"})
        parameters = tools["mesh"]["inputSchema"]["properties"]["parameters"]["properties"]
        self.assertEqual(parameters["passes"]["type"], "integer")
        self.assertEqual(parameters["passes"]["maximum"], 1000)
        self.assertIn("taubin", parameters["smoothing"]["enum"])
        self.assertEqual(parameters["draco"]["properties"]["speed"]["maximum"], 10)
        self.assertEqual({*parameters, "formats", "callback"}, {each.rstrip("_") for each in JobOptions.__annotations__})
        self.assertFalse({"volume", "formats", "callback"} & set(parameters))

    def test_wrong_calls_say_what_helps(self):
        with self.session() as client:
            for arguments, told in (
                ({"files": ["nothing.nii"]}, "nothing.nii"),
                ({"files": ["../secret"]}, "is not in the folder"),
                ({"files": ["/etc/passwd"]}, "is not in the folder"),
                ({"files": "ball.mhd"}, "files: has the wrong type"),
                ({}, "files: must name a file"),
                ({"files": ["ball.mhd"], "volume": "a" * 64}, "files: cannot be given with volume"),
                ({"volume": "a" * 64, "masks": True}, "masks: cannot be given with volume"),
                ({"volume": "a" * 64, "volume_index": 0}, "volume_index: cannot be given with volume"),
                ({"files": ["ball.mhd"], "parameters": {"iso": 1, "formats": ["stl"]}}, "formats: is not one of"),
                ({"files": ["ball.mhd\0.nii"]}, "U+0000"),
                ({"files": ["ball.mhd"], "parameters": {"pases": 1}}, "pases"),
                ({"files": ["ball.mhd"], "parameters": {"iso": 1, "passes": 2000}}, "passes"),
                ({"files": ["ball.mhd"], "file": 1}, "file: is no argument of mesh"),
                ({"files": ["ball.mhd"], "output": ["ball.raw"], "parameters": {"iso": 1}}, "format"),
                ({"files": ["ball.mhd"], "output": ["../ball.stl"], "parameters": {"iso": 1}}, "is not in the folder"),
            ):
                arguments = {"parameters": {"iso": 1}, **arguments}
                result = client.call("mesh", **arguments)
                self.assertTrue(result["isError"], arguments)
                self.assertIn(told, result["content"][0]["text"])
            listed = client.call("jobs", job="a", state="failed")
            self.assertIn("state: cannot be given with job", listed["content"][0]["text"])
            (self.place / "there.stl").write_text("mine")
            again = client.call("mesh", files=["ball.mhd"], parameters={"iso": 1}, output=["there.stl"])
            self.assertIn("exists already", again["content"][0]["text"])
            self.assertEqual((self.place / "there.stl").read_text(), "mine")

    def test_lines_that_are_no_requests(self):
        with self.session() as client:
            for line, code in (
                ("no JSON", -32700),
                ('{"jsonrpc": "2.0", "id": 1, "method": "ping"', -32700),
                ("[]", -32600),
                ('[{"jsonrpc": "2.0", "id": 1, "method": "ping"}]', -32600),
                ('{"id": 1, "method": "ping"}', -32600),
                ('{"jsonrpc": "2.0", "id": null, "method": "ping"}', -32600),
                ('{"jsonrpc": "2.0", "id": {}, "method": "ping"}', -32600),
                ('{"jsonrpc": "2.0", "id": 1}', -32600),
                ('{"jsonrpc": "2.0", "id": 1, "method": 5}', -32602),
                ('{"jsonrpc": "2.0", "id": 1, "method": "ping", "params": []}', -32602),
                ('{"jsonrpc": "2.0", "id": 1, "method": "sampling/createMessage"}', -32601),
                ('{"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": {"name": "rm"}}', -32602),
                ('{"jsonrpc": "2.0", "id": 1, "method": "resources/read", "params": {"uri": 1}}', -32602),
                ("[" * 100000, -32700),
                ('"' + "x" * (1 << 20), -32600),
            ):
                client.write(line)
                response = client.read()
                self.assertEqual(response.get("error", {}).get("code"), code, line[:80])
            deep = "[" * 400000 + "]" * 400000
            client.write('{"jsonrpc": "2.0", "id": 1, "method": "ping", "params": {"a": %s}}' % deep)
            self.assertEqual(client.read()["error"]["code"], -32700)
            # Notifications and responses get no answer.
            client.notify("notifications/initialized")
            client.notify("no/such/thing")
            client.write('{"jsonrpc": "2.0", "id": 7, "result": {}}')
            client.write("")
            self.assertEqual(client.ask("ping")["result"], {})
            old = client.ask("initialize", protocolVersion="1999-01-01")["result"]["protocolVersion"]
            self.assertEqual(old, "2025-06-18")
            # The last line may lack its end.
            client.process.stdin.write('"' + "x" * (1 << 20))
            client.process.stdin.close()
            self.assertEqual(client.read()["error"]["code"], -32600)

    def test_a_cancelled_call_cancels_its_job(self):
        volume = self.client.upload(ball((160, 160, 160), radius=70.0))["id"]
        with self.session() as client:
            arguments = {"volume": volume, "parameters": {"iso": 1, "passes": 1000}}
            number = client.send("tools/call", name="mesh", arguments=arguments)
            while not (jobs := list(self.client.jobs(volume=volume))):
                time.sleep(0.01)
            client.notify("notifications/cancelled", requestId=number)
            self.assertEqual(client.ask("ping")["result"], {})  # the next message: a cancelled request gets none
            self.assertFalse(client.call("volumes")["isError"])
        with self.assertRaises(isomesh_client.JobFailed):
            self.client.wait(jobs[0])
        self.assertEqual(self.client.job(jobs[0])["state"], "cancelled")

    def test_a_call_that_waits_for_a_silent_server_is_cancelled(self):
        with socket.create_server(("127.0.0.1", 0)) as silent:
            with Session(f"http://127.0.0.1:{silent.getsockname()[1]}", self.place) as client:
                numbers = [client.send("tools/call", name="volumes", arguments={}) for _ in range(2)]
                self.assertEqual(client.ask("ping")["result"], {})
                for number in reversed(numbers):
                    client.notify("notifications/cancelled", requestId=number)
                self.assertIn("is empty", client.call("info", volume="")["content"][0]["text"])

    def test_a_server_that_answers_oddly(self):
        deep = b"[" * 400000 + b"]" * 400000
        for body in (b"[]", b"7", b"", b"nonsense", b'{"a": ' + deep + b"}"):
            with OddServer(body) as server, Session(server.url, self.place) as client:
                result = client.call("volumes")
                self.assertTrue(result["isError"])
                self.assertIn("does not match the API", result["content"][0]["text"])
                self.assertEqual(client.ask("ping")["result"], {})

    def test_a_cancelled_call_does_not_wait_long_for_a_silent_server(self):
        with OddServer(b'{"volumes": []}', silent=["POST"]) as server, Session(server.url, self.place) as client:
            arguments = {"volume": "a", "parameters": {"iso": 1}}
            number = client.send("tools/call", name="mesh", arguments=arguments)
            self.assertTrue(server.asked.wait(60))
            client.notify("notifications/cancelled", requestId=number)
            begun = time.monotonic()
            self.assertEqual(client.call("volumes")["structuredContent"], {"volumes": []})
            self.assertLess(time.monotonic() - begun, 60)

    def test_progress_is_told_to_whom_asks(self):
        with self.session() as client:
            arguments = {"files": ["ball.mhd"], "parameters": {"iso": 1, "passes": 3}}
            client.ask("tools/call", name="mesh", arguments=arguments, _meta={"progressToken": 5})
        told = [each["params"] for each in client.notifications]
        self.assertTrue(told)
        self.assertTrue(all(each["progressToken"] == 5 and 0 <= each["progress"] <= 1 for each in told))
        self.assertEqual([each["progress"] for each in told], sorted({each["progress"] for each in told}))

    def test_a_signal_ends_it(self):
        client = self.session()
        client.ask("ping")
        client.process.send_signal(signal.SIGTERM)
        self.assertEqual(client.process.wait(30), -signal.SIGTERM)
        client.process.stdin.close()
        client.process.stdout.close()

    def test_no_server(self):
        with Session("http://127.0.0.1:1", self.place) as client:
            result = client.call("volumes")
            self.assertTrue(result["isError"])
            self.assertEqual(client.ask("ping")["result"], {})


if __name__ == "__main__":
    unittest.main()
