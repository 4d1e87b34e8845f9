# SPDX-License-Identifier: Apache-2.0
"""The same bits whatever computes them: the scenes of golden_scenes.py, each step's 128-bit hash and the decoded density of
each frame, over vector targets, numbers of threads, and interruptions at random steps; with NEPHOS_TEST_ALL=1 over all scenes
and combinations, and over compilers and optimisation, whose programs are built for it. ../golden/matrix.txt has the hashes.

    NEPHOS=... SOURCE=. TARGETS_LIBRARY=... /usr/bin/python3 tests/determinism/matrix_test.py [Matrix.test_...]
    ... matrix_test.py --write        writes the hashes anew: a decision for docs/adr/, not a habit"""

import concurrent.futures
import csv
import itertools
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import unittest

import golden_scenes

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
GOLDEN = SOURCE / "tests/golden/matrix.txt"
ALL = os.environ.get("NEPHOS_TEST_ALL") == "1"
THREADS = (1, 2, 3, 8)

# Bits of Highway's list of targets. What a processor lacks is left out: it runs the next one below.
SCALAR = 1 << 61 | 1 << 62
SSE4 = SCALAR | 1 << 11 | 1 << 12
AVX2 = SSE4 | 1 << 9 | 1 << 10
AVX512 = AVX2 | 1 << 8 | 1 << 7
FUSED = 1 << 9 | 1 << 8 | 1 << 7  # have fused multiply-add, which refined density takes (docs/determinism.md)
TARGETS = {"scalar": SCALAR, "sse4": SSE4, "avx2": AVX2, "avx512": AVX512}


# glibc then takes the versions of its functions (exp, sin, pow ...) that old processors get: some round otherwise.
OLD_LIBRARY = "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX512F,-AVX512VL,-AVX512BW,-AVX,-SSE4_1,-SSE4_2"
SINES = "import math; print(sum(math.sin(n) * math.exp(n % 7) for n in range(100000)))"


class Runner:
    """Runs scenes in a temporary folder by one program."""

    def __init__(self, program, folder):
        self.program, self.folder = str(program), pathlib.Path(folder)
        self.fused = True  # whether the last program that was told its targets had fused multiply-add

    def run(self, scene, out, *more, targets=None, threads=2, old_library=False):
        environment = dict(os.environ, LC_ALL="C.UTF-8")
        if old_library:
            environment["GLIBC_TUNABLES"] = OLD_LIBRARY
        log = self.folder / "targets.log"
        self.fused = True  # of a program that may take what it likes
        if targets is not None:
            log.unlink(missing_ok=True)
            environment.update(LD_PRELOAD=os.environ["TARGETS_LIBRARY"], NEPHOS_TARGETS=str(TARGETS[targets]),
                               NEPHOS_TARGETS_LOG=str(log))
        result = subprocess.run([self.program, "run", scene, "--no-render", "--quiet", "--out", out, "--threads", str(threads),
                                 *more], capture_output=True, text=True, env=environment, timeout=600)
        assert result.returncode == 0, result.stderr
        if targets is not None:  # Highway asked, and got no more than it was to get
            asked, found = map(int, log.read_text().split()[:2])
            assert asked == TARGETS[targets] and found & ~asked == 0, (targets, asked, found)
            self.fused = found & FUSED != 0

    def hashes(self, scene, more=(), split=None, **options):
        """The lines of the golden file for a scene; run up to step `split`, and then resumed, when that is given."""
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        if split is not None:
            self.run(scene, out, "--set", f"time.steps={split}", **options)
            more = (*more, "--resume")
        self.run(scene, out, *more, **options)
        return lines_of(scene, out)


def lines_of(scene, out):
    """Each step's hash of the automaton, or of each layer's, and each density file's. The hash of a veil, and so the run's with
    one, is that of the text of its options, which has more keys with each that is added: a veil's voxels are compared."""
    name, text = scene.stem, scene.read_text()
    tables = {"": out / "statistics.csv"}
    if "layer = [" in text:
        tables = {f" {path.stem}": path for path in sorted((out / "statistics").glob("*.csv"))}
        if "veil = {" in text:
            del tables[" high"]
    lines = []
    for layer, path in tables.items():
        with open(path, newline="") as file:
            lines += [f"{name}{layer} step {row['step']} {row['hash']}" for row in csv.DictReader(file)]
    manifest = json.loads((out / "manifest.json").read_text())
    for frame in manifest["frames"]:
        lines += [f"{name} {file['path']} {file['voxels_xxh3']}" for file in frame["files"] if "voxels_xxh3" in file]
    return lines


def is_refined(scene):
    return "refine = 1" not in scene.read_text()


def steps_of(lines):
    return [line for line in lines if " step " in line]


def last_step(lines):
    return max(int(line.split(" step ")[1].split()[0]) for line in steps_of(lines))


def promised(scene, lines):
    """Those that are the same everywhere: all, but of refined density (docs/determinism.md)."""
    return steps_of(lines) if is_refined(scene) else lines


def ways_of(number, steps):
    """Options of runs of the scene of that number, the last of them interrupted at a random step."""
    combinations = [(target, threads) for target in TARGETS for threads in THREADS]
    if not ALL:  # a target and a number of threads each, other ones for the next scene
        combinations = [(target, THREADS[(n + number) % 4]) for n, target in enumerate(TARGETS)]
    for target, threads in combinations:
        yield {"targets": target, "threads": threads}
    yield {"more": ("--checkpoint-every", "0.0001")}  # after each step
    draw = random.Random(number)
    yield {"targets": "avx512", "threads": draw.choice(THREADS), "split": draw.randrange(1, steps)}


