# SPDX-License-Identifier: Apache-2.0
"""The Python module against the `nephos` command: NEPHOS names the binary, SOURCE the source tree, and PYTHONPATH the
folder of the package `nephos`. The arguments are those of unittest."""

import copy
import inspect
import json
import os
import pathlib
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
sys.path.insert(1, str(SOURCE / "tests/apps/command"))

import nephos  # noqa: E402
from case import BAD, NULL_SCENE, PATIENCE, Case, rows_of  # noqa: E402

FAIR = SOURCE / "docs/research/fair.toml"


def number(text):
    return None if text == "" else float(text)


class Scenes(Case):
    def test_another_interpreter_is_refused(self):
        """pybind11 would wait for ever there."""
        try:
            import _xxsubinterpreters  # noqa: F401
        except ImportError:
            self.skipTest("this Python has no _xxsubinterpreters")
        code = "import _xxsubinterpreters as other\nother.run_string(other.create(), 'import nephos')"
        result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=False)
        self.assertIn("nephos cannot be imported in a subinterpreter", result.stderr)

    def test_keys_are_set_on_a_copy(self):
        scene = nephos.Scene(self.scene)
        changed = scene.set("field.background.ext", 0.5).set("lattice.cells", numpy.array([40, 24, 12])).set("seed", 9)
        self.assertEqual((scene.name, scene.seed, scene.steps, changed.seed), ("tiny", 3, 6, 9))
        self.assertNotEqual(scene, changed)
        self.assertIn("cells = [40, 24, 12]", changed.text())
        self.assertIn("cells = [32, 24, 12]", scene.text())
        self.assertEqual(scene, scene.set("field.background.ext", 0.5).set("field.background.ext", numpy.float64(0.05)))
        again = nephos.Scene.from_text(changed.text())
        self.assertEqual(nephos.Scene.from_text(changed.text(), folder="").text(), again.text())
        self.assertEqual(again, changed)
        self.assertEqual(again.text(), changed.text())
        self.assertEqual(scene.set("name", 'a-b').name, "a-b")
        self.assertIn("enabled = false", scene.set("frames", {"enabled": False, "png": True}).text())
        endless, deep = [], {}
        endless.append(endless)
        for _ in range(200_000):
            deep = {"a": deep}
        class Same:
            def tolist(self):
                return self
        for value in (endless, deep):
            with self.assertRaisesRegex(nephos.Error, "nested more than 64 deep"):
                scene.set("lattice.cells", value)
        for value in (Same(), numpy.longdouble(8), numpy.ones(3, dtype=numpy.longdouble)):
            with self.assertRaisesRegex(nephos.Error, "a value of type (Same|longdouble|float128) cannot stand in a scene"):
                scene.set("lattice.cells", value)

    def test_a_key_is_one_and_no_more(self):
        scene = nephos.Scene(self.scene)
        for key in ("seed=5 #", "field.background.ext = 0.3\n#", "", "wind[", "seed\0"):
            with self.assertRaises(nephos.Error):
                scene.set(key, 7)

    def test_pickling_is_refused(self):
        """By all protocols: what 0 and 1 would write has nothing in it."""
        scene = nephos.Scene(self.scene)
        simulation = nephos.Simulation(scene)
        class Sub(nephos.Scene):
            pass
        for value in (scene, simulation, simulation.density(), Sub(self.scene)):
            for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
                with self.assertRaisesRegex(TypeError, "cannot pickle"):
                    pickle.dumps(value, protocol)
            with self.assertRaises(TypeError):
                copy.deepcopy(value)

    def test_files_of_a_scene_are_those_beside_it_wherever_python_goes(self):
        path = pathlib.Path(self.scene)
        (path.parent / "with-state.toml").write_text(path.read_text().replace("[lattice]", "[lattice]\ninitial_state = \"st.vdb\""))
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(path.parent)
        scene = nephos.Scene("with-state.toml")
        os.chdir("/")
        self.assertIn(f"{path.parent}/st.vdb", scene.text())

    def test_errors_are_those_of_the_command(self):
        path = self.write("bad.toml", BAD)
        with self.assertRaises(nephos.Error) as caught:
            nephos.Scene(path)
        told = self.call("validate", path, status=2).stderr
        self.assertIn(str(caught.exception), told)
        self.assertIn("cell_sise_m", str(caught.exception))
        self.assertEqual((caught.exception.code, caught.exception.file, caught.exception.line), ("usage", path, 2))
        self.assertGreater(caught.exception.column, 0)
        missing = str(self.folder / "none.toml")
        with self.assertRaises(nephos.Error) as caught:
            nephos.Scene(missing)
        self.assertEqual((caught.exception.code, caught.exception.file, caught.exception.line), ("io", missing, None))
        self.assertIn(str(caught.exception), self.call("hash", missing, status=3).stderr)
        scene = nephos.Scene(self.scene)
        with self.assertRaisesRegex(nephos.Error, "field.background.ext"):
            scene.set("field.background.ext", 1.5)
        with self.assertRaisesRegex(nephos.Error, "hum"):
            scene.set("field.background.humm", 0.5)
        with self.assertRaisesRegex(nephos.Error, "type object"):
            scene.set("seed", object())
        with self.assertRaisesRegex(nephos.Error, "ext"):
            scene.set("field.background.ext", float("nan"))
        self.assertEqual(scene, nephos.Scene(self.scene))


