"""Measures which thin walls, gaps and rods of masks survive: in isomesh's schemes, and in VTK.

Usage: thin_walls.py ISOMESH [--daemon ISOMESHD] [--directions 60]

ISOMESH is the command, whose `local` makes the meshes; with --daemon if isomeshd is not beside it. The
python that runs this needs numpy, and VTK for its column (Debian: python3-vtk9, python3-numpy).

Each shape is drawn into masks of 32 x 32 x 32 voxels: a voxel has the value 1 if its centre is in the
shape. Directions are spread evenly over half a sphere, and centres of shapes lie anywhere between
voxels. The surface is that at 0.5, closed, without smoothing. Prints a table in Markdown. A cell has
in how many of the directions something is wrong, and how much there is of it in all of them:
  shell, disc  holes through the wall (and, of a disc, more parts than one)
  gap          bridges over the gap between the halves of a ball
  rod          parts beyond the first
A second table has how many of the masks have another topology when they are mirrored along x, or moved
by a voxel along x: masks up to 1.5 voxels, in a third of the directions.
"""
import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy

try:
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkMarchingCubes, vtkPolyDataConnectivityFilter
except ImportError:
    vtkImageData = None

SIZE = 32
SCHEMES = ("6", "5", "bcc")
THICKNESSES = (1.0, 1.25, 1.5, 1.75, 2.0)


def directions(count):
    """Unit vectors with z > 0, on a spiral."""
    turn = math.pi * (3 - math.sqrt(5))
    for n in range(count):
        z = (n + 0.5) / count
        radius = math.sqrt(1 - z * z)
        yield numpy.array([radius * math.cos(turn * n), radius * math.sin(turn * n), z])


def shapes(direction, centre):
    """A function of a thickness for each kind: the mask. The number of components and the Euler number are those of the shape."""
    from_centre = numpy.stack(numpy.indices((SIZE, SIZE, SIZE)), axis=-1) - centre
    height = from_centre @ direction
    distance = numpy.linalg.norm(from_centre, axis=-1)
    from_axis = numpy.sqrt(numpy.maximum(distance**2 - height**2, 0))
    return {
        "shell": (lambda t: abs(distance - 11) <= t / 2, 2, 4),
        "disc": (lambda t: (abs(height) <= t / 2) & (distance <= 11), 1, 2),
        "gap": (lambda t: (abs(height) >= t / 2) & (distance <= 11), 2, 4),
        "rod": (lambda t: (from_axis <= t / 2) & (distance <= 12), 1, 2),
    }


def all_masks(count):
    """(kind, thickness, mask, components, Euler number) of each direction."""
    random = numpy.random.default_rng(1)
    for direction in directions(count):
        centre = SIZE / 2 - 0.5 + random.uniform(-0.5, 0.5, 3)
        for kind, (draw, components, euler) in shapes(direction, centre).items():
            for thickness in THICKNESSES:
                yield kind, thickness, draw(thickness).astype("uint8"), components, euler


def write(path, mask):
    header = (
        "NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\n"
        f"sizes: {SIZE} {SIZE} {SIZE}\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
        "space origin: (0,0,0)\nencoding: raw\n\n"
    )
    path.write_bytes(header.encode() + mask.tobytes(order="F"))


def topologies(options, scheme, masks):
    """(components, Euler number) of the surface of each mask."""
    with tempfile.TemporaryDirectory() as path:
        return topologies_in(options, scheme, masks, pathlib.Path(path))


def topologies_in(options, scheme, masks, folder):
    files = [folder / f"{number:06}.nrrd" for number in range(len(masks))]
    for file, mask in zip(files, masks):
        write(file, mask)
    command = [options.isomesh, "local", *files, "--iso", "0.5", "--passes", "0", "--close", "--scheme", scheme]
    command += ["--json", "--quiet", "--format", "stl", "-o", f"{folder}/{scheme}/"]
    if options.daemon:
        command += ["--daemon", options.daemon]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    made = {}
    for line in run.stdout.splitlines():
        job = json.loads(line)
        made[pathlib.Path(job["input"]).name] = job["mesh"]["components"], job["mesh"]["euler"]
    return [made[file.name] for file in files]


