#!/bin/sh
# Guess: the volume of `vtkMassProperties` tells a surface that is inside out: it is negative, as the signed sum over triangles is.
# Seen: a ball has 2125.4 mm3 whichever side its triangles show. Two such balls, one of them inside out, have 0.0 mm3 together, although each
#   of them alone is right. So an airway that was extracted from its dark side passes as solid, and one inverted part takes away another.
# Packages: Debian 12: python3-vtk9 9.1.0+really9.1.0+dfsg2-5+deb12u1. Date: 2026-11-30.
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
cat >volume.py <<'P'
import vtk

def ball(x, is_inverted):
    source, inverted = vtk.vtkSphereSource(), vtk.vtkReverseSense()
    source.SetRadius(8)
    source.SetCenter(x, 0, 0)
    source.SetThetaResolution(32)
    source.SetPhiResolution(32)
    inverted.SetInputConnection(source.GetOutputPort())
    inverted.ReverseCellsOn()
    last = inverted if is_inverted else source
    last.Update()
    return last.GetOutput()

for balls in [(0, False)], [(0, True)], [(0, False), (20, False)], [(0, False), (20, True)]:
    surface, mass = vtk.vtkAppendPolyData(), vtk.vtkMassProperties()
    for place, is_inverted in balls: surface.AddInputData(ball(place, is_inverted))
    surface.Update()
    mass.SetInputData(surface.GetOutput())
    mass.Update()
    print(*['inside out' if is_inverted else 'right' for _, is_inverted in balls], sep=' and ', end=f': {mass.GetVolume():.1f} mm3\n')
P
seen=$(/usr/bin/python3 volume.py | paste -sd'|')
echo "$seen" | tr '|' '\n'
[ "$seen" = 'right: 2125.4 mm3|inside out: 2125.4 mm3|right and right: 4250.9 mm3|right and inside out: 0.0 mm3' ] || { echo changed; exit 1; }
