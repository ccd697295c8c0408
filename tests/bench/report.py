#!/usr/bin/python3
"""report.py JSON: draws the report of what `isomesh-bench report DIR` measured, from DIR/report.json.

Writes REPORT.md and one SVG for each figure beside the JSON. Sections that were not measured are left out.
Needs Debian's python3-matplotlib.
"""
import json
import math
import re
import sys
from pathlib import Path

import matplotlib

matplotlib.use('svg')
import matplotlib.pyplot as plt

# The paper's own rows. Its times are of a Pentium III of 600 MHz.
PAPER_SCHEMES = [['the paper, 128x128x128', '5 tetrahedra', '1 631 460', '', '', '', '970 ms', ''],
                 ['the paper, 128x128x128', '6 tetrahedra', '2 027 184', '', '', '', '1.25 s', '']]
PAPER_UNIQUE = [['the paper, 32x32x32', '44 880', '7 415', '0.17', '', '', '', ''],
                ['the paper, 64x64x64', '215 616', '35 888', '0.17', '', '', '', ''],
                ['the paper, 128x128x128', '1 013 592', '171 819', '0.17', '', '', '', '']]
PAPER_GENERATION = {(337863, 5): '37.6 s', (337863, 10): '39.85 s', (71795, 5): '4.58 s'}
VOLUMES = {
    'ct-head': "CT of a head, 256x256x108 int16, from Debian's package invesalius-examples, resampled (trilinear) to cubes",
    'ch2': "MRI of a brain, 181x217x181 uint8, from Debian's package mricron-data",
}


def text_of(value, digits=None):
    if value is None:
        return '-'
    return f'{value:,}'.replace(',', ' ') if digits is None else f'{value:.{digits}f}'


def ms(value):
    if value is None:
        return '-'
    if value >= 1000:
        return f'{value / 1000:.{1 if value >= 10000 else 2}f} s'
    return f'{value:.{0 if value >= 100 else 1 if value >= 10 else 2}f} ms'


def mebibytes(value):
    return '-' if value is None else f'{value / 2**20:.{1 if value < 10 * 2**20 else 0}f} MiB'


def percent(share):
    return f'{100 * share:.1f} %'


def span(values, digits):
    low, high = (f'{value:.{digits}f}' for value in (min(values), max(values)))
    return low if low == high else f'{low} to {high}'


def by(rows, *names):
    """The rows in groups that agree in these members, in the order of their first appearance."""
    groups = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups.items()


def way_of(row):
    return f'{row["tetrahedra"]} tetrahedra, {row["interpolation"]}'


class Report:
    def __init__(self, folder):
        self.folder = folder
        self.text = []
        self.remarks = []

    def heading(self, text):
        self.text.append(f'{"##" if self.text else "#"} {text}\n')

    def paragraph(self, *texts):
        self.text.append(' '.join(texts) + '\n')

    def table(self, head, rows):
        lines = [head, ['---'] + ['---:'] * (len(head) - 1), *rows]
        self.text.append(''.join('| ' + ' | '.join(map(str, line)) + ' |\n' for line in lines)
                         .replace(' --- ', '---').replace(' ---: ', '---:'))

    def bullets(self, lines):
        self.text.append(''.join(f'* {line}\n' for line in lines))

    def figure(self, name, title, x, y, series, log='xy', band=None):
        """Draws lines: (label, [(x, y)]). Points that an axis cannot show are left out."""
        figure, axes = plt.subplots(figsize=(8, 5))
        for label, points in series:
            shown = [(a, b) for a, b in points if b is not None and math.isfinite(b)
                     and (a > 0 or 'x' not in log) and (b > 0 or 'y' not in log)]
            axes.plot([a for a, _ in shown], [b for _, b in shown], marker='o', markersize=3, label=label)
        if band:
            axes.axvspan(*band[:2], alpha=0.15, label=band[2])
        for axis in log:
            getattr(axes, f'set_{axis}scale')('log')
        axes.set(title=title, xlabel=x, ylabel=y)
        axes.grid(alpha=0.3)
        if series:
            axes.legend(fontsize='small')
        figure.savefig(self.folder / f'{re.sub("[^a-z0-9]+", "-", name.lower()).strip("-")}.svg')
        plt.close(figure)

    def write(self):
        if self.remarks:
            self.heading('Where measurement and paper differ')
            self.bullets(self.remarks)
        path = self.folder / 'REPORT.md'
        path.write_text('\n'.join(self.text))
        return path


