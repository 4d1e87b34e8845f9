# SPDX-License-Identifier: Apache-2.0
"""Every call of the system that a command makes on its files is made to fail once, in every way that it can. After each:

- the exit status is 0 with all files as of an undisturbed call, or 3 with one message that names the reason, or the kill;
- every file that is there under its final name is whole: the same bytes as those of the undisturbed call, which programs of
  others have read; files that grow by rows are a beginning of them; a manifest says that it is complete where all is there
  alone;
- nothing is left under a temporary name, but after a kill;
- calling it again, with --resume where the command asks for it, gives the bytes of the undisturbed call. What is left may
  be what an earlier fault has left, byte by byte: then that has been tried.

    NEPHOS=... SOURCE=. FAILING_CALLS=build/release/tests/faults/libfailing_calls.so python3 tests/faults/injection_test.py [Class]

Each class is a command that writes. Without NEPHOS_TEST_ALL=1 a few calls of each kind fail instead of all."""

import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "apps/command"))
from case import LAYERED, NEPHOS, PATIENCE, SCENE, voxels  # noqa: E402

ALL = os.environ.get("NEPHOS_TEST_ALL") == "1"
SLICE = 2  # calls of each kind, when not all

# Of each call the ways in which it fails. A kill at one that changes nothing leaves what a kill at the next that does would.
WAYS = {
    "write": ("ENOSPC", "EIO", "EINTR", "SHORT", "KILL"),
    "fsync": ("ENOSPC", "EIO", "EINTR", "KILL"),
    "rename": ("ENOSPC", "EIO", "KILL"),
    "open": ("ENOSPC", "EIO", "EINTR", "EMFILE", "KILL"),
    "mkdir": ("ENOSPC", "EIO", "KILL"),
    "read": ("EIO", "EINTR", "SHORT"),
    "lseek": ("EIO",),
    "stat": ("EIO",),
    "mmap": ("ENOMEM",),
    "allocate": ("ENOMEM",),
}
# What POSIX or our own page (docs/reliability.md) wants to be gone on with.
REPEATED = {("write", "EINTR"), ("write", "SHORT"), ("fsync", "EINTR"), ("read", "EINTR"), ("read", "SHORT")}
REASONS = {"ENOSPC": "No space left", "EIO": "Input/output error", "EINTR": "Interrupted", "EMFILE": "Too many open files",
           "ENOMEM": "memory"}

# Of a sweep a run without memory is recorded as failed, and made again by --retry-failed; Open MPI ends the program itself.
MEMORY = ("mmap", "allocate")

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


