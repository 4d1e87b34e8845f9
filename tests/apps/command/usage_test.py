# SPDX-License-Identifier: Apache-2.0
"""What concerns every subcommand: options, help, terminals, completion."""

import json
import os
import pathlib
import pty
import re
import select
import shutil
import struct
import subprocess
import termios
import unittest

from case import BAD, NEPHOS, PATIENCE, SCENE, Case


class Usage(Case):
    def test_an_editor_that_cannot_be_started_is_named(self):
        """What is beside the command in its place is broken; nothing there is a build without one."""
        program = self.folder / "bin/nephos"
        program.parent.mkdir()
        shutil.copy2(NEPHOS, program)
        for make, reason in ((pathlib.Path.touch, "Permission denied"), (pathlib.Path.mkdir, "Permission denied"),
                             (lambda path: (path.touch(), path.chmod(0o755)), "Exec format error"), (None, "this build has no editor")):
            editor = program.with_name("nephos-editor")
            if make is not None:
                make(editor)
            result = subprocess.run([program, "edit"], capture_output=True, text=True, timeout=PATIENCE, check=False,
                                    env={**self.environment, "PATH": str(self.folder)})
            says = reason if make is None else f"{editor} cannot be started: {reason}"
            self.assertEqual((result.returncode, result.stderr.startswith(f"error: {says}")), (2 if make is None else 3, True), result.stderr)
            if editor.is_dir():
                editor.rmdir()
            editor.unlink(missing_ok=True)

    def test_what_follows_two_dashes_is_named(self):
        for arguments, says in ((["hash", self.scene, "--", "-n", "3"], "`-n`"), (["hash", "--", self.scene, "extra"], "`extra`"), (["--", "hahs"], "`hahs`"),
                                (["hash", self.scene, ""], "unexpected argument ``")):
            self.refused(2, *arguments, says=says)

    def test_help_goes_to_stdout(self):
        for arguments in (["--help"], ["run", "--help"], ["render", "-h"], ["validate", "--help"], ["info", "--help"],
                          ["hash", "--help"], ["state", "--help"], ["completion", "--help"], ["sweep", "--help"],
                          ["merge", "--help"], ["report", "--help"], ["fit", "--help"], ["stats", "--help"]):
            result = self.call(*arguments)
            self.assertIn("Usage: nephos", result.stdout)
            self.assertEqual(result.stderr, "")
        for command in ("run", "sweep", "merge", "report", "fit", "stats", "render", "validate", "info", "hash", "state", "completion"):
            self.assertIn(f"\n  {command}", self.call("--help").stdout)

    def test_version(self):
        self.assertRegex(self.call("--version").stdout, r"^nephos \d+\.\d+\.\d+ \(random stream \d+\)\n$")

    def test_empty_values_are_none(self):
        """As of a variable of a script that is not set."""
        for arguments, option in ((["hash", self.scene, "--check", ""], "--check"), (["run", self.scene, "--from", ""], "--from"),
                                  (["run", ""], "SCENE"), (["run", self.scene, "--set", "time.steps=3", "--set", ""], "--set"),
                                  (["hash", self.scene, "--from", ""], "--from"), (["verify", "out", "--against", ""], "--against"),
                                  (["metar", "EGLL 211350Z 24012KT", "-o", ""], "--scene"), (["export", "out", "--for", ""], "--for"),
                                  (["render", "cloud.vdb", "--out", "a.png", "--scene", ""], "--scene")):
            result = self.call(*arguments, status=2)
            self.assertEqual(result.stdout, "")
            self.assertRegex(result.stderr, f"^error: {option}.* is empty: expected")
        self.assertEqual(list(self.folder.iterdir()), [self.folder / "tiny.toml"])

    def test_bad_arguments_are_status_2(self):
        for arguments, says in (
            ([], "a command is missing"),
            (["rum"], "did you mean `run`"),
            (["run"], "SCENE is missing"),
            (["run", self.scene, "--oot", "x"], "did you mean `--out`"),
            (["run", self.scene, "surplus"], "surplus"),
            (["run", self.scene, "--out"], "--out"),
            (["run", self.scene, "--threads", "0"], "--threads '0'"),
            (["run", self.scene, "--threads", "many"], "--threads 'many'"),
            (["run", self.scene, "--seed", "-1"], "--seed '-1'"),
            (["run", self.scene, "--frames", "5..2"], "--frames '5..2'"),
            (["run", self.scene, "--frames", "0..2"], "--frames '0..2'"),
            (["run", self.scene, "--frames", "90"], "1 to 5"),
            (["run", self.scene, "--frames", "2..6"], "1 to 5"),
            (["run", self.scene, "--statistics-only", "--frames", "2..3"], "--statistics-only"),
            (["run", self.scene, "--checkpoint-every", "soon"], "--checkpoint-every 'soon'"),
            (["run", self.scene, "--resume", "--overwrite"], "--overwrite"),
            (["hash", self.scene, "--steps", "1e3"], "--steps '1e3'"),
            (["hash", self.scene, "--steps", "99999999999999999999999"], "--steps"),
            (["state", self.scene], "--out"),
            (["render", "x.vdb"], "--out"),
            (["render", "x.vdb", "--out", "x.jpg"], ".png or .exr"),
            (["render", "x.vdb", "--out", "x.png", "--size", "0x0"], "--size '0x0'"),
            (["render", "x.vdb", "--out", "x.png", "--camera", "1,2"], "--camera '1,2'"),
            (["render", "x.vdb", "--out", "x.png", "--sun", "95,0"], "--sun '95,0'"),
            (["render", "x.vdb", "--out", "x.png", "--set", "a=1"], "--scene"),
            (["completion", "tcsh"], "tcsh"),
        ):
            with self.subTest(arguments=arguments):
                self.refused(2, *arguments, says=says)

    def test_values_may_be_given_twice_only_where_it_makes_sense(self):
        self.refused(2, "run", self.scene, "--out", "a", "--out", "b", says="--out")
        self.hashes(self.scene, "--steps", "0", "--set", "seed=1", "--set", "time.steps=2")


