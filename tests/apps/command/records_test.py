# SPDX-License-Identifier: Apache-2.0
"""Records of `nephos sweep` that are damaged, or that other processes hold: each is named, and nothing is lost for it."""

import json
import re
import unittest

import xxhash

from case import Case
from sweep_test import NULL, TABLES, rows


class Records(Case):
    def setUp(self):
        super().setUp()
        self.null = self.write("null.toml", NULL)

    def sweep(self, out, *arguments, status=0):
        return self.call("sweep", self.null, "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps", "20",
                         "--out", out, *arguments, status=status)

    def tables(self, folder):
        return {name: (self.folder / folder / name).read_bytes() for name in TABLES}

    def flip(self, path, at):
        content = bytearray(path.read_bytes())
        content[at] ^= 0x10
        path.write_bytes(content)

    def test_a_flipped_bit_of_series_is_named_and_costs_one_run(self):
        self.sweep("whole")
        before = self.tables("whole")
        records = self.folder / "whole/shards/0000-of-0001.jsonl"
        first = json.loads(records.read_text().splitlines()[0])
        series = records.with_suffix(".series")
        part = series.read_bytes()[first["series_offset"]:][:first["series_bytes"]]
        self.assertEqual(first["series_xxh3"], xxhash.xxh3_128(part).hexdigest())
        self.flip(series, first["series_offset"] + first["series_bytes"] // 2)
        said = (f"{records.name}: the record at byte 0 is of run {first['run']}, whose packed series are damaged, at byte "
                f"{first['series_offset']} of {series.name}")
        for argument in ("--status", "--dry-run"):
            result = self.sweep("whole", argument, status=3)
            self.assertIn(said, result.stderr)
            self.assertIn("3 of 4 runs done", result.stdout)
        # Whoever would append behind it says what to do; nothing is changed.
        self.assertIn("--overwrite computes the runs of this shard again", self.sweep("whole", status=3).stderr)
        self.assertIn(said, self.call("merge", "whole", status=3).stderr)
        self.assertEqual(self.tables("whole"), before)
        # Tables and pages are made of the others.
        self.assertIn(said, self.call("merge", "whole", "--out", "others", status=3).stderr)
        self.assertEqual(set(TABLES) - {path.name for path in (self.folder / "others").iterdir()}, set())
        table = rows(self.folder / "others/runs.csv")
        self.assertEqual([run["run"] for run in table if run["status"] == "missing"], [first["run"]])
        self.assertIn(said, self.call("report", "whole", "--out", "page.html", status=3).stderr)
        self.assertIn("3 done, 0 failed, 1 missing", (self.folder / "page.html").read_text())
        # Another folder that has the run is enough, in any order.
        self.sweep("good")
        for folders in (("whole", "good"), ("good", "whole")):
            self.call("merge", *folders, "--out", "both", status=3)
            for name in ("runs.csv", "series.nc"):
                self.assertEqual((self.folder / "both" / name).read_bytes(), before[name])
        self.sweep("whole", "--overwrite")
        self.assertEqual(self.tables("whole"), before)

    def test_damaged_series_without_a_hash_leave_the_tables_as_they_are(self):
        """Those of earlier versions are read as before; what is wrong is found when they are unpacked."""
        self.sweep("old")
        records = self.folder / "old/shards/0000-of-0001.jsonl"
        lines = []
        for line in records.read_text().splitlines():
            text = re.sub(r',"series_xxh3":"\w+"', "", line.rsplit(',"xxh3":"', 1)[0])
            lines.append(f'{text},"xxh3":"{xxhash.xxh3_128(text.encode()).hexdigest()}"}}\n')
        records.write_text("".join(lines))
        before = self.tables("old")
        self.sweep("old")
        self.assertEqual(self.tables("old"), before)
        first = json.loads(lines[0])
        self.flip(records.with_suffix(".series"), first["series_offset"] + 1)
        for arguments in (("sweep", "old/sweep.toml", "--out", "old"), ("merge", "old")):
            for name in TABLES:
                (self.folder / "old" / name).write_bytes(before[name])
            (self.folder / "old/points.csv").write_text("point,as it was\n")
            said = self.call(*arguments, status=3).stderr
            self.assertIn(f"at byte {first['series_offset']}, of run {first['run']}: ", said)
            self.assertIn("`nephos sweep` with --overwrite computes it again", said)
            self.assertEqual((self.folder / "old/points.csv").read_text(), "point,as it was\n")


if __name__ == "__main__":
    unittest.main()
