# SPDX-License-Identifier: Apache-2.0
"""Runs whose files are damaged, missing or strange, and what `nephos verify` says of them."""

import json
import os
import shutil
import subprocess
import unittest

from case import Case, NEPHOS, SANITIZED, SCENE, SOURCE, unsealed

PLACED = SCENE + """\
[georeference]
latitude_deg = 51.4775
longitude_deg = -0.4614
height_m = 25
geoid_height_m = 45.5
heading_deg = 30
start_utc = "2024-06-21T13:50:00Z"
"""

LAYERED = """\
seed = 5
[density]
write_velocity = true
velocity_name = "velocity"
[frames]
per_second = 1
time_scale = 10
[time]
steps = 2
[[wind]]
levels = [{ height_m = 0, from_deg = 270, speed_m_per_s = 5 }, { height_m = 2000, from_deg = 270, speed_m_per_s = 15 }]
[[layer]]
name = "low"
lattice = { cells = [24, 24, 6], cell_size_m = 50, origin_m = [0, 0, 300] }
[layer.veil]
form = "stratus"
base_m = 350
top_m = 550
margin_m = 0
[[layer]]
name = "high"
lattice = { cells = [24, 24, 6], cell_size_m = 50, origin_m = [0, 0, 900] }
[layer.veil]
form = "cumulus"
base_m = 950
top_m = 1150
margin_m = 0
"""

# A veil with hard edges.
HARD = """\
[frames]
count = 2
[time]
step_s = 10
steps = 60
[[layer]]
name = "A"
lattice = { cells = [128, 128, 12], cell_size_m = 80, origin_m = [0, 0, 8000] }
[layer.veil]
form = "stratus"
octaves = 2
wavelength_m = 5120
coverage = 0.5
softness = 0.05
margin_m = 0
base_m = 8000
top_m = 9000
"""

# Two layers of automata in one box: clouds grow in that of the second name, and nothing in the other.
PAIR = """\
seed = 3
[lattice]
cells = [32, 24, 12]
[time]
steps = 6
[frames]
per_second = 1
time_scale = 15
[[sky]]
name = "clear"
state = 0
clouds = 0
[[layer]]
name = "EMPTY"
skies = "clear"
base_height_m = 0
background = { hum = 0.0, act = 0.0, ext = 0.05 }
[[layer]]
name = "CLOUDY"
skies = "clear"
base_height_m = 0
background = { hum = 0.15, act = 0.01, ext = 0.05 }
"""


