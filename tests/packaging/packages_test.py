# SPDX-License-Identifier: Apache-2.0
"""The Debian packages: `cpack -G DEB` makes them, dpkg installs them into a root that holds the files of their dependencies
alone, and there the programs and the Python module work, and programs of others are built against the libraries.

    BUILD=build/release SOURCE=. /usr/bin/python3 tests/packaging/packages_test.py       as root, for chroot"""

import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

BUILD = pathlib.Path(os.environ["BUILD"]).resolve()
SOURCE = pathlib.Path(os.environ["SOURCE"]).resolve()
NAMES = {"nephos", "nephos-editor", "libnephos-dev", "python3-nephos"}
if (BUILD / "bin/nephos-mpi").exists():
    NAMES |= {"nephos-mpi"}
# What every Debian system has, as far as programs of ours and dpkg's own checks take it.
BASE = ["dash", "libc6", "libc-bin", "base-files", "coreutils"]

SCENE = """\
seed = 3
lattice.cells = [32, 24, 12]
time.steps = 3
field.background = {hum = 0.15, act = 0.01, ext = 0.05}
frames = {per_second = 1, time_scale = 15}
camera = {width = 64, height = 48}
sun.shadow_map_size = 64
"""

# The installed module steps the scene to the hashes that the command prints, and gives its bits as arrays of NumPy.
MODULE = """\
import pathlib
import nephos
print(pathlib.Path(nephos.__file__).parent)
simulation = nephos.Simulation(nephos.Scene("/tmp/small.toml"))
print(0, simulation.hash())
for step in range(1, 4):
    print(step, simulation.step().hash())
assert simulation.cld().shape == (12, 24, 32) and simulation.density().values.max() > 0
"""


def output(*command, **options):
    return subprocess.run(command, check=True, capture_output=True, text=True, **options).stdout


def field(package, name):
    return output("dpkg-deb", "--field", package, name).strip()


