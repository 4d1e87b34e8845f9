# SPDX-License-Identifier: Apache-2.0
"""`nephos sweep` and `nephos merge`: the same tables whatever happened on the way, and statistics with a known answer."""

import csv
import html
import json
import math
import os
import pathlib
import re
import resource
import shlex
import shutil
import signal
import subprocess
import time
import unittest
from xml.etree import ElementTree

import xxhash

from case import NEPHOS, PATIENCE, SOURCE, Case

# Without vapour cells are independent: the cover is known in closed form.
NULL = """\
seed = 3
[lattice]
cells = [64, 64, 10]
boundaries = ["periodic", "periodic", "open"]
initial = "empty"
[time]
steps = 400
[field.background]
hum = 0.0
act = 0.002
ext = 0.1
"""
TABLES = ("runs.csv", "points.csv", "failures.csv", "series.nc", "manifest.json")


def cover(act, ext, levels=10):
    fraction = act * (1 - ext) / (1 - (1 - act) * (1 - ext))
    return 1 - (1 - fraction) ** levels


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


class Sweep(Case):
    def setUp(self):
        super().setUp()
        self.null = self.write("null.toml", NULL)

    def sweep(self, out, *arguments, axis="field.background.ext=0.05,0.1,0.2", steps="400..3200", status=0):
        return self.call("sweep", self.null, "--axis", axis, "--replicates", "3", "--steps", steps, "--out", out,
                         *arguments, status=status)

    def start(self, *arguments, stderr=subprocess.DEVNULL):
        return subprocess.Popen([NEPHOS, *map(str, arguments)], cwd=self.folder, env=self.environment, text=True,
                                stdout=subprocess.DEVNULL, stderr=stderr)

    def tables(self, folder):
        return {name: (self.folder / folder / name).read_bytes() for name in TABLES}

    def test_means_are_those_in_closed_form(self):
        self.sweep("a", "-j", "2")
        points = rows(self.folder / "a/points.csv")
        self.assertEqual([point["field.background.ext"] for point in points], ["0.05", "0.1", "0.2"])
        for point in points:
            ext = float(point["field.background.ext"])
            error = max(float(point["cover_se"]), float(point["cover_se_within"]))
            self.assertLess(abs(float(point["cover"]) - cover(0.002, ext)), 5 * error)
            self.assertLess(error, 0.01)
            self.assertEqual(point["steady"], "3")
            self.assertAlmostEqual(float(point["lifetime_s"]), 10 / ext, delta=0.05 * 10 / ext)
        for run in rows(self.folder / "a/runs.csv"):
            self.assertEqual((run["status"], run["regime"]), ("done", "steady"))
            self.assertGreater(int(run["used_steps"]), 100)

    def test_tracks_follow_clouds(self):
        """Cells that are far apart are clouds of their own, and live for 1 / ext steps; the wind changes nothing."""
        sparse = ("--set", "field.background.act=1e-5", "--tracks", "--replicates", "1", "--axis", "field.background.ext=0.05,0.1",
                  "--steps", "1500..6000")
        windy = self.write("windy.toml", NULL + "[[wind]]\nlevels = [{ height_m = 0, east_m_per_s = 7, north_m_per_s = -3 }]\n")
        for folder, scene in (("calm", self.null), ("windy", windy)):
            self.call("sweep", scene, *sparse, "--out", folder, "-j", "2")
            table = rows(self.folder / folder / "tracks.csv")
            for run, point in zip(table, rows(self.folder / folder / "runs.csv")):
                self.assertEqual((run["run"], run["status"]), (point["run"], "done"))
                number = {key: float(value) for key, value in run.items() if key[0] in "bdsmect" and key != "status"}
                ext = float(run["field.background.ext"])
                self.assertGreater(number["births"], 300)
                self.assertLess(abs(number["births"] - number["deaths"]), 0.1 * number["births"])
                self.assertLess(abs(number["track_lifetime_mean_s"] - 10 / ext),
                                4 * number["track_lifetime_mean_s_se"] + 0.03 * 10 / ext)
                self.assertEqual(number["entered"], 0)
                self.assertGreaterEqual(float(run["track_age_longest_s"]), number["track_lifetime_mean_s"])
        # Shards merge to the same bytes; without --tracks nothing changes and there is no table.
        for shard in range(2):
            self.call("sweep", self.null, *sparse, "--out", "parts", "--shard", f"{shard}/2")
        self.call("merge", "parts")
        self.assertEqual((self.folder / "parts/tracks.csv").read_bytes(), (self.folder / "calm/tracks.csv").read_bytes())
        self.assertIn("tracks = true", (self.folder / "parts/sweep.toml").read_text())
        self.sweep("plain", steps="50")
        self.assertFalse((self.folder / "plain/tracks.csv").exists())
        plan = self.write("bad.toml", 'scene = "null.toml"\ntracks = "yes"\n')
        self.assertIn("expected true or false", self.call("sweep", plan, "--out", "bad", status=2).stderr)
        rolls = self.write("rolls.toml", NULL + """\
[[wind_field]]
kind = "roll"
x_m = 0
y_m = 600
radius_m = 1200
speed_m_per_s = 1.8
direction_deg = 90
""")
        said = self.call("sweep", rolls, "--tracks", "--out", "bad", status=2).stderr
        self.assertIn("has a wind that differs within a level", said)
        self.assertFalse((self.folder / "bad").exists())
        # The same wind from a file, which is read for that.
        written = self.write("written.toml", pathlib.Path(rolls).read_text() + "[density]\nwrite_velocity = true\n[frames]\ncount = 1\n")
        self.call("run", written, "--no-render", "--set", "time.steps=2", "--out", "written")
        read = self.write("read.toml", NULL + """\
[[wind_field]]
kind = "grid"
grid = "vel"
files = ["written/density/written_0001.vdb"]
""")
        said = self.call("sweep", read, "--tracks", "--out", "bad", status=2).stderr
        self.assertIn("has a wind that differs within a level", said)

    def test_a_run_of_the_table_can_be_repeated(self):
        self.sweep("a", "-j", "2")
        run = rows(self.folder / "a/runs.csv")[4]
        last = self.hashes("a/scene.toml", "--steps", run["steps"], "--seed", run["seed"], "--set",
                           f"field.background.ext={run['field.background.ext']}").splitlines()[-1]
        self.assertEqual(last, f"{run['steps']} {run['state_hash']}")

    def test_tables_are_the_same_for_any_workers_shards_and_order(self):
        self.sweep("one", "-j", "1")
        expected = self.tables("one")
        self.sweep("two", "-j", "2")
        self.assertEqual(self.tables("two"), expected)
        for shards in (3, 7):
            folder = f"shards{shards}"
            for shard in reversed(range(shards)):
                self.sweep(folder, "-j", "2", "--shard", f"{shard}/{shards}")
            self.call("merge", folder)
            self.assertEqual(self.tables(folder), expected)
        # Shards of two machines, merged in either order.
        self.sweep("here", "--shard", "0/2")
        self.sweep("there", "--shard", "1/2")
        for first, second in (("here", "there"), ("there", "here")):
            self.call("merge", first, second, "--out", "merged")
            self.assertEqual(self.tables("merged"), expected)

    def test_the_advice_of_merge_works(self):
        """Tables beside no records: the page is made where the records are, and the commands in the tables have their scene."""
        for shard, folder in enumerate(("here", "there")):
            self.sweep(folder, "--shard", f"{shard}/2", steps="100")
        said = self.call("merge", "here", "there", "--out", "tables").stdout
        advice = re.search(r"`nephos (report [^`]*)` shows them", said).group(1)
        self.call(*shlex.split(advice))
        self.assertIn("9 done, 0 failed, 0 missing", (self.folder / "tables/report.html").read_text())
        for name in ("scene.toml", "sweep.toml"):
            self.assertEqual((self.folder / "tables" / name).read_bytes(), (self.folder / "here" / name).read_bytes())
        self.refused(2, "report", "tables", says="`nephos report` of the folders that were merged")
        # In place the folder alone will do.
        said = self.call("merge", "here").stdout
        self.call(*shlex.split(re.search(r"`nephos (report [^`]*)` shows them", said).group(1)))
        self.assertTrue((self.folder / "here/report.html").exists())
        # A folder of records keeps its own plan.
        self.sweep("other", steps="120", axis="field.background.ext=0.3")
        plan = (self.folder / "other/sweep.toml").read_bytes()
        self.call("merge", "here", "there", "--out", "other", "--overwrite")
        self.assertEqual((self.folder / "other/sweep.toml").read_bytes(), plan)

    def test_its_files_are_not_replaced(self):
        """By what writes single files, also through links; files of others beside them are."""
        self.sweep("out", steps="20", axis="field.background.ext=0.05")
        files = sorted(path for path in (self.folder / "out").rglob("*") if path.is_file())
        before = {path: path.read_bytes() for path in files}
        self.assertTrue({"runs.csv", "points.csv", "failures.csv", "series.nc", "timing.csv", "scene.toml", "sweep.toml", "manifest.json", "lock",
                         "0000-of-0001.jsonl", "0000-of-0001.series"} <= {path.name for path in files})
        (self.folder / "link").symlink_to("out/points.csv")
        for file in (*files, self.folder / "link"):
            self.refused(2, "state", self.scene, "--steps", "1", "--out", file, says="is a file of the sweep in ")
        self.assertEqual(before, {path: path.read_bytes() for path in files})
        self.call("report", "out")
        self.refused(2, "state", self.scene, "--steps", "1", "--out", "out/report.html", says="is a file of the sweep in ")
        for engine, script in (("slurm", "sweep.slurm"), ("snakemake", "Snakefile"), ("parallel", "sweep.parallel")):
            self.sweep(engine, "--emit", engine, steps="20")
            for name in ("sweep.toml", "scene.toml", script):  # the only copies of a plan that the command line made
                self.refused(2, "state", self.scene, "--steps", "1", "--out", f"{engine}/{name}", says="is a file of the sweep in ")
        for mine in ("out/mine.vdb", "points.csv"):
            for _ in range(2):
                self.call("state", self.scene, "--steps", "1", "-q", "--out", mine)

    def test_records_of_another_sweep_are_not_left_out_in_silence(self):
        self.sweep("one", steps="100")
        other = self.write("other.toml", NULL.replace("act = 0.002", "act = 0.003"))
        self.call("sweep", other, "--axis", "field.background.ext=0.3", "--replicates", "2", "--steps", "100", "--out", "k")
        for command in (("merge", "one", "k", "--out", "m"), ("report", "one", "k", "--out", "m/report.html")):
            self.refused(2, *command, says="k: has 2 records, and none is of a run that one/sweep.toml asks for")
        self.assertFalse((self.folder / "m").exists())
        # Some points more are no other sweep, but they are counted.
        self.sweep("more", steps="100", axis="field.background.ext=0.1,0.4")
        said = self.call("merge", "one", "more", "--out", "m")
        self.assertIn("one more: 3 records are of other points or rules", said.stderr)
        self.assertNotIn("records are of", self.call("merge", "one").stderr)

    def test_records_of_another_version_are_refused_with_a_cure_that_works(self):
        self.sweep("old", steps="100")
        before = self.tables("old")
        shard = self.folder / "old/shards/0000-of-0001.jsonl"
        lines = []
        for line in shard.read_text().splitlines():
            text = re.sub(r'"statistics_version":\d+', '"statistics_version":1', line.rsplit(',"xxh3":"', 1)[0])
            lines.append(f'{text},"xxh3":"{xxhash.xxh3_128(text.encode()).hexdigest()}"}}\n')
        shard.write_text("".join(lines))
        self.assertIn("choose another --out, or give --overwrite", self.sweep("old", steps="100", status=2).stderr)
        for command in (("merge", "old"), ("merge", "old", "--overwrite"), ("report", "old")):
            said = self.refused(2, *command, says="0000-of-0001.jsonl: has records of version 1 of the statistics").stderr
            self.assertRegex(said, r"and this nephos makes versions \d+ and \d+: leave old out")
            cure = re.search(r"`nephos (sweep [^`]*)`", said).group(1)
        self.call(*shlex.split(cure))
        self.assertEqual(self.tables("old"), before)

    def test_equal_points_are_refused(self):
        """Their runs would have the same ids and seeds."""
        plan = self.write("plan.toml", 'scene = "null.toml"\n[[axis]]\nkey = "field.background.ext"\nvalues = [0.1, 0.2, 0.10]\n')
        for arguments, says in (([self.null, "--axis", "field.background.ext=0.1,0.2,1e-1"], "value 3 is 0.1, and so is value 1"),
                                ([plan], "value 3 is 0.1, and so is value 1"),
                                ([self.null, "--design", "list", "--axis", "field.background.ext=0.1,0.2,0.10", "--axis",
                                  "field.background.act=0.01,0.02,1e-2"],
                                 "points 1 and 3 of the list are the same: field.background.act=0.01 field.background.ext=0.1"),
                                ([self.null, "--axis", "density.refine=integer:1..2", "--points", "3"], "of the sobol are the same")):
            with self.subTest(arguments=arguments):
                self.assertIn(says, self.call("sweep", *arguments, "--out", "twice", status=2).stderr)
        self.assertFalse((self.folder / "twice").exists())
        # A value of a list may come again with another one of a second axis.
        pairs = self.call("sweep", self.null, "--axis", "field.background.ext=0.1,0.1", "--axis",
                          "field.background.act=0.01,0.02", "--design", "list", "--dry-run", "-r", "1")
        self.assertIn("2 points", pairs.stdout)

    def test_values_with_tables_reach_the_runs(self):
        values = ["[{levels = [{from_deg = 0, height_m = 0, speed_m_per_s = 90}]}]", "[]"]
        plan = self.write("plan.toml", """\
scene = "null.toml"
replicates = 1
steps = { min = 20, max = 20 }
[[axis]]
keys = ["wind"]
values = [[{ levels = [{ height_m = 0, 'from_deg' = 0, speed_m_per_s = 9e1 }] }], []]
""")
        self.call("sweep", plan, "--out", "file")
        table = rows(self.folder / "file/runs.csv")
        self.assertEqual([run["wind"] for run in table], values)
        for run in table:
            for scene in (self.null, "file/scene.toml"):
                last = self.hashes(scene, "--steps", "20", "--seed", run["seed"], "--set", f"wind={run['wind']}").splitlines()[-1]
                self.assertEqual(last, f"20 {run['state_hash']}")
        # The command line, however it writes them, and parts of the plan that it leaves, give the same bytes.
        given = ("sweep", self.null, "--axis", f"wind={values[0].replace(' ', '')} , [ ]", "--replicates", "1", "--steps", "20")
        self.call(*given, "--out", "line")
        self.call(*given, "--out", "parts", "--emit", "parallel", "--tasks", "2")
        for shard in range(2):
            self.call("sweep", "parts/sweep.toml", "--out", "parts", "--shard", f"{shard}/2")
        self.call("merge", "parts")
        for folder in ("line", "parts"):
            self.assertEqual(self.tables(folder), self.tables("file"))
        self.call("report", "line")
        page = html.unescape((self.folder / "line/report.html").read_text())
        self.assertIn(f"--set 'wind={values[0]}' --seed {table[0]['seed']}", page)
        dated = self.write("dated.toml", pathlib.Path(plan).read_text().replace("9e1", "2026-07-01"))
        self.assertIn("`axis[0].values` holds a date or time", self.call("sweep", dated, "--out", "no", status=2).stderr)
        self.call("sweep", self.null, "--axis", "wind=[{levels=[{height_m=2026-07-01}]}]", "--out", "no", status=2)
        self.assertFalse((self.folder / "no").exists())

    def test_keys_that_overlap_are_refused(self):
        """The last one would win, but the ids of the runs do not tell the order."""
        windy = self.write("windy.toml", NULL + "[[wind]]\nlevels = [{ height_m = 0, east_m_per_s = 7, north_m_per_s = -3 }]\n")
        pairs = (("field.background", "{ext = 0.1}", "field.background.ext", "0.2"),
                 ("lattice.cells", "[8, 8, 4]", "lattice.cells[0]", "16"),
                 ("wind", "[]", "wind[0].levels[0].east_m_per_s", "5"))
        for outer, table, inner, number in pairs:
            for one, two in (((outer, table), (inner, number)), ((inner, number), (outer, table))):
                says = f"keys `{outer}` and `{inner}` overlap"
                axes = [f"--axis={key}={value}" for key, value in (one, two)]
                plan = self.write("plan.toml", 'scene = "windy.toml"\n' + "".join(
                    f'[[axis]]\nkey = "{key}"\nvalues = [{value}]\n' for key, value in (one, two)))
                for arguments in ([windy, *axes], [plan], [windy, f"--axis={one[0]}+{two[0]}={one[1]}"]):
                    with self.subTest(arguments=arguments):
                        self.refused(2, "sweep", *arguments, "--out", "bad", says=says)
        ext = "field.background.ext"
        for axes, says in (([f"{ext}+{ext}=0.1,0.2"], f"key `{ext}` is in it twice"),
                           (["time={step_s=5},{step_s=10}"], "axis time: has the steps in it"),
                           ([f"{ext}=0.1", f"{ext} =0.2"], f"key `{ext}` is in two axes"),
                           (["lattice.cells[0]=8", "lattice.cells[00]=16"], "key `lattice.cells[0]` is in two axes")):
            self.refused(2, "sweep", self.null, *(f"--axis={axis}" for axis in axes), "--out", "bad", says=says)
        self.assertFalse((self.folder / "bad").exists())
        # Beside each other they are good, also where one name begins another; what all runs have in common comes first.
        said = self.call("sweep", self.null, "--axis", "lattice.cells[0]=8,16", "--axis", "lattice.cells[1]=8,16", "--axis",
                         "lattice.cell_size_m=40,50", "--set", "lattice.cells=[8,8,4]", "--dry-run").stdout
        self.assertIn("8 points", said)

    def test_what_the_command_line_takes_is_read_back(self):
        for number, axis in enumerate(("field.background={ext=0.1,act=0.01} , {act=0.02,ext=0.2}", "lattice.cells=[8,8,4], [8, 8,5]",
                                       'lattice.boundaries="open",["periodic","periodic","open"]', "lattice.cells[00]=8,16",
                                       "lattice.initial='empty'")):
            with self.subTest(axis=axis):
                out = f"out{number}"
                self.call("sweep", self.null, "--axis", axis, "--replicates", "1", "--steps", "20", "--out", out)
                runs = len(rows(self.folder / out / "runs.csv"))
                plan = (self.folder / out / "sweep.toml").read_bytes()
                before = self.tables(out)
                said = self.call("sweep", f"{out}/sweep.toml", "--out", out, "--status").stdout
                self.assertIn(f"{runs} of {runs} runs done", said)
                for command in (("sweep", f"{out}/sweep.toml", "--out", out), ("merge", out), ("report", out)):
                    self.call(*command)
                self.assertEqual((self.folder / out / "sweep.toml").read_bytes(), plan)
                self.assertEqual(self.tables(out), before)
        # The same checks at both entrances.
        for key, values in (("lattice.cells", "[8,8,4] ,[8, 8,4]"), ("field.background.hum", "0,-0"), ("field.background.hum", "-0.0,0"),
                            ("lattice.boundaries", '"open",["open","open","open"]'),
                            ("field.background", "{ext=0.1,act=0.01},{act=0.010,ext=0.1}"),
                            ("field.background", "{ext=0.1,act=0.01},{act=0.01,ext=0.1,hum=0}")):
            plan = self.write("plan.toml", f'scene = "null.toml"\n[[axis]]\nkey = "{key}"\nvalues = [{values}]\n')
            for arguments in ([self.null, "--axis", f"{key}={values}"], [plan]):
                with self.subTest(arguments=arguments):
                    self.refused(2, "sweep", *arguments, "--out", "twice", says="expected each value once")
                    self.refused(2, "sweep", *arguments, "--out", "twice", "--design", "list", says="points 1 and 2 of the list are the same")
        self.assertFalse((self.folder / "twice").exists())

    def test_a_scene_or_sweep_file_may_come_through_a_pipe(self):
        self.sweep("file", "-j", "2", steps="40")
        arguments = ["--axis", "field.background.ext=0.05,0.1,0.2", "--replicates", "3", "--steps", "40", "-j", "2"]
        plan = f'scene = "{self.null}"\nreplicates = 3\nsteps = {{ min = 40, max = 40 }}\n' \
               '[[axis]]\nkey = "field.background.ext"\nvalues = [0.05, 0.1, 0.2]\n'
        for name, text, more in (("scene", 'name = "null"\n' + NULL, arguments), ("plan", plan, [])):
            with self.subTest(name):
                done = subprocess.run([NEPHOS, "sweep", "/dev/stdin", *more, "--out", name], input=text, text=True,
                                      cwd=self.folder, env=self.environment, capture_output=True, timeout=PATIENCE)
                self.assertEqual((done.returncode, done.stderr.count("error")), (0, 0), done.stderr)
                self.assertEqual((self.folder / name / "runs.csv").read_bytes(),
                                 (self.folder / "file/runs.csv").read_bytes())

    def test_files_of_a_scene_are_found_from_the_folder_of_the_sweep(self):
        self.call("run", self.null, "--no-render", "--set", "density.write_state=true", "--set", "frames.count=1", "--set",
                  "time.steps=2", "--out", "w")
        data = self.folder / "data"
        data.mkdir()
        shutil.copy(self.folder / "w/density/null_0001.vdb", data / "init.vdb")
        scene = self.write("data/a.toml", NULL.replace('initial = "empty"', 'initial_state = "init.vdb"'))
        sweep = ("--axis", "field.background.ext=0.1,0.2", "--replicates", "1", "--steps", "20")
        self.call("sweep", "data/a.toml", *sweep, "--out", "data/o")
        self.assertIn('initial_state = "../init.vdb"', (data / "o/scene.toml").read_text())
        before = self.tables("data/o")
        plan = [(data / "o" / name).read_bytes() for name in ("scene.toml", "sweep.toml")]
        self.call("report", "data/o")
        page = (data / "o/report.html").read_bytes()
        # The same from any folder, by any name of the scene, and where all of it was moved to.
        for folder, named, out in ((data, "a.toml", "o"), (self.folder, scene, data / "o"), (data / "o", "../a.toml", ".")):
            self.folder, home = folder, self.folder
            self.assertIn("2 of 2 runs done", self.call("sweep", named, *sweep, "--out", out, "--status").stdout)
            self.call("sweep", named, *sweep, "--out", out)
            self.call("sweep", pathlib.Path(out) / "sweep.toml", "--out", out)
            self.call("merge", out)
            self.call("report", out)
            self.call("validate", pathlib.Path(out) / "scene.toml")
            self.folder = home
            self.assertEqual(self.tables("data/o"), before)
            self.assertEqual([(data / "o" / name).read_bytes() for name in ("scene.toml", "sweep.toml")], plan)
            self.assertEqual((data / "o/report.html").read_bytes(), page)
        run = rows(data / "o/runs.csv")[1]
        last = self.hashes("data/o/scene.toml", "--steps", "20", "--seed", run["seed"], "--set", "field.background.ext=0.2").splitlines()[-1]
        self.assertEqual(last, f"20 {run['state_hash']}")
        data.rename(self.folder / "moved")
        self.call("sweep", "moved/o/sweep.toml", "--out", "moved/o")
        self.assertEqual(self.tables("moved/o"), before)
        # A folder that is reached through a link has another parent than its name says.
        (self.folder / "elsewhere/deep").mkdir(parents=True)
        (self.folder / "link").symlink_to("elsewhere/deep")
        self.call("sweep", "moved/a.toml", *sweep, "--out", "link/o")
        for folder in ("link/o", "elsewhere/deep/o"):
            self.call("validate", f"{folder}/scene.toml")
            self.call("report", folder)
        # A sweep whose scene names its file from another folder goes on, and is mended.
        text = (self.folder / "moved/o/scene.toml").read_text()
        (self.folder / "moved/o/scene.toml").write_text(text.replace("../init.vdb", "data/init.vdb"))
        self.assertIn('"before": 2', self.call("sweep", "moved/a.toml", *sweep, "--out", "moved/o", "--json").stdout)
        self.assertEqual((self.folder / "moved/o/scene.toml").read_text(), text)

    def test_the_scene_in_the_folder_is_that_of_the_runs(self):
        """Keys that follow others do so there, too: fields of layers, boxes of scatters and motions, either form of a wind."""
        scatter = NULL.replace("[64, 64, 10]", "[32, 32, 8]") + (
            "[[field.scatters]]\ncount = 6\nz_m = 200\nsemi_axis_x_m = [100, 300]\nsemi_axis_y_m = 200\nsemi_axis_z_m = 150\n"
            "centre = { hum = 0.2, act = 0.02, ext = 0.05 }\nrim = { hum = 0.0, act = 0.001, ext = 0.1 }\n")
        wind = NULL.replace('initial = "empty"\n', "") + "[[wind]]\nlevels = [{ height_m = 0, from_deg = 200, speed_m_per_s = 4 }]\n"
        swirl = NULL + '[[wind_field]]\nkind = "vortex"\nx_m = 800\ny_m = 800\nradius_m = 300\nspeed_m_per_s = 20\n'
        for name, text, axis in (("layers", None, "field.background.ext=0.05,0.4"),
                                 ("scatter", scatter, "lattice.cells=[32,32,8],[64,64,8]"),
                                 ("wind", wind, "wind[0].levels[0].speed_m_per_s=3,9"),
                                 ("swirl", swirl, "lattice.cell_size_m=50,80")):
            with self.subTest(name):
                scene = self.write(f"{name}.toml", text) if text else SOURCE / "scenes/rain.toml"
                self.call("sweep", scene, "--axis", axis, "--replicates", "1", "--steps", "30", "--out", name)
                tables = self.tables(name)
                runs = rows(self.folder / name / "runs.csv")
                self.assertNotEqual(runs[0]["state_hash"], runs[1]["state_hash"])
                self.call("sweep", f"{name}/sweep.toml", "--out", f"{name}-again")
                again = rows(self.folder / f"{name}-again/runs.csv")
                self.assertEqual([(r["run"], r["state_hash"]) for r in again], [(r["run"], r["state_hash"]) for r in runs])
                self.call("merge", name)
                self.call("report", name)
                self.assertEqual(self.tables(name), tables)
                key, values = axis.split("=")
                value = values[values.index("],") + 2:] if "[" in values else values.partition(",")[2]
                hashes = [self.hashes(place, "--steps", "30", "--seed", runs[1]["seed"], "--set", f"{key}={value}")
                          for place in (scene, f"{name}/scene.toml")]
                self.assertEqual(*hashes)

    def test_files_as_values_of_an_axis(self):
        states = {}
        for name, seed in (("a.vdb", 1), ("b.vdb", 2)):
            self.call("run", self.null, "--no-render", "--set", "density.write_state=true", "--set", "frames.count=12", "--set",
                      "time.steps=4", "--set", "field.background.hum=0.3", "--seed", str(seed), "--out", "w", "--overwrite")
            states[name] = max((self.folder / "w/density").glob("*.vdb")).read_bytes()
        self.assertNotEqual(states["a.vdb"], states["b.vdb"])
        data, out = self.folder / "data", "data/o"
        data.mkdir()
        for name, state in states.items():
            (data / name).write_bytes(state)
        scene = self.write("data/s.toml", NULL.replace('initial = "empty"', 'initial_state = "a.vdb"'))
        rest = ("--replicates", "1", "--steps", "20", "--out")
        axis = "lattice.initial_state=data/a.vdb,data/b.vdb"
        self.call("sweep", scene, "--axis", axis, *rest, out)
        before = self.tables(out)
        runs = rows(self.folder / out / "runs.csv")
        self.assertNotEqual(runs[0]["state_hash"], runs[1]["state_hash"])
        self.assertEqual(runs[1]["lattice.initial_state"].strip('"'), str(data.resolve() / "b.vdb"))
        # The sweep's own file, from its folder and from here; the same sweep by other names of the files.
        home = self.folder
        for folder, call in ((data / "o", ("sweep", "sweep.toml", "--out", ".")), (home, ("sweep", f"{out}/sweep.toml", "--out", out)),
                             (data, ("sweep", scene, "--axis", "lattice.initial_state='a.vdb','./b.vdb'", *rest, "o"))):
            self.folder = folder
            self.assertIn('"before": 2', self.call(*call, "--json").stdout)
            self.folder = home
            self.assertEqual(self.tables(out), before)
        # Names in a sweep file are relative to it.
        plan = self.write("data/plan.toml", 'scene = "s.toml"\nreplicates = 1\n[steps]\nmin = 20\nmax = 20\n[[axis]]\n'
                          'key = "lattice.initial_state"\nvalues = ["a.vdb", "b.vdb"]\n')
        self.assertIn('"before": 2', self.call("sweep", plan, "--out", out, "--json").stdout)
        # The files may be anywhere: what is in them is what counts.
        data.rename(self.folder / "moved")
        self.assertIn('values = ["../a.vdb", "../b.vdb"]', (self.folder / "moved/o/sweep.toml").read_text())
        self.assertIn('"before": 2', self.call("sweep", "moved/o/sweep.toml", "--out", "moved/o", "--json").stdout)
        self.assertEqual([run["run"] for run in rows(self.folder / "moved/o/runs.csv")], [run["run"] for run in runs])
        (self.folder / "moved").rename(data)
        (self.folder / "below").mkdir()
        self.folder = home / "below"
        self.assertIn('"before": 2', self.call("sweep", "../data/s.toml", "--axis", "lattice.initial_state=../data/a.vdb,../data/b.vdb", *rest,
                                               "../data/o", "--json").stdout)
        self.folder = home
        # Another content under the same name is another run.
        (data / "b.vdb").write_bytes(states["a.vdb"])
        self.refused(2, "sweep", "--quiet", scene, "--axis", axis, *rest, out, says="has the content of value 1")
        self.call("state", scene, "--steps", "9", "--out", data / "b.vdb")
        self.assertIn('"before": 1', self.call("sweep", scene, "--axis", axis, *rest, out, "--json").stdout)
        again = rows(self.folder / out / "runs.csv")
        self.assertEqual(again[0]["run"], runs[0]["run"])
        self.assertNotEqual(again[1]["run"], runs[1]["run"])
        self.assertNotEqual(again[1]["state_hash"], runs[1]["state_hash"])
        for key, says in (("lattice.initial_state=data/a.vdb,data/./a.vdb", "expected each value once"),
                          ("lattice={cells=[64,64,10],initial_state='data/a.vdb'}", "expected `lattice.initial_state` itself as an axis"),
                          ("models=['m.toml']", "are not an axis")):
            with self.subTest(axis=key):
                self.refused(2, "sweep", scene, "--axis", key, *rest, "no", says=says)
        missing = self.call("sweep", scene, "--axis", "lattice.initial_state=data/a.vdb,data/c.vdb", *rest, "no", status=3)
        self.assertIn(f"{data.resolve()}/c.vdb: ", missing.stderr)
        self.assertFalse((self.folder / "no").exists())

    def meanwhile(self, act, *arguments, records="shards/*.jsonl", least=0):
        """Begins a sweep or fit, calls `act` when it has a file of records of `least` bytes, and returns its status and errors."""
        process = subprocess.Popen([NEPHOS, *map(str, arguments), "-j", "1", "--quiet"], cwd=self.folder, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env=self.environment)
        out, end = self.folder / arguments[-1], time.monotonic() + PATIENCE
        while not any(path.stat().st_size >= least for path in out.glob(records)):
            self.assertLess(time.monotonic(), end)
            self.assertIsNone(process.poll())
            time.sleep(0.002)
        act()
        _, errors = process.communicate(timeout=PATIENCE)
        return process.returncode, errors

    def test_a_scene_that_is_edited_meanwhile(self):
        """The runs are those of the scene that the sweep began with, and so are the waves of a fit."""
        changed = NULL.replace("act = 0.002", "act = 0.02")
        scene = pathlib.Path(self.write("scenes/edited.toml", NULL))
        sweep = ("sweep", scene, "--axis", "field.background.ext=0.1..0.4:8", "--replicates", "4", "--steps", "1500..1500", "--out")
        self.call(*sweep, "calm")
        self.assertEqual(self.meanwhile(lambda: scene.write_text(changed), *sweep, "edited"), (0, ""))
        self.assertEqual(self.tables("edited"), self.tables("calm"))
        # What it is now is another sweep.
        self.assertIn('"before": 0', self.call(*sweep, "edited", "--json").stdout)
        scene.write_text(NULL)
        fit = self.write("fit.toml", """\
scene = "scenes/edited.toml"
runs = 16
clouds_every = 0
[steps]
min = 400
max = 1600
[[parameter]]
key = "field.background.ext"
prior = { from = 0.05, to = 0.4, scale = "log" }
[[target]]
statistic = "cover"
value = 0.15
sd = 0.05
""")
        self.call("fit", fit, "--out", "calm-fit")
        self.assertEqual(self.meanwhile(lambda: scene.write_text(changed), "fit", fit, "--out", "edited-fit", records="wave-1/shards/*.jsonl"),
                         (0, ""))
        for name in ("fit.json", "posterior.csv", "fitted.toml"):
            self.assertEqual((self.folder / "edited-fit" / name).read_bytes(), (self.folder / "calm-fit" / name).read_bytes())
        mine = self.write("own-fit/fitted.toml", "mine")
        self.refused(2, "fit", fit, "--out", "own-fit", "--quiet", says="own-fit/fitted.toml: is there, but a fit did not write it")
        self.assertEqual(pathlib.Path(mine).read_text(), "mine")

    def test_names_of_files_go_back_through_links_as_the_system_does(self):
        """In a scene, in one that is reached through a link, in its models, as a value of an axis, and in a plan."""
        for folder in ("real/scenes", "real/data", "here/data", "here/models", "real/models"):
            (self.folder / folder).mkdir(parents=True)
        (self.folder / "here/link").symlink_to("../real/scenes")
        for name, hum in (("real/data/x.vdb", 0.1), ("here/data/x.vdb", 0.9)):
            self.call("state", self.null, "--steps", "1", "--set", f"field.background.hum={hum}", "--out", name)
        started = NULL.replace('initial = "empty"', 'initial_state = "{}"')
        self.write("real/scenes/a.toml", started.format("../data/x.vdb"))
        self.write("here/a.toml", started.format("link/../data/x.vdb"))
        right, other = (self.hashes(self.write("at.toml", started.format(name)), "--steps", "3")
                        for name in ("real/data/x.vdb", "here/data/x.vdb"))
        self.assertNotEqual(right, other)
        for scene in ("real/scenes/a.toml", "here/link/a.toml", "here/a.toml", "here/link/../scenes/a.toml"):
            self.assertEqual(self.hashes(scene, "--steps", "3"), right, scene)
        for name, sun in (("real", 30), ("here", 60)):
            self.write(f"{name}/models/m.toml", f'[[model]]\nname = "of {name}"\nlevels = 3\n')
        self.write("real/scenes/m.toml", 'models = ["../models/m.toml"]\n' + NULL)
        for folder in ("real/scenes", "here/link"):
            said = self.call("validate", f"{folder}/m.toml", status=2).stderr
            self.assertIn("real/models/m.toml", said)
            self.assertNotIn("here/models/m.toml", said)
        steps = ("--replicates", "1", "--steps", "20")
        for number, (scene, value) in enumerate((("here/a.toml", "here/link/../data/x.vdb"), ("real/scenes/a.toml", "real/data/x.vdb"))):
            self.call("sweep", scene, "--axis", f"lattice.initial_state={value}", *steps, "--out", f"o{number}")
        self.assertEqual((self.folder / "o0/series.nc").read_bytes(), (self.folder / "o1/series.nc").read_bytes())
        (self.folder / "o2").symlink_to("o1")  # one folder by two names
        before = self.tables("o1")
        self.assertIn('"before": 1', self.call("sweep", "o2/sweep.toml", "--out", "o2", "--json").stdout)
        for shard in ("o3", "o4"):
            (self.folder / "o3").mkdir(exist_ok=True)
            if shard == "o4":
                (self.folder / "o4").symlink_to("o3")
            self.call("sweep", "real/scenes/a.toml", "--axis", "field.background.ext=0.1,0.2", *steps, "--out", shard, "--shard",
                      f"{int(shard[1]) - 3}/2")
        self.call("merge", "o4")
        self.assertEqual(self.tables("o1"), before)

    def test_a_folder_whose_name_no_scene_can_hold(self):
        self.call("state", self.null, "--steps", "1", "--out", "x.vdb")
        folder = os.fsencode(self.folder) + b"/\xff"
        os.mkdir(folder)
        os.rename(self.folder / "x.vdb", folder + b"/x.vdb")
        with open(folder + b"/a.toml", "w") as file:
            file.write(NULL.replace('initial = "empty"', 'initial_state = "x.vdb"'))
        call = subprocess.run([os.fsencode(NEPHOS), b"sweep", folder + b"/a.toml", b"--replicates", b"1", b"--steps", b"20", b"--quiet",
                               b"--out", b"no"], cwd=self.folder, env=self.environment, capture_output=True)
        self.assertEqual(call.returncode, 2, call.stderr)
        self.assertIn(b"x.vdb: its name is no UTF-8", call.stderr)

    def test_a_file_that_is_exchanged_meanwhile(self):
        for name, hum in (("a.vdb", 0.1), ("b.vdb", 0.9)):
            self.call("state", self.null, "--steps", "1", "--set", f"field.background.hum={hum}", "--out", name)
        data = self.folder / "data.vdb"
        shutil.copy(self.folder / "a.vdb", data)
        scene = self.write("started.toml", NULL.replace('initial = "empty"', 'initial_state = "data.vdb"'))
        sweep = ("sweep", scene, "--axis", "field.background.ext=0.1..0.4:8", "--replicates", "16", "--steps", "1500..1500", "--out")
        self.call(*sweep, "calm", "-j", "2")
        status, errors = self.meanwhile(lambda: os.replace(self.folder / "b.vdb", data), *sweep, "exchanged", least=1000)
        self.assertEqual(status, 3)
        self.assertIn("data.vdb: was changed after the sweep began", errors)
        self.assertIn(",", (self.folder / "exchanged/timing.csv").read_text())
        shutil.copy(self.folder / "a.vdb", data)
        # A name more, and other rights, make no other file.
        self.assertEqual(self.meanwhile(lambda: (os.link(data, self.folder / "backup.vdb"), data.chmod(0o600)), *sweep, "exchanged"), (0, ""))
        self.assertEqual(self.tables("exchanged"), self.tables("calm"))

    def test_files_of_others_are_not_replaced(self):
        """Scenes, plans and tables of the user's own, and runs."""
        axis = ("--axis", "field.background.ext=0.1,0.2", "--replicates", "1", "--steps", "20", "--out")
        text = "# mine\n" + NULL
        scene = pathlib.Path(self.write("own/scene.toml", text))
        self.refused(2, "sweep", "--quiet", scene, *axis, "own", says="own/scene.toml: is there, but a sweep did not write it")
        plan_text = ('# mine\nscene = "scene.toml"\nreplicates = 1\n[[axis]]\nkey = "field.background.ext"\nvalues = [0.1]\n'
                     "[steps]\nmin = 20\nmax = 20\n")
        plan = pathlib.Path(self.write("own/sweep.toml", plan_text))
        for more in ((), ("--emit", "slurm"), ("--overwrite",), ("--shard", "0/2")):
            self.refused(2, "sweep", "--quiet", plan, "--out", "own", *more, says="a sweep did not write it")
        self.assertEqual((scene.read_text(), plan.read_text()), (text, plan_text))
        self.assertFalse((self.folder / "own/shards").exists())
        self.call("run", self.null, "--no-render", "--set", "time.steps=2", "--out", "run")
        manifest = (self.folder / "run/manifest.json").read_bytes()
        self.refused(2, "sweep", "--quiet", self.null, *axis, "run", says="run/manifest.json: is there")
        self.call("sweep", self.null, *axis, "swept")
        self.call("run", self.null, "--statistics-only", "--set", "time.steps=2", "--out", "swept", "--overwrite")
        self.refused(2, "sweep", "--quiet", self.null, *axis, "swept", says="swept/manifest.json: is there")
        shutil.rmtree(self.folder / "swept")
        self.call("sweep", self.null, *axis, "swept")
        self.refused(2, "merge", "swept", "--out", "run", says="run/manifest.json: is there")
        self.assertEqual((self.folder / "run/manifest.json").read_bytes(), manifest)
        for name in ("runs.csv", "points.csv", "failures.csv", "tracks.csv", "series.nc"):
            self.write(f"tables-{name}/{name}", "mine")
            self.refused(2, "sweep", "--quiet", self.null, *axis, f"tables-{name}", says=f"{name}: is there")
        self.write("scripts/Snakefile", "mine")
        self.refused(2, "sweep", "--quiet", self.null, *axis, "scripts", "--emit", "snakemake", says="Snakefile: is there")
        shards = self.write("parts/shards/0.tar", "mine")  # a folder of that name says nothing
        self.write("parts/scene.toml", "mine")
        self.refused(2, "sweep", "--quiet", self.null, *axis, "parts", says="scene.toml: is there")
        self.assertEqual(pathlib.Path(shards).read_text(), "mine")
        self.refused(2, "sweep", self.null, *axis, "", says="expected the path of a folder")
        self.refused(2, "sweep", self.null, "--seed", 2**63, *axis, "large", says="is not from 0 to 9223372036854775807")
        self.refused(2, "sweep", self.null, *axis, "both", "--emit", "slurm", "--shard", "0/2", says="leave out --shard")
        self.refused(2, "sweep", self.null, *axis, "tasks", "--tasks", "3", says="--emit")
        self.refused(2, "sweep", "--quiet", self.null, *axis, "scripts", "--fail-fast", "--allow-failures", says="give one of them")
        for option in (["--retry-failed"], ["--fail-fast"], ["--allow-failures"], ["-j", "3"], ["--json"], ["--overwrite"]):
            self.refused(2, "sweep", self.null, *axis, "tasks", "--emit", "slurm", *option, says="--emit runs nothing")
        for option in ("--dry-run", "--status"):
            self.refused(2, "sweep", self.null, *axis, "tasks", "--emit", "slurm", option, says="--dry-run and --status only tell")
        # Beside records, too, whether complete or killed in the first runs.
        self.call("sweep", self.null, *axis, "mixed")
        shutil.copytree(self.folder / "mixed", self.folder / "killed")
        for name in ("runs.csv", "points.csv", "failures.csv", "series.nc", "manifest.json"):
            (self.folder / "killed" / name).unlink()
        for folder in ("mixed", "killed"):
            for name in ("scene.toml", "sweep.toml", "runs.csv", "points.csv", "failures.csv", "tracks.csv", "series.nc"):
                path = self.folder / folder / name
                before = path.read_bytes() if path.exists() else None
                path.write_text("mine")
                self.refused(2, "sweep", "--quiet", self.null, *axis, folder, says=f"{folder}/{name}: is there")
                self.assertEqual(path.read_text(), "mine")
                path.unlink() if before is None else path.write_bytes(before)
            self.call("sweep", self.null, *axis, folder)
        (self.folder / "mixed/report.html").write_text("mine")
        self.refused(2, "report", "mixed", says="mixed/report.html: is there")
        self.refused(2, "report", "mixed", "--out", "mixed/report.html", says="mixed/report.html: is there")
        (self.folder / "mixed/report.html").unlink()
        self.call("report", "mixed")
        # Files beside the records, and such as have their names.
        texts = {"train-000.jsonl": '{"my": 1}\n{"my": 2}\n', "train-000.series": "mine"}
        for name, text in texts.items():
            self.write(f"dataset/shards/{name}", text)
        for more in ((), ("--overwrite",)):
            self.call("sweep", self.null, *axis, "dataset", *more)
        for name, text in texts.items():
            self.assertEqual((self.folder / "dataset/shards" / name).read_text(), text)
        for name, text in (("0000-of-0001.jsonl", '{"my": 1}\n'), ("0000-of-0001.series", "mine")):
            for more in ((), ("--overwrite",)):
                mine = pathlib.Path(self.write(f"named-{name}/shards/{name}", text))
                self.refused(2, "sweep", "--quiet", self.null, *axis, f"named-{name}", *more, says=f"{name}: is there")
                self.assertEqual(mine.read_text(), text)
        # Tables of one plan do not go beside records of another one.
        self.call("sweep", self.null, "--axis", "field.background.hum=0.1,0.2", "--replicates", "8", "--steps", "20", "--shard", "0/2",
                  "--out", "other")
        self.refused(2, "merge", "swept", "--out", "other", says="other: holds the records of a sweep of another plan")
        # What a sweep left is its own: with and without records, and a plan that was made only.
        shutil.copytree(self.folder / "killed", self.folder / "begun")
        for name in ("runs.csv", "points.csv", "failures.csv", "series.nc", "manifest.json"):
            (self.folder / "begun" / name).unlink()
        shutil.rmtree(self.folder / "begun/shards")
        (self.folder / "begun/timing.csv").write_text("")
        self.call("sweep", self.null, *axis, "begun")
        before = self.tables("begun")
        (self.folder / "begun/shards/0000-of-0001.jsonl").unlink()  # as a kill between the two does, and a user after damage
        self.call("sweep", self.null, *axis, "begun")
        self.assertEqual(self.tables("begun"), before)
        # A version before wrote no marks.
        for name in ("scene.toml", "sweep.toml"):
            path = self.folder / "begun" / name
            path.write_text(path.read_text().replace("# Written by nephos sweep.\n", ""))
        self.call("sweep", self.null, *axis, "begun")
        self.assertEqual(self.tables("begun"), before)
        # One plan in two texts.
        text = (self.folder / "begun/sweep.toml").read_text()
        (self.folder / "begun/sweep.toml").write_text(text + "# a comment\n")
        self.call("merge", "swept", "--out", "begun")
        self.call("merge", "swept", "--out", "tables")
        for folder in ("swept", "tables"):
            self.call("sweep", self.null, *axis, folder)
        self.call("sweep", self.null, *axis, "planned", "--emit", "slurm")
        shutil.rmtree(self.folder / "planned/shards")
        self.call("sweep", self.null, *axis, "planned")
        for left in (("scene.toml",), ("scene.toml", "sweep.toml", "runs.csv"), ("scene.toml", "sweep.toml", "runs.csv", "points.csv")):
            shutil.rmtree(self.folder / "half", ignore_errors=True)
            (self.folder / "half").mkdir()
            for name in left:
                shutil.copy(self.folder / "tables" / name, self.folder / "half" / name)
            self.call("merge", "swept", "--out", "half")

    def test_a_grown_axis_computes_only_what_is_new(self):
        self.sweep("grown", "-j", "2", axis="field.background.ext=0.2,0.05")
        result = self.sweep("grown", "-j", "2", "--json")
        self.assertIn('"before": 6', result.stdout)
        self.sweep("whole", "-j", "2")
        self.assertEqual(self.tables("grown"), self.tables("whole"))
        # A smaller one leaves the others out, and says so.
        result = self.sweep("grown", axis="field.background.ext=0.1")
        self.assertIn("6 records are of other points", result.stderr)
        self.assertEqual(len(rows(self.folder / "grown/points.csv")), 1)

    def test_killed_at_any_time_it_goes_on(self):
        self.sweep("whole", "-j", "2")
        arguments = ("sweep", self.null, "--axis", "field.background.ext=0.05,0.1,0.2", "--replicates", "3", "--steps",
                     "400..3200", "--out", "killed", "-j", "2")
        for wait, kill in ((0.1, signal.SIGKILL), (0.25, signal.SIGTERM), (0.4, signal.SIGKILL), (0.3, signal.SIGINT)):
            process = self.start(*arguments)
            time.sleep(wait)
            process.send_signal(kill)
            process.wait(timeout=PATIENCE)
        shard = self.folder / "killed/shards/0000-of-0001.jsonl"
        if shard.exists():
            with open(shard, "ab") as file:
                file.write(b'{"run":"0123","status":"do')  # a torn record
        self.sweep("killed", "-j", "2")
        self.assertEqual(self.tables("killed"), self.tables("whole"))

    def test_records_that_somebody_forged_are_refused(self):
        """Their hash is right, but no run has such numbers: 7 (steps + 1) values would be one, modulo 2^64."""
        self.sweep("forged", steps="20")
        shard = self.folder / "forged/shards/0000-of-0001.jsonl"
        lines = shard.read_text().splitlines()
        series = shard.with_suffix(".series").read_bytes()

        def forge(key, value):
            text = re.sub(rf'"{key}":\d+', f'"{key}":{value}', lines[0].rsplit(',"xxh3":"', 1)[0])
            sealed = f'{text},"xxh3":"{xxhash.xxh3_128(text.encode()).hexdigest()}"}}'
            shard.write_text("\n".join([sealed, *lines[1:]]) + "\n")
        for key, value, says in (("steps", pow(7, -1, 2**64) - 1, "impossible numbers"), ("steps", 10**12, "impossible numbers"),
                                 ("steps", 10**9, "impossible numbers"), ("series_offset", 2**63, "impossible numbers"),
                                 ("series_bytes", 2**63, "impossible numbers"), ("series_bytes", 2**64 - 1, "impossible numbers"),
                                 ("series_bytes", 1, "packed series are damaged"), ("series_bytes", 10**6, "which has fewer"),
                                 ("series_offset", 10**6, "which has fewer")):
            forge(key, value)
            self.assertIn(says, self.call("merge", "forged", "--out", "merged", status=3).stderr, (key, value))
            self.assertIn(says, self.sweep("forged", steps="20", status=3).stderr, (key, value))
            self.assertEqual(shard.with_suffix(".series").read_bytes(), series)
        forge("replicate", 0)  # the forger's hash is that of the program
        self.sweep("forged", steps="20")

    def damage(self, path, line):
        """Another byte in a line of a shard."""
        lines = path.read_bytes().split(b"\n")
        lines[line] = lines[line].replace(b"done", b"dome")
        path.write_bytes(b"\n".join(lines))

    def test_a_damaged_shard_is_named_and_the_others_are_merged(self):
        self.sweep("one")
        for shard in range(2):
            self.sweep("two", "--shard", f"{shard}/2")
        self.call("merge", "two")
        self.assertEqual(self.tables("two"), self.tables("one"))
        before = self.tables("two")
        path = max((self.folder / "two/shards").glob("*.jsonl"), key=lambda p: p.stat().st_size)
        self.damage(path, 0)
        said = f"{path.name}: the record at byte 0 is damaged, but others follow it"
        # Good tables are not replaced by such with fewer runs, unless one says so.
        result = self.call("merge", "two", status=3)
        self.assertIn(said, result.stderr)
        self.assertIn("two/runs.csv has 1 runs that are in no shard that can be read", result.stderr)
        self.assertEqual(self.tables("two"), before)
        for arguments in (("--out", "new"), ("--overwrite",)):
            self.assertIn(said, self.call("merge", "two", *arguments, status=3).stderr)
            statuses = [run["status"] for run in rows(self.folder / ("new" if "--out" in arguments else "two") / "runs.csv")]
            self.assertEqual((statuses.count("done"), statuses.count("missing")), (8, 1))
        # The other shard is not stopped by it; its own sweep is, and says what to do.
        number = int(path.name[:4])
        self.assertIn(said, self.sweep("two", "--shard", f"{1 - number}/2", status=3).stderr)
        for argument in ("--status", "--dry-run"):
            self.assertIn(said, self.sweep("two", argument, status=3).stderr)
        self.assertIn(said, json.loads(self.sweep("two", "--status", "--json", status=3).stdout)["problems"][0])
        self.assertIn("--overwrite", self.sweep("two", "--shard", f"{number}/2", status=3).stderr)
        self.sweep("two", "--shard", f"{number}/2", "--overwrite")
        self.call("merge", "two")
        self.assertEqual(self.tables("two"), before)

    def test_a_damaged_last_record_is_named(self):
        """What an append left that was cut short has no end of its line, and is written anew; a whole line that is damaged is told."""
        self.sweep("one")
        before = self.tables("one")
        path, = (self.folder / "one/shards").glob("*.jsonl")
        content = path.read_bytes()
        path.write_bytes(content[:-9])
        self.assertIn("1 of 9 runs are missing", self.call("merge", "one", "--out", "cut").stderr)
        path.write_bytes(content[:content.rindex(b"done")] + b"dome" + content[content.rindex(b"done") + 4:])
        said = f"{path.name}: the record at byte {content[:-1].rindex(10) + 1} is damaged"
        for command in (("merge", "one", "--out", "new"), ("report", "one", "-o", "a.html")):
            self.assertIn(said, self.call(*command, status=3).stderr)
        self.assertIn(said, self.sweep("one", "--status", status=3).stderr)
        self.sweep("one")
        self.assertEqual(self.tables("one"), before)
        # Of one shard of several, until the run is done in any of them.
        for n in range(3):
            self.sweep("three", "--shard", f"{n}/3")
        path = self.folder / "three/shards/0001-of-0003.jsonl"
        content = path.read_bytes()
        path.write_bytes(content[:content.rindex(b"done")] + b"dome" + content[content.rindex(b"done") + 4:])
        self.assertIn("is damaged", self.call("merge", "three", status=3).stderr)
        self.assertIn("is damaged", self.sweep("three", "--status", status=3).stderr)
        self.sweep("three")
        self.call("merge", "three")
        self.sweep("three", "--status")
        self.assertEqual(self.tables("three"), before)

    def test_overwriting_a_shard_leaves_the_others(self):
        for shard in range(3):
            self.sweep("three", "--shard", f"{shard}/3")
        kept = {path: path.read_bytes() for path in (self.folder / "three/shards").glob("*-of-*") if not path.name.startswith("0001")}
        self.assertEqual(len(kept), 4)
        said = self.sweep("three", "--shard", "1/3", "--overwrite", "--json").stdout
        self.assertIn('"before": 0', said)
        for path, content in kept.items():
            self.assertEqual(path.read_bytes(), content)
        self.call("merge", "three")
        self.assertNotIn("missing", (self.folder / "three/runs.csv").read_text())
        # Without a shard all are computed again.
        self.sweep("three", "--overwrite")
        self.assertEqual([path.name for path in sorted((self.folder / "three/shards").glob("*.jsonl"))], ["0000-of-0001.jsonl"])

    def started(self, folder, *arguments):
        """A sweep of long runs that has written its first record."""
        process = self.start("sweep", self.null, "--axis", "field.background.ext=0.05,0.1", "--replicates", "40", "--clouds-every",
                             "0", "--out", folder, "-j", "1", "--steps", "3000", *arguments, stderr=subprocess.PIPE)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        shards = self.folder / folder / "shards"
        for _ in range(600):
            if any(path.stat().st_size > 0 for path in shards.glob("*.jsonl")):
                return process
            time.sleep(0.1)
        self.fail("nothing was written")

    def test_a_folder_that_is_removed_ends_the_sweep_with_an_error(self):
        for damage in (lambda: shutil.rmtree(self.folder / "gone"),
                       lambda: (self.folder / "gone").rename(self.folder / "elsewhere")):
            process = self.started("gone")
            damage()
            process.wait(timeout=PATIENCE)
            self.assertEqual(process.returncode, 3)
            self.assertIn("was removed or replaced while the sweep wrote it", process.stderr.read())

    def test_a_plan_is_not_replaced_while_it_is_run(self):
        """Its runs would be in no table of the other plan."""
        process = self.started("shared", "--shard", "0/2")
        plan = {name: (self.folder / "shared" / name).read_bytes() for name in ("scene.toml", "sweep.toml")}
        shards = self.folder / "shared/shards"
        (shards / "0001-of-0002.jsonl").write_bytes(b"")  # which has done nothing yet
        files = sorted(shards.iterdir())
        for arguments in ([], ["--shard", "0/2"], ["--shard", "1/2"], ["--shard", "1/2", "--overwrite"], ["--emit", "slurm"]):
            said = self.sweep("shared", *arguments, status=3).stderr
            self.assertIn("0000-of-0002.jsonl: a", said)
            self.assertIn("wait for its end", said)
            for name, content in plan.items():
                self.assertEqual((self.folder / "shared" / name).read_bytes(), content)
            self.assertEqual(sorted(shards.iterdir()), files)
        self.assertEqual(self.call("sweep", "shared/sweep.toml", "--out", "shared", "--status").returncode, 0)
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=PATIENCE)
        self.sweep("shared")  # as soon as nobody runs it

    def test_tables_of_another_plan_stay(self):
        self.sweep("tables", "--tracks")
        self.assertTrue((self.folder / "tables/tracks.csv").exists())
        before = self.tables("tables")
        self.sweep("tables", "--tracks", "--shard", "0/1", axis="field.background.ext=0.3")  # of one part, so it makes the tables
        self.assertEqual(len(rows(self.folder / "tables/runs.csv")), 3)
        self.sweep("tables", "--tracks")
        self.assertEqual(self.tables("tables"), before)
        # Another plan, whose parts are merged.
        for shard in range(2):
            self.sweep("tables", "--shard", f"{shard}/2", axis="field.background.ext=0.3,0.4")
        said = self.call("merge", "tables", status=3).stderr
        self.assertIn("tables/runs.csv has 9 runs that tables/sweep.toml does not ask for", said)
        self.assertEqual(self.tables("tables"), before)
        # The same where the records are elsewhere: done runs that are in no record are counted, of whatever plan.
        self.sweep("other", axis="field.background.ext=0.3")
        said = self.call("merge", "other", "--out", "tables", status=3).stderr
        self.assertIn("tables/runs.csv has 9 runs that are in no shard that can be read", said)
        self.assertEqual(self.tables("tables"), before)
        self.call("merge", "tables", "--overwrite")
        self.assertEqual(len(rows(self.folder / "tables/runs.csv")), 6)
        self.assertFalse((self.folder / "tables/tracks.csv").exists(), "of the plan before")

    def test_values_that_differ_by_rounding_have_a_report(self):
        self.sweep("out", axis="field.background.ext=0.3,0.30000000000000004")
        self.call("report", "out", "--out", "page.html")
        self.assertIn("</html>", (self.folder / "page.html").read_text())

    def test_a_copy_of_a_sweep_that_is_made_of_links(self):
        """`cp -l` gives its files a second name each; to grow it under one leaves the other as it was."""
        self.sweep("out")
        shutil.copytree(self.folder / "out", self.folder / "linked", copy_function=os.link)
        before = {path: path.read_bytes() for path in (self.folder / "linked").rglob("*") if path.is_file()}
        self.sweep("out", axis="field.background.ext=0.05,0.1,0.2,0.4")
        self.sweep("undisturbed", axis="field.background.ext=0.05,0.1,0.2,0.4")
        self.assertEqual(self.tables("undisturbed"), self.tables("out"))
        for path, content in before.items():
            self.assertEqual(path.read_bytes(), content, path)
        self.assertIn("9 runs", self.sweep("linked").stderr)

    def test_links_and_pipes_in_the_folder_are_not_followed(self):
        victim = self.folder / "victim.txt"
        for name in ("shards/0000-of-0001.series", "shards/0000-of-0001.jsonl", "shards/lock", "timing.csv"):
            victim.write_text("of somebody else")
            link = self.folder / "out" / name
            link.parent.mkdir(parents=True)
            link.symlink_to(victim)
            said = self.sweep("out", status=3).stderr
            self.assertIn(f"{link.name}: is a link, which is not followed here", said)
            self.assertEqual(victim.read_text(), "of somebody else")
            link.unlink()
            self.sweep("out")
            self.assertTrue((self.folder / "out/runs.csv").exists())
            shutil.rmtree(self.folder / "out")
        (self.folder / "out").mkdir()
        os.mkfifo(self.folder / "out/timing.csv")
        self.assertIn("timing.csv: is not a regular file", self.sweep("out", status=3).stderr)

    def test_a_shard_that_is_written_is_not_removed(self):
        process = self.started("busy", "--shard", "0/2")
        for arguments in (["--shard", "0/2"], []):
            said = self.sweep("busy", "--overwrite", *arguments, status=3).stderr
            self.assertIn("a sweep of another plan is writing into this folder", said)
            said = self.call("sweep", "busy/sweep.toml", "--out", "busy", "--overwrite", *arguments, status=3).stderr
            self.assertIn("another sweep is writing this shard", said)
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=PATIENCE)
        self.assertGreater((self.folder / "busy/shards/0000-of-0002.jsonl").stat().st_size, 0)

    def test_a_worker_leaves_the_signal_to_its_parent(self):
        """A batch system may tell a worker first that the job ends: its run is not recorded as failed."""
        for number in (signal.SIGTERM, signal.SIGHUP):
            folder = f"told-{int(number)}"
            process = self.started(folder)
            children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            for _ in range(2):
                for child in children:
                    os.kill(int(child), number)
                time.sleep(0.5)
            process.send_signal(number)
            self.assertEqual(process.wait(timeout=PATIENCE), 128 + number)
            self.assertNotIn('"failed"', (self.folder / folder / "shards/0000-of-0001.jsonl").read_text())

    def test_records_that_cannot_be_used_have_a_reason(self):
        self.sweep("one", steps="20")
        path = self.folder / "one/shards/0000-of-0001.jsonl"
        path.write_text(path.read_text().replace('"done"', '"dXne"'))
        self.refused(3, "report", "one", says="0000-of-0001.jsonl: the record at byte 0 is damaged")
        # A shard that was never written to has an empty file of series.
        self.sweep("two", steps="20")
        before = self.tables("two")
        path = self.folder / "two/shards/0000-of-0001.jsonl"
        path.unlink()
        path.with_suffix(".series").write_text("")
        self.sweep("two", steps="20")
        self.assertEqual(self.tables("two"), before)
        # Shards that were copied together have no plan of their own.
        for shard in range(2):
            self.sweep(f"host{shard}", "--shard", f"{shard}/2", steps="20")
        shutil.copytree(self.folder / "host1/shards", self.folder / "together/shards")
        self.call("merge", "host0", "host1", "--out", "together")
        self.assertEqual(self.tables("together"), before)
        self.assertEqual((self.folder / "together/sweep.toml").read_bytes(), (self.folder / "host0/sweep.toml").read_bytes())
        self.call("merge", "together", "host0")

    def test_a_crash_costs_one_run(self):
        arguments = ["sweep", self.null, "--axis", "field.background.ext=0.05,0.1", "--replicates", "1", "--clouds-every", "0",
                     "--out", "crash", "-j", "1", "--steps", "30000"]
        process = self.start(*arguments)
        deadline = time.time() + PATIENCE
        children = []
        while time.time() < deadline and not children:
            children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        time.sleep(0.2)
        os.kill(int(children[0]), signal.SIGKILL)
        self.assertEqual(process.wait(timeout=PATIENCE), 1)
        self.assertEqual([run["status"] for run in rows(self.folder / "crash/runs.csv")], ["failed", "done"])
        failure = rows(self.folder / "crash/failures.csv")[0]
        self.assertIn("signal 9", failure["message"])
        # All of the run, in the folder of the tables.
        self.assertRegex(failure["command"], r"^nephos run scene\.toml --statistics-only --set field\.background\.ext=0\.05 "
                                             r"--seed \d+ --set time\.steps=30000 --out run-[0-9a-f]{8}$")
        self.assertIn("1 failed", self.call(*arguments, "--status").stdout)
        self.call(*arguments, status=1)  # it is not tried again unasked
        self.call(*arguments, "--allow-failures")
        self.call(*arguments, "--retry-failed")
        self.assertEqual([run["status"] for run in rows(self.folder / "crash/runs.csv")], ["done", "done"])

    def test_bad_input_is_refused_before_the_first_run(self):
        for arguments, says in ((["--axis", "field.background.ext=0.1,1.5"], "field.background.ext"),
                                (["--axis", "field.background.exd=0.1"], "did you mean `ext`"),
                                (["--axis", "seed=1,2"], "replicates"),
                                (["--axis", "time.steps=10,20"], "range of steps"),
                                (["--axis", "field.background.ext"], "KEY=V,V"),
                                (["--axis", "field.background.ext=0.3..0.1:4"], "from 0.3 to 0.1, which is not FROM below TO"),
                                (["--axis", "field.background.act=log:0..1:4"], "log scale"),
                                (["--axis", "field.background.ext=0.1..0.2"],
                                 "expected field.background.ext=FROM..TO:COUNT, or --points N"),
                                (["--axis", "field.background.ext=0.1,0.2", "--points", "5"],
                                 "--points 5: takes points from ranges, and the axis field.background.ext has values"),
                                (["--until", "cover.se=nought"], "nought"),
                                (["--until", "cower.se=0.1"], "did you mean `cover`"),
                                (["--shard", "3/3"], "'3'"),
                                (["--steps", "5"], "'5'"),
                                (["--design", "hypercube"], "latin_hypercube"),
                                (["--layer", "low"], "no layers"),
                                (["--points", "3"], "has no axis to take points from"),
                                (["--axis", "field.background.ext=0.1,0.2", "--design", "list", "--points", "7"], "has the points of its values"),
                                (["--axis", "lattice.cells[0]=integer:10.5..13.5", "--points", "3"], "which are not whole"),
                                (["--axis", "field.background.act=log:5e-324..1:5"], "spans more than numbers do"),
                                (["--axis", "field.background.ext=0.1..0.1000000000000001:5"], "a range of 1 different values of 12 digits"),
                                (["--axis", "field.background.ext=+-0.1,0.2"], 'is the text "+-0.1"'),
                                (["--clouds-every", "0", "--until", "clouds_per_km2.se=1"], "is of snapshots, and clouds_every = 0 takes none")):
            with self.subTest(arguments=arguments):
                self.assertIn(says, self.call("sweep", self.null, *arguments, "--out", "bad", status=2).stderr)
        self.assertFalse((self.folder / "bad").exists())
        for arguments, says in ((["merge", "nothere"], "nothere: is no folder of a sweep: it has no sweep.toml"),
                                (["report", self.folder], "is no folder of a sweep"),
                                (["report", "null.toml"], "null.toml: is no folder of a sweep")):
            self.refused(3, *arguments, says=says)
        self.sweep("good", steps="20")
        self.refused(3, "merge", "good", "nothere", says="nothere: is no folder")
        plan = self.write("plan.toml", 'scene = "null.toml"\nreplicats = 2\n[[axis]]\nkey = "field.background.ext"\n'
                                       'values = [0.1, [1]]\n[steps]\nmin = 3\n')
        message = self.call("sweep", plan, status=2).stderr
        self.assertIn("did you mean `replicates`?", message)
        self.assertIn("plan.toml:2:1", message)
        self.assertIn("plan.toml:7:7", message)

    def test_designs(self):
        sobol = ("sweep", self.null, "--axis", "field.background.ext=log:0.01..0.4", "--axis",
                 "field.background.act+field.background.hum=0.001..0.1", "--points", "4", "--replicates", "1", "--dry-run",
                 "--out", "x")
        text = self.call(*sobol).stdout
        self.assertIn("4 points (sobol;", text)
        points = re.findall(r"--set field.background.ext=(\S+) --set field.background.act=(\S+) --set field.background.hum=(\S+)",
                            text)
        self.assertEqual(len(points), 4)
        for ext, act, hum in points:
            self.assertEqual(act, hum)
            self.assertTrue(0.01 <= float(ext) <= 0.4 and 0.001 <= float(act) <= 0.1)
        self.assertEqual(len({int(math.log(float(ext) / 0.01) / math.log(40) * 8) for ext, _, _ in points}), 4)
        self.assertEqual(self.call(*sobol).stdout, text)
        self.assertNotIn(points[0][0], self.call(*sobol, "--seed", "2").stdout)
        self.assertFalse((self.folder / "x").exists())
        for design in ("random", "latin_hypercube"):
            self.call("sweep", self.null, "--axis", "field.background.ext=0.05..0.4", "--points", "4", "--design", design,
                      "--replicates", "1", "--out", design, "--steps", "100")
            values = sorted(float(point["field.background.ext"]) for point in rows(self.folder / design / "points.csv"))
            if design == "latin_hypercube":  # one in each quarter
                self.assertEqual([int((value - 0.05) / 0.35 * 4) for value in values], [0, 1, 2, 3])
            # The plan that is in the folder repeats it.
            before = self.tables(design)
            self.call("sweep", f"{design}/sweep.toml", "--out", f"{design}2")
            self.assertEqual(self.tables(f"{design}2"), before)
        pairs = self.call("sweep", self.null, "--axis", "field.background.ext=0.1,0.2", "--axis",
                          "field.background.act=0.01,0.02", "--design", "list", "--dry-run", "-r", "1")
        self.assertIn("2 points", pairs.stdout)

    def test_common_seeds(self):
        self.sweep("a", "--common-seeds", steps="50")
        seeds = {(run["replicate"], run["seed"]) for run in rows(self.folder / "a/runs.csv")}
        self.assertEqual(len(seeds), 3)

    def test_what_is_not_steady_has_no_mean(self):
        result = self.sweep("short", steps="30")
        self.assertIn("are not steady", result.stderr)
        for point in rows(self.folder / "short/points.csv"):
            self.assertEqual((point["not_steady"], point["cover"]), ("3", ""))

    def test_until(self):
        self.call("sweep", self.null, "--replicates", "1", "--steps", "100..20000", "--until", "cover.se=0.001", "--out", "u")
        run = rows(self.folder / "u/runs.csv")[0]
        self.assertLess(float(run["cover_se"]), 0.001)
        self.assertGreater(int(run["steps"]), 500)
        # It has two names, and is one statistic: the same runs.
        self.assertIn("1 of 1 runs done", self.call("sweep", self.null, "--replicates", "1", "--steps", "100..20000", "--until",
                                                    "cloud_cover.se=0.001", "--out", "u", "--status").stdout)
        plan = (self.folder / "u/sweep.toml").read_text()
        self.write("u/named.toml", plan.replace('"cover"', '"cloud_cover"'))
        self.assertIn("1 of 1 runs done", self.call("sweep", "u/named.toml", "--out", "u", "--status").stdout)

    def test_a_run_until_its_error_is_small(self):
        until = ("run", self.null, "--statistics-only", "--until", "cover.se=0.002", "--max-steps", "6000", "--out", "run")
        result = self.call(*until)
        self.assertRegex(result.stderr, r"cover: steady; mean 0\.\d+, standard error 0\.00\d+ after \d+ steps\n")
        table = rows(self.folder / "run/statistics.csv")
        self.assertGreater(len(table), 401)
        self.assertFalse((self.folder / "run/checkpoint.nephos").exists())
        mean = float(result.stderr.split("mean ")[1].split(",")[0])
        self.assertLess(abs(mean - cover(0.002, 0.1)), 0.01)
        # The same steps as without interruption, and nothing to do when it is called again.
        self.call("run", self.null, "--statistics-only", "--set", f"time.steps={len(table) - 1}", "--out", "whole")
        self.assertEqual((self.folder / "run/statistics.csv").read_bytes(), (self.folder / "whole/statistics.csv").read_bytes())
        again = self.call(*until, "--resume")
        self.assertIn("complete already", again.stderr)
        self.assertEqual(len(rows(self.folder / "run/statistics.csv")), len(table))
        self.assertIn("not what --until asks for", self.call(*until[:4], "cover.se=1e-6", "--max-steps", "450", "--out", "short",
                                                             status=1).stderr)
        # The name of the column will do, too; fewer steps than the scene has will not.
        self.assertIn("cover: steady; mean", self.call(*until[:4], "cloud_cover.se=0.01", "--out", "named").stderr)
        self.refused(2, *until[:4], "cover.se=0.1", "--max-steps", "399", "--out", "no", says="takes `time.steps` = 400 at least")
        said = self.call(*until[:4], "cover.se=0.1", "--set", "time.steps=30", "--max-steps", "40", "--out", "short", "--overwrite",
                         status=1).stderr
        self.assertIn("cover: not_steady, so it has no mean after 40 steps: not what --until asks for", said)
        self.refused(2, *until[:4], "clouds_per_km2.se=1", "--out", "no", says="not measured at every step")

    def test_series_are_readable(self):
        from scipy.io import netcdf_file
        self.sweep("a", "-j", "2")
        with netcdf_file(self.folder / "a/series.nc", mmap=False) as file:
            series = file.variables["cloud_area_fraction"]
            self.assertEqual(series.dimensions, ("run", "step"))
            self.assertEqual(series.standard_name, b"cloud_area_fraction")
            for number, run in enumerate(rows(self.folder / "a/runs.csv")):
                begin, used = int(run["warm_up_steps"]), int(run["used_steps"])
                values = [float(value) for value in series[number, begin:begin + used]]
                self.assertAlmostEqual(sum(values) / used, float(run["cover"]), places=6)
                self.assertEqual(float(series[number, 0]), 0)
                self.assertEqual(file.variables["run_id"][number].tobytes().decode(), run["run"])
                levels = file.variables["cloud_area_fraction_in_atmosphere_layer"][number]
                self.assertAlmostEqual(float(levels.mean()), float(run["cloud_fraction"]), places=6)
            self.assertTrue(math.isclose(float(file.variables["time"][1]), 10))
            # CF: what is over runs names its auxiliary coordinates, and they are there.
            seeds = [text.tobytes().decode().strip() for text in file.variables["seed"][:]]
            self.assertEqual(seeds, [run["seed"] for run in rows(self.folder / "a/runs.csv")])
            runs = ["run_id", "realization", "point", "seed", "field_background_ext"]
            for name, others in (("cloud_area_fraction", ["time"]), ("cloud_area_fraction_in_atmosphere_layer", ["height"]),
                                 ("clouds_of_size", ["size_bin_begin"]), ("warm_up_steps", [])):
                self.assertEqual(file.variables[name].coordinates.decode().split(), runs + others, name)
            for name, variable in file.variables.items():
                has = hasattr(variable, "coordinates")
                self.assertEqual(has, variable.dimensions[0] == "run" and name not in runs, name)
        keys = json.loads((self.folder / "a/manifest.json").read_text())["parameters"]
        self.assertEqual((keys["field.background.act"], keys["lattice.cells"], keys["field.background.hum"]), ("0.002", "[64, 64, 10]", "0.0"))
        self.assertIn("density.refine", keys)

    def test_series_of_runs_with_other_steps_and_cells(self):
        from scipy.io import netcdf_file
        self.call("sweep", self.null, "--axis", "time.step_s=10,20", "--axis", "lattice.cell_size_m=50,100", "--replicates", "2", "--steps",
                  "400", "--out", "a")
        with netcdf_file(self.folder / "a/series.nc", mmap=False) as file:
            time, height = file.variables["time"], file.variables["height"]
            self.assertEqual((time.dimensions, height.dimensions), (("run", "step"), ("run", "level")))
            for number, run in enumerate(rows(self.folder / "a/runs.csv")):
                step_s, cell_m = float(run["time.step_s"]), float(run["lattice.cell_size_m"])
                self.assertEqual([float(value) for value in time[number]], [n * step_s for n in range(401)])
                self.assertEqual([float(value) for value in height[number]], [(k + 0.5) * cell_m for k in range(10)])
            for name in ("time", "height"):
                self.assertFalse(hasattr(file.variables[name], "coordinates"))
            self.assertTrue(file.variables["cloud_area_fraction"].coordinates.decode().endswith(" time"))

    def test_numbers_of_toml_are_values_of_an_axis(self):
        steps = ("--replicates", "1", "--steps", "20", "--out")
        self.call("sweep", self.null, "--axis", "time.step_s=0x10,1_0", *steps, "a")
        self.assertEqual([run["time.step_s"] for run in rows(self.folder / "a/runs.csv")], ["16", "10"])
        for name, steps_before in (("0#1.vdb", "1"), ("1_0.vdb", "2")):  # which are no numbers
            self.call("state", self.null, "--steps", steps_before, "--out", name)
        started = self.write("started.toml", NULL.replace('initial = "empty"', 'initial_state = "0#1.vdb"'))
        self.call("sweep", started, "--axis", "lattice.initial_state=0#1.vdb,1_0.vdb", *steps, "c")
        self.assertEqual([pathlib.Path(run["lattice.initial_state"]).name for run in rows(self.folder / "c/runs.csv")], ["0#1.vdb", "1_0.vdb"])
        large = ("9007199254740993", "9007199254740992", "-9007199254740993")
        said = self.call("sweep", self.null, "--axis", "lattice.cells[0]=" + ",".join(large), *steps, "b", status=2).stderr
        self.assertIn(f"--set lattice.cells[0]={large[0]}: error", said)

    def test_a_value_that_looks_like_a_status(self):
        self.call("state", self.null, "--steps", "1", "--out", "a,done,b.vdb")
        self.call("state", self.null, "--steps", "2", "--out", "c.vdb")
        started = self.write("started.toml", NULL.replace('initial = "empty"', 'initial_state = "c.vdb"'))
        sweep = ("sweep", started, "--axis", "lattice.initial_state='a,done,b.vdb',c.vdb", "--replicates", "4", "--steps", "20", "--out", "o")
        self.call(*sweep, "--shard", "0/2")
        for _ in range(2):  # half of the runs are missing, and are not lost
            self.call("merge", "o")
        self.call(*sweep, "--shard", "1/2")
        self.call("merge", "o")
        self.assertEqual({run["status"] for run in rows(self.folder / "o/runs.csv")}, {"done"})

    def test_the_files_of_the_page_work(self):
        page = SOURCE / "docs/research"
        result = self.call("sweep", page / "fair.toml", "--axis", "field.background.ext=0.05..0.4:8", "--replicates", "3",
                           "--steps", "300..3000", "--dry-run")
        self.assertIn("8 points (grid; field.background.ext: 8 values) x 3 replicates = 24 runs of 300 to 3000 steps",
                      result.stdout)
        self.sweep("a", "-j", "2")
        self.call("fit", page / "cover.toml", "--runs", "10", "--out", "fit", "-j", "2")
        for arguments in (["points", "a/points.csv", "field.background.ext", "cover", "0.1", "0.01"],):
            picture = subprocess.run(["/usr/bin/python3", page / "plot.py", *arguments], cwd=self.folder, text=True,
                                     capture_output=True, check=True).stdout
            root = ElementTree.fromstring(picture)
            self.assertEqual(len(root.findall("{http://www.w3.org/2000/svg}circle")), 3)

    def test_a_full_disk_stops_cleanly(self):
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
        result = self.call("sweep", self.null, "--axis", "field.background.ext=0.05,0.1,0.2", "--replicates", "3", "--steps",
                           "400..3200", "--out", "full", "-j", "1", preexec_fn=limit, status=3)
        self.assertIn("cannot write", result.stderr)
        # What is there is whole, and the sweep goes on from it.
        self.sweep("full", "-j", "2")
        self.sweep("whole", "-j", "2")
        self.assertEqual(self.tables("full"), self.tables("whole"))


if __name__ == "__main__":
    unittest.main()
