# SPDX-License-Identifier: Apache-2.0
"""`nephos export` that is killed, stopped, refused or met by files of others: which files it takes for its own (docs/adr/0038-noted-exports.md)."""

import os
import shutil
import signal
import subprocess
import time
import unittest

from case import NEPHOS, PATIENCE, SANITIZED, Case, limit_addresses
from verify_test import PLACED


class InterruptedExport(Case):
    def setUp(self):
        super().setUp()
        self.call("run", self.write("placed.toml", PLACED), "--no-render", "--out", "run")

    def export(self, folder, *arguments):
        self.call("export", "run", "-o", folder, *arguments)
        self.call("verify", folder)
        return self.folder / folder

    KINDS = (["--for", "blender"], ["--for", "unreal"], ["--to", "vdb", "--voxel", "200"], ["--to", "raw", "--to", "layers", "--to", "cigi"],
             ["--to", "usd", "--to", "vdb"], ["--to", "nvdb"], ["--to", "vti"], ["--for", "flightgear"])

    def faulty(self, plan, path, *arguments, status):
        """An export of which calls of the system fail."""
        environment = {**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": plan, "FAIL_PATH": path}
        done = subprocess.run([NEPHOS, "export", "run", *arguments], cwd=self.folder, env=environment, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stderr

    def killed(self, call, first, path, *arguments):
        """An export that is killed at a call of the system on files with this in their path."""
        self.faulty(f"{call} KILL {first} 1", path, *arguments, status=-signal.SIGKILL)

    def stopped(self, plan, path, *command):
        """A command that has stopped at a call of the system on files with this in their path, and goes on by SIGCONT."""
        environment = {**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": plan, "FAIL_PATH": path}
        process = subprocess.Popen([NEPHOS, *command], cwd=self.folder, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)
        return process

    def test_a_killed_export_knows_its_files(self):
        """It goes on, whatever it writes and wherever it was killed, and what is there in the end is what an undisturbed one has written."""
        for kind, arguments in enumerate(self.KINDS):
            whole = self.export(f"whole-{kind}", *arguments)
            for call, first, path in (("rename", 3, "placed_"), ("rename", 4, "placed_"), ("rename", 1, "README"), ("fsync", 2, "notes")):
                out = self.folder / f"out-{kind}-{call}-{first}"
                self.killed(call, first, path, *arguments, "-o", out)
                self.call("export", "run", *arguments, "-o", out)
                self.assertEqual({file.name: file.read_bytes() for file in out.iterdir()}, {file.name: file.read_bytes() for file in whole.iterdir()}, out)
                shutil.rmtree(out)

    def test_files_of_a_killed_export_are_kept(self):
        """By what writes single files, before they are listed; but a file of somebody in such a place is theirs."""
        scene = self.folder / "placed.toml"
        self.killed("rename", 3, "out/placed_", "--to", "vdb", "-o", "out", "-j", "1")
        made = sorted((self.folder / "out").glob("placed_*.vdb"))
        self.assertTrue(made)
        for file in made:
            before = file.read_bytes()
            self.refused(2, "state", scene, "--steps", "1", "--out", file, says="is a file of the export in ")
            self.assertEqual(file.read_bytes(), before)
        self.refused(2, "state", scene, "--steps", "1", "--out", "out/.nephos-export/notes.jsonl", says="is a file of the export in ")
        (self.folder / "out/.nephos-export/alias").symlink_to("notes.jsonl")
        for name in ("notes.jsonl", "./notes.jsonl", "alias"):
            self.refused(2, "state", scene, "--steps", "1", "--out", name, cwd=self.folder / "out/.nephos-export", says="is a file of the export in ")
        (self.folder / "out/.nephos-export/alias").unlink()
        if os.geteuid() == 0 and shutil.which("setpriv"):  # of another user, who may not look into the notes
            self.folder.chmod(0o755)
            (self.folder / "out").chmod(0o777)
            for _ in range(2):
                state = subprocess.run(["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups", NEPHOS, "state", scene, "--steps", "1", "-q", "-o",
                                        "out/theirs.vdb"], cwd=self.folder, env=self.environment, capture_output=True, text=True)
                self.assertEqual(state.returncode, 0, state.stderr)
            (self.folder / "out/theirs.vdb").unlink()
        made[0].write_bytes(b"mine")
        self.call("state", scene, "--steps", "1", "-q", "--out", made[0])
        made[0].unlink()
        self.call("export", "run", "--to", "vdb", "-o", "out")
        self.call("verify", "out")

    def test_a_killed_export_takes_no_file_of_others_for_its_own(self):
        """Volumes, texts and weather that somebody put where it had not come to, as a file or a link, stay, however often it is called."""
        arguments = ["--to", "raw", "--to", "layers", "-o", "out"]
        folder, elsewhere = self.folder / "out", self.folder / "diary.txt"
        elsewhere.write_text("mine")
        for call, first, path in (("rename", 3, "placed_"), ("rename", 1, "README")):
            for name in ("README.txt", "placed.layers.json", "placed_0004.raw"):
                for is_link in (False, True):
                    self.killed(call, first, path, *arguments)
                    left = folder / name
                    if left.exists():  # it had come to this one
                        self.assertEqual((path, name), ("README", "placed_0004.raw") if name.endswith("raw") else ("README", "placed.layers.json"))
                        shutil.rmtree(folder)
                        continue
                    left.symlink_to(elsewhere) if is_link else left.write_text("mine")
                    for _ in range(3):
                        self.refused(2, "export", "run", *arguments, says=f"{name}: is there already, and no export of this has listed it")
                        self.assertEqual((left.read_text(), elsewhere.read_text(), left.is_symlink()), ("mine", "mine", is_link))
                    left.unlink()
                    self.call("export", "run", *arguments)
                    self.call("verify", "out")
                    shutil.rmtree(folder)

    def test_a_killed_export_knows_what_it_has_made_again(self):
        """Files of a list that are made again, of other frames or another source, are noted as well: one that asks for less removes them."""
        for call, path, changes in (("rename", "placed.volume.json", False), ("fsync", "placed_0003", True)):
            folder = self.export("out", "--to", "raw", "--to", "layers", "--frames", "1..4" if changes else "1..3")
            if changes:
                for number in (1, 2, 3):
                    shutil.copy(self.folder / "run/density/placed_0004.vdb", self.folder / f"run/density/placed_000{number}.vdb")
            try:
                self.killed(call, 1, path, "--to", "raw", "--to", "layers", "-o", "out")
                said = self.call("export", "run", "--to", "raw", "--frames", "1..2", "-o", "out").stderr
                self.assertNotIn("changed since", said)
                self.call("verify", "out")
                self.assertEqual({file.name for file in folder.iterdir()},
                                 {"README.txt", "export.json", "placed.volume.json", "placed_0001.raw", "placed_0002.raw"})
                self.export("out", "--to", "raw", "--to", "layers")
            finally:
                shutil.rmtree(folder)

    def test_every_preset_takes_every_summary_of_weather(self):
        """Also one that it writes by itself, or that is named twice."""
        for preset in ("blender", "flightgear", "msfs", "xplane", "cigi"):
            for form in ("layers", "metar", "xplane", "wpr", "cigi"):
                self.export(f"{preset}-{form}", "--for", preset, "--to", form, "--to", form)

    def test_an_interrupted_export_without_its_notes(self):
        """It says how it may go on, and removes nothing of others."""
        self.killed("rename", 2, "out/placed_", "--to", "raw", "-o", "out")
        shutil.rmtree(self.folder / "out/.nephos-export")
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says="if the one that was interrupted has written it, whose notes are not there, remove it")
        (self.folder / "out/.nephos-export/mine").mkdir(parents=True)
        for path in (self.folder / "out").glob("*.raw"):
            path.unlink()
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says=".nephos-export: is in the way")
        (self.folder / "out/.nephos-export/mine").rmdir()
        (self.folder / "out/.nephos-export/mine").write_text("mine")
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says=".nephos-export: is in the way")
        (self.folder / "out/.nephos-export/mine").unlink()
        self.export("out", "--to", "raw")

    def test_a_run_that_grows_is_that_of_one_moment(self):
        """Its volumes and its weather have the same frames, whenever others come."""
        run = ("run", self.folder / "placed.toml", "--no-render", "--checkpoint-every", "0", "--out")
        environment = {"LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": "rename KILL 1 1", "FAIL_PATH": "placed_0005"}
        self.call(*run, "short", status=-signal.SIGKILL, env=environment)
        counts = set()
        for opened in range(1, 9):
            shutil.rmtree(self.folder / "run")
            shutil.copytree(self.folder / "short", self.folder / "run")
            process = self.stopped(f"open STOP {opened} 1", "manifest.json", "export", "run", "--to", "raw", "--to", "metar", "-o", f"out{opened}")
            self.call(*run, "run", "--resume")
            process.send_signal(signal.SIGCONT)
            error = process.communicate(timeout=PATIENCE)[1]
            self.assertEqual(process.returncode, 0, error)
            volumes = len(list((self.folder / f"out{opened}").glob("*.raw")))
            self.assertEqual(len((self.folder / f"out{opened}/placed.metar.txt").read_text().splitlines()), volumes)
            counts.add(volumes)
        self.assertEqual(len(counts), 2)  # before it was read, and afterwards

    def test_a_link_in_place_of_the_hidden_folder_is_not_followed(self):
        """Also where it is put there when an export has begun to go on."""
        (self.folder / "victim").mkdir()
        (self.folder / "victim/letter.txt").write_text("mine")
        self.killed("rename", 2, "out/placed_", "--to", "raw", "-o", "out")
        process = self.stopped("rename STOP 1 1", "export.json", "export", "run", "--to", "raw", "-o", "out")
        (self.folder / "out/.nephos-export").rename(self.folder / "away")
        (self.folder / "out/.nephos-export").symlink_to("../victim")
        process.send_signal(signal.SIGCONT)
        error = process.communicate(timeout=PATIENCE)[1]
        self.assertEqual((process.returncode, (self.folder / "victim/letter.txt").read_text()), (2, "mine"), error)
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says=".nephos-export: is in the way")
        (self.folder / "out/.nephos-export").unlink()
        self.export("out", "--to", "raw")

    @unittest.skipIf(os.geteuid() != 0, "needs another user")
    def test_verify_by_another_user(self):
        """The notes of a killed export are its user's alone: what there is, is judged without them."""
        self.killed("rename", 3, "out/placed_", "--to", "raw", "-o", "out")
        self.assertNotIn("listed nowhere", self.call("verify", "out", status=1).stdout)
        os.chmod(self.folder, 0o755)
        done = subprocess.run(["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups", NEPHOS, "verify", "out"], cwd=self.folder,
                              env=self.environment, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("the export was interrupted", done.stdout)

    def test_file_systems_that_rename_less(self):
        """Without RENAME_NOREPLACE (EINVAL), and within a folder alone (EXDEV)."""
        whole = self.export("whole", "--to", "raw")
        for number, plan in enumerate(("rename EINVAL 1 1", "rename EXDEV 1 1")):
            out = f"less-{number}"
            self.faulty(plan, f"{out}/placed_0002", "--to", "raw", "-o", out, status=0)
            self.call("verify", out)
            self.assertEqual({file.name: file.read_bytes() for file in (self.folder / out).iterdir()}, {file.name: file.read_bytes() for file in whole.iterdir()})
        error = self.faulty("rename EXDEV 1 2", "none/placed_0002", "--to", "raw", "-o", "none", status=3)
        self.assertIn("none/placed_0002.raw: cannot rename into place: Invalid cross-device link", error)
        self.assertEqual([path.name for path in (self.folder / "none").glob(".*")], [])
        self.assertFalse((self.folder / "none/placed_0002.raw").exists())
        self.export("none", "--to", "raw")

    def test_messages_name_the_hidden_folder_by_its_path(self):
        self.killed("rename", 2, "out/placed_", "--to", "raw", "-o", "out")
        error = self.faulty("open EIO 1 1", "/proc/self/fd/", "--to", "raw", "-o", "out", status=3)
        self.assertIn("out/.nephos-export/: cannot read: Input/output error", error)
        shutil.rmtree(self.folder / "out")
        for call in ("read EIO 1 1", "write ENOSPC 1 1", "open EACCES 1 1"):
            error = self.faulty(call, ".nephos-export/placed_0002" if call.startswith("read") else ".nephos-export/.placed_0002", "--to", "raw", "-o", "out", status=3)
            self.assertIn("out/.nephos-export/placed_0002.raw: cannot ", error)
            self.export("out", "--to", "raw")
            shutil.rmtree(self.folder / "out")

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_what_is_compressed_without_memory_is_not_written(self):
        """zlib and libpng tell a lack of memory in their own way, at any of its allocations."""
        arguments = ("--to", "nvdb", "--to", "vti", "--zip", "--to", "slices", "--frames", "3..3", "-j", "1")
        whole = self.export("whole", *arguments)
        failed = 0
        for number in range(1, 120):
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            done = subprocess.run([NEPHOS, "export", "run", *arguments, "-o", "out"], cwd=self.folder, capture_output=True, text=True, check=False,
                                  env={**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": f"allocate ENOMEM {number} 1"})
            self.assertIn(done.returncode, (0, 2, 3), done.stderr)
            self.assertNotIn("Warning", done.stderr)
            failed += done.returncode != 0
            if done.returncode == 0:
                for file in whole.iterdir():
                    self.assertEqual((self.folder / "out" / file.name).read_bytes(), file.read_bytes(), (number, file.name))
        self.assertGreater(failed, 0)

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_verify_tells_a_lack_of_memory_from_damage(self):
        for name, more in (("flightgear", []), ("slices", []), ("vti", ["--zip"])):
            self.export(name, "--to", name, *more, "--frames", "3..3")
            told = []
            for number in range(1, 60):
                done = subprocess.run([NEPHOS, "verify", name, "-j", "1"], cwd=self.folder, capture_output=True, text=True, check=False,
                                      env={**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": f"allocate ENOMEM {number} 1"})
                self.assertIn(done.returncode, (0, 3), done.stdout + done.stderr)
                told += [done.stdout] * ("cannot compare with its source: out of memory" in done.stdout)
            self.assertTrue(told, name)

    def test_verify_tells_a_look_that_fails_from_damage(self):
        for name in ("nvdb", "vdb"):
            self.export(name, "--to", name, "--frames", "3..3", "--voxel", "100")
            told = []
            for number in range(1, 30):
                done = subprocess.run([NEPHOS, "verify", name], cwd=self.folder, capture_output=True, text=True, check=False,
                                      env={**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": f"stat EIO {number} 1", "FAIL_PATH": name + "/"})
                self.assertIn(done.returncode, (0, 3), done.stdout + done.stderr)
                told += [number] * (done.returncode == 3)
            self.assertTrue(told, name)

    def test_a_look_that_fails_is_no_change(self):
        told = []
        for number in range(1, 8):
            done = subprocess.run([NEPHOS, "export", "run", "--to", "raw", "--frames", "3..3", "-o", f"look{number}"], cwd=self.folder,
                                  capture_output=True, text=True, check=False,
                                  env={**self.environment, "LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": f"stat EIO {number} 1",
                                       "FAIL_PATH": "run/density/placed_0003"})
            self.assertIn(done.returncode, (0, 3), done.stderr)
            self.assertNotIn("was changed", done.stderr)
            told += [number] * (done.returncode == 3)
        self.assertTrue(told)

    def test_a_run_that_cannot_be_examined_is_still_one(self):
        """Nor does a plan need the folder that it is for."""
        (self.folder / "loop").symlink_to("loop")
        for folder in ("loop/x", "n" * 300):
            self.assertIn("nothing was written", self.call("export", "run", "--to", "raw", "--plan", "-o", folder).stdout)
        for path in ("run/manifest.json", "run"):
            for number in range(1, 5):
                error = self.faulty(f"stat EIO {number} 1", path, "--to", "raw", "--to", "metar", "-o", "out", status=3)
                self.assertRegex(error, "^error: run(/manifest.json)?: cannot examine: Input/output error\n")

    def test_a_folder_put_there_meanwhile_stays(self):
        """Where an export has looked for its hidden folder, and not made it yet; whoever owns it."""
        for was_killed in (False, True):
            for owner in (0, 65534):
                if was_killed:
                    self.killed("rename", 2, "out/placed_", "--to", "raw", "-o", "out")
                process = self.stopped("rename STOP 1 1", "export.json", "export", "run", "--to", "raw", "-o", "out")
                hidden = self.folder / "out/.nephos-export"
                if was_killed:
                    hidden.rename(self.folder / "away")
                hidden.mkdir()
                (hidden / "thesis.txt").write_text("mine")
                if os.geteuid() == 0:
                    os.chown(hidden, owner, owner)
                process.send_signal(signal.SIGCONT)
                error = process.communicate(timeout=PATIENCE)[1]
                self.assertEqual((process.returncode, (hidden / "thesis.txt").read_text()), (2, "mine"), error)
                self.assertIn(".nephos-export: is in the way", error)
                hidden.rename(self.folder / "thesis")
                self.export("out", "--to", "raw")
                for name in ("out", "thesis", "away"):
                    shutil.rmtree(self.folder / name, ignore_errors=True)

    def test_notes_of_others(self):
        """Damaged, very long or none at all, they let nothing in and take no memory."""
        whole = self.export("whole", "--to", "raw")
        for number, notes in enumerate((b"\0" * 100, b"[" * 100_000, b'{"path": "../run/manifest.json", "bytes": 1, "xxh3": "0"}\n', b"", None)):
            # One frame at a time, so that the first is in its place when the second is about to get there.
            self.killed("rename", 2, f"out-{number}/placed_", "--to", "raw", "-o", f"out-{number}", "-j", "1")
            path = self.folder / f"out-{number}/.nephos-export/notes.jsonl"
            path.write_bytes(notes or b"")
            if notes is None:
                os.truncate(path, 100 << 30)
            done = subprocess.run([NEPHOS, "export", "run", "--to", "raw", "-o", f"out-{number}"], cwd=self.folder, env=self.environment,
                                  capture_output=True, text=True, check=False, preexec_fn=lambda: limit_addresses(2 << 30))
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("whose notes are not there", done.stderr)
            for path in (self.folder / f"out-{number}").glob("*.raw"):
                path.unlink()
            self.export(f"out-{number}", "--to", "raw")
            self.assertEqual({file.name: file.read_bytes() for file in (self.folder / f"out-{number}").iterdir()},
                             {file.name: file.read_bytes() for file in whole.iterdir()})

    def test_what_becomes_of_files_meanwhile(self):
        """One that is removed or replaced ends the export; a folder that is put in the place of its own stays as it is."""
        self.call("run", self.scene, "--no-render", "--out", "long", "--set", "time.steps=240")
        whole = ("export", "long", "--to", "raw", "--to", "vti", "-o", "own")
        for act in ("remove", "replace", "exchange"):
            self.call("export", "long", "--to", "raw", "--to", "vti", "-o", "other")
            self.call(*whole)
            if act == "exchange":
                for path in sorted((self.folder / "long/density").glob("*.vdb"))[2:]:
                    shutil.copy(self.folder / "long/density/tiny_0001.vdb", path)
            else:
                shutil.rmtree(self.folder / "own")
            before = {file.name: file.read_bytes() for file in (self.folder / "other").iterdir()}
            process = self.stopped("fsync STOP 1 1", "tiny_0006", *whole)
            if act == "exchange":
                (self.folder / "own").rename(self.folder / "away")
                (self.folder / "other").rename(self.folder / "own")
            elif act == "remove":
                (self.folder / "own/tiny_0001.raw").unlink()
            else:
                (self.folder / "own/tiny_0001.raw").write_text("mine")
            process.send_signal(signal.SIGCONT)
            error = process.communicate(timeout=PATIENCE)[1]
            self.assertEqual(process.returncode, 3, error)
            self.assertIn("was removed or", error)
            if act == "exchange":
                self.assertEqual({file.name: file.read_bytes() for file in (self.folder / "own").iterdir() if file.is_file()}, before)
            else:
                self.assertIn("tiny_0001.raw", error)
                self.call(*whole)
                self.call("verify", "own")
                shutil.rmtree(self.folder / "own")
            shutil.rmtree(self.folder / "other", ignore_errors=True)

    def test_a_folder_put_there_while_left_over_files_are_removed(self):
        """Nothing of it is removed or replaced; and what was removed of its own is listed no more."""
        for first, path, swaps in ((1, "placed_0003.raw", True), (1, "export.json.", True), (2, "export.json.", True), (1, "placed_0003.raw", False)):
            self.export("out", "--to", "raw")
            self.export("other", "--to", "raw", "--type", "r16")
            before = {file.name: file.read_bytes() for file in (self.folder / "other").iterdir()}
            call = "read" if path.endswith("raw") else "open"
            process = self.stopped(f"{call} STOP {first} 1", path if path.endswith("raw") else "out/.export.part", "export", "run", "--to", "raw", "--frames", "1..2", "-o", "out")
            if swaps:
                (self.folder / "out").rename(self.folder / "away")
                (self.folder / "other").rename(self.folder / "out")
            else:
                (self.folder / "out/placed_0003.raw").unlink()
                (self.folder / "out/placed_0003.raw").write_text("mine")
            process.send_signal(signal.SIGCONT)
            error = process.communicate(timeout=PATIENCE)[1]
            self.assertEqual(process.returncode, 3, error)
            if swaps:
                self.assertIn("was removed or renamed", error)
                self.assertEqual({file.name: file.read_bytes() for file in (self.folder / "out").iterdir()}, before, (first, path))
                self.call("verify", "out")
            else:
                self.assertEqual((self.folder / "out/placed_0003.raw").read_text(), "mine")
            for name in ("out", "other", "away"):
                shutil.rmtree(self.folder / name, ignore_errors=True)
        self.export("out", "--to", "raw")
        self.killed("rename", 3, "out/export.json", "--to", "raw", "--frames", "1..2", "-o", "out")
        (self.folder / "out/placed_0003.raw").write_text("mine")
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says="placed_0003.raw: is there already, and no export of this has listed it")

    def test_a_list_put_there_meanwhile_stays(self):
        """Where an export has looked for one, and not written its own yet."""
        for stop, path in (("stat STOP 2 1", "out/placed_0001"), ("fsync STOP 1 1", "out/.export")):
            process = self.stopped(stop, path, "export", "run", "--to", "raw", "-o", "out")
            (self.folder / "out/export.json").write_text("mine")
            process.send_signal(signal.SIGCONT)
            error = process.communicate(timeout=PATIENCE)[1]
            self.assertEqual((process.returncode, (self.folder / "out/export.json").read_text()), (2, "mine"), error)
            self.assertIn("export.json: is there already", error)
            self.assertEqual([path.name for path in (self.folder / "out").iterdir()], ["export.json"])
            shutil.rmtree(self.folder / "out")

    def test_a_signal_stops_weather(self):
        """Also behind the last volume; the same command goes on."""
        for stop, path, formats in (("rename STOP 1 1", "export.json", ["--to", "layers"]), ("rename STOP 4 1", "placed_", ["--to", "raw", "--to", "metar"])):
            whole = self.export("whole", *formats)
            process = self.stopped(stop, path, "export", "run", *formats, "-o", "out")
            process.send_signal(signal.SIGINT)
            process.send_signal(signal.SIGCONT)
            error = process.communicate(timeout=PATIENCE)[1]
            self.assertEqual(process.returncode, 130, error)
            self.assertIn("stopped; the same command goes on", error)
            self.assertEqual(list((self.folder / "out").glob("placed.*")), [])
            out = self.export("out", *formats)
            self.assertEqual({file.name: file.read_bytes() for file in out.iterdir()}, {file.name: file.read_bytes() for file in whole.iterdir()})
            shutil.rmtree(out)
            shutil.rmtree(whole)

    def test_a_signal_while_the_largest_value_is_looked_for(self):
        """By --range auto, before anything is written."""
        process = self.stopped("read STOP 1 1", "density/placed_0002", "export", "run", "--to", "raw", "--range", "auto", "-o", "out")
        process.send_signal(signal.SIGTERM)
        process.send_signal(signal.SIGCONT)
        error = process.communicate(timeout=PATIENCE)[1]
        self.assertEqual(process.returncode, 143, error)
        self.assertFalse((self.folder / "out").exists())

    def test_weather_of_a_run_that_is_exchanged(self):
        """A link that leads to another run by now, also to one without the frames asked for: refused; with the first one again it goes on."""
        self.call("run", "placed.toml", "--no-render", "--out", "second", "--seed", "9")
        self.call("run", "placed.toml", "--no-render", "--out", "short", "--seed", "9", "--frames", "..2")
        latest = self.folder / "latest"
        for formats in (["--to", "layers"], ["--to", "raw", "--to", "wpr"]):
            for other in ("second", "short"):
                latest.unlink(missing_ok=True)
                latest.symlink_to("run")
                command = ["export", "latest", *formats, "--frames", "3..4", "-o", "out"]
                process = self.stopped("rename STOP 1 1", "export.json", *command)
                latest.unlink()
                latest.symlink_to(other)
                process.send_signal(signal.SIGCONT)
                error = process.communicate(timeout=PATIENCE)[1]
                self.assertEqual(process.returncode, 3, error)
                latest.unlink()
                latest.symlink_to("run")
                self.call(*command)
                self.call("verify", "out")
                whole = self.folder / "whole"
                self.call("export", "latest", *formats, "--frames", "3..4", "-o", "whole")
                self.assertEqual({file.name: file.read_bytes() for file in (self.folder / "out").iterdir()},
                                 {file.name: file.read_bytes() for file in whole.iterdir()})
                for name in ("out", "whole"):
                    shutil.rmtree(self.folder / name)

    def test_what_an_export_refuses_leaves_the_one_before_complete(self):
        folder = self.export("out", "--to", "raw")
        before = {path.name: path.read_bytes() for path in folder.iterdir()}
        (folder / "placed.layers.json").write_text("mine")
        for _ in range(2):
            self.refused(2, "export", "run", "--to", "raw", "--to", "layers", "-o", "out", says="placed.layers.json: is there already")
        (folder / "placed.layers.json").unlink()
        self.assertEqual({path.name: path.read_bytes() for path in folder.iterdir()}, before)
        self.call("verify", "out")
        (folder / ".nephos-export").symlink_to(self.folder)  # its own hidden folder
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says=".nephos-export: is in the way")
        self.assertIn("listed nowhere", self.call("verify", "out", status=1).stdout)
        (folder / ".nephos-export").unlink()
        self.call("verify", "out")

    def test_files_that_are_put_there_meanwhile_stay(self):
        """Under a name that was free when the export began."""
        self.call("run", self.scene, "--no-render", "--out", "long", "--set", "time.steps=300")
        process = subprocess.Popen([NEPHOS, "export", "long", "--to", "vti", "--zip", "-o", "met"], cwd=self.folder,
                                   env=self.environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        while process.poll() is None and not (self.folder / "met/tiny_0003.vti").exists():
            time.sleep(0.001)
        process.send_signal(signal.SIGSTOP)
        last = self.folder / "met" / max((self.folder / "long/density").glob("*.vdb")).with_suffix(".vti").name
        self.assertFalse(last.exists())
        last.write_text("mine")
        process.send_signal(signal.SIGCONT)
        error = process.communicate(timeout=PATIENCE)[1]
        self.assertEqual((process.returncode, last.read_text()), (2, "mine"), error)
        self.assertIn(f"{last.name}: is there already", error)
        last.unlink()
        self.call("export", "long", "--to", "vti", "--zip", "-o", "met")
        self.call("verify", "met")


if __name__ == "__main__":
    unittest.main(verbosity=2)