def installed_closure(names):
    """These packages and all that they depend on, as far as they are installed here; of alternatives, those that are."""
    states = {}
    for block in output("dpkg-query", "-W", "-f",
                        "${db:Status-Status}\t${binary:Package}\t${Provides}\t${Pre-Depends}, ${Depends}\n").splitlines():
        status, package, provides, depends = block.split("\t")
        if status == "installed":
            states[package.split(":")[0]] = (provides, depends)
    providers = {}
    for package, (provides, _) in states.items():
        for name in provides.split(","):
            providers.setdefault(name.split("(")[0].strip(), package)
    wanted, found = list(names), set()
    while wanted:
        name = wanted.pop()
        name = name if name in states else providers.get(name)
        if name is None or name in found:
            continue
        found.add(name)
        for group in states[name][1].split(","):
            wanted += [re.split(r"[ (:]", word.strip())[0] for word in group.split("|") if word.strip()]
    return sorted(found)


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos-packages-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        output("cpack", "-G", "DEB", "--config", str(BUILD / "CPackConfig.cmake"), "-B", str(cls.folder / "debs"), cwd=BUILD)
        cls.packages = {field(path, "Package"): path for path in (cls.folder / "debs").glob("*.deb")}

    def files_of(self, name):
        """Paths of the files in a package, without folders."""
        lines = output("dpkg-deb", "--contents", self.packages[name]).splitlines()
        return {line.split(maxsplit=5)[5].lstrip(".").split(" -> ")[0]: line.split()[:2] for line in lines if line[0] != "d"}

    def test_each_file_is_in_the_package_where_it_belongs(self):
        self.assertEqual(set(self.packages), NAMES)
        expected = {
            "nephos": ("/usr/bin/nephos", "/usr/lib/nephos/libnephos_volumes.so", "/usr/share/man/man1/nephos.1", "/usr/share/man/man1/nephos-run.1",
                       "/usr/share/nephos/scenes/cumulus.toml", "/usr/share/bash-completion/completions/nephos"),
            "nephos-editor": ("/usr/bin/nephos-editor", "/usr/share/applications/nephos-editor.desktop"),
            "nephos-mpi": ("/usr/bin/nephos-mpi",),
            "libnephos-dev": ("/usr/include/nephos/simulation/simulation.h", "/usr/lib/libnephos_automaton.a",
                              "/usr/lib/cmake/nephos/nephosConfig.cmake"),
            "python3-nephos": ("/usr/lib/python3/dist-packages/nephos/__init__.py",),
        }
        seen = {}
        for name in NAMES:
            files = self.files_of(name)
            for path in expected[name]:
                self.assertIn(path, files, name)
            for program in (path for path in files if path.startswith("/usr/bin/")):
                self.assertIn(f"/usr/share/man/man1/{program[9:]}.1", files, "a program without its page")
            for path, (mode, owner) in files.items():
                self.assertNotIn(path, seen, f"in {name} and {seen.get(path)}")
                seen[path] = name
                self.assertEqual(owner, "root/root", path)
                self.assertNotRegex(mode, "^.....w|^........w|s", path)
                self.assertNotRegex(path, r"gtest|/tests?/|\.toml\.|CMakeFiles")
            self.assertRegex(field(self.packages[name], "Description"), r"^\w.*\n .*")

    def test_no_package_names_the_machine_that_built_it(self):
        for name, path in self.packages.items():
            tree = self.folder / "content" / name
            tree.mkdir(parents=True)
            output("dpkg-deb", "-x", path, tree)
            for file in tree.rglob("*"):
                if file.is_file() and file.suffix != ".a":
                    self.assertNotIn(str(BUILD).encode(), file.read_bytes(), f"{name}: {file.name}")

    def test_dependencies_name_what_programs_link_to(self):
        depends = field(self.packages["nephos"], "Depends")
        for library in ("libopenvdb", "libtbb", "libc6", "libseccomp2", "libfmt"):
            self.assertIn(library, depends)
        self.assertIn("nephos (= ", field(self.packages["nephos-editor"], "Depends"))
        for library in ("libopenvdb-dev", "nlohmann-json3-dev", "zlib1g-dev"):
            self.assertIn(library, field(self.packages["libnephos-dev"], "Depends"))
        self.assertIn("python3-numpy", field(self.packages["python3-nephos"], "Depends"))

    def test_every_page_of_the_manual_is_correct_troff(self):
        tree = self.folder / "manual"
        for package in self.packages.values():
            output("dpkg-deb", "-x", package, tree)
        pages = sorted((tree / "usr/share/man/man1").glob("*"))
        self.assertGreater(len(pages), 12)
        for page in pages:
            result = subprocess.run(["groff", "-man", "-Tutf8", "-ww", page], capture_output=True, text=True)
            self.assertEqual((result.returncode, result.stderr), (0, ""), page.name)
            text = " ".join(re.sub(".\b", "", result.stdout).split())  # justified
            for words in (f"{page.stem}(1)", f"{page.stem} - ", "SYNOPSIS", "OPTIONS", "--help", "SEE ALSO"):
                self.assertIn(words, text)

    def bare_root(self, name, packages):
        """A root with the files and the dpkg database of these packages and their dependencies, and nothing else."""
        root = self.folder / name
        closure = installed_closure(packages)
        (root / "var/lib/dpkg/info").mkdir(parents=True)
        (root / "var/lib/dpkg/updates").mkdir()
        for link in ("bin", "sbin", "lib", "lib64"):
            (root / "usr" / link).mkdir(parents=True)
            (root / link).symlink_to(f"usr/{link}")
        (root / "dev").mkdir()
        os.mknod(root / "dev/null", 0o666 | 0o020000, os.makedev(1, 3))
        (root / "tmp").mkdir()
        paths = sorted({path for path in output("dpkg", "-L", *closure).splitlines()
                        if path.startswith("/") and not path.startswith("/usr/share/doc") and
                        (os.path.islink(path) or os.path.isfile(path))})
        for path in paths:
            target = root / path.lstrip("/")
            if target.exists() or target.is_symlink():
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, target, follow_symlinks=False)
        # Links that the packages' scripts make, which are not run here: NumPy's BLAS is an alternative.
        for link in pathlib.Path("/etc/alternatives").iterdir():
            administration = pathlib.Path("/var/lib/dpkg/alternatives") / link.name
            if not administration.exists() or os.readlink(link) not in paths:
                continue
            for each in (link, pathlib.Path(administration.read_text().splitlines()[1])):
                target = root / str(each).lstrip("/")
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(each, target, follow_symlinks=False)
        (root / "var/lib/dpkg/status").write_text(output("dpkg-query", "-s", *closure))
        subprocess.run(["ldconfig", "-r", root], check=True)
        return root

    def root_with(self, *packages):
        """A root of what these packages of ours depend on, with them installed."""
        names = [word.strip().split()[0] for name in packages for word in field(self.packages[name], "Depends").split(",")]
        root = self.bare_root("root-" + packages[0], [*BASE, *(name for name in names if name not in NAMES)])
        for name in packages:
            # dpkg refuses a package of which a dependency is not in this root's database.
            result = subprocess.run(["dpkg", f"--root={root}", "--force-script-chrootless", "--install", self.packages[name]],
                                    capture_output=True, text=True)
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return root

    @unittest.skipUnless(os.geteuid() == 0, "chroot takes root's rights")
    def test_programs_work_in_a_root_of_their_dependencies_alone(self):
        packages = ["nephos", *sorted(NAMES - {"nephos", "libnephos-dev"})]
        root = self.root_with(*packages)
        (root / "tmp/small.toml").write_text(SCENE)

        def inside(*command, status=0):
            result = subprocess.run(["/usr/sbin/chroot", root, *command], capture_output=True, text=True,
                                    env={"PATH": "/usr/bin", "LC_ALL": "C.UTF-8", "HOME": "/tmp"})
            self.assertEqual(result.returncode, status, result.stdout + result.stderr)
            return result.stdout if status == 0 else result.stderr
        self.assertRegex(inside("nephos", "--version"), r"^nephos \d")
        inside("nephos", "run", "/tmp/small.toml", "--splatting", "cpu", "--quiet", "--out", "/tmp/out")
        self.assertTrue(list((root / "tmp/out/frames").glob("*.png")))
        output(BUILD / "bin/nephos", "verify", root / "tmp/out")  # outside: reading volumes takes /proc
        self.assertIn("takes a mounted /proc", inside("nephos", "info", "/tmp/out/density/small_0001.vdb", status=3))
        self.assertEqual(inside("nephos-editor", "--version"), inside("nephos", "--version"))
        self.assertIn("--screenshot", inside("nephos-editor", "--help"))
        if "nephos-mpi" in packages:
            self.assertIn("mpirun", inside("nephos-mpi", "--man"))
        inside("nephos", "validate", "/usr/share/nephos/scenes/cumulus.toml")
        here = output(BUILD / "bin/nephos", "hash", root / "tmp/small.toml")
        self.assertEqual(inside("nephos", "hash", "/tmp/small.toml"), here)
        (root / "tmp/module.py").write_text(MODULE)
        module, *steps = inside("python3", "-B", "/tmp/module.py").splitlines()
        self.assertEqual(module, "/usr/lib/python3/dist-packages/nephos")
        self.assertEqual(steps, here.splitlines())
        output("dpkg", f"--root={root}", "--force-script-chrootless", "--remove", *reversed(packages))
        self.assertFalse((root / "usr/bin/nephos").exists())

    @unittest.skipUnless(os.geteuid() == 0, "chroot takes root's rights")
    def test_programs_of_others_take_nothing_but_the_package_and_its_dependencies(self):
        root = self.root_with("libnephos-dev")
        tree = self.folder / "consumer"
        only = [f"-DCMAKE_FIND_ROOT_PATH_MODE_{kind}=ONLY" for kind in ("PACKAGE", "LIBRARY", "INCLUDE")]
        output("cmake", "-S", SOURCE / "tests/apps/consumer", "-B", tree, "-G", "Ninja", f"-DCMAKE_SYSROOT={root}", *only,
               "-DCMAKE_BUILD_TYPE=Debug")
        self.assertIn(f"nephos_DIR:PATH={root}/usr/lib/cmake/nephos", (tree / "CMakeCache.txt").read_text())
        output("cmake", "--build", tree)
        shutil.copy2(tree / "automaton_only", root / "tmp")
        self.assertRegex(output("/usr/sbin/chroot", root, "/tmp/automaton_only"), "^[0-9a-f]{32}$")

    @unittest.skipUnless(os.geteuid() == 0, "chroot takes root's rights")
    def test_a_root_without_a_library_is_refused(self):
        root = self.bare_root("poor", BASE)
        result = subprocess.run(["dpkg", f"--root={root}", "--force-script-chrootless", "--install", self.packages["nephos"]],
                                capture_output=True, text=True)
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("libopenvdb", result.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