def write_opening(data, report):
    report.heading('The paper, measured again')
    report.paragraph(
        'Measured by `isomesh-bench report`, written by `tests/bench/report.py`, which also draws the figures. It'
        ' reproduces Tables 2 and 3 and Figures 4, 5 and 6 of "Laplacian mesh smoothing for tetrahedra based volume'
        " visualization\" on this machine, beside the paper's own way of doing it, built again as it describes it,"
        f' and VTK. Times are medians of several runs on {data["threads"]} threads, with memory that was used before,'
        ' unless said otherwise. Ratios hold better than times: other machines and busier days give other times.')
    report.table(['machine', ''], data['machine'].items())
    report.bullets(f'`{name}`: {what}' if name in data['volumes'] else
                   f'`{name}` is missing, and what needs it is left out: {what}' for name, what in VOLUMES.items())


def write_findings(rows, report):
    def cells(row):
        goal = next((f'{words} {row[name]:.2f}' for name, words in
                     (('goal_at_most', 'at most'), ('goal_at_least', 'at least')) if name in row), '')
        verdict = {True: 'reached', False: 'not reached', None: ''}[row.get('reached')]
        value = text_of(row['value'], 2 if row['value'] < 10 else 0)
        return [row['what'], row['isomesh'], row.get('peer', ''), value, goal, verdict]
    report.table(['what', 'isomesh', 'peer', 'value', 'goal', ''], map(cells, rows))


def write_service(rows, report):
    report.heading('What a user gets')
    report.paragraph(
        'A daemon of one worker, measured over HTTP by the C++ client, beside the peers in the same run:'
        " `isomesh-bench service`. A job's times are those that it reports, from the samples on the disk to the file"
        ' on the disk; the daemon is warm, and no mesh is taken from an earlier job. The peers have their samples in'
        ' memory and write no file.')
    write_findings(rows, report)


def write_goals(rows, report):
    report.heading('Against the peers and the goals')
    report.paragraph(
        "The kernels and a job's way through them in this process, without the service. Ratios are medians over pairs"
        " of runs, ours and the peer's in turn, memory as the daemon uses it unless said otherwise.")
    write_findings(rows, report)


def regularised(row):
    return f'{text_of(3 * row["regularized_triangles"])}, {text_of(row["regularized_vertices"])}'


def write_schemes(rows, report):
    report.heading("Five against six tetrahedra (the paper's Table 2)")
    report.paragraph(
        "*Vertices* counts three for every triangle, as the paper does. *The paper's way* is a loop over cells and"
        " tetrahedra that writes triangles with three vertices each, on one thread; in the paper's own rows it is the"
        " paper's time on a Pentium III of 600 MHz. Flying Edges makes marching cubes' triangles, a third as many.")
    report.table(
        ['volume', 'scheme', 'vertices', 'unique', 'isomesh', 'regularised: vertices, unique, isomesh', "the paper's way",
         'Flying Edges'],
        PAPER_SCHEMES + [[row['volume'], f'{row["tetrahedra"]} tetrahedra', text_of(3 * row['triangles']),
                          text_of(row['vertices']), ms(row['isomesh_ms']),
                          f'{regularised(row)}, {ms(row["regularized_ms"])}', ms(row['paper_ms']), ms(row['peer_ms'])]
                         for row in rows])
    factors = {volume: (six['triangles'] / five['triangles'], six['isomesh_ms'] / five['isomesh_ms'])
               for (volume,), (five, six) in by(rows, 'volume')}
    report.bullets(f'{volume}: six give {triangles:.2f} times the triangles of five in {time:.2f} times the time (the'
                   ' paper: 1.24 and 1.29).' for volume, (triangles, time) in factors.items())
    report.remarks.append(
        "The paper's conclusion prefers six tetrahedra for time and number of triangles. Its own Table 2 says the"
        f' opposite; here six give {span([one for one, _ in factors.values()], 2)} times the triangles of five in'
        f' {span([one for _, one in factors.values()], 2)} times the time.')


