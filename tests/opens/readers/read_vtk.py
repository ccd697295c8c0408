import vtk
from report import hex_of_linear, main, surface
from vtk.util.numpy_support import vtk_to_numpy

READERS = {
    'stl': vtk.vtkSTLReader,
    'ply': vtk.vtkPLYReader,
    'obj': vtk.vtkOBJReader,
    'vtk': vtk.vtkPolyDataReader,
    'vtp': vtk.vtkXMLPolyDataReader,
}


def surface_of(poly, **more):
    points = vtk_to_numpy(poly.GetPoints().GetData()) if poly.GetNumberOfPoints() else []
    labels = poly.GetCellData().GetArray('label')
    if labels:
        more['labels'] = sorted({int(v) for v in vtk_to_numpy(labels)})
    arrays = poly.GetPointData()
    more['values'] = [arrays.GetArrayName(at) for at in range(arrays.GetNumberOfArrays())]
    return surface(points, poly.GetNumberOfPolys(), normals=arrays.GetNormals() is not None, **more)


def scene(importer, path):
    importer.SetFileName(path)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    importer.SetRenderWindow(window)
    importer.Read()
    surfaces = []
    actors = importer.GetRenderer().GetActors()
    actors.InitTraversal()
    while actor := actors.GetNextActor():
        mapper = actor.GetMapper()
        mapper.Update()
        move = vtk.vtkTransformPolyDataFilter()
        transform = vtk.vtkTransform()
        transform.SetMatrix(actor.GetMatrix())
        move.SetTransform(transform)
        move.SetInputData(mapper.GetInput())
        move.Update()
        surfaces.append(surface_of(move.GetOutput(), colour=hex_of_linear(actor.GetProperty().GetDiffuseColor())))
    return surfaces


def read(path, suffix):
    errors = []
    told = vtk.vtkStringOutputWindow()
    vtk.vtkOutputWindow.SetInstance(told)
    if suffix == 'glb':
        surfaces = scene(vtk.vtkGLTFImporter(), path)
        if not surfaces:
            raise RuntimeError(told.GetOutput().strip().splitlines()[-1] if told.GetOutput() else 'nothing')
        return surfaces
    reader = READERS[suffix]()
    reader.AddObserver('ErrorEvent', lambda *event: errors.append(event))
    reader.SetFileName(path)
    reader.Update()
    if errors:
        raise RuntimeError(told.GetOutput() or 'an error')
    return [surface_of(reader.GetOutput())]


main(vtk.vtkVersion().GetVTKVersion(), read)
