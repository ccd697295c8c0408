"""The guide for a hospital's IT, docs/for-hospital-it.md, with a PACS at the address that it names."""
import os
import subprocess
import unittest

import dicom
import fixture
import peers

GUIDES = os.path.join(os.path.dirname(__file__), "..", "guides", "run")


class Guide(unittest.TestCase):
    def test_every_line_runs(self):
        with peers.temporary_folder() as folder:
            pacs = peers.Orthanc(os.path.join(folder, "pacs"), port=8042)
            try:
                series = dicom.Series(fixture.ROOT + ".4242")
                pacs.upload(series.files.values())
                environment = {**os.environ, "STUDY": series.study, "SERIES": series.uid}
                ran = subprocess.run([GUIDES, "for-hospital-it"], env=environment, check=False, timeout=300,
                                     stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
                self.assertEqual(ran.returncode, 0, ran.stdout)
                self.assertEqual(len(pacs.objects(series.study)), 1)
            finally:
                pacs.kill()
