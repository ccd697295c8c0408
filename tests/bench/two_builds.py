"""Compares two builds: the same jobs on a warm daemon of each, in turns.

Usage: two_builds.py BEFORE AFTER VOLUME [--dims X,Y,Z] --iso N [--format stl] [--passes 5]
                     [--runs 10] [--jobs 1] [--threads 2] [--nice N]

BEFORE and AFTER are folders with `isomeshd` and the programs that it starts. A run is so many jobs
one after another; the first of each build, which warms up, does not count. Prints for each build the
processor time and the wall time of a run (least and median) and the most private memory that its
processes had at the same time (RssAnon and RssShmem, read every few milliseconds), and the ratios.
The processes that import are forks of one, so what they share counts once (Pss).
Processor time is that of all processes of the daemon: with many short jobs it is exact enough.
On a machine that does other work, `--nice -20` (as root) gives the jobs the processors.
"""
import argparse
import http.client
import json
import os
import pathlib
import re
import statistics
import subprocess
import tempfile
import threading
import time

TICK = os.sysconf("SC_CLK_TCK")
PRIVATE = re.compile(r"^Rss(?:Anon|Shmem):\s+(\d+)", re.MULTILINE)
PART_OF_SHARED = re.compile(r"^Pss_(?:Anon|Shmem):\s+(\d+)", re.MULTILINE)


def read(path):
    """A file of /proc; empty if the process has ended."""
    try:
        return pathlib.Path(path).read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""


def family(process):
    """The process and its descendants."""
    found = [process]
    for one in found:
        for task in pathlib.Path(f"/proc/{one}/task").glob("*"):
            found += map(int, read(task / "children").split())
    return found


def private_kib(process):
    """Reading `smaps_rollup` of a job takes too long, as it maps the samples."""
    if read(f"/proc/{process}/comm").startswith("isomesh-import"):
        return sum(map(int, PART_OF_SHARED.findall(read(f"/proc/{process}/smaps_rollup"))))
    return sum(map(int, PRIVATE.findall(read(f"/proc/{process}/status"))))


class Daemon:
    def __init__(self, programs, folder, options):
        self.iso = options.iso
        self.process = subprocess.Popen(
            [f"{programs}/isomeshd", "--listen", "127.0.0.1:0", "--data", folder, "--log-level", "warn",
             "--workers", "1", "--threads", str(options.threads), "--max-upload", str(1 << 34),
             "--max-volume", str(1 << 34)], stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        self.address = re.search(r"http://([\d.:]+)", line).group(1)
        query = f"?dims={options.dims}&type=uint8" if options.dims else ""
        with open(options.volume, "rb") as body:
            size = {"Content-Length": str(os.path.getsize(options.volume))}
            self.volume = self.ask("POST", f"/v1/volumes{query}", body, size)["id"]
        self.peak = 0
        self.measures = []

    def ask(self, method, target, body=None, headers=None):
        connection = http.client.HTTPConnection(self.address)
        connection.request(method, target, body, headers or {})
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        if answer.status >= 300:
            raise RuntimeError(f"{method} {target}: {answer.status} {text.decode()}")
        return json.loads(text or b"{}")

    def processor_seconds(self):
        ticks = 0
        for one in family(self.process.pid):
            fields = read(f"/proc/{one}/stat").rpartition(")")[2].split()
            ticks += sum(map(int, fields[11:15]))
        return ticks / TICK

    def set_priority(self, niceness):
        for one in family(self.process.pid):
            for task in pathlib.Path(f"/proc/{one}/task").glob("*"):
                os.setpriority(os.PRIO_PROCESS, int(task.name), niceness)

    def watch(self, ended):
        processes = family(self.process.pid)
        looks = 0
        while not ended.wait(0.01):
            if looks % 8 == 0:
                processes = family(self.process.pid)
            looks += 1
            self.peak = max(self.peak, sum(map(private_kib, processes)))

    def job(self, options):
        self.iso -= 1e-6  # the same work, yet not the job whose mesh is there
        asked = {"volume": self.volume, "iso": self.iso, "passes": options.passes,
                 "formats": options.format.split(",")}
        job = self.ask("POST", "/v1/jobs", json.dumps(asked), {"Content-Type": "application/json",
                                                               "Prefer": "wait=30"})
        while job["state"] in ("queued", "running"):
            job = self.ask("GET", f"/v1/jobs/{job['id']}?wait=30")
        if job["state"] != "succeeded":
            raise RuntimeError(json.dumps(job))
        return job

    def run(self, options):
        ended = threading.Event()
        watcher = threading.Thread(target=self.watch, args=(ended,))
        if options.jobs == 1:  # looking takes the time of short jobs
            watcher.start()
        processor = self.processor_seconds()
        wall = time.monotonic()
        jobs = [self.job(options) for _ in range(options.jobs)]
        wall = time.monotonic() - wall
        self.measures.append((self.processor_seconds() - processor, wall))
        ended.set()
        if options.jobs == 1:
            watcher.join()
        for job in jobs:
            self.ask("DELETE", f"/v1/jobs/{job['id']}")
        return jobs[-1]

    def result(self):
        processor, wall = zip(*self.measures)
        return {"memory_mib": self.peak / 1024, "processor_s": min(processor),
                "processor_median_s": statistics.median(processor), "wall_s": min(wall),
                "wall_median_s": statistics.median(wall)}

    def end(self):
        self.process.terminate()
        self.process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("volume")
    parser.add_argument("--dims")
    parser.add_argument("--iso", type=float, required=True)
    parser.add_argument("--format", default="stl")
    parser.add_argument("--passes", type=int, default=5)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--nice", type=int)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        daemons = []
        try:
            for name in ("before", "after"):
                daemons.append(Daemon(getattr(options, name), f"{folder}/{name}", options))
            for run in range(options.runs + 1):
                for daemon in daemons:
                    job = daemon.run(options)
                    if run == 0:
                        daemon.measures.clear()
                        if options.nice is not None:
                            daemon.set_priority(options.nice)
            print(f"{options.format}, {options.passes} passes, {job['mesh']['triangles']} triangles, "
                  f"{options.runs} runs of {options.jobs}")
            before, after = (daemon.result() for daemon in daemons)
            for what in before:
                if before[what]:
                    print(f"  {what}: {before[what]:.3f} -> {after[what]:.3f}, "
                          f"ratio {after[what] / before[what]:.3f}")
        finally:
            for daemon in daemons:
                daemon.end()


if __name__ == "__main__":
    main()
