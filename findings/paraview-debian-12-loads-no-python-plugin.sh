#!/bin/sh
# Guess: ParaView of Debian 12 loads plugins in Python (classes with smproxy decorators), because it comes with Python and a module for them.
# Seen: it loads none. Its module paraview.detail.pythonalgorithm imports inspect.getargspec, which Python 3.11 of Debian 12 does not have any
#   more. pvpython says "invalid ELF header", because it then tries the file as a library. A line before the plugin is loaded helps:
#   import inspect; inspect.getargspec = inspect.getfullargspec
# Packages: Debian 12: paraview and python3-paraview 5.11.0+dfsg-1+b1, with what they need of any version. Date: 2026-11-29.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
pinned='paraview=5.11.0+dfsg-1+b1 python3-paraview=5.11.0+dfsg-1+b1'
# The packages have no blanks in their names. Nothing is installed: python3-paraview excludes python3-vtk9.
others=$(apt-get install --simulate --no-install-recommends $pinned | sed -n 's/^Inst \([^ ]*\) .*/\1/p' | grep -v paraview)
apt-get download $pinned $others >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
libraries="$t/tree/usr/lib/$(uname -m)-linux-gnu"
export LD_LIBRARY_PATH="$libraries:$libraries/blas:$libraries/lapack:$t/tree/usr/lib:$t/tree/usr/lib/ogdi/4.1"
export PYTHONPATH="$t/tree/usr/lib/python3/dist-packages"
cat >plugin.py <<'P'
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smproxy
from vtkmodules.vtkCommonDataModel import vtkPolyData
@smproxy.source(name='Nothing', label='Nothing')
class Nothing(VTKPythonAlgorithmBase):
    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType='vtkPolyData')
    def RequestData(self, request, inputs, outputs):
        return 1
P
cat >load.py <<'P'
import inspect, sys
if sys.argv[1] == 'helped':
    inspect.getargspec = inspect.getfullargspec
from paraview import simple
try:
    simple.LoadPlugin(sys.argv[2], remote=False, ns=globals())
    print('%s: loaded' % sys.argv[1], 'Nothing' in globals())
except RuntimeError as error:
    print('%s: not loaded' % sys.argv[1])
P
for way in plain helped; do
  tree/usr/bin/pvpython load.py "$way" "$t/plugin.py" 2>log.$way
done >seen
cat seen
grep -o "cannot import name 'getargspec'.*inspect'" log.plain || true
grep -q "cannot import name 'getargspec'" log.plain && [ "$(cat seen)" = "$(printf 'plain: not loaded\nhelped: loaded True')" ] || { echo changed; exit 1; }
