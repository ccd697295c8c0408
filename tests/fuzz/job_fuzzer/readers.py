"""Readers of mesh files that are not ours: draco3d, gltf-validator, meshoptimizer, VTK and nibabel, and plain parsing of the rest."""

import functools
import importlib.util
import io
import json
import os
import re
import subprocess
import xml.etree.ElementTree as xml
import zipfile
from pathlib import Path

import numpy

FOLDER = Path(__file__).resolve().parents[2] / "unit" / "codec" / "readers"
# From each format's space to LPS millimetres; the others have that of the job.
Y_UP = numpy.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
RAS = numpy.diag([-1.0, -1.0, 1.0])


class Unreadable(Exception):
    """A reader does not take the file."""


class Part:
    """A surface in a file: points, triangles as indices, and what each point has. A coarser level of detail is not `finest`."""

    def __init__(self, points, triangles, normals=None, distances=None, finest=True):
        self.points = points.reshape(-1, 3)
        self.triangles = triangles.reshape(-1, 3)
        self.normals = None if normals is None else normals.reshape(-1, 3)
        self.distances = distances
        self.finest = finest


def numbers(text, kind=float):
    return numpy.fromstring(text, kind, sep=" ") if text.strip() else numpy.zeros(0, kind)


def read_stl(data):
    count = int.from_bytes(data[80:84], "little")
    if len(data) != 84 + 50 * count:
        raise Unreadable(f"{len(data)} bytes are not {count} triangles")
    faces = numpy.frombuffer(data, [("normal", "<f4", 3), ("points", "<f4", 9), ("more", "<u2")], offset=84)
    # A facet without an area has the normal 0, 0, 0. It is not unit, and that is checked here.
    lengths = numpy.linalg.norm(faces["normal"].astype(float), axis=1)
    if not numpy.all((numpy.abs(lengths - 1) < 1e-3) | (lengths == 0)):
        raise Unreadable("a facet's normal has not the length 1")
    return [Part(faces["points"], numpy.arange(3 * count))]


PLY_TYPES = {"float": "<f4", "int": "<i4", "uint": "<u4", "uchar": "u1", "uint8": "u1", "double": "<f8", "short": "<i2", "ushort": "<u2", "char": "i1"}


def read_ply(data):
    end = data.index(b"end_header\n") + len(b"end_header\n")
    elements = []
    for line in data[:end].decode("utf-8").splitlines():
        words = line.split()
        if words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property" and words[1] == "list":
            elements[-1][2].extend([("count", PLY_TYPES[words[2]]), (words[4], PLY_TYPES[words[3]], 3)])
        elif words[0] == "property":
            elements[-1][2].append((words[2], PLY_TYPES[words[1]]))
    read = {}
    for name, count, kind in elements:
        read[name] = numpy.frombuffer(data, kind, count, offset=end)
        end += read[name].nbytes
    if end != len(data):
        raise Unreadable(f"{len(data) - end} bytes are left")
    vertices, faces = read["vertex"], read["face"]
    if numpy.any(faces["count"] != 3):
        raise Unreadable("a face has not three corners")
    return [Part(numpy.stack([vertices[axis] for axis in "xyz"], axis=1), faces["vertex_indices"])]


def read_obj(data):
    lines = data.decode("utf-8").splitlines()
    points = numbers(" ".join(line[2:] for line in lines if line.startswith("v ")))
    faces = numbers(" ".join(line[2:] for line in lines if line.startswith("f ")), int)
    known = {"v", "f", "#", "o", "g", "usemtl", "mtllib", ""}
    if strange := {line.split(" ", 1)[0] for line in lines} - known:
        raise Unreadable(f"lines begin with {strange}")
    return [Part(points, faces - 1)]


def read_off(data):
    lines = [line for line in data.decode("utf-8").splitlines() if not line.startswith("#")]
    if lines[0] != "OFF":
        raise Unreadable("it does not begin with OFF")
    vertices, faces, _ = (int(word) for word in lines[1].split())
    if len(lines) != 2 + vertices + faces:
        raise Unreadable(f"{len(lines)} lines for {vertices} vertices and {faces} faces")
    corners = numbers(" ".join(lines[2 + vertices :]), int).reshape(-1, 4)
    if numpy.any(corners[:, 0] != 3):
        raise Unreadable("a face has not three corners")
    return [Part(numbers(" ".join(lines[2 : 2 + vertices])), corners[:, 1:].copy())]


def whole_zip(data):
    package = zipfile.ZipFile(io.BytesIO(data))
    if damaged := package.testzip():
        raise Unreadable(f"{damaged} is damaged")
    return package


def read_3mf(data):
    space = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    root = xml.fromstring(whole_zip(data).read("3D/3dmodel.model"))
    parts = []
    for mesh in root.iter(space + "mesh"):
        points = [[float(vertex.get(axis)) for axis in "xyz"] for vertex in mesh.iter(space + "vertex")]
        corners = [[int(triangle.get(name)) for name in ("v1", "v2", "v3")] for triangle in mesh.iter(space + "triangle")]
        parts.append(Part(numpy.array(points, float), numpy.array(corners, int)))
    objects = {each.get("id") for each in root.iter(space + "object")}
    if len(objects) < len(parts) or len(list(root.iter(space + "item"))) > len(objects):
        raise Unreadable("objects and items do not match")
    return parts


