"""Files, jobs, errors and broken connections."""

import json
import os
import re
import subprocess
import signal
import threading
import time
import unittest
import urllib.request
from unittest import mock

import isomesh_client
import numpy
from isomesh_client.transport import Transport
from support import DAEMON, Canned, DaemonTest, Relay, UploadRelay, ball


class Files(DaemonTest):
    options = ("--max-upload", "2000000")

    def write_meta_image(self, folder, element, names):
        """The ball as a header and its data in those files."""
        folder.mkdir(exist_ok=True)
        data = ball().tobytes(order="F")
        piece = len(data) // len(names)
        for number, name in enumerate(names):
            (folder / name).write_bytes(data[number * piece : (number + 1) * piece])
        header = folder / "ball.mhd"
        header.write_text(
            "ObjectType = Image\nNDims = 3\nDimSize = 40 32 24\nElementSpacing = 1 1 1\nElementType = MET_FLOAT\n"
            f"ElementByteOrderMSB = False\nElementDataFile = {element}\n"
        )
        return header

    def test_all_ways_to_send_the_same_samples(self):
        wanted = self.client.upload(ball())["id"]
        one = self.write_meta_image(self.folder / "one", "ball.raw", ["ball.raw"])
        planes = [f"plane{n:02}.raw" for n in range(24)]
        many = self.write_meta_image(self.folder / "many", "plane%02d.raw 0 23 1", planes)
        listed = self.write_meta_image(self.folder / "list", "LIST\n" + "\n".join(planes), planes)
        for name in (".hidden", "README.txt", "report.pdf", "Thumbs.db", "empty"):
            (self.folder / "one" / name).write_bytes(b"nothing of the volume" if name != "empty" else b"")
        bare = isomesh_client.Raw((40, 32, 24), "float32")
        for source, more in (
            (one, {}),
            (str(many), {}),
            (listed, {}),
            (self.folder / "one", {}),
            ([one, one.with_name("ball.raw")], {}),
            (one.with_name("ball.raw"), {"raw": bare}),
            (ball().tobytes(order="F"), {"raw": bare}),
            (ball().astype(">f4").tobytes(order="F"), {"raw": isomesh_client.Raw((40, 32, 24), "float32", big_endian=True)}),
        ):
            with self.subTest(source=str(source)[:60]):
                self.assertEqual(self.client.upload(source, **more)["id"], wanted)

    def test_several_volumes(self):
        folder = self.folder / "several"
        folder.mkdir()
        for name, radius in (("a", 3), ("b", 5)):
            header = self.write_meta_image(self.folder / f"only {name}", "ball.raw", ["ball.raw"])
            header.rename(folder / f"{name}.mhd")
            text = (folder / f"{name}.mhd").read_text().replace("ball.raw", f"{name}.raw")
            (folder / f"{name}.mhd").write_text(text)
            (folder / f"{name}.raw").write_bytes((ball() + radius).tobytes(order="F"))
        answers = self.client.upload_all(folder)
        self.assertEqual([each["member"] for each in answers], ["a.mhd", "b.mhd"])
        self.assertTrue(all(each["volume"] for each in answers))
        with self.assertRaisesRegex(isomesh_client.Refused, "member='a.mhd': can be meshed") as refused:
            self.client.upload(folder)
        self.assertEqual(len(refused.exception.choices), 2)
        chosen = self.client.upload(folder, member="b.mhd", name="the second")
        self.assertEqual(chosen["id"], answers[1]["volume"]["id"])
        self.assertEqual(chosen["name"], "the second")

    def test_a_folder_of_masks_is_one_volume_of_labels(self):
        folder = self.folder / "masks"
        folder.mkdir()
        for name, at in (("liver", 6), ("aorta", 14)):
            mask = numpy.zeros((20, 12, 12), "uint8")
            mask[at - 3 : at + 3, 3:9, 3:9] = 1
            header = self.write_meta_image(folder, f"{name}.raw", [f"{name}.raw"])
            text = header.read_text().replace("40 32 24", "20 12 12").replace("MET_FLOAT", "MET_UCHAR")
            header.rename(folder / f"{name}.mhd").write_text(text)
            (folder / f"{name}.raw").write_bytes(mask.tobytes(order="F"))
        mesh = self.client.mesh(folder, masks=True, close=True)
        labels = [(each["label"], each["name"]) for each in mesh.job["mesh"]["labels"]]
        self.assertEqual(labels, [(1, "aorta"), (2, "liver")])
        (result,) = self.client.mesh_all([folder], to=self.folder / "all.glb", masks=True, close=True)
        self.assertEqual(len(result.job["mesh"]["labels"]), 2)
        (folder / "liver.raw").write_bytes(bytes(range(240)) * 12)
        with self.assertRaisesRegex(isomesh_client.Refused, '"liver.mhd": It is not a mask'):
            self.client.mesh(folder, masks=True)

    def test_links_in_a_folder_are_followed(self):
        folder = self.folder / "dataset" / "sub"
        objects = self.folder / "dataset" / ".git"
        for each in (folder, objects):
            each.mkdir(parents=True)
        self.write_meta_image(objects, "ball.raw", ["ball.raw"])
        for name in ("ball.mhd", "ball.raw"):
            (folder / name).symlink_to(f"../.git/{name}")
        volume = self.client.upload(folder)
        self.assertEqual(self.client.upload(folder.parent)["id"], volume["id"])
        (folder / "up").symlink_to("..")
        with self.assertRaisesRegex(ValueError, "up/sub leads back to a folder"):
            self.client.upload(folder)
        (folder / "up").unlink()
        (folder / ".#notes").symlink_to("someone@host.1234:5678")  # as Emacs marks a file that is open
        self.assertEqual(self.client.upload(folder)["id"], volume["id"])
        (folder / "gone").symlink_to("absent")
        with self.assertRaisesRegex(FileNotFoundError, "gone is a link to a file that is not there"):
            self.client.upload(folder)

    def test_an_upload_that_is_too_large_is_refused_with_the_reason(self):
        with self.assertRaises(isomesh_client.Refused) as refused:
            self.client.upload(numpy.zeros((200, 200, 200)))
        self.assertEqual(refused.exception.status, 413)

    def test_names_lists_and_erasing(self):
        volume = self.client.upload(ball() * 2, name="Größe 1")
        self.assertEqual(volume["name"], "Größe 1")
        self.assertEqual(self.client.rename(volume, "knee")["name"], "knee")
        self.assertIn(volume["id"], [each["id"] for each in self.client.volumes()])
        self.assertEqual(sum(self.client.histogram(volume, 16)["counts"]), 40 * 32 * 24)
        self.client.erase(volume)
        with self.assertRaises(isomesh_client.Refused) as refused:
            self.client.volume(volume)
        self.assertEqual(refused.exception.status, 404)

    def test_erasing_takes_the_meshes(self):
        volume = self.client.upload(ball() * 3)
        first, second = (self.client.wait(self.client.submit(volume, iso=iso)) for iso in (-12, -9))
        self.assertEqual([each["id"] for each in self.client.jobs(volume=volume)], [second["id"], first["id"]])
        self.assertEqual(list(self.client.jobs(volume=volume, until="2020-01-01")), [])
        self.assertEqual(self.client.report(first)["volume"]["id"], volume["id"])
        self.client.erase_job(first)
        self.assert_is_gone(first)
        self.client.erase(volume, jobs=True)
        self.assert_is_gone(second)

    def assert_is_gone(self, job):
        with self.assertRaises(isomesh_client.Refused) as refused:
            self.client.job(job)
        self.assertEqual(refused.exception.status, 404)