def vtk_topology(mask):
    """The same of VTK's marching cubes."""
    image = vtkImageData()
    image.SetDimensions(SIZE, SIZE, SIZE)
    image.GetPointData().SetScalars(numpy_to_vtk(mask.ravel(order="F"), deep=True))
    cubes = vtkMarchingCubes()
    cubes.SetInputData(image)
    cubes.SetValue(0, 0.5)
    parts = vtkPolyDataConnectivityFilter()
    parts.SetInputConnection(cubes.GetOutputPort())
    parts.SetExtractionModeToAllRegions()
    parts.Update()
    surface = cubes.GetOutput()
    triangles = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    edges = numpy.sort(numpy.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    euler = len(numpy.unique(triangles)) - len(numpy.unique(edges, axis=0)) + len(triangles)
    return parts.GetNumberOfExtractedRegions(), euler


def wrong(kind, found, components, euler):
    """How many holes, bridges or further parts there are, and whether the number of parts is wrong."""
    if kind == "rod":
        return found[0] - 1, found[0] != 1
    # Each hole or bridge is a handle, or joins two parts: both take two of the Euler number.
    handles = (euler - 2 * components + 2 * found[0] - found[1]) // 2 + max(0, components - found[0])
    return handles, found[0] > components


def cell_of(results):
    bad = sum(1 for number, is_apart in results if number or is_apart)
    if bad == 0:
        return "0"
    apart = sum(1 for _, is_apart in results if is_apart)
    return f"{bad}: {sum(number for number, _ in results)}" + (f", {apart} apart" if apart else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("isomesh")
    parser.add_argument("--daemon")
    parser.add_argument("--directions", type=int, default=60)
    options = parser.parse_args()
    columns = [f"`scheme` {name}" for name in SCHEMES]
    masks = list(all_masks(options.directions))
    drawn = [mask for _, _, mask, _, _ in masks]
    meshers = [lambda some, scheme=scheme: topologies(options, scheme, some) for scheme in SCHEMES]
    if vtkImageData is None:
        print("thin_walls.py: VTK is not there, so it has no column", file=sys.stderr)
    else:
        columns.append("VTK's marching cubes")
        meshers.append(lambda some: [vtk_topology(mask) for mask in some])
    found = [mesher(drawn) for mesher in meshers]
    print("| shape | thickness | " + " | ".join(columns) + " |")
    print("|---|---|" + "---|" * len(columns))
    for kind in ("shell", "disc", "gap", "rod"):
        for thickness in THICKNESSES:
            chosen = [n for n, mask in enumerate(masks) if mask[:2] == (kind, thickness)]
            cells = [cell_of([wrong(kind, column[n], *masks[n][3:]) for n in chosen]) for column in found]
            print(f"| {kind} | {thickness:g} | " + " | ".join(cells) + " |")
    per_direction = len(masks) // options.directions
    some = [n for n in range(len(masks)) if n // per_direction % 3 == 0 and masks[n][1] <= 1.5]
    print("\n| of " + str(len(some)) + " masks, other topology when | " + " | ".join(columns) + " |")
    print("|---|" + "---|" * len(columns))
    for name, change in (("mirrored", lambda mask: mask[::-1]), ("moved", lambda mask: numpy.roll(mask, 1, axis=0))):
        changed = [mesher([change(drawn[n]) for n in some]) for mesher in meshers]
        counts = [sum(1 for n, one in zip(some, other) if column[n] != one) for column, other in zip(found, changed)]
        print(f"| {name} | " + " | ".join(str(count) for count in counts) + " |")


if __name__ == "__main__":
    main()
