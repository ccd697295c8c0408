import os
import re
import tempfile

from report import main, package_version, said, surface_of_obj


def read(path, _):
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, 'out.obj')
        options = ['-M_EXPORT_FMT', 'OBJ', '-NO_TIMESTAMP', '-SAVE_MESHES', 'FILE', out]
        text = said('xvfb-run', '-a', 'CloudCompare', '-SILENT', '-O', path, *options)
        found = re.search(r'Found one mesh with (\d+) faces and (\d+) vertices', text)
        if not found:
            problem = re.search(r".*(?:Can't|rror|failed|No mesh|unhandled).*", text)
            raise RuntimeError(problem.group(0) if problem else 'no mesh')
        # The one of Debian 13 can write no OBJ.
        written = surface_of_obj(out) if os.path.exists(out) else {'bounds': None}
        return [{**written, 'triangles': int(found.group(1)), 'vertices': int(found.group(2))}]


main(package_version('cloudcompare'), read)
