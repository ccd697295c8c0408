"""Says in a few words how much of a file arrived."""
import itertools
import re

UNITS = {1: 'mm', 0.001: 'm', 0.1: 'cm'}
# The unit and the axes that the file's own specification, or our own words in it, gives the object; others are in LPS millimetres.
EXPECTED = {'glb': ('m', 'Y up'), 'usda': ('mm', 'Y up'), 'usdz': ('mm', 'Y up'), 'gii': ('mm', 'RAS')}
# Blender turns glTF to its own axes, with Z up, and Manifold also to millimetres. three scales USD to its own unit, the metre.
OWN = {('blender', 'glb'): ('m', 'LPS'), ('manifold', 'glb'): ('mm', 'LPS')}
OWN |= {('three', 'usda'): ('m', 'Y up'), ('three', 'usdz'): ('m', 'Y up')}
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
    return None


def place(file, surfaces, reader):
    with_bounds = [s['bounds'] for s in surfaces if s.get('bounds')]
    if not with_bounds:
        return '–', True
    found = [[f(b[end][axis] for b in with_bounds) for axis in range(3)] for end, f in ((0, min), (1, max))]
    unit, axes = place_of(found, file.bounds) or ('', 'wrong place')
    expected = OWN.get((reader, file.suffix)) or EXPECTED.get(file.suffix, ('mm', 'LPS'))
    return f'{unit}, {axes}'.strip(', '), (unit, axes) == expected


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
    if len(surfaces) > 1 and not by_name(file, surfaces) and not all(by_count(file, surfaces).values()):
        return 'other surfaces', False
    if vertices == 3 * count and file.suffix != 'stl':
        return 'all, three vertices each', True
    return f'all, {first["note"]}' if first.get('note') else 'all', True


def plain(name):
    return re.sub('[^A-Za-z0-9]+', '_', name)


def by_name(file, surfaces):
    """(how the names arrive, {label: its surfaces}), or None if a label's name does not arrive."""
    ways = {'all': str.__eq__, 'longer': lambda name, other: name in other, 'changed': lambda name, other: plain(name) == plain(other)}
    for way, is_same in ways.items():
        found = {name: [s for s in surfaces if is_same(name, str(s.get('name')))] for name in file.labels}
        if found and all(found.values()):
            return way, found
    return None


def by_count(file, surfaces):
    """{label: the surfaces that have as many triangles as it}."""
    return {name: [s for s in surfaces if s['triangles'] == count] for name, (_, count) in file.labels.items()}


def names(file, surfaces):
    if not by_name(file, surfaces):
        arrays = {plain(value) for value in surfaces[0].get('values') or []}
        return ('as arrays', True) if len(surfaces) == 1 and arrays >= {plain(name) for name in file.labels} else ('none', False)
    way, found = by_name(file, surfaces)
    if any(sum(s['triangles'] for s in found[name]) != count for name, (_, count) in file.labels.items()):
        return 'of other labels', False
    if way != 'changed':
        return way, True
    changed = [named[0]['name'] for named in found.values()]
    return f'as `{max(changed, key=lambda name: sum(not c.isalnum() for c in name))}`', True


def labels(file, surfaces):
    found = {label for s in surfaces for label in s.get('labels') or []}
    return ('yes', True) if len(found) == len(file.labels) else ('no', False)


def close(a, b):
    # three 0.187 rounds colours of vertices to bytes of linear light.
    return b and all(abs(int(a[at : at + 2], 16) - int(b[at : at + 2], 16)) <= 6 for at in (1, 3, 5))


def colours_of(surfaces):
    return [colour for s in surfaces for colour in s.get('colours') or [s.get('colour')]]


def colours(file, surfaces):
    found = (by_name(file, surfaces) or (None, by_count(file, surfaces)))[1]
    if len(surfaces) > 1:
        is_right = all(
            found[name] and all(close(colour, other) for other in colours_of(found[name])) for name, (colour, _) in file.labels.items()
        )
    else:
        is_right = all(any(close(colour, other) for other in colours_of(surfaces)) for colour, _ in file.labels.values())
    if is_right:
        return 'all', True
    distinct = sorted({colour for colour in colours_of(surfaces) if colour})
    if len(distinct) < len(file.labels):
        return 'none', False
    return f'other, such as `{distinct[0]}`', False


def distances(surfaces):
    values = sorted({value for s in surfaces for value in s.get('values') or [] if 'normal' not in value.lower()})
    kept = [value for value in values if 'distance' in value.lower()]
    return (f'`{kept[0]}`', True) if kept else (f'`{values[0]}`', False) if values else ('dropped', False)


def cells(file, answer, reader):
    """{column: (words, whether that is right)} for a reader's answer."""
    if 'ends' in answer:
        return {'triangles': (answer['ends'], False)}
    surfaces = [s for s in answer.get('surfaces', []) if s['triangles'] != 0]
    if not surfaces:
        return {'triangles': ('does not open' if 'error' in answer else '0 triangles', False)}
    result = {'triangles': triangles(file, surfaces), 'place': place(file, surfaces, reader)}
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
        result['distances'] = distances(surfaces) if 'values' in told else ('–', True)
    return result
