"""Writes docs/opens-in.md from what the readers answered."""
import re

import judge
import reasons

KINDS = ['glb-none', 'glb-quantized', 'glb-meshopt', 'glb-khr-meshopt', 'glb-draco', 'drc', 'stl', 'ply', 'obj', '3mf', 'usda', 'usdz', 'off']
KINDS += ['vtk', 'vtp', 'gii']
MAIN = {'drc': 'ball', 'stl': 'ball', 'off': 'ball', 'gii': 'ball'}
COLUMNS = ['triangles', 'place', 'names', 'colours', 'labels', 'normals', 'distances']
SPECIAL = {
    'open': 'a surface that is not closed',
    'lods': 'two levels of detail',
    'distances': 'distances',
    'head': 'a large surface',
    'ball': 'one surface',
}


def title(kind):
    return f'`glb`, {kind[4:]}' if kind.startswith('glb') else f'`{kind}`'


def main_of(kind):
    """The file of this kind that the large table is about."""
    return f'{MAIN.get(kind, "atlas")}-{kind}'


def short(cells):
    """One cell of the large table."""
    words, is_right = cells['triangles']
    if not is_right:
        return f'**{words}**'
    lacks = [
        f'{"other" if cells[column][0].startswith("other") else "no"} {column}'
        for column in ('names', 'colours')
        if column in cells and not cells[column][1]
    ]
    lacks += [cells['place'][0].split(', ')[-1]] if not cells['place'][1] else []
    if lacks:
        return f'**{", ".join(lacks)}**'
    return words.replace(', three vertices each', '')


def row(columns):
    return f'| {" | ".join(columns)} |'


def table(head, rows):
    return ['', row(head), '|' + '---|' * len(head), *map(row, rows)]


def overview(readers, judged):
    rows = []
    for reader, program in readers:
        found = [judged.get((reader.key, main_of(kind))) for kind in KINDS]
        rows.append([program, *('' if cells is None else short(cells) for cells in found)])
    return table(['program', *map(title, KINDS)], rows)


def details(readers, judged, file):
    """Programs that get the same share a row. Those that open nothing of a kind are in the large table."""
    programs = {}
    for reader, program in readers:
        cells = judged.get((reader.key, file))
        if cells and (len(cells) > 1 or file != main_of(file.split('-', 1)[1])):
            programs.setdefault(tuple(cells.get(column, ('–', True)) for column in COLUMNS), []).append(program)
    columns = [column for at, column in enumerate(COLUMNS) if any(cells[at][0] != '–' for cells in programs)]
    rows = []
    for cells, named in programs.items():
        kept = [cell for column, cell in zip(COLUMNS, cells) if column in columns]
        rows.append([', '.join(named), *(words if is_right else f'**{words}**' for words, is_right in kept)])
    return table(['programs', *columns], rows) if rows else []


def versions_of(readers, answers):
    """{key: version}. Raises ValueError for readers that told none."""
    versions = {key[0]: answer['version'] for key, answer in answers.items() if 'version' in answer}
    silent = [reader.key for reader in readers if reader.key not in versions]
    if silent:
        raise ValueError(f'no version was told by {", ".join(silent)}: not run yet, or broken')
    return versions


def write(path, readers, files, answers, mesher):
    """Replaces what stands between the marks in the page. Raises ValueError for a bold cell without a reason, a reason without a
    bold cell, and a reader that told no version."""
    by_name = {file.name: file for file in files}
    wanted = {(reader.key, file.name): reader for reader in readers for file in files if file.kind in reader.kinds}
    answers = {key: answer for key, answer in answers.items() if key in wanted}
    judged = {key: judge.cells(by_name[key[1]], answer, wanted[key].name) for key, answer in answers.items()}
    versions = versions_of(readers, answers)
    named = [(reader, f'{reader.program} {versions[reader.key]}') for reader in readers]
    bold = {
        (key, by_name[name].kind, by_name[name].shape, column)
        for (key, name), cells in judged.items()
        for column, (_, is_right) in cells.items()
        if not is_right
    }
    dates = sorted({answer['date'] for answer in answers.values()})
    when = dates[0] if len(dates) == 1 else f'{dates[0]} to {dates[-1]}'
    lines = [f'Seen on {when}, with files of the mesher {mesher}. [versions.txt](../tests/opens/versions.txt) has the packages.', '']
    lines += ['## Which format in which program', *overview(named, judged), '', '## Why some cells are bold']
    lines += table(['file', 'program', 'what it does'], reasons.rows(named, bold, title))
    lines += ['', '## What arrives']
    for kind in KINDS:
        lines += ['', f'### {title(kind)}', *details(named, judged, main_of(kind))]
    for file in files:
        if file.shape in SPECIAL and file.name != main_of(file.kind):
            lines += ['', f'### {title(file.kind)}: {SPECIAL[file.shape]}', *details(named, judged, file.name)]
    text = path.read_text()
    begin, end = '<!-- tests/opens/run writes from here -->\n', '\n<!-- to here -->'
    path.write_text(re.sub(f'{begin}.*?{end}', lambda _: begin + '\n'.join(lines) + end, text, flags=re.DOTALL))