def calls_of(count, stride):
    """The numbers of the calls that fail: all, or every so many, or some from the first to the last."""
    if ALL or count <= SLICE:
        return range(1, count + 1, stride)
    return sorted({1 + (count - 1) * n // (SLICE - 1) for n in range(SLICE)})


def without_times(manifest):
    """A manifest.json but for what the clock has to do with."""
    return {key: value for key, value in json.loads(manifest).items() if key not in ("timing", "xxh3")}


class Injection(unittest.TestCase):
    program = NEPHOS
    arguments = None  # of the command, which writes to `out`
    grows = ()  # files that get rows appended
    varies = ("manifest.json", "timing.csv")  # files that hold times
    unused = ()  # calls of WAYS that it does not make on its files
    of_others = ()  # those that do not fail here
    says_what_is_missing = False  # makes what it can of what it could read, and status 3
    stride = 1  # more than 1: one of so many calls fails even where all are to
    work = ()  # what stays where it cannot be listed, until the call that goes on
    again = ()  # of the call after a failure, beside the same arguments
    leftovers_stay = False  # after a kill: where others may be writing, nobody knows whose they are

    @classmethod
    def setUpClass(cls):
        if cls.arguments is None:
            raise unittest.SkipTest("the base of the others")
        cls.sound, cls.gone_on = set(), set()  # checkpoints that were read, and states that were gone on from
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
            environment.update(LD_PRELOAD=os.environ["FAILING_CALLS"], FAIL_CALL=fail, FAIL_PROGRAM=os.path.basename(cls.program),
                               FAIL_COUNT=str(cls.folder / "count"))
            if not everywhere:
                environment["FAIL_PATH"] = str(cls.folder) + "/"
        return subprocess.run([cls.program, *cls.arguments, *more], cwd=cls.folder, capture_output=True, text=True,
                              env=environment, timeout=PATIENCE)

    def files(self, folder):
        root = self.folder / folder
        if root.is_file():
            return {"": root}
        return {str(path.relative_to(root)): path for path in root.rglob("*") if path.is_file()}

    def no_leftovers(self, but=()):
        self.assertEqual([path.name for path in self.folder.rglob(".*") if path.name not in but], [])

    def state(self):
        """A hash of what is left in `out`, whatever the time and the names of temporary files."""
        found, state = self.files("out"), hashlib.sha256()
        state.update(repr(sorted(str(path.relative_to(self.folder)) for path in self.folder.glob("out/**") if path.is_dir())).encode())
        for name in sorted(found, key=lambda name: (name.split(".part")[0], found[name].suffix)):
            content, base = found[name].read_bytes(), pathlib.Path(name).name
            if base == "manifest.json":
                content = json.dumps(without_times(content)).encode()
            elif base == "timing.csv":
                content = str(content.count(b"\n")).encode()
            state.update(repr((name.split(".part")[0], content)).encode())
        return state.digest()

    def require_sound(self, checkpoint):
        """Of any step: one that the command reads."""
        content = checkpoint.read_bytes()
        if content not in self.sound:
            info = subprocess.run([NEPHOS, "info", checkpoint], capture_output=True, text=True)
            self.assertEqual(info.returncode, 0, info.stderr)
            self.sound.add(content)

    def whole_or_absent(self, succeeded, said=""):
        """Whatever stands under a final name; all of it when the command says so, and of a folder whose list does."""
        expected, found, before = self.files("undisturbed"), self.files("out"), self.files("before")
        names = {name for name in found if not any(part.startswith(".") for part in pathlib.Path(name).parts)}
        self.assertLessEqual(names, set(expected))
        old = {name for name in names if name in before and found[name].read_bytes() == before[name].read_bytes()}
        complete = [""] if succeeded else []
        for name in names - old:
            if pathlib.Path(name).name in LISTS and json.loads(found[name].read_text())["complete"]:
                complete.append(name[:-len(pathlib.Path(name).name)])
        for folder in complete:
            self.assertEqual({name for name in names if name.startswith(folder)}, {name for name in expected if name.startswith(folder)})
        for name in names:
            content, should = found[name].read_bytes(), expected[name].read_bytes()
            base = pathlib.Path(name).name
            is_complete = any(name.startswith(folder) for folder in complete)
            if base == "manifest.json" and is_complete:
                self.assertEqual(without_times(content), without_times(should))
            elif base in self.varies and base not in LISTS:
                self.assertLessEqual(content.count(b"\n"), should.count(b"\n"), name)
            elif is_complete:
                self.assertEqual(content, should, name)
            elif base in LISTS:
                self.assertTrue(name in old or not json.loads(content)["complete"], name)
            elif any(name.endswith(end) for end in self.grows):
                self.assertTrue(should.startswith(content), name)
            elif base == "checkpoint.nephos":
                self.require_sound(found[name])
            elif name not in old and not (self.says_what_is_missing and "missing" in said):
                self.assertEqual(content, should, name)

    def go_on(self, after_kill):
        """The same call again, with the option that it asks for."""
        left = self.state()
        if left in self.gone_on:
            return
        result = self.command(*self.again)
        if result.returncode == 2 and "--resume" in result.stderr:
            result = self.command("--resume")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.whole_or_absent(True)
        if not (self.leftovers_stay and after_kill):
            self.no_leftovers()
        self.gone_on.add(left)

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
            self.assertRegex(result.stderr, r"(?m)^(\S+:\d+:(\d+:)? )?error: ")
            self.assertIn(REASONS[how], result.stderr)
            self.assertNotIn("unexpected", result.stderr)
        if result.returncode == 0:
            self.assertNotRegex(result.stderr, r"(?m)^(\S+:\d+:(\d+:)? )?error: ")
        if how != "KILL":
            self.no_leftovers(self.work if result.returncode == 3 else ())
        self.whole_or_absent(result.returncode == 0, result.stderr)
        if result.returncode != 0:
            self.go_on(how == "KILL")
        return result.returncode

    def restore(self):
        """Puts back what the command changes."""

    def test_whatever_fails(self):
        tried = failed = 0
        begin = time.monotonic()
        for call in sorted(set(WAYS) - set(self.of_others)):
            (self.folder / "count").unlink(missing_ok=True)
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            self.restore()
            everywhere = call in ("mmap", "allocate")
            self.assertEqual(self.command(fail=f"{call} COUNT 1 1", everywhere=everywhere).returncode, 0)
            count = (self.folder / "count").stat().st_size if (self.folder / "count").exists() else 0
            self.assertEqual(count == 0, call in self.unused, f"{call}: {count} calls")
            for how in WAYS[call]:
                for number in calls_of(count, self.stride):
                    with self.subTest(call=call, how=how, number=number, of=count):
                        tried += 1
                        failed += self.once(call, how, number, everywhere) != 0
        print(f"{type(self).__name__}: {tried} faults, {failed} of them ended the command and left {len(self.gone_on)} states, "
              f"{time.monotonic() - begin:.0f} s", file=sys.stderr)
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
    unused = ("lseek",)


class Layered(Injection):
    arguments = ("run", "layers.toml", "--no-render", "--out", "out", "--threads", "1")
    grows = (".csv",)
    unused = ("lseek",)


class Pictures(Injection):
    arguments = ("run", "tiny.toml", "--splatting", "cpu", "--set", "frames.exr=true", "--set", "time.steps=1", "--out", "out",
                 "--threads", "1")
    grows = ("statistics.csv",)
    unused = ("lseek",)


class Video(Injection):
    """The picture and the video that ffmpeg makes of it, whose own calls do not fail."""
    arguments = ("run", "tiny.toml", "--splatting", "cpu", "--video", "--set", "time.steps=1", "--set", "camera.width=64", "--set",
                 "camera.height=48", "--out", "out", "--threads", "1")
    grows = ("statistics.csv",)
    unused = ("lseek",)


class Branch(Injection):
    """Begins with the state of another run."""
    arguments = ("run", "--from", "source", "--no-render", "--set", "time.steps=5", "--out", "out", "--threads", "1")
    grows = ("statistics.csv",)

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "source", "--quiet"], cwd=cls.folder, check=True)