class States(Case):
    def setUp(self):
        super().setUp()
        self.simulation = nephos.Simulation(nephos.Scene(self.scene))

    def test_hashes_are_those_of_the_command(self):
        expected = [line.split()[1] for line in self.hashes(self.scene, "--steps", "8").splitlines()]
        got = [self.simulation.hash()] + [self.simulation.step().hash() for _ in range(8)]
        self.assertEqual(got, expected)
        self.assertEqual((self.simulation.step_number, self.simulation.time_s), (8, 80.0))
        other = nephos.Simulation(nephos.Scene(self.scene), seed=2**64 - 1).step(8)
        self.assertEqual(other.hash(), self.hashes(self.scene, "--steps", "8", "--seed", 2**64 - 1).split()[-1])
        for wrong in (-1, 1.5, "2", 2**64, None):
            with self.assertRaises(nephos.Error) as caught:
                self.simulation.step(wrong)
            self.assertEqual(str(caught.exception), f"n is {wrong!r}; expected a whole number of steps, 0 or more")
        for wrong in (-1, 0.5, 2**64):
            with self.assertRaises(nephos.Error) as caught:
                nephos.Simulation(nephos.Scene(self.scene), seed=wrong)
            self.assertEqual(str(caught.exception), f"seed is {wrong!r}; expected a whole number from 0 to 2^64 - 1")
        self.assertEqual(nephos.Simulation(nephos.Scene(self.scene), seed=numpy.int32(5)).step(numpy.uint8(8)).hash(),
                         self.hashes(self.scene, "--steps", "8", "--seed", 5).split()[-1])
        with self.assertRaisesRegex(nephos.Error, "1000000000"):
            self.simulation.step(10**9)
        self.assertEqual(self.simulation.step(0).step_number, 8)

    def test_layers_have_states_of_their_own(self):
        scene = SOURCE / "scenes/climate.toml"
        simulation = nephos.Simulation(nephos.Scene(scene)).step(2)
        self.assertEqual(simulation.hash(), self.hashes(scene, "--steps", "2").split()[-1])
        self.assertGreater(len(simulation.layers), 1)
        of_layers = [simulation.statistics(layer=name) for name in simulation.layers]
        self.assertEqual(simulation.statistics()["cld"], sum(row["cld"] for row in of_layers))
        for number, row in enumerate(of_layers):
            self.assertEqual(row, simulation.statistics(layer=number))
            try:
                cells = simulation.cld(simulation.layers[number])
            except nephos.Error as error:
                self.assertIn("no automaton", str(error))
            else:
                self.assertEqual(cells.sum(), row["cld"])
        with self.assertRaisesRegex(nephos.Error, simulation.layers[1]):
            simulation.cld("no such layer")

    def test_planes_are_read_only_arrays(self):
        self.simulation.step(4)
        statistics = self.simulation.statistics()
        for name in ("hum", "act", "cld"):
            cells = getattr(self.simulation, name)()
            self.assertEqual((cells.shape, cells.dtype), ((12, 24, 32), numpy.bool_))
            self.assertEqual(cells.sum(), statistics[name])
            self.assertGreater(statistics[name], 0)
            words = self.simulation.words(name)
            self.assertEqual((words.shape, words.dtype), ((12, 24, 1), numpy.uint64))
            bits = numpy.unpackbits(words.astype("<u8").view(numpy.uint8), axis=2, bitorder="little")
            numpy.testing.assert_array_equal(bits[:, :, :32].astype(bool), cells)
            for array in (cells, words):
                self.assertFalse(array.flags.writeable)
                with self.assertRaises(ValueError):
                    array[0, 0, 0] = 1
                with self.assertRaises(ValueError):
                    array.setflags(write=True)
        # Arrays outlive steps and the simulation.
        before, words = self.simulation.cld(), self.simulation.words("cld")
        copy, copy_of_words = before.copy(), words.copy()
        self.simulation.step(5)
        self.assertTrue((self.simulation.cld() != before).any())
        del self.simulation
        numpy.testing.assert_array_equal(before, copy)
        numpy.testing.assert_array_equal(words, copy_of_words)
        with self.assertRaisesRegex(nephos.Error, "no plane"):
            nephos.Simulation(nephos.Scene(self.scene)).words("cloud")

    def test_order_is_z_y_x(self):
        import pyopenvdb
        self.simulation.step(3)
        self.call("state", self.scene, "--steps", "3", "--out", "state.vdb")
        for name in ("hum", "act", "cld"):
            expected = numpy.zeros((32, 24, 12), dtype=bool)
            pyopenvdb.read(str(self.folder / "state.vdb"), name).copyToArray(expected)
            numpy.testing.assert_array_equal(getattr(self.simulation, name)(), expected.transpose(2, 1, 0))


