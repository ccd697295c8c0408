#!/bin/sh
# Guess: a contour and its normals do not depend on the unit of the samples. If all samples of a volume are multiplied by the
#   same number, the surface of the value 0 stays where it is, and its normals still have the length 1.
# Seen: vtkFlyingEdges3D keeps every point, but with samples of double precision around 1e-25 all its normals are (0, 0, 0),
#   without an error or a warning. It squares the gradient in single precision, where that is 0. vtkMarchingCubes has
#   normals of length 1 for the same samples. A surface without normals is drawn black. Charges in coulomb, masses in
#   kilogram and densities of particles are that small.
# Packages: Debian 12: python3-vtk9 9.1.0+really9.1.0+dfsg2-5+deb12u1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
# The package, and those it depends on, that this machine lacks. Nothing is installed.
apt-get -s --no-install-recommends install python3-vtk9=9.1.0+really9.1.0+dfsg2-5+deb12u1 |
  awk '/^Inst/ { print $2 }' | xargs -r apt-get download >apt.log 2>&1
for package in *.deb; do [ ! -e "$package" ] || dpkg -x "$package" tree; done
libraries="tree/usr/lib/$(uname -m)-linux-gnu"
export PYTHONPATH="$t/tree/usr/lib/python3/dist-packages"
export LD_LIBRARY_PATH="$t/$libraries:$t/$libraries/blas:$t/$libraries/lapack:$t/$libraries/openmpi/lib"
cat >contour.py <<'P'
import math
import vtk
COUNT = 20
def ball(scale):
    image = vtk.vtkImageData()
    image.SetDimensions(COUNT, COUNT, COUNT)
    image.AllocateScalars(vtk.VTK_DOUBLE, 1)
    middle = (COUNT - 1) / 2
    for z in range(COUNT):
        for y in range(COUNT):
            for x in range(COUNT):
                distance = math.hypot(x - middle, y - middle, z - middle)
                image.SetScalarComponentFromDouble(x, y, z, 0, scale * (6.3 - distance))
    return image
for contour in vtk.vtkFlyingEdges3D, vtk.vtkMarchingCubes:
    for scale in 1, 1e-25:
        algorithm = contour()
        algorithm.SetInputData(ball(scale))
        algorithm.SetValue(0, 0)
        algorithm.ComputeNormalsOn()
        algorithm.Update()
        surface = algorithm.GetOutput()
        normals = surface.GetPointData().GetNormals()
        lengths = [math.hypot(*normals.GetTuple3(i)) for i in range(surface.GetNumberOfPoints())]
        print(f'{contour.__name__}, samples times {scale:g}: {surface.GetNumberOfPoints()} points, '
              f'lengths of normals {min(lengths):.1f} to {max(lengths):.1f}')
P
seen=$(/usr/bin/python3 contour.py)
echo "$seen"
want='vtkFlyingEdges3D, samples times 1: 720 points, lengths of normals 1.0 to 1.0
vtkFlyingEdges3D, samples times 1e-25: 720 points, lengths of normals 0.0 to 0.0
vtkMarchingCubes, samples times 1: 720 points, lengths of normals 1.0 to 1.0
vtkMarchingCubes, samples times 1e-25: 720 points, lengths of normals 1.0 to 1.0'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
