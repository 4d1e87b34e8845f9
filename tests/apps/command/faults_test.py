# SPDX-License-Identifier: Apache-2.0
"""Calls of the system that fail, kills, and folders that vanish: no torn file, no success that is none, and always a way
forward. FAILING_CALLS names the library that lets the calls fail (failing_calls.cpp)."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
import unittest

from case import LONG, NEPHOS, PATIENCE, SOURCE, Case


class Faults(Case):
    def failing(self, call, path=None, program="nephos"):
        """An environment in which such calls fail."""
        if "FAILING_CALLS" not in os.environ:
            self.skipTest("FAILING_CALLS does not say where the library lies that lets calls fail")
        sanitizer = os.environ.get("LD_PRELOAD", "")
        env = {**self.environment, "LD_PRELOAD": f"{sanitizer} {os.environ['FAILING_CALLS']}".strip(), "FAIL_CALL": call,
               "FAIL_PROGRAM": program}
        return {**env, "FAIL_PATH": path} if path else env

    def run_into(self, out, *arguments, env=None):
        return subprocess.run([NEPHOS, "run", self.scene, "--no-render", "--out", out, *arguments], cwd=self.folder,
                              capture_output=True, text=True, env=env or self.environment, timeout=PATIENCE)

    def no_leftovers(self, out):
        self.assertEqual([p.name for p in (self.folder / out).rglob(".*")], [])

    def test_a_kill_before_the_first_rows_leaves_a_way_forward(self):
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        for path in ("statistics", "manifest"):
            for number in range(1, 4):
                with self.subTest(path=path, number=number):
                    shutil.rmtree(self.folder / "out", ignore_errors=True)
                    killed = self.run_into("out", env=self.failing(f"write KILL {number} 1", path))
                    if killed.returncode == 0:
                        continue
                    self.assertEqual(killed.returncode, -signal.SIGKILL)
                    again = self.run_into("out")
                    if again.returncode != 0:
                        self.assertIn("--resume", again.stderr)
                        again = self.run_into("out", "--resume")
                    self.assertEqual(again.returncode, 0, again.stderr)
                    self.same_runs("undisturbed", "out")
                    self.no_leftovers("out")

    def test_a_disk_that_is_full_at_the_beginning_leaves_a_way_forward(self):
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        for path in ("statistics", "manifest", "checkpoint"):
            with self.subTest(path=path):
                full = self.run_into("out", env=self.failing("write ENOSPC 1 1000", path))
                self.assertEqual(full.returncode, 3, full.stderr)
                self.assertIn("No space left", full.stderr)
                self.no_leftovers("out")
                self.assertEqual(self.run_into("out").returncode, 0)
                self.same_runs("undisturbed", "out")
                shutil.rmtree(self.folder / "out")

    def test_a_new_folder_is_flushed_into_the_one_that_holds_it(self):
        """A power cut takes no folder away from under its files: the first flush of a run is that of the new folder's place."""
        (self.folder / "there").mkdir()
        for out in ("new", "there/new", "there/a/b/new/"):
            with self.subTest(out):
                failed = self.run_into(out, env=self.failing("fsync EIO 1 1"))
                self.assertEqual(failed.returncode, 3, failed.stderr)
                self.assertIn("cannot flush its folder to the device: Input/output error", failed.stderr)
                self.assertEqual(self.run_into(out).returncode, 0)

    def test_whatever_call_fails_the_files_are_whole_and_there_is_a_way_forward(self):
        """The same bytes as of an undisturbed run, after at most one more call without --overwrite."""
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        kinds = {"write": ("KILL", "EIO", "ENOSPC", "EINTR"), "fsync": ("KILL", "EIO", "EINTR"),
                 "read": ("KILL", "EIO", "EINTR"), "stat": ("KILL", "EIO")}
        failed = 0
        for call, how, number in ((c, h, n) for c, hows in kinds.items() for h in hows for n in range(1, 47, 5)):
            with self.subTest(call=call, how=how, number=number):
                shutil.rmtree(self.folder / "out", ignore_errors=True)
                result = self.run_into("out", env=self.failing(f"{call} {how} {number} 1", str(self.folder)))
                allowed = {"KILL": (0, -signal.SIGKILL), "EINTR": (0,)}.get(how, (0, 3))
                self.assertIn(result.returncode, allowed, result.stderr)
                if result.returncode != 0:
                    failed += 1
                    again = self.run_into("out")
                    if again.returncode == 2 and "--resume" in again.stderr:
                        again = self.run_into("out", "--resume")
                    self.assertEqual(again.returncode, 0, again.stderr)
                for file in (self.folder / "undisturbed").rglob("*.*"):
                    if file.is_file() and file.name != "manifest.json":
                        other = self.folder / "out" / file.relative_to(self.folder / "undisturbed")
                        self.assertEqual(file.read_bytes(), other.read_bytes(), file.name)
                self.no_leftovers("out")
        self.assertGreater(failed, 30)

    def test_statistics_that_were_only_begun_are_of_no_value(self):
        self.assertEqual(self.run_into("out").returncode, 0)
        (self.folder / "out/checkpoint.nephos").unlink()
        header = (self.folder / "out/statistics.csv").read_text().splitlines()[0]
        for text in ("", header[:20], header):
            (self.folder / "out/statistics.csv").write_text(text)
            self.assertEqual(self.run_into("out").returncode, 0, text)
            (self.folder / "out/checkpoint.nephos").unlink()
        for text in ("mine", header[:20] + "mine"):
            (self.folder / "out/statistics.csv").write_text(text)
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", says="statistics.csv")

    def test_grids_are_written_without_seeking(self):
        """Failed ones of a stream's tellp() tore grids: positions are counted, and not one is asked for."""
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        result = self.run_into("out", env=self.failing("lseek EIO 1 1000000", ".vdb"))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.same_runs("undisturbed", "out")
        self.no_leftovers("out")
        # That of the check would be noticed: reading one back does seek.
        result = subprocess.run([NEPHOS, "info", next((self.folder / "out/density").glob("*.vdb"))], capture_output=True, text=True,
                                env=self.failing("lseek EIO 1 1000000", ".vdb"))
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("Input/output error", result.stderr)

    def test_writes_of_grids_that_fail_are_told(self):
        for number in (1, 4, 7):
            result = self.run_into("out", env=self.failing(f"write EIO {number} 1", ".vdb"))
            self.assertEqual(result.returncode, 3)
            self.assertRegex(result.stderr, r"tiny_000\d\.vdb: cannot write: Input/output error")
            self.no_leftovers("out")
            shutil.rmtree(self.folder / "out")

    def test_an_interrupted_flush_is_repeated(self):
        self.assertEqual(self.run_into("undisturbed").returncode, 0)
        for path in ("statistics.csv", ".vdb", "checkpoint", "manifest", "/out"):
            result = self.run_into("out", "--overwrite", env=self.failing("fsync EINTR 1 3", path))
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.same_runs("undisturbed", "out")

    def test_a_file_that_cannot_be_examined_is_not_a_foreign_one(self):
        for name in ("tiny.mp4", "checkpoint.nephos"):
            result = self.run_into("out", env=self.failing("stat EIO 1 1000", name))
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assertRegex(result.stderr, re.escape(name) + ".*Input/output error")
            self.assertNotIn("--overwrite", result.stderr)

    def test_a_file_that_cannot_be_read_is_neither_foreign_nor_damaged(self):
        self.assertEqual(self.run_into("out").returncode, 0)
        for name in ("manifest.json", "statistics.csv", "checkpoint.nephos"):
            for arguments in (["run", self.scene, "--no-render", "--out", "out"],
                              ["run", self.scene, "--no-render", "--out", "out", "--resume"], ["info", f"out/{name}"]):
                with self.subTest(name=name, arguments=arguments):
                    result = self.refused(3, *arguments, says=f"{name}: cannot read: Input/output error",
                                          env=self.failing("read EIO 1 1000", name))
                    self.assertNotIn("--overwrite", result.stderr)
        self.assertEqual(self.run_into("out", "--resume").returncode, 0)

    def test_what_verify_cannot_read_hides_nothing(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        unread = {"env": self.failing("read EIO 1 1000", "tiny_0002.vdb")}
        result = self.call("verify", "out", status=3, **unread)
        self.assertIn("none  reading   out/density/tiny_0002.vdb: cannot read: Input/output error", result.stdout)
        self.assertIn("none  decoding  out/density/tiny_0002.vdb: cannot read: Input/output error", result.stdout)
        self.assertIn("ok    hashes", result.stdout)
        self.assertIn("nothing is wrong, but the check `reading` could not be done: out/density/tiny_0002.vdb", result.stderr)
        (self.folder / "out/density/tiny_0003.vdb").write_bytes(b"damaged")
        result = self.call("verify", "out", status=1, **unread)
        self.assertIn("FAIL  hashes    density/tiny_0003.vdb: 7 bytes, not", result.stdout)
        self.assertIn("tiny_0002.vdb: cannot read", result.stdout)
        # Nor of another run that is compared with, which alone is no verdict.
        self.call("run", self.scene, "--no-render", "--out", "other")
        said = self.call("verify", "out", "--against", "other", "--hashes", status=1,
                         env=self.failing("stat EIO 1 1000", "other/manifest.json")).stdout
        self.assertIn("FAIL  hashes    density/tiny_0003.vdb: 7 bytes, not", said)
        self.assertIn("none  against   other/manifest.json: cannot", said)
        for name in ("other/statistics.csv", "other/manifest.json"):
            with self.subTest(name):
                env = self.failing("read EIO 1 1000", name)
                said = self.call("verify", "out", "--against", "other", "--hashes", status=1, env=env).stdout
                self.assertIn("FAIL  hashes    density/tiny_0003.vdb: 7 bytes, not", said)
                self.assertIn(f"none  against   {name}: cannot", said)
                said = self.call("verify", "other", "--against", "other", "--hashes", status=3, env=env)
                self.assertIn("Input/output error", said.stdout + said.stderr)

    def fails_at_each_call(self, call, path, *arguments):
        """Lets one call on a file fail after the other, also in the process that parses it; returns how many there are."""
        for number in range(1, 100):
            result = subprocess.run([NEPHOS, *arguments], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                                    env=self.failing(f"{call} EIO {number} 1", path))
            if result.returncode == 0:
                return number - 1
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assertIn("Input/output error", result.stderr)
            self.assertNotRegex(result.stderr, "damaged|truncated|early|memory")
        self.fail(f"{call} fails for ever")

    def test_a_file_for_a_parser_that_cannot_be_read_is_not_damaged(self):
        self.assertEqual(self.run_into("out").returncode, 0)
        (self.folder / "out/density/tiny_0001.vdb").rename(self.folder / "cloud.vdb")
        for call, least in (("read", 2), ("lseek", 3)):
            with self.subTest(call=call):
                self.assertGreaterEqual(self.fails_at_each_call(call, "cloud.vdb", "info", "cloud.vdb"), least)
        for name, source in (("height.png", "volcano.png"), ("height.raw", "crater.raw")):
            with self.subTest(name=name):
                shutil.copy(SOURCE / "scenes/maps" / source, self.folder / name)
                map_of = ["validate", self.scene, "--set", f"ground.height_map={name}", "--set", "terrain.raw_columns=65",
                          "--set", "terrain.raw_rows=65", "--set", "camera.above_ground=true"]
                self.assertGreaterEqual(self.fails_at_each_call("read", name, *map_of), 1)

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_an_encoder_that_cannot_read_is_an_error(self):
        arguments = ["run", self.scene, "--video", "--splatting", "cpu", "--set", "camera.height=32", "--out", "out"]
        for call in ("read EIO 1 1000000", "read EIO 2 1000000", "read EIO 2 1"):
            with self.subTest(call=call):
                result = subprocess.run([NEPHOS, *arguments], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                                        env=self.failing(call, "socket:", "ffmpeg"))
                self.assertEqual(result.returncode, 3, result.stderr)
                self.assertIn("tiny.mp4: ffmpeg", result.stderr)
                self.assertFalse((self.folder / "out/frames/tiny.mp4").exists())
                self.no_leftovers("out")
                self.assertFalse(json.loads((self.folder / "out/manifest.json").read_text())["complete"])
                self.call(*arguments, "--resume")
                self.assertTrue((self.folder / "out/frames/tiny.mp4").exists())
                shutil.rmtree(self.folder / "out")

    def started(self, out):
        """A long run that has written a few frames."""
        scene = self.write("long.toml", LONG)
        process = subprocess.Popen([NEPHOS, "run", scene, "--no-render", "--out", out], cwd=self.folder,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.environment)
        self.addCleanup(process.kill)
        third = self.folder / out / "density/long_0003.vdb"
        for _ in range(3000):
            if third.exists() or process.poll() is not None:
                break
            time.sleep(0.02)
        self.assertTrue(third.exists())
        self.assertIsNone(process.poll())
        return process

    def ends_with(self, process, says):
        output, errors = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 3, output + errors)
        self.assertEqual(output, "")
        self.assertIn(says, errors)
        for manifest in self.folder.rglob("manifest.json"):
            self.assertFalse(json.loads(manifest.read_text())["complete"])

    def test_a_folder_that_is_removed_or_renamed_ends_the_run(self):
        process = self.started("removed")
        while (self.folder / "removed").exists():
            shutil.rmtree(self.folder / "removed", ignore_errors=True)
        self.ends_with(process, "removed")
        process = self.started("renamed")
        (self.folder / "renamed").rename(self.folder / "elsewhere")
        self.ends_with(process, "renamed: the folder was removed or renamed")
        self.assertFalse((self.folder / "renamed/manifest.json").exists())

    def test_tables_of_a_folder_that_is_renamed_between_them_are_not_spread(self):
        """A merge that is stopped where it publishes its second table, while its folder gets another name."""
        self.call("sweep", self.scene, "--axis", "field.background.ext=0.05,0.1", "--replicates", "1", "--steps", "20", "--out", "sweep")
        merge = subprocess.Popen([NEPHOS, "merge", "sweep"], cwd=self.folder, stderr=subprocess.PIPE, text=True,
                                 env=self.failing("rename STOP 1 1", "runs.csv"))
        self.addCleanup(merge.stderr.close)
        self.addCleanup(merge.wait)
        self.addCleanup(merge.kill)
        self.assertTrue(os.WIFSTOPPED(os.waitpid(merge.pid, os.WUNTRACED)[1]))
        (self.folder / "sweep").rename(self.folder / "moved")
        merge.send_signal(signal.SIGCONT)
        self.assertEqual(merge.wait(timeout=PATIENCE), 3)
        self.assertIn("sweep: was removed or replaced while its tables were written", merge.stderr.read())
        self.assertFalse((self.folder / "sweep").exists())
        self.no_leftovers("moved")

    def test_a_folder_that_cannot_be_listed_is_not_empty(self):
        """Files that no run wrote stay, and extra ones are not called none, whichever opening of their folder fails."""
        mine = self.folder / "out/density/tiny_0001.vdb"
        mine.parent.mkdir(parents=True)
        mine.write_bytes(b"MINE")
        failed = 0
        for number in range(1, 6):
            result = self.run_into("out", env=self.failing(f"open EIO {number} 1", "out/density"))
            self.assertIn(result.returncode, (2, 3), result.stderr)
            failed += result.returncode == 3
            self.assertEqual(mine.read_bytes(), b"MINE", number)
        self.assertGreater(failed, 0)
        self.assertEqual(self.run_into("run").returncode, 0)
        shutil.copy(self.folder / "run/density/tiny_0002.vdb", self.folder / "run/density/tiny_0099.vdb")
        self.assertIn("tiny_0099.vdb is listed nowhere", self.call("verify", "run", status=1).stdout)
        result = self.call("verify", "run", status=3, env=self.failing("open EIO 1 1", "run/density"))
        self.assertIn("none  listing   run/density: cannot read: Input/output error", result.stdout)
        self.call("export", "run", "--to", "raw", "-o", "volumes")
        (self.folder / "volumes/tiny_0001.raw").write_bytes(b"damaged")
        said = [subprocess.run([NEPHOS, "verify", "volumes"], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                               env=self.failing(f"open EIO {number} 1", "volumes")).stdout for number in range(1, 10)]
        unlisted = [text for text in said if "none  listing   volumes: cannot read: Input/output error" in text]
        self.assertEqual(len(unlisted), 1, said)
        self.assertIn("FAIL  hashes    tiny_0001.raw: 7 bytes, not", unlisted[0])

    def test_a_file_that_cannot_be_examined_is_not_lost(self):
        """Scenes and reports that would be written over, a table of the user's own, private files: whichever stat fails."""
        scene = (self.folder / "mine.toml")
        text = pathlib.Path(self.scene).read_bytes()
        (self.folder / "report.txt").write_text("EGLL 211350Z 24012KT 9999 FEW020 14/08 Q1017\n", encoding="utf-8")
        (self.folder / "sweep").mkdir()
        rows = b"my,own\nrows,of\na,user"
        for number in range(1, 12):
            for arguments, path, file, content in (
                    (("state", "mine.toml", "--steps", "1", "--out", "mine.toml"), "mine.toml", scene, text),
                    (("metar", "@report.txt", "--scene", "report.txt", "-q"), "report.txt", self.folder / "report.txt",
                     b"EGLL 211350Z 24012KT 9999 FEW020 14/08 Q1017\n"),
                    (("sweep", self.scene, "--axis", "field.background.ext=0.1", "--replicates", "1", "--steps", "20", "--out", "sweep", "-q"),
                     "timing.csv", self.folder / "sweep/timing.csv", rows)):
                file.write_bytes(content)
                result = subprocess.run([NEPHOS, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                                        env=self.failing(f"stat EIO {number} 1", path))
                self.assertIn(result.returncode, (2, 3), (arguments, number, result.stderr))
                self.assertEqual(file.read_bytes(), content, (arguments, number))
            private = self.folder / "private.vdb"
            private.write_bytes(b"")
            private.chmod(0o600)
            subprocess.run([NEPHOS, "state", self.scene, "--steps", "1", "--out", private, "-q"], cwd=self.folder, capture_output=True, timeout=PATIENCE,
                           env=self.failing(f"stat EIO {number} 1", "private.vdb"), check=False)
            self.assertEqual(private.stat().st_mode & 0o777, 0o600, number)

    def test_rows_are_not_appended_to_what_a_link_leads_to(self):
        process = self.started("out")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)
        table, other = self.folder / "out/statistics.csv", self.folder / "other.csv"
        table.rename(other)
        table.symlink_to(other)
        before = other.read_bytes()
        self.refused(3, "run", "long.toml", "--no-render", "--resume", "--out", "out",
                     says="statistics.csv: is a link, which is not followed here")
        self.assertEqual(other.read_bytes(), before)

    def stopped_at(self, call, path, meanwhile, *arguments):
        """Stops a command before such a call, does something, and lets it go on. Returns its status and what it said; none where it
        made no such call."""
        process = subprocess.Popen([NEPHOS, *map(str, arguments)], cwd=self.folder, stderr=subprocess.PIPE, text=True, env=self.failing(call, path))
        try:
            _, status = os.waitpid(process.pid, os.WUNTRACED)
            if not os.WIFSTOPPED(status):
                return None
            meanwhile()
            process.send_signal(signal.SIGCONT)
            said = process.communicate(timeout=PATIENCE)[1]
            return process.returncode, said
        finally:
            process.kill()
            process.stderr.close()

    def test_a_branch_has_the_state_and_the_rows_of_one_run(self):
        """Whenever another run gets the place of the one that it branches off."""
        self.call("run", self.scene, "--no-render", "--out", "a")
        self.call("run", self.scene, "--no-render", "--seed", "8", "--out", "b")
        branch = ["run", "--no-render", "-q", "--set", "time.steps=30", "--from"]
        self.call(*branch, "a", "--out", "twin")
        def exchange():
            shutil.rmtree(self.folder / "parent")
            shutil.copytree(self.folder / "b", self.folder / "parent")
        statuses = []
        for path in ("parent/statistics.csv", "parent/manifest.json", "parent/checkpoint.nephos"):
            for number in range(1, 9):
                shutil.rmtree(self.folder / "parent", ignore_errors=True)
                shutil.rmtree(self.folder / "out", ignore_errors=True)
                shutil.copytree(self.folder / "a", self.folder / "parent")
                ended = self.stopped_at(f"open STOP {number} 1", path, exchange, *branch, "parent", "--out", "out")
                if ended is None:
                    break
                self.assertIn(ended[0], (0, 2, 3), ended[1])
                statuses.append(ended[0])
                if ended[0] == 0:
                    rows = (self.folder / "out/statistics.csv").read_bytes()
                    other = (self.folder / "b/statistics.csv").read_bytes()
                    if rows[:len(other)] != other:  # else it branched off that one from the start
                        self.assertEqual(rows, (self.folder / "twin/statistics.csv").read_bytes(), (path, number))
                    else:
                        self.call("verify", "out", "--replay", 2)
        self.assertIn(3, statuses)

    def test_a_folder_that_is_exchanged_while_a_run_begins(self):
        """A run that is made again behind a link: that leads to another run before what is replaced is removed."""
        self.call("run", self.scene, "--no-render", "--out", "a")
        self.call("run", self.scene, "--no-render", "--seed", "8", "--out", "b")
        before = {path: path.read_bytes() for path in (self.folder / "b").rglob("*") if path.is_file()}
        link = self.folder / "latest"
        def lead_to(name):
            (self.folder / "new").symlink_to(name)
            (self.folder / "new").rename(link)
        stops = 0
        for call in ("stat", "open"):
            for number in range(1, 1000, 3):
                lead_to("a")
                ended = self.stopped_at(f"{call} STOP {number} 1", "latest", lambda: lead_to("b"), "run", self.scene, "--no-render", "-q", "--out", "latest")
                self.assertEqual({path: path.read_bytes() for path in (self.folder / "b").rglob("*") if path.is_file()}, before, (call, number, ended))
                if ended is None:
                    break
                self.assertIn(ended[0], (0, 2, 3), (call, number, ended[1]))
                stops += 1
                shutil.rmtree(self.folder / "a")
                self.call("run", self.scene, "--no-render", "--out", "a")
        self.assertGreater(stops, 10)

    def test_a_table_that_is_changed_after_its_last_row_is_missed_at_the_end(self):
        """By an editor or a spreadsheet, in place or by another file, while the checkpoint or the video is made."""
        def changed(in_place):
            table = self.folder / "out/statistics.csv"
            rows = table.read_text().replace(",0.", ",9.", 1)
            if in_place:
                table.write_text(rows)
            else:
                self.write("other.csv", rows)
                (self.folder / "other.csv").rename(table)
        for in_place in (True, False):
            status, said = self.stopped_at("rename STOP 1 1", "checkpoint.nephos", lambda: changed(in_place), "run", self.scene, "--no-render", "-q",
                                           "--out", "out")
            self.assertEqual(status, 3, said)
            self.assertIn("statistics.csv: was changed while the run was writing it", said)
            self.assertFalse(json.loads((self.folder / "out/manifest.json").read_text())["complete"])
            shutil.rmtree(self.folder / "out")

    def test_parts_that_are_removed_are_missed_at_the_end(self):
        for name in ("density/long_0002.vdb", "statistics.csv"):
            process = self.started("out")
            (self.folder / "out" / name).unlink()
            process.send_signal(signal.SIGINT) if name == "statistics.csv" else None
            self.ends_with(process, pathlib.Path(name).name)
            shutil.rmtree(self.folder / "out")


if __name__ == "__main__":
    unittest.main(verbosity=2)
