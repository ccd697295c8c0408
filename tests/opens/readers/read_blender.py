import sys

import bpy

sys.path.insert(0, __file__.rsplit('/', 1)[0])
from report import hex_of_linear, main, surface  # noqa: E402


def importer(suffix):
    known = {
        'glb': [lambda path: bpy.ops.import_scene.gltf(filepath=path)],
        # Axes as in the file; Blender's own choice for OBJ is Y up.
        'stl': [lambda path: bpy.ops.wm.stl_import(filepath=path), lambda path: bpy.ops.import_mesh.stl(filepath=path)],
        'ply': [lambda path: bpy.ops.wm.ply_import(filepath=path), lambda path: bpy.ops.import_mesh.ply(filepath=path)],
        'obj': [lambda path: bpy.ops.wm.obj_import(filepath=path)],
    }
    known['usda'] = known['usdz'] = [lambda path: bpy.ops.wm.usd_import(filepath=path)]
    return known[suffix]


def colour_of(mesh):
    material = mesh.materials[0] if mesh.materials else None
    if not material:
        return None
    nodes = material.node_tree.nodes if material.use_nodes else {}
    shader = nodes.get('Principled BSDF')
    return hex_of_linear(list(shader.inputs['Base Color'].default_value if shader else material.diffuse_color))


def read(path, suffix):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    calls = importer(suffix)
    for at, call in enumerate(calls):
        try:
            call(path)
            break
        except AttributeError:  # an older Blender has another name for it
            if at + 1 == len(calls):
                raise
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
                colour=colour_of(mesh),
                normals=mesh.has_custom_normals,
                values=[a.name for a in mesh.attributes if a.domain == 'POINT' and a.name not in ('position', '.select_vert')],
            )
        )
    return surfaces


main(bpy.app.version_string, read)
