import re

from report import main, package_version, said


def read(path, _):
    text = said('admesh', '--exact', path)
    triangles = int(re.search(r'Number of facets +: +(\d+)', text).group(1))
    limits = re.findall(r'Min ([XYZ]) = +(\S+), Max [XYZ] = +(\S+)', text)
    return [{'triangles': triangles, 'vertices': None, 'bounds': [[float(limit[at]) for limit in limits] for at in (1, 2)]}]


main(package_version('admesh'), read)