class Results(Case):
    def test_statistics_are_those_of_a_run(self):
        self.call("run", self.scene, "--no-render", "--out", "run")
        rows = rows_of(self.folder / "run/statistics.csv")
        simulation = nephos.Simulation(nephos.Scene(self.scene))
        self.assertEqual(len(rows), 7)
        for row in rows:
            got = simulation.statistics(density=True)
            self.assertEqual(list(got), list(row))
            self.assertEqual(got.pop("hash"), row.pop("hash"))
            self.assertEqual(got, {name: number(value) for name, value in row.items()})
            without = simulation.statistics()
            self.assertIsNone(without.pop("mean_density"))
            self.assertIsNone(without.pop("optical_cover"))
            del got["mean_density"], got["optical_cover"], without["hash"]
            self.assertEqual(without, got)
            simulation.step()
        with self.assertRaisesRegex(nephos.Error, "layers"):
            simulation.statistics(layer=0)

    def test_density_and_picture_are_those_of_a_run(self):
        import PIL.Image
        import pyopenvdb
        # Frames of steps 0, 2 and 4.
        self.call("run", self.scene, "--set", "frames.time_scale=20", "--set", "frames.splatting=cpu", "--out", "run")
        scene = nephos.Scene(self.scene).set("frames.splatting", "cpu")
        simulation = nephos.Simulation(scene)
        for frame in (1, 2, 3):
            density = simulation.density()
            values = density.values
            self.assertEqual((values.shape, values.dtype, values.flags.writeable), ((12, 24, 32), numpy.float32, False))
            grid = pyopenvdb.read(str(self.folder / f"run/density/tiny_{frame:04}.vdb"), "density")
            expected = numpy.zeros((32, 24, 12), dtype=numpy.float32)
            grid.copyToArray(expected)
            numpy.testing.assert_array_equal(values, expected.transpose(2, 1, 0))
            self.assertEqual(density.cell_size_m, grid.transform.voxelSize()[0])
            centre = grid.transform.indexToWorld((0, 0, 0))
            numpy.testing.assert_allclose(numpy.array(density.origin_m) + density.cell_size_m / 2, centre)
            mean = simulation.statistics(density=True)["mean_density"]
            self.assertAlmostEqual(values.mean(dtype=float), mean, places=12)
            picture = simulation.picture()
            self.assertEqual((picture.shape, picture.dtype, picture.flags.writeable), ((48, 64, 3), numpy.uint8, False))
            drawn = numpy.asarray(PIL.Image.open(self.folder / f"run/frames/tiny_{frame:04}.png").convert("RGB"))
            numpy.testing.assert_array_equal(picture, drawn)
            simulation.step(2)
        self.assertGreater(picture.std(), 1)

    def test_clouds_fill_the_shadow(self):
        simulation = nephos.Simulation(nephos.Scene(FAIR)).step(40)
        cells = simulation.cld()
        shadow = cells.any(axis=0)
        clouds = simulation.clouds()
        self.assertEqual(clouds["cells"].sum(), shadow.sum())
        numpy.testing.assert_array_equal(clouds["area_m2"], clouds["cells"] * 2500.0)
        self.assertAlmostEqual(clouds["perimeter_m"].sum(), simulation.statistics()["perimeter_m"])
        self.assertLess(len(simulation.clouds(neighbours=8)["cells"]), len(clouds["cells"]))
        space = simulation.clouds(dimensions=3)
        self.assertEqual(space["cells"].sum(), cells.sum())
        self.assertGreaterEqual(len(space["cells"]), len(clouds["cells"]))
        levels = numpy.flatnonzero(cells.any(axis=(1, 2)))
        statistics = simulation.statistics()
        self.assertEqual((space["base_m"].min(), space["top_m"].max()), (statistics["base_m"], statistics["top_m"]))
        self.assertAlmostEqual(space["top_m"].max() - space["base_m"].min(), 50.0 * (levels[-1] - levels[0] + 1))
        self.assertTrue(((space["z_m"] > space["base_m"]) & (space["z_m"] < space["top_m"])).all())
        self.assertFalse(space["cut"].dtype != numpy.bool_ or space["cells"].flags.writeable)
        for wrong in ({"dimensions": 4}, {"neighbours": 6}, {"dimensions": 3, "neighbours": 8}):
            with self.assertRaisesRegex(nephos.Error, "expected"):
                simulation.clouds(**wrong)


    def test_organisation_is_compared_with_chance(self):
        simulation = nephos.Simulation(nephos.Scene(FAIR)).step(100)
        found = simulation.organisation()
        self.assertEqual(set(found), {f"{name}{end}" for name in ("iorg", "scai", "cop") for end in ("", "_random", "_random_sd")})
        # A homogeneous field has clouds of neighbours that form together: more than chance, by many deviations.
        self.assertGreater(abs(found["iorg"] - found["iorg_random"]), 5 * found["iorg_random_sd"])
        # Where cells are independent and there is one level, the shadow is the null model itself.
        chance = nephos.Scene(FAIR).set("field.background.hum", 0.0).set("lattice.cells", [256, 128, 1])
        found = nephos.Simulation(chance.set("field.background.act", 0.02)).step(60).organisation(draws=40)
        for name in ("iorg", "scai", "cop"):
            self.assertLess(abs(found[name] - found[name + "_random"]), 4 * found[name + "_random_sd"], name)
        self.assertTrue(numpy.isnan(nephos.Simulation(chance).organisation()["iorg"]))
        with self.assertRaisesRegex(nephos.Error, "draws is 1"):
            simulation.organisation(draws=1)