def difference(way, found, expected):
    """Nothing, or one line that says what differs."""
    if found == expected:
        return []
    pairs = itertools.zip_longest(found, expected)
    return [f"{way}: " + next(f"{one}, expected {other}" for one, other in pairs if one != other)]


def golden():
    lines = {}
    for line in GOLDEN.read_text().splitlines():
        if not line.startswith("#"):
            lines.setdefault(line.split()[0], []).append(line)
    return lines


def build(compiler, optimisation):
    """The command, built by this compiler into the folder of builds."""
    tree = SOURCE / "build" / f"matrix-{compiler}-{optimisation}"
    subprocess.run(["cmake", "-S", SOURCE, "-B", tree, "-G", "Ninja", f"-DCMAKE_CXX_COMPILER={compiler}",
                    "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache", "-DCMAKE_BUILD_TYPE=None",
                    f"-DCMAKE_CXX_FLAGS=-{optimisation}", "-DNEPHOS_BUILD_TESTS=OFF", "-DNEPHOS_BUILD_BENCHMARKS=OFF"],
                   check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["ninja", "-C", tree, "nephos"], check=True, stdout=subprocess.DEVNULL)
    return tree / "bin/nephos"


class Matrix(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos matrix "))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.scenes = golden_scenes.write_all(cls.folder / "scenes")
        cls.golden = golden()
        cls.runs = 0

    @classmethod
    def tearDownClass(cls):
        print(f"{cls.runs} runs compared", file=sys.stderr)

    def every_way(self, program):
        """Scenes beside each other, as many as there are processors: most of their runs are the start of a process."""
        scenes = self.scenes if ALL else self.scenes[::11]  # with layers, too
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            for scene, (runs, different) in zip(scenes, pool.map(lambda scene: self.compare(program, scene), scenes)):
                type(self).runs += runs
                with self.subTest(scene=scene.stem):
                    self.assertEqual(different, [])

    def compare(self, program, scene):
        """How often a scene was run, and the ways to run it that gave other lines, with the first line of each that differs."""
        with tempfile.TemporaryDirectory(dir=self.folder) as folder:
            runner = Runner(program, folder)
            reference = runner.hashes(scene)
            expected = self.golden[scene.stem]
            different = difference("golden", promised(scene, reference), expected)
            different += difference("old library", promised(scene, runner.hashes(scene, old_library=True)), expected)
            ways = list(ways_of(self.scenes.index(scene), last_step(reference)))
            for way in ways:
                found, same = runner.hashes(scene, **way), reference
                if is_refined(scene) and not runner.fused:
                    found, same = steps_of(found), steps_of(same)
                different += difference(str(way), found, same)
            return len(ways) + 2, different

    def test_this_build(self):
        self.every_way(os.environ["NEPHOS"])

    def test_the_scenes_do_not_repeat_or_stand_still(self):
        """A golden file that nothing moves in would agree with anything."""
        self.assertEqual(len(self.golden), golden_scenes.COUNT)
        last = {lines[-1].split()[-1] for lines in self.golden.values()}
        self.assertGreater(len(last), 0.9 * golden_scenes.COUNT)
        moving = [lines for lines in self.golden.values() if len({line.split()[-1] for line in lines}) > len(lines) // 2]
        self.assertGreater(len(moving), 0.9 * golden_scenes.COUNT)

    def test_the_old_library_rounds_otherwise(self):
        """Else the runs with it would show nothing."""
        sums = [subprocess.run(["/usr/bin/python3", "-c", SINES], check=True, capture_output=True, text=True,
                               env={**os.environ, **more}).stdout for more in ({}, {"GLIBC_TUNABLES": OLD_LIBRARY})]
        if "fma" not in pathlib.Path("/proc/cpuinfo").read_text():
            self.skipTest("this processor has no fused multiply-add: the library is the old one anyway")
        self.assertNotEqual(*sums)

    def test_another_seed_is_noticed(self):
        scene = self.scenes[0]
        out = self.folder / "other"
        Runner(os.environ["NEPHOS"], self.folder).run(scene, out, "--seed", "1")
        found = promised(scene, lines_of(scene, out))
        name = scene.stem
        self.assertRegex(difference("seed 1", found, self.golden[name])[0], rf"^seed 1: {name} step \d+ \w+, expected {name} ")

    @unittest.skipUnless(ALL, "builds the command three times: ./test --all")
    def test_other_compilers_and_no_optimisation(self):
        for compiler, optimisation in (("g++", "O0"), ("clang++", "O3"), ("clang++", "O0")):
            with self.subTest(compiler=compiler, optimisation=optimisation):
                self.every_way(build(compiler, optimisation))


def write():
    with tempfile.TemporaryDirectory() as folder:
        runner = Runner(os.environ["NEPHOS"], folder)
        lines = ["# Written by tests/determinism/matrix_test.py --write: scene, layer, step or file, XXH3-128 of state or voxels."]
        for scene in golden_scenes.write_all(pathlib.Path(folder) / "scenes"):
            lines += promised(scene, runner.hashes(scene))
        GOLDEN.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        write()
    else:
        unittest.main(verbosity=2)
