"""The files that the readers get, and what each of them holds."""
import json
import re
import subprocess
import zipfile
from dataclasses import dataclass, field

import volumes

CODECS = ('none', 'quantized', 'meshopt', 'khr-meshopt', 'draco')
# Volume: the options of its job.
OPTIONS = {
    'ball': ['--iso', '0'],
    'open': ['--iso', '0'],
    'lods': ['--iso', '0', '--lods', '1,0.25'],
    'distances': ['--iso', '0', '--distances'],
    'head': ['--iso', '0'],
    'atlas': ['--labels', 'all']
    + [f'--label-name={label}={name}' for label, (name, _) in volumes.LABELS.items()]
    + [f'--label-color={label}={colour}' for label, (_, colour) in volumes.LABELS.items()],
}
# Connectome Workbench goes by this name.
SUFFIXES = {'gii': 'surf.gii'}
VOLUMES = {'ball': volumes.ball, 'open': volumes.open_surface, 'lods': volumes.ball, 'distances': volumes.ball}
VOLUMES |= {'head': volumes.head, 'atlas': volumes.atlas}


@dataclass
class File:
    """A kind is a format, or a format with a codec: `glb-draco`. Bounds are in LPS millimetres."""

    shape: str
    kind: str
    path: object
    triangles: int = 0
    bounds: list = None
    labels: dict = field(default_factory=dict)  # name: (colour, triangles)

    @property
    def name(self):
        return f'{self.shape}-{self.kind}'

    @property
    def suffix(self):
        return self.kind.split('-')[0]


# The shapes that are not an atlas or a ball show what is special; the formats are those that can hold it.
KINDS = {
    'atlas': [*(f'glb-{codec}' for codec in CODECS), 'ply', 'obj', '3mf', 'usda', 'usdz', 'vtk', 'vtp'],
    'ball': ['drc', 'stl', 'ply', 'off', 'gii'],
    'open': ['glb-none', 'stl', '3mf'],
    'lods': ['glb-none', 'glb-draco'],
    'distances': ['glb-none', 'glb-draco'],
    'head': ['glb-none', 'glb-draco'],
}


def make(isomesh, folder):
    """Makes all files in the folder, and returns them."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for shape, kinds in KINDS.items():
        volume = folder / f'{shape}.nii'
        VOLUMES[shape](volume)
        for codec in [None, *CODECS]:
            files = [File(shape, kind, folder / f'{shape}-{kind}.{SUFFIXES.get(kind, kind.split("-")[0])}') for kind in kinds]
            files = [file for file in files if (codec and file.kind == f'glb-{codec}') or (not codec and '-' not in file.kind)]
            if not files:
                continue
            outputs = [option for file in files for option in ('-o', str(file.path))]
            codecs = ['--glb-codec', codec] if codec else []
            command = [isomesh, 'local', str(volume), '--json', *OPTIONS[shape], *codecs, *outputs]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            describe(files, json.loads(done.stdout)['mesh'])
            made += files
    return made


def describe(files, mesh):
    for file in files:
        labels = mesh.get('labels', [])
        file.triangles = sum(label['triangles'] for label in labels) or mesh['triangles']
        file.bounds = mesh['bounds']
        file.labels = {label['name']: (label['color'], label['triangles']) for label in labels}


def mesher_of(files):
    """The version of the mesher, as its 3MF files tell it."""
    with zipfile.ZipFile(next(file.path for file in files if file.kind == '3mf')) as archive:
        return re.search('isomesh, mesher ([^<]+)<', archive.read('3D/3dmodel.model').decode()).group(1)
