"""meshlabserver, which MeshLab no longer has after 2020."""
import os
import re
import tempfile

from report import main, package_version, said, surface_of_obj


def read(path, suffix):
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, 'out.obj')
        # vc: with the colours of vertices.
        text = said('xvfb-run', '-a', 'meshlabserver', '-i', path, '-o', out, '-m', 'vc')
        if not os.path.exists(out):
            raise RuntimeError(text.strip().splitlines()[-1])
        found = surface_of_obj(out)
    vertices, triangles = re.search(r'loaded has (\d+) vn (\d+) fn', text).groups()
    if suffix != 'ply':
        del found['colours']
    return [{**found, 'triangles': int(triangles), 'vertices': int(vertices)}]


main(package_version('meshlab'), read)