def write_unique(rows, report):
    report.heading("Vertices and unique vertices (the paper's Table 3)")
    report.paragraph(
        'Six tetrahedra. A closed surface has two triangles for every vertex but a few, so the ratio tends to 1/6; a'
        " boundary raises it. *The paper's way* finds the unique vertices among three per triangle by 250 sorted"
        ' sub-tables; isomesh numbers them while it extracts and never searches.')
    report.table(
        ['volume', 'vertices', 'unique', 'ratio', 'regularised: vertices, unique', "unique, the paper's way", 'its search',
         'Flying Edges, vertices / unique'],
        PAPER_UNIQUE + [[row['volume'], text_of(3 * row['triangles']), text_of(row['vertices']),
                         text_of(row['vertices'] / (3 * row['triangles']), 3), regularised(row),
                         text_of(row['paper_vertices']),
                         ms(row['paper_ms']),
                         f'{text_of(3 * row["peer_triangles"])} / {text_of(row["peer_vertices"])}'
                         if row['peer_triangles'] else '-'] for row in rows])
    report.remarks.append(
        "The 2 027 184 vertices of the paper's Table 2 are exactly twice the 1 013 592 of its Table 3 for a volume of"
        ' the same size; it does not say which surface either is.')


def write_sub_tables(rows, without, report):
    report.heading("Time against the number of sub-tables (the paper's Figure 4)")
    report.paragraph(
        "The CT head, resampled to the cubes whose skin comes nearest to the paper's 337 863 and 71 795 triangles; time"
        " of finding the unique vertices, their neighbours and five passes, the paper's way, on one thread, one run"
        ' each. Few sub-tables on the larger mesh would take minutes and are left out. The search for unique vertices'
        ' gains little from many tables: vertices on lattice edges that run in a plane of samples share their x,'
        ' whatever the table.')
    series = []
    table = []
    for (triangles,), group in by(rows, 'triangles'):
        times = {row['sub_tables']: row['unique_ms'] + row['neighbors_ms'] + row['passes_ms'] for row in group}
        series.append((f"the paper's way, {text_of(triangles)} triangles", list(times.items())))
        best = min(times, key=times.get)
        report.remarks.append(
            f'The paper finds 150 to 250 sub-tables best. For {text_of(triangles)} triangles the best of those tried'
            f' here is {best} with {ms(times[best])}, beside {ms(times.get(250))} with 250.')
        table += [[f'{text_of(triangles)} triangles', row['sub_tables'], ms(row['unique_ms']),
                   ms(row['neighbors_ms']), ms(row['passes_ms']), ms(times[row['sub_tables']])] for row in group]
    series += [(f'{row["name"]}, {text_of(row["triangles"])} triangles', [(1, row['smooth_ms']), (1000, row['smooth_ms'])])
               for row in without]
    report.figure('sub-tables', "Five passes, the paper's way", 'sub-tables', 'time, ms', series,
                  band=(150, 250, "the paper's best"))
    report.table(['mesh', 'sub-tables', 'unique vertices', 'neighbours', 'five passes', 'all'], table)


def write_generation(rows, report):
    report.heading("Generation and smoothing (the paper's Figures 5 and 6)")
    report.paragraph(
        "The same two meshes, generation included. The paper's machine was a Pentium III of 600 MHz. VTK is Flying"
        ' Edges and vtkSmoothPolyDataFilter, on its own smaller mesh.')
    report.table(
        ["the paper's figure", 'the paper', 'triangles here', "the paper's way, here", 'isomesh', 'VTK'],
        [[f'{text_of(row["paper_triangles"])} triangles, {row["passes"]} passes',
          PAPER_GENERATION.get((row['paper_triangles'], row['passes']), '-'), text_of(row['triangles']),
          ms(row['paper_ms']), ms(row['isomesh_ms']), ms(row['peer_ms'])] for row in rows])


