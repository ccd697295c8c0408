"""What the objects say, and what the judges say of them."""
import json
import math
import os
import re
import struct
import subprocess

import dicom
import peers
from fixture import Loop


def texts_kind(result):
    """The end of the media type of an object's document."""
    return {"4": b"obj", "5": b"mtl"}[result["sop_class_uid"][-1]]


class Objects(Loop):
    def made(self, series, **more):
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series, **more))
        path = os.path.join(self.folder.name, order["id"] + ".dcm")
        with open(path, "wb") as file:
            file.write(self.pacs.file(order["results"][0]["sop_instance_uid"]))
        return daemon, order, path

    def assert_judged(self, path, extensions=()):
        """Nothing is wrong with an object; it may be of a Standard Extended SOP Class by those."""
        said = subprocess.run(["dciodvfy", path], capture_output=True, text=True, check=False)
        faults = [line for line in said.stderr.splitlines()
                  if line.startswith(("Error", "Warning"))]
        if extensions:
            extensions += ("this is a Standard Extended SOP Class",)
            faults = [line for line in faults if not any(each in line for each in extensions)]
        self.assertEqual(faults, [])

    def assert_by_template(self, path):
        """The report is one by the template that it names."""
        # Its templates are larger than Java lets a style sheet be.
        limits = [f"-Djdk.xml.xpath{limit}Limit=0" for limit in ("ExprGrp", "ExprOp", "TotalOp")]
        said = subprocess.run(["java", *limits, "-cp", "/usr/share/java/pixelmed.jar",
                               "com.pixelmed.validate.DicomSRValidator", path],
                              capture_output=True, text=True, check=True, timeout=300)
        lines = (said.stdout + said.stderr).splitlines()
        self.assertIn("Found Root Template TID_1500 (MeasurementReport)", lines)
        self.assertIn("Root Template Validation Complete", lines)
        # An uncertainty is a property of a number (TID 310), which PixelMed takes for an inference;
        # TID 1411 is extensible, and the category is where others write it.
        known = ('range of measurement uncertainty"): Incorrect relationship - '
                 'expected INFERRED FROM - found HAS PROPERTIES',
                 'CODE (276214006,SCT,"Finding category"): Content Item not in template')
        self.assertEqual([line for line in lines if line.startswith(("Error", "Warning")) and
                          not line.endswith(known)], [])

    def assert_valid(self, path, series):
        self.assert_judged(path)
        sources = []
        for index, data in enumerate(series.files.values()):
            sources.append(f"{path}.{index}")
            with open(sources[-1], "wb") as file:
                file.write(data)
        said = subprocess.run(["dcentvfy", path, *sources], capture_output=True, text=True,
                              check=False)
        self.assertEqual([line for line in said.stderr.splitlines() if line.strip()], [])

    def value(self, path, tag):
        said = subprocess.run(["dcmdump", "+L", "+P", tag, path], check=True, capture_output=True,
                              text=True).stdout
        lines = [line.split("#")[0].strip().split(" ", 2)[-1].strip() for line in said.splitlines()]
        return lines

    def test_rows(self):
        """Every row of the table, on an object of which the judges find nothing wrong."""
        series = self.series(name="Muster^Erika")
        _, order, path = self.made(series)
        result = order["results"][0]
        self.assert_valid(path, series)
        rows = {
            "0008,0005": "[ISO_IR 192]", "0008,0016": "=EncapsulatedSTLStorage",
            "0008,0018": f"[{result['sop_instance_uid']}]", "0010,0010": "[Muster^Erika]",
            "0010,0020": "[PAT-4711]", "0010,0021": "[Hospital]", "0010,0030": "[19700101]",
            "0010,0040": "[F]", "0020,000d": f"[{series.study}]", "0008,0020": "[20261120]",
            "0008,0030": "[101112]", "0020,0010": "[S1]", "0008,0050": "[ACC-1]",
            "0008,0090": "[Refer^Red]", "0008,1030": "[Head study]", "0008,0060": "[M3D]",
            "0020,0011": "[9001]", "0008,103e": "[Bone]",
            "0020,1040": "[SN]", "0008,1090": "[isomeshd]",
            "0020,0013": "[1]", "0008,002a": "[20261120101500]", "0028,0301": "[NO]",
            "0028,0302": "[YES]", "0042,0010": "[Bone]", "0042,0012": "[model/stl]",
            "0068,7001": "[NO]", "0068,7002": "[NO]",
            "0070,0081": "[iso 500, scheme 6, 5 passes]",
        }
        for tag, value in rows.items():
            self.assertEqual(self.value(path, tag)[0], value, tag)
        self.assertIn(f"[{result['series_uid']}]", self.value(path, "0020,000e"))
        self.assertEqual(len(self.value(path, "0020,0052")), 1)
        # Equipment: the maker of the object, and the scanner as a contributor.
        self.assertEqual(set(self.value(path, "0008,0070")), {"[isomesh]", "[Maker]"})
        self.assertEqual(set(self.value(path, "0018,1000")), {"[isomesh-test]", "[SN-77]"})
        self.assertIn("[CT-ROOM-2]", self.value(path, "0008,1010"))
        codes = self.value(path, "0008,0100")
        self.assertEqual(codes.count("[121324]"), 12)
        for code in ["[85040-4]", "[123103]", "[109101]", "[mm]"]:
            self.assertIn(code, codes)
        # Every slice as a source, and under the source series.
        referenced = self.value(path, "0008,1155")
        for instance in series.instances:
            self.assertEqual(referenced.count(f"[{instance}]"), 2)
        self.assertIn(f"[{series.uid}]", self.value(path, "0020,000e"))
        parameters = self.value(path, "0066,0032")[0]
        self.assertEqual(json.loads(parameters[1:-1])["iso"], 500)
        self.assertEqual(self.value(path, "0066,0036"), ["[isomesh marching tetrahedra]"])
        # No offset of times is told, which would be taken for that of the others.
        self.assertEqual(self.value(path, "0008,0201"), [])

    def test_the_mesh_is_the_jobs(self):
        series = self.series()
        daemon, order, path = self.made(series)
        mesh = peers.call(daemon.port, "GET", f"/v1/jobs/{order['job']}/mesh.stl")[2]
        with open(path, "rb") as file:
            data = file.read()
        self.assertEqual(data.count(mesh), 1)
        self.assertIn(b"SPACE=LPS", mesh[:80])
        self.assertEqual(self.value(path, "0042,0015"), [str(len(mesh))])
        self.assertEqual(order["results"][0]["bytes"], len(data))

    def test_by_labels(self):
        """One object a label, each with that label's own surface, all in one series."""
        series = self.series()
        daemon, order, _ = self.made(series, parameters={"labels": "all"})
        results = order["results"]
        self.assertEqual([each["label"] for each in results], [1000])
        self.assertEqual(self.stored(series), [each["sop_instance_uid"] for each in results])
        data = self.pacs.file(results[0]["sop_instance_uid"])
        mesh = peers.call(daemon.port, "GET", f"/v1/jobs/{order['job']}/mesh.stl?label=1000")[2]
        self.assertEqual(data.count(mesh), 1)

    def test_a_segmentation_out_of_the_pacs(self):
        """Each segment becomes an object that says what it is by the segment's own codes."""
        series = self.series()
        uid, instance, data = dicom.segmentation(series)
        self.pacs.upload([data])
        daemon = self.daemon()
        body = {"source": {"pacs": "main", "study": series.study, "series": uid}, "rule": "bone",
                "parameters": {"labels": "all"}}
        order = self.succeeded(daemon, daemon.order(body)["id"])
        results = order["results"]
        self.assertEqual([each["label"] for each in results], [1, 2])
        self.assertEqual(len({each["series_uid"] for each in results}), 1)
        self.assertEqual(sorted(self.stored(series)),
                         sorted(each["sop_instance_uid"] for each in results))
        for result, segment in zip(results, (dicom.SKULL, dicom.LESION)):
            path = os.path.join(self.folder.name, f"segment-{result['label']}.dcm")
            with open(path, "wb") as file:
                file.write(self.pacs.file(result["sop_instance_uid"]))
            self.assert_judged(path, ("Anatomic Region Sequence", "(0x0008,0x010"))
            codes = self.codes(path)
            self.assertEqual(codes["ConceptNameCodeSequence"], segment["type"])
            self.assertEqual(codes["AnatomicRegionSequence"], segment["region"])
            self.assertEqual(self.value(path, "0042,0010"), [f"[Bone {segment['label']}]"])
            self.assertEqual(self.value(path, "0020,0013"), [f"[{result['label']}]"])
            self.assertIn(f"[{instance}]", self.value(path, "0008,1155"))
            self.assertIn(f"[{uid}]", self.value(path, "0020,000e"))

    def test_segments_as_an_obj_with_their_colours(self):
        """One OBJ of all segments; its materials are an object before it, to which it refers."""
        series = self.series()
        uid, _, data = dicom.segmentation(series)
        self.pacs.upload([data])
        daemon = self.daemon()
        body = {"source": {"pacs": "main", "study": series.study, "series": uid}, "rule": "bone",
                "parameters": {"labels": "all"}, "send": [{"pacs": "main", "format": "obj"}]}
        order = self.succeeded(daemon, daemon.order(body)["id"])
        materials, mesh = order["results"]
        self.assertEqual([each["sop_class_uid"][-6:] for each in (materials, mesh)], [".104.5", ".104.4"])
        self.assertEqual(materials["series_uid"], mesh["series_uid"])
        self.assertEqual(sorted(self.stored(series)),
                         sorted(each["sop_instance_uid"] for each in order["results"]))
        texts, paths = [], []
        for result in (materials, mesh):
            path = os.path.join(self.folder.name, result["sop_instance_uid"] + ".dcm")
            with open(path, "wb") as file:
                file.write(self.pacs.file(result["sop_instance_uid"]))
            # The judge knows the modules, but of these classes only STL.
            with open(path, "rb") as file, open(path + ".stl", "wb") as judged:
                judged.write(file.read().replace(result["sop_class_uid"].encode(),
                                                 (result["sop_class_uid"][:-1] + "3").encode())
                             .replace(b"model/" + texts_kind(result), b"model/stl"))
            self.assert_judged(path + ".stl")
            paths.append(path)
            texts.append(self.document(path))
        self.assertEqual(self.value(paths[0], "0008,0016"), ["=EncapsulatedMTLStorage"])
        self.assertEqual(self.value(paths[0], "0042,0012"), ["[model/mtl]"])
        self.assertEqual(self.value(paths[1], "0008,0016"), ["=EncapsulatedOBJStorage"])
        self.assertEqual(self.value(paths[1], "0042,0012"), ["[model/obj]"])
        self.assertEqual(self.value(paths[1], "0068,7005"), ["[mesh.mtl]"])
        self.assertIn(f"[{materials['sop_instance_uid']}]", self.value(paths[1], "0008,1155"))
        job = peers.call(daemon.port, "GET", f"/v1/jobs/{order['job']}/mesh.obj")[2].decode()
        self.assertEqual(texts[1], job)
        self.assertIn("\nmtllib mesh.mtl\n", texts[1])
        served = peers.call(daemon.port, "GET", f"/v1/jobs/{order['job']}/mesh.mtl")[2].decode()
        self.assertEqual(texts[0], served)
        used = re.findall("^usemtl (.*)$", texts[1], re.MULTILINE)
        self.assertEqual(used, ["Skull", "Lesion"])
        self.assertEqual(re.findall("^newmtl (.*)$", texts[0], re.MULTILINE), used)
        self.assertEqual(len(re.findall("^Kd( [01]\\.[0-9]{6}){3}$", texts[0], re.MULTILINE)), 2)
        again = self.succeeded(daemon, daemon.order(body)["id"])
        self.assertEqual(again["results"], order["results"])

    def report(self, series, uid, parameters):
        """The order of a report, the path of that, and what dsrdump says of it."""
        daemon = self.daemon()
        body = {"source": {"pacs": "main", "study": series.study, "series": uid}, "rule": "bone",
                "parameters": parameters, "send": [{"pacs": "main", "format": "sr"}]}
        order = self.succeeded(daemon, daemon.order(body)["id"])
        result, = order["results"]
        path = os.path.join(self.folder.name, result["sop_instance_uid"] + ".dcm")
        with open(path, "wb") as file:
            file.write(self.pacs.file(result["sop_instance_uid"]))
        # No standard code tells how far a mesh is from the extracted surface.
        self.assert_judged(path, ("term <99ISOMESH>",))
        said = subprocess.run(["dsrdump", "+Pc", path], capture_output=True, text=True,
                              check=True)
        # It warns that it does not check texts in UTF-8.
        self.assertEqual([line for line in said.stderr.splitlines() if "ISO_IR 192" not in line], [])
        again = self.succeeded(daemon, daemon.order(body)["id"])
        self.assertEqual(again["results"], order["results"])
        self.assertEqual([each["00080018"]["Value"][0]
                          for each in self.pacs.objects(series.study, "SR")],
                         [result["sop_instance_uid"]])
        return daemon, order, path, said.stdout

    def assert_measured(self, said, expected):
        """The report has these numbers, in this order, to the digits of a decimal string."""
        found = [float(each) for each in re.findall(r'="([-0-9.e+]+)" \(', said)]
        self.assertEqual(len(found), len(expected), said)
        for number, wanted in zip(found, expected):
            self.assertAlmostEqual(number, wanted, delta=abs(wanted) * 1e-8 + 1e-12)

    def diameter(self, stl):
        """The largest distance of two vertices, from all pairs."""
        points = {struct.unpack_from("<3f", stl, at + 12 + 12 * corner)
                  for at in range(84, len(stl), 50) for corner in range(3)}
        return max(math.dist(a, b) for a in points for b in points)

    def test_a_report_of_a_surface(self):
        series = self.series()
        daemon, order, path, said = self.report(series, series.uid,
                                                {"iso": 500, "max_error_mm": 0.5})
        mesh = daemon.call("GET", "/v1/jobs/" + order["job"])[2]["mesh"]
        stl = peers.call(daemon.port, "GET", f"/v1/jobs/{order['job']}/mesh.stl")[2]
        bound = mesh["certificate"]["bound_mm"]
        self.assert_measured(said, [mesh["volume_mm3"]["smoothed"], mesh["area_mm2"],
                                    self.diameter(stl), 2 * bound, bound])
        for instance in series.instances:
            self.assertIn(f"[{instance}]", self.value(path, "0008,1155"))
        self.assertEqual(self.value(path, "0008,0060"), ["[SR]"])

    def test_a_report_of_segments(self):
        """Each segment has its volume, area and diameter, and the report refers to it."""
        series = self.series()
        uid, instance, data = dicom.segmentation(series)
        self.pacs.upload([data])
        daemon, order, path, said = self.report(series, uid, {"labels": "all"})
        self.assert_by_template(path)
        job = daemon.call("GET", "/v1/jobs/" + order["job"])[2]["mesh"]
        expected = []
        for label in job["labels"]:
            stl = peers.call(daemon.port, "GET",
                             f"/v1/jobs/{order['job']}/mesh.stl?label={label['label']}")[2]
            bound = job["certificate"].get("bound_mm")
            expected += [label["volume_mm3"], label["area_mm2"], self.diameter(stl)]
            expected += [job["certificate"]["found_mm"]] if bound is None else [2 * bound, bound]
        self.assertEqual(len(job["labels"]), 2)
        self.assert_measured(said, expected)
        for segment in (dicom.SKULL, dicom.LESION):
            for code in ("category", "type", "region"):
                self.assertIn(segment[code][0], said)
        self.assertEqual(self.value(path, "0008,1155").count(f"[{instance}]"), 3)
        self.assertEqual(self.value(path, "0062,000b"), ["1", "2"])
        self.assertEqual(self.value(path, "0040,a124").count(f"[{series.uid}]"), 2)

    def document(self, path):
        """The text that the object encapsulates: its element (0042,0011)."""
        with open(path, "rb") as file:
            data = file.read()
        at = data.index(b"\x42\0\x11\0OB\0\0") + 8
        length = int.from_bytes(data[at:at + 4], "little")
        return data[at + 4:at + 4 + length].rstrip(b"\0").decode()

    def codes(self, path):
        """The codes of the sequences of the object's own: value, scheme, meaning."""
        said = subprocess.run(["dcmdump", "+L", path], check=True, capture_output=True,
                              text=True).stdout
        found, name = {}, None
        for line in said.splitlines():
            if line.startswith("("):
                name = line.split()[-1]
            elif name and line.startswith("    (0008,010"):
                value = line.split("[", 1)[1].split("]")[0]
                found[name] = found.get(name, ()) + (value,)
        return found

    def test_simplified_to_fit(self):
        """What is too large for the PACS is simplified within what its rule allows, and says so."""
        rules = """
[[rules]]
name = "fit"
max-error-mm = 1.0
parameters = { iso = 500, passes = 1 }
send = [ { pacs = "main" } ]
"""
        series = self.series(size=40, slices=40, radius=0.4)
        wide = self.daemon(rules=rules)
        whole = self.succeeded(wide, self.order(wide, series, rule="fit"))
        size = whole["results"][0]["bytes"]
        most = size // 3
        daemon = self.daemon(most=most, rules=rules)
        order = self.succeeded(daemon, self.order(daemon, series, rule="fit"))
        result = order["results"][0]
        self.assertLessEqual(result["bytes"], most)
        self.assertGreater(result["bytes"], most // 2)
        self.assertNotEqual(result["series_uid"], whole["results"][0]["series_uid"])
        path = os.path.join(self.folder.name, "fitted.dcm")
        with open(path, "wb") as file:
            file.write(self.pacs.file(result["sop_instance_uid"]))
        self.assert_judged(path)
        job = daemon.call("GET", "/v1/jobs/" + order["job"])[2]
        certificate = job["mesh"]["certificate"]
        certified = certificate.get("bound_mm", certificate["found_mm"])
        self.assertLessEqual(certified, 1.0)
        said = self.value(path, "0070,0081")[0]
        found = re.fullmatch(r"\[iso 500, scheme 6, 1 passes, within ([0-9.]+) mm\]", said)
        self.assertTrue(found, said)
        self.assertLess(abs(float(found.group(1)) - certified), 0.0011)
        self.assertGreaterEqual(float(found.group(1)), certified)
        # An order without the rule is not simplified by anybody's wish but its own.
        failed = daemon.ended(self.order(daemon, series))
        self.assertEqual(failed["error"]["type"], "urn:isomesh:problem:too-large")
        # And what cannot fit fails, with the reason.
        narrow = self.daemon(most=size // 40, rules=rules)
        failed = narrow.ended(self.order(narrow, series, rule="fit"))
        self.assertEqual((failed["state"], failed["error"]["type"]),
                         ("failed", "urn:isomesh:problem:too-large"))
        self.assertIn("max-error-mm", failed["error"]["detail"])

    def test_other_modalities_have_other_concepts(self):
        for modality, code in [("MR", "[85041-2]"), ("PT", None)]:
            series = self.series(modality=modality)
            _, _, path = self.made(series)
            codes = self.value(path, "0008,0100")
            self.assertEqual([each for each in codes if each.startswith("[850")],
                             [code] if code else [])

    def test_names_of_the_world(self):
        names = {
            "ISO_IR 100": ("Müller^Jörg", "latin-1"),
            "ISO_IR 192": ("Łoś^Zażółć", "utf-8"),
            "ISO_IR 144": ("Люкceмбypг", "iso8859-5"),
            "\\ISO 2022 IR 87": ("Yamada^Tarou=山田^太郎", "iso2022_jp"),
        }
        for charset, (name, codec) in names.items():
            with self.subTest(charset):
                series = self.series(name=name.encode(codec), charset=charset)
                _, _, path = self.made(series)
                said = subprocess.run(["dciodvfy", path], capture_output=True, text=True,
                                      check=False).stderr
                self.assertNotIn("Error", said)
                said = subprocess.run(["dcmdump", "+P", "0010,0010", path], check=True,
                                      capture_output=True).stdout
                self.assertIn(f"[{name}]".encode(), said)
