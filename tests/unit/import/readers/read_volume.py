"""Reads a volume with a library that is not ours: nibabel, NumPy, VTK or Pillow.

    read_volume.py FILE VOLUME OUT

VOLUME is the index of one of several volumes in the file. OUT gets three sizes (uint32), the position of
the first sample and its steps along x, y and z in LPS (float64), and the samples (float64, x fastest).
"""

import sys

import numpy

ANGSTROM_PER_BOHR = 0.529177210903
LPS_OF_RAS = numpy.diag([-1.0, -1.0, 1.0])


def by_nibabel(path, volume):
    import nibabel

    image = nibabel.load(path)
    samples = numpy.asarray(image.dataobj, dtype=numpy.float64)
    if samples.ndim == 4:
        samples = samples[..., volume]
    affine = LPS_OF_RAS @ image.affine[:3]
    return samples, affine[:, 3], affine[:, :3].T


def by_numpy(path, volume):
    samples = numpy.load(path).astype(numpy.float64)
    if samples.ndim == 4:
        samples = samples[volume]
    return samples.transpose(2, 1, 0), numpy.zeros(3), numpy.eye(3)


def of_vtk_image(image, of_cells=False):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    sizes = [max(size - 1, 1) if of_cells else size for size in image.GetDimensions()]
    data = image.GetCellData() if of_cells else image.GetPointData()
    samples = vtk_to_numpy(data.GetScalars()).astype(numpy.float64).reshape(sizes, order="F")
    spacing = numpy.array(image.GetSpacing())
    first = numpy.array(image.GetExtent()[::2])
    origin = numpy.array(image.GetOrigin()) + spacing * (first + (0.5 if of_cells else 0))
    return samples, origin, numpy.diag(spacing)


def by_vtk(reader, path):
    reader.SetFileName(path)
    reader.Update()
    image = reader.GetOutput()
    return of_vtk_image(image, image.GetPointData().GetScalars() is None)


def by_cube_reader(path):
    from vtkmodules.vtkIOChemistry import vtkGaussianCubeReader

    reader = vtkGaussianCubeReader()
    reader.SetFileName(path)
    reader.Update()
    samples, _, _ = of_vtk_image(reader.GetGridOutput())
    # The transform leads from space to the grid. VTK keeps bohr.
    matrix = reader.GetTransform().GetMatrix()
    inverse = [[matrix.GetElement(row, column) for column in range(4)] for row in range(4)]
    affine = numpy.linalg.inv(numpy.array(inverse))[:3] * ANGSTROM_PER_BOHR
    return samples, affine[:, 3], affine[:, :3].T


def by_pillow(path):
    from PIL import Image, ImageSequence

    pages = [numpy.asarray(page, dtype=numpy.float64) for page in ImageSequence.Iterator(Image.open(path))]
    return numpy.stack(pages).transpose(2, 1, 0), numpy.zeros(3), numpy.eye(3)


def read(path, volume):
    if path.endswith((".mgh", ".mgz", ".HEAD", ".PAR")):
        return by_nibabel(path, volume)
    if path.endswith(".npy"):
        return by_numpy(path, volume)
    if path.endswith(".tif"):
        return by_pillow(path)
    if path.endswith(".cube"):
        return by_cube_reader(path)
    from vtkmodules.vtkIOImage import vtkMRCReader
    from vtkmodules.vtkIOLegacy import vtkStructuredPointsReader
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    readers = {"mrc": vtkMRCReader, "vtk": vtkStructuredPointsReader, "vti": vtkXMLImageDataReader}
    return by_vtk(readers[path.rsplit(".", 1)[1]](), path)


samples, origin, steps = read(sys.argv[1], int(sys.argv[2]))
with open(sys.argv[3], "wb") as out:
    out.write(numpy.array(samples.shape, dtype="<u4").tobytes())
    out.write(numpy.array([origin, *steps], dtype="<f8").tobytes())
    out.write(numpy.ascontiguousarray(samples.ravel(order="F"), dtype="<f8").tobytes())
