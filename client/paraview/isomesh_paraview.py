"""ParaView: a reader and a filter that get surfaces from an isomesh daemon.

A plugin of one file: Tools, Manage Plugins, Load New. It needs the package isomesh_client in ParaView's Python, or beside it in a checkout.
The token is ISOMESH_TOKEN of the environment, because properties are written to state files. It goes to the server of ISOMESH_SERVER
only, because a state file of somebody else may name another one.
"""

import importlib.util
import json
import os
import pathlib
import struct
import sys
import tempfile
from xml.sax.saxutils import quoteattr

import numpy
from paraview import print_error
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smdomain, smhint, smproperty, smproxy
from vtkmodules.util import numpy_support
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData

if importlib.util.find_spec("isomesh_client") is None:
    sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "python/src"))
import isomesh_client  # noqa: E402

SERVER = os.environ.get("ISOMESH_SERVER", "http://127.0.0.1:8080")
TOKEN = os.environ.get("ISOMESH_TOKEN", "")
FILES = "nii nii.gz nrrd nhdr mha mhd mgz mgh dcm"


# ParaView looks for decorated methods in the class of a proxy itself, not in its bases.
PROPERTIES = (
    ("String", "IsoValue", "otsu", "", "A number, or a name that the daemon knows, such as otsu or bone."),
    ("String", "Labels", "", "", "Empty for a surface at the iso-value; all, or numbers with blanks between, for surfaces of labels."),
    ("Double", "LargestError", 0, '<DoubleRangeDomain name="range" min="0"/>', "In mm. The surface is simplified within it. 0: no simplification."),
    ("Int", "Distances", 0, '<BooleanDomain name="bool"/>', "Adds distance_mm: how far smoothing and simplification moved each vertex."),
    ("Int", "AllowEmpty", 0, '<BooleanDomain name="bool"/>', "Gives no surface if it is empty, instead of an error."),
    ("String", "Server", SERVER, "", "The address of the daemon."),
)


PROPERTIES_XML = "".join(
    f'<{kind}VectorProperty name="{name}" command="Set{name}" number_of_elements="1" default_values={quoteattr(str(value))}>'
    f"{domain}<Documentation>{text}</Documentation></{kind}VectorProperty>"
    for kind, name, value, domain, text in PROPERTIES
)


class Surface(VTKPythonAlgorithmBase):
    """What the reader and the filter share."""

    def __init__(self, inputs):
        super().__init__(nInputPorts=inputs, inputType="vtkImageData", nOutputPorts=1, outputType="vtkPolyData")
        self._server, self._iso, self._labels, self._error, self._distances = SERVER, "otsu", "", 0.0, False
        self._allow_empty = False
        self._stored = (None, None)

    def _set(self, name, value):
        if getattr(self, name) != value:
            setattr(self, name, value)
            self.Modified()

    def SetServer(self, value):
        self._set("_server", value or "")

    def SetIsoValue(self, value):
        self._set("_iso", (value or "").strip())

    def SetLabels(self, value):
        self._set("_labels", (value or "").strip())

    def SetLargestError(self, value):
        self._set("_error", value)

    def SetDistances(self, value):
        self._set("_distances", bool(value))

    def SetAllowEmpty(self, value):
        self._set("_allow_empty", bool(value))

    def parameters(self):
        if self._labels:
            try:
                labels = "all" if self._labels == "all" else [int(each) for each in self._labels.replace(",", " ").split()]
            except ValueError:
                raise ValueError('labels: must be "all", or numbers with blanks between') from None
            chosen = {"labels": labels}
        else:
            try:
                chosen = {"iso": float(self._iso)}
            except ValueError:
                chosen = {"iso": self._iso}
        if self._error > 0:
            chosen["max_error_mm"] = self._error
        if self._distances:
            chosen.update(formats=["glb"], glb_codec="none", distances=True)
        return chosen

    def surface(self, key, upload, output):
        """Fills `output` with the surface of what `upload` stores; that is stored once for each key."""
        try:
            output.ShallowCopy(self.made((self._server, key), upload))
        except (isomesh_client.IsomeshError, ValueError, OSError) as error:
            print_error(f"isomesh: {error}")
            return 0
        return 1

    def made(self, key, upload):
        is_own = self._server.rstrip("/") == SERVER.rstrip("/")
        client = isomesh_client.Client(self._server, token=TOKEN if is_own else "")
        parameters = self.parameters()
        if self._stored[0] == key:
            try:
                return self.fetched(client, parameters)
            except isomesh_client.Refused as refused:
                if refused.status != 404:
                    raise
                # The daemon has removed the volume meanwhile.
        self._stored = (key, upload(client))
        return self.fetched(client, parameters)

    def seen(self, job):
        self.UpdateProgress(job["progress"])
        if self.GetAbortExecute():
            raise ValueError("the surface was cancelled")

    def fetched(self, client, parameters):
        mesh = client.mesh(self._stored[1], progress=self.seen, allow_empty=self._allow_empty, **parameters)
        surface = mesh.to_vtk()
        if self._distances and len(mesh.vertices):
            with tempfile.TemporaryDirectory() as folder:
                vertices, distances = distances_of(client.download(mesh.job, os.path.join(folder, "mesh.glb")).read_bytes())
            if not numpy.array_equal(vertices, mesh.vertices):
                raise ValueError("the vertices of the GLB are not those of the PLY")
            array = numpy_support.numpy_to_vtk(distances, deep=True)
            array.SetName("distance_mm")
            surface.GetPointData().AddArray(array)
        return surface


