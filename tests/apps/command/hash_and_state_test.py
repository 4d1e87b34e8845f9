# SPDX-License-Identifier: Apache-2.0
"""`nephos hash` and `nephos state`."""

import json
import os
import pathlib
import shutil
import unittest

from case import Case, LAYERED, rows_of, SCENE, SOURCE, unsealed, voxels


class Hash(Case):
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

    def test_a_staggered_wind_is_that_of_the_centres(self):
        """Components on the low faces of voxels, as fluid solvers have them: at a centre, the mean of both faces."""
        import numpy
        import pyopenvdb
        faces = numpy.random.default_rng(3).normal(0, 9, (9, 8, 6, 3)).astype("f4")
        centres = faces.copy()
        for axis in range(3):
            low, high = ([slice(None)] * 3 + [axis] for _ in range(2))
            low[axis], high[axis] = slice(None, -1), slice(1, None)
            centres[tuple(low)] = (faces[tuple(low)].astype("f8") + faces[tuple(high)]) / 2
        for name, values, kind in (("faces", faces, pyopenvdb.GridClass.STAGGERED), ("centres", centres, pyopenvdb.GridClass.UNKNOWN),
                                   ("other", faces, pyopenvdb.GridClass.UNKNOWN)):
            wind = pyopenvdb.Vec3SGrid()
            wind.copyFromArray(values)
            wind.name, wind.gridClass, wind.transform = "vel", kind, pyopenvdb.createLinearTransform(voxelSize=200)
            pyopenvdb.write(str(self.folder / f"{name}.vdb"), [wind])
        hashes = [self.hashes(self.scene, "--steps", "12", "--set", f'wind_field=[{{kind="grid",files="{name}.vdb"}}]') for name in ("faces", "centres", "other")]
        self.assertEqual(hashes[0], hashes[1])
        self.assertNotEqual(hashes[0], hashes[2])

    def test_check_compares(self):
        self.write("golden.txt", "# comment\n" + self.hashes(self.scene, "--steps", "4"))
        self.call("hash", self.scene, "--steps", "4", "--check", "golden.txt")
        self.refused(1, "hash", self.scene, "--steps", "4", "--check", "golden.txt", "--seed", "9", says="step 0")
        self.refused(1, "hash", self.scene, "--steps", "5", "--check", "golden.txt", says="step 5")
        self.refused(1, "hash", self.scene, "--steps", "3", "--check", "golden.txt", says="4 steps")

    def test_what_is_compared_is_a_text_of_steps(self):
        lines = self.hashes(self.scene, "--steps", "4").splitlines()
        call = ("hash", self.scene, "--steps", "4", "--check", "golden.txt")
        (self.folder / "golden.txt").write_bytes("\r\n".join(lines + ["# " + "x" * 4000]).encode())
        self.call(*call)
        self.write("golden.txt", lines[0] + "\n" + "x" * 10_000_000)
        self.assertLess(len(self.refused(2, *call, says="golden.txt: line 2 has more than 4095 bytes: expected lines such as").stderr), 300)
        self.write("golden.txt", lines[0] + "\n" + "x" * 3000)
        self.assertLess(len(self.refused(1, *call, says="step 1 should be").stderr), 400)
        with open(self.folder / "golden.txt", "wb") as file:
            file.truncate(3 << 30)  # a hole
        self.refused(2, *call, says="golden.txt: line 1 has more than 4095 bytes")
        for end in (b"\0\n", b"\0", b"\0x\n"):
            (self.folder / "golden.txt").write_bytes(lines[0].encode() + end)
            self.refused(2, *call, says="golden.txt:1: holds a byte that no text has")


