import os
import re
import tempfile

from report import main, package_version, said, surface_of_ply


def read(path, suffix):
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, 'out.ply')
        options = ['-M_EXPORT_FMT', 'PLY', '-PLY_EXPORT_FMT', 'ASCII', '-NO_TIMESTAMP', '-SAVE_MESHES', 'FILE', out]
        text = said('xvfb-run', '-a', 'CloudCompare', '-SILENT', '-O', path, *options)
        found = re.search(r'Found one mesh with (\d+) faces and (\d+) vertices', text)
        if not found:
            problem = re.search(r".*(?:Can't|rror|failed|No mesh|unhandled).*", text)
            raise RuntimeError(problem.group(0) if problem else 'no mesh')
        written = surface_of_ply(out)
        if suffix != 'ply':
            del written['colours']
        return [{**written, 'triangles': int(found.group(1)), 'vertices': int(found.group(2))}]


main(package_version('cloudcompare'), read)
