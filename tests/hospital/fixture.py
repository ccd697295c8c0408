"""A PACS, a proxy in front of it, and a daemon that knows both."""
import itertools
import os
import unittest

import dicom
import peers

ISOMESHD = os.environ["ISOMESHD"]
ROOT = "1.2.826.0.1.3680043.10.1"

HOSPITAL = """
[orders]
settle-seconds = {settle}
poll-seconds = 1
first-delay-seconds = 1
station-name = "isomesh-test"
[[pacs]]
name = "main"
dicomweb = "http://127.0.0.1:{port}/dicom-web"
timeout-seconds = {timeout}
max-send-bytes = {most}
{pacs}
[[rules]]
name = "bone"
label = "Bone"
series-number = 9001
parameters = {{ iso = 500 }}
send = [ {{ pacs = "main", format = "stl" }} ]
{rules}
"""


class Loop(unittest.TestCase):
    """One Orthanc for all tests of a class; a proxy and a daemon for each."""

    counter = itertools.count(1)

    @classmethod
    def setUpClass(cls):
        cls.folder = peers.temporary_folder()
        cls.pacs = peers.Orthanc(os.path.join(cls.folder.name, "pacs"))

    @classmethod
    def tearDownClass(cls):
        cls.pacs.kill()
        cls.folder.cleanup()

    def setUp(self):
        self.proxy = peers.Proxy(self.pacs.port)
        self.daemons = []

    def tearDown(self):
        for daemon in self.daemons:
            if daemon.process.poll() is None:
                daemon.kill()
        self.proxy.close()

    def uid(self):
        return f"{ROOT}.{next(Loop.counter)}"

    def daemon(self, port=None, settle=0, timeout=60, most=500_000_000, pacs="", rules="", *options):
        text = HOSPITAL.format(port=port or self.proxy.port, settle=settle, timeout=timeout,
                               most=most, pacs=pacs, rules=rules)
        folder = os.path.join(self.folder.name, f"daemon-{self.uid()}")
        self.daemons.append(peers.Daemon(ISOMESHD, folder, text, *options))
        return self.daemons[-1]

    def series(self, **how):
        """A series that the PACS has."""
        series = dicom.Series(self.uid(), **how)
        self.pacs.upload(series.files.values())
        return series

    def order(self, daemon, series, headers=None, **more):
        body = {"source": {"pacs": "main", "study": series.study, "series": series.uid},
                "rule": "bone", **more}
        return daemon.order(body, headers)["id"]

    def stored(self, series):
        """The instances of meshes in the series' study."""
        return [each["00080018"]["Value"][0] for each in self.pacs.objects(series.study)]

    def succeeded(self, daemon, identity, seconds=60):
        order = daemon.ended(identity, seconds)
        self.assertEqual(order["state"], "succeeded", order["error"])
        return order

    def assert_one_mesh(self, order, series):
        self.assertEqual(self.stored(series), [order["results"][0]["sop_instance_uid"]])
