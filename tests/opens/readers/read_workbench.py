import re

from report import main, package_version, said


def read(path, _):
    text = said('wb_command', '-file-information', path)

    def number(name):
        return int(re.search(name + r':\s+(\d+)', text).group(1))

    bounds = [[float(v) for v in re.findall(rf'[XYZ]-{which}imum: +(\S+)', text)] for which in ('min', 'max')]
    structure = re.search(r'Structure: +(\S+)', text).group(1)
    return [{'triangles': number('Number of Triangles'), 'vertices': number('Number of Vertices'), 'bounds': bounds, 'name': structure}]


main(package_version('connectome-workbench'), read)
