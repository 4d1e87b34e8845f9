# SPDX-License-Identifier: Apache-2.0
"""The same bits whatever computes them: the scenes of golden_scenes.py and further_scenes.py, each step's 128-bit hash and the
decoded density of each frame, over vector targets, numbers of threads and processes, and interruptions at random steps; with
NEPHOS_TEST_ALL=1 over all scenes and combinations, and over compilers and optimisation, whose programs are built for it.
../golden/matrix.txt and matrix_refined.txt have the hashes.

    NEPHOS=... NEPHOS_MPI=... SOURCE=. TARGETS_LIBRARY=... /usr/bin/python3 tests/determinism/matrix_test.py [Matrix.test_...]
    ... matrix_test.py --write [refined]    writes the hashes anew, or those of refined density: a decision for docs/adr/"""

import collections
import concurrent.futures
import csv
import itertools
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import further_scenes
import golden_scenes

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
GOLDEN = SOURCE / "tests/golden/matrix.txt"
REFINED = SOURCE / "tests/golden/matrix_refined.txt"
ALL = os.environ.get("NEPHOS_TEST_ALL") == "1"
THREADS = (1, 2, 3, 8)
PROCESSES = (1, 2, 3)
LEVELS_EACH = 8  # that a process has at least

# Bits of Highway's list of targets. What a processor lacks is left out: it runs the next one below.
SCALAR = 1 << 61 | 1 << 62
SSE4 = SCALAR | 1 << 11 | 1 << 12
AVX2 = SSE4 | 1 << 9 | 1 << 10
AVX512 = AVX2 | 1 << 8 | 1 << 7
TARGETS = {"scalar": SCALAR, "sse4": SSE4, "avx2": AVX2, "avx512": AVX512}
FUSED = ("avx2", "avx512")  # have fused multiply-add, which refined density takes (docs/determinism.md)
BEST = next((name for name, flag in (("avx512", "avx512dq"), ("avx2", "avx2"), ("sse4", "sse4_1"))
             if f" {flag} " in pathlib.Path("/proc/cpuinfo").read_text()), "scalar")


def best_of(found):
    """The name of the best target of Highway's list: its lowest bit."""
    return next(name for name, most in TARGETS.items() if found & -found & most)


# glibc then takes the versions of its functions (exp, sin, pow ...) that old processors get: some round otherwise.
OLD_LIBRARY = "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX512F,-AVX512VL,-AVX512BW,-AVX,-SSE4_1,-SSE4_2"
SINES = "import math; print(sum(math.sin(n) * math.exp(n % 7) for n in range(100000)))"


