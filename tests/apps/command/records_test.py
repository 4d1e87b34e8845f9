# SPDX-License-Identifier: Apache-2.0
"""Records of `nephos sweep` that are damaged, or that other processes hold: each is named, and nothing is lost for it."""

import fcntl
import json
import re
import shutil
import signal
import subprocess
import time
import unittest

import xxhash

from case import NEPHOS, PATIENCE, Case
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

    def test_a_shard_that_is_being_written_is_not_damaged(self):
        """Its series grow before its records do: whoever reads them meanwhile finds both whole."""
        tiny = self.write("smallest.toml", NULL.replace("[64, 64, 10]", "[4, 4, 4]"))
        study = ("sweep", tiny, "--axis", "field.background.ext=0.05,0.1,0.2,0.3", "--replicates", "1500", "--steps", "20..20", "--clouds-every",
                 "0", "-j", "1", "--quiet", "--out", "parts", "--shard")
        writer = subprocess.Popen([NEPHOS, *study, "0/2"], cwd=self.folder, env=self.environment)
        while not (self.folder / "parts/shards/0000-of-0002.series").exists():
            time.sleep(0.01)
        looks = 0
        while writer.poll() is None:
            self.call(*study, "1/2", "--status")
            looks += 1
        self.assertEqual(writer.returncode, 0)
        self.assertGreater(looks, 1)

    def test_a_part_of_a_study_compares_its_own_series(self):
        """In whichever shard they are: with 0 a workflow would go on to tables that cannot be made."""
        for shard in ("0/2", "1/2"):
            self.sweep("two", "--shard", shard)
        series = sorted((self.folder / "two/shards").glob("*.series"))
        damaged, whole = sorted(series, key=lambda path: -path.stat().st_size)[0], None
        number = int(damaged.name[:4])
        self.flip(damaged, 30)
        said = self.sweep("two", "--shard", f"{number}/2", status=3).stderr
        self.assertIn("whose packed series are damaged", said)
        self.assertIn("--overwrite computes the runs of this shard again", said)
        self.sweep("two", "--shard", f"{1 - number}/2")
        self.sweep("two", "--shard", f"{number}/2", "--overwrite")
        self.call("merge", "two")
        # Of another number of parts: done again where the other file is damaged.
        self.sweep("one")
        before = self.tables("one")
        parts = ("0/3", "1/3", "2/3")  # by the ids of the runs, which change with the version of the statistics: some may be empty
        runs = {part: json.loads(self.sweep("one", "--shard", part, "--status", "--json").stdout)["runs"] for part in parts}
        self.assertEqual(sum(runs.values()), 4)
        series = self.folder / "one/shards/0000-of-0001.series"
        series.write_bytes(bytes(255 - byte for byte in series.read_bytes()))
        for part in parts:
            self.sweep("one", "--shard", part, status=3 if runs[part] > 0 else 0)
        (self.folder / "one/shards/0000-of-0001.jsonl").unlink()
        series.unlink()
        self.call("merge", "one")
        self.assertEqual({name: text for name, text in self.tables("one").items() if name != "manifest.json"},
                         {name: text for name, text in before.items() if name != "manifest.json"})

    def test_many_parts_begin_at_once(self):
        """What one has just put into the folder is no file of others to another one."""
        for _ in range(6):
            parts = [subprocess.Popen([NEPHOS, "sweep", self.null, "--axis", "field.background.ext=0.05,0.1", "--replicates", "1", "--steps", "20",
                                       "--clouds-every", "0", "-q", "-j", "1", "--out", "at once", "--shard", f"{n}/12"], cwd=self.folder,
                                      env=self.environment, stderr=subprocess.PIPE, text=True) for n in range(12)]
            for part in parts:
                _, said = part.communicate(timeout=PATIENCE)
                self.assertEqual(part.returncode, 0, said)
            shutil.rmtree(self.folder / "at once")

    def test_a_shard_that_is_begun_again_is_not_damaged(self):
        self.sweep("again")
        for _ in range(8):
            writer = subprocess.Popen([NEPHOS, "sweep", self.null, "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps", "20",
                                       "--out", "again", "--overwrite", "-q"], cwd=self.folder, env=self.environment)
            while writer.poll() is None:
                self.sweep("again", "--status")
            self.assertEqual(writer.returncode, 0)

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

    def test_damage_at_the_beginning_of_a_shard_is_damage(self):
        """Its records end as those of a sweep do. A file of somebody else is refused as before."""
        self.sweep("a")
        before = self.tables("a")
        records = self.folder / "a/shards/0000-of-0001.jsonl"
        self.flip(records, 3)
        said = f"{records.name}: the record at byte 0 is damaged, but others follow it"
        self.assertIn(said + "; --overwrite computes the runs of this shard again", self.sweep("a", status=3).stderr)
        self.assertIn(said, self.call("merge", "a", status=3).stderr)
        self.sweep("a", "--overwrite")
        self.assertEqual(self.tables("a"), before)
        for mine in ('{"my": 1}\n', 'x"xxh3":"0123"}\n'):
            records.write_text(mine)
            for arguments in ((), ("--overwrite",)):
                self.assertIn(f"{records.name}: is there, but a sweep did not write it", self.sweep("a", *arguments, status=2).stderr)
            self.assertEqual(records.read_text(), mine)

    def test_a_signal_ends_the_wait_for_a_folder(self):
        self.sweep("a")
        for folder, arguments in (("a", ()), ("a", ("--overwrite",)), ("new", ())):
            lock = self.folder / folder / "shards/lock"
            lock.parent.mkdir(parents=True, exist_ok=True)
            with open(lock, "w") as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                process = subprocess.Popen([NEPHOS, "sweep", self.null, "--steps", "20", "--replicates", "1", "--out", folder, *arguments],
                                           cwd=self.folder, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                time.sleep(1)
                self.assertIsNone(process.poll())
                process.send_signal(signal.SIGTERM)
                said = process.communicate(timeout=PATIENCE)[1]  # while the lock is held still
                self.assertEqual(process.returncode, 143)
                self.assertIn("stopped after 0 of 1 runs", said)
        # Who has the folder later goes on.
        self.assertFalse((self.folder / "new/sweep.toml").exists())
        self.call("sweep", self.null, "--steps", "20", "--replicates", "1", "--out", "new")

    def test_a_torn_line_of_times_is_dropped(self):
        self.sweep("a")
        times = self.folder / "a/timing.csv"
        whole = times.read_text()
        for torn in ("0,1,1,4,0.", "0"):
            times.write_text(whole + torn)
            self.sweep("a", "--overwrite")
            lines = times.read_text().splitlines()
            self.assertEqual("\n".join(lines[:-1]) + "\n", whole)
            self.assertRegex(lines[-1], r"\A0,1,\d+,4,\d+\.\d{3}\Z")
        times.write_text("shard,shards,wor")
        self.sweep("a", "--overwrite")
        self.assertEqual(times.read_text().splitlines()[0], "shard,shards,workers,runs,wall_s")

    def test_a_fit_names_damaged_records_beside_its_own(self):
        fit = self.write("fit.toml", """\
scene = "null.toml"
runs = 10
proof = 0
steps = { min = 200, max = 1600 }
[[parameter]]
key = "field.background.ext"
prior = { from = 0.08, to = 0.12 }
[[target]]
statistic = "cover"
value = 0.16
sd = 0.02
""")
        self.call("fit", fit, "--out", "fit")
        found = (self.folder / "fit/fit.json").read_bytes()
        shards = self.folder / "fit/wave-1/shards"
        other = shards / "0000-of-0002.jsonl"
        shutil.copy(shards / "0000-of-0001.jsonl", other)
        shutil.copy(shards / "0000-of-0001.series", other.with_suffix(".series"))
        self.flip(other, 20)
        result = self.call("fit", fit, "--out", "fit", status=3)
        self.assertIn(f"error: fit/wave-1/shards/{other.name}: the record at byte 0 is damaged", result.stderr)
        self.assertIn("fitted.toml", result.stdout)
        self.assertEqual((self.folder / "fit/fit.json").read_bytes(), found)


if __name__ == "__main__":
    unittest.main()