class Resumed(Injection):
    """Goes on with a run that ended before."""
    arguments = ("run", "tiny.toml", "--no-render", "--out", "out", "--resume", "--set", "time.steps=5", "--threads", "1")
    grows = ("statistics.csv",)
    unused = ("mkdir",)

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "before", "--quiet"], cwd=cls.folder, check=True)
        shutil.copytree(cls.folder / "before", cls.folder / "out")

    def restore(self):
        shutil.copytree(self.folder / "before", self.folder / "out")


class State(Injection):
    arguments = ("state", "tiny.toml", "-o", "out/state.vdb")
    leftovers_stay = True
    unused = ("lseek",)


class Render(Injection):
    arguments = ("render", "cloud.vdb", "--size", "64x48", "--splatting", "cpu", "-o", "out/picture.png")
    leftovers_stay = True

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "run", "--quiet"], cwd=cls.folder, check=True)
        (cls.folder / "run/density/tiny_0002.vdb").rename(cls.folder / "cloud.vdb")
        shutil.rmtree(cls.folder / "run")


class RenderLayers(Render):
    arguments = (*Render.arguments[:-1], "out/picture.exr")


def export_to(*formats):
    return ("export", "run", "-o", "out", *(word for name in formats for word in ("--to", name)))


class Export(Injection):
    work = (".nephos-export",)
    arguments = export_to("raw", "vti", "dds", "ktx2", "nvdb", "usd", "slices", "vdb")

    @classmethod
    def prepare(cls):
        place = ("georeference.latitude_deg=48", "georeference.longitude_deg=11", 'georeference.start_utc="2024-06-21T13:50:00Z"')
        subprocess.run([NEPHOS, "run", "tiny.toml", "--no-render", "--out", "run", "--quiet", "--set", "time.steps=1",
                        *(word for setting in place for word in ("--set", setting))], cwd=cls.folder, check=True)


