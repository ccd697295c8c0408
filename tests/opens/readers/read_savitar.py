"""Cura's reader of 3MF."""
import struct
import zipfile

from report import main, package_version, surface

try:
    import Savitar
except ModuleNotFoundError:
    import pySavitar as Savitar  # its name since Cura 5


def surfaces_of(node):
    # No object of these files has a transform.
    mesh = node.getMeshData()
    points = list(struct.iter_unpack('<3f', mesh.getVerticesAsBytes()))
    if points:
        yield surface(points, len(mesh.getFacesAsBytes()) // 12, name=node.getName())
    for child in node.getChildren():
        yield from surfaces_of(child)


def read(path, _):
    with zipfile.ZipFile(path) as archive:
        scene = Savitar.ThreeMFParser().parse(archive.read('3D/3dmodel.model').decode())
    return [found for node in scene.getSceneNodes() for found in surfaces_of(node)]


main(package_version('python3-savitar'), read)
