# SPDX-License-Identifier: Apache-2.0
"""libFuzzer looks for inputs that break a reader: a minute for each target, in ./test --all (docs/reliability.md).

Environment: SOURCE, the repository; TARGETS, the names of the targets, separated by commas; NEPHOS_TEST_ALL=1 for all
of it, else only that the seeds of every target are there; FUZZ_SECONDS, seconds for each target (60).
"""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ["SOURCE"])
TARGETS = os.environ["TARGETS"].split(",")
BUILD = SOURCE / "build" / "fuzz"
SECONDS = int(os.environ.get("FUZZ_SECONDS", "60"))
SEEDS = SOURCE / "tests" / "fuzz" / "inputs"


class Seeds(unittest.TestCase):
    def test_every_target_has_some(self):
        for target in TARGETS:
            files = [p for p in (SEEDS / target).iterdir() if p.is_file()]
            self.assertTrue(files, target)
            self.assertLess(sum(p.stat().st_size for p in files), 200_000, target)

    def test_no_folder_without_a_target(self):
        self.assertEqual(sorted(p.name for p in SEEDS.iterdir()), sorted(TARGETS))


@unittest.skipUnless(os.environ.get("NEPHOS_TEST_ALL"), "./test --all")
class NewInputs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        subprocess.run(["cmake", "--preset", "fuzz"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cmake", "--build", BUILD, "--target", *(f"fuzz_{t}" for t in TARGETS)], check=True)

    def test_none_breaks_a_reader(self):
        for target in TARGETS:
            with self.subTest(target=target), tempfile.TemporaryDirectory() as new:
                seeds = [SEEDS / target]
                if target in ("scene", "toml_edit"):
                    seeds.append(SOURCE / "scenes")
                call = [BUILD / "tests" / "fuzz" / f"fuzz_{target}", f"-max_total_time={SECONDS}", "-timeout=20",
                        "-rss_limit_mb=4096", "-max_len=65536", f"-artifact_prefix={new}/", new, *seeds]
                done = subprocess.run(call, capture_output=True, text=True, errors="replace")
                if done.returncode != 0:
                    for found in Path(new).glob("*-*"):
                        kept = BUILD / f"{target}-{found.name}"
                        shutil.copy(found, kept)
                        print("input kept in", kept, file=sys.stderr)
                self.assertEqual(done.returncode, 0, done.stderr[-6000:])
                runs = [line for line in done.stderr.splitlines() if line.startswith("Done ")]
                self.assertTrue(runs, done.stderr[-2000:])
                print(target, runs[-1])


if __name__ == "__main__":
    unittest.main()