class Studies(Case):
    def test_a_sweep_has_the_bytes_of_the_command(self):
        scene = nephos.Scene.from_text(NULL_SCENE)
        sweep = nephos.sweep(scene, {"field.background.ext": numpy.array([0.05, 0.1]),
                                     ("field.background.act",): {"from": 0.001, "to": 0.004, "count": 2, "scale": "log"}},
                             out=self.folder / "python", replicates=2, steps=(200, 400), workers=2)
        self.call("sweep", self.write("null.toml", NULL_SCENE), "--axis", "field.background.ext=0.05,0.1", "--axis",
                  "field.background.act=log:0.001..0.004:2", "--replicates", "2", "--steps", "200..400", "--out", "command")
        for name in ("runs.csv", "points.csv", "series.nc"):
            self.assertEqual((sweep.folder / name).read_bytes(), (self.folder / "command" / name).read_bytes(), name)
        runs, points = sweep.runs(), sweep.points()
        self.assertEqual((len(runs["run"]), len(points["cover"])), (8, 4))
        self.assertEqual((runs["seed"].dtype, runs["cover"].dtype, runs["steps"].dtype.kind, runs["state_hash"].dtype.kind),
                         (numpy.uint64, numpy.float64, "i", "U"))
        numpy.testing.assert_array_equal(runs["field.background.ext"], numpy.repeat([0.05, 0.1], 4))
        self.assertEqual(len(sweep.failures()["message"]), 0)
        # Names that Python takes for numbers stay names.
        rows = (sweep.folder / "runs.csv").read_text()
        for name, kind in (("2024_01", "U"), ("007", "U"), ("nan", "U"), ("1e5", "f"), ("-3", "i"), ("0.25", "f")):
            (sweep.folder / "runs.csv").write_text(rows.replace(",0.1,", f",{name},").replace(",0.05,", f",{name},"))
            found = sweep.runs()["field.background.ext"]
            self.assertEqual((found.dtype.kind, len(set(found))), (kind, 1), name)
            self.assertTrue(kind != "U" or found[0] == name)
        (sweep.folder / "runs.csv").write_text(rows)
        self.assertTrue(sweep.report().read_text().startswith("<!DOCTYPE html>"))
        # Another look at the folder, and the same call, compute nothing.
        before = (sweep.folder / "shards/0000-of-0001.jsonl").stat().st_mtime_ns
        numpy.testing.assert_array_equal(nephos.Sweep(sweep.folder).runs()["cover"], runs["cover"])
        nephos.sweep(scene, {"field.background.ext": [0.05, 0.1], "field.background.act": [0.001, 0.004]},
                     out=sweep.folder, replicates=2, steps=(200, 400))
        self.assertEqual((sweep.folder / "shards/0000-of-0001.jsonl").stat().st_mtime_ns, before)
        # Records that are thrown away are computed again; tables that would lose runs stay, unless one says so.
        nephos.sweep(scene, {"field.background.ext": [0.05], "field.background.act": [0.001]}, out=sweep.folder, replicates=2,
                     steps=(200, 400), overwrite=True, retry_failed=True)
        self.assertNotEqual((sweep.folder / "shards/0000-of-0001.jsonl").stat().st_mtime_ns, before)
        (sweep.folder / "shards/0000-of-0001.jsonl").unlink()
        with self.assertRaisesRegex(nephos.Error, "--overwrite"):
            nephos.merge(sweep.folder)
        self.assertEqual(set(nephos.merge(sweep.folder, overwrite=True).runs()["status"]), {"missing"})

    def test_tables_are_read_as_a_whole_or_not_at_all(self):
        long = [{"levels": [{"height_m": 10 * n, "from_deg": 0, "speed_m_per_s": 5} for n in range(900)]} for _ in range(5)]
        for n, table in enumerate(long):
            table["time_s"] = 100 * n
        scene = nephos.Scene.from_text(NULL_SCENE)
        sweep = nephos.sweep(scene, {"wind": [long, []]}, self.folder / "long", replicates=1, steps=(20, 20))
        self.assertGreater(len(sweep.runs()["wind"][0]), 131_072)
        path = sweep.folder / "runs.csv"
        text = path.read_text()
        lines = text.splitlines(keepends=True)
        for damaged, says in ((text + "\n", "has 0 values"), (lines[0] + "a,b\n", "has 2 values"), ("", "is empty")):
            path.write_text(damaged)
            with self.assertRaisesRegex(nephos.Error, says) as caught:
                sweep.runs()
            self.assertEqual(caught.exception.code, "io")
        path.write_text(text[:-30])
        with self.assertRaisesRegex(nephos.Error, "its last line is cut"):
            sweep.runs()
        path.write_bytes(b"\xff" + text.encode())
        with self.assertRaisesRegex(nephos.Error, "is damaged"):
            sweep.runs()

    def test_a_folder_whose_name_begins_with_a_dash(self):
        scene = nephos.Scene.from_text(NULL_SCENE)
        before = os.getcwd()
        os.chdir(self.folder)
        try:
            sweep = nephos.sweep(scene, {"field.background.ext": [0.1]}, "-x", replicates=1, steps=(20, 20))
            self.assertTrue(sweep.report().is_file())
            self.assertEqual(len(nephos.merge("-x").runs()["run"]), 1)
            self.assertEqual(len(nephos.merge(b"-x").runs()["run"]), 1)
            with self.assertRaisesRegex(nephos.Error, "is no folder of a sweep"):
                nephos.merge("--help")
            name = os.fsdecode(b"cw\xff")  # a current folder that no plan can name
            os.mkdir(name)
            os.chdir(name)
            sweep = nephos.sweep(scene, {"field.background.ext": [0.1]}, self.folder / "there", replicates=1, steps=(20, 20))
            self.assertEqual(len(sweep.runs()["run"]), 1)
        finally:
            os.chdir(before)

    def test_tracks_have_the_numbers_of_the_command(self):
        scene = nephos.Scene.from_text(NULL_SCENE)
        axes = {"field.background.ext": [0.05, 0.1]}
        sweep = nephos.sweep(scene, axes, self.folder / "python", replicates=2, steps=(400, 3200), tracks=True, workers=2)
        self.call("sweep", self.write("null.toml", NULL_SCENE), "--axis", "field.background.ext=0.05,0.1", "--tracks",
                  "--replicates", "2", "--steps", "400..3200", "--out", "command")
        for name in ("runs.csv", "tracks.csv"):
            self.assertEqual((sweep.folder / name).read_bytes(), (self.folder / "command" / name).read_bytes(), name)
        tracks = sweep.tracks()
        numpy.testing.assert_array_equal(tracks["run"], sweep.runs()["run"])
        # Cells of the null scene die with probability ext a step: clouds live longer where it is smaller. Runs that are not
        # steady have no value.
        steady = tracks["regime"] == "steady"
        few, many = (tracks["field.background.ext"] == ext for ext in (0.05, 0.1))
        self.assertTrue((steady & few).any() and (steady & many).any())
        self.assertTrue(numpy.isnan(tracks["births"][~steady]).all())
        self.assertTrue((tracks["births"][steady] > 100).all() and (tracks["deaths"][steady] > 100).all())
        self.assertTrue((tracks["censored"][steady] < tracks["tracks"][steady]).all())
        mean, median = tracks["track_lifetime_mean_s"], tracks["track_lifetime_median_s"]
        self.assertGreater(mean[steady & few].min(), mean[steady & many].max())
        self.assertTrue((median[steady] <= tracks["track_age_longest_s"][steady]).all())
        plain = nephos.sweep(scene, {"field.background.ext": [0.1]}, self.folder / "plain", replicates=1, steps=(200, 400))
        with self.assertRaisesRegex(nephos.Error, "tracks=True"):
            plain.tracks()

    def test_merged_parts_have_a_report(self):
        scene = nephos.Scene.from_text(NULL_SCENE)
        for part in range(2):
            nephos.sweep(scene, {"field.background.ext": [0.05, 0.1]}, self.folder / f"part{part}", replicates=2, steps=(50, 50),
                         workers=1, shard=(part, 2))
        merged = nephos.merge([self.folder / "part0", self.folder / "part1"], self.folder / "merged")
        page = merged.report()
        self.assertEqual(page, self.folder / "merged/report.html")
        self.assertIn("4 done, 0 failed, 0 missing", page.read_text())

    def test_a_fit_has_the_numbers_of_the_command(self):
        self.write("null.toml", NULL_SCENE)
        path = self.write("fit.toml", """\
scene = "null.toml"
runs = 16
proof = 2
clouds_every = 0
[steps]
min = 400
max = 1600
[[parameter]]
key = "field.background.ext"
prior = { from = 0.05, to = 0.2 }
[[target]]
statistic = "cover"
value = 0.2
sd = 0.01
""")
        found = nephos.fit(path, self.folder / "fit")
        posterior = found["posterior"]["field.background.ext"]
        self.assertEqual(posterior.shape, (1000,))
        self.assertAlmostEqual(posterior.mean(), found["parameters"][0]["mean"], delta=0.01)
        self.assertLess(found["parameters"][0]["low"], found["parameters"][0]["high"])
        # Records that are thrown away are computed again.
        records = self.folder / "fit/wave-1/shards/0000-of-0001.jsonl"
        before = records.stat().st_mtime_ns
        nephos.fit(path, self.folder / "fit", retry_failed=True)
        self.assertEqual(records.stat().st_mtime_ns, before)
        self.assertEqual(nephos.fit(path, self.folder / "fit", overwrite=True)["parameters"], found["parameters"])
        self.assertNotEqual(records.stat().st_mtime_ns, before)

    def test_errors_are_those_of_the_command(self):
        scene = nephos.Scene.from_text(NULL_SCENE)
        with self.assertRaisesRegex(nephos.Error, "a probability per step") as caught:
            nephos.sweep(scene, {"field.background.ext": [0.1, 1.5]}, out=self.folder / "bad")
        self.assertEqual(caught.exception.code, "usage")
        self.assertIn("arguments: axis field.background.ext: error: `field.background.ext` is 1.5", str(caught.exception))
        self.assertIsNone(caught.exception.file)
        with self.assertRaisesRegex(nephos.Error, "did you mean"):
            nephos.sweep(scene, {"field.background.exd": [0.1]}, out=self.folder / "bad")
        # No word of the plan, which the user never wrote.
        for axes, options, says in (({"field.background.ext": []}, {}, r"axes\['field.background.ext'\] has no values"),
                                    ({"field.background.ext": [0.1]}, {"replicates": 0}, "arguments:.*`replicates` is 0"),
                                    ({"field.background.ext": {"from": 0.2, "to": 0.1}}, {}, "arguments:.*range of an axis is empty"),
                                    ({"field.background.ext": {"count": 3}}, {}, "axis field.background.ext: error: the range has no `from`"),
                                    ({"field.background.act": [0.1], "seed=7 #": [1]}, {}, "axis seed=7 #: error: `seed=7 #` is no key of a scene"),
                                    ({"field.background.ext": [0.1, 0.1]}, {}, "axis field.background.ext: error: axis .*: value 2 is 0.1, and so"),
                                    ({"field.background.ext": [0.1]}, {"layer": "low"}, "arguments:.*error: the scene has no layers"),
                                    ({"layer": [[{"name": "v", "veil": {"form": "cirrus"}}]]}, {}, "has no layer with an automaton")):
            with self.assertRaisesRegex(nephos.Error, says) as caught:
                nephos.sweep(scene, axes, out=self.folder / "bad", **options)
            self.assertNotIn(tempfile.gettempdir() + "/nephos-", str(caught.exception))
            self.assertIsNone(caught.exception.file)
        for axes, options, says in (([("field.background.ext", [0.1])], {}, "axes is a list; expected a dict"),
                                    ({"field.background.ext": "0.1"}, {}, "is one text; expected a list of values"),
                                    ({"field.background.ext": [0.1]}, {"steps": (20,)}, r"steps is \(20,\); expected \(least, most\)"),
                                    ({"field.background.ext": [0.1]}, {"shard": (0,)}, r"shard is \(0,\); expected \(i, n\)"),
                                    ({"field.background.ext": ["\udc80"]}, {}, "is no text of Unicode")):
            with self.assertRaisesRegex(nephos.Error, says):
                nephos.sweep(scene, axes, out=self.folder / "bad", **options)
        with self.assertRaisesRegex(nephos.Error, "folders is empty"):
            nephos.merge([])
        self.assertFalse((self.folder / "bad").exists())
        with self.assertRaisesRegex(nephos.Error, "runs.csv"):
            nephos.Sweep(self.folder)
        with self.assertRaises(nephos.Error) as caught:
            nephos.fit(self.folder / "none.toml", self.folder / "fit")
        self.assertEqual((caught.exception.code, caught.exception.file), ("io", str(self.folder / "none.toml")))
        bad = self.write("bad.toml", "scene = 'nothere.toml'\n[[target]]\nstatistic = 'cover'\nvalue = 0.3\nsd = 0\n")
        with self.assertRaises(nephos.Error) as caught:
            nephos.fit(bad, self.folder / "fit")
        self.assertEqual((caught.exception.file, caught.exception.line, caught.exception.column), (bad, 1, 9))


