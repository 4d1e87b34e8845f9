# SPDX-License-Identifier: Apache-2.0
"""What the tests of the `nephos` command share. NEPHOS names the binary, SOURCE the source tree:

    NEPHOS=build/release/bin/nephos SOURCE=. /usr/bin/python3 tests/apps/command/run_test.py [Class[.test]]
"""

import csv
import json
import os
import pathlib
import resource
import shutil
import subprocess
import tempfile
import unittest

NEPHOS = os.path.abspath(os.environ["NEPHOS"])
SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
# A build whose shadow memory takes terabytes of addresses, and several times the time.
SANITIZED = os.environ.get("NEPHOS_SANITIZED") == "1"
# Seconds after which what takes a few is taken for hanging, also on a machine that does much else.
PATIENCE = 3000 if SANITIZED else 600


def limit_addresses(size):
    """Limits the addresses of a process that begins, where that can be."""
    if not SANITIZED:
        resource.setrlimit(resource.RLIMIT_AS, (size, size))


def unsealed(listing):
    """The text of a manifest.json or export.json without the checksum of itself, as earlier versions wrote it."""
    return json.dumps({key: value for key, value in listing.items() if key != "xxh3"})


# Without growth: what is born dies again, so that statistics have closed forms.
NULL_SCENE = """\
[lattice]
cells = [64, 64, 10]
boundaries = ["periodic", "periodic", "open"]
initial = "empty"
[field.background]
hum = 0.0
act = 0.002
ext = 0.1
"""

SCENE = """\
seed = 3
[lattice]
cells = [32, 24, 12]
[time]
steps = 6
[field.background]
hum = 0.15
act = 0.01
ext = 0.05
[density]
write_state = true
[frames]
per_second = 1
time_scale = 15
[camera]
width = 64
height = 48
[sun]
shadow_map_size = 64
"""

# The same in a layer, which others may follow.
LAYERED = SCENE.replace("[field.background]\nhum = 0.15\nact = 0.01\next = 0.05\n", "") + """\
[[sky]]
name = "clear"
state = 0
clouds = 0
[[layer]]
name = "low"
skies = "clear"
base_height_m = 0
background = { hum = 0.15, act = 0.01, ext = 0.05 }
"""

# Ten thousand steps with a frame each ten of them: long enough to be interrupted anywhere.
LONG = SCENE.replace("steps = 6", "steps = 10000").replace("time_scale = 15", "time_scale = 100")

# Three mistakes, in lines 2, 3 and 5.
BAD = """\
[lattice]
cells = [32, 24, 0]
cell_sise_m = 50
[time]
step_s = -1
"""


class Case(unittest.TestCase):
    """A temporary folder with a scene, and ways to call the command in it."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos command ü "))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.scene = self.write("tiny.toml", SCENE)
        self.environment = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "TERM", "VK_ICD_FILENAMES")}
        self.environment["TERM"] = "xterm"
        self.environment["LC_ALL"] = "C.UTF-8"

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return str(path)

    def call(self, *arguments, status=0, env=None, cwd=None, **options):
        """Runs the command; checks its exit status."""
        result = subprocess.run([NEPHOS, *map(str, arguments)], cwd=cwd or self.folder, capture_output=True, text=True,
                                env={**self.environment, **(env or {})}, timeout=PATIENCE, **options)
        self.assertEqual(result.returncode, status, f"{arguments}\n{result.stdout}\n{result.stderr}")
        return result

    def refused(self, status, *arguments, says, **options):
        """A call that fails as it should: nothing on stdout, one message on stderr, with or without a place in a file, that
        contains `says`."""
        result = self.call(*arguments, status=status, **options)
        self.assertEqual(result.stdout, "")
        self.assertRegex(result.stderr, r"\A(?:[^\n]+:\d+:\d+: )?error: ")
        self.assertIn(says, result.stderr)
        return result

    def hashes(self, *arguments):
        return self.call("hash", *arguments).stdout

    def same_runs(self, a, b):
        """Two folders of runs with the same content: statistics, hashes, decoded voxels."""
        a, b = self.folder / a, self.folder / b
        self.assertEqual((a / "statistics.csv").read_bytes(), (b / "statistics.csv").read_bytes())
        self.assertEqual((a / "checkpoint.nephos").read_bytes(), (b / "checkpoint.nephos").read_bytes())
        manifests = [json.loads((folder / "manifest.json").read_text()) for folder in (a, b)]
        for manifest in manifests:
            self.assertTrue(manifest["complete"])
            del manifest["timing"], manifest["xxh3"]  # which is of the timing, too
        self.assertEqual(*manifests)
        files = [sorted(str(p.relative_to(f)) for p in f.rglob("*") if p.is_file()) for f in (a, b)]
        self.assertEqual(*files)
        for frame in manifests[0]["frames"]:
            grids = [voxels(folder / frame["density"]) for folder in (a, b)]
            self.assertEqual(*grids)
        return manifests[0]


def rows_of(path):
    """The rows of a CSV file, each by the names in its first line."""
    return list(csv.DictReader(path.read_text().splitlines()))


def voxels(path):
    """Every active voxel and all metadata of every grid, read by OpenVDB's own Python module."""
    import pyopenvdb
    grids, metadata = pyopenvdb.readAll(str(path))
    content = {}
    for grid in grids:
        values = [(item.min, item.max, item.value) for item in grid.iterOnValues()]
        content[grid.name] = (values, sorted((k, str(v)) for k, v in grid.metadata.items()))
    return content, sorted((k, str(v)) for k, v in metadata.items())
