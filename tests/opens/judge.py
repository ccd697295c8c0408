"""Says in a few words how much of a file arrived."""
import itertools
import re

UNITS = {1: 'mm', 0.001: 'm', 0.1: 'cm'}
# The unit and axes that the file's specification, or its own text, gives the object.
EXPECTED = {'glb': ('m', 'Y up'), 'usda': ('mm', 'Y up'), 'usdz': ('mm', 'Y up'), 'gii': ('mm', 'RAS')}
# Axes: which of x, y, z of LPS, and with which sign.
AXES = {
    ((0, 1), (1, 1), (2, 1)): 'LPS',
    ((0, -1), (1, -1), (2, 1)): 'RAS',
    ((0, 1), (2, 1), (1, -1)): 'Y up',
    ((0, 1), (2, -1), (1, 1)): 'turned: Y is up',
}


def parity(order):
    swaps = sum(order[a] > order[b] for a, b in itertools.combinations(range(3), 2))
    return -1 if swaps % 2 else 1


def all_axes():
    """Those with a name first."""
    every = [
        tuple(zip(order, signs)) for order in itertools.permutations(range(3)) for signs in itertools.product((1, -1), repeat=3)
    ]
    return sorted(every, key=lambda axes: axes not in AXES)


def moved(bounds, axes, scale):
    corners = [[bounds[end][axis] * sign * scale for end in (0, 1)] for axis, sign in axes]
    return [[min(pair) for pair in corners], [max(pair) for pair in corners]]


def is_mirror(axes):
    signs = 1
    for _, sign in axes:
        signs *= sign
    return parity([axis for axis, _ in axes]) * signs < 0


def place_of(found, truth):
    """(unit, axes or how else it lies) of the bounds that a program found; truth is in LPS millimetres."""
    tolerance = 0.003 * max(high - low for low, high in zip(*truth))
    tries = [(scale, axes) for scale in UNITS for axes in all_axes()]
    for scale, axes in tries:
        if all(abs(a - b) < tolerance * scale for pair in zip(found, moved(truth, axes, scale)) for a, b in zip(*pair)):
            return UNITS[scale], AXES.get(axes, 'mirrored' if is_mirror(axes) else 'turned')
    # A slicer puts what it loads on its bed, where z is 0.
    for scale, axes in tries[:1]:
        ends = [[a - b for a, b in zip(*pair)] for pair in zip(found, moved(truth, axes, scale))]
        if all(abs(a - b) < 2 * tolerance * scale for a, b in zip(*ends)):
            return UNITS[scale], 'on the bed' if abs(found[0][2]) + abs(ends[0][0]) + abs(ends[0][1]) < tolerance else 'moved'
    return None


def place(file, surfaces):
    with_bounds = [s['bounds'] for s in surfaces if s.get('bounds')]
    if not with_bounds:
        return '–', True
    found = [[f(b[end][axis] for b in with_bounds) for axis in range(3)] for end, f in ((0, min), (1, max))]
    unit, axes = place_of(found, file.bounds) or ('', 'wrong place')
    expected = EXPECTED.get(file.suffix, ('mm', 'LPS'))
    # A program may turn and scale what says its unit and its axes.
    right = {expected, (expected[0], 'on the bed')} | {(u, a) for u in ('mm', 'm') for a in ('LPS', expected[1]) if file.suffix in EXPECTED}
    return f'{unit}, {axes}'.strip(', '), (unit, axes) in right


def triangles(file, surfaces):
    first = surfaces[0]
    if first['triangles'] is None:
        return 'opens', True
    count = sum(s['triangles'] for s in surfaces)
    vertices = sum(s['vertices'] or 0 for s in surfaces)
    if count != file.triangles:
        return f'{count} of {file.triangles}', False
    if vertices == 0 and first['vertices'] is not None:
        return '0 vertices', False
    if vertices == 3 * count and file.suffix != 'stl':
        return 'all, three vertices each', True
    return f'all, {first["note"]}' if first.get('note') else 'all', True


def plain(name):
    return re.sub('[^A-Za-z0-9]+', '_', name)


def names(file, surfaces):
    found = [str(s.get('name')) for s in surfaces]
    if all(name in found for name in file.labels):
        return 'all', True
    if all(any(name in other for other in found) for name in file.labels):
        return 'longer', True
    changed = [next((other for other in found if plain(name) == plain(other)), None) for name in file.labels]
    if all(changed):
        return f'as `{max(changed, key=lambda name: sum(not c.isalnum() for c in name))}`', True
    return 'none', False


def labels(file, surfaces):
    found = {label for s in surfaces for label in s.get('labels') or []}
    return ('yes', True) if len(found) == len(file.labels) else ('no', True)


def close(a, b):
    # three 0.187 rounds colours of vertices to bytes of linear light.
    return b and all(abs(int(a[at : at + 2], 16) - int(b[at : at + 2], 16)) <= 6 for at in (1, 3, 5))


def colours(file, surfaces):
    found = [colour for s in surfaces for colour in s.get('colours') or [s.get('colour')]]
    if all(any(close(colour, other) for other in found) for colour, _ in file.labels.values()):
        return 'all', True
    distinct = sorted({colour for colour in found if colour})
    if len(distinct) < len(file.labels):
        return 'none', False
    return f'other, such as `{distinct[0]}`', False


def distances(surfaces):
    values = sorted({value for s in surfaces for value in s.get('values') or [] if 'normal' not in value.lower()})
    kept = [value for value in values if 'distance' in value.lower()]
    return (f'`{kept[0]}`', True) if kept else (f'`{values[0]}`', False) if values else ('dropped', True)


def cells(file, answer):
    """{column: (words, whether that is right)}."""
    if 'ends' in answer:
        return {'triangles': ('ends', False)}
    surfaces = [s for s in answer.get('surfaces', []) if s['triangles'] != 0]
    if not surfaces:
        return {'triangles': ('does not open' if 'error' in answer else '0 triangles', False)}
    result = {'triangles': triangles(file, surfaces), 'place': place(file, surfaces)}
    told = {key for s in surfaces for key in s}
    if file.labels and file.suffix in ('ply', 'vtk', 'vtp'):
        result['labels'] = labels(file, surfaces) if 'labels' in told else ('–', True)
    elif file.labels:
        result['names'] = names(file, surfaces) if 'name' in told else ('–', True)
    if file.labels and file.suffix not in ('vtk', 'vtp'):
        result['colours'] = colours(file, surfaces) if {'colour', 'colours'} & told else ('–', True)
    if file.suffix in ('glb', 'usda', 'usdz'):
        result['normals'] = ('–', True) if 'normals' not in told else ('yes', True) if all(s['normals'] for s in surfaces) else ('no', False)
    if file.shape == 'distances':
        result['distances'] = distances(surfaces)
    return result
