# SPDX-License-Identifier: Apache-2.0
"""`nephos fit`: the parameter of a scene whose answer is known in closed form."""

import contextlib
import csv
import json
import os
import pathlib
import re
import signal
import subprocess
import time
import unittest

import xxhash

from case import NEPHOS, PATIENCE, Case

NULL = """\
[lattice]
cells = [128, 64, 20]
boundaries = ["periodic", "periodic", "open"]
initial = "empty"
[time]
steps = 600
[field.background]
hum = 0.0
act = 0.001
ext = 0.1
"""
FIT = """\
scene = "null.toml"
runs = 32
proof = 4
clouds_every = 0
[steps]
min = 800
max = 6400
[[parameter]]
key = "field.background.ext"
prior = { from = 0.02, to = 0.3, scale = "log" }
[[target]]
statistic = "cover"
value = 0.3
sd = 0.003
"""


def cover(ext):
    fraction = 0.001 * (1 - ext) / (1 - 0.999 * (1 - ext))
    return 1 - (1 - fraction) ** 20


class Fit(Case):
    def test_the_exact_parameter_is_found(self):
        low, high = 0.02, 0.3
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if cover(middle) > 0.3 else (low, middle)
        self.write("null.toml", NULL)
        file = self.write("fit.toml", FIT)
        result = self.call("fit", file, "--out", "fit", "-j", "2")
        self.assertIn("the targets fix 1 of 1 combinations", result.stdout)
        found = json.loads((self.folder / "fit/fit.json").read_text())["parameters"][0]
        self.assertLess(abs(found["mean"] - low), 3 * found["sd"])
        self.assertLess(found["sd"], 0.02 * low)
        with open(self.folder / "fit/posterior.csv", newline="") as samples:
            self.assertEqual(len(list(csv.DictReader(samples))), 1000)
        # The scene that it writes runs, and again nothing is computed and everything is the same.
        self.call("validate", "fit/fitted.toml")
        before = (self.folder / "fit/wave-1/timing.csv").read_text()
        self.assertEqual(self.call("fit", file, "--out", "fit", "-j", "1").stdout, result.stdout)
        self.assertEqual((self.folder / "fit/wave-1/timing.csv").read_text(), before)
        for name in ("fit.json", "fitted.toml", "posterior.csv"):
            self.refused(2, "state", "null.toml", "--steps", "1", "--out", f"fit/{name}", says=f"fit/{name}: is a file of the fit in ")
        self.refused(2, "state", "null.toml", "--steps", "1", "--out", "fit/wave-1/points.csv", says="is a file of the sweep in ")
        (self.folder / "fit/fit.json").unlink()  # as after a kill
        for name in ("fitted.toml", "posterior.csv"):
            self.refused(2, "state", "null.toml", "--steps", "1", "--out", f"fit/{name}", says="is a file of the fit in ")
        (self.folder / "fit/fitted.toml").unlink()
        self.call("state", "null.toml", "--steps", "1", "--out", "fit/posterior.csv", "-q")  # which a fit would not take for its own

    def test_the_fitted_scene_finds_its_files(self):
        self.write("null.toml", NULL)
        self.call("run", "null.toml", "--no-render", "--set", "density.write_state=true", "--set", "frames.count=1", "--set",
                  "time.steps=2", "--out", "w")
        self.write("data/a.toml", NULL.replace('initial = "empty"', 'initial_state = "../w/density/null_0001.vdb"'))
        file = self.write("data/fit.toml", FIT.replace("null.toml", "a.toml").replace("runs = 32", "runs = 10").replace("proof = 4", "proof = 1"))
        self.call("fit", "data/fit.toml", "--out", "data/fit", "-j", "2")
        self.call("validate", "data/fit/fitted.toml")
        self.call("report", "data/fit/wave-1")
        before = (self.folder / "data/fit/fitted.toml").read_bytes()
        self.assertIn(b'"../../w/density/null_0001.vdb"', before)
        self.folder, home = self.folder / "data/fit", self.folder
        self.call("validate", "fitted.toml")
        self.call("fit", file, "--out", ".", "-j", "2")
        self.folder = home
        self.assertEqual((self.folder / "data/fit/fitted.toml").read_bytes(), before)

    def test_runs_that_failed_are_counted(self):
        """A worker that was killed tells nothing, in a wave or in the proof: status 1, until --retry-failed."""
        self.write("null.toml", NULL)
        file = self.write("cover.toml", FIT.replace("runs = 32", "runs = 16"))
        self.call("fit", file, "--out", "whole", "-j", "2")
        for _ in range(10):  # one that has just ended its last run tells all
            process = subprocess.Popen([NEPHOS, "fit", file, "--out", "out", "-j", "1", "-q", "--overwrite"], cwd=self.folder,
                                       env=self.environment, stderr=subprocess.PIPE, text=True)
            self.addCleanup(process.stderr.close)
            children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                while process.poll() is None:
                    workers = children.read_text().split()
                    if workers and any((self.folder / "out").glob("wave-1/shards/*.jsonl")):
                        os.kill(int(workers[0]), signal.SIGKILL)
                        break
            status = process.wait(timeout=PATIENCE)
            self.assertIn(status, (0, 1, 2))  # 2: too few are left
            self.assertEqual("failed" in process.stderr.read(), status != 0)
            if status != 0:
                break
        else:
            self.fail("no run failed in ten fits whose worker was killed")
        self.call("fit", file, "--out", "out", "-j", "2", "--retry-failed")
        for name in ("posterior.csv", "fitted.toml"):
            self.assertEqual((self.folder / "out" / name).read_bytes(), (self.folder / "whole" / name).read_bytes())

    def test_the_target_that_no_run_has_is_named(self):
        """Nothing pulses without vapour."""
        self.write("null.toml", NULL)
        fit = FIT.replace("runs = 32", "runs = 12") + "[[target]]\nstatistic = \"pulse_period_s\"\nvalue = 100\nsd = 5\n"
        said = self.refused(2, "fit", self.write("fit.toml", fit), "--out", "fit", "-j", "2", says="6 of 6 runs have no mean").stderr
        self.assertIn("`pulse_period_s` in 6;", said)

    def test_a_fit_of_another_version_is_overwritten(self):
        """Its records are refused with a cure that helps."""
        self.write("null.toml", NULL)
        file = self.write("fit.toml", FIT.replace("runs = 32", "runs = 10").replace("proof = 4", "proof = 0"))
        self.call("fit", file, "--out", "fit", "-j", "2")
        before = (self.folder / "fit/fit.json").read_bytes()
        for shard in self.folder.glob("fit/wave-*/shards/*.jsonl"):
            lines = []
            for line in shard.read_text().splitlines():
                text = re.sub(r'"statistics_version":\d+', '"statistics_version":1', line.rsplit(',"xxh3":"', 1)[0])
                lines.append(f'{text},"xxh3":"{xxhash.xxh3_128(text.encode()).hexdigest()}"}}\n')
            shard.write_text("".join(lines))
        self.assertIn("give --overwrite", self.call("fit", file, "--out", "fit", status=2).stderr)
        self.call("fit", file, "--out", "fit", "-j", "2", "--overwrite")
        self.assertEqual((self.folder / "fit/fit.json").read_bytes(), before)

    def test_a_file_that_is_missing_is_one_that_cannot_be_read(self):
        """The status is that of the scene or mask itself, 3; with another problem beside it 2."""
        self.write("null.toml", NULL)
        missing = FIT.replace('scene = "null.toml"', 'scene = "nothere.toml"')
        self.assertNotEqual(missing, FIT)
        said = self.call("fit", self.write("bad.toml", missing), "--out", "bad", status=3).stderr
        self.assertIn("bad.toml:1:", said)
        self.assertIn("nothere.toml", said)
        target = '[[target]]\nstatistic = "cover"\nfrom = "nothere.nc"\nsd = 0.1\n'
        of_mask = FIT[:FIT.index("[[target]]")] + target
        self.assertIn("nothere.nc", self.call("fit", self.write("bad.toml", of_mask), "--out", "bad", status=3).stderr)
        self.call("fit", self.write("bad.toml", "rums = 9\n" + of_mask), "--out", "bad", status=2)

    def said_at(self, text, place, *says, status=2):
        """A fit file that is refused at a place, by its own words."""
        said = self.call("fit", self.write("bad.toml", text), "--out", "bad", status=status).stderr
        line = next(n for n, row in enumerate(text.splitlines(), 1) if place in row)
        self.assertRegex(said, rf"bad.toml:{line}:\d+: error: ")
        self.assertIn(f"\n {line} | {place}", said)
        for part in says:
            self.assertIn(part, said)
        self.assertNotIn("--set", said)
        self.assertEqual(said.count(": error: "), 1, said)
        self.assertFalse((self.folder / "bad").exists())

    def test_what_is_wrong_is_said_where_it_stands(self):
        self.write("null.toml", NULL)
        second = "[[parameter]]\nkey = \"field.background.act\"\nprior = { from = 0.001, to = 0.002 }\n"
        self.said_at(FIT.replace("value = 0.3", "value = 1.3"), "value = 1.3", "`cover` of 1.3", "above 0 and below 1")
        self.said_at(FIT.replace("value = 0.3", "value = 0"), "value = 0", "above 0 and below 1")
        self.said_at(FIT.replace('"cover"\nvalue = 0.3', '"base_mean_m"\nvalue = 0'), "value = 0", "`base_mean_m` of 0",
                     "expected a number above 0\n")
        self.said_at(FIT.replace("sd = 0.003", "sd = 0"), "sd = 0", "`target[0].sd` is 0", "expected a number above 0\n")
        self.said_at(FIT.replace("[[target]]", second.replace(".act", ".ext") + "[[target]]").replace("key = \"", "keys = \"", 1),
                     "key = \"", "`field.background.ext` is a parameter twice", "expected each key in one [[parameter]]")
        self.said_at(FIT.replace("[[target]]", second.replace("ground.act", "ground") + "[[target]]"), "key = \"field.background\"",
                     "`field.background.ext` and `field.background` overlap", "none is a part of another one")
        self.said_at(FIT.replace("to = 0.3", "to = 1.4"), "prior =", "`field.background.ext` is 1.4, too large",
                     "expected a number from 0 to 1, a probability per step")
        self.said_at(FIT.replace("from = 0.02", "from = -0.1").replace(', scale = "log"', ""), "prior =", "is -0.1, too small")
        self.said_at(FIT.replace("from = 0.02, ", ""), "prior =", "the prior has no `from`")
        self.said_at(FIT.replace("ground.ext", "ground.exd"), "key = ", "did you mean `ext`")
        self.said_at(FIT.replace("field.background.ext", "time.steps"), "key = ", "`time.steps` is no parameter of a fit")
        self.said_at(FIT.replace("null.toml", "nothere.toml"), "scene = ", "nothere.toml: cannot read the scene: No such file",
                     "relative to the folder of this file", status=3)
        self.said_at('layer = "low"\n' + FIT, "layer = ", "has no layers")
        self.said_at('set = "field.background.hum=2"\n' + FIT, "set = ", "`field.background.hum` is 2, too large")
        self.said_at(FIT.replace('"cover"', '"clouds_per_km2"'), "statistic = ", "clouds_every = 0 takes none")
        # Mistakes of the scene stand in the scene; several are told at once.
        self.write("null.toml", NULL.replace("hum = 0.0", "hum = 7"))
        said = self.call("fit", self.write("bad.toml", FIT.replace("sd = 0.003", "sd = 0")), status=2).stderr
        self.assertRegex(said, r"null.toml:8:7: error: `field.background.hum` is 7(.|\n)*bad.toml:14:6: error: `target")
        self.refused(3, "fit", "nothere.toml", says="nothere.toml: cannot read the fit file: No such file")
        self.refused(3, "fit", str(self.folder), says="is a folder, expected a fit file in TOML")

    def test_bad_files(self):
        self.write("null.toml", NULL)
        for old, new, says in (("statistic = \"cover\"", "statistic = \"cower\"", "did you mean \"cover\"?"),
                               ("[[parameter]]", "[[paramter]]", "did you mean `parameter`?"),
                               ("from = 0.02", "from = 0.4", "the prior is empty"),
                               ("from = 0.02, to = 0.3", "from = 0.3, to = 0.30000000000000004", "the prior is too narrow or too wide"),
                               ("from = 0.02, to = 0.3", "from = 1e-310, to = 0.3", "the prior is too narrow or too wide"),
                               ("sd = 0.003", "", "needs statistic, and value and sd or from"),
                               ("field.background.ext", "field.background.exd", "did you mean `ext`"),
                               ("to = 0.3", "to = 1.3", "field.background.ext"),
                               ("runs = 32", "runs = 3", "from 8"),
                               ("runs = 32", "runs = 9", "9 runs are too few for 1 parameters")):
            with self.subTest(new=new):
                file = self.write("bad.toml", FIT.replace(old, new))
                self.assertIn(says, self.call("fit", file, "--out", "bad", status=2).stderr)
                self.assertFalse((self.folder / "bad").exists())
        said = self.call("fit", self.write("bad.toml", FIT), "--runs", "9", "--out", "bad", status=2).stderr
        self.assertRegex(said, r"(?m)^error: 9 runs are too few for 1 parameters: expected 10 or more$")
        self.call("fit", self.write("bad.toml", FIT.replace("runs = 32", "runs = 9")), "--runs", "16", "--out", "cured", "-j", "2")


if __name__ == "__main__":
    unittest.main()
