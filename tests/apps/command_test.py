# SPDX-License-Identifier: Apache-2.0
"""Drives the `nephos` command as a user would. NEPHOS names the binary, SOURCE the source tree.

    NEPHOS=build/release/bin/nephos SOURCE=. /usr/bin/python3 tests/apps/command_test.py [Class[.test]]
"""

import csv
import json
import os
import pathlib
import pty
import re
import resource
import select
import shutil
import signal
import stat
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest

NEPHOS = os.path.abspath(os.environ["NEPHOS"])
SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()

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

# Ten thousand steps with a frame each ten of them: long enough to be interrupted anywhere.
LONG = SCENE.replace("steps = 6", "steps = 10000").replace("time_scale = 15", "time_scale = 100")


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

    def call(self, *arguments, status=0, env=None, **options):
        """Runs the command; checks its exit status."""
        result = subprocess.run([NEPHOS, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True,
                                env={**self.environment, **(env or {})}, timeout=120, **options)
        self.assertEqual(result.returncode, status, f"{arguments}\n{result.stdout}\n{result.stderr}")
        return result

    def refused(self, status, *arguments, says, **options):
        """A call that fails as it should: nothing on stdout, one message on stderr that contains `says`."""
        result = self.call(*arguments, status=status, **options)
        self.assertEqual(result.stdout, "")
        self.assertTrue(result.stderr.startswith("error: "), result.stderr)
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
            del manifest["timing"]
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


class Usage(Case):
    def test_help_goes_to_stdout(self):
        for arguments in (["--help"], ["run", "--help"], ["render", "-h"], ["validate", "--help"], ["info", "--help"],
                          ["hash", "--help"], ["state", "--help"], ["completion", "--help"]):
            result = self.call(*arguments)
            self.assertIn("Usage: nephos", result.stdout)
            self.assertEqual(result.stderr, "")
        for command in ("run", "render", "validate", "info", "hash", "state", "completion"):
            self.assertIn(f"\n  {command}", self.call("--help").stdout)

    def test_version(self):
        self.assertRegex(self.call("--version").stdout, r"^nephos \d+\.\d+\.\d+ \(random stream \d+\)\n$")

    def test_bad_arguments_are_status_2(self):
        for arguments, says in (
            ([], "a command is missing"),
            (["rum"], "did you mean `run`"),
            (["run"], "SCENE is missing"),
            (["run", self.scene, "--oot", "x"], "did you mean `--out`"),
            (["run", self.scene, "surplus"], "surplus"),
            (["run", self.scene, "--out"], "--out"),
            (["run", self.scene, "--threads", "0"], "--threads '0'"),
            (["run", self.scene, "--threads", "many"], "--threads 'many'"),
            (["run", self.scene, "--seed", "-1"], "--seed '-1'"),
            (["run", self.scene, "--frames", "5..2"], "--frames '5..2'"),
            (["run", self.scene, "--frames", "0..2"], "--frames '0..2'"),
            (["run", self.scene, "--frames", "90"], "1 to 5"),
            (["run", self.scene, "--frames", "2..6"], "1 to 5"),
            (["run", self.scene, "--statistics-only", "--frames", "2..3"], "--statistics-only"),
            (["run", self.scene, "--checkpoint-every", "soon"], "--checkpoint-every 'soon'"),
            (["run", self.scene, "--resume", "--overwrite"], "--overwrite"),
            (["hash", self.scene, "--steps", "1e3"], "--steps '1e3'"),
            (["hash", self.scene, "--steps", "99999999999999999999999"], "--steps"),
            (["state", self.scene], "--out"),
            (["render", "x.vdb"], "--out"),
            (["render", "x.vdb", "--out", "x.jpg"], ".png or .exr"),
            (["render", "x.vdb", "--out", "x.png", "--size", "0x0"], "--size '0x0'"),
            (["render", "x.vdb", "--out", "x.png", "--camera", "1,2"], "--camera '1,2'"),
            (["render", "x.vdb", "--out", "x.png", "--sun", "95,0"], "--sun '95,0'"),
            (["render", "x.vdb", "--out", "x.png", "--set", "a=1"], "--scene"),
            (["completion", "tcsh"], "tcsh"),
        ):
            with self.subTest(arguments=arguments):
                self.refused(2, *arguments, says=says)

    def test_values_may_be_given_twice_only_where_it_makes_sense(self):
        self.refused(2, "run", self.scene, "--out", "a", "--out", "b", says="--out")
        self.hashes(self.scene, "--steps", "0", "--set", "seed=1", "--set", "time.steps=2")


class Scenes(Case):
    BAD = """\
[lattice]
cells = [32, 24, 0]
cell_sise_m = 50
[time]
step_s = -1
"""

    def test_every_problem_at_once_with_its_place(self):
        bad = self.write("bad.toml", self.BAD)
        for command in (["validate", bad], ["run", bad, "--no-render"], ["hash", bad]):
            result = self.call(*command, status=2)
            self.assertEqual(result.stdout, "")
            for place in (":2:", ":3:", ":5:"):
                self.assertIn("bad.toml" + place, result.stderr)
            self.assertEqual(result.stderr.count("error:"), 3, result.stderr)
            self.assertIn("cell_size_m", result.stderr)  # did you mean

    def test_json(self):
        bad = self.write("bad.toml", self.BAD)
        result = self.call("validate", self.scene, bad, "--json", status=2)
        good, wrong = json.loads(result.stdout)
        self.assertTrue(good["valid"])
        self.assertEqual(good["cells"], [32, 24, 12])
        self.assertFalse(wrong["valid"])
        self.assertEqual([p["line"] for p in wrong["problems"]], [2, 3, 5])

    def test_the_printed_scene_is_the_scene(self):
        text = self.call("validate", self.scene, "--print").stdout
        self.write("again/tiny.toml", text)
        hashes = [json.loads(self.call("validate", p, "--json").stdout)[0]["scene_hash"]
                  for p in (self.scene, "again/tiny.toml")]
        self.assertEqual(*hashes)

    def test_set_and_seed_change_the_scene(self):
        base = self.hashes(self.scene, "--steps", "3")
        self.assertNotEqual(base, self.hashes(self.scene, "--steps", "3", "--seed", "4"))
        self.assertEqual(self.hashes(self.scene, "--steps", "3", "--set", "seed=4"),
                         self.hashes(self.scene, "--steps", "3", "--seed", "4"))
        self.assertNotEqual(base, self.hashes(self.scene, "--steps", "3", "--set", "field.background.hum=0.5"))
        self.refused_set("field.background.hun=0.5", "hum")
        self.refused_set("field.background.hum=7", "0 to 1")
        self.refused_set("nonsense", "nonsense")

    def refused_set(self, change, says):
        result = self.call("hash", self.scene, "--set", change, status=2)
        self.assertIn(says, result.stderr)

    def test_shipped_scenes_are_valid(self):
        scenes = sorted((SOURCE / "scenes").glob("*.toml"))
        self.assertGreaterEqual(len(scenes), 4)
        self.call("validate", *scenes)

    def test_base_models_without_a_layer_are_noted(self):
        lonely = self.write("lonely.toml", f'name = "lonely"\nmodels = ["{SOURCE}/scenes/genera/Cb.toml"]\n')
        self.assertIn("no [[layer]]", self.call("validate", lonely).stderr)
        self.assertEqual(self.call("validate", SOURCE / "scenes/genera/Cb.toml").stderr, "")

    def test_quiet_runs_say_nothing(self):
        lonely = self.write("lonely.toml", f'name = "lonely"\nmodels = ["{SOURCE}/scenes/genera/Cb.toml"]\n')
        for scene in self.scene, lonely:
            command = ["run", scene, "--no-render", "--set", "time.steps=2", "--set", "lattice.cells=[16,16,8]"]
            self.assertNotEqual(self.call(*command, "--overwrite", "--out", "loud").stdout, "")
            quiet = self.call(*command, "--overwrite", "--out", "quiet", "--quiet")
            self.assertEqual((quiet.stdout, quiet.stderr), ("", ""))

    def test_a_lattice_beyond_memory_is_refused(self):
        result = self.call("run", self.scene, "--no-render", "--set", "lattice.cells=[65536,65536,65536]", status=2)
        self.assertIn("TiB", result.stderr)
        self.call("hash", self.scene, "--set", "lattice.cells=[65536,65536,65536]", status=2)
        self.call("state", self.scene, "--out", "x.vdb", "--set", "lattice.cells=[65536,65536,65536]", status=2)


class Files(Case):
    def test_files_that_are_not_there_are_named(self):
        for arguments in (["run", "no.toml"], ["validate", "no.toml"], ["hash", "no.toml"],
                          ["state", "no.toml", "--out", "x.vdb"], ["info", "no.toml"],
                          ["render", "no.toml", "--out", "x.png"], ["hash", self.scene, "--from", "no.toml"],
                          ["hash", self.scene, "--check", "no.toml"], ["render", "x.vdb", "--scene", "no.toml", "--out", "x.png"]):
            with self.subTest(arguments=arguments):
                self.refused(3, *arguments, says="no.toml")

    def test_folders_where_files_should_be(self):
        (self.folder / "folder.toml").mkdir()
        for arguments in (["run"], ["validate"], ["hash"], ["info"], ["state", "--out", "x.vdb"],
                          ["render", "--out", "x.png"], ["hash", self.scene, "--from"], ["hash", self.scene, "--check"]):
            with self.subTest(arguments=arguments):
                self.refused(3, *arguments, "folder.toml", says="folder.toml")
        self.refused(3, "state", self.scene, "--out", "folder.toml", says="folder.toml")

    def test_garbage_is_refused_by_name(self):
        for name, content in (("empty", b""), ("text", b"hello world" * 10), ("vdb", b" BDV\0\0\0\0" + b"x" * 100),
                              ("exr", b"\x76\x2f\x31\x01" + b"x" * 100), ("checkpoint", b"NEPHOSCP" + b"x" * 100)):
            path = self.folder / name
            path.write_bytes(content)
            with self.subTest(name=name):
                self.refused(3, "info", path, says=name)
                self.refused(3, "render", path, "--out", "x.png", says=name)
                self.refused(3, "hash", self.scene, "--from", path, says=name)

    def test_pipes_and_links_in_the_folder_of_a_run(self):
        for name in ("manifest.json", "statistics.csv", "checkpoint.nephos", "density/tiny_0001.vdb"):
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            (self.folder / "out/density").mkdir(parents=True)
            os.mkfifo(self.folder / "out" / name)
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", says=name)
            self.assertTrue((self.folder / "out" / name).is_fifo())
            self.call("run", self.scene, "--no-render", "--out", "out", "--overwrite")
            self.assertTrue((self.folder / "out" / name).is_file())
        for name in ("checkpoint.nephos", "manifest.json", "statistics.csv"):
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            self.call("run", self.scene, "--no-render", "--out", "out")
            (self.folder / "out" / name).unlink()
            os.mkfifo(self.folder / "out" / name)
            self.refused(3, "run", self.scene, "--no-render", "--out", "out", "--resume", says=name)
        # The folder and its parts may be links, to elsewhere and to nothing.
        elsewhere = self.folder / "elsewhere"
        (elsewhere / "grids").mkdir(parents=True)
        (self.folder / "link").symlink_to(elsewhere)
        (elsewhere / "density").symlink_to("grids")
        self.call("run", self.scene, "--no-render", "--out", "link")
        self.assertEqual(len(list((elsewhere / "grids").iterdir())), 5)
        (self.folder / "nowhere").symlink_to("not there")
        self.refused(3, "run", self.scene, "--no-render", "--out", "nowhere", says="nowhere")
        # A link in the place of a file is somebody's, whatever it points to.
        (self.folder / "mine").write_text("mine")
        (self.folder / "third").mkdir()
        (self.folder / "third/statistics.csv").symlink_to("../mine")
        self.refused(2, "run", self.scene, "--no-render", "--out", "third", says="statistics.csv")
        self.call("run", self.scene, "--no-render", "--out", "third", "--overwrite")
        self.assertEqual((self.folder / "mine").read_text(), "mine")

    def test_a_foreign_manifest(self):
        for text in ("", "{}", "[1, 2]", "mine", '{"format": "nephos run", "format_version": 999}'):
            self.write("out/manifest.json", text)
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", says="manifest.json")
            self.assertEqual((self.folder / "out/manifest.json").read_text(), text)
        self.assertEqual(len(list((self.folder / "out").iterdir())), 1)
        self.call("run", self.scene, "--no-render", "--out", "out", "--overwrite")

    def test_a_run_of_another_scene_stays(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        table = (self.folder / "out/statistics.csv").read_text()
        for change in (["--seed", "77"], ["--set", "time.step_s=7"]):
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", *change, says="another scene or seed")
            self.assertEqual((self.folder / "out/statistics.csv").read_text(), table)
        self.call("run", self.scene, "--no-render", "--out", "out")  # the same scene: the same files
        self.assertEqual((self.folder / "out/statistics.csv").read_text(), table)
        self.call("run", self.scene, "--no-render", "--out", "out", "--seed", "77", "--overwrite")
        self.assertNotEqual((self.folder / "out/statistics.csv").read_text(), table)

    def test_named_pipes_are_refused_and_those_of_commands_read(self):
        os.mkfifo(self.folder / "pipe")
        for arguments in (["info"], ["validate"], ["run"], ["hash"], ["hash", self.scene, "--check"],
                          ["hash", self.scene, "--from"]):
            with self.subTest(arguments=arguments):
                self.refused(3, *arguments, "pipe", says="pipe")
        result = subprocess.run(["bash", "-c", f'"{NEPHOS}" validate <(cat "{self.scene}")'], capture_output=True, text=True,
                                timeout=60, env=self.environment)
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_one_unreadable_file_does_not_hide_the_others(self):
        bad = self.write("bad.toml", Scenes.BAD)
        result = self.call("validate", "no.toml", bad, self.scene, "--json", status=3)
        entries = json.loads(result.stdout)
        self.assertEqual([entry["valid"] for entry in entries], [False, False, True])
        self.assertIn("no.toml", entries[0]["error"])
        self.assertIn("error: ", result.stderr)
        self.assertIn("tiny.toml: valid", self.call("validate", "no.toml", self.scene, status=3).stdout)

        self.call("state", self.scene, "--out", "good.vdb")
        self.write("empty", "")
        result = self.call("info", "empty", "no.vdb", "good.vdb", "--json", status=3)
        entries = json.loads(result.stdout)
        self.assertEqual([entry.get("kind") for entry in entries], [None, None, "vdb"])
        self.assertIn("is empty", entries[0]["error"])
        result = self.call("info", "empty", "good.vdb", status=3)
        self.assertTrue(result.stdout.startswith("good.vdb: OpenVDB"), result.stdout)
        self.assertEqual(result.stderr.count("error: "), 1)
        self.assertIn("no.vdb", json.loads(self.call("info", "no.vdb", "--json", status=3).stdout)["error"])

    def test_a_checkpoint_that_lies_about_its_size(self):
        head = b"NEPHOSCP" + struct.pack("<II", 1, 1) + b"a" * 32 + bytes(24)
        for name, sizes in (("state", [1 << 62]), ("history", [8, 1 << 62]), ("sum", [(1 << 64) - 8])):
            content = head
            for size in sizes:
                content += struct.pack("<Q", size) + bytes(8 if size == 8 else 0)
            path = self.folder / name
            path.write_bytes(content)
            self.refused(3, "info", path, says="bytes announced")
        # A sparse file of a terabyte costs nothing to make, and must cost nothing to refuse.
        with open(self.folder / "huge", "wb") as file:
            file.write(head + struct.pack("<Q", 100))
            file.truncate(1 << 40)
        self.refused(3, "info", "huge", says="bytes after its end")
        with open(self.folder / "huge", "r+b") as file:
            file.seek(len(head))
            file.write(struct.pack("<Q", (1 << 40) - len(head) - 32))
        self.refused(3, "info", "huge", says="to read, but")

    def test_an_output_that_is_in_the_way(self):
        self.write("file", "mine")
        self.refused(3, "run", self.scene, "--no-render", "--out", "file", says="file")
        self.refused(3, "run", self.scene, "--no-render", "--out", "file/below", says="file")
        self.refused(3, "state", self.scene, "--out", "file/x.vdb", says="file")
        self.assertEqual((self.folder / "file").read_text(), "mine")

    def test_a_folder_without_rights(self):
        locked = self.folder / "locked"
        locked.mkdir()
        locked.chmod(0o555)
        os.chmod(self.folder, 0o755)
        drop = (lambda: os.setuid(65534)) if os.getuid() == 0 else None
        self.refused(3, "run", self.scene, "--no-render", "--out", "locked/out", says="locked", preexec_fn=drop)
        self.refused(3, "state", self.scene, "--out", "locked/x.vdb", says="locked", preexec_fn=drop)

    def test_names_with_spaces_and_other_scripts(self):
        scene = self.write("Вечер 雲/mein Himmel ☁.toml", "name = \"cloud\"\n" + SCENE)
        self.call("run", scene, "--no-render", "--out", "aus gabe/雲")
        self.assertTrue((self.folder / "aus gabe/雲/density/cloud_0001.vdb").exists())
        self.call("info", "aus gabe/雲/density/cloud_0001.vdb")
        self.call("state", scene, "--steps", "1", "--out", "état.vdb")
        self.call("hash", scene, "--steps", "1", "--from", "état.vdb")

    def test_a_full_disk_is_status_3_and_leaves_nothing_half(self):
        def small():
            resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
        result = self.refused(3, "state", self.scene, "--out", "x.vdb", says="x.vdb", preexec_fn=small)
        self.assertNotIn("unexpected", result.stderr)
        self.assertEqual([p.name for p in self.folder.iterdir()], ["tiny.toml"])
        self.refused(3, "run", self.scene, "--no-render", "--out", "out", says="out/", preexec_fn=small)
        left = [p.name for p in (self.folder / "out").rglob("*") if p.is_file()]
        self.assertFalse([name for name in left if "part" in name or name.endswith(".vdb")], left)
        # With room again the same command works.
        self.call("run", self.scene, "--no-render", "--out", "out")

    def test_little_memory_is_an_error_and_no_crash(self):
        big = self.write("big.toml", SCENE.replace("[32, 24, 12]", "[4096, 4096, 512]"))
        def small():
            resource.setrlimit(resource.RLIMIT_AS, (700 << 20, 700 << 20))
        result = self.call("run", big, "--no-render", status=2, preexec_fn=small)
        self.assertIn("error:", result.stderr)
        result = self.call("hash", big, status=2, preexec_fn=small)
        self.assertIn("error:", result.stderr)


class Disk(Case):
    """A full disk at every kind of file: exit status 3, the file's name, nothing half, and the rest as it was."""

    def limited(self, size):
        return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    def need_device(self):
        if shutil.which("vulkaninfo") is None and not list(pathlib.Path("/usr/share/vulkan/icd.d").glob("*")):
            self.skipTest("no Vulkan device")

    def no_parts(self):
        parts = [p for p in self.folder.rglob("*") if ".part" in p.name]
        self.assertEqual(parts, [])

    def refused_at(self, size, says, *arguments):
        result = self.refused(3, *arguments, says=says, preexec_fn=self.limited(size))
        self.assertIn("File too large", result.stderr)
        self.no_parts()

    def test_manifest(self):
        self.refused_at(100, "manifest.json", "run", self.scene, "--no-render", "--out", "out")
        self.assertEqual([p.name for p in (self.folder / "out").iterdir()], [])

    def test_vdb(self):
        # Larger than manifest and table, smaller than a grid.
        self.refused_at(5000, "tiny_0001.vdb", "run", self.scene, "--no-render", "--out", "out")
        self.call("run", self.scene, "--no-render", "--out", "out")
        self.refused_at(5000, "x.vdb", "state", self.scene, "--out", "x.vdb")

    def test_frames_that_were_finished_stay(self):
        """Files grow with the clouds: a limit that some later frame is the first to pass."""
        growing = ["--set", "density.write_state=false", "--set", "field.background.act=0.0002", "--set", "field.background.ext=0",
                   "--set", "time.steps=20", "--no-render", "--out"]
        self.call("run", self.scene, *growing, "whole")
        sizes = [(self.folder / frame["density"]).stat().st_size for frame in self.listed("whole")]
        limit = 2 * max(sizes) // 3
        failed = next(n for n, size in enumerate(sizes) if size > limit)
        self.assertGreater(failed, 2)
        for threads in (1, 2):
            with self.subTest(threads=threads):
                out = f"out{threads}"
                self.refused_at(limit, f"tiny_{failed + 1:04}.vdb", "run", self.scene, *growing, out, "--threads", threads)
                self.assertEqual([frame["number"] for frame in self.listed(out)], list(range(1, failed + 1)))
                on_disk = sorted(p.name for p in (self.folder / out / "density").iterdir())
                self.assertEqual(on_disk, [f"tiny_{n:04}.vdb" for n in range(1, failed + 1)])
                self.call("run", self.scene, *growing, out)
                self.same_runs("whole", out)

    def listed(self, out):
        """The frames in a run's manifest, each of whose files is there."""
        frames = json.loads((self.folder / out / "manifest.json").read_text())["frames"]
        for frame in frames:
            frame["density"] = f"{out}/{frame['density']}"
            self.call("info", frame["density"])
        return frames

    def test_statistics(self):
        # Grids of few voxels stay small, the table of many steps does not.
        few = ["--set", "lattice.cells=[8,8,8]", "--set", "density.write_state=false", "--set", "frames.time_scale=100000",
               "--set", "time.steps=300", "--no-render", "--out", "out"]
        self.refused_at(15000, "statistics.csv", "run", self.scene, *few)
        # Whole rows or none, and the run can start again.
        text = (self.folder / "out/statistics.csv").read_text()
        self.assertTrue(text.endswith("\n"))
        self.call("run", self.scene, *few)
        self.assertGreater((self.folder / "out/statistics.csv").stat().st_size, 15000)

    def test_checkpoint(self):
        # Planes without a cloud: grids stay small, planes as bits do not.
        bare = ["--set", "field.background.act=0", "--set", "density.write_state=false", "--set", "lattice.cells=[256,256,32]",
                "--no-render", "--out", "out"]
        self.refused_at(100000, "checkpoint.nephos", "run", self.scene, *bare)
        self.assertFalse((self.folder / "out/checkpoint.nephos").exists())
        self.call("run", self.scene, *bare)

    def test_pictures(self):
        self.need_device()
        small = ["--set", "lattice.cells=[16,16,8]", "--set", "density.write_state=false", "--set", "camera.width=640",
                 "--set", "camera.height=480"]
        self.refused_at(20000, "tiny_0001.png", "run", self.scene, *small, "--out", "png")
        self.refused_at(20000, "tiny_0001.exr", "run", self.scene, *small, "--out", "exr", "--set", "frames.png=false",
                        "--set", "frames.exr=true")
        self.call("run", self.scene, *small, "--no-render", "--out", "out")
        for name in ("x.png", "x.exr"):
            self.refused_at(20000, name, "render", "out/density/tiny_0005.vdb", "--out", name)
            self.assertFalse((self.folder / name).exists())

    def test_pictures_that_were_finished_stay(self):
        """The first picture that is larger than all before it fails; those before it are as in a whole run."""
        self.need_device()
        changes = ["--set", "density.write_state=false", "--set", "camera.width=640", "--set", "camera.height=480",
                   "--set", "field.background.act=0.0002", "--set", "field.background.ext=0", "--set", "time.steps=20"]
        self.call("run", self.scene, *changes, "--out", "whole")
        names = sorted(p.name for p in (self.folder / "whole/frames").iterdir())
        sizes = [(self.folder / "whole/frames" / name).stat().st_size for name in names]
        failed = next(n for n in range(3, len(sizes)) if sizes[n] > max(sizes[:n]))
        limit = max(sizes[:failed])
        others = [p for p in (self.folder / "whole").rglob("*") if p.is_file() and p.suffix != ".png"]
        self.assertLess(max(p.stat().st_size for p in others), limit, "a picture is the first to fail")
        for threads in (1, 2):
            with self.subTest(threads=threads):
                out = self.folder / f"out{threads}"
                self.refused_at(limit, names[failed], "run", self.scene, *changes, "--out", out, "--threads", threads)
                self.assertEqual([frame["number"] for frame in json.loads((out / "manifest.json").read_text())["frames"]],
                                 list(range(1, failed + 1)))
                self.assertEqual(sorted(p.name for p in (out / "frames").iterdir()), names[:failed])
                for name in names[:failed]:
                    self.assertEqual((out / "frames" / name).read_bytes(), (self.folder / "whole/frames" / name).read_bytes())
                self.call("run", self.scene, *changes, "--out", out)
                self.same_runs("whole", out.name)

    def test_a_small_file_system(self):
        """No limit on files but a disk that is really full, where this machine lets us mount one."""
        self.need_device()
        disk = self.folder / "disk"
        disk.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", disk], capture_output=True).returncode != 0:
            self.skipTest("mounting is not allowed here")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        for kind, many in (("density", ["--no-render"]), ("frames", ["--set", "frames.png=false", "--set", "frames.exr=true"])):
            result = self.refused(3, "run", self.scene, *many, "--out", f"disk/{kind}", "--set", "time.steps=60",
                                  says="No space left on device")
            self.assertIn(f"disk/{kind}/", result.stderr)
            self.no_parts()
            frames = json.loads((disk / kind / "manifest.json").read_text())["frames"]
            self.assertGreater(len(frames), 1)
            self.assertLessEqual(len(frames), len(list((disk / kind / kind).iterdir())))
            for frame in (disk / kind / kind).iterdir():
                self.call("info", frame)
            shutil.rmtree(disk / kind)


class Memory(Case):
    SKIES = {"overcast": (0.9, 0.6, 0), "fair": (0.1, 0.0005, 0.3)}
    OUTPUTS = {"plain": "", "state": "write_state = true", "refined": "refine = 2",
               "all": "write_state = true\nrefine = 2\nwrite_velocity = true\nhalf = true"}

    def peak(self, *arguments):
        """Bytes of main memory that a command took at its peak."""
        out = os.open("/dev/null", os.O_WRONLY)
        self.addCleanup(os.close, out)
        child = os.posix_spawn(NEPHOS, [NEPHOS, *map(str, arguments)], self.environment,
                               file_actions=[(os.POSIX_SPAWN_DUP2, out, 1)])
        _, status, usage = os.wait4(child, 0)
        self.assertEqual(status, 0)
        return usage.ru_maxrss * 1024

    @unittest.skipIf("asan" in NEPHOS or "tsan" in NEPHOS, "sanitizers take memory of their own")
    def test_a_run_stays_below_its_estimate(self):
        for sky, (hum, act, ext) in self.SKIES.items():
            for output, keys in self.OUTPUTS.items():
                scene = self.write(f"{sky} {output}.toml", f"[lattice]\ncells = [192, 200, 60]\n[time]\nsteps = 5\n"
                                   f"[field.background]\nhum = {hum}\nact = {act}\next = {ext}\n[density]\n{keys}\n"
                                   f"[frames]\nper_second = 1\ntime_scale = 13\n")
                estimate = json.loads(self.call("validate", scene, "--json").stdout)[0]["memory_bytes_without_pictures"]
                peak = self.peak("run", scene, "--no-render", "--out", self.folder / f"{sky} {output}")
                with self.subTest(sky=sky, output=output):
                    self.assertLess(peak, estimate)
                    self.assertLess(estimate, 2 * peak, "so large that it would refuse what fits")


class Results(Case):
    def test_hash_prints_a_line_for_each_step(self):
        lines = self.hashes(self.scene, "--steps", "5").splitlines()
        self.assertEqual([line.split()[0] for line in lines], list("012345"))
        for line in lines:
            self.assertRegex(line, r"^\d [0-9a-f]{32}$")
        self.assertEqual(len(set(line.split()[1] for line in lines)), 6)
        self.assertEqual(len(self.hashes(self.scene).splitlines()), 7)  # the scene's own six steps

    def test_threads_do_not_change_a_bit(self):
        one = self.hashes(SOURCE / "scenes/cumulus.toml", "--steps", "12", "--threads", "1")
        for threads in (2, 3, 8):
            self.assertEqual(one, self.hashes(SOURCE / "scenes/cumulus.toml", "--steps", "12", "--threads", threads))

    def test_check_compares(self):
        self.write("golden.txt", "# comment\n" + self.hashes(self.scene, "--steps", "4"))
        self.call("hash", self.scene, "--steps", "4", "--check", "golden.txt")
        self.refused(1, "hash", self.scene, "--steps", "4", "--check", "golden.txt", "--seed", "9", says="step 0")
        self.refused(1, "hash", self.scene, "--steps", "5", "--check", "golden.txt", says="step 5")
        self.refused(1, "hash", self.scene, "--steps", "3", "--check", "golden.txt", says="4 steps")

    def test_state_goes_round(self):
        all_steps = self.hashes(self.scene, "--steps", "6").splitlines()
        result = self.call("state", self.scene, "--steps", "6", "--out", "state.vdb")
        self.assertEqual(result.stdout.strip(), all_steps[6])
        # The file holds that very state: starting from it, step 0 has its hash.
        again = self.hashes(self.scene, "--steps", "0", "--from", "state.vdb")
        self.assertEqual(again.split()[1], all_steps[6].split()[1])
        as_json = json.loads(self.call("state", self.scene, "--steps", "6", "--out", "state.vdb", "--json").stdout)
        self.assertEqual(as_json["hash"], all_steps[6].split()[1])
        content, _ = voxels(self.folder / "state.vdb")
        self.assertEqual(sorted(content), ["act", "cld", "hum"])
        # A state of another size is refused, a smaller scene as well as a larger one.
        for cells in ("[8,8,8]", "[32,24,13]"):
            result = self.refused(3, "hash", self.scene, "--from", "state.vdb", "--set", f"lattice.cells={cells}",
                                  says="state.vdb")
            self.assertIn("32 x 24 x 12", result.stderr)

    def test_a_state_of_another_place_is_refused(self):
        self.call("state", self.scene, "--steps", "2", "--out", "state.vdb")
        scene = self.write("from.toml", SCENE.replace("[time]", 'initial_state = "state.vdb"\n[time]'))
        for setting, says in (("lattice.cell_size_m=25", "cells of 50 m, but the scene's lattice has cells of 25 m"),
                              ("lattice.origin_m=[10,0,1000]", "but the scene's lattice at (10, 0, 1000) m")):
            for command in (["hash", self.scene, "--from", "state.vdb"],
                            ["state", self.scene, "--from", "state.vdb", "--out", "next.vdb"],
                            ["run", scene, "--no-render", "--out", "out"]):
                with self.subTest(setting=setting, command=command):
                    result = self.refused(3, *command, "--set", setting, says="state.vdb")
                    self.assertIn(says, result.stderr)

    def test_a_run_starts_from_a_state(self):
        self.call("state", self.scene, "--steps", "4", "--out", "state.vdb")
        scene = self.write("from.toml", SCENE.replace("[time]", 'initial_state = "state.vdb"\n[time]'))
        self.call("run", scene, "--no-render", "--out", "out")
        expected = self.hashes(self.scene, "--from", "state.vdb").splitlines()
        self.assertEqual([row["hash"] for row in rows_of(self.folder / "out/statistics.csv")],
                         [line.split()[1] for line in expected])
        self.assertEqual(expected[0].split()[1], self.hashes(self.scene, "--steps", "4").splitlines()[4].split()[1])
        # Another state is another simulation.
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        self.call("state", self.scene, "--steps", "5", "--out", "state.vdb")
        self.refused(2, "run", scene, "--no-render", "--out", "out", "--resume", says="the simulation itself differs")
        self.call("run", scene, "--no-render", "--out", "out")
        again = json.loads((self.folder / "out/manifest.json").read_text())
        self.assertNotEqual(manifest["scene"]["simulation_hash"], again["scene"]["simulation_hash"])

    def test_run_writes_what_it_lists(self):
        result = self.call("run", self.scene, "--no-render")
        self.assertEqual(result.stderr, "", "no bar and no notes without a terminal")
        out = self.folder / "out/tiny"
        for part in ("density/tiny_0001.vdb", "statistics.csv", "manifest.json", "checkpoint.nephos"):
            self.assertTrue((out / part).exists(), part)
            self.assertIn(part, result.stdout)
        rows = rows_of(out / "statistics.csv")
        self.assertEqual([row["step"] for row in rows], [str(n) for n in range(7)])
        expected = [line.split()[1] for line in self.hashes(self.scene).splitlines()]
        self.assertEqual([row["hash"] for row in rows], expected)
        self.assertGreater(float(rows[-1]["mean_density"]), 0)
        manifest = json.loads((out / "manifest.json").read_text())
        self.assertEqual(sorted(p.name for p in (out / "density").iterdir()),
                         [pathlib.Path(f["density"]).name for f in manifest["frames"]])
        # The film rate is the same wherever it is named.
        self.assertEqual((manifest["frames_per_second"], manifest["time_scale"]), (1, 15))
        metadata = json.loads(self.call("info", "--json", out / "density/tiny_0001.vdb").stdout)["metadata"]
        self.assertEqual((float(metadata["nephos_frames_per_second"]), float(metadata["nephos_time_scale"])), (1, 15))

    def test_all_json_parses(self):
        run = json.loads(self.call("run", self.scene, "--no-render", "--json").stdout)
        self.assertTrue(run["complete"])
        for kind in ("density", "statistics", "manifest", "checkpoint"):
            for file in run["files"][kind]:
                self.assertTrue((self.folder / file).exists(), file)
        hashes = json.loads(self.call("hash", self.scene, "--json").stdout)
        self.assertEqual(run["state_hash"], hashes["hashes"][6])
        info = json.loads(self.call("info", "--json", run["files"]["density"][4]).stdout)
        self.assertEqual(info["kind"], "vdb")
        self.assertEqual([grid["name"] for grid in info["grids"]][0], "density")
        self.assertEqual(info["metadata"]["nephos_state_hash"], run["state_hash"])
        checkpoint = json.loads(self.call("info", "--json", run["files"]["checkpoint"][0]).stdout)
        self.assertEqual(checkpoint["kind"], "checkpoint")
        self.assertEqual(checkpoint["simulation_hash"], run["simulation_hash"])
        both = json.loads(self.call("info", "--json", run["files"]["density"][0], run["files"]["checkpoint"][0]).stdout)
        self.assertEqual([entry["kind"] for entry in both], ["vdb", "checkpoint"])

    def test_frames_writes_only_these(self):
        self.call("run", self.scene, "--no-render", "--out", "all")
        self.call("run", self.scene, "--no-render", "--out", "some", "--frames", "2..3")
        names = sorted(p.name for p in (self.folder / "some/density").iterdir())
        self.assertEqual(names, ["tiny_0002.vdb", "tiny_0003.vdb"])
        for name in names:
            self.assertEqual(voxels(self.folder / "some/density" / name), voxels(self.folder / "all/density" / name))

    def test_statistics_only_writes_the_same_statistics_and_no_frames(self):
        self.call("run", self.scene, "--no-render", "--out", "all")
        result = self.call("run", self.scene, "--statistics-only", "--out", "some", "--quiet")
        self.assertEqual((result.stdout, result.stderr), ("", ""))
        self.assertEqual((self.folder / "some/statistics.csv").read_bytes(),
                         (self.folder / "all/statistics.csv").read_bytes())
        self.assertEqual(list(self.folder.glob("some/**/*.vdb")) + list(self.folder.glob("some/**/*.png")), [])

    def test_names_of_files_do_not_matter_to_info(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        shutil.copy(self.folder / "out/density/tiny_0001.vdb", self.folder / "a.exr")
        self.assertEqual(json.loads(self.call("info", "--json", "a.exr").stdout)["kind"], "vdb")


class Terminal(Case):
    def on_terminal(self, *arguments, columns=100, env=None):
        """Runs with stderr (and stdout) on a terminal; returns all that appeared there."""
        leader, follower = pty.openpty()
        termios.tcsetwinsize(follower, (24, columns)) if hasattr(termios, "tcsetwinsize") else \
            __import__("fcntl").ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        process = subprocess.Popen([NEPHOS, *map(str, arguments)], cwd=self.folder, stdin=follower, stdout=follower,
                                   stderr=follower, env={**self.environment, **(env or {})})
        os.close(follower)
        shown = b""
        while True:
            ready, _, _ = select.select([leader], [], [], 60)
            self.assertTrue(ready, "nothing happens")
            try:
                piece = os.read(leader, 65536)
            except OSError:
                break
            if not piece:
                break
            shown += piece
        os.close(leader)
        return process.wait(timeout=60), shown.decode()

    def test_progress_only_on_a_terminal(self):
        status, shown = self.on_terminal("run", self.scene, "--no-render", "--set", "time.steps=300")
        self.assertEqual(status, 0)
        self.assertRegex(shown, r"step \d+/301 .*\d+%.*steps/s")
        self.assertRegex(shown, r"left")
        self.assertIn("━", shown)
        for line in re.split(r"[\r\n]+", shown):
            visible = re.sub(r"\x1b\[[0-9;]*[mK]", "", line)
            if visible.startswith("step "):
                self.assertLess(len(visible), 100)
        for env, arguments in (({"TERM": "dumb"}, []), ({}, ["--quiet"])):
            _, shown = self.on_terminal("run", self.scene, "--no-render", *arguments, env=env)
            self.assertNotIn("steps/s", shown)

    def test_colours(self):
        _, shown = self.on_terminal("run", "no.toml")
        self.assertIn("\x1b[1;31merror:\x1b[0m", shown)
        _, shown = self.on_terminal("run", "no.toml", env={"NO_COLOR": "1"})
        self.assertIn("error: ", shown)
        self.assertNotIn("\x1b", shown)
        _, shown = self.on_terminal("run", self.scene, "--no-render", env={"NO_COLOR": "1"})
        self.assertNotIn("\x1b[1m", shown)
        bad = self.write("bad.toml", Scenes.BAD)
        _, shown = self.on_terminal("validate", bad)
        self.assertEqual(shown.count("\x1b[1;31merror:\x1b[0m"), 3)
        self.assertNotIn("\x1b", self.call("validate", bad, status=2).stderr)

    def test_a_reader_that_goes_away_is_no_error(self):
        script = f'set -o pipefail; "{NEPHOS}" hash "{self.scene}" --steps 20000 | head -n 1'
        result = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=60, env=self.environment)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertRegex(result.stdout, r"^0 [0-9a-f]{32}\n$")

    def test_a_full_stdout_is_an_error(self):
        with open("/dev/full", "w") as full:
            for arguments in (["hash", self.scene], ["--help"], ["completion", "bash"]):
                result = subprocess.run([NEPHOS, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
                self.assertEqual(result.returncode, 3)
                self.assertIn("standard output", result.stderr)


class Signals(Case):
    def setUp(self):
        super().setUp()
        self.long = self.write("long.toml", LONG)

    def start(self, *arguments):
        return subprocess.Popen([NEPHOS, *map(str, arguments)], cwd=self.folder, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True, env=self.environment)

    def wait_for(self, path):
        end = time.monotonic() + 60
        while not (self.folder / path).exists():
            self.assertLess(time.monotonic(), end, f"{path} never appeared")
            time.sleep(0.002)

    def interrupt(self, number, *arguments):
        """Starts a run, sends a signal when the first frame is there, and returns what it said."""
        process = self.start("run", *arguments)
        self.wait_for("stopped/density/long_0002.vdb")
        process.send_signal(number)
        output, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 128 + number, errors)
        self.assertTrue((self.folder / "stopped/checkpoint.nephos").exists())
        return output, errors

    def test_the_first_signal_leaves_a_checkpoint(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            shutil.rmtree(self.folder / "stopped", ignore_errors=True)
            output, errors = self.interrupt(number, self.long, "--no-render", "--out", "stopped")
            self.assertEqual(output, "")
            self.assertIn("--resume", errors)
            info = json.loads(self.call("info", "--json", "stopped/checkpoint.nephos").stdout)
            self.assertGreater(info["steps"], 0)
            self.assertLess(info["steps"], 10000)
            rows = rows_of(self.folder / "stopped/statistics.csv")
            self.assertEqual([int(row["step"]) for row in rows], list(range(len(rows))))

    def test_a_resumed_run_is_the_uninterrupted_one(self):
        changes = ["--set", "time.steps=400", "--no-render"]
        whole = self.start("run", self.long, *changes, "--out", "whole", "--threads", "1")
        _, errors = whole.communicate(timeout=120)
        self.assertEqual(whole.returncode, 0, errors)
        self.interrupt(signal.SIGINT, self.long, *changes, "--out", "stopped")
        # Without --resume it is not thrown away.
        self.refused(2, "run", self.long, *changes, "--out", "stopped", says="--resume")
        # Stopped once more, while it is resumed.
        done = len(list((self.folder / "stopped/density").iterdir()))
        again = self.start("run", self.long, *changes, "--out", "stopped", "--resume")
        self.wait_for(f"stopped/density/long_{done + 2:04}.vdb")
        again.send_signal(signal.SIGTERM)
        again.communicate(timeout=60)
        self.assertIn(again.returncode, (0, 128 + signal.SIGTERM))
        self.call("run", self.long, *changes, "--out", "stopped", "--resume")
        manifest = self.same_runs("whole", "stopped")
        self.assertEqual(len(manifest["frames"]), 41)
        # What is complete stays so.
        self.call("run", self.long, *changes, "--out", "stopped", "--resume")
        self.same_runs("whole", "stopped")

    def test_another_scene_cannot_be_resumed(self):
        self.interrupt(signal.SIGINT, self.long, "--no-render", "--out", "stopped")
        for change in (["--seed", "77"], ["--set", "time.steps=9000"], ["--set", "density.half=true"]):
            self.refused(2, "run", self.long, "--no-render", "--out", "stopped", "--resume", *change,
                         says="another scene")
        self.refused(2, "run", self.long, "--no-render", "--out", "stopped", "--resume", "--frames", "1..3",
                     says="--frames")

    def test_the_second_signal_stops_at_once(self):
        # A scene whose single step takes seconds: the second signal must not wait for it.
        slow = self.write("slow.toml", SCENE.replace("[32, 24, 12]", "[1024, 1024, 256]")
                          .replace("hum = 0.15", "hum = 0.45").replace("ext = 0.05", "ext = 0.45"))
        process = self.start("run", slow, "--no-render", "--out", "slow", "--threads", "1")
        self.wait_for("slow/manifest.json")
        process.send_signal(signal.SIGINT)
        time.sleep(0.4)
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)
        self.assertLess(time.monotonic() - begin, 1.0)

    def test_a_signal_that_comes_twice_is_one(self):
        # As from the terminal and from a program between, like timeout.
        process = self.start("run", self.long, "--no-render", "--out", "stopped")
        self.wait_for("stopped/density/long_0002.vdb")
        for _ in range(3):
            process.send_signal(signal.SIGINT)
            time.sleep(0.02)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)
        self.assertTrue((self.folder / "stopped/checkpoint.nephos").exists())

    def test_two_runs_do_not_share_a_folder(self):
        process = self.start("run", self.long, "--no-render", "--out", "stopped")
        self.wait_for("stopped/density/long_0002.vdb")
        for more in ([], ["--overwrite"]):
            self.refused(3, "run", self.long, "--no-render", "--out", "stopped", *more, says="another run")
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=60)
        # The lock ends with its owner, however that ends; so do the files that it was writing.
        (self.folder / "stopped/density/.long_0003.part1-2.vdb").write_text("half")
        self.call("run", self.long, "--no-render", "--out", "stopped", "--overwrite", "--set", "time.steps=20")
        self.assertFalse([p for p in (self.folder / "stopped").rglob(".*")])

    def test_a_signal_with_json(self):
        output, errors = self.interrupt(signal.SIGTERM, self.long, "--no-render", "--out", "stopped", "--json")
        report = json.loads(output)
        self.assertFalse(report["complete"])
        self.assertIn("--resume", errors)
        rows = rows_of(self.folder / "stopped/statistics.csv")
        self.assertEqual((len(rows) - 1, rows[-1]["hash"]), (report["steps"], report["state_hash"]))
        self.assertEqual(len(report["files"]["density"]), report["frames"])
        # The frames of the manifest are those of the folder.
        manifest = json.loads((self.folder / "stopped/manifest.json").read_text())
        self.assertFalse(manifest["complete"])
        self.assertEqual([f["number"] for f in manifest["frames"]], list(range(1, report["frames"] + 1)))

    def test_commands_without_a_checkpoint_stop_at_once(self):
        process = self.start("hash", self.long, "--steps", "1000000000", "--json")
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10)
        self.assertEqual(process.returncode, 130)