def write_passes(rows, report):
    report.heading('Time against passes')
    report.paragraph(
        "Extraction included. VTK's filters work on the Flying Edges mesh, which is a third the size. The paper took"
        ' 37.6 s for 5 and 39.85 s for 10 passes on 337 863 triangles: the passes themselves were cheap there, too.')
    columns = {'isomesh_ms': 'isomesh', 'peer_smooth_ms': 'Flying Edges + vtkSmoothPolyDataFilter',
               'peer_sinc_ms': 'Flying Edges + windowed sinc'}
    for (volume,), group in by(rows, 'volume'):
        report.paragraph(f'**{volume}**')
        report.figure(f'passes {volume}', f'Extraction and smoothing, {volume}', 'passes', 'time, ms',
                      [(label, [(row['passes'], row[name]) for row in group]) for name, label in columns.items()],
                      log='y')
        report.table(['passes', *columns.values()],
                     [[row['passes'], *(ms(row[name]) for name in columns)] for row in group])


def slope(points):
    """The exponent of the power law that fits the points best."""
    logs = [(math.log(a), math.log(b)) for a, b in points]
    mean_a, mean_b = (sum(values) / len(logs) for values in zip(*logs))
    return (sum((a - mean_a) * (b - mean_b) for a, b in logs) / sum((a - mean_a) ** 2 for a, _ in logs))


def write_growth(rows, report):
    report.heading('Time and memory against size')
    report.paragraph(
        'A synthetic field of n^3 uint8 samples whose surface grows with n^2; six tetrahedra, five passes. Time is'
        ' drawn against samples + triangles: the slope of a straight line on these axes is the exponent of growth, and'
        ' 1 is linear. The paper tells times for two sizes only, 37.6 s and 4.58 s for 337 863 and 71 795 triangles: a'
        ' slope of 1.36.')
    stages = {name: label for name, label in
              {'extract': 'extraction', 'smooth': 'smoothing', 'job': 'whole job', 'peer_extract': 'Flying Edges',
               'peer_job': 'VTK + Draco'}.items() if f'{name}_ms' in rows[0]}
    times = {label: [(row['samples'] + row['triangles'], row[f'{name}_ms']) for row in rows]
             for name, label in stages.items()}
    report.figure('time-against-size', 'Time against size', 'samples + triangles', 'time, ms',
                  [(f'{label}, slope {slope(points):.2f}', points) for label, points in times.items()])
    report.table(['time', 'triangles', *stages.values()],
                 [[f'{row["size"]}^3', text_of(row['triangles']), *(ms(row[f'{name}_ms']) for name in stages)]
                  for row in rows])
    report.paragraph(
        'Memory is the peak of a process of its own that holds the samples and runs the stage once: samples included,'
        ' program and libraries not. *Samples + mesh* is what cannot be avoided.')
    stages['smooth'] = 'extraction + smoothing'
    report.figure('memory-against-size', 'Peak memory against size', 'samples along each axis', 'bytes',
                  [(label, [(row['size'], row[f'{name}_bytes']) for row in rows]) for name, label in stages.items()])
    report.table(['peak memory', 'samples + mesh', *stages.values()],
                 [[f'{row["size"]}^3', mebibytes(row.get('least_bytes')),
                   *(mebibytes(row[f'{name}_bytes']) for name in stages)] for row in rows])