class Threads(Case):
    def test_threads_do_not_change_a_bit(self):
        self.addCleanup(nephos.set_threads, 0)
        scene = nephos.Scene(SOURCE / "scenes/cumulus.toml")
        hashes = set()
        for threads in (1, 2, 0):
            nephos.set_threads(threads)
            hashes.add(nephos.Simulation(scene).step(12).hash())
        self.assertEqual(hashes, {self.hashes(SOURCE / "scenes/cumulus.toml", "--steps", "12").split()[-1]})
        with self.assertRaisesRegex(nephos.Error, "-1 threads"):
            nephos.set_threads(-1)

    def test_python_goes_on_while_the_engine_works(self):
        simulation = nephos.Simulation(nephos.Scene(FAIR).set("lattice.cells", [512, 512, 20]))
        seen = []
        worker = threading.Thread(target=lambda: simulation.step(200))
        worker.start()
        while worker.is_alive():
            seen.append(simulation.step_number)  # waits for its turn, not for the end
            time.sleep(0.001)
        worker.join()
        self.assertEqual(simulation.step_number, 200)
        self.assertEqual(seen, sorted(seen))
        self.assertTrue(any(0 < number < 200 for number in seen), seen)

    def test_simulations_and_callers_do_not_disturb_each_other(self):
        expected = [line.split()[1] for line in self.hashes(self.scene, "--steps", "60").splitlines()]
        shared = nephos.Simulation(nephos.Scene(self.scene))
        wrong = []

        def work():
            own = nephos.Simulation(nephos.Scene(self.scene))
            for step in range(1, 31):
                if own.step().hash() != expected[step]:
                    wrong.append(step)
                shared.step()
                shared.cld()
                shared.density()

        workers = [threading.Thread(target=work) for _ in range(2)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        self.assertEqual(wrong, [])
        self.assertEqual((shared.step_number, shared.hash()), (60, expected[60]))

    def test_ctrl_c_ends_a_long_call(self):
        simulation = nephos.Simulation(nephos.Scene(self.scene))
        timer = threading.Timer(1, lambda: os.kill(os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            simulation.step(10**9)
        steps = simulation.step_number
        self.assertTrue(0 < steps < 10**9)
        self.assertEqual(simulation.step().step_number, steps + 1)

    def test_a_sweep_ends_with_python(self):
        """However that ends: a sweep that nobody waits for would keep its folder from the next one."""
        script = self.write("sweep.py", f"""
import nephos, sys
nephos.sweep({str(FAIR)!r}, {{"field.background.ext": [0.1, 0.11, 0.12, 0.13]}}, replicates=50, steps=(10**6, 10**6), workers=2, out=sys.argv[1])
""")
        def is_at_work(process):
            try:
                return os.readlink(process / "cwd") == str(self.folder.resolve())
            except OSError:
                return False

        for number in (signal.SIGTERM, signal.SIGKILL):
            python = subprocess.Popen([sys.executable, script, f"out{number}"], cwd=self.folder)
            while not any((self.folder / f"out{number}").glob("shards/*.jsonl")):
                self.assertIsNone(python.poll())
                time.sleep(0.05)
            python.send_signal(number)
            self.assertEqual(python.wait(), -number)
            end = time.monotonic() + PATIENCE  # the sweep itself would take longer
            while any(is_at_work(process) for process in pathlib.Path("/proc").glob("[0-9]*")):
                self.assertLess(time.monotonic(), end)
                time.sleep(0.1)

    def test_an_exception_ends_a_sweep(self):
        """Whatever a handler raises: no process stays that works without its arguments, and the same call goes on."""
        out = self.folder / "out"

        def stop(*_):
            if any(out.glob("shards/*.jsonl")):
                signal.setitimer(signal.ITIMER_REAL, 0)
                raise TimeoutError

        def sweep():
            return nephos.sweep(nephos.Scene(self.scene), {"field.background.ext": [0.1, 0.2]}, out, replicates=20,
                                steps=(2000, 2000), clouds_every=0, workers=1)

        before = signal.signal(signal.SIGALRM, stop)
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
            with self.assertRaises(TimeoutError):
                sweep()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
        children = pathlib.Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
        self.assertEqual(children, [])
        self.assertEqual(list(sweep().runs()["status"]), ["done"] * 40)

    def test_files_are_those_of_the_current_folder(self):
        """Of models, wherever it is when a key is set; of values of an axis."""
        home = os.getcwd()
        scene = nephos.Scene.from_text("[lattice]\ncells = [8, 8, 8]\n")
        for name in ("Cb", "Ac"):
            (self.folder / name).mkdir()
            shutil.copy(SOURCE / f"scenes/genera/{name}.toml", self.folder / name / "m.toml")
        try:
            texts = []
            for name in ("Cb", "Ac"):
                os.chdir(self.folder / name)
                texts.append(scene.set("models", ["m.toml"]).text())
                self.assertIn(f'name = "{name}"', texts[-1])
            os.chdir(self.folder)
            self.call("state", self.scene, "--steps", "1", "--out", "state.vdb")
            sweep = nephos.sweep(nephos.Scene(self.scene), {"lattice.initial_state": ["state.vdb"]}, "out", replicates=1,
                                 steps=(20, 20))
            self.assertEqual(list(sweep.runs()["status"]), ["done"])
        finally:
            os.chdir(home)
        self.assertNotEqual(*texts)
        with self.assertRaisesRegex(nephos.Error, "has no name"):
            nephos.sweep(scene, {}, "")

    def test_a_forked_child_ends(self):
        """It has none of the threads that libraries began in its parent."""
        program = ("import os, sys, nephos\n"
                   "print('parent', end=' ', flush=True)\n"
                   "if os.fork() == 0:\n"
                   "    print('child', end=' ')\n"
                   "    sys.exit(7)\n"
                   "print(os.waitstatus_to_exitcode(os.wait()[1]))\n")
        result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "parent child 7\n", ""))

    def test_a_program_ends_while_its_daemons_work(self):
        # Python takes the interpreter from them where they come back from the engine.
        program = ("import nephos, threading, time\n"
                   f"simulations = [nephos.Simulation(nephos.Scene({str(self.scene)!r})) for _ in range(2)]\n"
                   "def work(simulation):\n"
                   "    while True:\n"
                   "        simulation.step()\n"
                   "        simulation.hash()\n"
                   "        simulation.density()\n"
                   "for simulation in simulations:\n"
                   "    threading.Thread(target=work, args=[simulation], daemon=True).start()\n"
                   "threading.Thread(target=simulations[0].step, args=[10**8], daemon=True).start()\n"
                   "time.sleep(0.2)\n")
        for _ in range(10):
            result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE)
            self.assertEqual((result.returncode, result.stderr), (0, ""))