class Vulkan(Case):
    """Without a device, whatever this machine has."""

    NONE = {"VK_ICD_FILENAMES": "/nonexistent", "VK_DRIVER_FILES": "/nonexistent"}

    def without_loader(self):
        """An environment in which no libvulkan.so.1 can be opened."""
        if "NO_LOADER" not in os.environ:
            self.skipTest("NO_LOADER does not say where the library lies that hides the loader")
        sanitizer = os.environ.get("LD_PRELOAD", "")
        return {"LD_PRELOAD": f"{sanitizer} {os.environ['NO_LOADER']}".strip()}

    def test_the_processor_draws_without_a_driver_and_without_a_loader(self):
        self.call("run", self.scene, "--splatting", "cpu", "--out", "whole")
        for name, env in (("driver", self.NONE), ("loader", self.without_loader())):
            for splatting in ("auto", "cpu"):
                out = f"{name}_{splatting}"
                result = self.call("run", self.scene, "--splatting", splatting, "--out", out, "--json", env=env)
                self.assertEqual(result.stderr, "")
                report = json.loads(result.stdout)
                self.assertEqual(report["backend"], "cpu")
                self.assertTrue(report["device"].startswith("cpu ("), report["device"])
                self.assertEqual(len(report["files"]["png"]), 5)
                for picture in report["files"]["png"]:
                    self.assertEqual((self.folder / picture).read_bytes(),
                                     (self.folder / "whole/frames" / pathlib.Path(picture).name).read_bytes())
                timing = json.loads((self.folder / out / "manifest.json").read_text())["timing"]
                self.assertEqual((timing["backend"], timing["device"]), ("cpu", report["device"]))
            self.call("render", "whole/density/tiny_0005.vdb", "--out", f"{name}.png", env=env)

    def test_a_device_that_is_asked_for_and_missing_is_status_4_and_says_what_to_install(self):
        self.call("run", self.scene, "--no-render", "--out", "out", env=self.NONE)
        render = ["render", "out/density/tiny_0005.vdb", "--out", "x.png", "--quiet"]
        for env in (self.NONE, self.without_loader()):
            for wish in (["--splatting", "vulkan"], ["--splatting", "blended"], ["--device", "llvmpipe"]):
                for arguments in (["run", self.scene, "--out", "other", *wish], [*render, *wish]):
                    result = self.refused(4, *arguments, says="mesa-vulkan-drivers", env=env)
                    self.assertNotIn("unexpected", result.stderr)
            self.refused(4, "run", self.scene, "--out", "other", "--set", 'frames.splatting="blended"',
                         says="mesa-vulkan-drivers", env=env)
            self.refused(4, *render, says="mesa-vulkan-drivers", env={**env, "NEPHOS_DEVICE": "llvmpipe"})
        self.assertFalse((self.folder / "other").exists(), "nothing was done")
        self.assertFalse((self.folder / "x.png").exists())

    def test_back_ends_that_contradict_each_other(self):
        self.refused(2, "run", self.scene, "--splatting", "gpu", says="one of auto, cpu, vulkan and blended")
        self.refused(2, "run", self.scene, "--splatting", "cpu", "--device", "llvmpipe",
                     says='uses no Vulkan device, but "llvmpipe" is asked for')
        result = self.call("validate", self.scene, "--set", 'frames.splatting="cpu"', "--set", 'frames.device="x"', status=2)
        self.assertIn("uses no Vulkan device", result.stderr)

    def test_a_missing_ffmpeg_is_found_before_anything_is_computed(self):
        video = self.write("video.toml", SCENE.replace("[frames]", "[frames]\nvideo = true"))
        for arguments in ([self.scene, "--video"], [video], [self.scene, "--set", "frames.video=true"]):
            # Not even a device is looked for.
            self.refused(3, "run", *arguments, "--out", "out", says="install the package ffmpeg",
                         env={**self.NONE, "PATH": str(self.folder)})
            self.assertFalse((self.folder / "out").exists(), "nothing was done")
        self.call("run", video, "--no-render", "--out", "out", env={**self.NONE, "PATH": str(self.folder)})

    def test_a_scene_without_pictures_needs_no_device(self):
        self.call("run", self.scene, "--set", "frames.png=false", env=self.NONE)


