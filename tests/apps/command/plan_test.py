# SPDX-License-Identifier: Apache-2.0
"""Plans of `nephos sweep`: what they ask for is checked before the first run, for every value of every axis, and what is wrong
is said where it stands."""

import unittest

from case import Case, LAYERED, SANITIZED, limit_addresses
from sweep_test import NULL, rows

# Two layers with lattices of their own, at different heights and of cells of different sizes.
LAYERS = """\
seed = 3
[time]
steps = 20
[[sky]]
name = "clear"
state = 0
clouds = 0
[[layer]]
name = "low"
skies = "clear"
base_height_m = 500
background = { hum = 0.0, act = 0.002, ext = 0.1 }
lattice = { cells = [16, 16, 6], cell_size_m = 80, origin_m = [0, 0, 500] }
[[layer]]
name = "middle"
skies = "clear"
base_height_m = 3400
background = { hum = 0.0, act = 0.02, ext = 0.1 }
lattice = { cells = [16, 16, 6], cell_size_m = 100, origin_m = [0, 0, 3400] }
"""
LOW, MIDDLE = ('{name="%s",skies="clear",base_height_m=%d,background={hum=0.0,act=%s,ext=0.1},'
               'lattice={cells=[16,16,6],cell_size_m=%d,origin_m=[0,0,%d]}}' % layer
               for layer in (("low", 500, "0.002", 80, 500), ("middle", 3400, "0.02", 100, 3400)))
VEIL = '{name="v",veil={form="cirrus"}}'


