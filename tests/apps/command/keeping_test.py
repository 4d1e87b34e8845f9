# SPDX-License-Identifier: Apache-2.0
"""Files that are there already, and that a call must not lose: of somebody, of another run, or what it reads itself."""

import fcntl
import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import time
import unittest
import zlib

from case import NEPHOS, PATIENCE, SANITIZED, SCENE, Case, unsealed

LAYERED = """\
name = "l"
[time]
steps = 4
[frames]
enabled = false
[[layer]]
name = "low"
lattice = { cells = [16, 16, 4], cell_size_m = 500 }
veil = { form = "cirrostratus", octaves = 1, wavelength_m = 4000, base_m = 500, top_m = 1500 }
"""


def height_map(height):
    """A PNG file of 16 x 16 heights."""
    rows = b"".join(b"\0" + struct.pack(">16H", *(x * height for x in range(16))) for _ in range(16))
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 16, 16, 16, 0, 0, 0, 0)) + \
        chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Keeping(Case):
    def setUp(self):
        super().setUp()
        self.plain = ("run", self.scene, "--no-render", "-q")

    def files(self, folder):
        return {path: path.read_bytes() for path in (self.folder / folder).rglob("*") if path.is_file()}

    def kept(self, folder, status, *arguments, says, **options):
        before = self.files(folder)
        self.refused(status, *arguments, says=says, **options)
        self.assertEqual(self.files(folder), before)

    def test_a_foreign_table_of_a_layer(self):
        scene = self.write("layered.toml", LAYERED)
        for content in ("mine\n", "step,my\n"):
            table = self.folder / "out/statistics/low.csv"
            table.parent.mkdir(parents=True, exist_ok=True)
            table.write_text(content)
            for more in ([], ["--resume"]):
                self.kept("out", 2, "run", scene, "--out", "out", *more, says="holds a statistics/low.csv that is not of a run")
        table.write_text("")  # of a run that was killed, or of nobody
        self.call("run", scene, "--out", "out")
        self.call("verify", "out")
        table.write_text("mine\n")
        (self.folder / "out/checkpoint.nephos").unlink()
        self.kept("out", 2, "run", scene, "--out", "out", "--resume", says="statistics/low.csv")

    @unittest.skipIf(SANITIZED, "memory of the sanitizer is mapped first, and does not fail")
    def test_a_lack_of_means_says_nothing_of_a_manifest(self):
        """It takes a part of nephos to read the scene of veils in it."""
        self.call("run", self.write("layered.toml", LAYERED), "--out", "out")
        failing = {"LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": "mmap ENOMEM 1 1", "FAIL_PROGRAM": "nephos"}
        self.kept("out", 3, "metar", "METAR LOWW 241250Z 30012KT 9999 FEW040 12/05 Q1020", "-o", "out/statistics.csv", "--overwrite", "-j", "1", env=failing,
                  says="a part of nephos cannot be loaded")

    def test_resuming_without_a_checkpoint_keeps_what_starting_keeps(self):
        self.call(*self.plain, "--out", "out")
        (self.folder / "out/checkpoint.nephos").unlink()
        shutil.copytree(self.folder / "out", self.folder / "table")
        (self.folder / "table/statistics.csv").write_text("mine\n")
        for more in ([], ["--resume"]):
            self.kept("table", 2, *self.plain, "--out", "table", *more, says="a statistics.csv that is not of a run")
        self.call("run", self.scene, "--splatting", "cpu", "-q", "--out", "drawn")
        (self.folder / "drawn/checkpoint.nephos").unlink()
        for more in ([], ["--resume"]):
            self.kept("drawn", 2, *self.plain, "--out", "drawn", *more, says="not all of which would be made again")
        (self.folder / "h.png").write_bytes(height_map(10))
        high = ("run", self.write("high.toml", 'ground = { height_map = "h.png" }\n' + SCENE),
                "--splatting", "cpu", "-q", "--out", "high")
        self.call(*high)
        (self.folder / "high/checkpoint.nephos").unlink()
        (self.folder / "h.png").write_bytes(height_map(20))
        for more in ([], ["--resume"]):
            self.kept("high", 2, *high, *more, says="another content of h.png of `ground.height_map`")
        # Of statistics alone, whose run is complete: nothing to do, but for a table that is not its own.
        for name, seed in (("five", 5), ("six", 6)):
            self.call("run", self.scene, "--statistics-only", "--seed", seed, "-q", "--out", name)
        self.call("run", self.scene, "--statistics-only", "--seed", 5, "-q", "--out", "five", "--resume")
        shutil.copy(self.folder / "six/statistics.csv", self.folder / "five")
        self.kept("five", 3, "run", self.scene, "--statistics-only", "--seed", 5, "-q", "--out", "five", "--resume",
                  says="or is of another run")
        # What loses nothing goes on, also with more steps.
        self.call(*self.plain, "--out", "out", "--resume", "--set", "time.steps=9")
        self.call(*self.plain, "--out", "whole", "--set", "time.steps=9")
        self.same_runs("whole", "out")

    @unittest.skipUnless(shutil.which("strace"), "strace is not installed")
    def test_a_run_that_ends_while_another_begins(self):
        """What --resume finds before it has the folder may be another run's work by then."""
        self.call(*self.plain, "--out", "out")
        (self.folder / "out/checkpoint.nephos").unlink()
        late = subprocess.Popen(["strace", "-f", "-qq", "-e", "trace=flock", "-e", "inject=flock:delay_enter=10000000:when=1", "-o",
                                 "/dev/null", NEPHOS, *map(str, self.plain), "--resume", "--out", "out"], cwd=self.folder,
                                env=self.environment, stderr=subprocess.PIPE, text=True)
        time.sleep(2)
        self.call(*self.plain, "--seed", "99", "--overwrite", "--out", "out")
        _, said = late.communicate(timeout=PATIENCE)
        self.assertEqual(late.returncode, 2, said)
        self.assertEqual(json.loads((self.folder / "out/manifest.json").read_text())["scene"]["seed"], "99")
        self.call("verify", "out")

    def test_a_branch_that_cannot_begin(self):
        """An earlier one stays; and one that fails on the way can be made again by the same call."""
        later = ("--set", "time.steps=12", "--no-render", "-q")
        self.call(*self.plain, "--out", "source")
        shutil.copytree(self.folder / "source", self.folder / "damaged")
        self.call("run", "--from", "damaged", *later, "--out", "branch")
        (self.folder / "damaged/statistics.csv").unlink()
        self.kept("branch", 3, "run", "--from", "damaged", self.scene, *later, "--out", "branch", says="damaged/statistics.csv: cannot open")
        self.call("run", "--from", "source", *later, "--out", "whole")
        for kilobytes in range(1, 12):
            shutil.rmtree(self.folder / "small", ignore_errors=True)
            full = subprocess.run(["bash", "-c", f'ulimit -f {kilobytes}; exec "$0" "$@"', NEPHOS, "run", "--from", "source", *later,
                                   "--out", "small"], cwd=self.folder, env=self.environment, capture_output=True, text=True)
            self.assertIn(full.returncode, (0, 3), full.stderr)
            self.call("run", "--from", "source", *later, "--out", "small", *(["--resume"] if (
                self.folder / "small/checkpoint.nephos").exists() else []))
            self.same_runs("whole", "small")

    def test_tables_of_another_run(self):
        """Brought beside a checkpoint they are not taken for its own: neither when it goes on, nor by a branch."""
        for name, seed in (("a", 3), ("b", 4)):
            self.call(*self.plain, "--seed", seed, "--out", name)
        later = ("--set", "time.steps=9", "--no-render", "-q")
        shutil.copytree(self.folder / "a", self.folder / "mixed")
        shutil.copy(self.folder / "b/statistics.csv", self.folder / "mixed")
        self.kept("mixed", 3, "run", self.scene, "--seed", 3, *later, "--out", "mixed", "--resume",
                  says="mixed/statistics.csv: does not begin with the")
        self.kept("mixed", 3, "run", "--from", "mixed", *later, "--out", "no", says="or is of another run")
        # Also one that is shorter, and one without a digit.
        whole = (self.folder / "a/statistics.csv").read_bytes()
        for table in (whole[:-3], whole[:-3] + b"\n", whole.replace(b",", b"", 1), whole[:whole.rindex(b"\n", 0, -1) + 1]):
            (self.folder / "mixed/statistics.csv").write_bytes(table)
            self.kept("mixed", 3, "run", self.scene, "--seed", 3, *later, "--out", "mixed", "--resume", says="does not begin with the")
            self.kept("mixed", 3, "run", "--from", "mixed", *later, "--out", "no", says="does not begin with the")
        shutil.copy(self.folder / "a/checkpoint.nephos", self.folder / "b/early.nephos")
        self.kept("b", 3, "run", self.scene, "--seed", 3, "--from", "b/early.nephos", *later, "--out", "no",
                  says="b/early.nephos: is not of the run in the folder that it lies in")

    def test_tables_that_were_edited(self):
        """One digit of a row before the checkpoint, in the table of all and in that of a layer."""
        layered = ("run", self.write("layered.toml", LAYERED), "-q")
        self.call(*self.plain, "--out", "out")
        self.call(*layered, "--out", "layers")
        for folder, name, command in (("out", "statistics.csv", self.plain), ("layers", "statistics/low.csv", layered)):
            more, table = ("--set", "time.steps=9"), self.folder / folder / name
            whole = table.read_bytes()
            at = whole.index(b"\n1,") + 3  # the time of step 1
            table.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1:])
            self.kept(folder, 3, *command, *more, "--out", folder, "--resume", says=f"{folder}/{name}: does not begin with the")
            self.kept(folder, 3, "run", "--from", folder, *more, "-q", "--out", "no", says=f"{folder}/{name}: does not begin with the")
            # Of a run that goes on, only what it had written is known.
            manifest = self.folder / folder / "manifest.json"
            complete = manifest.read_bytes()
            manifest.write_text(unsealed({**json.loads(complete), "complete": False}))
            self.assertIn("does not begin with the", self.call("verify", folder, status=1).stdout)
            manifest.write_bytes(complete)
            # What stands behind the rows of a complete run is none of it, and is not cut off.
            table.write_bytes(whole + b"# my note\n")
            for further in ((), more):
                self.kept(folder, 3, *command, *further, "--out", folder, "--resume", says=f"{folder}/{name}: 10 bytes were appended")
            table.write_bytes(whole)
            self.call(*command, *more, "--out", folder, "--resume")
            self.call("verify", folder)

    def test_a_note_behind_the_rows_where_a_file_cannot_be_examined(self):
        """Once, at any call: status 3, and it stays."""
        self.call(*self.plain, "--out", "out")
        table = self.folder / "out/statistics.csv"
        noted = table.read_bytes() + b"# my note\n"
        failing = {**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_PATH": "out/statistics.csv", "FAIL_PROGRAM": "nephos"}
        for call in range(1, 16):  # it is examined 7 times
            table.write_bytes(noted)
            done = subprocess.run([NEPHOS, *self.plain, "--out", "out", "--resume"], cwd=self.folder, env={**failing, "FAIL_CALL": f"stat EIO {call} 1"},
                                  capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, table.read_bytes()), (3, noted), f"{call}: {done.stderr}")

    def test_layers_behind_links(self):
        """The folder of a layer on another disk: what others have there is as safe as in the run's own, and no file too many."""
        frames = LAYERED.replace("enabled = false", "count = 2") + "[density]\nper_layer = true\n"
        scene = self.write("layered.toml", frames)
        for name in ("a", "b"):
            (self.folder / name / "density").mkdir(parents=True)
            (self.folder / name / "density/low").symlink_to("../../shared")
        (self.folder / "shared").mkdir()
        self.call("run", scene, "--no-render", "--out", "a")
        self.assertEqual(len(list((self.folder / "shared").iterdir())), 2)
        self.call("verify", "a")
        self.kept("shared", 2, "run", scene, "--seed", 9, "--no-render", "--out", "b", says="but no manifest.json")
        self.call("run", scene, "--no-render", "--out", "a", "--overwrite", "--set", "frames.count=1")
        self.assertEqual(len(list((self.folder / "shared").iterdir())), 1)
        self.call("verify", "a")

    def test_what_a_complete_run_has_not_written_is_kept(self):
        """Copies of frames that the user keeps, those of another run behind a link, and what is called like a frame: without
        --overwrite the run is not made again. Its own files are."""
        self.call(*self.plain, "--out", "other", "--seed", "8")
        def copies(out):
            (out / "density/old").mkdir()
            for frame in (out / "density").glob("*.vdb"):
                shutil.copy(frame, out / "density/old")
        def linked(out):
            (out / "density/other").symlink_to("../../other/density")
        def exchanged(out):
            shutil.rmtree(out / "density")
            (out / "density").symlink_to("../other/density")
        def named(out):
            (out / "density/tiny_0099.vdb").write_text("mine")
        def picture(out):
            (out / "frames").mkdir(exist_ok=True)
            (out / "frames/tiny_0001.png").write_text("mine")
        def video(out):
            (out / "frames").mkdir(exist_ok=True)
            (out / "frames/tiny.mp4").write_text("mine")
        def table(out):
            (out / "statistics").mkdir()
            (out / "statistics/mine.csv").write_text(layer_table)
        def other_table(out):
            shutil.copy(self.folder / "other/statistics.csv", out)
        def other_checkpoint(out):
            shutil.copy(self.folder / "other/checkpoint.nephos", out)
        def nowhere(out):
            (out / "density/tiny_0001.vdb").unlink()
            (out / "density/tiny_0001.vdb").symlink_to("nowhere")
        self.call("run", self.write("layered.toml", LAYERED), "--no-render", "--out", "layers")
        layer_table = (self.folder / "layers/statistics/low.csv").read_text()
        for number, (put, says) in enumerate(((table, "there is statistics/mine.csv, which the run in it has not written"),
                                              (other_table, "statistics.csv is not what the run in it has written"),
                                              (other_checkpoint, "checkpoint.nephos is not what the run in it"),
                                              (nowhere, "density/tiny_0001.vdb is not what the run in it"), (copies, "density/old/tiny_0001.vdb, which the run in it has not written"),
                                              (linked, "density/other/tiny_0001.vdb, which"), (exchanged, "density/tiny_0001.vdb is not what"),
                                              (named, "density/tiny_0099.vdb, which"), (picture, "frames/tiny_0001.png, which"),
                                              (video, "frames/tiny.mp4, which"))):
            out = f"run{number}"
            self.call(*self.plain, "--out", out)
            self.call(*self.plain, "--out", out)
            put(self.folder / out)
            other = self.files("other")
            self.kept(out, 2, *self.plain, "--out", out, says=says)
            self.assertEqual(self.files("other"), other)
        self.call("run", self.scene, "--statistics-only", "--out", "bits")
        (self.folder / "bits/density").mkdir()
        (self.folder / "bits/density/tiny_0001.vdb").write_text("mine")
        self.kept("bits", 2, "run", self.scene, "--statistics-only", "--out", "bits", says="density/tiny_0001.vdb, which")
        # One that was killed before its first checkpoint has no list of frames: their places tell them.
        self.call(*self.plain, "--out", "begun")
        manifest = self.folder / "begun/manifest.json"
        manifest.write_text(unsealed({**json.loads(manifest.read_text()), "complete": False}))
        (self.folder / "begun/checkpoint.nephos").unlink(missing_ok=True)
        copies(self.folder / "begun")
        self.kept("begun", 2, *self.plain, "--out", "begun", says="density/old/tiny_0001.vdb, which")
        shutil.rmtree(self.folder / "begun/density/old")
        for put, says in ((table, "there is statistics/mine.csv"), (picture, "there is frames/tiny_0001.png"),
                          (video, "there is frames/tiny.mp4")):
            put(self.folder / "begun")
            self.kept("begun", 2, *self.plain, "--out", "begun", says=says)
            for folder in ("statistics", "frames"):
                shutil.rmtree(self.folder / "begun" / folder, ignore_errors=True)
        self.call(*self.plain, "--out", "begun")
        self.call("verify", "begun")

    def test_tables_of_layers_behind_a_link(self):
        """Those of another run: neither a complete run that is made again takes their place, nor one that was killed."""
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "a")
        self.call("run", scene, "--no-render", "--out", "b", "--seed", "8")
        shutil.rmtree(self.folder / "a/statistics")
        (self.folder / "a/statistics").symlink_to("../b/statistics")
        other = self.files("b")
        self.kept("a", 2, "run", scene, "--no-render", "--out", "a", says="statistics/low.csv is not what the run in it has written")
        manifest = self.folder / "a/manifest.json"
        manifest.write_text(unsealed({**json.loads(manifest.read_text()), "complete": False}))
        (self.folder / "a/checkpoint.nephos").unlink()
        self.kept("a", 2, "run", scene, "--no-render", "--out", "a", says="statistics/low.csv is not what the run in it has written")
        self.assertEqual(self.files("b"), other)

    def test_own_files_by_another_path(self):
        """A link of the user's to one of the run's own folders, and a folder for two kinds of its files."""
        scene = self.write("layered.toml", LAYERED.replace("enabled = false", "count = 2") + "[density]\nper_layer = true\n")
        self.call("run", scene, "--no-render", "--out", "out")
        for name, target in (("latest", "low"), ("zlatest", "low"), ("all", ".")):
            (self.folder / "out/density" / name).symlink_to(target)
        self.call("run", scene, "--no-render", "--out", "out")
        manifest = self.folder / "out/manifest.json"
        manifest.write_text(unsealed({**json.loads(manifest.read_text()), "complete": False}))
        (self.folder / "out/checkpoint.nephos").unlink()
        self.call("run", scene, "--no-render", "--out", "out")
        (self.folder / "both/density").mkdir(parents=True)
        (self.folder / "both/frames").symlink_to("density")
        for _ in range(2):
            self.call("run", self.scene, "--splatting", "cpu", "-q", "--out", "both")
        self.call("verify", "both")

    @unittest.skipUnless(shutil.which("strace"), "strace is not installed")
    def test_two_runs_into_one_folder_of_frames(self):
        """By links: while one is at work the other does not begin; also where the first one has made the folder itself. What neither
        writes to is nobody's."""
        (self.folder / "disk").mkdir()
        for out, target in (("a", "../disk"), ("b", "../disk"), ("c", None), ("d", "../c/density"), ("e", "../disk")):
            (self.folder / out).mkdir()
            if target:
                (self.folder / out / ("density" if out != "e" else "frames")).symlink_to(target)
        for first, second in (("a", "b"), ("c", "d")):
            with self.subTest(first):
                begun = subprocess.Popen(["strace", "-f", "-qq", "-e", "trace=rename,renameat,renameat2", "-e",
                                          "inject=rename,renameat,renameat2:delay_enter=1500000", "-o", "/dev/null", NEPHOS, *map(str, self.plain),
                                          "--out", first], cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
                while begun.poll() is None and not (self.folder / first / "statistics.csv").exists():
                    time.sleep(0.01)
                self.assertIsNone(begun.poll())
                for more in ([], ["--overwrite"]):
                    self.refused(3, *self.plain, "--seed", "9", "--out", second, *more,
                                 says=f"{second}/density: another run or export is writing into this folder")
                self.call("run", self.scene, "--statistics-only", "--out", second)
                self.call(*self.plain, "--out", "e", "--overwrite")
                _, said = begun.communicate(timeout=PATIENCE)
                self.assertEqual(begun.returncode, 0, said)
                self.call("verify", first)

    @unittest.skipUnless("FAILING_CALLS" in os.environ, "no failing calls")
    def test_a_table_of_a_layer_that_was_begun(self):
        """Killed while it is published: the leftover, which has a header, is in nobody's way."""
        scene = self.write("layered.toml", LAYERED)
        for call in ("rename", "fsync"):
            environment = {**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": f"{call} KILL 1 1",
                           "FAIL_PATH": f"{call}/statistics/", "FAIL_PROGRAM": "nephos"}
            for more in ([], ["--resume"]):
                shutil.rmtree(self.folder / call, ignore_errors=True)
                killed = subprocess.run([NEPHOS, "run", str(scene), "--no-render", "-q", "--out", call], cwd=self.folder, env=environment)
                self.assertEqual(killed.returncode, -signal.SIGKILL)
                self.assertNotEqual(list((self.folder / call / "statistics").iterdir()), [])
                self.call("run", scene, "--no-render", "-q", "--out", call, *more)
                self.call("verify", call)

    def test_a_table_that_is_empty(self):
        """Nothing is in it: a complete run is made again."""
        self.call(*self.plain, "--out", "run")
        (self.folder / "run/statistics.csv").write_text("")
        self.call(*self.plain, "--out", "run")
        self.call("verify", "run")

    def test_what_another_run_is_about_to_publish_is_no_leftover(self):
        (self.folder / "disk").mkdir()
        self.call(*self.plain, "--out", "own")
        for folder, is_kept in (("density", False), ("density/other", True)):
            (self.folder / "own" / folder).parent.mkdir(exist_ok=True)
            if is_kept:
                (self.folder / "own" / folder).symlink_to("../../disk")
            hidden = self.folder / "own" / folder / ".tiny_0009.part123-456.vdb"
            hidden.write_text("on the way")
            other = os.open(self.folder / "disk", os.O_RDONLY)  # where another run is at work
            fcntl.flock(other, fcntl.LOCK_EX)
            self.call(*self.plain, "--out", "own", "--resume")
            os.close(other)
            self.assertEqual(hidden.exists(), is_kept, folder)

    def test_frames_of_another_run_at_the_places_of_an_interrupted_one(self):
        """Behind a link that two runs share, or put there: neither run nor --resume takes them for its own."""
        (self.folder / "disk").mkdir()
        for out in ("a", "b"):
            (self.folder / out).mkdir()
            (self.folder / out / "density").symlink_to("../disk")
        environment = {**self.environment, "LD_PRELOAD": os.environ.get("FAILING_CALLS", ""), "FAIL_CALL": "rename KILL 2 1", "FAIL_PATH": "/a/",
                       "FAIL_PROGRAM": "nephos"}
        if "FAILING_CALLS" not in os.environ:
            self.skipTest("no failing calls")
        out = str(self.folder / "a")
        self.assertEqual(subprocess.run([NEPHOS, *map(str, self.plain), "--out", out], cwd=self.folder, env=environment).returncode, -signal.SIGKILL)
        self.call(*self.plain, "--seed", "9", "--out", "b")
        for more in ([], ["--resume"]):
            self.kept("b", 2, *self.plain, "--out", "a", *more, says="density/tiny_0001.vdb is not what the run in it has written")
        # With a checkpoint before its frames are all there.
        environment["FAIL_CALL"], environment["FAIL_PATH"] = "rename KILL 9 1", "/c/"
        interrupted = [NEPHOS, *map(str, self.plain), "--checkpoint-every", "0", "--out", str(self.folder / "c")]
        self.assertEqual(subprocess.run(interrupted, cwd=self.folder, env=environment).returncode, -signal.SIGKILL)
        frames = sorted(path.name for path in (self.folder / "c/density").glob("tiny*.vdb"))
        self.assertIn(len(frames), range(1, 5), frames)
        for name in (frames[0], "tiny_0005.vdb"):
            shutil.copytree(self.folder / "c", self.folder / f"c-{name}")
            shutil.copy(self.folder / "b/density" / name, self.folder / f"c-{name}/density")
            published = lambda: {path.name: path.read_bytes() for path in (self.folder / f"c-{name}/density").glob("tiny*.vdb")}
            before = published()
            self.refused(2, *self.plain, "--out", f"c-{name}", "--resume", says=f"density/{name}: is of another run, or of none")
            self.assertEqual(before, published())
        self.call(*self.plain, "--out", "c", "--resume")
        self.call(*self.plain, "--out", "whole")
        self.same_runs("c", "whole")

    def test_a_file_called_like_the_next_frame(self):
        self.call(*self.plain, "--set", "time.steps=4", "--out", "run")
        frames = sorted((self.folder / "run/density").iterdir())
        copy = self.folder / f"run/density/tiny_{len(frames) + 1:04}.vdb"
        shutil.copy(frames[0], copy)
        longer = (*self.plain, "--set", "time.steps=9", "--resume", "--out", "run")
        self.kept("run", 2, *longer, says=f"run/density/{copy.name}: would be replaced by the next frame")
        self.call("run", self.scene, "--no-render", "--set", "time.steps=4", "--resume", "--out", "run")
        copy.unlink()
        self.call(*longer)
        self.call(*self.plain, "--set", "time.steps=9", "--out", "whole")
        self.same_runs("run", "whole")

    def test_layers_in_one_folder_are_refused(self):
        """By links: the frames of one would replace those of the other. Nothing is written, nothing removed."""
        scene = self.write("layered.toml", LAYERED.replace("enabled = false", "count = 2") + LAYERED[LAYERED.index("[[layer]]"):].replace("low", "high")
                           + "[density]\nper_layer = true\n")
        self.call("run", scene, "--no-render", "--out", "kept")
        for number, links in enumerate(({"low": "../../disk", "high": "../../disk"}, {"low": "high"}, {"low": "."})):
            out = f"links{number}"
            shutil.copytree(self.folder / "kept", self.folder / out)
            (self.folder / "disk").mkdir(exist_ok=True)
            for name, target in links.items():
                shutil.rmtree(self.folder / out / "density" / name)
                (self.folder / out / "density" / name).symlink_to(target)
            before = {str(path): path.stat().st_mtime_ns for path in sorted((self.folder / out).rglob("*"))}
            for more in ([], ["--overwrite"], ["--seed", "9", "--overwrite"]):
                self.refused(2, "run", scene, "--no-render", "--out", out, *more, says="are one folder" if more else out)
            after = {str(path): path.stat().st_mtime_ns for path in sorted((self.folder / out).rglob("*"))}
            self.assertEqual(before, after)
            self.call("run", scene, "--statistics-only", "--out", f"{out}-bits")
        # To a folder that is not there yet.
        for link, target, status, says in (("high", "low", 2, "are one folder"), ("low", "high", 3, "a link stands there that leads nowhere")):
            (self.folder / f"new-{link}/density").mkdir(parents=True)
            (self.folder / f"new-{link}/density" / link).symlink_to(target)
            self.refused(status, "run", scene, "--no-render", "--out", f"new-{link}", says=says)
            self.assertEqual([path for path in (self.folder / f"new-{link}").rglob("*") if path.is_file()], [])

    def test_a_frame_that_is_not_what_was_written(self):
        self.call(*self.plain, "--out", "out")
        frame = self.folder / "out/density/tiny_0001.vdb"
        for put in (lambda: frame.write_bytes(b""), lambda: os.mkfifo(frame), lambda: frame.symlink_to("/dev/zero"), frame.mkdir):
            frame.unlink()
            put()
            self.refused(3, *self.plain, "--out", "out", "--resume", "--set", "time.steps=9", says="tiny_0001.vdb: is not the file of ")

    def test_a_run_of_another_name_is_replaced_as_a_whole(self):
        self.call(*self.plain, "--out", "out")
        self.call(*self.plain, "--out", "out", "--set", 'name="other"', "--overwrite")
        self.assertEqual([p.name for p in sorted((self.folder / "out/density").iterdir())],
                         [f"other_{n:04}.vdb" for n in range(1, len(list((self.folder / "out/density").iterdir())) + 1)])
        self.call("verify", "out")
        # A name that leads elsewhere is none.
        manifest = self.folder / "out/manifest.json"
        manifest.write_text(manifest.read_text().replace('"name": "other"', '"name": "../../victim"'))
        (self.folder / "victim.mp4").write_text("mine")
        self.call(*self.plain, "--out", "out", "--overwrite")
        self.assertEqual((self.folder / "victim.mp4").read_text(), "mine")

    def test_a_camera_in_the_ground_is_refused_before_a_run_is_removed(self):
        scene = self.write("high.toml", 'ground = { relief = "hills" }\nterrain = { cells = 16 }\n' + SCENE)
        run = ("run", scene, "--splatting", "cpu", "--out", "out", "-q")
        self.call(*run, "--set", "camera.above_ground=true")
        low = ("--set", "camera.above_ground=false", "--set", "camera.position_m=[500,500,-5]")
        says = "camera: the position 500, 500, -5 is in the ground"
        self.kept("out", 2, *run, "--overwrite", *low, says=says)
        self.assertIn(says, self.call("validate", scene, *low, status=2).stderr)
        self.refused(2, "run", scene, "--splatting", "cpu", "--out", "new", *low, says=says)
        for height in ("0", "-5"):  # which no heights of the ground are needed for
            low = ("--set", "camera.above_ground=true", "--set", f"camera.position_m=[500,500,{height}]")
            says = f"camera: the position is {height} m above the ground; expected more than 0"
            self.kept("out", 2, *run, "--overwrite", *low, says=says)
            self.assertIn(says, self.call("validate", scene, *low, status=2).stderr)

    @unittest.skipUnless(os.geteuid() == 0 and shutil.which("setpriv"), "only root becomes another user")
    def test_a_file_below_a_folder_of_others(self):
        """Who may not look into a folder above has no run there: a file is replaced as anywhere else."""
        os.chmod(self.folder, 0o755)
        folder = self.folder / "closed/mine"
        folder.mkdir(parents=True)
        shutil.copy(self.folder / self.scene, folder / "scene.toml")
        os.chown(folder, 65534, 65534)
        (self.folder / "closed").chmod(0o700)
        for _ in range(2):
            # Beside others' files that say nothing of it.
            (folder / "fit.json").write_text("{}")
            (folder / "fit.json").chmod(0o600)
            (folder / "wave-1").mkdir(mode=0o700, exist_ok=True)
            state = subprocess.run(["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups", NEPHOS, "state", "scene.toml", "--steps", "1", "-q", "-o",
                                    "x.vdb"], cwd=folder, env=self.environment, capture_output=True, text=True)
            self.assertEqual(state.returncode, 0, state.stderr)

    def test_files_that_a_call_reads(self):
        self.call(*self.plain, "--out", "out")
        frame = self.folder / "out/density/tiny_0003.vdb"
        shutil.copy(frame, self.folder / "cloud.vdb")
        (self.folder / "h.png").write_bytes(height_map(10))
        scene = self.write("high.toml", 'ground = { height_map = "h.png" }\n' + SCENE)
        for out in ("h.png", "./h.png"):
            self.kept(".", 2, "render", "cloud.vdb", "--scene", scene, "--out", out, "--splatting", "cpu", says="is the file that is read")
        self.kept("out", 2, *self.plain, "--out", "out", "--overwrite", "--set", "lattice.initial_state=out/density/tiny_0003.vdb",
                  says="is what `lattice.initial_state` names, and a file of the run in out, which is replaced")
        self.call("export", "cloud.vdb", "--for", "blender", "-o", "exported", "-q")
        name = next(p for p in (self.folder / "exported").iterdir() if p.suffix == ".vdb").name
        self.kept("exported", 2, "export", f"exported/{name}", "--for", "blender", "-o", "exported", "-q",
                  says=f"exported/{name}: lies in the folder that is written to")
        self.call("verify", "exported")

    def test_a_run_that_is_put_in_the_place_of_another(self):
        """The one that is moved away while it is at work writes nothing into it."""
        self.call(*self.plain, "--seed", "8", "--set", "time.steps=60", "--out", "done")
        before = self.files("done")
        for n in range(12):
            process = subprocess.Popen([NEPHOS, *map(str, self.plain), "--seed", "7", "--set", "time.steps=60", "--out", "out", "-j", "1"],
                                       cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
            while process.poll() is None and not (self.folder / "out/density/tiny_0002.vdb").exists():
                pass
            time.sleep(0.002 * n)
            (self.folder / "out").rename(self.folder / f"moved{n}")
            (self.folder / "done").rename(self.folder / "out")
            _, said = process.communicate(timeout=PATIENCE)
            self.assertIn(process.returncode, (0, 3), said)
            (self.folder / "out").rename(self.folder / "done")
            after = self.files("done")
            self.assertEqual([path for path in sorted({*before, *after}) if before.get(path) != after.get(path)], [])

    def test_a_part_that_is_exchanged_ends_the_run(self):
        """A link to the frames of another run, or a folder of these, in place of its own: nothing is written there."""
        self.call(*self.plain, "--seed", "8", "--set", "time.steps=600", "--out", "done")
        before = self.files("done")
        for n in range(6):
            out = self.folder / f"out{n}"
            process = subprocess.Popen([NEPHOS, *map(str, self.plain), "--seed", "7", "--set", "time.steps=600", "--out", out, "-j", "1"],
                                       cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
            while process.poll() is None and not (out / "density/tiny_0001.vdb").exists():
                pass
            time.sleep(0.002 * n)
            (out / "density").rename(self.folder / f"moved{n}")
            (out / "density").symlink_to(self.folder / "done/density")
            _, said = process.communicate(timeout=PATIENCE)
            if process.returncode != 0:  # it may have been done before
                self.assertEqual(process.returncode, 3, said)
            self.assertEqual(self.files("done"), before)

    def test_a_run_with_links_in_place_of_its_files_is_not_resumed(self):
        """They lead to another run's, which would be replaced."""
        self.call(*self.plain, "--out", "a")
        for name in ("manifest.json", "checkpoint.nephos"):
            shutil.copytree(self.folder / "a", self.folder / "b")
            (self.folder / "b" / name).unlink()
            (self.folder / "b" / name).symlink_to(self.folder / "a" / name)
            before = self.files("a")
            self.assertIn(f"{name}: is a link", self.call(*self.plain, "--resume", "--set", "time.steps=90", "--out", "b", status=3).stderr)
            self.assertEqual(self.files("a"), before)
            shutil.rmtree(self.folder / "b")

    def test_a_link_that_is_put_in_place_of_the_manifest_ends_the_run(self):
        """While the run is at work: the file of another run that it leads to is not replaced."""
        self.call(*self.plain, "--seed", "8", "--out", "done")
        before = self.files("done")
        for name in ("manifest.json", "checkpoint.nephos"):
            out = self.folder / f"out-{name}"
            process = subprocess.Popen([NEPHOS, "run", self.scene, "--checkpoint-every", "0", "--set", "time.steps=20000", "--statistics-only", "--out", out, "-q"],
                                       cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
            while process.poll() is None and not (out / "checkpoint.nephos").exists():
                time.sleep(0.01)
            # Once more where the run has put its own file there between its last look and the renaming.
            while process.poll() is None:
                if not (out / name).is_symlink():
                    (self.folder / "link").symlink_to(self.folder / "done" / name)
                    (self.folder / "link").rename(out / name)
                time.sleep(0.01)
            _, said = process.communicate(timeout=PATIENCE)
            self.assertEqual(process.returncode, 3, said)
            self.assertIn("is a link, which is not followed here" if (out / name).is_symlink() else "was removed or replaced", said)
            self.assertEqual(self.files("done"), before)

    def test_a_link_in_place_of_a_table_is_not_followed(self):
        """A run and a branch refuse it, or remove it with --overwrite; what it leads to stays."""
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "a")
        (self.folder / "diary.txt").write_text("mine")
        for name in ("statistics/low.csv", "statistics.csv"):
            for command in (["run", scene, "--no-render"], ["run", "--from", "a", "--no-render", "--set", "time.steps=30"]):
                link = self.folder / "b" / name
                link.parent.mkdir(parents=True)
                link.symlink_to(self.folder / "diary.txt")
                self.refused(2, *command, "--out", "b", says=pathlib.Path(name).name)
                self.call(*command, "--out", "b", "--overwrite")
                self.assertEqual((self.folder / "diary.txt").read_text(), "mine")
                self.call("verify", "b")
                shutil.rmtree(self.folder / "b")

    def test_a_run_whose_tables_are_behind_a_link_is_not_resumed(self):
        """A copy of it shares them, which would be cut or appended to; and none begins so."""
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "a")
        (self.folder / "a/statistics").rename(self.folder / "elsewhere")
        for name in "ab":
            (self.folder / name / "statistics").symlink_to("../elsewhere") if name == "a" else shutil.copytree(self.folder / "a", self.folder / "b", symlinks=True)
            before = self.files("elsewhere")
            resumed = self.call("run", scene, "--no-render", "--resume", "--set", "time.steps=90", "--out", name, status=3)
            self.assertIn(f"{name}/statistics: is a link, which is not followed here", resumed.stderr)
            self.assertEqual(self.files("elsewhere"), before)
        (self.folder / "c").mkdir()
        (self.folder / "empty").mkdir()
        (self.folder / "c/statistics").symlink_to("../empty")
        self.kept("c", 2, "run", scene, "--no-render", "--out", "c", says="c/statistics: is a link, which is not followed here")

    def test_a_folder_that_is_moved_away_does_not_come_back(self):
        for n in range(6):
            process = subprocess.Popen([NEPHOS, "run", self.scene, "--checkpoint-every", "0", "--set", "time.steps=20000", "--statistics-only", "--out", "out", "-q"],
                                       cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
            while process.poll() is None and not (self.folder / "out/checkpoint.nephos").exists():
                time.sleep(0.01)
            time.sleep(0.013 * n)
            (self.folder / "out").rename(self.folder / f"away{n}")
            _, said = process.communicate(timeout=PATIENCE)
            self.assertEqual(process.returncode, 3, said)
            self.assertIn("the folder was removed or renamed", said)
            self.assertFalse((self.folder / "out").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
