# SPDX-License-Identifier: Apache-2.0
"""`nephos fit`: the parameter of a scene whose answer is known in closed form."""

import csv
import json
import re
import unittest

import xxhash

from case import Case

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

    def test_bad_files(self):
        self.write("null.toml", NULL)
        for old, new, says in (("statistic = \"cover\"", "statistic = \"cower\"", "did you mean \"cover\"?"),
                               ("[[parameter]]", "[[paramter]]", "did you mean `parameter`?"),
                               ("from = 0.02", "from = 0.4", "the prior is empty"),
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
        self.assertRegex(said, r"bad.toml:\d+:\d+: .*9 runs are too few")
        self.call("fit", self.write("bad.toml", FIT.replace("runs = 32", "runs = 9")), "--runs", "16", "--out", "cured", "-j", "2")


if __name__ == "__main__":
    unittest.main()