class Terminal(Case):
    def on_terminal(self, *arguments, columns=100, env=None):
        """Runs with stderr (and stdout) on a terminal; returns all that appeared there."""
        leader, follower = pty.openpty()
        termios.tcsetwinsize(follower, (24, columns)) if hasattr(termios, "tcsetwinsize") else \
            __import__("fcntl").ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        process = subprocess.Popen([NEPHOS, *map(str, arguments)], cwd=self.folder, stdin=follower, stdout=follower,
                                   stderr=follower, env={**self.environment, **(env or {})})
        os.close(follower)
        shown = b""
        while True:
            ready, _, _ = select.select([leader], [], [], 60)
            self.assertTrue(ready, "nothing happens")
            try:
                piece = os.read(leader, 65536)
            except OSError:
                break
            if not piece:
                break
            shown += piece
        os.close(leader)
        return process.wait(timeout=PATIENCE), shown.decode()

    def test_progress_only_on_a_terminal(self):
        status, shown = self.on_terminal("run", self.scene, "--no-render", "--set", "time.steps=300")
        self.assertEqual(status, 0)
        self.assertRegex(shown, r"step \d+/301 .*\d+%.*steps/s")
        self.assertRegex(shown, r"left")
        self.assertIn("━", shown)
        for line in re.split(r"[\r\n]+", shown):
            visible = re.sub(r"\x1b\[[0-9;]*[mK]", "", line)
            if visible.startswith("step "):
                self.assertLess(len(visible), 100)
        for env, arguments in (({"TERM": "dumb"}, []), ({}, ["--quiet"])):
            _, shown = self.on_terminal("run", self.scene, "--no-render", *arguments, env=env)
            self.assertNotIn("steps/s", shown)

    def test_colours(self):
        _, shown = self.on_terminal("run", "no.toml")
        self.assertIn("\x1b[1m\x1b[31merror:\x1b[0m", shown)
        _, shown = self.on_terminal("run", "no.toml", env={"NO_COLOR": "1"})
        self.assertIn("error: ", shown)
        self.assertNotIn("\x1b", shown)
        _, shown = self.on_terminal("run", self.scene, "--no-render", env={"NO_COLOR": "1"})
        self.assertNotIn("\x1b[1m", shown)
        bad = self.write("bad.toml", BAD)
        _, shown = self.on_terminal("validate", bad)
        self.assertEqual(shown.count("\x1b[1m\x1b[31merror:\x1b[0m"), 3)
        self.assertNotIn("\x1b", self.call("validate", bad, status=2).stderr)

    def plant(self, name, content, planted):
        """A file where text was replaced by as many bytes of something else."""
        for old, new in planted.items():
            self.assertIn(old, content)
            content = content.replace(old, new.ljust(len(old), b"x"))
        (self.folder / name).write_bytes(content)

    def test_nothing_in_a_file_or_in_its_name_steers_the_terminal(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        vdb = (self.folder / "out/density/tiny_0001.vdb").read_bytes()
        hostile = "\x1b]0;t\x07\x9b2J \u202e\r.vdb"
        (self.folder / hostile).write_bytes(vdb)
        self.call("render", hostile, "--out", "picture.exr", "--size", "32x24")
        exr = (self.folder / "picture.exr").read_bytes()
        self.plant("part.exr", exr, {b"picture": b"\x1b[2J\x07\x9b"})
        self.plant("channel.exr", exr, {b"transmittance.Y": b"transmit\x1b[2J\x9b2"})
        self.plant("attribute.exr", exr, {b"stateHash\0": b"\x1b[2J\x07\x9b2J\0", b"sceneHash\0": b"\xc2\x9b2Jxxxxx\0"})
        self.plant("grid.vdb", vdb, {b"density": b"\x1b[2J\x07"})
        scene = self.write("\x1b[2J.toml", 'models = ["\\u001b]0;title\\u0007"]\n' + SCENE)
        calls = [["info", hostile], ["info", hostile, "no\x1b[2J"], ["info", "part.exr"], ["info", "channel.exr"],
                 ["info", "attribute.exr"], ["info", "grid.vdb"], ["validate", scene], ["run", scene], ["validate", "\x07"],
                 ["\x1b[2J"], ["validate", self.scene, "--set", "\x1b[2J=1"],
                 ["hash", self.scene, "--from", "\x9b"], ["run", self.scene, "--no-render", "--out", "\x1b[2J"],
                 ["info", hostile, "--json"], ["render", hostile, "--size", "8x8", "--out", "\x7f\x9b.png", "--json"]]
        for arguments in calls:
            with self.subTest(arguments=arguments):
                result = subprocess.run([NEPHOS, *arguments], cwd=self.folder, capture_output=True, text=True,
                                        env=self.environment, timeout=PATIENCE)
                shown = result.stdout + result.stderr
                self.assertRegex(shown, r"\\(u00|x)[0-9a-f]{2}|[\uFFFD?]")
                self.assertNotRegex(shown, "[\0-\x08\x0b-\x1f\x7f-\x9f\u202e]")
                _, shown = self.on_terminal(*arguments)  # there the command's own colours and progress bar alone
                shown = re.sub(r"\x1b\[(\d*m|K)|\r", "", shown)
                self.assertNotRegex(shown, "[\0-\x08\x0b-\x1f\x7f-\x9f\u202e]")
        # JSON keeps the name, and UTF-8 is shown as it is.
        self.assertEqual(json.loads(self.call("info", hostile, "--json").stdout)["file"], hostile)
        self.assertIn(" Wölkchen ☁: ", self.call("info", "Wölkchen ☁", status=3).stderr)

    def test_a_reader_that_goes_away_is_no_error(self):
        script = f'set -o pipefail; "{NEPHOS}" hash "{self.scene}" --steps 20000 | head -n 1'
        result = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=PATIENCE, env=self.environment)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertRegex(result.stdout, r"^0 [0-9a-f]{32}\n$")

    def test_a_reader_that_goes_away_hides_no_error(self):
        """What a run or a check came to is its status all the same."""
        self.call("run", self.scene, "--no-render", "--out", "checked")
        frame = next((self.folder / "checked/density").glob("*.vdb"))
        damaged = bytearray(frame.read_bytes())
        damaged[-40] ^= 1
        frame.write_bytes(damaged)
        bad = self.write("bad.toml", "".join(f"unknown_{n} = 1\n" for n in range(400)))
        for arguments, status, says in ((["verify", "checked"], 1, "is not what it claims to be"), (["verify", "checked", "--json"], 1, "is not what it claims to be"),
                                        (["validate", bad, "--json"], 2, ""), (["info", *[str(frame)] * 40, "none.vdb", "--json"], 3, "none.vdb"),
                                        (["validate", *[self.scene] * 40, "none.toml", "--print"], 3, "none.toml")):
            read, write = os.pipe()
            os.close(read)
            result = subprocess.run([NEPHOS, *arguments], stdout=write, stderr=subprocess.PIPE, text=True, timeout=PATIENCE, cwd=self.folder)
            os.close(write)
            self.assertEqual(result.returncode, status, result.stderr)
            self.assertIn(says, result.stderr)

    def test_a_full_stdout_is_an_error(self):
        with open("/dev/full", "w") as full:
            for arguments in (["hash", self.scene], ["--help"], ["completion", "bash"]):
                result = subprocess.run([NEPHOS, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, timeout=PATIENCE)
                self.assertEqual(result.returncode, 3)
                self.assertIn("standard output", result.stderr)


class Completion(Case):
    def completed(self, *words):
        """What bash offers for the last word."""
        script = f"""
            source <("{NEPHOS}" completion bash) || exit 9
            COMP_WORDS=(nephos {' '.join(f"'{w}'" for w in words)}); COMP_CWORD={len(words)}
            _nephos
            printf '%s\\n' "${{COMPREPLY[@]}}"
        """
        result = subprocess.run(["bash", "--norc", "-u", "-c", script], cwd=self.folder, capture_output=True, text=True,
                                timeout=PATIENCE)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return [line for line in result.stdout.split("\n") if line]

    def test_bash(self):
        self.assertIn("run", self.completed("r"))
        self.assertIn("render", self.completed("r"))
        self.assertEqual(self.completed("val"), ["validate"])
        self.assertIn("--resume", self.completed("run", "--re"))
        self.assertEqual(self.completed("run", "ti"), ["tiny.toml"])
        self.assertEqual(self.completed("completion", "z"), ["zsh"])
        self.assertEqual(self.completed("run", "--json", "--no-r"), ["--no-render"])  # after a flag
        self.assertEqual(self.completed("run", "--seed", ""), [])  # a value that nobody can guess
        (self.folder / "a folder").mkdir()
        self.assertEqual(self.completed("run", "tiny.toml", "--out", "a"), ["a folder"])

    def test_other_shells_accept_theirs(self):
        for shell, arguments in (("zsh", ["-n"]), ("fish", ["--no-execute"])):
            script = self.call("completion", shell).stdout
            self.assertIn("nephos", script)
            if shutil.which(shell):
                path = self.write(shell, script)
                subprocess.run([shell, *arguments, path], check=True, timeout=PATIENCE)


class Manual(Case):
    def test_a_page_of_each_command_has_all_of_its_options(self):
        commands = re.findall(r"^  ([a-z]+) ", self.call("--help").stdout.split("Commands:")[1].split("\n\n")[0], re.M)
        self.assertIn("man", commands)
        for command in commands:
            page = self.call("man", command).stdout.replace("\\-", "-")
            self.assertIn(f"nephos {command}", page)
            for option in re.findall(r"^  (?:-\w, )?(--[a-z-]+)", self.call(command, "--help").stdout, re.M):
                self.assertRegex(page, rf"(?m)^\.B .*{option}\b", command)
        whole = self.call("man").stdout.replace("\\-", "-")
        for command in commands:
            self.assertIn(f".BR nephos-{command} (1)", whole)
        editor = self.call("man", "nephos-editor").stdout.replace("\\-", "-")
        self.assertIn("\nnephos-editor [SCENE] [options]\n", editor)
        self.assertIn(".BR nephos (1),\n.BR nephos-edit (1)\n", editor)

    def test_all_pages_are_written_into_a_folder(self):
        self.call("man", "--out", "pages")
        self.assertEqual((self.folder / "pages/nephos-run.1").read_text(), self.call("man", "run").stdout)
        self.refused(2, "man", "rum", says="is not one of run,")
        self.refused(2, "man", "run", "--out", "pages", says="exclude each other")


if __name__ == "__main__":
    unittest.main(verbosity=2)
