#!/usr/bin/env python3
"""Meshes every volume of a folder and prints a table of the surfaces' measurements.

    python3 -m venv isomesh-env && . isomesh-env/bin/activate && pip install ./client/python
    python3 examples/python/batch.py scans/ meshes/ --iso 60 > surfaces.csv

Files that are not volumes are listed on standard error and skipped.
"""

import argparse
import csv
import sys
from pathlib import Path

import isomesh_client


def main() -> int:
    parser = argparse.ArgumentParser(description="Mesh every volume of a folder")
    parser.add_argument("scans", type=Path, help="folder of volumes: files, or folders of DICOM slices")
    parser.add_argument("meshes", type=Path, help="folder for the meshes; it is created if needed")
    parser.add_argument("--iso", type=float, required=True, help="the iso-value of the surfaces")
    parser.add_argument("--server", help="default: $ISOMESH_SERVER, or http://127.0.0.1:8080")
    arguments = parser.parse_args()

    client = isomesh_client.Client(arguments.server)
    if not arguments.scans.is_dir():
        parser.error(f"there is no folder {arguments.scans}")
    table = csv.writer(sys.stdout)
    table.writerow(["scan", "triangles", "closed", "area_mm2", "volume_mm3"])
    scans = sorted(each for each in arguments.scans.iterdir() if not each.name.startswith("."))
    results = client.mesh_all(
        scans, to=lambda scan: arguments.meshes / f"{scan.name}.glb", iso=arguments.iso, close=True, priority="bulk"
    )
    for result in results:
        if not result:
            print(f"{result.source}: {result.error}", file=sys.stderr)
            continue
        found = result.job["mesh"]
        quality = found["quality"]
        # A surface that is open, or inside out, encloses nothing.
        enclosed = round(found["volume_mm3"]["smoothed"], 1) if quality["encloses_volume"] else ""
        row = [found["triangles"], quality["closed"], round(found["area_mm2"], 1), enclosed]
        table.writerow([result.source.name, *row])
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
