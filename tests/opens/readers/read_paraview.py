"""Run by ParaView's own pvpython."""
from paraview import simple
from polydata import surface_of
from report import main, package_version


def surfaces_of(data, name=None):
    if data.IsA('vtkPolyData'):
        yield surface_of(data, name=name)
        return
    for at in range(data.GetNumberOfBlocks()):
        told = data.GetMetaData(at) if data.HasMetaData(at) else None
        own = told.Get(data.NAME()) if told and told.Has(data.NAME()) else None
        if data.GetBlock(at):
            yield from surfaces_of(data.GetBlock(at), own if own and not own.startswith(('Mesh', 'Primitive')) else name)


def read(path, _):
    source = simple.OpenDataFile(path)
    source.UpdatePipeline()
    return list(surfaces_of(simple.servermanager.Fetch(source)))


main(package_version('paraview'), read)