class Runner:
    """Runs scenes in a temporary folder by one program."""

    def __init__(self, program, folder, mpi=None):
        self.program, self.folder, self.mpi = str(program), pathlib.Path(folder), mpi
        self.used = collections.Counter()  # how often each target was asked for, and which one was used

    def call(self, *command, targets=None, old_library=False, processes=0):
        """Returns what a command prints, and the target that it used."""
        environment, log, launch = dict(os.environ, LC_ALL="C.UTF-8"), self.folder / "targets.log", []
        log.unlink(missing_ok=True)
        if processes:
            launch = ["mpirun", "--allow-run-as-root", "--oversubscribe", "--mca", "btl_vader_single_copy_mechanism", "none",
                      "-n", str(processes), "-x", "LD_PRELOAD=" + os.environ["TARGETS_LIBRARY"]]
        if old_library:
            environment["GLIBC_TUNABLES"] = OLD_LIBRARY
        if targets is not None:
            environment.update(NEPHOS_TARGETS=str(TARGETS[targets]), NEPHOS_TARGETS_LOG=str(log),
                               NEPHOS_PROCESSORS=str(max(THREADS)))  # else threads are no more than processors
            if not processes:
                environment.update(LD_PRELOAD=os.environ["TARGETS_LIBRARY"])
        result = subprocess.run([*launch, *map(str, command)], capture_output=True, text=True, env=environment, timeout=3000)
        assert result.returncode == 0, result.stderr
        if targets is None:
            return result.stdout, BEST
        lines = [tuple(map(int, line.split())) for line in log.read_text().splitlines()]
        assert len(lines) == max(1, processes) and len(set(lines)) == 1, lines
        asked, found = lines[0]  # Highway asked, and got no more than it was to get
        assert asked == TARGETS[targets] and found & ~asked == 0, (targets, asked, found)
        self.used[targets, best_of(found)] += 1
        return result.stdout, best_of(found)

    def run(self, scene, out, *more, threads=2, **options):
        return self.call(self.program, "run", scene, "--no-render", "--quiet", "--out", out, "--threads", threads, *more,
                         **options)[1]

    def hashes(self, scene, more=(), split=None, begun=None, **options):
        """The lines of the golden file for a scene, and the targets that computed them; run up to step `split` with the options
        `begun`, and then resumed, when that is given."""
        out, used = self.folder / "out", set()
        shutil.rmtree(out, ignore_errors=True)
        if split is not None:
            used.add(self.run(scene, out, "--set", f"time.steps={split}", **begun))
            more = (*more, "--resume")
        used.add(self.run(scene, out, *more, **options))
        return lines_of(scene, out), used

    def hashes_of_processes(self, scene, processes, threads, targets):
        """The lines of steps, of a lattice that some processes share."""
        text, _ = self.call(self.mpi, scene, "--hash", "--threads", threads, processes=processes, targets=targets)
        return [f"{scene.stem} step {line}" for line in text.splitlines()]


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


def number_of(scene):
    return int(scene.stem.split("-")[1])


def is_refined(scene):
    return "refine = 1" not in scene.read_text()


def steps_of(lines):
    return [line for line in lines if " step " in line]


def last_step(lines):
    return max(int(line.split(" step ")[1].split()[0]) for line in steps_of(lines))


def ways_of(number, steps):
    """Options of runs of the scene of that number."""
    targets, draw = list(TARGETS), random.Random(number)
    combinations = [(target, threads) for target in TARGETS for threads in THREADS]
    if not ALL:  # a target and a number of threads each, other ones for the next scene
        combinations = [(target, THREADS[(n + number) % 4]) for n, target in enumerate(TARGETS)]
    for target, threads in combinations:
        yield {"targets": target, "threads": threads}
    yield {"old_library": True}
    yield {"more": ("--checkpoint-every", "0.0001")}  # after each step
    # Interrupted at a random step, and resumed on each target after another one, with as many threads as it happens.
    for n in range(4) if ALL else [number % 4]:
        yield {"targets": targets[n], "threads": draw.choice(THREADS), "split": draw.randrange(1, steps),
               "begun": {"targets": targets[n - 1], "threads": draw.choice(THREADS)}}


