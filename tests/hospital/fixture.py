"""A PACS, a proxy in front of it, and a daemon that knows both."""
import itertools
import os
import subprocess
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

DIMSE = """
[dimse]
listen = "127.0.0.1:{port}"
associations = {associations}
routes = {{ BONE = "bone", SKIN = "skin" }}
calling = ["CT1", "ROUTER", "ORTHANC"]
idle-seconds = {idle}
max-object-bytes = {most_object}
max-held-bytes = {most_held}
[[rules]]
name = "skin"
parameters = {{ iso = 300 }}
send = [ {{ pacs = "main" }} ]
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


class Receiver(Loop):
    """A daemon that also receives series by C-STORE."""

    def receiver(self, settle=8, idle=60, associations=3, most_object=1 << 30, most_held=1 << 30,
                 *options):
        port = peers.free_port()
        daemon = self.daemon(None, settle, 60, 500_000_000, "", DIMSE.format(
            port=port, idle=idle, associations=associations, most_object=most_object,
            most_held=most_held), *options)
        daemon.dimse_port = port
        return daemon

    def made(self, **how):
        """A series that nobody has, and the folder that its files are in."""
        series = dicom.Series(self.uid(), **how)
        folder = os.path.join(self.folder.name, "files-" + series.uid)
        os.makedirs(folder)
        for number, data in enumerate(series.files.values()):
            with open(os.path.join(folder, f"{number:03}.dcm"), "wb") as file:
                file.write(data)
        return series, folder

    @staticmethod
    def send(daemon, files, called="BONE", calling="CT1", check=True, options=()):
        said = subprocess.run(
            ["storescu", "--no-halt", "--verbose", "--aetitle", calling, "--call", called,
             "--timeout", "10", *options, "127.0.0.1", str(daemon.dimse_port), *files],
            capture_output=True, text=True, check=False)
        if check:
            assert said.returncode == 0, said.stdout + said.stderr
        return said.stdout + said.stderr

    @staticmethod
    def in_folder(folder):
        return sorted(os.path.join(folder, name) for name in os.listdir(folder))

    @staticmethod
    def orders(daemon):
        return daemon.call("GET", "/v1/orders")[2]["orders"]

    def of(self, daemon, series):
        return [each for each in self.orders(daemon) if each["source"]["series"] == series.uid]

    def let_all_be_ordered(self, daemon):
        """Another series goes its way: whatever came before was looked at before."""
        later, folder = self.made()
        self.send(daemon, self.in_folder(folder))
        self.succeeded(daemon, self.only_order(daemon, later))

    def only_order(self, daemon, series, seconds=60):
        found = peers.until(lambda: self.of(daemon, series), seconds)
        self.assertEqual(len(found), 1)
        return found[0]["id"]

    @staticmethod
    def received(daemon):
        """The files in the data folder, quarantine included, that are images as they were sent."""
        found = []
        for place, _, names in os.walk(daemon.data):
            for name in names:
                try:
                    with open(os.path.join(place, name), "rb") as file:
                        head = file.read(4096)
                except FileNotFoundError:
                    continue
                if head[128:132] == b"DICM" and b"ORIGINAL" in head:
                    found.append(name)
        return found
