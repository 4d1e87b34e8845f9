# SPDX-License-Identifier: Apache-2.0
"""Calls of the system that fail, kills, and folders that vanish: no torn file, no success that is none, and always a way
forward. FAILING_CALLS names the library that lets the calls fail (failing_calls.cpp)."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
import unittest

from case import Case, LONG, NEPHOS


class Faults(Case):
    def failing(self, call, path=None, program="nephos"):
        """An environment in which such calls fail."""
        if "FAILING_CALLS" not in os.environ:
            self.skipTest("FAILING_CALLS does not say where the library lies that lets calls fail")
        sanitizer = os.environ.get("LD_PRELOAD", "")
        env = {**self.environment, "LD_PRELOAD": f"{sanitizer} {os.environ['FAILING_CALLS']}".strip(), "FAIL_CALL": call,
               "FAIL_PROGRAM": program}
        return {**env, "FAIL_PATH": path} if path else env

    def run_into(self, out, *arguments, env=None):
        return subprocess.run([NEPHOS, "run", self.scene, "--no-render", "--out", out, *arguments], cwd=self.folder,
                              capture_output=True, text=True, env=env or self.environment, timeout=120)

    def no_leftovers(self, out):
        self.assertEqual([p.name for p in (self.folder / out).rglob(".*")], [])

    def test_a_kill_before_the_first_rows_leaves_a_way_forward(self):
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        for path in ("statistics", "manifest"):
            for number in range(1, 4):
                with self.subTest(path=path, number=number):
                    shutil.rmtree(self.folder / "out", ignore_errors=True)
                    killed = self.run_into("out", env=self.failing(f"write KILL {number} 1", path))
                    if killed.returncode == 0:
                        continue
                    self.assertEqual(killed.returncode, -signal.SIGKILL)
                    again = self.run_into("out")
                    if again.returncode != 0:
                        self.assertIn("--resume", again.stderr)
                        again = self.run_into("out", "--resume")
                    self.assertEqual(again.returncode, 0, again.stderr)
                    self.same_runs("undisturbed", "out")
                    self.no_leftovers("out")

    def test_a_disk_that_is_full_at_the_beginning_leaves_a_way_forward(self):
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        for path in ("statistics", "manifest", "checkpoint"):
            with self.subTest(path=path):
                full = self.run_into("out", env=self.failing("write ENOSPC 1 1000", path))
                self.assertEqual(full.returncode, 3, full.stderr)
                self.assertIn("No space left", full.stderr)
                self.no_leftovers("out")
                self.assertEqual(self.run_into("out").returncode, 0)
                self.same_runs("undisturbed", "out")
                shutil.rmtree(self.folder / "out")

    def test_statistics_that_were_only_begun_are_of_no_value(self):
        self.assertEqual(self.run_into("out").returncode, 0)
        (self.folder / "out/checkpoint.nephos").unlink()
        header = (self.folder / "out/statistics.csv").read_text().splitlines()[0]
        for text in ("", header[:20], header):
            (self.folder / "out/statistics.csv").write_text(text)
            self.assertEqual(self.run_into("out").returncode, 0, text)
            (self.folder / "out/checkpoint.nephos").unlink()
        for text in ("mine", header[:20] + "mine"):
            (self.folder / "out/statistics.csv").write_text(text)
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", says="statistics.csv")

    def test_a_seek_that_fails_tears_no_file(self):
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        for number in (1, 2, 3, 5, 8, 13, 21):
            with self.subTest(number=number):
                result = self.run_into("out", env=self.failing(f"lseek EIO {number} 1", ".vdb"))
                if result.returncode != 0:
                    self.assertEqual(result.returncode, 3)
                    self.assertIn("Input/output error", result.stderr)
                    self.assertEqual(self.run_into("out").returncode, 0)
                self.same_runs("undisturbed", "out")
                self.no_leftovers("out")
                shutil.rmtree(self.folder / "out")

    def test_writes_of_grids_that_fail_are_told(self):
        for number in (1, 4, 7):
            result = self.run_into("out", env=self.failing(f"write EIO {number} 1", ".vdb"))
            self.assertEqual(result.returncode, 3)
            self.assertRegex(result.stderr, r"tiny_000\d\.vdb: cannot write: Input/output error")
            self.no_leftovers("out")
            shutil.rmtree(self.folder / "out")


if __name__ == "__main__":
    unittest.main(verbosity=2)
