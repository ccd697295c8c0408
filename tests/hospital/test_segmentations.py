"""An AI returns labels as NIfTI: isomesh stores them as a segmentation (SEG) beside their meshes."""
import gzip
import json
import os
import re
import struct
import subprocess

import peers
from fixture import Loop
from test_objects import Objects


def nifti(size, slices, label_of):
    """Labels on the grid of `dicom.Series`, with rows from back to front as dcm2niix writes them."""
    head = bytearray(348)
    struct.pack_into("<i", head, 0, 348)
    struct.pack_into("<8h", head, 40, 3, size, size, slices, 1, 1, 1, 1)
    struct.pack_into("<hh", head, 70, 512, 16)  # uint16
    struct.pack_into("<8f", head, 76, 1, 2, 2, 2, 0, 0, 0, 0)
    struct.pack_into("<f", head, 108, 352)
    struct.pack_into("<hh", head, 252, 0, 1)  # sform
    # RAS: x and y of LPS with the other sign; the first row is the last one of the images.
    struct.pack_into("<4f", head, 280, -2, 0, 0, 20)
    struct.pack_into("<4f", head, 296, 0, 2, 0, 30 - 2 * (size - 1))
    struct.pack_into("<4f", head, 312, 0, 0, 2, 0)
    head[344:348] = b"n+1\0"
    samples = b"".join(struct.pack("<H", label_of(x, size - 1 - y, z)) for z in range(slices)
                       for y in range(size) for x in range(size))
    return gzip.compress(bytes(head) + bytes(4) + samples)


def label_of(x, y, z):
    """A box of 1, and one of 5 that not all slices have; neither is symmetrical."""
    if 3 <= x < 9 and 4 <= y < 15 and 2 <= z < 10:
        return 1
    return 5 if 12 <= x < 21 and 2 <= y < 8 and 3 <= z < 6 else 0


SIZE, SLICES = 23, 12

# pydicom reads these of a segmentation: the slice, the segment and the samples of each frame.
READER = """
import json, sys, pydicom
data = pydicom.dcmread(sys.argv[1])
groups = data.PerFrameFunctionalGroupsSequence
print(json.dumps([[float(group.PlanePositionSequence[0].ImagePositionPatient[2]),
                   int(group.SegmentIdentificationSequence[0].ReferencedSegmentNumber),
                   frame.ravel().tolist()] for group, frame in zip(groups, data.pixel_array)]))
"""


