import gmsh
from report import main, package_version, surface


def read(path, _):
    gmsh.initialize()
    gmsh.option.setNumber('General.Terminal', 0)
    gmsh.open(path)
    _, coordinates, _ = gmsh.model.mesh.getNodes()
    kinds, elements, _ = gmsh.model.mesh.getElements(2)
    triangles = sum(len(of) for kind, of in zip(kinds, elements) if kind == 2)
    return [surface(list(zip(*[iter(coordinates)] * 3)), triangles)]


main(package_version('gmsh'), read)
