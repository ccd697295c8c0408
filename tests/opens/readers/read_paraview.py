"""Run by ParaView's own pvpython."""
from paraview import simple
from report import main, package_version, surface
from vtkmodules.util.numpy_support import vtk_to_numpy


def surfaces_of(data, name=None):
    if data.IsA('vtkPolyData'):
        points = vtk_to_numpy(data.GetPoints().GetData()) if data.GetNumberOfPoints() else []
        labels = data.GetCellData().GetArray('label')
        arrays = data.GetPointData()
        yield surface(
            points,
            data.GetNumberOfPolys(),
            name=name,
            normals=arrays.GetNormals() is not None,
            labels=sorted({int(v) for v in vtk_to_numpy(labels)}) if labels else [],
            values=[arrays.GetArrayName(at) for at in range(arrays.GetNumberOfArrays())],
        )
    elif data.IsA('vtkMultiBlockDataSet'):
        for at in range(data.GetNumberOfBlocks()):
            told = data.GetMetaData(at) if data.HasMetaData(at) else None
            own = told.Get(data.NAME()) if told and told.Has(data.NAME()) else None
            if data.GetBlock(at):
                yield from surfaces_of(data.GetBlock(at), own if own and not own.startswith(('Mesh', 'Primitive')) else name)


def read(path, _):
    source = simple.OpenDataFile(path)
    if source is None:
        raise RuntimeError('no reader')
    source.UpdatePipeline()
    return list(surfaces_of(simple.servermanager.Fetch(source)))


main(package_version('paraview'), read)
