"""vtkPolyData, for the readers by VTK and by ParaView."""
from report import hex_of, surface
from vtkmodules.util.numpy_support import vtk_to_numpy


def surface_of(poly, **more):
    points = vtk_to_numpy(poly.GetPoints().GetData()) if poly.GetNumberOfPoints() else []
    arrays = poly.GetPointData()
    labels = poly.GetCellData().GetArray('label') or arrays.GetArray('label')
    more['labels'] = sorted({int(v) for v in vtk_to_numpy(labels)}) if labels else []
    if arrays.GetArray('RGB'):
        more['colours'] = sorted({hex_of(row / 255) for row in vtk_to_numpy(arrays.GetArray('RGB'))})
    more['values'] = [arrays.GetArrayName(at) for at in range(arrays.GetNumberOfArrays())]
    return surface(points, poly.GetNumberOfPolys(), normals=arrays.GetNormals() is not None, **more)