class Documentation(Case):
    def test_the_example_of_the_page_runs(self):
        page = (SOURCE / "docs/research.md").read_text()
        section = page.split("## From Python\n")[1].split("\n## ")[0]
        example = re.search(r"(?:^    .*\n|^\n(?=    ))+", section, re.M).group()
        program = inspect.cleandoc(example)
        self.assertIn("import nephos", program)
        shutil.copy(FAIR, self.folder)
        result = subprocess.run([sys.executable, "-c", program], cwd=self.folder, capture_output=True, text=True,
                                timeout=PATIENCE)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        shown = section.split("prints\n\n")[1]
        self.assertEqual(result.stdout, inspect.cleandoc(shown.split("\n\n")[0]) + "\n")

    def test_everything_has_a_docstring_and_a_type(self):
        stub = pathlib.Path(nephos.__file__).with_name("__init__.pyi").read_text()
        compile(stub, "stub", "exec")
        self.assertTrue(pathlib.Path(nephos.__file__).with_name("py.typed").exists())
        for owner in (nephos, nephos.Scene, nephos.Simulation, nephos.Density, nephos.Sweep):
            for name, member in vars(owner).items():
                if name.startswith("_") or inspect.ismodule(member):
                    continue
                self.assertRegex(stub, rf"(def|class) {name}\b")
                if name not in ("name", "seed"):
                    self.assertTrue(member.__doc__, name)