def write_choices(rows, report):
    report.heading('Five against six, linear against midpoint: what they do to the mesh')
    report.paragraph(
        "*Aspect ratio* is twice the inscribed circle's radius over the circumscribed one's: 1 for an equilateral"
        ' triangle, 0 for one without area. *Poor* is the share of triangles below 0.3. Smoothing is five passes,'
        ' lambda 1. *Volume* is the enclosed volume after smoothing as a share of that before; an open surface is'
        ' closed by a cone. Draco is the `drc` file.')
    for (volume,), group in by(rows, 'volume'):
        report.paragraph(f'**{volume}**')
        report.table(
            ['', 'triangles', 'extraction', 'smoothing', 'Draco', 'bits per triangle', 'aspect ratio before / after',
             'poor before / after', 'volume'],
            [[way_of(row), text_of(row['triangles']), ms(row['extract_ms']), ms(row['smooth_ms']),
              mebibytes(row['drc_bytes']), text_of(8 * row['drc_bytes'] / row['triangles'], 1),
              f'{row["aspect_ratio_before"]:.2f} / {row["aspect_ratio_after"]:.2f}',
              f'{percent(row["poor_before"])} / {percent(row["poor_after"])}', percent(row['volume_kept'])]
             for row in group])
    linear = [row for row in rows if row['interpolation'] == 'linear']
    report.remarks.append(
        'That smoothing repairs bad triangles holds: with linear interpolation'
        f' {span([100 * row["poor_before"] for row in linear], 1)} % are poor before and'
        f' {span([100 * row["poor_after"] for row in linear], 1)} % after five passes. Midpoint vertices leave hardly'
        ' any to repair. What happens to the enclosed volume the paper does not ask:'
        f' {span([100 * row["volume_kept"] for row in rows], 1)} % of it is there after smoothing.')


QUANTITIES = [
    ('mean aspect ratio', lambda row: row['aspect_ratio'], 3),
    ('poor triangles, %', lambda row: 100 * row['poor'], 2),
    ("mean of the triangles' smallest angles, degrees", lambda row: row['smallest_angle_deg'], 1),
    ('smallest angle of all, degrees', lambda row: row['least_angle_deg'], 3),
    ('triangles with an angle below 21 degrees, %', lambda row: 100 * row['small_angles'], 2),
    ('time of smoothing, ms', lambda row: row['smooth_ms'], 1),
    ('change of the enclosed volume, %', lambda row: 100 * (row['volume_kept'] - 1), 3),
]


def write_quality(rows, report):
    report.heading('What smoothing does to the triangles, and to the volume')
    report.paragraph(
        'The paper says that smoothing makes triangles well shaped, and shows pictures. Here are the numbers, against'
        ' passes of 0, 1, 2, 5, 10 and 20, with aspect ratio and poor triangles as above. Surfaces are closed where they'
        " meet the volume's border, so that what they enclose is exact. Laplacian has lambda 1; Taubin's passes are two"
        " steps each, with the daemon's defaults. `angle` and `optimize` move vertices along the extracted surface.")
    for (volume,), of_volume in by(rows, 'volume'):
        report.paragraph(f'**{volume}**')
        ways = [(f'{way_of(group[0])}, {group[0]["smoothing"]}', group)
                for _, group in by(of_volume, 'smoothing', 'tetrahedra', 'interpolation')]
        for label, quantity, digits in QUANTITIES:
            report.figure(f'{label} {volume}', f'{label}: {volume}', 'passes', label,
                          [(way, [(row['passes'], quantity(row)) for row in group]) for way, group in ways], log='')
            report.table([label, *(row['passes'] for row in ways[0][1])],
                         [[way, *(text_of(quantity(row), digits) for row in group)] for way, group in ways])
    most = max(row['passes'] for row in rows)
    lost = {smoothing: [100 * (1 - row['volume_kept']) for row in group if row['passes'] == most]
            for (smoothing,), group in by(rows, 'smoothing')}
    report.remarks.append(
        f"What the paper's smoothing costs in volume it does not say: {most} passes take {span(lost['laplacian'], 3)} %"
        f" of what the surfaces enclose, and Taubin's {span(lost['taubin'], 3)} %; a negative number is a gain.")


LATTICES = {'6': '6 (Kuhn)', '5': '5 (face-centred)', 'bcc': 'bcc (body-centred)'}


