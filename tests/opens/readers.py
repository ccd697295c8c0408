"""The programs that read the files: each is a script in readers/ that prints JSON (readers/report.mjs, readers/report.py)."""
import json
import os
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

GLB = ('glb-none', 'glb-quantized', 'glb-meshopt', 'glb-khr-meshopt', 'glb-draco')
NPM, DEBIAN_12, DEBIAN_13 = 'npm', 'bookworm', 'trixie'
BOTH = (DEBIAN_12, DEBIAN_13)
SECONDS = 180


@dataclass
class Reader:
    name: str
    program: str
    where: str
    kinds: tuple  # the formats that it says it reads

    @property
    def key(self):
        return f'{self.name}@{self.where}'


def row(name, program, places, kinds):
    """`kinds` are formats; glb stands for all its codecs."""
    every = sum([GLB if kind == 'glb' else (kind,) for kind in kinds.split()], ())
    return [Reader(name, program, where, every) for where in places]


READERS = [
    *row('three', 'three', [NPM], 'glb drc stl ply obj 3mf usda usdz vtk vtp'),
    *row('babylon', 'Babylon.js', [NPM], 'glb stl obj'),
    *row('gltf_transform', 'glTF Transform', [NPM], 'glb'),
    *row('loaders_gl', 'loaders.gl', [NPM], 'glb drc obj'),
    *row('manifold', 'Manifold', [NPM], 'glb'),
    *row('draco3d', 'draco3d', [NPM], 'drc'),
    *row('vtkjs', 'vtk.js', [NPM], 'glb drc stl ply obj vtk vtp'),
    *row('itk_wasm', 'ITK-Wasm mesh-io', [NPM], 'stl obj off vtk'),
    *row('niivue', 'NiiVue', [NPM], 'stl ply obj off vtk gii'),
    *row('molstar', 'Mol*', [NPM], 'ply obj vtp'),
    *row('online_3d_viewer', 'Online 3D Viewer', [NPM], 'glb stl ply obj off 3mf'),
    *row('vtk', 'VTK', BOTH, 'glb stl ply obj vtk vtp'),
    *row('paraview', 'ParaView', BOTH, 'glb stl ply obj vtk vtp'),
    *row('f3d', 'F3D', [DEBIAN_12], 'glb stl ply obj vtk vtp'),
    *row('f3d', 'F3D', [DEBIAN_13], 'glb stl ply obj vtk vtp 3mf off'),
    *row('blender', 'Blender', BOTH, 'glb stl ply obj'),
    *row('assimp', 'assimp', BOTH, 'glb stl ply obj off 3mf'),
    *row('trimesh', 'trimesh', [DEBIAN_13], 'glb stl ply obj off 3mf'),
    *row('meshio', 'meshio', BOTH, 'stl ply obj off'),
    *row('meshlab', 'MeshLab', [DEBIAN_12], 'stl ply obj off'),
    *row('cloudcompare', 'CloudCompare', BOTH, 'stl ply obj off vtk'),
    *row('gmsh', 'Gmsh', [DEBIAN_12], 'stl ply vtk'),
    *row('gmsh', 'Gmsh', [DEBIAN_13], 'stl ply off vtk'),
    *row('prusaslicer', 'PrusaSlicer', BOTH, 'stl obj 3mf'),
    *row('lib3mf', 'lib3mf', [DEBIAN_12], '3mf'),
    *row('savitar', 'Savitar (Cura)', BOTH, '3mf'),
    *row('admesh', 'ADMesh', BOTH, 'stl'),
    *row('workbench', 'Connectome Workbench', BOTH, 'gii'),
    *row('nibabel', 'nibabel', BOTH, 'gii'),
]


# These files end their programs with a signal. That was seen once, and they are not given to them again.
ENDS = {
    ('vtk', DEBIAN_12): ('glb-meshopt', 'glb-khr-meshopt', 'glb-draco'),
    ('f3d', DEBIAN_12): ('glb-quantized', 'glb-meshopt', 'glb-khr-meshopt', 'glb-draco'),
    ('meshlab', DEBIAN_12): ('obj',),
}


def inside(there, *command):
    """The command in that Debian, with nothing of this environment."""
    environment = ['PATH=/usr/sbin:/usr/bin:/sbin:/bin', 'HOME=/root', 'LC_ALL=C.UTF-8', 'LIBGL_ALWAYS_SOFTWARE=1']
    return ['env', '-i', *environment, 'chroot', str(there), *command]


def command_of(reader, folder, path):
    script = f'/opens/readers/read_{reader.name}.py'
    there = folder / reader.where
    if reader.where == NPM:
        return ['node', str(there / f'readers/read_{reader.name}.mjs'), str(path)]
    file = f'/opens/files/{path.name}'
    if reader.name == 'blender':
        return inside(there, 'blender', '--background', '--factory-startup', '--python', script, '--', file)
    if reader.name == 'paraview':
        return inside(there, 'pvpython', script, file)
    modules = '/opt/vtk/usr/lib/python3/dist-packages' if reader.name == 'vtk' else ''
    return inside(there, 'env', f'PYTHONPATH={modules}', 'python3', script, file)


def read(reader, folder, file):
    """The reader's answer: {'version', 'surfaces'}, or with {'ends': ..} or {'error': ..}."""
    if file.kind in ENDS.get((reader.name, reader.where), ()):
        return {'ends': 'ends (not run again)'}
    process = subprocess.Popen(
        ['nice', *command_of(reader, folder, file.path)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, 'PYTHONDONTWRITEBYTECODE': '1'},
        start_new_session=True,
    )
    try:
        text = process.communicate(timeout=SECONDS)[0].decode(errors='replace')
    except subprocess.TimeoutExpired:
        # Also the display and whatever else it has started, which keep the pipe open.
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return {'error': f'takes more than {SECONDS} s'}
    lines = [line for line in text.splitlines() if line.startswith('{"version"')]
    if lines:
        answer = json.loads(lines[-1])
        return {'ends': answer['error'], **answer} if 'signal' in answer.get('error', '') else answer
    return {'ends': f'status {process.returncode}', 'text': text[-500:]}


def mount(folder):
    """Programs need /proc in their Debian."""
    for where in BOTH:
        if not os.path.ismount(folder / where / 'proc'):
            subprocess.run(['mount', '-t', 'proc', 'proc', str(folder / where / 'proc')], check=True)


def unmount(folder):
    for where in BOTH:
        if os.path.ismount(folder / where / 'proc'):
            subprocess.run(['umount', '--lazy', str(folder / where / 'proc')], check=True)


def share(folder, files):
    """Copies the scripts and the files to where each program can see them."""
    scripts = Path(__file__).parent / 'readers'
    for where, suffix in ((NPM, 'mjs'), (DEBIAN_12, 'py'), (DEBIAN_13, 'py')):
        there = folder / where if where == NPM else folder / where / 'opens'
        targets = [(there / 'readers', scripts.glob(f'*.{suffix}'))]
        if where != NPM:
            targets.append((there / 'files', files))
        for target, sources in targets:
            subprocess.run(['rm', '-rf', str(target)], check=True)
            target.mkdir(parents=True)
            subprocess.run(['cp', *map(str, sources), str(target)], check=True)
