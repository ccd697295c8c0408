"""`assimp export` to its own JSON: pyassimp of both Debians ends in a segmentation fault with every file."""
import json
import os
import re
import tempfile

from report import hex_of, hex_of_linear, main, package_version, said, surface

VERSION = package_version('assimp-utils')


def surfaces_of(node, parent, scene, encode):
    own = [node['transformation'][4 * row : 4 * row + 4] for row in range(4)]
    matrix = [[sum(row[k] * own[k][column] for k in range(4)) for column in range(4)] for row in parent]
    for at in node.get('meshes', []):
        mesh = scene['meshes'][at]
        rows = zip(*[iter(mesh['vertices'])] * 3)
        points = [[sum(a * b for a, b in zip(row, (*point, 1))) for row in matrix[:3]] for point in rows]
        properties = {p['key']: p['value'] for p in scene['materials'][mesh['materialindex']]['properties']}
        colour = properties.get('$clr.base', properties.get('$clr.diffuse'))
        colours = sorted({hex_of(row) for row in zip(*[iter(mesh['colors'][0])] * 4)}) if mesh.get('colors') else []
        # Materials of 3MF keep the name that its nodes lack.
        name = node['name'] if not node['name'].startswith('Object_') else properties.get('?mat.name')
        yield surface(points, len(mesh['faces']), name=name, colour=colour and encode(colour), colours=colours, normals='normals' in mesh)
    for child in node.get('children', []):
        yield from surfaces_of(child, matrix, scene, encode)


def told(path):
    """Less, for files whose export ends assimp 5.2: GLB of two levels of detail. Its reader opens them."""
    text = said('assimp', 'info', path)
    numbers = [int(re.search(rf'{name}: +(\d+)', text).group(1)) for name in ('Faces', 'Vertices')]
    bounds = [[float(v) for v in re.search(rf'{end}imum point +\((.*)\)', text).group(1).split()] for end in ('Min', 'Max')]
    return [{'triangles': numbers[0], 'vertices': numbers[1], 'bounds': bounds}]


def read(path, suffix):
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, 'scene.json')
        if 'lods-' in path and VERSION.startswith('5.2'):
            return told(path)
        text = said('assimp', 'export', path, out, '-fassjson')
        if 'ERROR' in text:
            raise RuntimeError(text[text.index('ERROR') :].splitlines()[0])
        with open(out, encoding='utf-8') as file:
            scene = json.load(file)
    identity = [[float(row == column) for column in range(4)] for row in range(4)]
    return list(surfaces_of(scene['rootnode'], identity, scene, hex_of_linear if suffix == 'glb' else hex_of))


main(VERSION, read)
