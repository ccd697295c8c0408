"""Measures how much of its area and volume a flat cylinder with a sharp rim loses.

Usage: rims.py ISOMESH [--daemon ISOMESHD] [--positions 20] [--scale 1]

ISOMESH is the command, whose `local` makes the meshes; with --daemon if isomeshd is not beside it.

The cylinder is 40 voxels wide and 4 thick, times the scale. Its axis is that of z, and its centre lies anywhere between
voxels. Samples are signed distances, meshed at 0, and for `labels` masks. Prints a table in Markdown:
the means over all positions, of the loss of the true area, then of the true volume.
"""
import argparse
import array
import json
import math
import pathlib
import random
import subprocess
import tempfile

RADIUS, HALF = 20, 2
JOBS = (
    ("none", ("--passes", "0")),
    ("`optimize`", ("--smoothing", "optimize")),
    ("`taubin`", ("--smoothing", "taubin")),
    ("`labels`", ()),
    ("`laplacian`, the default", ()),
)


def depth(point, centre, scale):
    """The signed distance from the cylinder, positive inside."""
    across = math.hypot(point[0] - centre[0], point[1] - centre[1]) - scale * RADIUS
    along = abs(point[2] - centre[2]) - scale * HALF
    return -min(max(across, along), 0.0) - math.hypot(max(across, 0.0), max(along, 0.0))


def write_nrrd(file, kind, size, samples):
    header = (
        f"NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {size[0]} {size[1]} {size[2]}\nspace: LPS\n"
        "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n"
    )
    file.write_bytes(header.encode() + samples.tobytes())


def write_volumes(folder, number, scale, anywhere):
    size = [2 * scale * half + 11 for half in (RADIUS, RADIUS, HALF)]
    centre = [count // 2 + anywhere.random() for count in size]
    points = ((x, y, z) for z in range(size[2]) for y in range(size[1]) for x in range(size[0]))
    depths = array.array("f", (depth(point, centre, scale) for point in points))
    write_nrrd(folder / f"distances{number}.nrrd", "float", size, depths)
    write_nrrd(folder / f"mask{number}.nrrd", "uint8", size, array.array("B", (d >= 0 for d in depths)))


def losses(options, folder, kind, arguments):
    """The mean losses of area and volume, in percent."""
    files = sorted(folder.glob(kind + "*.nrrd"))
    daemon = ["--daemon", options.daemon] if options.daemon else []
    what = ["--labels", "1"] if kind == "mask" else ["--iso", "0"]
    command = [options.isomesh, "--json", "local", *files, *what, *arguments, *daemon, "-o", folder / "out{name}.stl"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    meshes = [json.loads(line)["mesh"] for line in printed.splitlines()]
    area = sum(mesh["area_mm2"] for mesh in meshes) / len(meshes)
    volume = sum(mesh["volume_mm3"]["smoothed"] for mesh in meshes) / len(meshes)
    radius, half = options.scale * RADIUS, options.scale * HALF
    true_area = 2 * math.pi * radius**2 + 4 * math.pi * radius * half
    return 100 * (1 - area / true_area), 100 * (1 - volume / (2 * math.pi * radius**2 * half))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("isomesh")
    parser.add_argument("--daemon")
    parser.add_argument("--positions", type=int, default=20)
    parser.add_argument("--scale", type=int, default=1)
    options = parser.parse_args()
    anywhere = random.Random(1)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for number in range(options.positions):
            write_volumes(folder, number, options.scale, anywhere)
        print('| smoothing | joined | `"regularize": false` |\n|---|---|---|')
        for title, arguments in JOBS:
            kind = "mask" if title == "`labels`" else "distances"
            cells = [losses(options, folder, kind, (*arguments, *more)) for more in ((), ("--no-regularize",))]
            print(f"| {title} | " + " | ".join(f"{area:.1f} %, {volume:.1f} %" for area, volume in cells) + " |")


if __name__ == "__main__":
    main()
