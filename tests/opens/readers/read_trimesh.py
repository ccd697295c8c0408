import trimesh
from report import hex_of, main, surface
from trimesh.transformations import transform_points


def surface_of(name, mesh, matrix):
    material = getattr(mesh.visual, 'material', None)
    colour = getattr(material, 'main_color', None)
    if colour is None and mesh.visual.kind == 'face':
        colour = mesh.visual.face_colors[0]
    colours = []
    if mesh.visual.kind == 'vertex':
        colours = sorted({hex_of(row / 255) for row in mesh.visual.vertex_colors})
    points = transform_points(mesh.vertices, matrix)
    if not points.any():
        raise RuntimeError('all coordinates are 0, without a warning')
    return surface(
        points,
        len(mesh.faces),
        name=name,
        colour=colour is not None and hex_of(colour / 255),
        colours=colours,
        normals='vertex_normals' in mesh._cache.cache,
        values=list(mesh.vertex_attributes),
        labels=sorted({int(v) for v in mesh.vertex_attributes.get('label', [])}),
    )


def read(path, _):
    scene = trimesh.load(path, force='scene')
    surfaces = []
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        surfaces.append(surface_of(node, scene.geometry[geometry], matrix))
    return surfaces


main(trimesh.__version__, read)
