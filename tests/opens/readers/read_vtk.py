import vtk
from polydata import surface_of
from report import hex_of_linear, main

READERS = {
    'stl': vtk.vtkSTLReader,
    'ply': vtk.vtkPLYReader,
    'obj': vtk.vtkOBJReader,
    'vtk': vtk.vtkPolyDataReader,
    'vtp': vtk.vtkXMLPolyDataReader,
}


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
    # An OBJ's names would be here as arrays.
    return [surface_of(reader.GetOutput(), **({'name': None} if suffix == 'obj' else {}))]


main(vtk.vtkVersion().GetVTKVersion(), read)