class Plans(Case):
    def setUp(self):
        super().setUp()
        self.null = self.write("null.toml", NULL)
        self.layers = self.write("layers.toml", LAYERS)

    def refused_plan(self, scene, *arguments, says, status=2):
        """A plan that is refused before anything is written."""
        result = self.refused(status, "sweep", scene, "--replicates", "1", "--steps", "20", "--out", "no", *arguments, says=says)
        self.assertFalse((self.folder / "no").exists())
        return result.stderr

    def test_every_value_has_the_lattice_that_is_measured(self):
        self.refused_plan(self.write("one.toml", LAYERED), "--axis", "layer[0].automaton=true,false",
                          says="axis layer[0].automaton: value 2 is false: the scene has no layer with an automaton")
        self.refused_plan(self.scene, "--axis", f"layer=[],[{VEIL}]",
                          says="the scene has no layer with an automaton")
        self.refused_plan(self.layers, "--layer", "middle", "--axis", "layer[1].name=middle,other",
                          says='axis layer[1].name: value 2 is "other": the scene has no layer `middle` with an automaton, but low, other')
        self.refused_plan(self.layers, "--layer", "middle", "--axis", f"layer=[{LOW},{MIDDLE}],[{LOW}]",
                          says="no layer `middle` with an automaton, but low")
        self.refused_plan(self.layers, "--layer", "high", says="no layer `high` with an automaton, but low, middle")
        self.refused_plan(self.layers, says="layers.toml: the scene has the layers with an automaton low, middle: name one of them")
        self.refused_plan(self.null, "--layer", "low", says="null.toml: the scene has no layers, and so none named `low`")

    def test_tables_have_the_heights_of_the_lattice_of_each_run(self):
        from scipy.io import netcdf_file
        self.call("sweep", self.layers, "--layer", "middle", "--axis", f"layer=[{LOW},{MIDDLE}],[{MIDDLE},{LOW}]",
                  "--replicates", "1", "--steps", "400..1600", "--out", "turned")
        with netcdf_file(self.folder / "turned/series.nc", mmap=False) as file:
            height = file.variables["height"]
            self.assertEqual(height.dimensions, ("level",))
            self.assertEqual([float(value) for value in height[:]], [3400 + (k + 0.5) * 100 for k in range(6)])
        self.call("report", "turned")

    def test_clouds_are_followed_in_the_winds_of_every_value(self):
        said = self.refused_plan(self.null, "--tracks", "--axis", 'wind_field=[],[{kind="roll",x_m=0,y_m=600,radius_m=1200,speed_m_per_s=1.8}]',
                                 says="axis wind_field: value 2 is [{")
        self.assertIn("differs within a level", said)

    def plan(self, text):
        return self.write("plan.toml", 'scene = "null.toml"\nreplicates = 1\nsteps = { min = 20, max = 20 }\n' + text)

    def test_what_is_no_key_is_refused(self):
        for key, says in (("field.background.ext=0.3 #", "character 21 is `=`"), ("seed=7 #", "character 5 is `=`"), ("a\"b", 'character 2 is `"`'),
                          ("field.background.", "ends before its last name"), ("wind[x].levels", "character 6 is `x`"), ("", "ends before")):
            quoted = key.replace('"', '\\"')
            for plan in (f'[[axis]]\nkey = "{quoted}"\nvalues = [0.1, 0.2]\n', f'[[axis]]\nkeys = ["field.background.act", "{quoted}"]\nvalues = [0.1]\n'):
                with self.subTest(plan=plan):
                    said = self.call("sweep", self.plan(plan), "--out", "no", status=2).stderr
                    self.assertIn(f"`{key}` is no key of a scene: {'it ' if says.startswith('ends') else 'its '}{says}", said)
                    self.assertIn("expected such as field.background.ext or wind[0].levels[1].height_m", said)
        self.assertFalse((self.folder / "no").exists())
        fit = self.write("fit.toml", """\
scene = "null.toml"
[[parameter]]
key = "field.background.ext=0.3 #"
prior = { from = 0.1, to = 0.2 }
[[target]]
statistic = "cover"
value = 0.3
sd = 0.1
""")
        said = self.call("fit", fit, "--out", "no", status=2).stderr
        self.assertIn("fit.toml:3:7: error: `field.background.ext=0.3 #` is no key of a scene: its character 21 is `=`", said)

    def test_a_range_says_all_of_itself(self):
        head = '[[axis]]\nkey = "field.background.ext"\n'
        for text, says in (("values = [0.1]\nrange = { from = 0.1, to = 0.2 }", "7:9: error: an axis has both values and a range"),
                           ("values = [0.1]\nrange = { from = 0.1, to = 0.2, count = 3 }", "7:9: error: an axis has both values and a range"),
                           ("range = { count = 3 }", "6:9: error: the range has no `from`"), ("range = { from = 0.1 }", "6:9: error: the range has no `to`"),
                           ("range = { to = 0.3, count = 3 }", "6:9: error: the range has no `from`"),
                           ("range = { from = 0.1, to = 0.3, count = 1 }", "6:41: error: `axis[0].range.count` is 1")):
            with self.subTest(text=text):
                said = self.call("sweep", self.plan(head + text + "\n"), "--out", "no", status=2).stderr
                self.assertIn(f"plan.toml:{says}", said)
        self.assertFalse((self.folder / "no").exists())

    @unittest.skipIf(SANITIZED, "addresses cannot be limited")
    def test_the_largest_run_fits_into_memory(self):
        """Whichever value of whichever axis it has; nothing is written before."""
        limit = {"preexec_fn": lambda: limit_addresses(2 << 30)}
        cells = "lattice.cells=[32,32,10],[4096,4096,512]"
        for arguments, says in ((("--axis", cells), "a run of lattice.cells=[4096, 4096, 512] takes about "),
                                (("--axis", "field.background.ext=0.1,0.2", "--axis", cells, "--set", "lattice.cells=[16,16,4]"),
                                 "a run of lattice.cells=[4096, 4096, 512] takes about "),
                                (("--axis", "lattice.cells[0]=64,4096", "--axis", "lattice.cells[1]=64,4096", "--axis", "lattice.cells[2]=10,512", "-j", "2"),
                                 "2 workers with a run each of lattice.cells[0]=4096, lattice.cells[1]=4096, lattice.cells[2]=512 takes"),
                                (("--axis", "lattice.cells[2]=integer:10..512", "--set", "lattice.cells=[4096,4096,10]", "--points", "2"), "a run of lattice.cells[2]=512 takes")):
            with self.subTest(arguments=arguments):
                result = self.call("sweep", self.null, "--replicates", "1", "--steps", "20", "--out", "no", *(() if "-j" in arguments else ("-j", "1")), *arguments,
                                   status=2, **limit)
                self.assertIn(says, result.stderr)
                self.assertIn("are all there is", result.stderr)
        # Of a list each value meets one of the others alone.
        self.call("sweep", self.null, "--replicates", "1", "--steps", "20", "--design", "list", "--axis", "lattice.cells[0]=4096,16", "--axis",
                  "lattice.cells[1]=16,4096", "--axis", "lattice.cells[2]=10,12", "-j", "1", "--out", "list", **limit)
        fit = self.write("fit.toml", """\
scene = "null.toml"
set = ["lattice.cells=[4096,4096,512]"]
[[parameter]]
key = "field.background.ext"
prior = { from = 0.1, to = 0.2 }
[[target]]
statistic = "cover"
value = 0.3
sd = 0.1
""")
        self.refused(2, "fit", fit, "--out", "no", "-j", "1", says="a run takes about", **limit)
        self.assertFalse((self.folder / "no").exists())

    def test_what_is_wrong_is_said_where_it_stands(self):
        """In the file of the plan, with line and column; of several overrides and values at the one that it is of."""
        ext = '[[axis]]\nkey = "field.background.ext"\n'
        self.call("state", self.scene, "--steps", "1", "--out", "there.vdb")
        ellipsoids = "[{ centre_m = [1000, 1000, 500], semi_axes_m = [500, 500, 400], centre = { hum = 0.2, act = 0.01, ext = 0.1 }, rim = { ext = %s } }]"
        for text, says in (
                (ext + "values = [0.1, 1.5]\n", "6:16: error: `field.background.ext` is 1.5"),
                (ext + "values = [0.1, 0.2, 0.10]\n", "6:21: error: axis field.background.ext: value 3 is 0.1, and so is value 1"),
                ('[[axis]]\nkey = "field.background.exd"\nvalues = [0.1]\n', "5:7: error: unknown key"),
                ('[[axis]]\nkeys = ["field.background.act",\n  "seed"]\nvalues = [0.1]\n', "6:3: error: axis field.background.act+seed: the seed is"),
                (ext + ext + "values = [0.1]\n", "4:1: error: an axis has no values"),
                (ext + "values = [0.1]\n" + ext + "values = [0.2]\n", "8:7: error: key `field.background.ext` is in two axes"),
                ('set = ["name=x", "field.background.hum=7"]\n', "4:18: error: `field.background.hum` is 7"),
                ('set = ["name=x", "field.backgrount.hum=7"]\n', "4:18: error: unknown key"),
                ('design = "sobol"\npoints = 2\n' + ext + "range = { from = -1.0, to = 0.3 }\n", "8:18: error: `field.background.ext` is -1"),
                (ext + "range = { from = 0.1, to = 1.5, count = 3 }\n", "6:28: error: `field.background.ext` is 1.5"),
                (ext + "range = { from = 0.1, to = 0.5 }\n", "6:9: error: axis field.background.ext: has a range without a number"),
                ('design = "sobol"\npoints = 2\n' + ext + 'range = { from = 0.1, to = 7.3, scale = "log" }\n', "8:28: error: `field.background.ext` is 7.3"),
                ('[[axis]]\nkey = "field.ellipsoids"\nvalues = [\n' + ellipsoids % "0.5" + ",\n" + ellipsoids % "7.0" + "]\n", "8:1: error: "),
                ('design = "sobol"\npoints = 8\n[[axis]]\nkey = "lattice.cells[0]"\nrange = { from = 24, to = 64 }\n', "8:9: error: `lattice.cells[0]` is "),
                ('folder = "a\\u0000b"\n', "4:10: error: `folder` names no folder"),
                ('layer = "low"\n', "4:9: error: the scene has no layers, and so none named `low`"),
                ('[[axis]]\nkey = "layer"\nvalues = [[], [{ name = "v", veil = { form = "cirrus" } }]]\n', "6:15: error: ")):
            with self.subTest(text=text):
                self.plan(text)
                said = self.call("sweep", "plan.toml", "--out", "no", status=2).stderr
                self.assertTrue(said.startswith("plan.toml:"), said)
                self.assertIn(f"plan.toml:{says}" if says[0].isdigit() else says, said)
                self.assertNotIn("--set", said)
        plan = self.write("state.toml", 'scene = "tiny.toml"\n[[axis]]\nkey = "lattice.initial_state"\nvalues = ["none.vdb"]\n')
        said = self.call("sweep", plan, "--out", "no", status=3).stderr
        self.assertIn("state.toml:4:11: error: ", said)
        plan = self.write("set.toml", 'scene = "tiny.toml"\nset = ["name=x",\n  "lattice.initial_state=no.vdb"]\n')
        self.assertIn("set.toml:3:3: error: ", self.call("sweep", plan, "--out", "no", status=3).stderr)
        long = "d" * 110  # as names in deep folders begin alike
        self.call("state", self.scene, "--steps", "2", "--out", f"{long}/a.vdb")
        plan = self.write("long.toml", f'scene = "tiny.toml"\n[[axis]]\nkey = "lattice.initial_state"\nvalues = ["there.vdb",\n "{long}/a.vdb",\n'
                                       f' "{long}/b.vdb"]\n')
        self.assertIn("long.toml:6:2: error: ", self.call("sweep", plan, "--out", "no", status=3).stderr)
        # What was given beside it has no place there.
        self.plan(ext + "values = [0.1]\n")
        for arguments, says in ((("--axis", "field.background.act=2"), "--set field.background.act=2: error: "),
                                (("--set", "field.background.act=2"), "--set field.background.act=2: error: "),
                                (("--layer", "low"), "error: null.toml: the scene has no layers")):
            said = self.call("sweep", "plan.toml", *arguments, "--out", "no", status=2).stderr
            self.assertTrue(said.startswith(says), said)
        self.assertFalse((self.folder / "no").exists())

    def test_names_of_files_are_texts(self):
        for name in ("007", "7", "a..b.vdb"):
            for hum in ("0.1", "0.2"):
                self.call("state", self.scene, "--steps", "1", "--set", f"field.background.hum={hum}", "--out", f"{name}.vdb")
            (self.folder / f"{name}.vdb").rename(self.folder / name)
        self.call("state", self.scene, "--steps", "1", "--out", "c.vdb")
        for axis, names in (("007", ["007"]), ("c.vdb,007", ["c.vdb", "007"]), ('c.vdb,"a..b.vdb"', ["c.vdb", "a..b.vdb"]), ("7", ["7"]), ("'7'", ["7"])):
            with self.subTest(axis=axis):
                self.call("sweep", self.scene, "--axis", f"lattice.initial_state={axis}", "--replicates", "1", "--steps", "20", "--out", "files")
                self.assertEqual([run["lattice.initial_state"] for run in rows(self.folder / "files/runs.csv")],
                                 [str(self.folder / name) for name in names])
        said = self.call("sweep", self.scene, "--axis", "lattice.initial_state=7,'7'", "--out", "no", status=2).stderr
        self.assertIn("and so is value 1", said)
        # The end of a range is the number that was given.
        self.call("sweep", self.null, "--axis", "density.extinction_per_m=log:0.3..100", "--points", "4", "--dry-run")
        # A number stays one, however it is written.
        said = self.call("sweep", self.null, "--axis", "lattice.cells[0]=0x10,1_6", "--out", "no", status=2).stderr
        self.assertIn("value 2 is 16, and so is value 1", said)

    def test_a_scene_without_a_name_is_said_where_it_stands(self):
        self.write("plan.toml", 'scene = ""\n')
        self.assertIn("plan.toml:1:9: error: `scene` names no file", self.call("sweep", "plan.toml", status=2).stderr)
        self.assertIn("plan.toml:1:9: error: `scene` names no file", self.call("fit", "plan.toml", status=2).stderr)


if __name__ == "__main__":
    unittest.main()