class Notebook(Case):
    def test_the_notebook_runs_and_finds_the_answer(self):
        folder = self.folder / "docs"
        shutil.copytree(SOURCE / "docs/research", folder)
        self.write("kernels/python3/kernel.json", json.dumps(
            {"argv": [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"], "display_name": "Python 3",
             "language": "python"}))
        result = subprocess.run(
            [sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", "--inplace", folder / "thirty-percent.ipynb"],
            cwd=folder, capture_output=True, text=True, timeout=1100,
            env={**os.environ, "JUPYTER_PATH": str(self.folder), "MPLBACKEND": "module://matplotlib_inline.backend_inline"})
        self.assertEqual(result.returncode, 0, result.stderr)
        cells = json.loads((folder / "thirty-percent.ipynb").read_text())["cells"]
        outputs = [output for cell in cells if cell["cell_type"] == "code" for output in cell["outputs"]]
        text = "".join("".join(output["text"]) for output in outputs if output["output_type"] == "stream")
        self.assertEqual(sum("image/png" in output.get("data", {}) for output in outputs), 3)
        mean, low, high = map(float, re.search(r"ext = ([\d.]+), 90 % of the posterior: ([\d.]+) to ([\d.]+)", text).groups())
        self.assertAlmostEqual(mean, 0.118, delta=0.003)
        self.assertTrue(0.10 < low < mean < high < 0.135)
        self.assertRegex(text, r"fixed \[ ?0\.9")
        self.assertRegex(text, r"free ")
        self.assertEqual(text.count("'not_steady'"), 5)
        # What the words of the notebook say is what it printed when it was last run.
        self.assertIn(f"`ext` = {mean:.3f}, and {low:.3f} to {high:.3f}", (folder / "thirty-percent.ipynb").read_text())


class Installation(Case):
    def test_the_installed_package_is_whole(self):
        build = pathlib.Path(nephos.__file__).parents[2]
        script = build / "apps/python/cmake_install.cmake"
        subprocess.run(["cmake", f"-DCMAKE_INSTALL_PREFIX={self.folder}", "-P", script], check=True, capture_output=True)
        folder, = self.folder.glob("lib/python3*/dist-packages")
        names = {path.name.split(".cpython")[0] for path in (folder / "nephos").iterdir()}
        self.assertEqual(names, {"__init__.py", "__init__.pyi", "py.typed", "_nephos", "_studies.py"})
        program = "import nephos; print(nephos.__file__, nephos.Simulation(nephos.Scene('tiny.toml')).step(2).hash())"
        result = subprocess.run([sys.executable, "-c", program], cwd=self.folder, capture_output=True, text=True,
                                check=True, env={**os.environ, "PYTHONPATH": str(folder)})
        self.assertTrue(result.stdout.startswith(str(folder)), result.stdout)
        self.assertEqual(result.stdout.split()[-1], self.hashes(self.scene, "--steps", "2").split()[-1])


if __name__ == "__main__":
    unittest.main()
