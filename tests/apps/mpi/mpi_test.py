# SPDX-License-Identifier: Apache-2.0
"""nephos-mpi on 1 to 4 processes against `nephos`: the same hashes, statistics and bits. NEPHOS and NEPHOS_MPI name the
binaries, SOURCE the source tree. Without mpirun these fail."""

import os
import pathlib
import re
import subprocess
import sys
import unittest

import numpy

SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
sys.path.insert(1, str(SOURCE / "tests/apps/command"))

from case import PATIENCE, Case, rows_of  # noqa: E402

PROGRAM = os.environ["NEPHOS_MPI"]
SCENE = """\
seed = 5
[lattice]
cells = [96, 40, 32]
boundaries = {boundaries}
[time]
steps = 100
{wind}
[field.background]
hum = 0.05
act = 0.005
ext = 0.1
[[field.ellipsoids]]
centre_m = [2000, 900, 700]
semi_axes_m = [900, 600, 500]
"""
WIND = """\
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 6.3, north_m_per_s = -4.7 }, { height_m = 1500, east_m_per_s = -17.0, north_m_per_s = 9.1 }]
"""


class Mpi(Case):
    def mpirun(self, processes, *arguments, status=0):
        result = subprocess.run(
            ["mpirun", "--allow-run-as-root", "--oversubscribe", "--mca", "btl_vader_single_copy_mechanism", "none",
             "-n", str(processes), PROGRAM, *map(str, arguments)],
            cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(result.returncode, status, result.stdout + result.stderr)
        return result

    def test_its_page_has_all_of_its_options(self):
        page = subprocess.run([PROGRAM, "--man"], check=True, capture_output=True, text=True).stdout.replace("\\-", "-")
        self.environment["NO_COLOR"] = "1"  # mpirun gives it a terminal
        said = self.mpirun(1, "--help").stdout
        self.assertIn("Usage: nephos-mpi SCENE [options]", said)
        options = re.findall(r"^  (?:-\w, )?(--[a-z-]+)", said, re.M)
        self.assertGreater(len(options), 9)
        for option in options:
            self.assertRegex(page, rf"(?m)^\.B .*{option}\b")

    def test_numbers_below_0_are_refused(self):
        scene = self.write("s.toml", SCENE.format(boundaries='"periodic"', wind=""))
        for option in ("--steps", "--seed"):
            self.assertIn(option, self.mpirun(1, scene, option, "-5", "--hash", status=2).stderr)


    def test_numbers_are_those_of_the_command(self):
        scene = self.write("s.toml", SCENE.format(boundaries='"periodic"', wind=""))
        for option, number in (("--seed", 2**64), ("--seed", "0x10"), ("--steps", 10**20), ("--steps", 10**9 + 1), ("--steps", "1.5")):
            self.assertIn(f"'{number}' is not a whole number", self.mpirun(1, scene, option, number, "--hash", status=2).stderr)

    def test_what_does_not_fit_into_memory_is_refused(self):
        scene = self.write("s.toml", SCENE.format(boundaries='"periodic"', wind=""))
        for processes in (1, 2):
            said = self.mpirun(processes, scene, "--steps", "1", "--set", "lattice.cells=[65536, 65536, 65536]", status=2).stderr
            self.assertIn(f"{processes} processes of this machine with {65536 // processes} levels each", said)
            self.assertIn("are all there is", said)

    def test_what_cannot_be_printed(self):
        scene = self.write("s.toml", SCENE.format(boundaries='"periodic"', wind=""))
        for arguments in ([scene, "--steps", "1", "--hash"], ["--help"], ["--version"]):
            with open("/dev/full", "w") as full:
                result = subprocess.run([PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, env=self.environment,
                                        timeout=PATIENCE)
            self.assertIn("standard output: cannot write", result.stderr)
            self.assertEqual(result.returncode, 3)

    def test_what_is_in_the_folder_stays(self):
        """A run, a table of an earlier call, links and pipes."""
        scene = self.write("s.toml", SCENE.format(boundaries='"periodic"', wind=""))
        self.call("run", scene, "--no-render", "--set", "time.steps=3", "--out", "run")
        table = (self.folder / "run/statistics.csv").read_bytes()
        for more in ((), ("--overwrite",)):
            self.assertIn("holds manifest.json of another command", self.mpirun(1, scene, "--out", "run", *more, status=2).stderr)
        self.assertEqual((self.folder / "run/statistics.csv").read_bytes(), table)
        levels = ("--steps", "2", "--write-state", "--slab-levels")
        self.mpirun(2, scene, "--out", "mpi", *levels, 8)
        before = (self.folder / "mpi/statistics.csv").read_bytes()
        self.assertIn("is there already", self.mpirun(2, scene, "--out", "mpi", *levels, 32, status=2).stderr)
        self.assertEqual((self.folder / "mpi/statistics.csv").read_bytes(), before)
        self.mpirun(2, scene, "--out", "mpi", *levels, 32, "--overwrite")
        self.assertEqual(len(list((self.folder / "mpi").glob("levels_*.vdb"))), 2)
        # Levels that are an export's, or what the scene names.
        next((self.folder / "run/density").iterdir()).rename(self.folder / "levels_10000.vdb")
        self.call("export", "levels_10000.vdb", "--to", "vdb", "-o", "exported", "-q")
        self.assertIn("holds export.json", self.mpirun(1, scene, "--steps", "1", "--out", "exported", "--overwrite", status=2).stderr)
        (self.folder / "linked").mkdir()
        (self.folder / "linked/levels_00001.vdb").symlink_to(next((self.folder / "exported").glob("*.vdb")))
        self.assertIn("is a file of the export in ", self.mpirun(1, scene, "--steps", "1", "--out", "linked", "--overwrite", status=2).stderr)
        self.call("verify", "exported")
        (self.folder / "mpi/levels_00099.vdb").mkdir()
        self.assertIn("levels_00099.vdb: is a folder", self.mpirun(1, scene, "--steps", "1", "--out", "mpi", "--overwrite", status=2).stderr)
        self.assertEqual(len(list((self.folder / "mpi").glob("*"))), 4)
        itself = self.write("itself/statistics.csv", pathlib.Path(scene).read_text())
        self.assertIn("is the scene", self.mpirun(1, itself, "--steps", "1", "--out", "itself", "--overwrite", status=2).stderr)
        (self.folder / "named").mkdir()
        (self.folder / "levels_10000.vdb").rename(self.folder / "named/levels_10000.vdb")
        named = self.write("n.toml", SCENE.format(boundaries='"periodic"', wind="") +
                           '[[field.grids]]\nof = "act"\nfile = "named/levels_10000.vdb"\ngrid = "density"\n')
        (self.folder / "named/levels_10000.vdb").rename(self.folder / "named/real.vdb")
        for target in ("real.vdb", None):
            if target:
                (self.folder / "named/levels_10000.vdb").symlink_to(target)
            else:
                (self.folder / "named/real.vdb").rename(self.folder / "named/levels_10000.vdb")
            self.assertIn("is what `field.grids[0].file` of the scene names",
                          self.mpirun(1, named, "--steps", "1", "--out", "named", "--overwrite", status=2).stderr)
        victim = pathlib.Path(self.write("victim", "precious"))
        for name in ("link", "pipe"):
            (self.folder / name).mkdir()
        (self.folder / "link/statistics.csv").symlink_to(victim)
        os.mkfifo(self.folder / "pipe/statistics.csv")
        for name in ("link", "pipe"):
            self.mpirun(1, scene, "--steps", "1", "--out", name, status=2)
            self.mpirun(1, scene, "--steps", "1", "--out", name, "--overwrite")
        self.assertEqual(victim.read_text(), "precious")
        self.mpirun(1, scene, "--out", "", status=2)


class Ranks(Mpi):
    def test_hashes_are_those_of_one_process(self):
        """Each number of processes x open, periodic and mixed sides x calm and wind: a hundred steps."""
        for sides in (["open"] * 3, ["periodic"] * 3, ["periodic", "periodic", "open"]):
            for wind in ("", WIND):
                scene = self.write("scene.toml", SCENE.format(boundaries=str(sides).replace("'", '"'), wind=wind))
                expected = self.hashes(scene)
                self.assertEqual(len(expected.splitlines()), 101)
                for processes in (1, 2, 3, 4):
                    self.assertEqual(self.mpirun(processes, scene, "--hash").stdout, expected, (sides, wind, processes))

    def test_a_wind_of_files_is_read(self):
        """One that is a profile gives the bits of one process; one that is not is refused, as it is without a file."""
        velocity = "[density]\nwrite_velocity = true\n[frames]\ncount = 1\n"
        sides = '["periodic", "periodic", "open"]'
        vortex = '[[wind_field]]\nkind = "vortex"\nx_m = 2400\ny_m = 1000\nradius_m = 600\nspeed_m_per_s = 30\n'
        for name, wind in (("profile", WIND), ("vortex", vortex)):
            scene = self.write(f"{name}.toml", SCENE.format(boundaries=sides, wind=wind) + velocity)
            self.call("run", scene, "--no-render", "--set", "time.steps=2", "--out", name)
            files = f'[[wind_field]]\nkind = "grid"\ngrid = "vel"\nfiles = ["{name}/density/{name}_0001.vdb"]\n'
            self.write(f"{name}-of-file.toml", SCENE.format(boundaries=sides, wind=files))
        expected = self.hashes("profile-of-file.toml")
        self.assertNotEqual(expected, self.hashes(self.write("calm.toml", SCENE.format(boundaries=sides, wind=""))))
        for processes in (1, 3):
            self.assertEqual(self.mpirun(processes, "profile-of-file.toml", "--hash").stdout, expected)
        for processes in (1, 2):
            self.assertIn("vortex-of-file.toml: has a `wind_field` that differs within a level or has a vertical part",
                          self.mpirun(processes, "vortex-of-file.toml", status=2).stderr)

    def test_statistics_and_bits_are_those_of_one_process(self):
        import pyopenvdb
        scene = self.write("scene.toml", SCENE.format(boundaries='["periodic", "periodic", "open"]', wind=WIND))
        self.call("run", scene, "--statistics-only", "--set", "time.steps=40", "--out", "run")
        expected = rows_of(self.folder / "run/statistics.csv")
        self.call("state", scene, "--steps", "40", "--out", "state.vdb")
        whole = numpy.zeros((96, 40, 32), dtype=bool)
        pyopenvdb.read(str(self.folder / "state.vdb"), "cld").copyToArray(whole)
        self.assertGreater(whole.sum(), 1000)
        for processes in (1, 3):
            out = f"mpi{processes}"
            self.mpirun(processes, scene, "--steps", "40", "--hash", "--out", out, "--write-state", "--slab-levels", "5")
            rows = rows_of(self.folder / out / "statistics.csv")
            self.assertEqual(len(rows), 41)
            for got, row in zip(rows, expected):
                self.assertEqual(got, {name: row[name] for name in got})
            cells, files = numpy.zeros_like(whole), sorted((self.folder / out).glob("levels_*.vdb"))
            self.assertGreaterEqual(len(files), 7)
            for path in files:
                grid = pyopenvdb.read(str(path), "cld")
                part = numpy.zeros((96, 40, 32), dtype=bool)
                grid.copyToArray(part)
                level = round((grid.transform.indexToWorld((0, 0, 0))[2] - 25) / 50)
                self.assertEqual(path.name, f"levels_{level:05}.vdb")
                cells[:, :, level:] |= part[:, :, :32 - level]
            numpy.testing.assert_array_equal(cells, whole)


class Limits(Mpi):
    def test_what_cannot_be_cut_is_refused(self):
        scene = self.write("scene.toml", SCENE.format(boundaries='["open", "open", "open"]', wind=""))
        said = self.mpirun(5, scene, status=2).stderr
        self.assertIn("5 processes for 32 levels", said)
        self.assertIn("at most 4 processes can help", said)
        layers = self.mpirun(1, SOURCE / "scenes/climate.toml", status=2).stderr
        self.assertIn("one lattice without layers", layers)
        self.assertIn("none.toml", self.mpirun(1, "none.toml", status=3).stderr)
        self.assertIn("a probability per step", self.mpirun(1, scene, "--set", "field.background.ext=2", status=2).stderr)
        self.mpirun(1, scene, "--steps", "x", status=2)
        self.assertIn("Example: mpirun", self.mpirun(2, "--help").stdout)


if __name__ == "__main__":
    unittest.main()
