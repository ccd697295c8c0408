"""The module for 3D Slicer, under a stub of Slicer: the daemon is real, and Slicer is not."""

import importlib.util
import sys
import tempfile
import types
import unittest
from pathlib import Path
from unittest import mock

import numpy
from support import DaemonTest, FakeServer, ball

MODULE = Path(__file__).resolve().parents[2] / "client/slicer/Isomesh.py"


class Base:
    def __init__(self, *_):
        pass


class Node:
    """What the module asks of Slicer's nodes: volumes write NRRD, models have a name and a colour."""

    def __init__(self, kind="vtkMRMLScalarVolumeNode", bytes_=b"", name="head"):
        self.kind, self.bytes, self.name, self.color = kind, bytes_, name, None

    def IsA(self, kind):
        return kind == self.kind

    def GetName(self):
        return self.name

    def SetName(self, name):
        self.name = name

    def GetDisplayNode(self):
        return self

    def SetColor(self, *color):
        self.color = color


def nrrd(samples, kind, more=""):
    sizes = " ".join(map(str, samples.shape))
    head = f"NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nspace: left-posterior-superior\nencoding: raw\nendian: little\n"
    axes = "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n"
    return (head + axes + more + "\n").encode() + samples.tobytes(order="F")


def stub():
    slicer = types.ModuleType("slicer")
    scripted = types.ModuleType("slicer.ScriptedLoadableModule")
    scripted.ScriptedLoadableModule = scripted.ScriptedLoadableModuleLogic = scripted.ScriptedLoadableModuleWidget = Base

    def save(node, path):
        Path(path).write_bytes(node.bytes)
        return True

    slicer.util = types.SimpleNamespace(saveNode=save, loadModel=lambda path: Node("model", Path(path).read_bytes()))
    slicer.app = types.SimpleNamespace(processEvents=lambda: None)
    return {"slicer": slicer, "slicer.ScriptedLoadableModule": scripted}


class Slicer(DaemonTest):
    def setUp(self):
        with mock.patch.dict(sys.modules, stub()):
            spec = importlib.util.spec_from_file_location("Isomesh", MODULE)
            self.module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(self.module)
        self.logic = self.module.IsomeshLogic(self.url)

    def test_a_volume_becomes_a_model(self):
        (model,) = self.logic.mesh(Node(bytes_=nrrd(ball(), "float")), iso=-9)
        self.assertEqual(model.name, "head")
        self.assertGreater(len(model.bytes), 84)
        self.assertEqual(len(model.bytes), 84 + 50 * int.from_bytes(model.bytes[80:84], "little"))

    def test_an_empty_surface_is_an_error_unless_it_is_allowed(self):
        node = Node(bytes_=nrrd(ball(), "float"))
        with self.assertRaisesRegex(RuntimeError, "isomesh: the surface is empty: the iso-value 5 separates none"):
            self.logic.mesh(node, iso=5)
        self.assertEqual(self.logic.mesh(node, iso=5, allow_empty=True), [])

    def test_segments_become_models_with_names_and_colours(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:6, 3:9, 3:9], samples[6:10, 3:9, 3:9] = 1, 2
        segments = "".join(
            f"Segment{n}_ID:=s{n}\nSegment{n}_Name:={name}\nSegment{n}_LabelValue:={n + 1}\nSegment{n}_Layer:=0\nSegment{n}_Color:={color}\n"
            for n, (name, color) in enumerate((("liver", "1 0 0"), ("aorta", "0 0 1")))
        )
        node = Node("vtkMRMLSegmentationNode", nrrd(samples, "unsigned char", segments))
        models = self.logic.mesh(node)
        self.assertEqual([(each.name, each.color) for each in models], [("liver", (1, 0, 0)), ("aorta", (0, 0, 1))])

    def test_errors_are_the_daemons(self):
        with self.assertRaisesRegex(RuntimeError, "isomesh: .*iso"):
            self.logic.mesh(Node(bytes_=nrrd(ball(), "float")), iso="nothing")
        with self.assertRaisesRegex(RuntimeError, "isomesh: The file is truncated"):
            self.logic.mesh(Node(bytes_=nrrd(ball(), "float")[:-100]))
        with self.assertRaisesRegex(RuntimeError, "cannot be reached"):
            self.module.IsomeshLogic("http://127.0.0.1:1").mesh(Node(bytes_=b"x"))

    def test_a_busy_daemon_is_asked_again(self):
        asked = []

        def respond(handler, _):
            asked.append(handler.path)
            if len(asked) < 3:
                return 503, {"Retry-After": str(len(asked) - 1)}, b'{"detail": "too many requests"}'
            return 201, {}, b'{"id": "one"}'

        with FakeServer(respond) as server, tempfile.NamedTemporaryFile() as file:
            self.assertEqual(self.module.IsomeshLogic(server.url).upload(file.name), "one")
            self.assertEqual(asked, ["/v1/volumes"] * 3)

    def test_a_daemon_that_stays_busy_is_asked_once_a_second_at_most(self):
        for told in ("0", "soon", ""):
            asked = []

            def respond(handler, _, asked=asked, told=told):
                asked.append(handler.path)
                return 503, {"Retry-After": told}, b'{"detail": "too many requests"}'

            with self.subTest(told), FakeServer(respond) as server, mock.patch.object(self.module, "LONGEST_BUSY_S", 2):
                with self.assertRaisesRegex(RuntimeError, "too many requests"):
                    self.module.IsomeshLogic(server.url).ask("GET", "/v1/jobs")
                self.assertLessEqual(len(asked), 3)

    def test_the_reason_of_an_end_is_told_when_the_job_cannot_be_cancelled(self):
        for status, more in ((500, {}), (503, {"Retry-After": "2"})):
            asked = []

            def respond(handler, _, asked=asked, status=status, more=more):
                asked.append(handler.command)
                if handler.command == "DELETE":
                    return status, more, b'{"detail": "broken"}'
                return 200, {}, b'{"id": "one", "state": "running", "progress": 0, "stage": "queued"}'

            def stop(*_):
                raise KeyboardInterrupt

            with self.subTest(status), FakeServer(respond) as server:
                with self.assertRaises(KeyboardInterrupt):
                    self.module.IsomeshLogic(server.url).job_of("v", {}, stop)
                self.assertEqual(asked, ["POST", "DELETE"])

    def test_a_daemon_that_is_busy_for_too_long_is_given_up(self):
        with FakeServer(lambda *_: (503, {"Retry-After": "601"}, b'{"detail": "too many requests"}')) as server:
            with self.assertRaisesRegex(RuntimeError, "too many requests"):
                self.module.IsomeshLogic(server.url).ask("GET", "/v1/jobs")


if __name__ == "__main__":
    unittest.main()