class LostDevice(Case):
    """A graphics card that is lost while it draws (lost_device_layer.cpp): exit status 4, and finished frames stay."""

    def setUp(self):
        super().setUp()
        if "LAYERS" not in os.environ:
            self.skipTest("LAYERS does not say where the layer lies")

    def lost_after(self, submissions=10**9, waits=10**9):
        return {"VK_LAYER_PATH": os.environ["LAYERS"], "VK_INSTANCE_LAYERS": "VK_LAYER_NEPHOS_lost_device",
                "NEPHOS_LOSE_DEVICE_AFTER": str(submissions), "NEPHOS_LOSE_WAIT_AFTER": str(waits)}

    def test_a_run_keeps_its_finished_frames_and_goes_on_with_another(self):
        never = self.lost_after()
        self.call("run", self.scene, "--out", "whole", env=never)
        numbers = set()
        for what, count in [("submissions", n) for n in (0, 1, 3, 6, 10, 14)] + [("waits", n) for n in (0, 3, 6, 10)]:
            with self.subTest(what, count=count):
                out = self.folder / f"{what}{count}"
                result = self.refused(4, "run", self.scene, "--out", out, says="ErrorDeviceLost",
                                      env=self.lost_after(**{what: count}))
                self.assertNotIn("unexpected", result.stderr)
                self.assertEqual([p for p in self.folder.rglob("*") if ".part" in p.name], [])
                frames = json.loads((out / "manifest.json").read_text())["frames"]
                numbers.add(len(frames))
                self.assertEqual([frame["number"] for frame in frames], list(range(1, len(frames) + 1)))
                for picture in (out / "frames").glob("*.png"):
                    self.assertEqual(picture.read_bytes(), (self.folder / "whole/frames" / picture.name).read_bytes())
                self.assertEqual(len(list((out / "frames").glob("*.png"))), len(frames))
                self.call("run", self.scene, "--out", out, env=never)
                self.same_runs("whole", out.name)
        self.assertGreater(len(numbers), 2, "it is lost at several frames")

    def test_render_writes_nothing(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        for submissions in (0, 2):
            self.refused(4, "render", "out/density/tiny_0005.vdb", "--out", "x.png", "--scene", self.scene, says="ErrorDeviceLost",
                         env=self.lost_after(submissions))
            self.assertFalse((self.folder / "x.png").exists())


class Pictures(Case):
    """With a device (lavapipe at least)."""

    def test_run_draws_every_frame(self):
        result = json.loads(self.call("run", self.scene, "--out", "out", "--set", "frames.exr=true", "--json").stdout)
        self.assertEqual(len(result["files"]["png"]), 5)
        self.assertEqual(len(result["files"]["exr"]), 5)
        info = json.loads(self.call("info", "--json", result["files"]["exr"][4]).stdout)
        self.assertEqual(info["kind"], "exr")
        self.assertEqual((info["parts"][0]["width"], info["parts"][0]["height"]), (64, 48))
        self.assertTrue(all(part["complete"] for part in info["parts"]))
        film = info["parts"][0]["attributes"]
        self.assertEqual((film["framesPerSecond"], film["timeScale"]), ("1000/1000", "15"))
        png = (self.folder / result["files"]["png"][4]).read_bytes()
        self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(struct.unpack(">II", png[16:24]), (64, 48))
        self.assertNotEqual(png, (self.folder / result["files"]["png"][0]).read_bytes())

    def test_every_back_end_can_be_asked_for_and_says_its_name(self):
        pixels = {}
        for splatting in ("cpu", "vulkan", "blended"):
            out = self.folder / splatting
            options = ["--splatting", splatting] if splatting != "vulkan" else ["--set", 'frames.splatting="vulkan"']
            result = self.call("run", self.scene, *options, "--out", out, "--set", "frames.exr=true", "--json")
            report = json.loads(result.stdout)
            self.assertEqual(report["backend"], splatting)
            timing = json.loads((out / "manifest.json").read_text())["timing"]
            self.assertEqual((timing["backend"], timing["device"]), (splatting, report["device"]))
            exr = json.loads(self.call("info", "--json", report["files"]["exr"][4]).stdout)["parts"][0]["attributes"]
            self.assertEqual(exr["backend"], splatting)
            self.assertEqual(exr.get("device"), None if splatting == "cpu" else report["device"])
            render = json.loads(self.call("render", out / "density/tiny_0005.vdb", "--out", out / "x.png", "--json",
                                          *options[:2 if splatting != "vulkan" else 0]).stdout)
            if splatting != "vulkan":
                self.assertEqual((render["backend"], render["device"]), (splatting, report["device"]))
            pixels[splatting] = png_pixels(out / "frames/tiny_0005.png")
        for splatting in ("vulkan", "blended"):
            self.assertLessEqual(max(abs(a - b) for a, b in zip(pixels["cpu"], pixels[splatting])), 1)

    def test_interrupted_pictures_are_the_same(self):
        changes = ["--set", "time.steps=40", "--set", "frames.time_scale=20", "--set", "frames.exr=true"]
        self.call("run", self.scene, *changes, "--out", "whole")
        process = subprocess.Popen([NEPHOS, "run", self.scene, *changes, "--out", "stopped"], cwd=self.folder,
                                   env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        end = time.monotonic() + 60
        while not (self.folder / "stopped/frames/tiny_0003.png").exists():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=60), 130)
        self.call("run", self.scene, *changes, "--out", "stopped", "--resume")
        self.same_runs("whole", "stopped")
        for name in sorted(p.name for p in (self.folder / "whole/frames").iterdir()):
            self.assertEqual((self.folder / "whole/frames" / name).read_bytes(),
                             (self.folder / "stopped/frames" / name).read_bytes(), name)

    def test_render_draws_what_run_wrote(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        volume = "out/density/tiny_0005.vdb"
        self.call("render", volume, "--out", "a.png", "--out", "a.exr", "--size", "80x60")
        info = json.loads(self.call("info", "--json", "a.exr").stdout)
        self.assertEqual(info["parts"][0]["width"], 80)
        result = json.loads(self.call("render", volume, "--out", "b.png", "--scene", self.scene, "--json").stdout)
        self.assertEqual((result["width"], result["height"]), (64, 48))
        self.assertEqual(result["extinction_per_m"], 0.02)
        below = json.loads(self.call("render", volume, "--out", "c.png", "--view", "below", "--size", "32x32",
                                     "--camera", "-10,-200,5", "--json").stdout)
        self.assertEqual(below["camera_m"], [-10, -200, 5])
        views = [self.call("render", volume, "--out", "d.png", "--scene", self.scene, *words, "--json").stdout
                 for words in ([], ["--view", "side"], ["--view", "above"])]
        self.assertEqual(len({str(json.loads(view)["camera_m"]) for view in views}), 3)

    def test_pictures_of_run_and_render_agree(self):
        self.call("run", self.scene, "--out", "out")
        self.call("render", "out/density/tiny_0005.vdb", "--scene", self.scene, "--out", "again.png")
        a, b = [png_pixels(self.folder / p) for p in ("out/frames/tiny_0005.png", "again.png")]
        self.assertEqual(a, b)

    def test_fog_has_drifted_as_far_in_render_as_in_run(self):
        """Fog is a function of time, which stands in the file."""
        drifting = ["fog.extinction_per_m=0.01", "fog.height_m=100", "fog.patchiness=1", "fog.patch_m=200",
                    "fog.velocity_m_per_s=[40,9,0]", "shells.spacing_m=40", "time.step_s=10", "frames.time_scale=10"]
        changes = [word for change in drifting for word in ("--set", change)]
        self.call("run", self.scene, *changes, "--out", "out")
        pictures = []
        for number in (1, 6):
            file = f"tiny_{number:04}"
            self.call("render", f"out/density/{file}.vdb", "--scene", self.scene, *changes, "--out", f"{file}.png")
            pictures.append(png_pixels(self.folder / f"{file}.png"))
            self.assertEqual(pictures[-1], png_pixels(self.folder / f"out/frames/{file}.png"), file)
        still = [word for change in drifting if "velocity" not in change for word in ("--set", change)]
        self.call("render", "out/density/tiny_0006.vdb", "--scene", self.scene, *still, "--set", "fog.velocity_m_per_s=[0,0,0]",
                  "--out", "still.png")
        differences = [abs(x - y) for x, y in zip(pictures[1], png_pixels(self.folder / "still.png"))]
        self.assertGreater(max(differences), 10, "the fog drifts")

    def test_refined_grids_are_drawn_with_metaballs_of_the_same_size(self):
        """The radius is in cells: a refined file looks as the run's own picture, which is of the cells."""
        changes = ["--set", "density.refine=2", "--set", "density.metaball_radius_cells=2.5", "--set", "lattice.cells=[48,32,24]"]
        self.call("run", self.scene, *changes, "--out", "out")
        result = self.call("render", "out/density/tiny_0005.vdb", "--scene", self.scene, *changes, "--out", "again.png",
                           "--json")
        self.assertEqual(json.loads(result.stdout)["metaball_radius_voxels"], 5)
        a, b = [png_pixels(self.folder / p) for p in ("out/frames/tiny_0005.png", "again.png")]
        differences = sorted(abs(x - y) for x, y in zip(a, b))
        self.assertLess(sum(differences) / len(differences), 3)

    def test_foreign_volumes_are_drawn(self):
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.name = "smoke"
        grid.transform = pyopenvdb.createLinearTransform(0.05)
        grid.fill((-10, -10, -10), (10, 10, 10), 0.7)
        pyopenvdb.write(str(self.folder / "foreign.vdb"), [grid])
        for up in ("y", "z"):
            result = self.call("render", "foreign.vdb", "--up", up, "--out", f"{up}.png", "--size", "64x64")
            self.assertIn("extinction", result.stderr)
            pixels = png_pixels(self.folder / f"{up}.png")
            self.assertGreater(len(set(pixels)), 20, "something is in the picture")
        middle = 3 * (64 * 32 + 32)
        self.assertNotEqual(pixels[middle:middle + 3], pixels[:3])

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_video(self):
        self.call("run", self.scene, "--out", "out", "--video")
        self.assertGreater((self.folder / "out/frames/tiny.mp4").stat().st_size, 500)


def png_pixels(path):
    """Decoded RGB bytes of an 8-bit PNG without interlacing."""
    import zlib
    data = pathlib.Path(path).read_bytes()
    at, idat, header = 8, b"", None
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", data[at + 8:at + 21])
        if kind == b"IDAT":
            idat += data[at + 8:at + 8 + length]
        at += 12 + length
    width, height, depth, colour, _, _, interlace = header
    assert (depth, colour, interlace) == (8, 2, 0), header
    raw, stride, rows = zlib.decompress(idat), 3 * width, [bytes(3 * width)]
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        above = rows[-1]
        for x in range(stride):
            left, up, corner = (line[x - 3] if x >= 3 else 0), above[x], (above[x - 3] if x >= 3 else 0)
            if kind == 1:
                predicted = left
            elif kind == 2:
                predicted = up
            elif kind == 3:
                predicted = (left + up) // 2
            elif kind == 4:
                p = left + up - corner
                predicted = min((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner))[2]
            else:
                predicted = 0
            line[x] = (line[x] + predicted) & 255
        rows.append(bytes(line))
    return b"".join(rows[1:])


class Completion(Case):
    def completed(self, *words):
        """What bash offers for the last word."""
        script = f"""
            source <("{NEPHOS}" completion bash) || exit 9
            COMP_WORDS=(nephos {' '.join(f"'{w}'" for w in words)}); COMP_CWORD={len(words)}
            _nephos
            printf '%s\\n' "${{COMPREPLY[@]}}"
        """
        result = subprocess.run(["bash", "--norc", "-u", "-c", script], cwd=self.folder, capture_output=True, text=True,
                                timeout=60)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return [line for line in result.stdout.split("\n") if line]

    def test_bash(self):
        self.assertIn("run", self.completed("r"))
        self.assertIn("render", self.completed("r"))
        self.assertEqual(self.completed("val"), ["validate"])
        self.assertIn("--resume", self.completed("run", "--re"))
        self.assertEqual(self.completed("run", "ti"), ["tiny.toml"])
        self.assertEqual(self.completed("completion", "z"), ["zsh"])
        self.assertEqual(self.completed("run", "--json", "--no-r"), ["--no-render"])  # after a flag
        self.assertEqual(self.completed("run", "--seed", ""), [])  # a value that nobody can guess
        (self.folder / "a folder").mkdir()
        self.assertEqual(self.completed("run", "tiny.toml", "--out", "a"), ["a folder"])

    def test_other_shells_accept_theirs(self):
        for shell, arguments in (("zsh", ["-n"]), ("fish", ["--no-execute"])):
            script = self.call("completion", shell).stdout
            self.assertIn("nephos", script)
            if shutil.which(shell):
                path = self.write(shell, script)
                subprocess.run([shell, *arguments, path], check=True, timeout=60)


class SetUp(Case):
    """apps/setup.sh with stand-ins for the system's commands: what it would install, and how."""

    def stand_in(self, name, body):
        path = pathlib.Path(self.write(f"bin/{name}", f"#!/bin/bash\n{body}\n"))
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    def install(self, groups, *, missing, root_user=True, sudo=True):
        installed = [line.split()[1] for line in (SOURCE / "packages.txt").read_text().splitlines()
                     if line and not line.startswith("#")]
        installed = [name for name in installed if name not in missing]
        # As the real one: a package that it does not know makes the status 1.
        self.stand_in("dpkg-query", f"printf 'installed %s\\n' {' '.join(installed)}\nexit {int(bool(missing))}")
        self.stand_in("apt-get", f'printf "%s\\n" "$DEBIAN_FRONTEND $*" >> "{self.folder}/apt.log"')
        self.stand_in("id", f"echo {0 if root_user else 1000}")
        self.stand_in("sudo", 'test "$1" = -n && shift && exec "$@"' if sudo else "exit 1")
        script = f'set -euo pipefail; root="{SOURCE}"; . "{SOURCE}/apps/setup.sh"; install_packages {groups}'
        result = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=60,
                                env={**self.environment, "PATH": f"{self.folder}/bin:{os.environ['PATH']}"})
        log = self.folder / "apt.log"
        calls = log.read_text().splitlines() if log.exists() else []
        return result, calls

    def test_missing_packages_are_listed_and_installed_once(self):
        result, calls = self.install("build run", missing=["cmake", "mesa-vulkan-drivers", "openexr"])
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("  cmake\n  mesa-vulkan-drivers\n", result.stderr)
        self.assertEqual(len(calls), 2)
        self.assertTrue(calls[0].endswith("update"))
        self.assertTrue(calls[1].endswith("install --no-install-recommends cmake mesa-vulkan-drivers"), calls[1])
        self.assertTrue(all(call.startswith("noninteractive ") for call in calls))
        self.assertEqual(result.stdout, "")

    def test_what_a_run_needs(self):
        video = self.write("video.toml", SCENE.replace("[frames]", "[frames]\nvideo = true"))
        for arguments, needs in (([self.scene], ""), ([video], "ffmpeg\n"), ([video, "--no-render"], ""),
                                 ([self.scene, "--splatting", "vulkan"], "vulkan\n"),
                                 ([self.scene, "--video", "--splatting", "blended"], "vulkan\nffmpeg\n"),
                                 ([self.scene, "--set", 'frames.splatting="vulkan"'], "vulkan\n"),
                                 ([self.scene, "--set", "frames.video=true"], "ffmpeg\n"),
                                 ([self.scene, "--set", "frames.png=false"], "")):
            self.assertEqual(self.call("run", *arguments, "--needs").stdout, needs)
        self.assertFalse((self.folder / "out").exists(), "nothing was done")

    def test_run_installs_ffmpeg_for_whoever_asks_for_a_video(self):
        # A tree that is built already, whose command tells what it was called with.
        for name in ("run", "apps/setup.sh", "packages.txt"):
            (self.folder / name).parent.mkdir(exist_ok=True)
            shutil.copy(SOURCE / name, self.folder / name)
        video = self.write("a scene.toml", SCENE.replace("[frames]", "[frames]\nvideo = true"))
        self.write("CMakePresets.json", "")
        self.write("build/release/CMakeCache.txt", f"CMAKE_HOME_DIRECTORY:INTERNAL={self.folder}\n")
        self.write("build/release/build.ninja", "")
        nephos = pathlib.Path(self.write("build/release/bin/nephos", f"""#!/bin/bash
            case "$*" in *--needs*) exec '{NEPHOS}' "$@" ;; esac
            printf '<%s>' "$@"
        """))
        nephos.chmod(0o755)
        self.stand_in("ninja", "echo 'ninja: no work to do.'")
        self.stand_in("dpkg-query", "sed -n 's/^[a-z]\\+ \\+\\([^ ]*\\).*/installed \\1/p' packages.txt | grep -v ffmpeg; exit 1")
        self.stand_in("apt-get", f'echo "$*" >> "{self.folder}/apt.log"')
        self.stand_in("id", "echo 0")
        for arguments, installs in (([self.scene], False), ([self.scene, "--video"], True), ([video], True),
                                    ([video, "--no-render"], False), ([self.scene, "--set", "frames.video=true"], True),
                                    (["no.toml"], False)):
            log = self.folder / "apt.log"
            log.unlink(missing_ok=True)
            result = subprocess.run(["./run", *arguments], cwd=self.folder, capture_output=True, text=True, timeout=60,
                                    env={**self.environment, "PATH": f"{self.folder}/bin:{os.environ['PATH']}"})
            self.assertEqual(result.stdout, "".join(f"<{a}>" for a in ["run", *arguments]), result.stderr)
            self.assertEqual("install --no-install-recommends ffmpeg" in (log.read_text() if log.exists() else ""),
                             installs, arguments)

    def test_nothing_to_do_says_nothing(self):
        result, calls = self.install("build run test bench", missing=[])
        self.assertEqual((result.returncode, result.stderr, result.stdout, calls), (0, "", "", []))

    def test_sudo_without_a_password_or_a_command_to_copy(self):
        result, calls = self.install("build", missing=["cmake"], root_user=False)
        self.assertEqual((result.returncode, len(calls)), (0, 2), result.stderr)
        (self.folder / "apt.log").unlink()
        result, calls = self.install("build", missing=["cmake"], root_user=False, sudo=False)
        self.assertEqual((result.returncode, calls), (3, []))
        self.assertIn("sudo apt-get install --no-install-recommends cmake", result.stderr.replace("update && ", ""))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
