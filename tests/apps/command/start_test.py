# SPDX-License-Identifier: Apache-2.0
"""Parts of the command that are loaded when they are needed (docs/adr/0033-start.md)."""

import os
import pathlib
import resource
import shutil
import subprocess
import unittest

from case import NEPHOS, PATIENCE, SANITIZED, Case

# Libraries whose symbols take most of the time of a short run.
SLOW = ("libopenvdb", "libOpenEXR", "libblosc", "libboost_iostreams", "liblog4cplus")

# From allocation FIRST on each fails.
NO_MEMORY = """\
#include <errno.h>
#include <stdlib.h>
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
static int fails(void) {
    static long number, first;
    if (first == 0) first = atol(getenv("FIRST"));
    if (__sync_add_and_fetch(&number, 1) < first) return 0;
    errno = ENOMEM;
    return 1;
}
void *malloc(size_t size) { return fails() ? 0 : __libc_malloc(size); }
void *calloc(size_t count, size_t size) { return fails() ? 0 : __libc_calloc(count, size); }
void *realloc(void *old, size_t size) { return fails() ? 0 : __libc_realloc(old, size); }
"""


def become(user, processes):
    """Makes this process one of a user who has no other, and may have so many."""
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
    resource.setrlimit(resource.RLIMIT_NPROC, (processes, processes))


