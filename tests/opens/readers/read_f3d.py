"""F3D draws a picture and tells what it loaded; of several objects, the numbers in its scene graph."""
import re

from report import main, package_version, said


def read(path, _):
    text = said('xvfb-run', '-a', 'f3d', '--verbose', '--output=/tmp/f3d.png', path)
    numbers = [[int(v) for v in re.findall(f'Number of {what}: (\\d+)', text)] for what in ('points', '(?:polygons|cells)')]
    problem = re.search(r'(is not a file of a supported|No file loaded|[Ee]rror|ERROR).*', text)
    if problem:
        raise RuntimeError(problem.group(0))
    # It only says that there are objects in an OBJ.
    if not any(numbers) and not re.search(r'data output \d', text):
        raise RuntimeError('tells nothing')
    triangles = sum(numbers[1]) if any(numbers) else None
    return [{'triangles': triangles, 'vertices': sum(numbers[0]), 'bounds': None}]


main(package_version('f3d'), read)
