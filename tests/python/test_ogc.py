"""OGC API - Processes (client/ogc), by the text of OGC 18-062r2."""

import importlib.util
import json
import socket
import threading
import urllib.error
import urllib.request
from pathlib import Path

import isomesh_client
import numpy
from support import DaemonTest, FakeServer, ball

FILE = Path(__file__).resolve().parents[2] / "client/ogc/isomesh_ogc.py"
SPEC = importlib.util.spec_from_file_location("isomesh_ogc", FILE)
isomesh_ogc = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(isomesh_ogc)


class Processes(DaemonTest):
    def setUp(self):
        super().setUp()
        self.ogc = isomesh_ogc.serve(0, self.client.server)
        thread = threading.Thread(target=self.ogc.serve_forever)
        thread.start()
        self.addCleanup(lambda: (self.ogc.shutdown(), thread.join(), self.ogc.server_close()))

    def ask(self, path, value=None, method=None):
        """Status, headers and JSON."""
        address = path if path.startswith("http") else f"http://127.0.0.1:{self.ogc.server_port}{path}"
        body = None if value is None else json.dumps(value).encode()
        request = urllib.request.Request(address, body, {"Content-Type": "application/json"}, method=method)
        try:
            response = urllib.request.urlopen(request, timeout=30)
        except urllib.error.HTTPError as error:
            response = error
        with response:
            text = response.read()
            return response.status, response.headers, json.loads(text) if text else None

    def execute(self, form, **parameters):
        volume = self.client.upload(ball())["id"]
        inputs = {"volume": volume, "format": "stl", "parameters": parameters}
        status, headers, job = self.ask("/processes/mesh/execution", {"inputs": inputs, "response": form})
        self.assertEqual((status, job["processID"], job["type"]), (201, "mesh", "process"))
        self.assertTrue(headers["Location"].endswith(f"/jobs/{job['jobID']}"))
        return headers["Location"], job

    def ended(self, location, job):
        self.client.wait(job["jobID"].partition(".")[0])
        return self.ask(location)[2]

    def test_a_mesh_from_the_landing_page_on(self):
        links = {each["rel"].rpartition("/")[2]: each["href"] for each in self.ask("/")[2]["links"]}
        self.assertTrue(any(each.endswith("/conf/core") for each in self.ask(links["conformance"])[2]["conformsTo"]))
        self.assertEqual([each["id"] for each in self.ask(links["processes"])[2]["processes"]], ["mesh"])
        described = self.ask("/processes/mesh")[2]
        self.assertEqual((set(described["inputs"]), set(described["outputs"])), ({"volume", "format", "parameters"}, {"mesh"}))
        location, job = self.execute("document", iso=-8)
        status = self.ended(location, job)
        self.assertEqual((status["status"], status["progress"]), ("successful", 100))
        (results,) = [each["href"] for each in status["links"] if each["rel"].endswith("/results")]
        mesh = self.ask(results)[2]["mesh"]["href"]
        with urllib.request.urlopen(mesh, timeout=30) as response:
            data = response.read()
        self.assertEqual(len(data), 84 + 50 * int.from_bytes(data[80:84], "little"))
        location, job = self.execute("raw", iso=-8)
        self.ended(location, job)
        status, headers, body = self.ask(location + "/results")
        self.assertEqual((status, body), (204, None))
        self.assertRegex(headers["Link"], r'^<http.*mesh\.stl>; rel="mesh"$')

    def test_an_empty_surface_is_told(self):
        location, job = self.execute("document", iso=1000)
        status = self.ended(location, job)
        self.assertEqual(status["status"], "successful")
        self.assertRegex(status["message"], "The surface is empty: the iso-value 1000 separates none")

    def test_labels_have_the_file_of_their_format(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:5, 2:5, 2:5] = 1
        samples[7:10, 7:10, 7:10] = 2
        volume = self.client.upload(samples)["id"]
        for form, end in (("obj", "mesh.obj"), ("glb", "mesh.glb"), ("stl", "mesh.zip")):
            inputs = {"volume": volume, "format": form, "parameters": {"labels": "all"}}
            _, headers, job = self.ask("/processes/mesh/execution", {"inputs": inputs, "response": "document"})
            location = headers["Location"]
            self.ended(location, job)
            mesh = self.ask(location + "/results")[2]["mesh"]["href"]
            self.assertTrue(mesh.endswith(end), mesh)
            with urllib.request.urlopen(mesh, timeout=30) as response:
                self.assertGreater(len(response.read()), 100)

    def test_a_proxy_may_stand_in_front(self):
        self.ogc.url = "https://ogc.example.org"
        self.ogc.names.add("ogc.example.org")
        address = f"http://127.0.0.1:{self.ogc.server_port}/"
        with urllib.request.urlopen(urllib.request.Request(address, headers={"Host": "OGC.example.org:443"}), timeout=30) as response:
            links = json.load(response)["links"]
        self.assertEqual(links[1]["href"], "https://ogc.example.org/conformance")

    def test_a_body_is_no_second_request(self):
        inner = b"GET /conformance HTTP/1.1\r\nHost: localhost\r\n\r\n"
        heads = (f"Content-Length: {len(inner)}", "Transfer-Encoding: chunked", "Content-Length: " + "9" * 5000)
        for head in heads:
            with socket.create_connection(("127.0.0.1", self.ogc.server_port), timeout=30) as connection:
                connection.sendall(f"GET / HTTP/1.1\r\nHost: localhost\r\n{head}\r\n\r\n".encode() + inner)
                connection.shutdown(socket.SHUT_WR)
                answer = b"".join(iter(lambda: connection.recv(65536), b""))
            self.assertEqual(answer.count(b"HTTP/1.1 "), 1)
            self.assertTrue(answer.startswith(b"HTTP/1.1 400 "), answer)

    def test_what_is_wrong_has_the_types_of_the_standard(self):
        for path, kind in (
            ("/processes/other", "no-such-process"),
            ("/jobs/none.raw", "no-such-job"),
            ("/jobs/none.document/results", "no-such-job"),
        ):
            status, headers, problem = self.ask(path)
            self.assertEqual((status, headers["Content-Type"]), (404, "application/problem+json"), path)
            self.assertTrue(problem["type"].endswith(f"/1.0/{kind}"), problem)
        inputs = {"volume": "0" * 64, "format": "stl"}
        for value, word in (({}, "inputs"), ({"inputs": {**inputs, "size": 1}}, "size"), ({"inputs": {"format": "stl"}}, "volume")):
            status, _, problem = self.ask("/processes/mesh/execution", value)
            self.assertEqual(status, 400)
            self.assertIn(word, problem["detail"])
        for more in ({"inputs": {**inputs, "format": "usda"}}, {"outputs": {"other": {}}}, {"outputs": {"mesh": {"transmissionMode": "value"}}}):
            self.assertEqual(self.ask("/processes/mesh/execution", {"inputs": inputs, **more})[0], 400, more)
        volume = self.client.upload(ball())["id"]
        status, _, problem = self.ask("/processes/mesh/execution", {"inputs": {**inputs, "volume": volume, "parameters": {"iso": "high"}}})
        self.assertEqual(status, 400)
        self.assertIn("iso", problem["detail"])

    def test_a_daemon_that_answers_oddly(self):
        problem = {"Content-Type": "application/problem+json"}
        for answer, wanted in (
            ((403, problem, b"[1]"), 403),
            ((403, problem, b'{"title": '), 403),
            ((200, {}, b"[]"), 502),
            ((200, {}, b"<html>"), 502),
            ((302, {"Location": "/elsewhere"}, b""), 502),
        ):
            with self.subTest(answer), FakeServer(lambda *_, answer=answer: answer) as server:
                self.ogc.daemon = server.url
                status, _, said = self.ask("/jobs/one.raw")
                self.assertEqual((status, said["status"]), (wanted, wanted))

    def test_a_dismissed_job_has_no_results(self):
        volume = self.client.upload(numpy.random.default_rng(1).random((128, 128, 96), "float32"))["id"]
        inputs = {"volume": volume, "format": "ply", "parameters": {"iso": 0.5, "passes": 1000}}
        location = self.ask("/processes/mesh/execution", {"inputs": inputs})[1]["Location"]
        status, _, problem = self.ask(location + "/results")
        self.assertEqual((status, problem["type"].rpartition("/")[2]), (404, "result-not-ready"))
        self.assertEqual(self.ask(location, method="DELETE")[0], 200)
        with self.assertRaises(isomesh_client.JobFailed):
            self.client.wait(location.rpartition("/")[2].partition(".")[0])
        self.assertEqual(self.ask(location)[2]["status"], "dismissed")
        self.assertGreaterEqual(self.ask(location + "/results")[0], 400)

    def test_a_host_that_is_none_is_refused(self):
        for host in (b"[", b"]", b"[::1", b"[x]", b"[::::]", b"\xff", b"", b"a@b:c"):
            with self.subTest(host=host), socket.create_connection(("127.0.0.1", self.ogc.server_port), timeout=30) as connection:
                connection.sendall(b"GET / HTTP/1.1\r\nHost: " + host + b"\r\n\r\n")
                answer = b"".join(iter(lambda: connection.recv(65536), b""))
                self.assertTrue(answer.startswith(b"HTTP/1.1 421 "), answer)

    def test_pages_of_other_sites_are_refused(self):
        for headers, wanted in (({"Host": "evil.example"}, 421), ({"Content-Type": "text/plain"}, 415)):
            address = f"http://127.0.0.1:{self.ogc.server_port}/processes/mesh/execution"
            with self.assertRaises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(urllib.request.Request(address, b"{}", {"Content-Type": "application/json", **headers}), timeout=30)
            self.assertEqual(refused.exception.code, wanted)
            refused.exception.close()
