"""read_surface.py FILE OUT: what VTK makes of a .vtk, .vtp or .glb file, and nibabel of a .gii file.

Writes the numbers of points, of triangles, of labels and of bytes of text as 32-bit numbers to OUT,
then points as floats, triangles as 32-bit indices, labels as 64-bit numbers, and the text: what the file
says of itself, as JSON. Fails where the reader has something to say.
"""
import json
import sys

import numpy


def by_vtk(path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOLegacy import vtkPolyDataReader
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    is_xml = path.endswith('.vtp')
    reader = vtkXMLPolyDataReader() if is_xml else vtkPolyDataReader()
    said = []  # an exception does not leave VTK's observers
    for event in ('ErrorEvent', 'WarningEvent'):
        reader.AddObserver(event, lambda _, told: said.append(told))
    reader.SetFileName(path)
    reader.Update()
    if said:
        sys.exit(f'VTK: {said}')
    surface = reader.GetOutput()
    told = {}
    if is_xml:
        for name in ('SPACE', 'isomesh:provenance'):
            told[name] = surface.GetFieldData().GetAbstractArray(name).GetValue(0)
    else:
        told['title'] = reader.GetHeader()
    points = numpy.zeros((0, 3), numpy.float32)
    if surface.GetNumberOfPoints() > 0:
        points = vtk_to_numpy(surface.GetPoints().GetData())
    polygons = surface.GetPolys()
    triangles = vtk_to_numpy(polygons.GetConnectivityArray())
    sizes = numpy.diff(vtk_to_numpy(polygons.GetOffsetsArray()))
    if numpy.any(sizes != 3) or surface.GetNumberOfCells() != polygons.GetNumberOfCells():
        sys.exit('there are other cells than triangles')
    array = surface.GetCellData().GetArray('label')
    labels = numpy.zeros(0, numpy.int64) if array is None else vtk_to_numpy(array)
    return points, triangles, labels, told


def by_vtk_from_gltf(path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOGeometry import vtkGLTFReader

    reader = vtkGLTFReader()
    said = []  # an exception does not leave VTK's observers
    for event in ('ErrorEvent', 'WarningEvent'):
        reader.AddObserver(event, lambda _, told: said.append(told))
    reader.SetFileName(path)
    reader.Update()
    if said:
        sys.exit(f'VTK: {said}')
    nothing = numpy.zeros((0, 3), numpy.float32)
    points, triangles, arrays = [nothing], [nothing.astype(numpy.uint32)], []
    count = 0
    output = reader.GetOutput()
    each = output.NewIterator()
    each.InitTraversal()
    while not each.IsDoneWithTraversal():
        surface = each.GetCurrentDataObject()
        corners = surface.GetPolys()
        if corners.GetNumberOfCells() != surface.GetNumberOfCells():
            sys.exit('there are other cells than polygons')
        places = vtk_to_numpy(surface.GetPoints().GetData())
        triangles.append(vtk_to_numpy(corners.GetConnectivityArray()).reshape(-1, 3) + count)
        points.append(places)
        count += len(places)
        data = surface.GetPointData()
        arrays.append(sorted(data.GetArrayName(n) for n in range(data.GetNumberOfArrays())))
        each.GoToNextItem()
    return numpy.concatenate(points), numpy.concatenate(triangles), numpy.zeros(0, numpy.int64), {'arrays': arrays}


def by_nibabel(path):
    import nibabel

    image = nibabel.load(path)
    if not image.darrays:
        nothing = numpy.zeros((0, 3), numpy.float32)
        return nothing, nothing, numpy.zeros(0, numpy.int64), dict(image.meta)
    points, triangles = image.agg_data(('pointset', 'triangle'))
    pointset = image.get_arrays_from_intent('pointset')[0]
    system = pointset.coordsys
    if not numpy.array_equal(system.xform, numpy.eye(4)):
        sys.exit('there is a transformation')
    told = {'dataspace': nibabel.nifti1.xform_codes.niistring[system.dataspace], **image.meta, **pointset.metadata}
    return points, triangles, numpy.zeros(0, numpy.int64), told


def main(path, out):
    readers = {'gii': by_nibabel, 'glb': by_vtk_from_gltf}
    points, triangles, labels, told = readers.get(path.rsplit('.')[-1], by_vtk)(path)
    if points.dtype != numpy.float32:
        sys.exit(f'points are {points.dtype}')
    text = json.dumps(told).encode()
    triangles = triangles.reshape(-1, 3)
    with open(out, 'wb') as file:
        numpy.array([len(points), len(triangles), len(labels), len(text)], numpy.uint32).tofile(file)
        numpy.ascontiguousarray(points).tofile(file)
        triangles.astype(numpy.uint32).tofile(file)
        labels.astype(numpy.int64).tofile(file)
        file.write(text)


if __name__ == '__main__':
    main(*sys.argv[1:])
