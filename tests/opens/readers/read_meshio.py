import meshio
from report import hex_of, main, surface


def read(path, _):
    mesh = meshio.read(path)
    labels = sorted({int(v) for v in mesh.point_data.get('label', [])})
    colours = sorted({hex_of([v / 255 for v in row]) for row in zip(*(mesh.point_data.get(name, []) for name in ('red', 'green', 'blue')))})
    return [surface(mesh.points, sum(len(block.data) for block in mesh.cells if block.type == 'triangle'), labels=labels, **({'colours': colours} if colours else {}))]


main(meshio.__version__, read)