class State(Case):
    def test_what_is_read_is_not_replaced(self):
        text = pathlib.Path(self.scene).read_text()
        self.refused(2, "state", self.scene, "--steps", "1", "--out", os.path.relpath(self.scene, self.folder), says="is the file that is read")
        self.refused(2, "state", self.scene, "--layer", "low", "--out", "state.vdb", says="has no layers: leave out --layer 'low'")
        report = self.write("report.txt", "METAR LOWW 241250Z 30012KT 9999 FEW040 12/05 Q1020\n")
        self.refused(2, "metar", f"@{report}", "--scene", report, says="is the file that is read")
        self.assertEqual(pathlib.Path(self.scene).read_text(), text)
        self.assertIn("LOWW", pathlib.Path(report).read_text())

    def test_files_of_a_run_are_not_replaced(self):
        self.call("run", self.scene, "--no-render", "--out", "out", "-q")
        self.call("run", self.write("layered.toml", LAYERED), "--no-render", "--out", "layers", "-q")
        self.call("export", "out", "--to", "vdb", "--to", "slices", "-o", "exported", "-q")
        (self.folder / "link").symlink_to("out/density")
        folders = ("out", "layers", "exported")
        contents = lambda: {path: path.read_bytes() for name in folders for path in (self.folder / name).rglob("*") if path.is_file()}
        before = contents()
        report = "METAR LOWW 241250Z 30012KT 9999 FEW040 12/05 Q1020"
        for file in ("out/density/tiny_0002.vdb", "link/tiny_0002.vdb", "out/manifest.json", "out/statistics.csv", "out/checkpoint.nephos",
                     "layers/density/low/layered_0001.vdb", "exported/tiny_0002.vdb", "exported/export.json", "exported/tiny.volume.json"):
            says = f"{file}: is a file of the {'export' if file.startswith('exported') else 'run'} in "
            self.assertTrue((self.folder / file).is_file(), file)
            self.refused(2, "state", self.scene, "--steps", "1", "--out", file, says=says)
            self.refused(2, "metar", report, "-o", file, "--overwrite", says=says)
        self.refused(2, "render", "out/density/tiny_0003.vdb", "--out", "exported/tiny_0002.png", "--splatting", "cpu",
                     says="exported/tiny_0002.png: is a file of the export in ")
        self.assertEqual(contents(), before)
        self.refused(2, "state", self.scene, "--steps", "1000000000", "--out", "x.vdb/", says="x.vdb/: is the name of a folder")
        self.assertFalse((self.folder / "x.vdb").exists())
        # From inside of a run that is not complete.
        shutil.copytree(self.folder / "out", self.folder / "bare")
        manifest = self.folder / "bare/manifest.json"
        manifest.write_text(unsealed({**json.loads(manifest.read_text()), "complete": False, "frames": []}))
        (self.folder / "bare/density/own.vdb").symlink_to("tiny_0002.vdb")
        for folder, file in (("density", "tiny_0002.vdb"), ("density", "./tiny_0002.vdb"), ("density", "own.vdb"), (".", "statistics.csv")):
            self.refused(2, "state", self.scene, "--steps", "1", "--out", file, cwd=self.folder / "bare" / folder, says=f"{file}: is a file of the run in ")
        # Folders and files that the user has put elsewhere.
        (self.folder / "disk").mkdir()
        shutil.move(self.folder / "out/density", self.folder / "disk/density")
        (self.folder / "out/density").symlink_to("../disk/density")
        shutil.move(self.folder / "exported/tiny_0002.vdb", self.folder / "disk/away.vdb")
        (self.folder / "exported/tiny_0002.vdb").symlink_to("../disk/away.vdb")
        # Links to what links lead on from, and ".." behind a link.
        (self.folder / "links").mkdir()
        for name, target in (("chain.vdb", "../exported/tiny_0002.vdb"), ("frame.vdb", "../out/density/tiny_0002.vdb"), ("density", "../out/density"),
                             ("out", "../out"), ("again.vdb", "chain.vdb"), ("whole.vdb", self.folder / "out/density/tiny_0002.vdb")):
            (self.folder / "links" / name).symlink_to(target)
        for file in ("out/density/tiny_0002.vdb", "exported/tiny_0002.vdb", "links/chain.vdb", "links/frame.vdb", "links/density/tiny_0002.vdb",
                     "links/out/../out/density/tiny_0002.vdb", "links/again.vdb", "links/whole.vdb"):
            self.refused(2, "state", self.scene, "--steps", "1", "--out", file, says=f"{file}: is a file of the ")
        # A frame that is written, and not listed yet.
        manifest = self.folder / "out/manifest.json"
        text = manifest.read_text()
        manifest.write_text(unsealed({**json.loads(text), "complete": False, "frames": []}))
        self.refused(2, "state", self.scene, "--steps", "1", "--out", "out/density/tiny_0002.vdb", says="is a file of the run in ")
        for file in ("links/frame.vdb", "links/density/tiny_0002.vdb"):
            self.refused(2, "state", self.scene, "--steps", "1", "--out", file, says="is a file of the run in ")
        (self.folder / "out/mine").mkdir()
        for file in ("out/mine/tiny_0002.vdb", "out/density/tiny_0100.vdb"):  # no frame of it
            for _ in range(2):
                self.call("state", self.scene, "--steps", "1", "-q", "--out", file)
            (self.folder / file).unlink()
        manifest.write_text(text)
        for _ in range(2):  # what the run does not list may be replaced
            self.call("state", self.scene, "--steps", "1", "--out", "out/density/state.vdb", "-q")
            self.call("render", "out/density/tiny_0003.vdb", "--out", "out/picture.png", "--splatting", "cpu", "--size", "32x24", "-q")
        (self.folder / "out/manifest.json").write_text("{")
        self.call("state", self.scene, "--steps", "1", "--out", "out/density/tiny_0002.vdb", "-q")

    def test_a_scene_that_was_tuned_is_kept(self):
        """The scene of a report is written over itself alone, unless the call says so."""
        call = ("metar", "METAR LOWW 241250Z 30012KT 9999 FEW040 12/05 Q1020", "-o", "sky.toml", "-q")
        self.call(*call)
        scene = self.folder / "sky.toml"
        made = scene.read_text()
        self.call(*call)
        for text in (made.replace("seed", "# mine\nseed", 1), made + "\n", made[:-1], "", "mine"):
            scene.write_text(text)
            self.refused(2, *call, says="sky.toml: is there, and is not the scene of this command")
            self.refused(2, *call, "--run", "--no-render", "--out", "run", says="is not the scene of this command")
            self.assertEqual(scene.read_text(), text)
        self.assertFalse((self.folder / "run").exists())
        self.call(*call, "--overwrite")
        self.assertEqual(scene.read_text(), made)
        self.refused(2, *call[:2], "--overwrite", says="--overwrite requires --scene or --run")
        for more in (("-o", "new.toml"), ("--run",)):
            self.refused(2, *call[:2], "--explain", *more, says="--explain only tells")
        self.assertFalse((self.folder / "new.toml").exists())

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
                            ["state", self.scene, "--from", "state.vdb", "--out", "next.vdb"]):
                with self.subTest(setting=setting, command=command):
                    result = self.refused(3, *command, "--set", setting, says="state.vdb")
                    self.assertIn(says, result.stderr)
            for command in (["run", "--no-render", "--out", "out"], ["validate"]):
                with self.subTest(setting=setting, command=command):
                    result = self.call(command[0], scene, *command[1:], "--set", setting, status=3)
                    self.assertRegex(result.stderr, r"from\.toml:4:17: error: `lattice\.initial_state`: .*state\.vdb")
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
        self.refused(2, "run", scene, "--no-render", "--out", "out", "--resume", says="the initial state differs")
        self.refused(2, "run", scene, "--no-render", "--out", "out", says="another content of state.vdb of `lattice.initial_state`")
        self.call("run", scene, "--no-render", "--out", "out", "--overwrite")
        again = json.loads((self.folder / "out/manifest.json").read_text())
        self.assertNotEqual(manifest["scene"]["simulation_hash"], again["scene"]["simulation_hash"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