def write_lattices(rows, report):
    report.heading("The paper's lattices and smoothings")
    report.paragraph(
        "Each `scheme` as the paper has it and regularised, and the smoothings that the paper cites beside Laplacian and"
        " Taubin's, with a job's default parameters. Surfaces are closed where they meet the volume's border. *Time* is"
        ' that of extraction where nothing is smoothed, otherwise that of smoothing. One triangle in a hundred has an angle'
        ' smaller than *1 %*. *Distance* is the largest of a vertex or a centre of a triangle from the extracted'
        ' surface, in steps of the lattice.')
    for (volume,), of_volume in by(rows, 'volume'):
        report.paragraph(f'**{volume}**')
        table = []
        for (scheme, regularize), group in by(of_volume, 'scheme', 'regularize'):
            laplacian = next(row['ms'] for row in group if row['smoothing'] == 'laplacian')
            for row in group:
                is_smoothed = row['passes'] > 0
                table.append(
                    [f'{LATTICES[scheme]}{", regularised" if regularize else ""}',
                     f'{row["smoothing"]}, {row["passes"]} passes' if is_smoothed else '', text_of(row['triangles']),
                     *(f'{row[name]:.1f}' for name in ('mean_angle_deg', 'percentile_1_angle_deg', 'least_angle_deg')),
                     f'{100 * row["small_angles"]:.2f} %', f'{100 * (row["volume_kept"] - 1):+.3f} %' if is_smoothed else '',
                     f'{row["distance_steps"]:.2f}' if is_smoothed else '', ms(row['ms']),
                     f'{row["ms"] / laplacian:.1f}' if is_smoothed else ''])
        report.table(['lattice', 'smoothing', 'triangles', 'smallest angles: mean', '1 %', 'least', 'below 20 degrees',
                      'volume', 'distance', 'time', 'of ten Laplacian passes'], table)


def write_accuracy(rows, report):
    report.heading('One number for the error')
    report.paragraph(
        '`isomesh-bench simplify`: a job to drc of five passes without a bound, the same with a certificate, and with'
        ' `max_error_mm` E. *Scan* is the surface as it was extracted, before smoothing; *max to scan* is the largest'
        ' distance of a vertex or a centre of a triangle of the file, as libdraco decodes it, from that surface, *from'
        ' scan* the other way. The peers have the smoothed surface in memory and make as many triangles of it as E'
        ' left; they know no bound. Each was run once.')
    for (volume,), group in by(rows, 'volume'):
        report.paragraph(f'**{volume}**')
        report.table(
            ['', 'triangles', 'max to scan', 'max from scan', 'rms from scan', 'simplify', 'certify', 'encode',
             'whole job', 'bytes'],
            [[row['name'], text_of(row['triangles']),
              *(text_of(row[name], 4) for name in ('max_to_scan_mm', 'max_from_scan_mm', 'rms_from_scan_mm')),
              *(ms(row[name]) for name in ('simplify_ms', 'certify_ms', 'encode_ms', 'job_ms')),
              text_of(row['bytes'])] for row in group])
        drawn = [{**row, 'name': row['name'] if row['is_peer'] else 'isomesh'} for row in group
                 if row['is_peer'] or row['name'].startswith('E = ')]
        report.figure(f'error {volume}', f'Largest distance of the scan from the mesh: {volume}', 'triangles', 'mm',
                      [(name, sorted((row['triangles'], row['max_from_scan_mm']) for row in of_name))
                       for (name,), of_name in by(drawn, 'name')])


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    source = Path(sys.argv[1])
    data = json.loads(source.read_text())
    report = Report(source.parent)
    write_opening(data, report)
    for table, write in (('service', write_service), ('goals', write_goals), ('schemes', write_schemes),
                         ('unique', write_unique),
                         ('sub_tables', lambda rows, to: write_sub_tables(rows, data['without_sub_tables'], to)),
                         ('generation', write_generation), ('passes', write_passes), ('growth', write_growth),
                         ('choices', write_choices), ('quality', write_quality), ('lattices', write_lattices),
                         ('accuracy', write_accuracy)):
        if data.get(table):
            write(data[table], report)
    print(report.write())


if __name__ == '__main__':
    main()