def array_of(text, name):
    """Each array of that name in a stage's text."""
    for found in re.finditer(r"\] " + name + r" = \[(.*?)\]", text):
        yield numbers(re.sub(r"[(),]+", " ", found[1]))


def read_usda(data):
    text = data.decode("utf-8")
    if not text.startswith("#usda 1.0\n"):
        raise Unreadable("it does not begin as USD does")
    points, faces = list(array_of(text, "points")), list(array_of(text, "faceVertexIndices"))
    normals = list(array_of(text, "normals")) or [None] * len(points)
    if any(numpy.any(counts != 3) for counts in array_of(text, "faceVertexCounts")):
        raise Unreadable("a face has not three corners")
    if not len(points) == len(faces) == len(normals) == text.count("def Mesh "):
        raise Unreadable("meshes and arrays do not match")
    return [Part(each, corners.astype(int), normal) for each, corners, normal in zip(points, faces, normals)]


def read_usdz(data):
    package = whole_zip(data)
    if len(package.infolist()) != 1 or package.infolist()[0].compress_type != zipfile.ZIP_STORED:
        raise Unreadable("a package holds one file as it is")
    return read_usda(package.read(package.infolist()[0]))


def surface_readers():
    """The functions of read_surface.py."""
    spec = importlib.util.spec_from_file_location("read_surface", FOLDER / "read_surface.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Readers:
    """All readers. Not for several threads. `folder` holds one file at a time."""

    def __init__(self, folder):
        self.folder = folder
        self.surface = surface_readers()
        self.node = None
        self.by_format = {"stl": read_stl, "ply": read_ply, "obj": read_obj, "off": read_off, "3mf": read_3mf, "usda": read_usda,
                          "usdz": read_usdz, "drc": self.read_drc, "glb": self.read_glb}
        for name in ("vtk", "vtp", "gii"):
            self.by_format[name] = functools.partial(self.read_file, name)

    def close(self):
        if self.node is not None:
            self.node.stdin.close()
            self.node.stdout.close()
            self.node.wait(30)
            self.node = None

    def read(self, name, data, space):
        """The parts of a file, in LPS. Throws Unreadable."""
        if name not in self.by_format:
            raise Unreadable(f"the fuzzer has no reader of {name}: add one to readers.py")
        try:
            parts = self.by_format[name](data)
        except (ValueError, KeyError, IndexError, xml.ParseError, zipfile.BadZipFile, SystemExit, UnicodeDecodeError) as error:
            raise Unreadable(f"{type(error).__name__}: {error}") from error
        turned = {"glb": None, "gii": RAS, "usda": Y_UP, "usdz": Y_UP}.get(name, RAS if space == "ras" else None)
        for part in parts:
            part.points = numpy.asarray(part.points, float)
            if turned is not None:
                part.points = part.points @ turned.T
        return parts

    def read_file(self, name, data):
        path = os.path.join(self.folder, f"mesh.{name}")
        with open(path, "wb") as file:
            file.write(data)
        read = self.surface.by_nibabel if name == "gii" else self.surface.by_vtk
        points, triangles, _, _ = read(path)
        return [Part(points, triangles)]

    def ask_node(self, kind, data):
        if self.node is None:
            self.node = subprocess.Popen(["node", FOLDER / "read_glb.mjs"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        try:
            self.node.stdin.write(f"{kind} {len(data)}\n".encode() + data)
            self.node.stdin.flush()
            word, size = self.node.stdout.readline().split()
            made = self.node.stdout.read(int(size))
        except (OSError, ValueError) as error:
            self.node.kill()
            self.close()
            raise Unreadable("the reader died") from error
        if word != b"ok":
            raise Unreadable(made.decode("utf-8", "replace"))
        parts = []
        while made:
            points, corners, normals, distances = numpy.frombuffer(made, "<u4", 4)
            arrays, at = [], 16
            for count, type_ in ((3 * points, "<f4"), (3 * normals, "<f4"), (distances, "<f4"), (3 * corners, "<u4")):
                arrays.append(numpy.frombuffer(made, type_, count, offset=at))
                at += arrays[-1].nbytes
            parts.append(Part(arrays[0], arrays[3], arrays[1] if normals else None, arrays[2] if distances else None))
            made = made[at:]
        return parts

    def read_drc(self, data):
        return self.ask_node("drc", data)

    def read_glb(self, data):
        parts = self.ask_node("glb", data)
        size = int.from_bytes(data[12:16], "little")
        gltf = json.loads(data[20 : 20 + size])
        shown, nodes = set(), list(gltf["scenes"][gltf.get("scene", 0)].get("nodes", []))
        while nodes:
            node = gltf["nodes"][nodes.pop()]
            nodes += node.get("children", [])
            shown |= {node["mesh"]} if "mesh" in node else set()
        primitives = [(number, primitive) for number, mesh in enumerate(gltf.get("meshes", [])) for primitive in mesh["primitives"]]
        if len(primitives) != len(parts):
            raise Unreadable(f"{len(parts)} of {len(primitives)} primitives were read")
        for part, (number, primitive) in zip(parts, primitives):
            part.finest = number in shown
            counts = {gltf["accessors"][primitive["attributes"][name]]["count"] for name in primitive["attributes"]}
            corners = gltf["accessors"][primitive["indices"]]["count"]
            if counts != {len(part.points)} or corners != 3 * len(part.triangles):
                raise Unreadable(f"accessors tell {counts} points and {corners} corners, not {len(part.points)} and {3 * len(part.triangles)}")
        return parts
