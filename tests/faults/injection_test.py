# SPDX-License-Identifier: Apache-2.0
"""Every call of the system that a command makes on its files is made to fail once, in every way that it can. After each:

- the exit status is 0 with all files as of an undisturbed call, or 3 with one message that names the reason, or the kill;
- every file that is there under its final name is whole: the same bytes as those of the undisturbed call, which programs of
  others have read; files that grow by rows are a beginning of them; a manifest that is not complete says so;
- nothing is left under a temporary name, but after a kill;
- calling it again, with --resume where the command asks for it, gives the bytes of the undisturbed call.

    NEPHOS=... SOURCE=. FAILING_CALLS=build/release/tests/faults/libfailing_calls.so python3 tests/faults/injection_test.py [Class]

Each class is a command that writes. Without NEPHOS_TEST_ALL=1 a few calls of each kind fail instead of all."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "apps/command"))
from case import LAYERED, NEPHOS, SCENE, voxels  # noqa: E402

ALL = os.environ.get("NEPHOS_TEST_ALL") == "1"
SLICE = 2  # calls of each kind, when not all

# Of each call the ways in which it fails.
WAYS = {
    "write": ("ENOSPC", "EIO", "EINTR", "SHORT", "KILL"),
    "fsync": ("ENOSPC", "EIO", "EINTR", "KILL"),
    "rename": ("ENOSPC", "EIO", "KILL"),
    "open": ("ENOSPC", "EIO", "EINTR", "EMFILE", "KILL"),
    "mkdir": ("ENOSPC", "EIO"),
    "read": ("EIO", "EINTR", "SHORT"),
    "lseek": ("EIO", "KILL"),
    "stat": ("EIO",),
    "mmap": ("ENOMEM",),
    "allocate": ("ENOMEM",),
}
# What POSIX or our own page (docs/reliability.md) wants to be gone on with.
REPEATED = {("write", "EINTR"), ("write", "SHORT"), ("fsync", "EINTR"), ("read", "EINTR"), ("read", "SHORT")}
REASONS = {"ENOSPC": "No space left", "EIO": "Input/output error", "EINTR": "Interrupted", "EMFILE": "Too many open files",
           "ENOMEM": "memory"}

LISTS = ("manifest.json", "export.json")  # written anew as the command proceeds

LAYERS = LAYERED + """\
[[layer]]
name = "high"
skies = "clear"
base_height_m = 2000
lattice = { origin_m = [0, 0, 2000] }
background = { hum = 0.1, act = 0.02, ext = 0.05 }
"""
NULL = """\
[lattice]
cells = [64, 64, 10]
boundaries = ["periodic", "periodic", "open"]
initial = "empty"
[time]
steps = 60
[field.background]
hum = 0.0
act = 0.002
ext = 0.1
"""


def calls_of(count):
    """The numbers of the calls that fail: all, or some from the first to the last."""
    if ALL or count <= SLICE:
        return range(1, count + 1)
    return sorted({1 + (count - 1) * n // (SLICE - 1) for n in range(SLICE)})


class Injection(unittest.TestCase):
    arguments = None  # of the command, which writes to `out`
    grows = ()  # files that get rows appended
    varies = ("manifest.json", "timing.csv")  # files that hold times
    calls = tuple(WAYS)
    again = ()  # of the call after a failure, beside the same arguments
    leftovers_stay = False  # after a kill: where others may be writing, nobody knows whose they are

    @classmethod
    def setUpClass(cls):
        if cls.arguments is None:
            raise unittest.SkipTest("the base of the others")
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos faults "))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.environment = {**os.environ, "LC_ALL": "C.UTF-8", "NO_COLOR": "1"}
        (cls.folder / "tiny.toml").write_text(SCENE.replace("steps = 6", "steps = 3"))
        (cls.folder / "layers.toml").write_text(LAYERS.replace("steps = 6", "steps = 2"))
        (cls.folder / "null.toml").write_text(NULL)
        cls.prepare()
        result = cls.command()
        assert result.returncode == 0, result.stderr
        (cls.folder / "out").rename(cls.folder / "undisturbed")

    @classmethod
    def prepare(cls):
        """Makes what the command reads."""

    @classmethod
    def command(cls, *more, fail=None, everywhere=False):
        environment = dict(cls.environment)
        if fail:
            environment.update(LD_PRELOAD=os.environ["FAILING_CALLS"], FAIL_CALL=fail, FAIL_PROGRAM=os.path.basename(NEPHOS),
                               FAIL_COUNT=str(cls.folder / "count"))
            if not everywhere:
                environment["FAIL_PATH"] = str(cls.folder) + "/"
        return subprocess.run([NEPHOS, *cls.arguments, *more], cwd=cls.folder, capture_output=True, text=True,
                              env=environment, timeout=300)

    def files(self, folder):
        root = self.folder / folder
        if root.is_file():
            return {"": root}
        return {str(path.relative_to(root)): path for path in root.rglob("*") if path.is_file()}

    def no_leftovers(self):
        self.assertEqual([path.name for path in self.folder.rglob(".*")], [])

    def whole_or_absent(self, complete):
        """Whatever stands under a final name; all of it when `complete`."""
        expected, found, before = self.files("undisturbed"), self.files("out"), self.files("before")
        names = {name for name in found if not any(part.startswith(".") for part in pathlib.Path(name).parts)}
        self.assertLessEqual(names, set(expected))
        if complete:
            self.assertEqual(names, set(expected))
        for name in names:
            content, should = found[name].read_bytes(), expected[name].read_bytes()
            base = pathlib.Path(name).name
            if base in LISTS and not complete:
                json.loads(content)
            elif base == "manifest.json":
                self.assertTrue(json.loads(content).get("complete", True), name)
            elif complete and base not in self.varies:
                self.assertEqual(content, should, name)
            elif base in self.varies or any(name.endswith(end) for end in self.grows):
                if name.endswith(".csv") and content and base not in self.varies:
                    self.assertTrue(should.startswith(content), name)
            elif base == "checkpoint.nephos":  # of any step
                info = subprocess.run([NEPHOS, "info", found[name]], capture_output=True, text=True)
                self.assertEqual(info.returncode, 0, info.stderr)
            elif name not in before or content != before[name].read_bytes():  # a table that was not written anew yet
                self.assertEqual(content, should, name)

    def go_on(self, after_kill):
        """The same call again, with the option that it asks for."""
        result = self.command(*self.again)
        if result.returncode == 2 and "--resume" in result.stderr:
            result = self.command("--resume")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.whole_or_absent(True)
        if not (self.leftovers_stay and after_kill):
            self.no_leftovers()

    def once(self, call, how, number, everywhere):
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True) if out.is_dir() else out.unlink(missing_ok=True)
        self.restore()
        result = self.command(fail=f"{call} {how} {number} 1", everywhere=everywhere)
        if how == "KILL":
            self.assertIn(result.returncode, (0, -signal.SIGKILL), result.stderr)
        elif (call, how) in REPEATED:
            self.assertEqual(result.returncode, 0, result.stderr)
        else:
            self.assertIn(result.returncode, (0, 3), result.stderr)
        if result.returncode == 3:
            self.assertRegex(result.stderr, r"(?m)^error: ")
            self.assertIn(REASONS[how], result.stderr)
            self.assertNotIn("unexpected", result.stderr)
        if result.returncode == 0:
            self.assertNotRegex(result.stderr, r"(?m)^error: ")
        if how != "KILL":
            self.no_leftovers()
        self.whole_or_absent(result.returncode == 0)
        if result.returncode != 0:
            self.go_on(how == "KILL")
        return result.returncode

    def restore(self):
        """Puts back what the command changes."""

    def test_whatever_fails(self):
        tried = failed = 0
        for call in self.calls:
            (self.folder / "count").unlink(missing_ok=True)
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            self.restore()
            everywhere = call in ("mmap", "allocate")
            self.assertEqual(self.command(fail=f"{call} COUNT 1 1", everywhere=everywhere).returncode, 0)
            count = (self.folder / "count").stat().st_size if (self.folder / "count").exists() else 0
            for how in WAYS[call]:
                for number in calls_of(count):
                    with self.subTest(call=call, how=how, number=number, of=count):
                        tried += 1
                        failed += self.once(call, how, number, everywhere) != 0
        print(f"{type(self).__name__}: {tried} faults, {failed} of them ended the command", file=sys.stderr)
        self.assertGreater(failed, 10)

    def test_the_undisturbed_files_are_read_by_programs_of_others(self):
        for name, path in self.files("undisturbed").items():
            with self.subTest(name=name):
                read_by_others(path)


def read_by_others(path):
    suffix = path.suffix
    if suffix == ".vdb":
        assert voxels(path)[0]
    elif suffix in (".png", ".jpg"):
        from PIL import Image
        with Image.open(path) as image:
            image.load()
    elif suffix == ".exr":
        subprocess.run(["exrheader", path], check=True, capture_output=True)
    elif suffix == ".json":
        json.loads(path.read_text())
    elif suffix == ".mp4":
        found = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries", "stream=nb_read_frames", "-of",
                                "csv=p=0", path], check=True, capture_output=True, text=True).stdout
        assert int(found) > 0
    elif suffix == ".nc":
        import scipy.io
        scipy.io.netcdf_file(path, mmap=False).close()


class Run(Injection):
    arguments = ("run", "tiny.toml", "--no-render", "--out", "out", "--threads", "1")
    grows = ("statistics.csv",)


class Layered(Injection):
    arguments = ("run", "layers.toml", "--no-render", "--out", "out", "--threads", "1")
    grows = (".csv",)
    calls = ("write", "fsync", "rename", "open", "mkdir")


class Pictures(Injection):
    arguments = ("run", "tiny.toml", "--splatting", "cpu", "--set", "frames.exr=true", "--set", "time.steps=1", "--out", "out",
                 "--threads", "1")
    grows = ("statistics.csv",)
    calls = ("write", "fsync", "rename", "open", "lseek")


class Resumed(Injection):
    """Goes on with a run that ended before."""
    arguments = ("run", "tiny.toml", "--no-render", "--out", "out", "--resume", "--set", "time.steps=5", "--threads", "1")
    grows = ("statistics.csv",)
    calls = ("read", "write", "fsync", "rename", "open", "stat")

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "before", "--quiet"], cwd=cls.folder, check=True)
        shutil.copytree(cls.folder / "before", cls.folder / "out")

    def restore(self):
        shutil.copytree(self.folder / "before", self.folder / "out")


class State(Injection):
    arguments = ("state", "tiny.toml", "-o", "out/state.vdb")
    leftovers_stay = True
    calls = ("write", "fsync", "rename", "open", "lseek", "allocate")


class Render(Injection):
    arguments = ("render", "cloud.vdb", "--size", "64x48", "--splatting", "cpu", "-o", "out/picture.png")
    leftovers_stay = True
    calls = ("write", "fsync", "rename", "open", "read", "stat")

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "run", "--quiet"], cwd=cls.folder, check=True)
        (cls.folder / "run/density/tiny_0002.vdb").rename(cls.folder / "cloud.vdb")
        shutil.rmtree(cls.folder / "run")


class Export(Injection):
    arguments = ("export", "run", "-o", "out", *(word for name in ("raw", "vti", "dds", "ktx2", "nvdb", "usd", "slices", "vdb")
                                                 for word in ("--to", name)))
    varies = ("manifest.json",)
    calls = ("write", "fsync", "rename", "open", "mkdir", "read")

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "run", "--quiet", "--set", "time.steps=1"],
                       cwd=cls.folder, check=True)


class Sweep(Injection):
    arguments = ("sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps", "40..80",
                 "--out", "out", "-j", "1")
    leftovers_stay = True
    grows = (".jsonl", ".series", "timing.csv")
    calls = ("write", "fsync", "rename", "open", "mkdir", "read")


class GrownSweep(Injection):
    """Goes on with a sweep of fewer values: what cannot be read is not taken for empty."""
    arguments = ("sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1,0.2", "--replicates", "2", "--steps", "40..80",
                 "--out", "out", "-j", "1")
    leftovers_stay = True
    grows = (".jsonl", ".series", "timing.csv")
    calls = ("write", "open", "read", "stat")

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps", "40..80",
                        "--out", "before", "-j", "1", "--quiet"], cwd=cls.folder, check=True)
        shutil.copytree(cls.folder / "before", cls.folder / "out")

    def restore(self):
        shutil.copytree(self.folder / "before", self.folder / "out")


class Fit(Injection):
    arguments = ("fit", "fit.toml", "--out", "out", "-j", "1")
    leftovers_stay = True
    grows = (".jsonl", ".series", "timing.csv")
    calls = ("write", "fsync", "rename", "open")

    @classmethod
    def prepare(cls):
        (cls.folder / "fit.toml").write_text("""\
scene = "null.toml"
runs = 10
proof = 1
clouds_every = 0
[steps]
min = 400
max = 1600
[[parameter]]
key = "field.background.ext"
prior = { from = 0.05, to = 0.2, scale = "log" }
[[target]]
statistic = "cover"
value = 0.15
sd = 0.05
""")


class Metar(Injection):
    arguments = ("metar", "EGLL 211350Z 24015KT 9999 FEW030 BKN045 12/06 Q1015", "--date", "2024-06", "-o", "out/sky.toml")
    leftovers_stay = True


if __name__ == "__main__":
    unittest.main(verbosity=2)
