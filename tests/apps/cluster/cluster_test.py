# SPDX-License-Identifier: Apache-2.0
"""Sweeps on engines for many machines, each of them real: Slurm on this node, Snakemake, GNU parallel, Dask. The tables have
the bytes of one process. NEPHOS names the binary, SOURCE the source tree, and PYTHONPATH the folder of the package
`nephos`. A missing engine is a failure, never a silent skip."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
sys.path.insert(1, str(SOURCE / "tests/apps/command"))

from case import NEPHOS, NULL_SCENE, PATIENCE, Case  # noqa: E402
from one_node_slurm import Slurm  # noqa: E402

TABLES = ("runs.csv", "points.csv", "failures.csv", "series.nc", "manifest.json")


class Emitted(Case):
    def setUp(self):
        super().setUp()
        self.write("null.toml", NULL_SCENE)
        self.environment["NEPHOS"] = NEPHOS

    def sweep(self, out, *arguments, steps="200..400", replicates=4):
        return self.call("sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1,0.2", "--replicates", replicates,
                         "--steps", steps, "--out", out, *arguments)

    def tables(self, folder):
        return {name: (self.folder / folder / name).read_bytes() for name in TABLES}

    def command(self, *arguments, **options):
        result = subprocess.run([str(word) for word in arguments], cwd=self.folder / "emitted", env=self.environment,
                                capture_output=True, text=True, timeout=PATIENCE, **options)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return result.stdout

    def same_tables(self):
        self.sweep("here")
        self.assertEqual(self.tables("emitted"), self.tables("here"))


class Engines(Emitted):
    def test_snakemake(self):
        said = self.sweep("emitted", "--emit", "snakemake", "--tasks", "3").stdout
        self.assertIn("snakemake --cores 2", said)
        self.command("snakemake", "--cores", "2")
        self.same_tables()
        again = subprocess.run(["snakemake", "--cores", "2"], cwd=self.folder / "emitted", env=self.environment,
                               capture_output=True, text=True)
        self.assertIn("Nothing to be done", again.stdout + again.stderr)

    def test_snakemake_where_runs_fail(self):
        """Values that contradict each other: the runs that have failed are in the tables, which are made all the same."""
        self.write("two.toml", "".join(f"[[wind]]\ntime_s = {time}\nlevels = [{{ height_m = 0, from_deg = 270, speed_m_per_s = 1 }}]\n" for time in (0, 1000))
                   + "[lattice]\ncells = [8, 8, 4]\n")
        self.call("sweep", "two.toml", "--axis", "wind[0].time_s=0,700", "--axis", "wind[1].time_s=600,800", "--replicates", 1, "--steps", "20",
                  "--out", "emitted", "--emit", "snakemake", "--tasks", "2")
        self.command("snakemake", "--cores", "2")
        failures = (self.folder / "emitted/failures.csv").read_text(encoding="utf-8")
        self.assertEqual(failures.count("not after the profile before it"), 1, failures)
        self.assertTrue((self.folder / "emitted/points.csv").exists())
        self.assertTrue((self.folder / "emitted/tables.done").exists())

    def test_snakemake_with_another_number_of_parts(self):
        """What is done of one number of parts says nothing of another one, also where times of files alone decide."""
        self.sweep("emitted", "--emit", "snakemake", "--tasks", "3")
        self.command("snakemake", "--cores", "1", "shards/0-of-3.done")
        self.sweep("emitted", "--emit", "snakemake", "--tasks", "2")
        self.command("snakemake", "--cores", "2", "--rerun-triggers", "mtime")
        self.assertEqual({path.name for path in (self.folder / "emitted/shards").glob("*.done")},
                         {"0-of-3.done", "0-of-2.done", "1-of-2.done"})
        self.same_tables()

    def test_snakemake_goes_on_after_a_part_failed(self):
        self.sweep("emitted", "--emit", "snakemake", "--tasks", "3")
        # One part's machine fails, before nephos is there.
        flaky = pathlib.Path(self.write("flaky nephos", '#!/bin/sh\ncase "$*" in *" 1/3 "*) exit 1 ;; esac\n'
                                        f'exec "{NEPHOS}" "$@"\n'))
        flaky.chmod(0o755)
        failed = subprocess.run(["snakemake", "--cores", "2", "--keep-going"], cwd=self.folder / "emitted",
                                env={**self.environment, "NEPHOS": str(flaky)}, capture_output=True, text=True)
        self.assertNotEqual(failed.returncode, 0)
        self.assertFalse((self.folder / "emitted/points.csv").exists())
        done = (self.folder / "emitted/shards/0000-of-0003.jsonl").read_bytes()
        self.assertGreater(len(done), 0)
        self.command("snakemake", "--cores", "2")
        self.assertEqual((self.folder / "emitted/shards/0000-of-0003.jsonl").read_bytes(), done)
        self.same_tables()

    def test_parallel(self):
        said = self.sweep("emitted", "--emit", "parallel", "--tasks", "3").stdout
        self.assertIn("parallel --jobs 2", said)
        with open(self.folder / "emitted/sweep.parallel") as commands:
            self.command("parallel", "--jobs", "2", "--joblog", "parallel.log", stdin=commands)
        self.assertEqual(len((self.folder / "emitted/parallel.log").read_text().splitlines()), 4)
        self.command(NEPHOS, "merge", ".")
        self.same_tables()

    def test_dask_as_the_page_says(self):
        page = (SOURCE / "docs/research.md").read_text()
        example = page.split("### On several machines")[1].split("With Dask")[1]
        lines = example.split("\n\n")[1].splitlines()
        self.assertTrue(all(line.startswith("    ") for line in lines), lines)
        program = "\n".join(line[4:] for line in lines)
        self.assertIn("LocalCluster", program)
        self.sweep("here", replicates=5)
        main = f"if __name__ == '__main__':\n" + "\n".join(f"    {line}" for line in program.splitlines())
        (self.folder / "emitted").mkdir()
        main = main.replace('"fair.toml"', '"null.toml"').replace("[0.10, 0.12, 0.14]", "[0.05, 0.1, 0.2]")
        self.assertIn("null.toml", main)
        script = self.write("study.py", main.replace("steps=(300, 3000)", "steps=(200, 400)"))
        result = subprocess.run([sys.executable, script], cwd=self.folder, env=self.environment, capture_output=True,
                                text=True, timeout=PATIENCE)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        for name in TABLES:
            self.assertEqual((self.folder / "sweep" / name).read_bytes(), (self.folder / "here" / name).read_bytes(), name)

    def test_what_cannot_be_emitted_is_refused(self):
        self.refused(2, "sweep", "null.toml", "--emit", "slum", says="'slum' is not one of slurm, snakemake and parallel")
        self.refused(2, "sweep", "null.toml", "--emit", "slurm", "--tasks", "0", says="--tasks")
        said = self.call("sweep", "null.toml", "--axis", "field.background.ext=2", "--emit", "slurm", "--out", "x", status=2)
        self.assertIn("a probability per step", said.stderr)
        self.assertFalse((self.folder / "x").exists())


class SlurmNode(Emitted):
    def setUp(self):
        super().setUp()
        folder = tempfile.mkdtemp(prefix="nephos-slurm-")  # paths of slurm.conf have no spaces
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        self.slurm = Slurm(pathlib.Path(folder) / "slurm")
        self.slurm.environment["NEPHOS"] = NEPHOS
        self.addCleanup(self.slurm.stop)
        self.slurm.start()

    def submit(self, *arguments):
        return self.slurm.submit(*arguments, "sweep.slurm", cwd=self.folder / "emitted")

    def test_an_array_of_four(self):
        said = self.sweep("emitted", "--emit", "slurm", "--tasks", "4").stdout
        self.assertIn("sbatch sweep.slurm", said)
        job = self.submit()
        self.assertEqual(self.slurm.wait(job), {str(task): "COMPLETED" for task in range(4)})
        # A task opens its shard if it has runs: ids tell which, and with so few a task may have none.
        self.assertGreaterEqual(len(list((self.folder / "emitted/shards").glob("*-of-0004.jsonl"))), 2)
        self.command(NEPHOS, "merge", ".")
        self.same_tables()

    def running(self, job, tasks):
        """Waits until the tasks have written records; returns the bytes of each shard."""
        for _ in range(600):
            files = {path.name: path.stat().st_size for path in (self.folder / "emitted/shards").glob("*.jsonl")}
            states = [fields["JobState"] for fields in self.slurm.tasks(job).values()]
            if sum(size > 0 for size in files.values()) >= tasks and "RUNNING" in states:
                return files
            time.sleep(0.1)
        self.fail(f"nothing was written: {files} {states}\n{self.slurm.logs()}")

    def test_requeue_goes_on(self):
        """A task that is preempted ends cleanly, and started again it computes only what is missing."""
        self.sweep("emitted", "--emit", "slurm", "--tasks", "1", steps="8000..8000", replicates=8)
        job = self.submit()
        self.running(job, 1)
        result = self.slurm.call("scontrol", "requeue", job)
        self.assertEqual(result.returncode, 0, result.stderr)
        for _ in range(600):
            fields, = self.slurm.tasks(job).values()
            if fields["JobState"] == "PENDING":
                break
            time.sleep(0.1)
        kept = (self.folder / "emitted/shards/0000-of-0001.jsonl").read_bytes()
        self.assertGreater(kept.count(b"\n"), 0)
        self.assertLess(kept.count(b"\n"), 24)
        # A requeued job waits two minutes by default; its start may be moved. The first process may still be ending.
        time.sleep(5)
        self.slurm.call("scontrol", "update", f"JobId={job}", "StartTime=now")
        end = self.slurm.wait(job)
        logs = [path.read_text() for path in (self.folder / "emitted").glob("slurm-*.out")]
        self.assertEqual(set(end.values()), {"COMPLETED"}, f"{logs} {self.slurm.tasks(job)}")
        self.assertEqual({fields["Restarts"] for fields in self.slurm.tasks(job).values()}, {"1"})
        records = (self.folder / "emitted/shards/0000-of-0001.jsonl").read_bytes()
        self.assertTrue(records.startswith(kept))
        self.assertEqual(records.count(b"\n"), 24)
        self.command(NEPHOS, "merge", ".")
        self.sweep("here", steps="8000..8000", replicates=8)
        self.assertEqual(self.tables("emitted"), self.tables("here"))

    def test_scancel_keeps_what_is_done(self):
        self.sweep("emitted", "--emit", "slurm", "--tasks", "2", steps="8000..8000", replicates=8)
        job = self.submit()
        self.running(job, 2)
        self.slurm.call("scancel", job)
        self.assertEqual(set(self.slurm.wait(job).values()), {"CANCELLED"})
        log = "".join(path.read_text() for path in (self.folder / "emitted").glob("slurm-*.out"))
        self.assertIn("the same command goes on", log)
        kept = {path: path.read_bytes() for path in (self.folder / "emitted/shards").glob("*.jsonl")}
        self.assertTrue(all(0 < text.count(b"\n") < 24 for text in kept.values()))
        again = self.submit()
        self.assertEqual(set(self.slurm.wait(again).values()), {"COMPLETED"})
        for path, text in kept.items():
            self.assertTrue(path.read_bytes().startswith(text))
        self.command(NEPHOS, "merge", ".")
        self.sweep("here", steps="8000..8000", replicates=8)
        self.assertEqual(self.tables("emitted"), self.tables("here"))


if __name__ == "__main__":
    unittest.main()