class ExportToSimulators(Export):
    arguments = export_to("bricks", "flightgear", "layers", "metar", "xplane", "wpr", "cigi")


class Sweep(Injection):
    arguments = ("sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps", "40..80",
                 "--out", "out", "-j", "1")
    leftovers_stay = True
    grows = (".jsonl", ".series", "timing.csv")
    unused = ("lseek",)
    of_others = MEMORY


class GrownSweep(Injection):
    """Goes on with a sweep of fewer values: what cannot be read is not taken for empty."""
    arguments = ("sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1,0.2", "--replicates", "2", "--steps", "40..80",
                 "--out", "out", "-j", "1")
    leftovers_stay = True
    grows = (".jsonl", ".series", "timing.csv")
    unused = ("mkdir", "lseek")
    of_others = MEMORY

    @classmethod
    def prepare(cls):
        subprocess.run([NEPHOS, "sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps", "40..80",
                        "--out", "before", "-j", "1", "--quiet"], cwd=cls.folder, check=True)
        shutil.copytree(cls.folder / "before", cls.folder / "out")

    def restore(self):
        shutil.copytree(self.folder / "before", self.folder / "out")


class Merge(Injection):
    """Makes the tables of two shards in a third folder."""
    arguments = ("merge", "a", "b", "--out", "out")
    says_what_is_missing = True
    leftovers_stay = True
    unused = ("lseek",)

    @classmethod
    def prepare(cls):
        for number, folder in enumerate("ab"):
            subprocess.run([NEPHOS, "sweep", "null.toml", "--axis", "field.background.ext=0.05,0.1", "--replicates", "2", "--steps",
                            "40..80", "--out", folder, "-j", "1", "--quiet", "--shard", f"{number}/2"], cwd=cls.folder, check=True)


class Report(Merge):
    """The page of a sweep."""
    arguments = ("report", "a", "b", "-o", "out/report.html")


class Fit(Injection):
    """Three waves and a proof, each of which writes as Sweep does, call by call: so one of four fails."""
    arguments = ("fit", "fit.toml", "--out", "out", "-j", "1")
    leftovers_stay = True
    grows = (".jsonl", ".series", "timing.csv")
    unused = ("lseek",)
    of_others = MEMORY
    stride = 4

    @classmethod
    def prepare(cls):
        (cls.folder / "null.toml").write_text(NULL.replace("[64, 64, 10]", "[32, 32, 4]"))
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
    unused = ("read", "lseek")


class Ranks(Injection):
    """nephos-mpi, in a process of its own."""
    program = os.environ.get("NEPHOS_MPI", "")
    arguments = ("null.toml", "--steps", "3", "--out", "out", "--write-state")
    grows = ("statistics.csv",)
    again = ("--overwrite",)
    leftovers_stay = True
    unused = ("lseek",)
    of_others = MEMORY


if __name__ == "__main__":
    unittest.main(verbosity=2)