def processes_of(scene):
    """Numbers of processes that can share the scene: one lattice, cut by its height, whose cells keep their level."""
    text = scene.read_text()
    by_place = number_of(scene) >= further_scenes.FIRST and further_scenes.kind_of(number_of(scene)) is further_scenes.wind_fields
    if "layer = [" in text or by_place:
        return []
    levels = int(re.search(r"cells = \[\d+, \d+, (\d+)\]", text)[1])
    return [processes for processes in PROCESSES if processes <= -(-levels // LEVELS_EACH)]


def difference(way, found, expected):
    """Nothing, or one line that says what differs."""
    if found == expected:
        return []
    pairs = itertools.zip_longest(found, expected)
    return [f"{way}: " + next(f"{one}, expected {other}" for one, other in pairs if one != other)]


class Golden:
    """The hashes of the files: those of refined density are of two kinds (docs/determinism.md)."""

    def __init__(self):
        self.lines, self.refined = {}, {True: {}, False: {}}  # by scene; whether multiply-add is fused
        for line in GOLDEN.read_text().splitlines():
            if not line.startswith("#"):
                self.lines.setdefault(line.split()[0], []).append(line)
        for line in REFINED.read_text().splitlines():
            if not line.startswith("#"):
                kind, line = line.split(" ", 1)
                self.refined[kind == "fused"].setdefault(line.split()[0], []).append(line)

    def difference(self, way, scene, found, used):
        """As difference(), of a run by these targets. Refined files of an interrupted run of both kinds are left out."""
        fused = {target in FUSED for target in used}
        lines = self.lines[scene.stem]
        if not is_refined(scene):
            return difference(way, found, lines)
        if len(fused) == 2:
            return difference(way, steps_of(found), lines)
        return difference(way, found, lines + self.refined[fused.pop()][scene.stem])


def write_scenes(folder):
    folder.mkdir()
    return golden_scenes.write_all(folder) + further_scenes.write_all(folder)


def sample_of(scenes):
    """Some of each kind."""
    return scenes[:golden_scenes.COUNT:11] + scenes[further_scenes.FIRST:][:len(further_scenes.KINDS)]


# What scenes are to differ in.
AXES = ['"open"', '"periodic"', 'initial = "field"', 'initial = "empty"', "\nwind = [", "ellipsoids = [{", "scatters = [{",
        "layer = [", "veil = {", "rain = {", "schedule = [", "refine = 1", "refine = 2", "half = true", 'kernel = "box"', 'kernel = "tent"',
        'kernel = "gaussian"', "replace = true", "thermals = {", "profile = [", "grids = [", 'kind = "grid"', 'kind = "roll"']


def build(compiler, optimisation):
    """The commands, built by this compiler into the folder of builds."""
    tree = SOURCE / "build" / f"matrix-{compiler}-{optimisation}"
    subprocess.run(["cmake", "-S", SOURCE, "-B", tree, "-G", "Ninja", f"-DCMAKE_CXX_COMPILER={compiler}",
                    "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache", "-DCMAKE_BUILD_TYPE=None",
                    f"-DCMAKE_CXX_FLAGS=-{optimisation}", "-DNEPHOS_BUILD_TESTS=OFF", "-DNEPHOS_BUILD_BENCHMARKS=OFF"],
                   check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["ninja", "-C", tree, "nephos", "nephos_mpi"], check=True, stdout=subprocess.DEVNULL)
    return tree / "bin/nephos", tree / "bin/nephos-mpi"


class Matrix(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos matrix "))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.scenes = write_scenes(cls.folder / "scenes")
        cls.golden = Golden()

    def every_way(self, program, mpi):
        """Scenes beside each other, as many as there are processors: most of their runs are the start of a process."""
        scenes = self.scenes if ALL else sample_of(self.scenes)
        runs, used = collections.Counter(), collections.Counter()
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            for scene, result in zip(scenes, pool.map(lambda scene: self.compare(program, mpi, scene), scenes)):
                runs += result[0]
                used += result[1]
                with self.subTest(scene=scene.stem):
                    self.assertEqual(result[2], [])
        print(f"{program}: {len(scenes)} scenes, {runs['one process']} runs compared, and shared by",
              ", ".join(f"{n} processes {runs[n]}" for n in PROCESSES), file=sys.stderr)
        print("  targets asked for, and used:", ", ".join(f"{a} {b} {n}" for (a, b), n in sorted(used.items())), file=sys.stderr)

    def compare(self, program, mpi, scene):
        """How often a scene was run in one and more processes, by which targets, and the first line of each run that differs."""
        number, expected = number_of(scene), self.golden.lines[scene.stem]
        runs, different = collections.Counter(), []
        with tempfile.TemporaryDirectory(dir=self.folder) as folder:
            runner = Runner(program, folder, mpi)
            for way in [{}, *ways_of(number, last_step(expected))]:
                different += self.golden.difference(str(way), scene, *runner.hashes(scene, **way))
                runs["one process"] += 1
            for processes in processes_of(scene) if mpi else []:
                target, threads = list(TARGETS)[(number + processes) % 4], THREADS[number // 4 % 4]
                found = runner.hashes_of_processes(scene, processes, threads, target)
                different += difference(f"{processes} processes, {target}, {threads} threads", found, steps_of(expected))
                runs[processes] += 1
            return runs, runner.used, different

    def test_this_build(self):
        self.every_way(os.environ["NEPHOS"], os.environ.get("NEPHOS_MPI"))

    def test_the_scenes_do_not_repeat_or_stand_still(self):
        """A golden file that nothing moves in would agree with anything."""
        golden = self.golden.lines
        self.assertEqual(list(golden), [scene.stem for scene in self.scenes])
        last = {lines[-1].split()[-1] for lines in golden.values()}
        self.assertGreater(len(last), 0.9 * len(golden))
        moving = [lines for lines in golden.values() if len({line.split()[-1] for line in lines}) > len(lines) // 2]
        self.assertGreater(len(moving), 0.9 * len(golden))
        refined = {scene.stem for scene in self.scenes if is_refined(scene)}
        for kind in self.golden.refined.values():
            self.assertEqual(set(kind), refined)

    def test_the_sample_has_each_axis(self):
        sample = sample_of(self.scenes)
        text = "".join(scene.read_text() for scene in sample)
        self.assertEqual([axis for axis in AXES if axis not in text], [])
        self.assertEqual({processes for scene in sample for processes in processes_of(scene)}, set(PROCESSES))
        ways = [way for scene in sample for way in ways_of(number_of(scene), 4)]
        for kind in (lambda way: way.get("targets"), lambda way: "split" in way and way["targets"]):
            self.assertLessEqual(set(TARGETS), {kind(way) for way in ways})
        self.assertLessEqual({(target, threads) for target in TARGETS for threads in THREADS},
                             {(way.get("targets"), way.get("threads")) for way in ways})

    def test_the_old_library_rounds_otherwise(self):
        """Else the runs with it would show nothing."""
        if "fma" not in pathlib.Path("/proc/cpuinfo").read_text():
            self.skipTest("this processor has no fused multiply-add: the library is the old one anyway")
        sums = [subprocess.run(["/usr/bin/python3", "-c", SINES], check=True, capture_output=True, text=True,
                               env={**os.environ, **more}).stdout for more in ({}, {"GLIBC_TUNABLES": OLD_LIBRARY})]
        self.assertNotEqual(*sums)

    def test_another_seed_is_noticed(self):
        for scene in (self.scenes[0], self.scenes[further_scenes.FIRST]):
            found, used = Runner(os.environ["NEPHOS"], self.folder).hashes(scene, more=("--seed", "1"))
            name = scene.stem
            self.assertRegex(self.golden.difference("seed 1", scene, found, used)[0],
                             rf"^seed 1: {name} step \d+ \w+, expected {name} ")

    @unittest.skipUnless(ALL, "builds the commands three times: ./test --all")
    def test_other_compilers_and_no_optimisation(self):
        for compiler, optimisation in (("g++", "O0"), ("clang++", "O3"), ("clang++", "O0")):
            with self.subTest(compiler=compiler, optimisation=optimisation):
                program, mpi = build(compiler, optimisation)
                self.every_way(program, os.environ.get("NEPHOS_MPI") and mpi)


def write(refined):
    with tempfile.TemporaryDirectory() as folder:
        runner = Runner(os.environ["NEPHOS"], folder)
        lines = [f"# Written by tests/determinism/matrix_test.py --write{' refined' if refined else ''}: "
                 + ("multiply-add, scene, file, XXH3-128 of voxels." if refined else
                    "scene, layer, step or file, XXH3-128 of state or voxels.")]
        for scene in write_scenes(pathlib.Path(folder) / "scenes"):
            if refined and is_refined(scene):
                for kind, target in (("fused", "avx2"), ("unfused", "scalar")):
                    found, used = runner.hashes(scene, targets=target)
                    assert used == {target}, "a processor with AVX2 is needed"
                    lines += [f"{kind} {line}" for line in found if line not in steps_of(found)]
            elif not refined:
                found, _ = runner.hashes(scene)
                lines += steps_of(found) if is_refined(scene) else found
        (REFINED if refined else GOLDEN).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--write"]:
        write(refined=sys.argv[2:] == ["refined"])
    else:
        unittest.main(verbosity=2)
