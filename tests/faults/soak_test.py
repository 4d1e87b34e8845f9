# SPDX-License-Identifier: Apache-2.0
"""A long run with pictures and checkpoints does not grow: after its first tenth neither memory nor descriptors do.

    NEPHOS=... SOURCE=. python3 tests/faults/soak_test.py

20,000 steps and 401 pictures; without NEPHOS_TEST_ALL=1 a tenth of that."""

import os
import pathlib
import statistics
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "apps/command"))
from case import NEPHOS, PATIENCE, SANITIZED, SCENE, Case  # noqa: E402

ALL = os.environ.get("NEPHOS_TEST_ALL") == "1"
STEPS = 20_000 if ALL else 2_000
STEPS_A_PICTURE = 50  # of 10 s
MOST_GROWTH = 4 << 20  # bytes: what is kept of each picture, and what the allocator has not given back
MOST_DESCRIPTORS = 16  # with the files that are being written


class Soak(Case):
    def measured(self, process):
        """The anonymous memory and the number of descriptors of a process that is at work; nothing when it has ended."""
        folder = pathlib.Path(f"/proc/{process.pid}")
        try:
            status = (folder / "status").read_text()
            memory = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("RssAnon:")) * 1024
            return memory, len(list((folder / "fd").iterdir()))
        except (FileNotFoundError, StopIteration, ProcessLookupError):
            return None

    def test_memory_and_descriptors_stay(self):
        scene = self.write("long.toml", SCENE.replace("steps = 6", f"steps = {STEPS}").replace(
            "time_scale = 15", f"time_scale = {10 * STEPS_A_PICTURE}"))
        process = subprocess.Popen([NEPHOS, "run", scene, "--splatting", "cpu", "--out", "out", "--checkpoint-every", "1", "--threads",
                                    "2", "-q"], cwd=self.folder, env=self.environment)
        pictures, found = STEPS // STEPS_A_PICTURE + 1, {}
        while process.poll() is None:
            made = len(list((self.folder / "out/frames").glob("*.png")))
            values = self.measured(process)
            if values is not None and made > pictures // 10:
                found.setdefault(made, values)
            try:
                process.wait(timeout=0.005)
            except subprocess.TimeoutExpired:
                continue
        self.assertEqual(process.wait(timeout=PATIENCE), 0)
        self.assertEqual(len(list((self.folder / "out/frames").glob("*.png"))), pictures)
        self.call("verify", "out")
        self.assertGreater(len(found), 5)
        memory, descriptors = zip(*(found[made] for made in sorted(found)))
        third = len(found) // 3
        first, last = (statistics.median(part) for part in (memory[:third], memory[-third:]))
        print(f"{STEPS} steps, {pictures} pictures: {first / 1e6:.1f} MB in the first third, {last / 1e6:.1f} MB in the last, "
              f"{min(descriptors)} to {max(descriptors)} descriptors", file=sys.stderr)
        if not SANITIZED:  # which keeps what was freed
            self.assertLess(last - first, MOST_GROWTH)
        self.assertLessEqual(max(descriptors), MOST_DESCRIPTORS)


if __name__ == "__main__":
    unittest.main(verbosity=2)
