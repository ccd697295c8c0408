#!/bin/sh
# Guess: the Hausdorff distance of two surfaces that VTK reports is 0 only if the surfaces are the same, at least if it measures to triangles.
# Seen: vtkHausdorffDistancePointSetFilter measures from vertices only. A cube of 20 mm, and the same cube with a square tunnel of 10 mm
#   right through it, have the distance 0 (PointToCell): all vertices of each lie on the other surface. The walls of the
#   tunnel are up to 5 mm from the cube, and the middle of a face of the cube is 5 mm from the rim of the tunnel. If all triangles are cut
#   into 64, VTK finds these 5 mm. Its default, PointToPoint, says 7.1 mm, then 5.2. So the number depends on the triangulation.
# Packages: Debian 12: python3-vtk9 9.1.0+really9.1.0+dfsg2-5+deb12u1. Date: 2026-11-29.
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
cat >compare.py <<'P'
import vtk
def cube(rings, finer):
    """Squares (half of a side, height), each joined to the next, the last to the first. Two squares have lids instead."""
    points, triangles = vtk.vtkPoints(), vtk.vtkCellArray()
    quads = [(3, 2, 1, 0), (4, 5, 6, 7)] if len(rings) == 2 else []
    for ring, (half, height) in enumerate(rings):
        for x, y in (-1, -1), (1, -1), (1, 1), (-1, 1): points.InsertNextPoint(half * x, half * y, height)
        low, high = 4 * ring, 4 * ((ring + 1) % len(rings))
        if ring == 0 or len(rings) > 2:
            quads += [(low + at, low + (at + 1) % 4, high + (at + 1) % 4, high + at) for at in range(4)]
    for a, b, c, d in quads:
        triangles.InsertNextCell(3, (a, b, c))
        triangles.InsertNextCell(3, (a, c, d))
    surface, subdivision = vtk.vtkPolyData(), vtk.vtkLinearSubdivisionFilter()
    surface.SetPoints(points)
    surface.SetPolys(triangles)
    subdivision.SetInputData(surface)
    subdivision.SetNumberOfSubdivisions(finer)
    subdivision.Update()
    return subdivision.GetOutput() if finer else surface
for finer in 0, 3:
    plain, tunnel = cube([(10, -10), (10, 10)], finer), cube([(10, -10), (10, 10), (5, 10), (5, -10)], finer)
    for name, surface in ('cube', plain), ('tunnel', tunnel):
        mass, edges = vtk.vtkMassProperties(), vtk.vtkFeatureEdges()
        edges.FeatureEdgesOff()
        for algorithm in mass, edges:
            algorithm.SetInputData(surface)
            algorithm.Update()
        print(f'{name}: {surface.GetNumberOfCells()} triangles, {edges.GetOutput().GetNumberOfCells()} open edges, {mass.GetVolume():.0f} mm3')
    for method in 1, 0:
        distance = vtk.vtkHausdorffDistancePointSetFilter()
        for port, surface in enumerate([plain, tunnel]): distance.SetInputData(port, surface)
        distance.SetTargetDistanceMethod(method)
        distance.Update()
        print('%s: %.1f mm' % (distance.GetTargetDistanceMethodAsString(), distance.GetHausdorffDistance()))
P
seen=$(/usr/bin/python3 compare.py | paste -sd'|')
echo "$seen" | tr '|' '\n'
[ "$seen" = "cube: 12 triangles, 0 open edges, 8000 mm3|tunnel: 32 triangles, 0 open edges, 6000 mm3|PointToCell: 0.0 mm|PointToPoint: 7.1 mm|\
cube: 768 triangles, 0 open edges, 8000 mm3|tunnel: 2048 triangles, 0 open edges, 6000 mm3|PointToCell: 5.0 mm|PointToPoint: 5.2 mm" ] ||
  { echo changed; exit 1; }
