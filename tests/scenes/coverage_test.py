# SPDX-License-Identifier: Apache-2.0
"""Lines, regions and branches of scenes/format that the scene tests and the fuzz targets' inputs reach, counted by Clang, in
./test --all. Prints what is not reached, and a table; fails if lines or regions are below 90 %. Builds the preset `coverage`.

    SOURCE=. NEPHOS_TEST_ALL=1 /usr/bin/python3 tests/scenes/coverage_test.py"""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
TREE = SOURCE / "build/coverage"
FOLDER = SOURCE / "scenes/format"
LEAST = 90  # per cent, of lines and of regions
COUNTS = ("lines", "regions", "branches")
SEEDS = SOURCE / "tests/fuzz/inputs"
PROGRAMS = {"scenes_tests": ("tests/scenes", ["--gtest_brief=1"]),
            "fuzz_scene": ("tests/fuzz", ["--mutations", "200", SEEDS / "scene", SOURCE / "scenes"]),
            "fuzz_toml_edit": ("tests/fuzz", ["--mutations", "200", SEEDS / "toml_edit", SOURCE / "scenes"])}


def tool(name):
    """Clang's own: a profile of one version is not read by another."""
    return subprocess.run(["clang++", f"-print-prog-name={name}"], check=True, capture_output=True, text=True).stdout.strip()


def programs():
    subprocess.run(["cmake", "--preset", "coverage"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", TREE, "--target", *PROGRAMS], check=True,
                   env={**os.environ, "LLVM_PROFILE_FILE": os.devnull})  # tests are listed while they are built
    return {TREE / folder / name: arguments for name, (folder, arguments) in PROGRAMS.items()}


def run_counted(calls, work):
    """The profile of these calls."""
    for number, (program, arguments) in enumerate(calls.items()):
        subprocess.run([program, *arguments], check=True, cwd=work, stdout=subprocess.DEVNULL,
                       env={**os.environ, "LLVM_PROFILE_FILE": f"{work}/{number}.profraw"})
    profile = work / "all.profdata"
    subprocess.run([tool("llvm-profdata"), "merge", *work.glob("*.profraw"), "-o", profile], check=True)
    return profile


def counts_of(programs, profile):
    """What llvm-cov says of each source file of FOLDER, and the sums."""
    objects = [part for program in programs for part in ("-object", program)]
    counted = subprocess.run([tool("llvm-cov"), "export", *objects[1:], f"-instr-profile={profile}"],
                             check=True, capture_output=True)
    files = {path.name: file for file in json.loads(counted.stdout)["data"][0]["files"]
             if (path := pathlib.Path(file["filename"]).resolve()).parent == FOLDER}
    totals = {c: {key: sum(file["summary"][c][key] for file in files.values()) for key in ("count", "covered")} for c in COUNTS}
    return dict(sorted(files.items())), totals


def percent(counts):
    return 100 * counts["covered"] / counts["count"] if counts["count"] else 100


def print_table(files, totals):
    for name, summary in [*((name, file["summary"]) for name, file in files.items()), ("all", totals)]:
        cells = (f"{percent(summary[c]):6.1f} % of {summary[c]['count']:5} {c}" for c in COUNTS)
        print(f"{name:28}", "  ".join(cells))


def print_lines(files):
    """The first line of each region that was not reached."""
    for name, file in files.items():
        text = (FOLDER / name).read_text().splitlines()
        for line in sorted({line for line, _, count, counted, entry, *_ in file["segments"] if counted and entry and not count}):
            print(f"scenes/format/{name}:{line}: {text[line - 1].strip()}")


def enough(totals):
    return all(percent(totals[c]) >= LEAST for c in ("lines", "regions"))


class Coverage(unittest.TestCase):
    def test_too_little_is_noticed(self):
        counts = {"lines": {"count": 1000, "covered": 900}, "regions": {"count": 1000, "covered": 900}}
        self.assertTrue(enough(counts))
        for which in counts:
            self.assertFalse(enough({**counts, which: {"count": 1000, "covered": 899}}))

    @unittest.skipUnless(os.environ.get("NEPHOS_TEST_ALL"), "builds the reader by Clang: ./test --all")
    def test_the_reader_is_reached(self):
        with tempfile.TemporaryDirectory(prefix="nephos coverage ") as work:
            calls = programs()
            files, totals = counts_of(calls, run_counted(calls, pathlib.Path(work)))
        self.assertLessEqual({path.name for path in FOLDER.glob("*.cpp")} - {"describe_main.cpp"}, set(files))
        print_lines(files)
        print_table(files, totals)
        self.assertTrue(enough(totals), f"below {LEAST} %: the lines above are not reached")


if __name__ == "__main__":
    unittest.main(verbosity=2)
