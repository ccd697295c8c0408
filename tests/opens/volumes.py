"""The volumes that tests/opens/run makes meshes of: small NIfTI files, with a place and axes that cannot be mistaken."""
import math
import struct

ORIGIN = (10, 20, 30)
# Label: name, colour, as a user gives them.
LABELS = {1: ('Liver', '#cc3311'), 2: ('Left kidney', '#33bbee'), 5: ('Rückenmark, hinten', '#ee7733')}


def write_nifti(path, size, spacing, code, sample_bytes, samples):
    header = bytearray(352)
    struct.pack_into('<i', header, 0, 348)
    struct.pack_into('<8h', header, 40, 3, *size, 1, 1, 1, 1)
    struct.pack_into('<2h', header, 70, code, 8 * sample_bytes)
    struct.pack_into('<4f', header, 76, 1, *spacing)
    struct.pack_into('<2f', header, 108, 352, 1)
    header[123] = 2  # millimetres
    struct.pack_into('<2h', header, 252, 0, 1)
    for axis in range(3):
        row = [0, 0, 0, ORIGIN[axis]]
        row[axis] = spacing[axis]
        struct.pack_into('<4f', header, 280 + 16 * axis, *row)
    header[344:348] = b'n+1\0'
    path.write_bytes(bytes(header) + samples)


def points(size):
    return ((x, y, z) for z in range(size[2]) for y in range(size[1]) for x in range(size[0]))


def write_samples(path, size, spacing, value):
    write_nifti(path, size, spacing, 16, 4, b''.join(struct.pack('<f', value(*at)) for at in points(size)))


def ball(path):
    write_samples(path, (24, 24, 24), (1, 1, 1.5), lambda x, y, z: 9 - math.dist((x, y, z), (11.5, 11.5, 11.5)))


def open_surface(path):
    """The same ball, which the volume's border cuts."""
    write_samples(path, (24, 24, 14), (1, 1, 1.5), lambda x, y, z: 9 - math.dist((x, y, z), (11.5, 11.5, 11.5)))


def head(path):
    """About 314 000 triangles: more than one primitive holds."""
    def value(x, y, z):
        folds = math.sin(0.9 * x) * math.cos(0.9 * y) + math.sin(0.9 * y) * math.cos(0.9 * z)
        return min(38 - math.dist((x, y, z), (40, 40, 40)), 6 * folds + 4)

    write_samples(path, (80, 80, 80), (1, 1.1, 1.2), value)


def atlas(path):
    """An organ in two halves that share a wall, and a box beside it."""
    def label(x, y, z):
        if (x - 12) ** 2 + (y - 13) ** 2 + (z - 14) ** 2 < 81:
            return 1 if x < 14 else 2
        return 5 if 20 <= x < 26 and 3 <= y < 9 and 4 <= z < 18 else 0

    size = (28, 28, 28)
    write_nifti(path, size, (1, 1.25, 1.5), 2, 1, bytes(label(*at) for at in points(size)))
