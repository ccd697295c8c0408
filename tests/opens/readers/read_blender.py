import sys

import bpy

sys.path.insert(0, __file__.rsplit('/', 1)[0])
from report import hex_of, hex_of_linear, main, surface  # noqa: E402


# Newer names first.
OPERATORS = {
    'glb': ['import_scene.gltf'],
    'stl': ['wm.stl_import', 'import_mesh.stl'],
    'ply': ['wm.ply_import', 'import_mesh.ply'],
    'obj': ['wm.obj_import'],
}


def load(path, suffix):
    for name in OPERATORS[suffix]:
        module, operator = name.split('.')
        if operator in dir(getattr(bpy.ops, module)):
            load_it = getattr(getattr(bpy.ops, module), operator)
            try:
                load_it(filepath=path)
                return None
            except RuntimeError:
                if suffix != 'glb':
                    raise
            # Blender 3.4 of Debian 12 has a numpy that its importer does not know, and needs it for the normals of a file.
            load_it(filepath=path, import_shading='SMOOTH')
            return 'with Shading: Smooth'
    raise RuntimeError('no importer')


def colour_of(mesh):
    material = mesh.materials[0] if mesh.materials else None
    if not material:
        return None
    nodes = material.node_tree.nodes if material.use_nodes else {}
    shader = nodes.get('Principled BSDF')
    return hex_of_linear(list(shader.inputs['Base Color'].default_value if shader else material.diffuse_color))


def read(path, suffix):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    note = load(path, suffix)
    surfaces = []
    for thing in bpy.data.objects:
        if thing.type != 'MESH' or not thing.visible_get():
            continue
        mesh = thing.data
        mesh.calc_loop_triangles()
        surfaces.append(
            surface(
                [thing.matrix_world @ vertex.co for vertex in mesh.vertices],
                len(mesh.loop_triangles),
                name=thing.name,
                note=note,
                colour=colour_of(mesh),
                colours=sorted({hex_of(c.color_srgb) for layer in mesh.color_attributes for c in layer.data}),
                normals=mesh.has_custom_normals,
                values=[a.name for a in mesh.attributes if a.domain == 'POINT' and a.name not in ('position', '.select_vert')],
            )
        )
    return surfaces


main(bpy.app.version_string, read)