class Verify(Case):
    def checks(self, *arguments, status=0):
        """The checks by their name."""
        result = self.call("verify", *arguments, "--json", status=status)
        report = json.loads(result.stdout)
        self.assertEqual(report["passed"], status == 0)
        return {check["name"]: check for check in report["checks"]}

    def failed(self, *arguments):
        return sorted(name for name, check in self.checks(*arguments, status=1).items() if not check["passed"])

    def test_a_run_is_what_it_says(self):
        self.call("run", self.scene, "--out", "out", "--set", "frames.exr=true")
        checks = self.checks("out", "--replay", 2)
        self.assertEqual({"list", "frames", "files", "hashes", "voxels", "values", "geometry", "metadata", "seam", "motion", "replay"},
                         set(checks))
        self.assertGreater(checks["motion"]["figures"]["largest_change"], 0)
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        for frame in manifest["frames"]:
            self.assertEqual([pathname.split("/")[0] for pathname in (f["path"] for f in frame["files"])],
                             ["density", "frames", "frames"])
            for file in frame["files"]:
                self.assertEqual((self.folder / "out" / file["path"]).stat().st_size, file["bytes"])
        self.assertEqual([f["path"] for f in manifest["run_files"]], ["statistics.csv", "checkpoint.nephos"])

    def test_refined_files_of_dense_cloud(self):
        """Whose thermals make them denser than 1."""
        dense = self.write("dense.toml", "seed = 5\n[lattice]\ncells = [24, 24, 16]\n[time]\nsteps = 16\n[frames]\nstart_s = 120\ncount = 2\n[field]\n"
                           "background = { hum = 0.3, act = 0.03, ext = 0.02 }\n[density]\nrefine = 2\n")
        self.call("run", dense, "--no-render", "--out", "dense")
        largest = float(self.checks("dense")["values"]["detail"].split("to ")[1])
        self.assertTrue(1 < largest <= 1.5, largest)
        self.call("run", dense, "--no-render", "--set", "detail.enabled=false", "--out", "smooth")
        self.assertLessEqual(float(self.checks("smooth")["values"]["detail"].split("to ")[1]), 1)

    @unittest.skipUnless(shutil.which("strace"), "strace is not installed")
    @unittest.skipIf(SANITIZED, "readers are not confined with sanitizers")
    def test_what_cannot_be_read_is_not_false(self):
        """Neither a reader that the system refuses nor one that it gives no memory says anything of a file."""
        self.call("run", self.scene, "--no-render", "--out", "out")
        self.call("export", "out", "--to", "raw", "--to", "vdb", "-o", "volumes")
        for folder in ("out", "volumes"):
            said = subprocess.run(["strace", "-f", "-qq", "-e", "trace=seccomp", "-e", "inject=seccomp:error=EINVAL", "-o", "/dev/null",
                                   NEPHOS, "verify", folder, "-j1"], cwd=self.folder, env=self.environment, capture_output=True, text=True)
            self.assertEqual(said.returncode, 3, said.stdout + said.stderr)
            self.assertIn("cannot be confined", said.stdout + said.stderr)
            self.assertNotIn("0 density files", said.stdout)

    def test_what_was_not_read_does_not_agree(self):
        """Bytes that nobody compared are no part of those that agree."""
        self.call("run", self.scene, "--no-render", "--out", "out")
        listed = self.checks("out", "--hashes")["hashes"]["detail"]
        self.assertRegex(listed, r"^\d+ bytes agree with")
        files = int(self.checks("out", "--hashes")["files"]["detail"].split()[0])
        failing = {"LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": "read EIO 1 1000000"}
        for path, compared in (("statistics.csv", files - 1), (".", 0)):
            report = json.loads(self.call("verify", "out", "--hashes", "--json", status=3, env={**failing, "FAIL_PATH": path}).stdout or
                                '{"checks": []}')
            checks = {check["name"]: check for check in report["checks"]}
            if compared:
                bytes_of_table = (self.folder / "out/statistics.csv").stat().st_size
                self.assertEqual(checks["hashes"]["detail"], f"{int(listed.split()[0]) - bytes_of_table} bytes of {compared} of the files agree "
                                 "with their checksums")
            self.assertNotIn("bytes agree", json.dumps(report))

    def test_what_is_missing_does_not_agree(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        whole = int(self.checks("out", "--hashes")["hashes"]["detail"].split()[0])
        gone = sorted((self.folder / "out/density").glob("*.vdb"))[0]
        size = gone.stat().st_size
        gone.unlink()
        self.assertRegex(self.checks("out", "--hashes", status=1)["hashes"]["detail"], rf"^{whole - size} bytes of \d+ of the files agree")

    def test_what_is_asked_for_is_done(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        self.call("export", "out", "--to", "raw", "-o", "volumes")
        self.call("run", self.scene, "--statistics-only", "--out", "alone")
        for option in (["--seam"], ["--max-change", "0"]):
            self.refused(2, "verify", "out", "--hashes", *option, says="--hashes decodes nothing")
            self.refused(2, "verify", "volumes", *option, says="is an export")
            self.call("verify", "alone", *option, status=3)
        self.call("verify", "alone", "--replay", 1, status=3)

    def test_checksums_are_those_of_xxhash(self):
        import xxhash
        self.call("run", self.scene, "--no-render", "--out", "out")
        for frame in json.loads((self.folder / "out/manifest.json").read_text())["frames"]:
            for file in frame["files"]:
                content = (self.folder / "out" / file["path"]).read_bytes()
                self.assertEqual(xxhash.xxh3_128_hexdigest(content), file["xxh3"])

    def test_three_bytes_inside_the_voxels(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        file = self.folder / "out/density/tiny_0003.vdb"
        content = bytearray(file.read_bytes())
        for at in (len(content) // 2, len(content) // 2 + 100, len(content) // 2 + 200):
            content[at] ^= 0x55
        file.write_bytes(content)
        self.assertIn("hashes", self.failed("out"))
        self.assertEqual(self.failed("out", "--hashes"), ["hashes"])
        self.assertIn("tiny_0003.vdb", self.call("verify", "out", "--hashes", status=1).stdout)

    def test_missing_extra_and_truncated_files(self):
        self.call("run", self.scene, "--no-render", "--out", "whole")
        def damaged(change):
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            shutil.copytree(self.folder / "whole", self.folder / "out")
            change(self.folder / "out")
            return self.failed("out")
        self.assertIn("files", damaged(lambda out: (out / "density/tiny_0002.vdb").unlink()))
        self.assertEqual(["files"], damaged(lambda out: shutil.copy(out / "density/tiny_0002.vdb", out / "density/tiny_0099.vdb")))
        self.assertEqual(["hashes", "voxels"], damaged(lambda out: (out / "density/tiny_0002.vdb").write_bytes(
            (out / "density/tiny_0002.vdb").read_bytes()[:-50])))
        self.assertEqual(["hashes"], damaged(lambda out: (out / "statistics.csv").write_text("step\n")))
        # One frame in the place of another.
        self.assertIn("metadata", damaged(lambda out: shutil.copy(out / "density/tiny_0001.vdb", out / "density/tiny_0002.vdb")))

        def forget(out):
            manifest = json.loads((out / "manifest.json").read_text())
            del manifest["frames"][2]
            (out / "manifest.json").write_text(unsealed(manifest))
        self.assertEqual(["files", "frames"], damaged(forget))

        def promise(out):
            manifest = json.loads((out / "manifest.json").read_text())
            manifest["range"]["last_frame"] = 900_000
            (out / "manifest.json").write_text(unsealed(manifest))
        self.assertIn("frames", damaged(promise))
        frames = json.loads((self.folder / "whole/manifest.json").read_text())["frames"]
        self.assertIn(f"frames {frames[-1]['number'] + 1} to 900000 are missing", self.call("verify", "out", status=1).stdout)

        def lie(out):
            manifest = json.loads((out / "manifest.json").read_text())
            manifest["frames"][1]["state_hash"] = "0" * 32
            (out / "manifest.json").write_text(unsealed(manifest))
        self.assertEqual(["metadata"], damaged(lie))
        self.assertIn("replay", self.failed("out", "--replay", 3))

    def test_the_list_itself(self):
        """No field of it is changed, left out or put in unnoticed."""
        import xxhash
        self.call("run", self.scene, "--no-render", "--out", "out")
        self.call("export", "out", "--to", "raw", "-o", "exported")
        for name in ("out/manifest.json", "exported/export.json"):
            folder, file = name.split("/")
            path = self.folder / name
            whole = path.read_text()
            self.assertEqual(xxhash.xxh3_128_hexdigest(whole[:whole.rindex(',\n  "xxh3"')].encode()), json.loads(whole)["xxh3"])
            self.assertEqual(self.checks(folder)["list"]["detail"], f"{file} is as it was written")
            listing = json.loads(whole)
            def edited(key, value):
                return json.dumps({**listing, key: value}, indent=2) + "\n"
            changed = [whole + "\n", whole.replace("  ", " ", 1), whole.replace('"xxh3": "', '"xxh3":  "'), json.dumps(listing),
                       whole[:-44] + chr(ord(whole[-44]) ^ 1) + whole[-43:], '{"a": [], ' + whole[1:-50] + whole[-50:].replace('"xxh3"', '"xxg3"'),
                       edited("xxh3", "0" * 32), edited("note", "mine"), edited("nephos_version", "9.9")]
            if file == "manifest.json":
                changed += [edited("run_files", listing["run_files"][:-1]), edited("bounds", {}),
                            edited("frames", [{**frame, "step": frame["step"] + 1} for frame in listing["frames"]])]
            for text in changed:
                self.assertNotEqual(text, whole)
                path.write_text(text)
                self.assertIn("list", self.failed(folder), text[-200:])
            path.write_text(unsealed(listing))
            self.assertEqual(self.checks(folder)["list"]["detail"], f"{file}, of an earlier version, has no checksum")

    def test_what_follows_a_list(self):
        """A byte of 0 is the end of the text to many parsers; and a file may have a hole of gigabytes."""
        self.call("run", self.scene, "--no-render", "--out", "out")
        self.call("export", "out", "--to", "raw", "-o", "exported")
        for name in ("out/manifest.json", "exported/export.json"):
            path = self.folder / name
            whole = path.read_bytes()
            for tail in (b"\0 this is no JSON {{{", b"\0" * 100, b"x"):
                path.write_bytes(whole + tail)
                self.refused(3, "verify", name.split("/")[0], says=f"{name}: is no JSON, or is damaged: line")
            with open(path, "ab") as file:
                file.truncate(3 << 30)
            self.refused(3, "verify", name.split("/")[0], says=f"{name}: is no JSON, or is damaged: line")
            path.write_bytes(whole)

    def test_against_runs_of_statistics_alone(self):
        for name, seed in (("a", 1), ("b", 1), ("c", 9)):
            self.call("run", self.scene, "--statistics-only", "--seed", seed, "--out", name)
        self.call("run", self.scene, "--statistics-only", "--seed", 1, "--set", "time.steps=4", "--out", "short")
        self.assertEqual(self.checks("a", "--against", "b")["against"]["detail"], "b: by tables and manifests the same states in 7 steps and the same voxels in 0 files")
        self.assertEqual(self.checks("a")["frames"]["detail"], "of statistics alone")
        self.assertEqual(self.failed("a", "--against", "c"), ["against"])
        self.assertIn("it has 5 steps, not 7", self.call("verify", "a", "--against", "short", status=1).stdout)

    def test_specks_are_no_seam(self):
        """Of a tile whose only clouds have just formed, a few voxels thick, at its edge."""
        tile = (SOURCE / "scenes/tile.toml").read_text().replace("genera/Cu.toml", str(SOURCE / "scenes/genera/Cu.toml"))
        tile = tile[:tile.index('[[layer]]\nname = "Ci"')] + tile[tile.index("[density]"):]
        tile = tile.replace("[256, 256, 32], cell_size_m = 40", "[64, 64, 32], cell_size_m = 160").replace("clouds = 45", "clouds = 2")
        few = ("--no-render", "--seed", 281797, "--set", "frames={count=1, start_s=300}")
        self.call("run", self.write("specks.toml", tile), *few, "--out", "out")
        figures = self.checks("out", "--seam")["seam"]["figures"]
        self.assertGreater(max(figures["x_limit"], figures["y_limit"]), 0)  # they lie over it
        # Grown, and cut where the wind takes them out of the box.
        self.call("run", self.write("cut.toml", tile.replace("tile = true\n", "").replace("clouds = 2", "clouds = 45")), "--no-render",
                  "--set", "frames={count=2, start_s=900}", "--out", "cut")
        self.assertEqual(self.failed("cut", "--seam"), ["seam"])

    def test_a_cut_of_hard_edges(self):
        """In a veil whose edges are as sharp as a voxel steps break everywhere, and a cut shows all the same."""
        scene = self.write("hard.toml", HARD)
        for seed in (1, 2):
            self.call("run", scene, "--no-render", "--seed", seed, "--set", "tile=true", "--out", f"tile{seed}")
            self.checks(f"tile{seed}", "--seam")
            self.call("run", scene, "--no-render", "--seed", seed, "--out", f"cut{seed}")
            self.assertEqual(self.failed(f"cut{seed}", "--seam"), ["seam"])

    def test_the_seam_of_every_frame(self):
        """One that shows in frames before the last is a failure."""
        self.call("run", self.scene, "--no-render", "--out", "out", "--frames", "1..4", "--set", "time.steps=12",
                  "--set", "field.background.ext=0.9", "--set", "field.background.hum=0.02")
        self.assertEqual(self.failed("out", "--seam"), ["seam"])
        self.assertRegex(self.checks("out", "--seam", status=1)["seam"]["detail"],
                         r"^x: break of [\d.]+ at the seam, .* \(the seam shows\); y: .*; the mean of 4 density files$")
        self.call("run", self.scene, "--no-render", "--out", "periodic", "--set", 'lattice.boundaries=["periodic", "periodic", "open"]')
        self.assertRegex(self.checks("periodic")["seam"]["detail"], r"^x: break of [\de.-]+ at the seam, .*; y: break of [\de.-]+ at the seam, .*; of frame 5$")

    def test_each_layer_where_there_is_no_file_of_all(self):
        """The worst layer counts, and not the one whose folder comes first."""
        for empty, cloudy in (("a", "b"), ("b", "a")):
            with self.subTest(empty=empty):
                scene = self.write("pair.toml", PAIR.replace("EMPTY", empty).replace("CLOUDY", cloudy))
                self.call("run", scene, "--no-render", "--out", "out", "--overwrite", "--set", "density.combined=false")
                self.assertEqual(self.failed("out", "--seam", "--max-change", 0.05), ["motion", "seam"])
                checks = self.checks("out", "--seam", "--max-change", 0.05, status=1)
                self.assertRegex(checks["seam"]["detail"], rf"^x: break of [\d.]+ at the seam of layer {cloudy}, .*\(the seam shows\)")
                self.assertIn(f"largest change of a voxel of layer {cloudy} ", checks["motion"]["detail"])
                self.assertGreater(self.checks("out")["motion"]["figures"]["largest_change"], 0.05)
                # What was not read of a layer is said.
                for file in (self.folder / "out/density" / cloudy).glob("*.vdb"):
                    file.write_text("damaged")
                detail = self.checks("out", "--max-change", 0.05, status=1)["motion"]["detail"]
                self.assertEqual(detail, f"layer {cloudy}: no density file could be read")

    def test_frames_beside_a_damaged_one(self):
        """They do not follow each other, and no file of a layer stands in for that of all."""
        def changed(folder):
            return self.checks(folder, status=1)["motion"]["figures"]["largest_change"]
        self.call("run", self.scene, "--no-render", "--out", "out")
        largest = self.checks("out")["motion"]["figures"]["largest_change"]
        (self.folder / "out/density/tiny_0003.vdb").write_text("damaged")
        self.assertTrue(0 < changed("out") <= largest, changed("out"))
        scene = self.write("pair.toml", PAIR.replace("EMPTY", "a").replace("CLOUDY", "b"))
        self.call("run", scene, "--no-render", "--out", "pair")
        largest = self.checks("pair")["motion"]["figures"]["largest_change"]
        shutil.copytree(self.folder / "pair", self.folder / "layer")
        (self.folder / "layer/density/b/pair_0003.vdb").write_text("damaged")
        self.assertEqual(changed("layer"), largest)  # that of all is whole
        (self.folder / "pair/density/pair_0005.vdb").write_text("damaged")
        self.assertTrue(0 < changed("pair") <= largest, changed("pair"))
        self.assertEqual(self.failed("pair", "--seam"), ["hashes", "seam", "voxels"])
        # Nor do those beside one that the list has lost.
        self.call("run", self.scene, "--no-render", "--out", "lost")
        largest = self.checks("lost")["motion"]["figures"]["largest_change"]
        path = self.folder / "lost/manifest.json"
        manifest = json.loads(path.read_text())
        del manifest["frames"][2]
        path.write_text(unsealed(manifest))
        self.assertTrue(0 < changed("lost") <= largest, changed("lost"))

    def test_frames_of_which_none_are_compared(self):
        """A single one, and such that cannot be read: nothing is said to agree."""
        self.call("run", self.scene, "--no-render", "--out", "one", "--frames", "2..2")
        motion = self.checks("one")["motion"]
        self.assertEqual((motion["detail"], motion.get("figures")), ("not compared: there is a single frame", None))
        self.assertIn("the check `motion` could not be done", self.call("verify", "one", "--max-change", 0, status=3).stderr)
        self.call("run", self.scene, "--no-render", "--out", "out")
        files = sorted((self.folder / "out/density").glob("*.vdb"))
        for file in files[1::2]:
            file.write_text("damaged")
        self.assertEqual(self.checks("out", "--max-change", 0, status=1)["motion"]["detail"],
                         "not compared: no two frames that follow each other could be read")
        for file in files:
            file.write_text("damaged")
        checks = self.checks("out", "--seam", "--max-change", 0, status=1)
        for name in ("seam", "motion"):
            self.assertEqual((checks[name]["done"], checks[name]["detail"]), (False, "no density file could be read"))
        self.assertEqual(set(self.checks("out", status=1)), {"list", "frames", "files", "hashes", "voxels"})

    def test_impossible_numbers_and_paths_of_a_manifest(self):
        self.call("run", self.scene, "--no-render", "--out", "whole")
        whole = json.loads((self.folder / "whole/manifest.json").read_text())
        def refused(change, says):
            manifest = json.loads(json.dumps(whole))
            change(manifest)
            (self.folder / "whole/manifest.json").write_text(unsealed(manifest))
            self.assertIn(says, self.call("verify", "whole", status=3).stderr)
        for number in (2147483647, -2147483648, 10**18, 2**64 - 1, 1e300, 1.5):
            refused(lambda m: m["range"].update(last_frame=number), f"whole/manifest.json: the frame's number {number}"[:60])
            refused(lambda m: m["frames"][1].update(number=number), "the frame's number")
        for step in (-1, 2**64 - 1, 1.5):
            refused(lambda m: m["frames"][1].update(step=step), f"whole/manifest.json: the step {step} of a frame"[:60])
        for path in ("../secret", "/etc/hostname", "density/../../secret", ""):
            refused(lambda m: m["frames"][1]["files"][0].update(path=path), "which is none of its folder")
        long = "../" + "x\u001b[2J" * 100_000
        refused(lambda m: m["frames"][1]["files"][0].update(path=long), "which is none of its folder")
        self.assertLess(len(self.call("verify", "whole", status=3).stderr), 300)
        for deep, says in (('{"a":' * 200_000 + "1" + "}" * 200_000, "is nested too deeply"),
                           ("[" * 200_000 + "]" * 200_000, "is not a manifest")):
            (self.folder / "whole/manifest.json").write_text('{"x":' + deep + ',"b":0}')
            self.assertIn(f"whole/manifest.json: {says}", self.call("verify", "whole", status=3).stderr)

    def test_against_another_run(self):
        self.call("run", self.scene, "--no-render", "--out", "a")
        self.call("run", self.scene, "--no-render", "--out", "b", "--set", "frames.count=4")
        self.call("run", self.scene, "--no-render", "--out", "c", "--seed", 4)
        self.call("verify", "a", "--against", "a")
        self.assertEqual(self.failed("a", "--against", "b"), ["against"])
        self.assertEqual(self.failed("a", "--against", "c"), ["against"])
        self.assertEqual(self.failed("a", "--max-change", 0), ["motion"])
        self.assertIn("and the same voxels in 5 files", self.checks("a", "--against", "a")["against"]["detail"])
        # What the other manifest says counts where it is as it was written.
        path = self.folder / "b/manifest.json"
        path.write_bytes(path.read_bytes().replace(b'"time_s"', b'"time_S"'))
        self.assertIn("the bytes of its manifest.json are not those that were written",
                      self.call("verify", "a", "--against", "b", "--hashes", status=1).stdout)
        # Those of earlier versions have fewer checksums.
        manifest = json.loads((self.folder / "a/manifest.json").read_text())
        for key, says in (("voxels_xxh3", "density/tiny_0001.vdb: a manifest has no checksum of its voxels"),
                          ("files", "a manifest of an earlier version has no checksums")):
            shutil.rmtree(self.folder / "b")
            shutil.copytree(self.folder / "a", self.folder / "b")
            for frame in manifest["frames"]:
                frame.pop(key, None)
                for file in frame.get("files", []):
                    file.pop(key, None)
            (self.folder / "b/manifest.json").write_text(unsealed(manifest))
            for one, other in (("a", "b"), ("b", "a")):
                self.assertIn(says, self.call("verify", one, "--against", other, "--hashes", status=1).stdout)
        self.refused(2, "verify", "a", "--against", "nowhere", says="nowhere: is no folder of a run: it has no manifest.json")

    def test_against_a_run_with_other_files(self):
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "all")
        self.call("run", scene, "--no-render", "--out", "layers", "--set", "density.combined=false")
        files = len(list((self.folder / "all/density").rglob("*.vdb")))
        self.assertIn(f"the same voxels in {files} files", self.checks("all", "--against", "all")["against"]["detail"])
        self.assertIn("it has no density/layered_0001.vdb", self.call("verify", "all", "--against", "layers", status=1).stdout)
        self.assertIn("it has density/layered_0001.vdb besides", self.call("verify", "layers", "--against", "all", status=1).stdout)

    def test_against_a_run_of_other_frames(self):
        """As many frames, of the same states and steps: those that only one of the two has are no agreement."""
        for name, frames in (("a", "6..7"), ("b", "8..9"), ("c", "7..8")):
            self.call("run", self.scene, "--no-render", "--out", name, "--frames", frames, "--set", "frames.time_scale=2")
        for other, says in (("b", "it has no frame 6; it has no frame 7; it has frame 8 besides; and 1 more"),
                            ("c", "it has no frame 6; it has frame 8 besides")):
            self.assertEqual(self.failed("a", "--hashes", "--against", other), ["against"])
            self.assertEqual(self.checks("a", "--hashes", "--against", other, status=1)["against"]["detail"], says)
        self.assertIn("the same voxels in 2 files", self.checks("a", "--hashes", "--against", "a")["against"]["detail"])

    def test_the_folder_of_a_sweep(self):
        self.call("run", self.scene, "--no-render", "--out", "a")
        self.call("sweep", self.scene, "--axis", "field.background.act=0.01,0.02", "-r", 1, "--out", "sweep", "-q")
        self.refused(3, "verify", "sweep", says='sweep/manifest.json: is not a manifest of a run: it is that of a "nephos sweep"')
        self.refused(2, "verify", "a", "--hashes", "--against", "sweep",
                     says='sweep: is no folder of a run: its manifest.json is that of a "nephos sweep"')
        # A long name, and one for the terminal.
        self.write("strange/manifest.json", json.dumps({"format": "\u001b[2J" * 100_000}))
        for status, arguments in ((3, ["strange"]), (2, ["a", "--hashes", "--against", "strange"])):
            said = self.refused(status, "verify", *arguments, says="is that of a")
            self.assertLess(len(said.stderr), 400)
            self.assertNotIn("\u001b", said.stderr)
        # Nothing says that these are of something else: the run that they are of may be damaged.
        for text in ("{", "[]", "{}", '{"format": 5}'):
            self.write("strange/manifest.json", text)
            self.call("verify", "strange", status=3)
            self.assertEqual(self.failed("a", "--hashes", "--against", "strange"), ["against"])

    def test_a_run_that_was_resumed_into_more_steps(self):
        """Its files are, byte for byte, those of a run that had the steps from the start."""
        self.call("run", self.scene, "--out", "whole", "--set", "frames.exr=true")
        self.call("run", self.scene, "--out", "out", "--set", "frames.exr=true", "--set", "time.steps=3")
        self.call("run", self.scene, "--out", "out", "--set", "frames.exr=true", "--resume")
        self.checks("out")
        self.checks("out", "--against", "whole")
        names = [file["path"] for frame in json.loads((self.folder / "whole/manifest.json").read_text())["frames"]
                 for file in frame["files"]]
        self.assertGreater(len(names), 9)
        for name in names:
            self.assertEqual((self.folder / "whole" / name).read_bytes(), (self.folder / "out" / name).read_bytes(), name)

    def test_folders_that_are_no_runs(self):
        self.refused(3, "verify", ".", says="manifest.json")
        self.write("bad/manifest.json", "{}")
        self.refused(3, "verify", "bad", says="manifest.json")

    def test_forked_readers_call_nothing_of_onetbb(self):
        """Beside the threads of the command a lock of it may be held, for which they would wait for ever."""
        scene = self.write("layered.toml", LAYERED)
        library = os.environ["FAILING_CALLS"].replace("libfailing_calls.so", "libforked_calls.so")
        self.assertTrue(library.endswith("libforked_calls.so") and os.path.exists(library.split(":")[-1]), library)
        self.environment["LD_PRELOAD"] = library
        self.call("run", scene, "--no-render", "--out", "out")
        self.call("verify", "out", "--replay", 2)
        self.call("export", "out", "--to", "nvdb", "--to", "vdb", "--velocity", "wind", "-o", "volumes")
        self.call("verify", "volumes")
        self.call("info", "out/density/layered_0001.vdb")

    def test_layers_and_their_files(self):
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "out")
        self.assertIn("layers", self.checks("out"))
        shutil.copytree(self.folder / "out", self.folder / "lie")
        manifest = json.loads((self.folder / "lie/manifest.json").read_text())
        manifest["frames"][1]["state_hash"] = "0" * 32
        (self.folder / "lie/manifest.json").write_text(unsealed(manifest))
        self.assertEqual(["metadata"], self.failed("lie"))
        grids = json.loads(self.call("info", "out/density/layered_0001.vdb", "--json").stdout)["grids"]
        self.assertEqual([grid["name"] for grid in grids], ["density", "velocity"])
        for switch, left in (("per_layer", ["layered_0001.vdb"]), ("combined", ["high/layered_0001.vdb", "low/layered_0001.vdb"])):
            self.call("run", scene, "--no-render", "--out", switch, "--set", f"density.{switch}=false")
            folder = self.folder / switch / "density"
            self.assertEqual(left, sorted(str(p.relative_to(folder)) for p in folder.rglob("*_0001.vdb")))
            self.call("verify", switch)
        for changes, says in ((["density.per_layer=false", "density.combined=false"], "neither `density.per_layer`"),
                              (["density.velocity_name=cld"], "velocity_name")):
            overrides = [word for change in changes for word in ("--set", change)]
            self.assertIn(says, self.call("run", scene, *overrides, status=2).stderr)

    def test_layers_that_lie_far_apart(self):
        """Their common box has more voxels than are compared one by one, which is said, and asked for is no success."""
        scene = self.write("far.toml", LAYERED.replace("[0, 0, 900]", "[200000, 200000, 900]"))
        self.call("run", scene, "--no-render", "--out", "far")
        checks = self.checks("far")
        for name in ("layers", "seam", "motion"):
            self.assertRegex(checks[name]["detail"], r"not done: the box has \d+ voxels, of which at most 268435456 are compared")
        for arguments, name in ((["--max-change", "0.5"], "motion"), (["--seam"], "seam")):
            report = self.call("verify", "far", *arguments, status=3)
            self.assertIn(f"the check `{name}` could not be done", report.stderr)


class Replay(Case):
    """Frames simulated anew, of runs that take more than their scene's text."""

    def replay(self, folder, status=0, frames=3, **options):
        """The check, and all that the command says on stderr."""
        result = self.call("verify", folder, "--replay", frames, "--json", status=status, **options)
        checks = {check["name"]: check for check in json.loads(result.stdout)["checks"]}
        self.assertEqual([name for name, check in checks.items() if not check["passed"]], ["replay"] if status else [])
        self.assertEqual(checks["replay"]["done"], status != 3)
        return checks["replay"]["detail"], result.stderr

    def state(self, path, steps):
        self.call("state", self.scene, "--steps", steps, "--out", path)

    def test_says_which_voxels_it_compares(self):
        """Those of each file that is not refined, of layers too."""
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "out")
        path = self.folder / "out/manifest.json"
        whole = json.loads(path.read_text())
        for file in whole["frames"][1]["files"]:
            with self.subTest(file["path"]):
                manifest = json.loads(json.dumps(whole))
                for other in manifest["frames"][1]["files"]:
                    if other["path"] == file["path"]:
                        other["voxels_xxh3"] = "0" * 32
                path.write_text(unsealed(manifest))
                self.assertIn(f"{file['path']}: other voxels", self.call("verify", "out", "--hashes", "--replay", 2, status=1).stdout)
        path.write_text(unsealed(whole))
        self.assertIn("2 frames simulated anew have the same states, and 6 files of them the same voxels", self.replay("out", frames=2)[0])
        self.call("run", scene, "--no-render", "--out", "fine", "--set", "density.refine=2")
        self.assertIn("have the same states; voxels of refined files are not compared", self.replay("fine", frames=2)[0])
        self.call("run", self.scene, "--no-render", "--out", "plain")
        self.assertIn("2 frames simulated anew have the same states, and 2 files", self.replay("plain", frames=2)[0])

    def test_of_a_run_that_starts_from_a_state(self):
        (self.folder / "in").mkdir()
        self.state("in/state.vdb", 4)
        scene = self.write("in/from.toml", SCENE.replace("[time]", 'initial_state = "state.vdb"\n[time]'))
        absolute = self.write("absolute.toml",
                              SCENE.replace("[time]", f'initial_state = "{self.folder}/in/state.vdb"\n[time]'))
        changed = ("--set", "lattice.initial_state=in/state.vdb")
        self.call("run", "in/from.toml", "--no-render", "--out", "relative")
        self.call("run", scene, "--no-render", "--out", "full")
        self.call("run", absolute, "--no-render", "--out", "absolute")
        self.call("run", self.scene, *changed, "--no-render", "--out", "changed")
        for folder in ("relative", "full", "absolute", "changed"):
            with self.subTest(folder):
                self.replay(folder)
                # From another folder, too.
                subprocess.run([NEPHOS, "verify", f"../{folder}", "--replay", "1"], cwd=self.folder / "in", check=True,
                               env=self.environment, stdout=subprocess.DEVNULL)
        # A state written anew with the same cells is the same; another one, or none, is nothing to judge by.
        self.state("in/state.vdb", 4)
        self.replay("relative")
        path = self.folder / "changed/manifest.json"
        manifest = json.loads(path.read_text())
        manifest["frames"][0]["state_hash"] = "0" * 32
        path.write_text(unsealed(manifest))
        self.assertIn("frame 1: state", self.call("verify", "changed", "--replay", 1, status=1).stdout)
        self.state("in/state.vdb", 5)
        for folder in ("relative", "full", "absolute"):
            detail, errors = self.replay(folder, status=3)
            self.assertIn("the content is not as it was: state.vdb of `lattice.initial_state`", detail)
            self.assertIn("the check `replay` could not be done", errors)
        (self.folder / "in/state.vdb").unlink()
        for folder in ("relative", "full", "absolute"):
            detail, _ = self.replay(folder, status=3)
            self.assertTrue(detail)
            self.assertIn("state.vdb", detail)

    def test_of_a_manifest_without_inputs(self):
        """As those of earlier versions: the state counts, wherever the scene's text finds it."""
        self.state("state.vdb", 4)
        self.call("run", self.scene, "--set", "lattice.initial_state=state.vdb", "--no-render", "--out", "out")
        path = self.folder / "out/manifest.json"
        manifest = json.loads(path.read_text())
        self.assertEqual(manifest["inputs"]["lattice.initial_state"]["path"], "../state.vdb")
        del manifest["inputs"]
        path.write_text(unsealed(manifest))
        self.replay("out")
        self.state("state.vdb", 5)
        self.assertIn("earlier version", self.replay("out", status=3)[0])

    def test_of_a_branch(self):
        self.call("run", self.scene, "--no-render", "--out", "source", "--frames", "1", "--set", "time.steps=12")
        self.call("run", "--from", "source", "--no-render", "--out", "branch", "--set", "field.background.ext=0.3")
        self.call("run", "--from", "branch/checkpoint.nephos", "--no-render", "--out", "twig", "--set", "time.steps=18",
                  "--set", "field.background.ext=0.05")
        manifest = json.loads((self.folder / "branch/manifest.json").read_text())
        self.assertEqual(manifest["branch"]["path"], "../source/checkpoint.nephos")
        for folder in ("branch", "twig"):
            self.assertIn("3 frames simulated anew", self.replay(folder)[0])
        (self.folder / "elsewhere").mkdir()
        subprocess.run([NEPHOS, "verify", "../twig", "--replay", "1"], cwd=self.folder / "elsewhere", check=True,
                       env=self.environment, stdout=subprocess.DEVNULL)

        def rewritten(change):
            other = json.loads(json.dumps(manifest))
            change(other)
            (self.folder / "branch/manifest.json").write_text(unsealed(other))
        # A manifest of an earlier version has the checkpoint's name alone.
        rewritten(lambda m: m.update(branch={"checkpoint": "source/checkpoint.nephos"}))
        self.replay("branch")
        rewritten(lambda m: m["frames"][1].update(state_hash="0" * 32))
        self.assertIn("frame 3: state", self.call("verify", "branch", "--replay", 3, status=1).stdout)
        for change in (lambda m: None, lambda m: m.update(branch={"checkpoint": "source/checkpoint.nephos"})):
            rewritten(change)
            kept = (self.folder / "source/checkpoint.nephos").read_bytes()
            self.call("run", self.scene, "--no-render", "--out", "source", "--overwrite")
            self.assertIn("is not the checkpoint any more", self.replay("branch", status=3)[0])
            (self.folder / "source/checkpoint.nephos").unlink()
            self.assertIn("is not there any more", self.replay("branch", status=3)[0])
            (self.folder / "source/checkpoint.nephos").write_bytes(kept)
            self.replay("branch")


class Place(Case):
    def test_metadata_are_typed_and_placed(self):
        scene = self.write("placed.toml", PLACED)
        self.call("run", scene, "--no-render", "--out", "out")
        self.call("verify", "out")
        info = json.loads(self.call("info", "out/density/placed_0002.vdb", "--json").stdout)
        metadata, grid = info["metadata"], info["grids"][0]
        self.assertEqual(metadata["nephos_latitude_deg"], 51.4775)
        self.assertEqual(metadata["nephos_utc"], "2024-06-21T13:50:15Z")
        self.assertEqual(metadata["nephos_bbox_max"], [31, 23, 11])
        self.assertEqual(grid["world_from_index"][3::4][:3], grid["origin"])
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        self.assertEqual(manifest["georeference"]["ecef_from_world"], metadata["nephos_ecef_from_world"])
        self.assertEqual(manifest["frames"][1]["utc"], "2024-06-21T13:50:15Z")

    def test_the_matrix_is_that_of_proj(self):
        import math
        import pyproj
        geodetic = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
        for latitude, longitude, height, heading in ((51.4775, -0.4614, 70.5, 0), (-33.9, 151.2, 6, 123), (89.9, 10, 0, -45),
                                                     (0, 180, 4000, 300), (-90, 0, 2835, 10)):
            place = PLACED.split("[georeference]")[0] + (
                f"[georeference]\nlatitude_deg = {latitude}\nlongitude_deg = {longitude}\nheight_m = {height}\n"
                f'height_datum = "ellipsoid"\nheading_deg = {heading}\n')
            self.call("run", self.write("placed.toml", place), "--no-render", "--out", "out", "--overwrite", "--frames", "1")
            metadata = json.loads(self.call("info", "out/density/placed_0001.vdb", "--json").stdout)["metadata"]
            m = metadata["nephos_ecef_from_world"]
            local = pyproj.Transformer.from_pipeline(
                f"+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lon_0={longitude} +lat_0={latitude} +h_0={height}")
            for x, y, z in ((0, 0, 0), (5000, 0, 1000), (0, -3000, 200), (-7000, 8000, 9000)):
                a = math.radians(heading)
                east, north = x * math.cos(a) + y * math.sin(a), -x * math.sin(a) + y * math.cos(a)
                expected = local.transform(east, north, z)
                found = [sum(m[4 * row + k] * v for k, v in enumerate((x, y, z, 1))) for row in range(3)]
                self.assertLess(math.dist(found, expected), 1e-5)
            self.assertLess(math.dist(geodetic.transform(longitude, latitude, height), [m[3], m[7], m[11]]), 1e-5)

    def test_the_sun_stands_where_it_does_there(self):
        def canonical(text, *arguments):
            scene = self.write("sunny.toml", text)
            self.call("run", scene, "--no-render", "--statistics-only", "--out", "sun", "--overwrite", *arguments)
            text = json.loads((self.folder / "sun/manifest.json").read_text())["scene_text"]
            return text.split("[sun]\n")[1].split("\n\n")[0]
        sun = canonical(PLACED)
        for line in ('date = "2024-06-21"', 'time = "13:50:00"', "latitude_deg = 51.4775", "moves = true"):
            self.assertIn(line, sun)
        self.assertIn('date = ""', canonical(PLACED, "--set", "sun.elevation_deg=20"))

    def test_mistakes_are_named(self):
        for keys, says in (("latitude_deg = 51", "longitude_deg"), ("latitude_deg = 91\nlongitude_deg = 0", "-90 to 90"),
                           ('latitude_deg = 1\nlongitude_deg = 2\nstart_utc = "yesterday"', "2024-06-21T13:50:00Z"),
                           ('latitude_deg = 1\nlongitude_deg = 2\nheight_datum = "sea"', "ellipsoid")):
            scene = self.write("bad.toml", f"{SCENE}[georeference]\n{keys}\n")
            self.assertIn(says, self.call("validate", scene, status=2).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
