"""Series of real scanners, from a folder with one series a folder: ISOMESH_DICOM_SERIES. What they
are made of must be a mesh in their study, or a refusal with its reason, never a lost order."""
import json
import os
import unittest

from fixture import Loop

FOLDER = os.environ.get("ISOMESH_DICOM_SERIES")


@unittest.skipUnless(FOLDER, "SKIPPED: ISOMESH_DICOM_SERIES names no folder")
class RealSeries(Loop):
    def test_other_modalities(self):
        daemon = self.daemon(port=self.pacs.port, timeout=30)
        ended = {}
        for name in sorted(os.listdir(FOLDER)):
            stored = self.upload(os.path.join(FOLDER, name))
            for study, series in stored:
                with self.subTest(name):
                    body = {"source": {"pacs": "main", "study": study, "series": series},
                            "rule": "bone", "parameters": {"iso": "otsu"}}
                    order = daemon.ended(daemon.order(body)["id"], 120)
                    ended[name] = order["state"]
                    if order["state"] == "succeeded":
                        found = self.pacs.objects(study)
                        self.assertIn(order["results"][0]["sop_instance_uid"],
                                      [each["00080018"]["Value"][0] for each in found])
                    else:
                        self.assertEqual(order["error"]["status"], 422, order["error"])
                        self.assertGreater(len(order["error"]["detail"]), 20)
        print(ended)
        self.assertIn("succeeded", ended.values())

    def upload(self, folder):
        """The series that the PACS knows of those files; some files are none."""
        found = set()
        files = [os.path.join(place, name) for place, _, names in os.walk(folder) for name in names]
        for path in sorted(files):
            with open(path, "rb") as file:
                status, _, answer = self.pacs.call("POST", "/instances", file.read())
            if status != 200:
                continue
            place = json.loads(answer)
            study = json.loads(self.pacs.call("GET", "/studies/" + place["ParentStudy"])[2])
            series = json.loads(self.pacs.call("GET", "/series/" + place["ParentSeries"])[2])
            found.add((study["MainDicomTags"]["StudyInstanceUID"],
                       series["MainDicomTags"]["SeriesInstanceUID"]))
        return found
