# SPDX-License-Identifier: Apache-2.0
"""`nephos run`: its files, its memory, and how it is interrupted and resumed."""

import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import time
import unittest

from case import LONG, NEPHOS, PATIENCE, SCENE, SOURCE, Case, rows_of, voxels


class Run(Case):
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

    def test_a_complete_run_is_replaced_only_by_all_of_it(self):
        """What a call does not make again stays, unless --overwrite says so: frames, pictures, steps, a branch, another content."""
        def kept(folder, *arguments, says):
            before = {path: path.read_bytes() for path in sorted((self.folder / folder).rglob("*")) if path.is_file()}
            said = self.refused(2, "run", *arguments, "--out", folder, says=says).stderr
            self.assertIn("choose another --out, or give --overwrite", said)
            self.assertEqual(before, {path: path.read_bytes() for path in sorted((self.folder / folder).rglob("*")) if path.is_file()})
        self.call("run", self.scene, "--no-render", "--out", "frames")
        for more in (("--statistics-only",), ("--no-render", "--frames", "1..2"), ("--no-render", "--frames", "2..")):
            kept("frames", self.scene, *more, says="it holds a complete run for frames 1..5, without pictures")
        self.call("run", self.scene, "--no-render", "--out", "frames")
        self.call("run", self.scene, "--splatting", "cpu", "--out", "frames")
        kept("frames", self.scene, "--no-render", says="it holds a complete run for frames 1..5,")
        self.call("run", self.scene, "--no-render", "--out", "frames", "--overwrite")
        self.call("run", self.scene, "--statistics-only", "--out", "rows")
        kept("rows", self.scene, "--no-render", "--frames", "1..2", says="it holds a complete run for statistics alone")
        self.call("run", self.scene, "--no-render", "--out", "rows")
        # Branches of one scene, and the run without them.
        drier = (self.scene, "--statistics-only", "--checkpoint", "--set", "field.background.ext=0.4")
        for steps in (2, 3):
            self.call("run", self.scene, "--statistics-only", "--checkpoint", "--set", f"time.steps={steps}", "--out", f"par{steps}")
        self.call("run", "--from", "par2", *drier, "--out", "branch")
        kept("branch", *drier, says="it branched off another run")
        kept("branch", "--from", "par3", *drier, says="another beginning")
        self.call("run", "--from", "par2", *drier, "--out", "branch")
        # One name, another content.
        started = [self.scene, "--statistics-only", "--set"]
        for folder, steps in (("d1", 1), ("d2", 2)):
            (self.folder / folder).mkdir()
            self.call("state", self.scene, "--steps", steps, "--out", f"{folder}/s.vdb")
        self.call("run", *started, "lattice.initial_state=d1/s.vdb", "--out", "started")
        kept("started", *started, "lattice.initial_state=d2/s.vdb", says="another content of s.vdb of `lattice.initial_state`")
        self.call("run", *started, "lattice.initial_state=d1/s.vdb", "--out", "started")

    def test_until_goes_on_from_few_steps_and_stops(self):
        until = ("run", self.scene, "--statistics-only", "--until", "cover.se=1e-9", "--set", "field.background.ext=0.4")
        for steps in (0, 1):
            self.call(*until, "--max-steps", "40", "--set", f"time.steps={steps}", "--out", f"u{steps}", status=1)
            self.assertEqual(len(rows_of(self.folder / f"u{steps}/statistics.csv")), 41)
        process = subprocess.Popen([NEPHOS, *until, "--max-steps", "1000000000", "--set", "time.steps=1", "--out", "stopped"],
                                   cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not (self.folder / "stopped/checkpoint.nephos").exists():
            self.assertIsNone(process.poll())
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 128 + signal.SIGTERM, said)
        self.assertIn("with --resume goes on", said)

    def test_until_lists_the_files_that_it_has_read(self):
        """Though one is exchanged between two of its parts: all of them are of the first."""
        self.call("state", self.scene, "--steps", "1", "--out", "first.vdb")
        self.call("state", self.scene, "--steps", "3", "--out", "other.vdb")
        shutil.copy(self.folder / "first.vdb", self.folder / "s.vdb")
        until = ("run", self.scene, "--statistics-only", "--until", "cover.se=1e-9", "--max-steps", "40", "--set", "time.steps=8", "--set", "field.background.ext=0.4",
                 "--set", "lattice.initial_state=s.vdb")
        environment = {**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": "rename STOP 4 1", "FAIL_PATH": "until/manifest"}
        self.call(*until, "--out", "whole", status=1)
        process = subprocess.Popen([NEPHOS, *until, "--out", "until"], cwd=self.folder, env=environment, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)  # in a later part
        shutil.copy(self.folder / "other.vdb", self.folder / "s.vdb")
        process.send_signal(signal.SIGCONT)
        said = process.communicate(timeout=PATIENCE)[1]
        self.assertEqual(process.returncode, 1, said)
        inputs = [json.loads((self.folder / name / "manifest.json").read_text())["inputs"] for name in ("whole", "until")]
        self.assertEqual(inputs[0], inputs[1])

    def test_a_scene_whose_canonical_text_is_long(self):
        """Every key spelled out, the scene of this run has more bytes than a scene may have."""
        small = "{centre_m=[%d,300,300],semi_axes_m=[60,60,60]}"
        entries = ",\n".join(small % (100 + n % 1000) for n in range(40_000))
        long = self.write("long.toml", SCENE.replace("[field.background]", f"[field]\nellipsoids = [{entries}]\n[field.background]"))
        run = ("--no-render", "--set", "time.steps=2", "--set", "frames.count=1")
        self.call("run", long, *run, "--out", "a")
        self.assertGreater(len(json.loads((self.folder / "a/manifest.json").read_text())["scene_text"]), 8 << 20)
        self.call("verify", "a")
        self.call("export", "a", "--for", "blender", "--out", "b")
        self.call("run", "--resume", "--out", "a", "--no-render")

    def test_an_option_whose_value_is_empty(self):
        for command in (["run", self.scene, "--out=", "--statistics-only"], ["sweep", self.scene, "--axis="], ["state", self.scene, "--out=", "--steps"]):
            self.assertIn("= has no value: expected ", self.call(*command, status=2).stderr.replace("`", ""))
        self.assertEqual([path.name for path in self.folder.iterdir()], ["tiny.toml"])

    def test_a_folder_whose_name_no_scene_can_hold(self):
        folder = os.fsencode(self.folder) + b"/f\xffx"
        os.mkdir(folder)
        self.call("state", self.scene, "--steps", "1", "--out", "s.vdb")
        os.rename(self.folder / "s.vdb", folder + b"/s.vdb")
        with open(folder + b"/a.toml", "w") as file:
            file.write(SCENE.replace("cells = [32, 24, 12]", 'cells = [32, 24, 12]\ninitial_state = "s.vdb"'))

        def run(*arguments):
            done = subprocess.run([os.fsencode(NEPHOS), b"run", *arguments, b"--statistics-only", b"--checkpoint"], cwd=self.folder,
                                  env=self.environment, capture_output=True, timeout=PATIENCE)
            return done.returncode, done.stderr
        self.assertEqual(run(b"f\xffx/a.toml", b"--out", b"f\xffx/out"), (0, b""))
        for arguments in ((b"--resume", b"--out", b"f\xffx/out"), (b"--from", b"f\xffx/out", b"--out", b"branch")):
            status, said = run(*arguments)
            self.assertEqual(status, 2, said)
            self.assertIn(b"f\\xffx/s.vdb: its name is no UTF-8", said)

    def test_frames_writes_only_these(self):
        self.call("run", self.scene, "--no-render", "--out", "all")
        self.call("run", self.scene, "--no-render", "--out", "some", "--frames", "2..3")
        names = sorted(p.name for p in (self.folder / "some/density").iterdir())
        self.assertEqual(names, ["tiny_0002.vdb", "tiny_0003.vdb"])
        for name in names:
            self.assertEqual(voxels(self.folder / "some/density" / name), voxels(self.folder / "all/density" / name))

    def test_a_range_to_the_end_is_lengthened_with_the_scene(self):
        """Complete or not; one to a frame that is named stays."""
        command = ("run", self.scene, "--no-render", "--frames", "2..")
        self.call(*command, "--set", "time.steps=15", "--out", "whole")
        self.call(*command, "--set", "time.steps=9", "--out", "longer")
        first = (self.folder / "longer/density/tiny_0002.vdb").stat().st_mtime_ns
        self.call(*command, "--set", "time.steps=15", "--out", "longer", "--resume")
        self.same_runs("whole", "longer")
        self.assertEqual((self.folder / "longer/density/tiny_0002.vdb").stat().st_mtime_ns, first)
        killed = {**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": "rename KILL 1 1", "FAIL_PATH": "tiny_0004"}
        subprocess.run([NEPHOS, *command, "--set", "time.steps=9", "--out", "stopped"], cwd=self.folder, env=killed, capture_output=True, check=False)
        self.assertFalse(json.loads((self.folder / "stopped/manifest.json").read_text())["complete"])
        self.call(*command, "--set", "time.steps=15", "--out", "stopped", "--resume")
        self.same_runs("whole", "stopped")
        # From the first on, also where the last step has a frame and the last one before had none.
        for before, after in ((8, 9), (8, 15), (9, 14)):
            for name, steps, more in (("all", after, ()), ("short", before, ()), ("short", after, ("--resume",))):
                self.call(*command[:-1], "1..", "--set", f"time.steps={steps}", "--out", f"{name} {before} {after}", *more)
            self.same_runs(f"all {before} {after}", f"short {before} {after}")
        self.call(*command[:-1], "2..3", "--set", "time.steps=9", "--out", "named")
        self.call(*command[:-1], "2..3", "--set", "time.steps=15", "--out", "named", "--resume")
        self.assertEqual(len(list((self.folder / "named/density").iterdir())), 2)

    def test_statistics_only_writes_the_same_statistics_and_no_frames(self):
        self.call("run", self.scene, "--no-render", "--out", "all")
        result = self.call("run", self.scene, "--statistics-only", "--out", "some", "--quiet")
        self.assertEqual((result.stdout, result.stderr), ("", ""))
        some, whole = ((self.folder / name / "statistics.csv").read_text().splitlines() for name in ("some", "all"))
        self.assertEqual(some[0], whole[0])
        rows = [row.split(",") for row in whole[1:]]
        for row in rows:
            row[-3] = row[-2] = ""  # mean_density and optical_cover: no density is made
        self.assertEqual([row.split(",") for row in some[1:]], rows)
        beyond = ["--set", "frames.count=1000"]
        self.assertIn("frames.count", self.call("run", self.scene, "--no-render", "--out", "more", *beyond, status=2).stderr)
        self.call("run", self.scene, "--statistics-only", "--out", "more", *beyond)
        self.assertEqual((self.folder / "more/statistics.csv").read_text().splitlines(), some)
        self.assertEqual(list(self.folder.glob("some/**/*.vdb")) + list(self.folder.glob("some/**/*.png")), [])

    def test_a_scene_without_frames_has_the_same_statistics(self):
        none = ["--set", "frames.enabled=false"]
        self.call("run", self.scene, "--no-render", "--out", "all")
        report = json.loads(self.call("run", self.scene, "--out", "some", *none, "--json").stdout)
        self.assertEqual((report["frames"], report["complete"], report["backend"]), (0, True, ""))
        some, whole = ((self.folder / name / "statistics.csv").read_text() for name in ("some", "all"))
        self.assertEqual(some, whole)
        self.assertEqual(sorted(p.name for p in (self.folder / "some").iterdir()),
                         ["checkpoint.nephos", "manifest.json", "statistics.csv"])
        self.assertEqual(json.loads(self.call("validate", self.scene, *none, "--json").stdout)[0]["frames"], 0)
        for option in (["--video"], ["--frames", "1"]):
            result = self.call("run", self.scene, "--out", "no", *none, *option, status=2)
            self.assertIn("has no frames", result.stderr)

    def test_names_of_files_do_not_matter_to_info(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        shutil.copy(self.folder / "out/density/tiny_0001.vdb", self.folder / "a.exr")
        self.assertEqual(json.loads(self.call("info", "--json", "a.exr").stdout)["kind"], "vdb")

    def test_damaged_statistics_have_a_way_on(self):
        """A complete run with a row too few, and with a checkpoint to go on from: nothing is lost, and the cure helps."""
        for more in ([], ["--checkpoint"]):
            command = ("run", self.scene, "--statistics-only", *more, "--out", "rows", "--overwrite")
            self.call(*command)
            table = self.folder / "rows/statistics.csv"
            whole = table.read_bytes()
            table.write_bytes(whole.replace(b"\n3,", b"\n4,"))
            before = {path: path.read_bytes() for path in (self.folder / "rows").iterdir()}
            self.refused(3, *command[:-1], "--resume", says="--overwrite instead of --resume starts the run anew")
            self.assertEqual({path: path.read_bytes() for path in (self.folder / "rows").iterdir()}, before)
            self.call(*command)
            self.assertEqual(table.read_bytes(), whole)


    def test_what_cannot_be_is_refused(self):
        self.refused(2, "run", self.scene, "--video", "--no-render", "--out", "out",
                     says="--no-render draws no pictures for --video")
        self.refused(2, "run", self.scene, "--no-render", "--out", "", says="--out '': expected the path of a folder")
        self.refused(2, "state", self.scene, "--out", "", says="--out '': expected the path of a file")
        self.assertEqual([p.name for p in self.folder.iterdir()], ["tiny.toml"])


class Inputs(Case):
    """Files that a scene names, replaced between two calls of a run."""

    SHORT = ("--set", "time.steps=3")
    SMALL = ("--splatting", "cpu", "--set", "camera.width=24", "--set", "camera.height=16")

    def replaced(self, scene, key, name, other, *options):
        """A run whose file is another one when it is to go on."""
        out = self.folder / "out"
        run = ["run", scene, *options, "--out", "out"]
        for more in ([], ["--frames", "1..3"]):
            shutil.rmtree(out, ignore_errors=True)
            first = (self.folder / name).read_bytes()
            self.call(*run, *self.SHORT, *more)
            manifest = json.loads((out / "manifest.json").read_text())
            self.assertEqual(manifest["inputs"][key]["path"], f"../{name}")
            self.assertEqual(manifest["inputs"][key]["bytes"], len(first))
            before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
            (self.folder / name).write_bytes(other)
            longer = self.SHORT if more else ()
            refused = self.refused(2, *run, *longer, *more, "--resume", says=f"{pathlib.Path(name).name} of `{key}`")
            self.assertIn("--overwrite", refused.stderr)
            self.assertEqual({path: path.read_bytes() for path in out.rglob("*") if path.is_file()}, before)
            (self.folder / name).write_bytes(first)
            self.call(*run, *longer, *more, "--resume")
            (self.folder / name).write_bytes(other)
            self.call(*run, *longer, *more, "--overwrite")
            (self.folder / name).write_bytes(first)
        return manifest

    def test_heights_of_the_ground(self):
        def heights(factor):
            return struct.pack("<256H", *[factor * (n % 7) for n in range(256)])
        (self.folder / "heights.raw").write_bytes(heights(100))
        scene = "hills.toml"
        self.write(scene, SCENE + '[ground]\nheight_map = "heights.raw"\n[terrain]\nraw_columns = 16\n'
                   "raw_rows = 16\n")
        self.replaced(scene, "ground.height_map", "heights.raw", heights(2000), *self.SMALL)
        # They count for pictures alone, and a manifest of an earlier version says nothing of them.
        self.call("run", scene, "--no-render", "--out", "plain", *self.SHORT)
        (self.folder / "heights.raw").write_bytes(heights(2000))
        self.call("run", scene, "--no-render", "--out", "plain", "--resume")
        path = self.folder / "out/manifest.json"
        self.call("run", scene, *self.SMALL, "--out", "out", *self.SHORT, "--overwrite")
        manifest = json.loads(path.read_text())
        del manifest["inputs"]
        path.write_text(json.dumps(manifest))
        (self.folder / "heights.raw").write_bytes(heights(100))
        self.call("run", scene, *self.SMALL, "--out", "out", "--resume")
        self.assertIn("ground.height_map", json.loads(path.read_text())["inputs"])

    def test_textures(self):
        shutil.copytree(SOURCE / "scenes/torchelsen", self.folder / "t")
        other = (self.folder / "t/textures/heap-3.png").read_bytes()
        options = [*self.SMALL, "--set", "frames.count=0", "--set", "frames.per_second=1", "--set", "frames.time_scale=10",
                   "--set", "frames.start_s=0", "--set", "time.step_s=10"]
        self.SHORT = ("--set", "time.steps=2")
        self.replaced("t/painted.toml", "model[0].textures[1]", "t/textures/heap-2.png", other, *options, "--set",
                      "time.steps=4")

    def test_probabilities(self):
        """In files of the simulation the values count: those of other bytes are the same."""
        self.call("run", self.scene, "--no-render", "--out", "grids", *self.SHORT)
        files = [self.folder / f"grids/density/tiny_000{n}.vdb" for n in (2, 3)]
        shutil.copy(files[0], self.folder / "p.vdb")
        scene = "p.toml"
        self.write(scene, SCENE + '[[field.grids]]\nof = "ext"\nfile = "p.vdb"\ngrid = "density"\n')
        self.replaced(scene, "field.grids[0].file", "p.vdb", files[1].read_bytes(), "--no-render")


class Branch(Case):
    """Runs that branch off another one."""

    BRANCH = ("--no-render", "--set", "field.background.ext=0.06", "--set", "time.steps=3000")

    def begin(self):
        """A branch that was interrupted, and the same one that was not."""
        self.scene = self.write("tiny.toml", LONG.replace("steps = 10000", "steps = 6"))
        self.call("run", self.scene, "--no-render", "--out", "source")
        self.call("run", "--from", "source", *self.BRANCH, "--out", "whole")
        process = subprocess.Popen([NEPHOS, "run", "--from", "source", *self.BRANCH, "--out", "part"], cwd=self.folder,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.environment)
        end = time.monotonic() + PATIENCE
        while not (self.folder / "part/density/tiny_0003.vdb").exists():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.002)
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 128 + signal.SIGTERM, errors)

    def goes_on(self, *arguments):
        """From a copy of what was interrupted. The manifest has the checksums of all files."""
        copy = self.folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(self.folder / "part", copy)
        self.call("run", *arguments, "--out", "copy", "--resume")
        manifests = [json.loads((self.folder / name / "manifest.json").read_text()) for name in ("whole", "copy")]
        for manifest in manifests:
            self.assertTrue(manifest.pop("complete"))
            del manifest["timing"], manifest["xxh3"]
        self.assertEqual(*manifests)

    def test_needs_the_manifest_of_the_other_run(self):
        """It says whose the statistics are that lie beside the checkpoint; a link leads to where these are."""
        scene = self.write("tiny.toml", LONG.replace("steps = 10000", "steps = 6"))
        self.call("run", scene, "--no-render", "--out", "source")
        (self.folder / "alone").mkdir()
        for name in ("checkpoint.nephos", "statistics.csv"):
            shutil.copy(self.folder / "source" / name, self.folder / "alone")
        branch = ["run", scene, "--no-render", "--set", "time.steps=12", "--from"]
        self.assertIn("has no manifest.json beside it", self.call(*branch, "alone", "--out", "b", status=3).stderr)
        (self.folder / "link").symlink_to("source/checkpoint.nephos")
        self.call(*branch, "link", "--out", "c")
        self.call(*branch, "source", "--out", "d")
        # What is beside the link itself comes first: a run whose checkpoint alone is elsewhere.
        shutil.copytree(self.folder / "source", self.folder / "apart")
        (self.folder / "apart/checkpoint.nephos").unlink()
        (self.folder / "apart/checkpoint.nephos").symlink_to("../alone/checkpoint.nephos")
        self.call(*branch, "apart/checkpoint.nephos", "--out", "e")
        # Of another run, or of none, it says nothing of the link.
        self.call("run", scene, "--no-render", "--seed", "9", "--out", "other")
        for name, content in (("other/from", None), ("web/from", "{}")):
            link = self.folder / name
            link.parent.mkdir(exist_ok=True)
            link.symlink_to("../source/checkpoint.nephos")
            if content:
                (link.parent / "manifest.json").write_text(content)
            self.call(*branch, name, "--out", "f" + name[0])
        self.assertEqual(len({(self.folder / name / "statistics.csv").read_bytes() for name in ("c", "d", "e", "fo", "fw")}), 1)

    def test_goes_on_without_the_other_run(self):
        self.begin()
        ways = [("--from", "source", *self.BRANCH), ("--from", "source/checkpoint.nephos", *self.BRANCH), ("--no-render",)]
        def all_go_on():
            for way in ways:
                with self.subTest(way):
                    self.goes_on(*way)
        all_go_on()
        self.call("run", self.scene, "--no-render", "--out", "source", "--set", "time.steps=20", "--resume")
        all_go_on()
        self.refused(2, "run", "--from", "source", *self.BRANCH, "--set", "field.background.act=0.5", "--out", "copy",
                     "--resume", says="`field.background.act` was 0.01, now 0.5")
        self.call("run", self.scene, "--no-render", "--out", "other", "--seed", 9)
        self.refused(2, "run", "--from", "other", *self.BRANCH, "--out", "copy", "--resume",
                     says="branched off source/checkpoint.nephos, not other")
        shutil.rmtree(self.folder / "source")
        all_go_on()
        self.refused(3, "run", "--from", "nowhere", *self.BRANCH, "--out", "copy", "--resume", says="nowhere: no such run")
        # Without a checkpoint of its own it needs the other run.
        (self.folder / "copy/checkpoint.nephos").unlink()
        self.refused(2, "run", "--no-render", "--out", "copy", "--resume", says="left no checkpoint of its own")

    def test_keys_that_follow_others_do_so_in_a_branch(self):
        scene = SOURCE / "scenes/rain.toml"  # whose layer has the common field
        small = ("--set", "frames.enabled=false")
        self.call("run", scene, *small, "--no-render", "--set", "time.steps=5", "--out", "source")
        branch = ("--from", "source", "--no-render", "--set", "time.steps=20")
        hashes = []
        for out, given in (("with", (scene, *small, "--set", "field.background.ext=0.5")), ("without", ("--set", "field.background.ext=0.5")),
                           ("same", ())):
            self.call("run", *given, *branch, "--out", out)
            hashes.append(rows_of(self.folder / out / "statistics.csv")[-1]["hash"])
        self.assertEqual(hashes[0], hashes[1])
        self.assertNotEqual(hashes[0], hashes[2])

    def test_frames_of_other_times(self):
        """Numbers go on from those of the other run; where that would leave out frames, or ask for some before the branch."""
        scene = self.write("tiny.toml", LONG.replace("steps = 10000", "steps = 20"))
        frames = ("--set", "frames.time_scale=10", "--set")  # 10 s each
        self.call("run", scene, "--no-render", *frames, "frames.count=5", "--set", "frames.start_s=50", "--out", "source")
        branch = ("run", "--from", "source", "--no-render", "--set", "time.steps=60", "--set")
        for more, says in ((("frames.start_s=300", "--set", "frames.count=3"), "frame 3 of the scene, at 320 s, is after"),
                           (("frames.start_s=250", "--set", "frames.count=30"), "frame 5 of the scene, at 290 s, is after"),
                           (("frames.start_s=100", "--set", "frames.count=30"), "frame 6 of the scene, at 150 s, is before")):
            self.refused(2, *branch, *more, "--out", "no", says=says)
            self.assertFalse((self.folder / "no").exists())
        self.call(*branch, "frames.start_s=160", "--set", "frames.count=8", "--out", "good")
        self.assertEqual(sorted(path.name for path in (self.folder / "good/density").iterdir()),
                         [f"tiny_{n:04}.vdb" for n in (6, 7, 8)])

    def test_a_large_seed_is_kept(self):
        seed = ("--seed", str(2**64 - 1))
        self.call("run", self.scene, *seed, "--no-render", "--out", "source")
        self.call("run", "--resume", "--no-render", "--out", "source")
        self.call("run", "--from", "source", "--no-render", "--set", "time.steps=9", "--out", "branch")
        self.call("run", self.scene, *seed, "--no-render", "--set", "time.steps=9", "--out", "whole")
        self.call("sweep", self.scene, "--set", "seed='0xffffffffffffffff'", "--replicates", "1", "--steps", "20", "--out", "sweep")
        self.call("merge", "sweep")
        # A manifest whose given keys cannot be read has the canonical text.
        manifest = self.folder / "source/manifest.json"
        manifest.write_text(manifest.read_text().replace('"scene_given": "', '"scene_given": "seed = -1\\n'))
        self.call("run", "--resume", "--no-render", "--out", "source")
        self.assertEqual(*((self.folder / name / "statistics.csv").read_bytes() for name in ("branch", "whole")))

    def test_a_run_goes_on_with_its_own_scene(self):
        self.call("run", self.scene, "--no-render", "--out", "whole")
        self.call("run", self.scene, "--no-render", "--out", "part", "--set", "time.steps=3")
        self.call("run", "--no-render", "--out", "part", "--set", "time.steps=6", "--resume")
        self.same_runs("whole", "part")
        self.call("run", self.scene, "--statistics-only", "--out", "table")  # complete, without a checkpoint
        self.assertIn("complete already", self.call("run", "--statistics-only", "--out", "table", "--resume").stderr)
        self.refused(2, "run", "--no-render", "--out", "none", "--resume", says="SCENE is missing")
        self.refused(2, "run", "--no-render", "--out", "part", says="SCENE is missing")

    def test_can_be_lengthened(self):
        """With frames of its own, and without where those of the scene were all written before it began."""
        for name, count in (("open", ()), ("fixed", ("--set", "frames.count=2"))):
            with self.subTest(name):
                self.call("run", self.scene, "--no-render", "--out", name, "--set", "time.steps=4", *count)
                branch = ("--from", name, "--no-render", "--set", "field.background.ext=0.06", *count)
                self.call("run", *branch, "--set", "time.steps=9", "--out", f"{name} long")
                self.call("run", *branch, "--set", "time.steps=6", "--out", f"{name} short")
                self.call("run", "--no-render", "--set", "time.steps=9", "--out", f"{name} short", "--resume")
                tables = [(self.folder / f"{name} {one}/statistics.csv").read_text() for one in ("long", "short")]
                self.assertEqual(*tables)
                self.assertIn("\n9,", tables[0])
                if not count:
                    self.same_runs(f"{name} long", f"{name} short")

    def test_can_be_lengthened_at_every_step(self):
        """Whatever its next frame is made of; also a branch off a branch, and one that had no frame yet."""
        self.call("run", self.scene, "--no-render", "--out", "from", "--set", "time.steps=3")
        branch = ("--no-render", "--set", "field.background.ext=0.06", "-q")
        self.call("run", "--from", "from", *branch, "--set", "time.steps=9", "--out", "whole")
        for steps in range(3, 9):
            with self.subTest(steps=steps):
                self.call("run", "--from", "from", *branch, "--set", f"time.steps={steps}", "--out", f"b{steps}")
                self.call("run", "--from", f"b{steps}", "--no-render", "--set", "time.steps=9", "-q", "--out", f"c{steps}")
                self.call("run", *branch[:1], "--set", "time.steps=9", "-q", "--out", f"b{steps}", "--resume")
                self.same_runs("whole", f"b{steps}")
        self.call("run", "--from", "from", "--splatting", "cpu", "--set", "time.steps=3", "-q", "--out", "d")
        self.assertFalse((self.folder / "d/frames").exists())
        self.call("run", "--splatting", "cpu", "--set", "time.steps=9", "-q", "--out", "d", "--resume")
        self.assertTrue((self.folder / "d/frames").exists())
        self.call("verify", "d")

    def test_files_that_are_links_keep_their_names(self):
        self.call("state", self.scene, "--steps", 4, "--out", "store.vdb")
        (self.folder / "in").mkdir()
        (self.folder / "in/state.vdb").symlink_to("../store.vdb")
        self.write("in/files.toml", SCENE.replace("[time]", 'initial_state = "state.vdb"\n[time]'))
        self.call("run", "in/files.toml", "--no-render", "--out", "run", "--set", "time.steps=3")
        (self.folder / "elsewhere").mkdir()
        subprocess.run([NEPHOS, "run", "--no-render", "--out", "../run", "--resume", "--set", "time.steps=6"],
                       cwd=self.folder / "elsewhere", check=True, env=self.environment, stdout=subprocess.DEVNULL)
        self.call("run", "in/files.toml", "--no-render", "--out", "whole")
        self.assertEqual((self.folder / "run/statistics.csv").read_text(), (self.folder / "whole/statistics.csv").read_text())

    def test_needs_no_state_and_finds_the_files_of_the_scene(self):
        """Called in another folder than the run that it branches off, whose initial state is gone."""
        self.call("run", self.scene, "--no-render", "--out", "in/grids", "--set", "time.steps=3")
        shutil.copy(self.folder / "in/grids/density/tiny_0002.vdb", self.folder / "in/p.vdb")
        self.call("state", self.scene, "--steps", 4, "--out", "in/state.vdb")
        self.write("in/files.toml", SCENE.replace("[time]", 'initial_state = "state.vdb"\n[time]') +
                   '[[field.grids]]\nof = "ext"\nfile = "p.vdb"\ngrid = "density"\n')
        self.call("run", "in/files.toml", "--no-render", "--out", "source", "--set", "time.steps=3")
        self.call("run", "--from", "source", "--no-render", "--out", "here", "--set", "time.steps=6")
        self.call("run", "in/files.toml", "--no-render", "--out", "longer")
        (self.folder / "in/state.vdb").unlink()
        for name in ("in", "elsewhere"):
            (self.folder / name).mkdir(exist_ok=True)
            subprocess.run([NEPHOS, "run", "--from", "../source", "--no-render", "--out", f"../from {name}", "--set",
                            "time.steps=6"], cwd=self.folder / name, check=True, env=self.environment,
                           stdout=subprocess.DEVNULL)
        for name in ("here", "from in", "from elsewhere"):
            rows = (self.folder / name / "statistics.csv").read_text()
            self.assertEqual(rows, (self.folder / "longer/statistics.csv").read_text())
            self.call("verify", name, "--replay", 2)
        # No other file of that name is taken, wherever one is called.
        shutil.copy(self.folder / "in/grids/density/tiny_0003.vdb", self.folder / "elsewhere/p.vdb")
        subprocess.run([NEPHOS, "run", "--from", "../from elsewhere", "--no-render", "--out", "../twig",
                        "--set", "time.steps=6"], cwd=self.folder / "elsewhere", check=True, env=self.environment,
                       stdout=subprocess.DEVNULL)
        self.assertEqual((self.folder / "twig/statistics.csv").read_text(), rows)


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


class Signals(Case):
    def setUp(self):
        super().setUp()
        self.long = self.write("long.toml", LONG)

    def start(self, *arguments):
        return subprocess.Popen([NEPHOS, *map(str, arguments)], cwd=self.folder, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True, env=self.environment)

    def wait_for(self, path):
        end = time.monotonic() + PATIENCE
        while not (self.folder / path).exists():
            self.assertLess(time.monotonic(), end, f"{path} never appeared")
            time.sleep(0.002)

    def interrupt(self, number, *arguments):
        """Starts a run, sends a signal when the first frame is there, and returns what it said."""
        process = self.start("run", *arguments)
        self.wait_for("stopped/density/long_0002.vdb")
        process.send_signal(number)
        output, errors = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 128 + number, errors)
        self.assertTrue((self.folder / "stopped/checkpoint.nephos").exists())
        return output, errors

    def test_the_first_signal_leaves_a_checkpoint(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
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
        _, errors = whole.communicate(timeout=PATIENCE)
        self.assertEqual(whole.returncode, 0, errors)
        self.interrupt(signal.SIGINT, self.long, *changes, "--out", "stopped")
        # Without --resume it is not thrown away.
        self.refused(2, "run", self.long, *changes, "--out", "stopped", says="--resume")
        # Stopped once more, while it is resumed.
        done = len(list((self.folder / "stopped/density").iterdir()))
        again = self.start("run", self.long, *changes, "--out", "stopped", "--resume")
        self.wait_for(f"stopped/density/long_{done + 2:04}.vdb")
        again.send_signal(signal.SIGTERM)
        again.communicate(timeout=PATIENCE)
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
        """While the run saves what the first one asks for, in the middle of which it is held here."""
        sanitizer = os.environ.get("LD_PRELOAD", "")
        self.environment |= {"LD_PRELOAD": f"{sanitizer} {os.environ['FAILING_CALLS']}".strip(), "FAIL_CALL": "rename HOLD 1 1",
                             "FAIL_PATH": "checkpoint.nephos", "FAIL_PROGRAM": "nephos", "FAIL_COUNT": str(self.folder / "held")}
        process = self.start("run", self.long, "--no-render", "--checkpoint-every", "100000", "--out", "stopped")
        self.wait_for("stopped/density/long_0002.vdb")
        process.send_signal(signal.SIGINT)
        self.wait_for("held")
        time.sleep(0.4)  # what comes sooner is the same key
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130)
        self.assertFalse((self.folder / "stopped/checkpoint.nephos").exists())

    def test_a_signal_that_comes_twice_is_one(self):
        # As from the terminal and from a program between, like timeout.
        process = self.start("run", self.long, "--no-render", "--out", "stopped")
        self.wait_for("stopped/density/long_0002.vdb")
        for _ in range(3):
            process.send_signal(signal.SIGINT)
            time.sleep(0.02)
        process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130)
        self.assertTrue((self.folder / "stopped/checkpoint.nephos").exists())

    def test_two_runs_do_not_share_a_folder(self):
        process = self.start("run", self.long, "--no-render", "--out", "stopped")
        self.wait_for("stopped/density/long_0002.vdb")
        for more in ([], ["--overwrite"]):
            self.refused(3, "run", self.long, "--no-render", "--out", "stopped", *more, says="another run")
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=PATIENCE)
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
        process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 130)


if __name__ == "__main__":
    unittest.main(verbosity=2)
