# SPDX-License-Identifier: Apache-2.0
"""Each sanitizer that the tree is run under would notice what it is there for: faults of seeded_faults.cpp, compiled with the
flags of each preset (CMakePresets.json), and under Valgrind. With NEPHOS_TEST_ALL=1 also a run of the command under Valgrind.

    NEPHOS=... SOURCE=. /usr/bin/python3 tests/sanitizers/sanitizers_test.py"""

import json
import os
import pathlib
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
HERE = SOURCE / "tests/sanitizers"
sys.path.insert(0, str(SOURCE / "tests/apps/command"))
from case import LAYERED, NEPHOS, SCENE  # noqa: E402

ADDRESS = {"heap-overflow": "heap-buffer-overflow", "stack-overflow": "stack-buffer-overflow",
           "use-after-free": "heap-use-after-free", "leak": "LeakSanitizer: detected memory leaks"}
UNDEFINED = {"signed-overflow": "signed integer overflow", "shift": "shift exponent 40 is too large",
             "misaligned": "misaligned address"}
CAST = {"float-cast": "is outside the range of representable values"}
NOTICED = {"asan": {**ADDRESS, **UNDEFINED, **CAST},
           "fuzz": {**ADDRESS, **UNDEFINED},
           "ubsan": {**UNDEFINED, **CAST},
           "tsan": {"race": "ThreadSanitizer: data race"}}
IN_CHILD = {"asan": ("heap-overflow", "signed-overflow"), "fuzz": ("heap-overflow", "signed-overflow"), "ubsan": ("signed-overflow",),
            "tsan": ("race",)}
ENDED = "a sanitizer has ended the process that reads a file"
CHILD = ["density/vdb/sandbox.cpp", "density/vdb/confinement.cpp", "core/text.cpp", "core/descriptor.cpp", "core/threads.cpp"]
MEMCHECK = {"heap-overflow": "Invalid read of size 1", "use-after-free": "Invalid read of size 1",
            "uninitialised": "depends on uninitialised value", "leak": "definitely lost"}
VALGRIND = ["valgrind", "--quiet", "--error-exitcode=99", "--leak-check=full", "--errors-for-leak-kinds=definite",
            "--show-leak-kinds=definite"]

TWO_LAYERS = LAYERED + """\
[[layer]]
name = "high"
lattice = { origin_m = [0, 0, 2000], cells = [40, 30, 6] }
veil = { form = "cirrus" }
"""


def presets():
    """Cache variables of each preset, with what it inherits."""
    named = {preset["name"]: preset for preset in json.loads((SOURCE / "CMakePresets.json").read_text().replace("${sourceDir}", str(SOURCE)))["configurePresets"]}

    def variables(name):
        preset = named[name]
        return {**(variables(preset["inherits"]) if "inherits" in preset else {}), **preset.get("cacheVariables", {})}
    return {name: variables(name) for name in named}


class Sanitizers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos sanitizers "))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)

    def compiled(self, name, compiler, flags):
        program = self.folder / name
        if program.exists():
            return program
        subprocess.run([compiler, "-std=c++20", "-w", "-I", SOURCE, *flags, HERE / "seeded_faults.cpp", *(SOURCE / file for file in CHILD),
                        "-o", program, "-pthread", "-lseccomp"], check=True)
        return program

    def program_of(self, preset):
        """Compiled with the flags of a preset; skips where its compiler is missing."""
        variables = presets()[preset]
        compiler = variables.get("CMAKE_CXX_COMPILER", "g++")
        if shutil.which(compiler) is None:
            self.assertNotIn("NEPHOS_TEST_ALL", os.environ, "./test --all installs Clang")
            self.skipTest(f"{compiler} is not installed")
        return self.compiled(preset, compiler, shlex.split(variables["CMAKE_CXX_FLAGS"] + " " + variables["CMAKE_CXX_FLAGS_DEBUG"]))

    def run_fault(self, fault, *command, in_child=False):
        environment = {k: v for k, v in os.environ.items() if not k.endswith("SAN_OPTIONS")}
        return subprocess.run([*command, fault, *(["in-child"] if in_child else [])], capture_output=True, text=True, env=environment, timeout=120)

    def test_every_preset_with_a_sanitizer_is_tried(self):
        flagged = {name for name, variables in presets().items() if "-fsanitize" in variables.get("CMAKE_CXX_FLAGS", "")}
        self.assertEqual(flagged, set(NOTICED))

    def test_each_notices_its_faults(self):
        for preset, faults in NOTICED.items():
            with self.subTest(preset=preset):
                program = self.program_of(preset)
                for fault, message in faults.items():
                    with self.subTest(fault=fault):
                        result = self.run_fault(fault, program)
                        self.assertNotEqual(result.returncode, 0, result.stderr)
                        self.assertIn(message, result.stderr)

    def test_a_report_in_the_process_that_reads_ends_its_parent(self):
        """Else it would be an error of the file, which many tests expect."""
        for preset, faults in IN_CHILD.items():
            with self.subTest(preset=preset):
                program = self.program_of(preset)
                for fault in faults:
                    with self.subTest(fault=fault):
                        result = self.run_fault(fault, program, in_child=True)
                        self.assertEqual(result.returncode, -signal.SIGABRT, result.stderr)
                        self.assertIn(NOTICED[preset][fault], result.stderr)
                        self.assertIn(ENDED, result.stderr)

    def test_without_one_nothing_is_noticed(self):
        """Else the messages above could come from the program itself."""
        program = self.compiled("plain", "g++", ["-O1", "-g1"])
        for fault in sorted({*ADDRESS, *UNDEFINED, "uninitialised", "float-cast", "race"}):
            with self.subTest(fault=fault):
                self.assertEqual(self.run_fault(fault, program).returncode, 0)
                self.assertEqual(self.run_fault(fault, program, in_child=True).returncode, 0)

    @unittest.skipUnless(shutil.which("valgrind"), "Valgrind is not installed: ./test --all installs it")
    def test_valgrind_notices_its_faults(self):
        program = self.compiled("memory", "g++", ["-O1", "-g1"])
        for fault, message in MEMCHECK.items():
            with self.subTest(fault=fault):
                result = self.run_fault(fault, *VALGRIND, program)
                self.assertEqual(result.returncode, 99, result.stderr)
                self.assertIn(message, result.stderr)
        self.assertEqual(self.run_fault("signed-overflow", *VALGRIND, program).returncode, 0)

    @unittest.skipUnless(os.environ.get("NEPHOS_TEST_ALL"), "a run of minutes: ./test --all")
    def test_a_run_under_valgrind(self):
        """Layers, a veil, states, density, EXR and PNG pictures of the processor, statistics; then resumed."""
        scene = self.folder / "small.toml"
        scene.write_text(TWO_LAYERS.replace("steps = 6", "steps = 2").replace("per_second = 1", "per_second = 1\nexr = true"))
        out = self.folder / "out"
        call = [*VALGRIND, NEPHOS, "run", scene, "--splatting", "cpu", "--threads", "2", "--quiet", "--out", out]
        for more in ([], ["--resume", "--set", "time.steps=3"]):
            result = subprocess.run([*call, *more], capture_output=True, text=True, timeout=3000)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertTrue(list((out / "frames").glob("*.png")) and list((out / "frames").glob("*.exr")))


if __name__ == "__main__":
    unittest.main(verbosity=2)
