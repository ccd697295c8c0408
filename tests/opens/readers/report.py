"""Shared by all readers in Python. `main(version, read)` reads the file that the command line names and prints one line of JSON:
{version, surfaces: [{name, colour, triangles, vertices, bounds, normals, labels, values}]} or {version, error}.
"""
import json
import os
import re
import struct
import subprocess
import sys


def surface(points, triangles, **more):
    """`points` are rows of x, y, z; `triangles` is how many there are; `more` has name, colour (#rrggbb), normals, labels, values."""
    columns = list(zip(*[[float(v) for v in point] for point in points]))
    bounds = [[f(column) for column in columns] for f in (min, max)] if columns else None
    return {'triangles': int(triangles), 'vertices': len(points), 'bounds': bounds, **more}


def hex_of(values):
    return '#' + ''.join(f'{max(0, round(255 * float(v))):02x}' for v in values[:3])


def hex_of_linear(values):
    """Linear red, green and blue from 0 to 1, as glTF has them."""
    return hex_of([12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055 for v in values[:3]])


def said(*command, **options):
    """Returns the text that a program prints; raises if it is ended by a signal."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors='replace', **options)
    if done.returncode < 0 or 128 < done.returncode < 160:
        raise RuntimeError(f'ends with signal {done.returncode % 128}')
    return done.stdout


def package_version(name):
    """The upstream part of a Debian package's version."""
    full = said('dpkg-query', '--show', '--showformat=${Version}', name)
    return full.split(':')[-1].split('-')[0].split('+')[0].split('~')[0]


def surface_of_stl(path):
    """A binary STL that a program wrote."""
    with open(path, 'rb') as file:
        data = file.read()[84:]
    rows = [struct.unpack_from('<12f', data, at) for at in range(0, len(data) - 49, 50)]
    return surface([row[at : at + 3] for row in rows for at in (3, 6, 9)], len(rows))


def surface_of_obj(path):
    """An OBJ that a program wrote, with the colours that some programs put behind the coordinates."""
    with open(path, encoding='utf-8', errors='replace') as file:
        lines = [line.split() for line in file]
    rows = [line[1:] for line in lines if line[:1] == ['v']]
    colours = {hex_of(row[3:6]) for row in rows if len(row) > 5}
    return surface([row[:3] for row in rows], sum(line[:1] == ['f'] for line in lines), colours=sorted(colours))


def surface_of_ply(path):
    """A PLY that a program wrote as text, with triangles only."""
    with open(path, encoding='utf-8', errors='replace') as file:
        text = file.read()
    head, body = text.split('end_header\n')
    counts = dict(re.findall(r'element (\w+) (\d+)', head))
    names = re.findall(r'property (?!list)\w+ (\w+)', head.split('element face')[0])
    rows = [dict(zip(names, line.split())) for line in body.splitlines()[: int(counts['vertex'])]]
    colours = {hex_of([int(row[name]) / 255 for name in ('red', 'green', 'blue')]) for row in rows if 'red' in row}
    return surface([[row[axis] for axis in 'xyz'] for row in rows], counts['face'], colours=sorted(colours))


def main(version, read, path=None):
    path = path or sys.argv[-1]
    answer = {'version': version}
    try:
        answer['surfaces'] = read(path, path.rsplit('.', 1)[-1])
    except (Exception, SystemExit) as error:  # whatever a reader raises is its answer
        answer['error'] = (str(error).strip() or repr(error)).splitlines()[-1]
    # Some programs have a standard output of their own, and some end badly when they clean up.
    os.write(1, b'\n' + json.dumps(answer).encode() + b'\n')
    os._exit(0)
