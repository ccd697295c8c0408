"""--info tells each object's triangles; where they lie is seen in the STL that it exports.

It puts each object of a file on its bed unless --no-ensure-on-bed is given; its window asks about that.
"""
import os
import re
import tempfile

from report import main, package_version, said, surface_of_stl


def read(path, _):
    text = said('prusa-slicer', '--info', path)
    counts = [int(v) for v in re.findall(r'number_of_facets = +(\d+)', text)]
    if not counts:
        raise RuntimeError(text.strip().splitlines()[-1])
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, 'out.stl')
        said('prusa-slicer', '--export-stl', '--dont-arrange', '--no-ensure-on-bed', '--output', out, path)
        found = surface_of_stl(out)
    return [{**found, 'triangles': sum(counts), 'vertices': None, 'note': 'with `--no-ensure-on-bed`'}]


main(package_version('prusa-slicer'), read)