def distances_of(glb):
    """The vertices of a GLB that isomesh wrote without a codec, in its order, and their distances."""
    (length,) = struct.unpack_from("<I", glb, 12)
    document, begin = json.loads(glb[20 : 20 + length]), 28 + length

    def values(number, width):
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        at = begin + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return numpy.frombuffer(glb, "<f4", accessor["count"] * width, at).reshape(-1, width)

    attributes = [each["attributes"] for mesh in document["meshes"] for each in mesh["primitives"]]
    return (
        numpy.concatenate([values(each["POSITION"], 3) for each in attributes]),
        numpy.concatenate([values(each["_DISTANCE_MM"], 1) for each in attributes])[:, 0],
    )


@smproxy.reader(name="IsomeshReader", label="isomesh Reader", extensions=FILES, file_description="Volumes as surfaces (isomesh)")
@smproperty.xml(PROPERTIES_XML)
class IsomeshReader(Surface):
    """A file of a volume as its surface."""

    def __init__(self):
        super().__init__(0)
        self._file = ""

    @smproperty.stringvector(name="FileName", panel_visibility="never")
    @smdomain.filelist()
    @smhint.filechooser(extensions=FILES, file_description="Volumes as surfaces (isomesh)")
    def SetFileName(self, value):
        self._set("_file", value)

    def RequestData(self, _, __, outputs):
        def key():
            found = os.stat(self._file)
            return self._file, found.st_mtime_ns, found.st_size

        try:
            known = key()
        except OSError as error:
            print_error(f"isomesh: {error}")
            return 0
        return self.surface(known, lambda client: client.upload(self._file), vtkPolyData.GetData(outputs))


@smproxy.filter(name="IsomeshSurface", label="isomesh Surface")
@smhint.xml('<ShowInMenu category="isomesh"/>')
@smproperty.xml(PROPERTIES_XML)
@smproperty.xml("""
<StringVectorProperty name="Scalars" command="SetScalars" number_of_elements="5" element_types="0 0 0 0 2">
  <ArrayListDomain name="array_list" attribute_type="Scalars" input_domain_name="input_array">
    <RequiredProperties><Property name="Input" function="Input"/></RequiredProperties>
  </ArrayListDomain>
</StringVectorProperty>""")
@smproperty.input(name="Input")
@smdomain.xml('<InputArrayDomain name="input_array" attribute_type="point" number_of_components="1"/>')
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class IsomeshSurface(Surface):
    """The surface of an image, in the image's coordinates, which count as millimetres."""

    def __init__(self):
        super().__init__(1)
        self._scalars = None

    def SetScalars(self, _, __, ___, ____, name):
        self._set("_scalars", name)

    def RequestData(self, _, inputs, outputs):
        image = vtkImageData.GetData(inputs[0])
        points = image.GetPointData()
        scalars = points.GetArray(self._scalars) if self._scalars else points.GetScalars()
        if scalars is None or scalars.GetNumberOfComponents() != 1:
            print_error("isomesh: the image needs point data with one component")
            return 0

        def upload(client):
            samples = numpy_support.vtk_to_numpy(scalars).reshape(image.GetDimensions(), order="F")
            return client.upload(samples, affine=affine_of(image), affine_space="lps")

        return self.surface((scalars.GetMTime(), image.GetMTime(), scalars.GetName()), upload, vtkPolyData.GetData(outputs))


def affine_of(image):
    """From indices of the samples to coordinates."""
    affine = numpy.eye(4)
    directions = image.GetDirectionMatrix()
    turn = numpy.array([[directions.GetElement(row, column) for column in range(3)] for row in range(3)])
    affine[:3, :3] = turn * image.GetSpacing()
    affine[:3, 3] = affine[:3, :3] @ image.GetExtent()[::2] + image.GetOrigin()
    return affine
