# SPDX-License-Identifier: Apache-2.0
"""`nephos validate`, and what every subcommand says of a scene."""

import json
import unittest

from case import BAD, Case, SCENE, SOURCE


class Scenes(Case):
    def test_every_problem_at_once_with_its_place(self):
        bad = self.write("bad.toml", BAD)
        for command in (["validate", bad], ["run", bad, "--no-render"], ["hash", bad]):
            result = self.call(*command, status=2)
            self.assertEqual(result.stdout, "")
            for place in (":2:", ":3:", ":5:"):
                self.assertIn("bad.toml" + place, result.stderr)
            self.assertEqual(result.stderr.count("error:"), 3, result.stderr)
            self.assertIn("cell_size_m", result.stderr)  # did you mean

    def test_json(self):
        bad = self.write("bad.toml", BAD)
        result = self.call("validate", self.scene, bad, "--json", status=2)
        good, wrong = json.loads(result.stdout)
        self.assertTrue(good["valid"])
        self.assertEqual(good["cells"], [32, 24, 12])
        self.assertFalse(wrong["valid"])
        self.assertEqual([p["line"] for p in wrong["problems"]], [2, 3, 5])

    def test_warns_of_clouds_that_the_lattice_cuts(self):
        high = self.write("high.toml", """name = "high"
[lattice]
cells = [64, 64, 16]
cell_size_m = 50
[[field.ellipsoids]]
centre_m = [1600, 1600, 500]
semi_axes_m = [500, 500, 400]
[[field.scatters]]
count = 3
x_m = [0, 3200]
y_m = [1000, 2000]
z_m = [100, 200]
semi_axis_x_m = [300, 300]
semi_axis_y_m = [300, 300]
semi_axis_z_m = [200, 300]
[detail]
apron_cells = 0
""")
        result = self.call("validate", high)
        notes = [line for line in result.stderr.splitlines() if line.startswith("note:")]
        self.assertEqual(len(notes), 3, result.stderr)
        self.assertIn("[[field.ellipsoids]] number 1 reaches up to 100 m above the lattice's top at 800 m", notes[0])
        self.assertIn("[[field.scatters]] number 1 reaches up to 300 m beyond the lattice's west side", notes[1])
        self.assertIn("east side", notes[2])
        report, = json.loads(self.call("validate", high, "--json").stdout)
        self.assertEqual(len(report["warnings"]), 3)
        quiet = self.call("validate", high, "--set", "lattice.cells=[64, 64, 20]", "--set", "detail.apron_cells=4")
        self.assertNotIn("note:", quiet.stderr)

    def test_the_printed_scene_is_the_scene(self):
        self.refused(2, "validate", self.scene, "--print", "--json", says="--print")
        text = self.call("validate", self.scene, "--print").stdout
        self.write("again/tiny.toml", text)
        hashes = [json.loads(self.call("validate", p, "--json").stdout)[0]["scene_hash"]
                  for p in (self.scene, "again/tiny.toml")]
        self.assertEqual(*hashes)

    def test_the_printed_scene_of_a_far_lattice(self):
        far = self.write("far.toml", "[lattice]\ncells = [8, 8, 8]\ncell_size_m = 100\norigin_m = [0, 10000000, 0]\n[[field.scatters]]\n"
                                     "count = 1\ncentre = { hum = 0.1, act = 0.01, ext = 0.1 }\n")
        printed = self.write("printed.toml", self.call("validate", far, "--print").stdout)
        self.assertIn("\ny_m = 10000000.0\n", self.call("validate", printed, "--print").stdout)

    def test_names_of_files_with_a_byte_of_zero(self):
        scene = self.write("models.toml", SCENE.replace("seed = 3\n", 'seed = 3\nmodels = ["Ns.toml\\u0000junk"]\n'))
        self.write("Ns.toml", "")
        self.assertIn("`models[0]` names no file", self.call("validate", scene, status=2).stderr)

    def test_messages_have_the_whole_name_of_a_file_that_the_system_takes(self):
        for key in ('models = ["{}"]', 'lattice.initial_state = "{}"', 'field.grids = [{{of = "hum", file = "{}"}}]',
                    'ground.height_map = "{}.png"', 'wind_field = [{{kind = "grid", files = ["{}"]}}]',
                    'model = [{{name = "Ns", seeds = [{{}}], textures = ["{}"]}}]'):
            for length, says in ((4096, "names no file"), (3900, "a" * 3900)):
                with self.subTest(key, length=length):
                    scene = self.write("long.toml", "lattice.cells = [32, 24, 12]\n" + key.format("a" * length))
                    status = 2 if length > 4095 or "models" in key else 3
                    said = self.call("run", scene, "--splatting", "cpu", "--out", "long", status=status).stderr
                    self.assertIn(says, said)
                    self.assertLess(max(map(len, said.splitlines())), length + 300 if status == 3 or length < 4096 else 300)

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


if __name__ == "__main__":
    unittest.main(verbosity=2)