class Jobs(DaemonTest):
    def test_step_by_step(self):
        volume = self.client.upload(ball())
        estimate = self.client.estimate(volume, iso=-8, formats=["stl"], components={"keep": 1}, close=True)
        job = self.client.submit(
            volume, iso=-8, formats=["stl", "glb"], lambda_=0.5, idempotency_key="once",
            components={"keep": 1}, close=True,
        )
        self.assertEqual(job["parameters"]["lambda"], 0.5)
        seen = []
        done = self.client.wait(job, progress=lambda each: seen.append(each["state"]))
        self.assertEqual(seen[-1], "succeeded")
        self.assertEqual(done["mesh"]["triangles"], estimate["triangles"])
        again = self.client.submit(
            volume["id"], iso=-8, formats=["stl", "glb"], **{"lambda": 0.5}, idempotency_key="once",
            components={"keep": 1}, close=True,
        )
        self.assertEqual(again["id"], job["id"])
        path = self.client.download(done["id"], self.folder / "ball.STL")
        self.assertEqual(path.stat().st_size, estimate["bytes"]["stl"])
        self.assertEqual(path.stat().st_mode & 0o777, 0o666 & ~self.mask())
        self.assertEqual((self.client.download(job["id"], self.folder / "b.glb")).read_bytes()[:4], b"glTF")
        self.assertIn(job["id"], [each["id"] for each in self.client.jobs("succeeded")])
        with self.assertRaisesRegex(ValueError, "no file of the format 'obj'; it has stl, glb|glb, stl"):
            self.client.download(done, self.folder / "ball.obj")
        with self.assertRaisesRegex(ValueError, "'ply'"):
            self.client.fetch(done)

    def test_a_file_that_is_replaced_keeps_its_mode(self):
        job = self.client.wait(self.client.submit(self.client.upload(ball()), iso=-8, formats=["stl"]))
        path = self.folder / "secret.stl"
        for mode in (0o600, 0o640):
            path.write_bytes(b"old")
            path.chmod(mode)
            self.client.download(job, path)
            self.assertEqual(path.stat().st_mode & 0o777, mode)
            self.assertGreater(path.stat().st_size, 84)

    @staticmethod
    def mask():
        mask = os.umask(0)
        os.umask(mask)
        return mask

    def test_numbers_of_numpy_are_numbers(self):
        volume = self.client.upload(ball())
        passes = numpy.arange(4)[3]
        job = self.client.submit(volume, iso=numpy.float32(-8), passes=passes, close=numpy.bool_(True))
        parameters = job["parameters"]
        self.assertEqual((parameters["iso"], parameters["passes"], parameters["close"]), (-8, 3, True))

    def test_labels_one_by_one(self):
        samples = numpy.zeros((8, 8, 8), "uint8")
        samples[2:4, 2:6, 2:6], samples[4:6, 2:6, 2:6] = 1, 2
        job = self.client.wait(self.client.submit(self.client.upload(samples), labels=[1, 2], formats=["stl"]))
        sizes = [self.client.download(job, self.folder / f"{n}.stl", label=n).stat().st_size for n in (1, 2)]
        self.assertEqual(sizes, [84 + 50 * each["triangles"] for each in job["mesh"]["labels"]])
        with self.assertRaisesRegex(ValueError, "of the label 9"):
            self.client.download(job, self.folder / "9.stl", label=9)

    def test_many_labels_are_listed_in_pages(self):
        samples = numpy.arange(343, dtype="uint16").reshape(7, 7, 7)
        volume = self.client.upload(samples)
        listed = self.client.labels(volume, background=7)
        self.assertEqual([each["label"] for each in listed["labels"]], [n for n in range(343) if n != 7])
        self.assertEqual((listed["volume"], listed["background"]), (volume["id"], 7))
        job = self.client.wait(self.client.submit(volume, labels="all", formats=["stl"]))
        self.assertNotIn("labels", job["mesh"])
        self.assertEqual(job["mesh"]["labels_count"], 342)
        labels = list(self.client.job_labels(job))
        self.assertEqual([each["label"] for each in labels], list(range(1, 343)))
        walls = list(self.client.job_walls(job))
        self.assertEqual(len(walls), job["mesh"]["walls_count"])
        self.assertTrue(all(each["faces"] > 0 for each in walls))
        at_edges = [each for each in self.client.job_walls(job, edge_contacts=True) if each["faces"] == 0]
        self.assertEqual(len(at_edges), job["mesh"]["edge_contacts_count"])
        self.assertGreater(len(at_edges), 0)
        touching = {each[side] for each in walls for side in "ab"}
        self.assertEqual(touching, {None, *range(1, 343)})
        size = self.client.download(job, self.folder / "300.stl", label=300).stat().st_size
        self.assertEqual(size, 84 + 50 * labels[299]["triangles"])
        with self.assertRaisesRegex(ValueError, "of the label 999"):
            self.client.download(job, self.folder / "999.stl", label=999)

    def test_parameters_that_are_wrong_are_named(self):
        volume = self.client.upload(ball())
        for parameters, text in (
            ({"iso": 1, "passes": 1001}, "passes"),
            ({}, "iso"),
            ({"iso": float("nan")}, "cannot be sent"),
            ({"iso": 1, "formats": ["fbx"]}, "fbx|formats"),
        ):
            with self.subTest(text), self.assertRaisesRegex((isomesh_client.Refused, ValueError), text):
                self.client.submit(volume, **parameters)

    def test_an_unknown_parameter_is_rejected_before_the_upload(self):
        unreachable = isomesh_client.Client("http://127.0.0.1:1")
        for call in (unreachable.mesh, unreachable.submit, unreachable.estimate):
            with self.assertRaisesRegex(TypeError, f"{call.__name__}.. has no parameter 'pases'; did you mean 'passes'"):
                call("x", iso=1, pases=3)
        with self.assertRaisesRegex(TypeError, r"formats must be a list: formats=\['glb'\]"):
            unreachable.mesh("x", iso=1, formats="glb")

    def test_the_parameters_of_a_job_start_it_again(self):
        volume = self.client.upload(ball())
        parameters = {**self.client.submit(volume, iso=-8, passes=3, lambda_=0.5)["parameters"]}
        del parameters["volume"]
        again = self.client.submit(volume, **parameters)
        self.assertEqual(again["parameters"], {"volume": volume["id"], **parameters})

    def test_a_cancelled_job_fails_whoever_waits(self):
        volume = self.client.upload(numpy.random.default_rng(1).random((128, 128, 96), "float32"))
        job = self.client.submit(volume, iso=0.5, passes=1000, formats=["ply"])
        with self.assertRaises(TimeoutError):
            self.client.wait(job, timeout=0.3)
        self.client.cancel(job)
        with self.assertRaisesRegex(isomesh_client.JobFailed, "cancelled") as failed:
            self.client.wait(job)
        self.assertEqual(failed.exception.job["state"], "cancelled")
        with self.assertRaises(isomesh_client.JobFailed):
            self.client.fetch(job["id"])

    def test_an_upload_in_one_call_may_be_described(self):
        mesh = self.client.mesh(ball(), iso=-5, name="from mesh", spacing=(1, 1, 3))
        self.assertEqual(self.client.volume(mesh.job["parameters"]["volume"])["name"], "from mesh")

    def made(self, before):
        return [job for job in isomesh_client.Client(self.url).jobs() if job["id"] not in before]

    def assert_the_one_job_is_cancelled(self, before):
        (interrupted,) = self.made(before)
        with self.assertRaisesRegex(isomesh_client.JobFailed, "cancelled"):
            self.client.wait(interrupted)

    def test_an_interrupt_cancels_the_job(self):
        noise = numpy.random.default_rng(2).random((128, 128, 96), "float32")
        before = {job["id"] for job in self.client.jobs()}
        taken = threading.Event()

        def interrupt():
            # As soon as it is there: its response may still be on the way.
            while not self.made(before):
                time.sleep(0.05)
            # Python sees a signal that comes just before it begins to wait for bytes only once they are there.
            while not taken.is_set():
                os.kill(os.getpid(), signal.SIGINT)
                taken.wait(10)

        threading.Thread(target=interrupt, daemon=True).start()
        with self.assertRaises(KeyboardInterrupt):
            self.client.mesh(noise, iso=0.5, passes=1000)
        taken.set()
        self.assert_the_one_job_is_cancelled(before)

    def test_an_interrupt_of_its_response_cancels_the_job(self):
        noise = numpy.random.default_rng(3).random((128, 128, 96), "float32")
        before = {job["id"] for job in self.client.jobs()}
        send = self.client._exchange.send_json
        interrupts = [KeyboardInterrupt]

        def interrupted(*arguments):
            answer = send(*arguments)
            while interrupts:
                raise interrupts.pop()
            return answer

        with mock.patch.object(self.client._exchange, "send_json", interrupted):
            with self.assertRaises(KeyboardInterrupt):
                self.client.mesh(noise, iso=0.5, passes=1000)
        self.assert_the_one_job_is_cancelled(before)

    def test_a_client_serves_several_threads(self):
        volume = self.client.upload(ball())
        sizes = {}

        def mesh(iso):
            job = self.client.submit(volume, iso=iso, formats=["ply"])
            sizes[iso] = len(self.client.fetch(self.client.wait(job)).faces)

        threads = [threading.Thread(target=mesh, args=(-radius,)) for radius in (3, 5, 7, 9)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(sorted(sizes, key=sizes.get), [-3, -5, -7, -9])


class Connections(DaemonTest):
    def test_a_broken_download_goes_on_where_it_broke(self):
        mesh = self.client.mesh(ball((64, 64, 64), radius=20), iso=-20)
        size = mesh.job["mesh"]["files"]["ply"]["bytes"]
        self.assertGreater(size, 200_000)
        with Relay(self.url, cuts=2, after=100_000) as relay:
            again = isomesh_client.Client(relay.url).fetch(mesh.job)
        self.assertTrue(numpy.array_equal(again.vertices, mesh.vertices))
        requests = [each for each in relay.requests if b"mesh.ply" in each]
        self.assertNotIn(b"Range:", requests[0])
        self.assertRegex(requests[1], rb"Range: bytes=\d{5}")
        self.assertEqual(len(requests), 3)

    def test_an_obj_names_its_materials_if_it_breaks_in_its_head(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:6, 2:10, 2:10] = 3
        job = self.client.mesh(samples, labels="all", formats=["obj"]).job
        whole = self.client.download(job, self.folder / "a.obj").read_bytes()
        with Relay(self.url, cuts=0, after=0) as relay:
            head = urllib.request.urlopen(f"{relay.url}/v1/jobs/{job['id']}/mesh.obj")
            sizes = len(f"HTTP/1.1 200 OK\r\n{head.headers}".replace("\r\n", "\n").replace("\n", "\r\n"))
        with Relay(self.url, cuts=2, after=sizes + 40) as relay:
            target = isomesh_client.Client(relay.url).download(job, self.folder / "left hip.obj")
        starts = [re.search(rb"Range: bytes=(\d+)-", each) for each in relay.requests if b"mesh.obj" in each]
        self.assertEqual(len(starts), 3)
        self.assertLess(int(starts[1][1]), 100)
        self.assertEqual(target.read_bytes(), whole.replace(b"mtllib a.mtl", b"mtllib left_hip.mtl"))
        self.assertIn("newmtl label_3", (self.folder / "left_hip.mtl").read_text())

    def test_a_connection_that_breaks_each_time_is_given_up(self):
        job = self.client.mesh(ball(), iso=-8).job
        target = self.folder / "never.ply"
        with Relay(self.url, cuts=100, after=1000) as relay, self.assertRaises(isomesh_client.Unreachable):
            isomesh_client.Client(relay.url).download(job, target)
        self.assertEqual([each.name for each in self.folder.iterdir() if "never" in each.name], [])

    def test_a_broken_upload_goes_on_where_it_broke(self):
        samples = numpy.random.default_rng(1).integers(0, 100, (256, 256, 160), dtype=numpy.uint8)
        with UploadRelay(self.url, cuts=2, after=3_000_000) as relay:
            volume = isomesh_client.Client(relay.url).upload(samples)
        self.assertEqual(volume["id"], self.client.upload(samples)["id"])
        methods = [each.split()[0] for each in relay.requests]
        self.assertEqual(methods, ["POST", "PATCH", "HEAD", "PATCH", "HEAD", "PATCH"])

    def test_an_interrupt_of_its_response_names_the_volume_that_is_stored(self):
        send = Transport.send

        def interrupted(transport, request, *excuse):
            answer = send(transport, request, *excuse)
            if request.method != "PATCH":
                return answer
            stored.append(json.loads(answer.text())["id"])
            raise KeyboardInterrupt

        stored = []
        with mock.patch.object(Transport, "send", interrupted), self.assertRaises(KeyboardInterrupt):
            with self.assertWarnsRegex(isomesh_client.VolumeWarning, "cancelled too late: .* volume [0-9a-f]{64}$") as warned:
                self.client.upload(numpy.zeros((128, 128, 128), "float32"))
        self.assertIn(stored[0], str(warned.warnings[0].message))
        self.assertEqual(self.client.volume(stored[0])["id"], stored[0])

    def test_an_upload_that_is_refused_is_not_tried_again(self):
        with UploadRelay(self.url, cuts=0, after=0) as relay, self.assertRaises(isomesh_client.Refused) as refused:
            isomesh_client.Client(relay.url).upload(bytes(9 << 20))
        self.assertEqual(refused.exception.status, 415)
        self.assertEqual([each.split()[0] for each in relay.requests], ["POST", "PATCH", "DELETE"])

    def test_a_mesh_of_other_bytes_is_refused(self):
        job = self.client.mesh(ball(), iso=-8).job
        job["mesh"]["files"]["ply"]["sha256"] = "0" * 64
        with self.assertRaises(isomesh_client.WrongAnswer):
            self.client.fetch(job)

    def test_an_answer_without_its_members_is_wrong(self):
        job = {"id": "j", "state": "succeeded", "volume": "v", "mesh": None, "error": None}
        note = {"id": "v", "range": [0, 1], "notes": [{"code": "x"}]}
        calls = (
            lambda client: client.volume("v"), lambda client: client.histogram("v"), lambda client: client.labels("v"),
            lambda client: client.rename("v", "name"), lambda client: list(client.volumes()),
            lambda client: client.upload(ball()), lambda client: client.mesh(ball(), iso=-8),
            lambda client: client.job("j"), lambda client: list(client.jobs()), lambda client: client.wait("j"),
            lambda client: list(client.job_labels("j")), lambda client: client.cancel("j"),
            lambda client: list(client.job_walls("j")),
            lambda client: client.submit("v", iso=1), lambda client: client.estimate("v", iso=1),
            lambda client: client.fetch("j"),
        )
        for body in ({}, [], {"jobs": [{}], "next": None}, note):
            with Canned(body) as server:
                for call in calls:
                    with self.assertRaises(isomesh_client.WrongAnswer):
                        call(isomesh_client.Client(server.url))
        with Canned(job) as server, self.assertRaisesRegex(isomesh_client.WrongAnswer, "'mesh' is missing"):
            isomesh_client.Client(server.url).wait("j")

    def test_no_server(self):
        for server in ("http://127.0.0.1:1", f"unix:{self.folder}/nothing"):
            with self.subTest(server), self.assertRaisesRegex(isomesh_client.Unreachable, "cannot be reached"):
                isomesh_client.Client(server).volume("x")
        for server in ("ftp://localhost", "localhost:80", "http://a/path", "http://u@h", "http://h:x", "http://h?q"):
            with self.subTest(server), self.assertRaises(ValueError):
                isomesh_client.Client(server)
        with self.assertRaises(ValueError):
            isomesh_client.Client(token="a\r\nb")
        for authorities, reason in (("/no/such.pem", "cannot be read: No such file"), (__file__, "is not a PEM file")):
            with self.assertRaisesRegex(ValueError, f"^authorities: {authorities} {reason}"):
                isomesh_client.Client("https://127.0.0.1:1", authorities=authorities)

    def test_the_environment_says_where_and_who(self):
        with mock.patch.dict(os.environ, {"ISOMESH_SERVER": self.url, "http_proxy": "http://127.0.0.1:1"}):
            self.assertEqual(len(list(isomesh_client.Client().jobs("failed"))), 0)


class Sockets(DaemonTest):
    listen = "unix:FOLDER/socket"

    def test_a_unix_socket(self):
        client = isomesh_client.Client(f"unix:{self.folder}/socket")
        self.assertGreater(len(client.mesh(ball(), iso=-8).faces), 1000)


class Guarded(DaemonTest):
    options = ("--tokens", "FOLDER/tokens", "--tls-cert", "FOLDER/cert.pem", "--tls-key", "FOLDER/key.pem")

    @classmethod
    def prepare(cls, folder):
        tokens = [DAEMON, "token", "add", "python", "--into", folder / "tokens"]
        cls.token = subprocess.check_output(tokens, text=True).strip()
        subprocess.check_call(
            ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost",
             "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", folder / "key.pem", "-out", folder / "cert.pem"],
            stderr=subprocess.DEVNULL,
        )

    def test_tokens_over_tls(self):
        authorities = str(self.folder / "cert.pem")
        client = isomesh_client.Client(self.url, token=self.token, authorities=authorities)
        self.assertGreater(len(client.mesh(ball(), iso=-8).faces), 1000)
        with self.assertRaises(isomesh_client.Refused) as refused:
            list(isomesh_client.Client(self.url, authorities=authorities).volumes())
        self.assertEqual(refused.exception.status, 401)
        with self.assertRaisesRegex(isomesh_client.Unreachable, "certificate"):
            list(isomesh_client.Client(self.url, token=self.token).volumes())


if __name__ == "__main__":
    unittest.main()