class Start(Case):
    def loaded(self, *arguments, status=0):
        """The slow libraries that a command loads, from the report of the dynamic linker."""
        log = self.folder / "linker"
        for old in self.folder.glob("linker.*"):
            old.unlink()
        environment = self.environment | {"LD_DEBUG": "files", "LD_DEBUG_OUTPUT": str(log)}
        result = subprocess.run([NEPHOS, *map(str, arguments)], cwd=self.folder, env=environment, capture_output=True, text=True)
        self.assertEqual(result.returncode, status, result.stdout + result.stderr)
        text = "".join(path.read_text() for path in self.folder.glob("linker.*"))
        self.assertIn("libstdc++", text)
        return {name for name in SLOW if name in text}

    def test_commands_of_bits_load_no_grid(self):
        mean = self.write("mean.toml", 'scene = "tiny.toml"\nreplicates = 2\n[steps]\nmin = 20\nmax = 20\n'
                          '[[axis]]\nkey = "field.background.ext"\nvalues = [0.05, 0.1]\n')
        for arguments in (["--version"], ["--help"], ["hash", self.scene], ["validate", self.scene],
                          ["run", self.scene, "--statistics-only", "--out", "bits"], ["sweep", mean, "--out", "swept"],
                          ["merge", "swept"], ["report", "swept", "-o", "report.html"]):
            with self.subTest(arguments[0]):
                self.assertEqual(self.loaded(*arguments), set())

    def test_a_run_with_grids_loads_them_all(self):
        self.assertEqual(self.loaded("run", self.scene, "--out", "grids", "--splatting", "cpu"), set(SLOW))

    def copied_program(self, library=None):
        program = self.folder / "bin" / "nephos"
        program.parent.mkdir()
        shutil.copy2(NEPHOS, program)
        original = next(pathlib.Path(NEPHOS).parent.parent.glob("lib*/**/libnephos_volumes.so"))
        place = self.folder / original.relative_to(pathlib.Path(NEPHOS).parent.parent)
        place.parent.mkdir(parents=True)
        if library is not None:
            place.write_bytes(library(original))
        return program, place

    def run_of(self, program):
        result = subprocess.run([program, "run", self.scene, "--out", "copied", "--quiet", "--splatting", "cpu"],
                                cwd=self.folder, env=self.environment, capture_output=True, text=True)
        return result.returncode, result.stderr

    def test_the_library_is_found_from_where_the_program_lies(self):
        program, _ = self.copied_program(pathlib.Path.read_bytes)
        self.assertEqual(self.run_of(program), (0, ""))
        link = self.folder / "linked"
        link.symlink_to(program)
        shutil.rmtree(self.folder / "copied")
        self.assertEqual(self.run_of(link), (0, ""))

    def test_a_missing_or_damaged_library_is_named(self):
        program, place = self.copied_program()
        status, message = self.run_of(program)
        self.assertEqual(status, 3)
        self.assertIn(f"a part of nephos cannot be loaded: {place}", message.replace(f"{program.parent}/../", f"{self.folder}/"))
        place.write_bytes(b"no library" * 1000)
        status, message = self.run_of(program)
        self.assertEqual(status, 3)
        self.assertIn("invalid ELF header", message)
        # Commands that need none of it go on.
        self.assertEqual(subprocess.run([program, "hash", self.scene], capture_output=True).returncode, 0)

    def test_without_room_for_its_threads_nothing_hangs(self):
        """Their libraries' own threads would end the process or wait for ever when some cannot be started."""
        self.call("run", self.scene, "--no-render", "--out", "grids")
        grid = self.folder / "grids/density/tiny_0001.vdb"
        statuses = set()
        for kib in range(90_000, 240_000, 10_000):
            result = subprocess.run(["sh", "-c", f'ulimit -v {kib}; exec "$@"', "sh", NEPHOS, "info", grid], env=self.environment,
                                    capture_output=True, text=True, timeout=PATIENCE)
            statuses.add(result.returncode)
            if result.returncode != 0:
                self.assertRegex(result.stderr, "^error: a part of nephos cannot be loaded: it needs 6 threads")
        self.assertEqual(statuses, {0, 3})

    @unittest.skipIf(SANITIZED, "a sanitizer has its own allocator")
    def test_without_any_memory_that_is_told(self):
        """From one allocation on each fails, also those that a message takes."""
        source = self.write("memory.c", NO_MEMORY)
        subprocess.run([os.environ.get("CC", "cc"), "-shared", "-fPIC", "-w", "-o", self.folder / "memory.so", source], check=True)
        ended = []
        for first in range(1000, 6000, 61):
            result = subprocess.run([NEPHOS, "hash", self.scene, "-n", "1"], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                                    env=self.environment | {"LD_PRELOAD": "./memory.so", "FIRST": str(first)})
            if result.returncode == 3:
                self.assertIn("error: out of memory\n", result.stderr, first)  # libraries may have words of their own
            ended.append(result.returncode)
        self.assertGreater(ended.count(3), 10)

    @unittest.skipIf(os.geteuid() != 0, "needs another user")
    def test_without_threads_nothing_aborts(self):
        """Limits of a user's processes, from those of the program alone to all that it wants."""
        os.chmod(self.folder, 0o777)
        statuses = set()
        for most in range(1, 20):
            shutil.rmtree(self.folder / "limited", ignore_errors=True)
            result = subprocess.run([NEPHOS, "run", self.scene, "--out", "limited", "-q", "--splatting", "cpu", "-j", str(1 + most % 3)], cwd=self.folder,
                                    env=self.environment, capture_output=True, text=True, timeout=PATIENCE, preexec_fn=lambda most=most: become(41234, most))
            statuses.add(result.returncode)
            self.assertIn(result.returncode, (0, 3), result.stderr)
            self.assertEqual(result.returncode == 0, result.stderr == "")
            self.assertNotIn("unexpected", result.stderr)
        self.assertEqual(statuses, {0, 3})

    @unittest.skipIf(os.geteuid() != 0, "needs another user")
    def test_threads_are_there_from_the_start_or_not_at_all(self):
        """Whatever the limit of processes and of `-j`, a command ends: oneTBB would wait for ever for what comes too late."""
        os.chmod(self.folder, 0o777)
        threads = len(os.sched_getaffinity(0))
        for n, most in enumerate((1, max(1, threads - 1), threads + 1, 60 + 4 * threads)):
            for call in range(20):
                result = subprocess.run([NEPHOS, "hash", self.scene, "-n", "1", "-j", str(threads * (1 + call % 2))], cwd=self.folder, env=self.environment,
                                        capture_output=True, text=True, timeout=PATIENCE, preexec_fn=lambda: become(41235 + 20 * n + call, most))
                self.assertEqual(result.returncode, 0 if most >= threads else 3, result.stderr)
                self.assertEqual(result.stderr.count("cannot start another thread"), 1 if most < threads else 0, result.stderr)

    def test_a_library_without_the_functions_is_another_version(self):
        program, place = self.copied_program()
        source = self.write("empty.c", "int nephos_nothing;\n")
        subprocess.run([os.environ.get("CC", "cc"), "-shared", "-o", place, source], check=True)
        status, message = self.run_of(program)
        self.assertEqual(status, 3)
        self.assertIn("a part of nephos is of another version", message)


if __name__ == "__main__":
    unittest.main()
