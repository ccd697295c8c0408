"""A disk that is full, and what is on it."""
import os
import subprocess

import peers
from fixture import Loop


class Disk(Loop):
    def test_disk_full(self):
        """An order waits for room, and goes on when there is some."""
        folder = os.path.join(self.folder.name, "small")
        os.makedirs(folder)
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=48m", "small", folder], check=True)
        try:
            self.fill_and_free(folder)
        finally:
            for daemon in self.daemons:
                daemon.kill()
            subprocess.run(["umount", "--lazy", folder], check=True)

    def fill_and_free(self, folder):
        series = self.series()
        daemon = self.daemon(None, 0, 60, 500_000_000, "", "", "--data", folder)
        filling = os.path.join(folder, "filling")
        peers.fill_disk(filling)
        status, _, answer = daemon.call("POST", "/v1/orders", {
            "source": {"pacs": "main", "study": series.study, "series": series.uid},
            "rule": "bone"})
        if status == 202:
            identity = answer["id"]
            peers.until(lambda: (daemon.get(identity)["error"] or {}).get("type") == "urn:isomesh:problem:out-of-space")
        else:
            self.assertEqual(status, 507)
        os.remove(filling)
        if status != 202:
            peers.until(lambda: peers.call(daemon.port, "GET", "/readyz")[0] == 200)
            identity = self.order(daemon, series)
        self.assert_one_mesh(self.succeeded(daemon, identity), series)
