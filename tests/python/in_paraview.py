"""Run by ParaView's pvpython: loads client/paraview, and prints what the reader and the filter make as JSON.

pvpython in_paraview.py PLUGIN SERVER VOLUME LABELS
"""

import inspect
import json
import sys

import numpy
from paraview import servermanager, simple
from paraview.vtk.util import numpy_support
from vtkmodules.vtkCommonDataModel import vtkImageData

# ParaView 5.11.0 of Debian 12 needs a function that its Python 3.11 does not have.
inspect.getargspec = inspect.getfullargspec
PLUGIN, SERVER, VOLUME, LABELS = sys.argv[1:]
simple.LoadPlugin(PLUGIN, remote=False, ns=globals())
import isomesh_client  # noqa: E402  where the plugin found it


def told(source):
    source.UpdatePipeline()
    mesh = servermanager.Fetch(source)
    arrays = {}
    for data in (mesh.GetPointData(), mesh.GetCellData()):
        for number in range(data.GetNumberOfArrays()):
            values = numpy_support.vtk_to_numpy(data.GetArray(number))
            arrays[data.GetArray(number).GetName()] = [len(values), float(values.min()), float(values.max())]
    return {
        "points": mesh.GetNumberOfPoints(),
        "cells": mesh.GetNumberOfCells(),
        "bounds": mesh.GetBounds(),
        "arrays": arrays,
    }


uploads = []
upload = isomesh_client.Client.upload


def counted(*given, **named):
    uploads.append(given)
    return upload(*given, **named)


isomesh_client.Client.upload = counted
result = {}
reader = isomeshReader(FileName=VOLUME, Server=SERVER, IsoValue="-9")  # noqa: F821
result["reader"] = told(reader)
reader.LargestError, reader.Distances = 0.2, 1
result["simplified"] = told(reader)
result["uploads"] = len(uploads)
for volume in list(isomesh_client.Client(SERVER).volumes()):
    isomesh_client.Client(SERVER).erase(volume, jobs=True)
reader.Distances = 0
result["uploaded again"] = told(reader)
result["all uploads"] = len(uploads)
result["empty"] = told(isomeshReader(FileName=VOLUME, Server=SERVER, IsoValue="5"))  # noqa: F821
result["allowed"] = told(isomeshReader(FileName=VOLUME, Server=SERVER, IsoValue="5", AllowEmpty=1))  # noqa: F821
result["labels"] = told(isomeshReader(FileName=LABELS, Server=SERVER, Labels="all", Distances=1))  # noqa: F821
result["one label"] = told(isomeshReader(FileName=LABELS, Server=SERVER, Labels="2"))  # noqa: F821
result["no server"] = told(isomeshReader(FileName=VOLUME, Server="http://127.0.0.1:9", IsoValue="-9"))  # noqa: F821
result["wrong labels"] = told(isomeshReader(FileName=VOLUME, Server=SERVER, Labels="one"))  # noqa: F821

samples = numpy.load(VOLUME + ".npy")
image = vtkImageData()
image.SetExtent(3, 2 + samples.shape[0], -2, samples.shape[1] - 3, 0, samples.shape[2] - 1)
image.SetSpacing(0.5, 0.75, 1.25)
image.SetOrigin(100, -200, 300)
image.SetDirectionMatrix([0, -1, 0, 1, 0, 0, 0, 0, 1])
for name, values in (("other", numpy.zeros_like(samples)), ("distance", samples)):
    array = numpy_support.numpy_to_vtk(samples.ravel(order="F") if name == "distance" else values.ravel(), deep=True)
    array.SetName(name)
    image.GetPointData().AddArray(array)
image.GetPointData().SetActiveScalars("other")
producer = simple.TrivialProducer()
producer.GetClientSideObject().SetOutput(image)
surface = isomeshSurface(Input=producer, Server=SERVER, IsoValue="-9", Scalars=["POINTS", "distance"])  # noqa: F821
result["filter"] = told(surface)
print(json.dumps(result))
