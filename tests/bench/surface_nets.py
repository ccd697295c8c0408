"""Runs vtkSurfaceNets3D of VTK 9.3 or newer on raw samples, for isomesh-bench (surface_nets.h).

Usage: surface_nets.py ORDER, a JSON object of
  "samples"     a file of raw samples, x fastest
  "type"        their numpy type
  "dims", "origin", "spacing"
  "labels"      to separate; "background" is 0
  "passes"      of the filter's smoothing
Prints one JSON object: "milliseconds" of a run after one that warms up, from samples to points and
triangles in memory, and "bytes", the peak of the memory of the first run, with the samples.
"""
import json
import pathlib
import sys
import time

import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D


def surface_nets(image, labels, passes):
    # Made anew for every run, because it would return what it has cached.
    nets = vtkSurfaceNets3D()
    nets.SetInputData(image)
    for index, label in enumerate(labels):
        nets.SetValue(index, label)
    nets.SetBackgroundLabel(0)
    nets.SetOutputMeshTypeToTriangles()
    nets.SmoothingOn()
    nets.SetNumberOfIterations(passes)
    nets.Update()
    return nets.GetOutput()


def own_status(field):
    """A field of /proc/self/status, in bytes."""
    for line in pathlib.Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field + ":"):
            return int(line.split()[1]) << 10
    raise KeyError(field)


def main(order):
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_WARNING)
    samples = numpy.fromfile(order["samples"], dtype=order["type"])
    image = vtkImageData()
    image.SetDimensions(order["dims"])
    image.SetOrigin(order["origin"])
    image.SetSpacing(order["spacing"])
    image.GetPointData().SetScalars(numpy_to_vtk(samples))

    pathlib.Path("/proc/self/clear_refs").write_text("5")  # resets the peak
    before = own_status("VmRSS")
    surface_nets(image, order["labels"], order["passes"])
    peak = own_status("VmHWM") - before + samples.nbytes
    begin = time.perf_counter()
    surface_nets(image, order["labels"], order["passes"])
    print(json.dumps({"milliseconds": 1000 * (time.perf_counter() - begin), "bytes": peak}))


main(json.loads(sys.argv[1]))
