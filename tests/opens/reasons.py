"""The reasons for what is bold in docs/opens-in.md. Each bold cell needs one, and each reason a bold cell."""
from dataclasses import dataclass

COMPRESSED = 'glb-meshopt glb-khr-meshopt glb-draco'
ENCODED = f'glb-quantized {COMPRESSED}'


@dataclass
class Reason:
    kinds: str  # a kind, or several
    readers: str  # keys, or names for all places
    text: str
    columns: str = 'triangles'
    shape: str = ''  # for files of this shape only

    def explains(self, reader, fault):
        key, kind, shape, column = fault
        return (
            key == reader.key
            and {reader.key, reader.name} & set(self.readers.split())
            and kind in self.kinds.split()
            and column in self.columns.split()
            and self.shape in ('', shape)
        )


REASONS = [
    Reason(COMPRESSED, 'vtk paraview f3d assimp blender', 'do not decode it: they report an error, show nothing, or end with a signal'),
    Reason(
        'glb-draco',
        'trimesh',
        'makes a mesh of zeros, without a warning ([finding](../findings/trimesh-draco-makes-zeros.sh))',
    ),
    Reason(COMPRESSED, 'manifold', 'has no decoder in its own reader'),
    Reason('glb-none', 'manifold', 'makes solids, and rejects surfaces that are not closed', shape='open'),
    Reason('glb-none', 'manifold', 'does not open a file with an attribute that it does not know', shape='distances'),
    Reason('glb-meshopt glb-khr-meshopt', 'trimesh vtkjs', 'do not decode it, and report an error'),
    Reason('glb-khr-meshopt', 'babylon gltf_transform', 'do not know the extension yet; `meshopt` is the same data under the older name'),
    Reason('glb-quantized glb-meshopt glb-khr-meshopt', 'online_3d_viewer', 'knows neither KHR_mesh_quantization nor these codecs, and says so'),
    Reason('glb-quantized', 'assimp', 'ignores that the file requires KHR_mesh_quantization, and places the object wrongly', 'place'),
    Reason('glb-quantized', 'vtk@bookworm', 'reads triangles without vertices'),
    Reason('glb-quantized', 'f3d@bookworm', 'ends with a signal'),
    Reason('glb-quantized', 'vtk@trixie f3d@trixie paraview', 'do not know KHR_mesh_quantization: they report an error, or show nothing'),
    Reason('glb-none glb-quantized glb-draco', 'vtkjs trimesh', 'take linear colours for those of a screen, so they are darker', 'colours'),
    Reason('glb-none glb-quantized glb-draco', 'vtkjs paraview', 'name objects by their number', 'names'),
    Reason(
        'glb-none glb-quantized',
        'blender@bookworm',
        'imports no glTF with normals: it needs a numpy before 1.24. Choose *Shading: Smooth* (or *Flat*) in the import dialog, which leaves '
        "the file's normals out",
        'normals',
    ),
    Reason(
        'glb-none',
        'blender',
        'imports all levels, also those outside the scene. Delete the objects whose names end in `level 2` and so on',
        shape='lods',
    ),
    Reason('glb-none glb-draco', 'babylon vtkjs blender@bookworm', 'drop the attribute', 'distances', 'distances'),
    Reason(
        'stl',
        'babylon',
        'exchanges y and z; in a right-handed scene, that is a mirror image ([finding](../findings/babylon-mirrors-stl.sh)). '
        '`STLFileLoader.DO_NOT_ALTER_FILE_COORDINATES = true` prevents it',
        'place',
    ),
    Reason('ply', 'gmsh', 'read only files without colours and labels, such as those of one surface'),
    Reason('ply', 'vtk paraview trimesh', 'leave the property `label` out', 'labels'),
    Reason('obj', 'itk_wasm', 'returns cells that are packed in pairs ([finding](../findings/itk-wasm-obj-cells-packed.sh))'),
    Reason('obj', 'blender', 'turns Y up. Choose *Forward Axis: Y* and *Up Axis: Z* in the import dialog', 'place'),
    Reason('obj', 'blender', 'takes the colours of the `.mtl` file for linear light, so they are lighter', 'colours'),
    Reason('obj', 'vtk@bookworm paraview@bookworm', 'make one surface of all labels, without names; take `vtk`', 'names'),
    Reason('obj', 'meshlab', '`meshlabserver` ends with a signal, also with its own files'),
    Reason('3mf', 'online_3d_viewer', 'darkens colours ([finding](../findings/online-3d-viewer-darkens-3mf.sh))', 'colours'),
    Reason('3mf', 'assimp', 'reads no names; [formats.md](formats.md#3mf) has more', 'names'),
    Reason('3mf', 'assimp@bookworm trimesh', 'reads no colours', 'colours'),
    Reason('vtk', 'vtkjs', 'reads text only, and shows nothing of binary files ([finding](../findings/vtkjs-binary-legacy-file-is-empty.sh))'),
    Reason('vtk', 'cloudcompare gmsh@trixie', "read no binary polygonal data, also not VTK's own"),
    Reason('vtk', 'itk_wasm', 'leaves the labels out', 'labels'),
    Reason('vtp', 'paraview@bookworm', 'reads no VTP whose data are appended, which VTK writes by default. Take `vtk`'),
    Reason(
        'vtp',
        'three',
        "fails at appended raw bytes, which are no valid XML for a browser's parser. It reads arrays that are inline, as text or base64. "
        'Its VTKLoader will be removed with r194',
    ),
]


def files_of(reason, title):
    if reason.shape:
        return '`glb` of a surface that is not closed' if reason.shape == 'open' else f'`glb` with `{reason.shape}`'
    return '; '.join(title(kind) for kind in reason.kinds.split())


def programs_of(named):
    """`VTK 9.1 and 9.3, F3D 3.1`, of pairs of a reader and its name with its version."""
    versions = {}
    for reader, name in named:
        versions.setdefault(reader.program, []).append(name.removeprefix(reader.program).strip())
    return ', '.join(f'{program} {" and ".join(of)}' for program, of in versions.items())


def rows(named, bold, title):
    """Rows of file, programs and reason. Raises ValueError if a bold cell has no reason, or a reason no bold cell."""
    unexplained, found, problems = set(bold), [], []
    for reason in REASONS:
        programs = [(reader, name) for reader, name in named if any(reason.explains(reader, fault) for fault in bold)]
        faults = {fault for fault in bold for reader, _ in programs if reason.explains(reader, fault)}
        wanted = set(reason.readers.split()) - {word for reader, _ in programs for word in (reader.key, reader.name)}
        wanted |= set(reason.kinds.split()) - {kind for _, kind, _, _ in faults}
        if wanted:
            problems.append(f'nothing is bold any more for {", ".join(sorted(wanted))} with the reason: {reason.text}')
        unexplained -= faults
        found.append([files_of(reason, title), programs_of(programs), reason.text])
    problems += [f'no reason in tests/opens/reasons.py for {" ".join(fault)}' for fault in sorted(unexplained)]
    if problems:
        raise ValueError('\n'.join(problems))
    return found
