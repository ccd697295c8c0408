#!/bin/sh
# Guess: with AccumulateError, vtkDecimatePro moves no point of a surface farther than the error that was set. Its documentation says that
#   this error then "becomes a global bounds on mesh error".
# Seen: a ball of 10 mm radius and 8192 triangles, simplified with an absolute error of 0.02 mm, has points that are 0.060 mm or more from
#   the ball, three times the limit. Without AccumulateError, the default, they are 0.257 mm or more from it. Nothing reports an error.
#   No search measures this distance: the centre of a triangle is that much nearer to the origin than all points of the ball are.
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
cat >simplify.py <<'P'
import math, vtk
octahedron, subdivision = vtk.vtkPlatonicSolidSource(), vtk.vtkLinearSubdivisionFilter()
octahedron.SetSolidTypeToOctahedron()
subdivision.SetInputConnection(octahedron.GetOutputPort())
subdivision.SetNumberOfSubdivisions(5)
subdivision.Update()
ball, points = subdivision.GetOutput(), vtk.vtkPoints()
points.SetDataTypeToDouble()
for at in range(ball.GetNumberOfPoints()):
    points.InsertNextPoint([10 * x / math.hypot(*ball.GetPoint(at)) for x in ball.GetPoint(at)])
ball.SetPoints(points)
def triangles(surface):
    for at in range(surface.GetNumberOfCells()):
        yield [surface.GetPoint(surface.GetCell(at).GetPointId(corner)) for corner in range(3)]
def height(a, b, c):
    """The distance of the plane of a triangle from the origin."""
    vtk.vtkTriangle.ComputeNormal(a, b, c, normal := [0, 0, 0])
    return abs(vtk.vtkMath.Dot(normal, a))
nearest = min(height(*corners) for corners in triangles(ball))
for limit, accumulate in (0.1, 1), (0.1, 0), (0.02, 1), (0.02, 0):
    decimation, edges = vtk.vtkDecimatePro(), vtk.vtkFeatureEdges()
    decimation.SetInputData(ball)
    decimation.SetTargetReduction(0.99)
    decimation.PreserveTopologyOn()
    decimation.SetErrorIsAbsolute(1)
    decimation.SetAbsoluteError(limit)
    decimation.SetAccumulateError(accumulate)
    edges.FeatureEdgesOff()
    edges.SetInputConnection(decimation.GetOutputPort())
    edges.Update()
    result = decimation.GetOutput()
    distance = nearest - min(math.hypot(*(sum(x) / 3 for x in zip(*corners))) for corners in triangles(result))
    print('limit %g mm, AccumulateError %d: %d of %d triangles, %d open edges, at least %.3f mm' % (limit, accumulate,
          result.GetNumberOfCells(), ball.GetNumberOfCells(), edges.GetOutput().GetNumberOfCells(), distance))
P
seen=$(/usr/bin/python3 simplify.py)
echo "$seen"
[ "$seen" = 'limit 0.1 mm, AccumulateError 1: 1070 of 8192 triangles, 0 open edges, at least 0.105 mm
limit 0.1 mm, AccumulateError 0: 384 of 8192 triangles, 0 open edges, at least 0.442 mm
limit 0.02 mm, AccumulateError 1: 1710 of 8192 triangles, 0 open edges, at least 0.060 mm
limit 0.02 mm, AccumulateError 0: 586 of 8192 triangles, 0 open edges, at least 0.257 mm' ] || { echo changed; exit 1; }