class Segmentations(Loop):
    assert_judged = Objects.assert_judged
    assert_valid = Objects.assert_valid
    value = Objects.value

    def upload(self, daemon, data, kind="application/octet-stream"):
        status, _, answer = peers.call(daemon.port, "POST", "/v1/volumes", data,
                                       {"Content-Type": kind})
        self.assertIn(status, (200, 201), answer)
        return json.loads(answer)

    def frames(self, path):
        """By slice and segment: the samples of each frame, read from the bits of the file."""
        def dumped(tag):
            said = subprocess.run(["dcmdump", "+L", "+P", tag, path], check=True,
                                  capture_output=True, text=True).stdout
            return re.findall(r"(?:US|DS) (?:\[(.*?)\]|(\S+))", said)
        positions = [each[0] for each in dumped("0020,0032")]
        segments = [int(each[1]) for each in dumped("0062,000b")]
        with open(path, "rb") as file:
            data = file.read()
        bits = SIZE * SIZE * len(segments)
        pixels = data[len(data) - (bits + 15) // 16 * 2:]
        found = {}
        for index, (position, segment) in enumerate(zip(positions, segments)):
            x, y, z = (float(each) for each in position.split("\\"))
            self.assertEqual((x, y), (-20, -30))
            first = index * SIZE * SIZE
            found[round(z / 2), segment] = [pixels[at // 8] >> at % 8 & 1
                                            for at in range(first, first + SIZE * SIZE)]
        return found

    def test_labels_of_an_ai(self):
        series = self.series(size=SIZE, slices=SLICES)
        daemon = self.daemon()
        labels = self.upload(daemon, nifti(SIZE, SLICES, label_of))
        order = self.order(daemon, series, label_volume=labels["id"], parameters={"labels": "all"},
                           send=[{"pacs": "main", "format": "seg"},
                                 {"pacs": "main", "format": "stl"}])
        order = self.succeeded(daemon, order)
        self.assertEqual(order["label_volume"], labels["id"])
        segmentation, *meshes = sorted(order["results"], key=lambda each: each["format"])
        self.assertEqual([each["label"] for each in meshes], [1, 5])
        path = os.path.join(self.folder.name, "seg.dcm")
        with open(path, "wb") as file:
            file.write(self.pacs.file(segmentation["sop_instance_uid"]))
        self.assert_valid(path, series)
        self.assertEqual(self.value(path, "0008,0016")[0], "=SegmentationStorage")
        frames = self.frames(path)
        wanted = {}
        for number, label in enumerate((1, 5), 1):
            for z in range(SLICES):
                bits = [int(label_of(x, y, z) == label) for y in range(SIZE) for x in range(SIZE)]
                if any(bits):
                    wanted[z, number] = bits
        self.assertEqual(frames, wanted)
        # Debian's pydicom and numpy belong to Debian's Python.
        read = json.loads(subprocess.run(["/usr/bin/python3", "-c", READER, path], check=True,
                                         capture_output=True, text=True).stdout)
        self.assertEqual({(round(z / 2), segment): bits for z, segment, bits in read}, wanted)
        sources = self.value(path, "0008,1155")
        self.assertTrue(all(f"[{each}]" in sources for each in series.instances))
        # isomesh itself reads the same labels in the same places.
        with open(path, "rb") as file:
            again = self.upload(daemon, file.read())
        first, last = 1, 10  # the slices that have labels, and an empty one at each end
        self.assertEqual(again["dims"], [SIZE, SIZE, last - first + 1])
        self.assertEqual(again["origin"], [-20, -30, 2 * first])
        for z in range(first, last + 1):
            slices = []
            for volume, index in ((again, z - first), (labels, z)):
                status, headers, data = peers.call(
                    daemon.port, "GET", f"/v1/volumes/{volume['id']}/slice?axis=z&index={index}")
                self.assertEqual(status, 200, data)
                form = {"uint8": "B", "uint16": "H"}[headers["Isomesh-Sample-Type"]]
                slices.append(struct.unpack(f"<{SIZE * SIZE}{form}", data))
            # Both are stored along the patient's axes, whatever the file's rows are.
            self.assertEqual([{0: 0, 1: 1, 2: 5}[each] for each in slices[0]], list(slices[1]))
        # The same again finds what is stored.
        repeated = self.order(daemon, series, label_volume=labels["id"],
                              parameters={"labels": "all"},
                              send=[{"pacs": "main", "format": "seg"}])
        repeated = self.succeeded(daemon, repeated)
        self.assertEqual(repeated["results"][0]["sop_instance_uid"],
                         segmentation["sop_instance_uid"])
        self.assertEqual(len(self.pacs.objects(series.study, "SEG")), 1)

    def test_many_labels_with_names(self):
        """The names and colours of 1500 labels are more than an attribute of short length holds."""
        size, count = 24, 1500
        series = self.series(size=size, slices=SLICES)
        head = (f"NRRD0004\ntype: uint16\ndimension: 3\nsizes: {size} {size} {SLICES}\nspace: left-posterior-superior\n"
                "encoding: raw\nendian: little\nspace directions: (2,0,0) (0,2,0) (0,0,2)\nspace origin: (-20,-30,0)\n")
        for n in range(count):
            head += (f"Segment{n}_ID:=s{n}\nSegment{n}_Name:=Structure with a rather long name {n}\n"
                     f"Segment{n}_LabelValue:={n + 1}\nSegment{n}_Layer:=0\nSegment{n}_Color:=1 0 0\n")
        inside = range(1, size - 1)
        samples = b"".join(
            struct.pack("<H", (x // 2 + 11 * (y // 2) + 121 * z) % count + 1 if x in inside and y in inside and 0 < z < SLICES - 1 else 0)
            for z in range(SLICES) for y in range(size) for x in range(size))
        daemon = self.daemon()
        labels = self.upload(daemon, head.encode() + b"\n" + samples)
        order = self.succeeded(daemon, self.order(daemon, series, label_volume=labels["id"], parameters={"labels": "all"},
                                                  send=[{"pacs": "main", "format": "obj"}]), 120)
        for result in order["results"]:
            path = os.path.join(self.folder.name, result["sop_instance_uid"])
            with open(path, "wb") as file:
                file.write(self.pacs.file(result["sop_instance_uid"]))
            parameters = self.value(path, "0066,0032")[0]
            self.assertEqual(json.loads(parameters[1:-1])["labels"], "all")

    def test_labels_of_something_else(self):
        daemon = self.daemon()
        labels = self.upload(daemon, nifti(SIZE, SLICES, label_of))
        for other in (self.series(size=SIZE, slices=SLICES + 1), self.series(slices=SLICES)):
            order = self.order(daemon, other, label_volume=labels["id"],
                               parameters={"labels": "all"},
                               send=[{"pacs": "main", "format": "seg"}])
            self.assertEqual(daemon.ended(order)["state"], "failed")
            self.assertIn("label volume", daemon.get(order)["error"]["detail"])
            self.assertEqual(self.pacs.objects(other.study, "SEG"), [])
        body = {"source": {"pacs": "main", "study": other.study, "series": other.uid},
                "parameters": {"labels": "all"}, "send": [{"pacs": "main", "format": "seg"}]}
        self.assertEqual(daemon.call("POST", "/v1/orders", body)[0], 400)


del Objects  # its own tests run elsewhere
