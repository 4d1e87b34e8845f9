#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What a user must not lose: edits through errors, files that are there already, the window's layout. And the size of
everything on a display with small dots. See case.py."""

import os
import signal
import subprocess
import sys
import threading
import time
import tomllib
import unittest

from PIL import Image, ImageChops, ImageStat

from case import NEPHOS, PATIENCE, Case, Screen
from kept import MODELS, WIND, Kept


class Safety(Kept):
    def test_edits_of_a_text_that_is_no_toml(self):
        """With `=` as the whole text the outline still shows the scene: copying, deleting, adding and renaming what it
        shows are refused with a message, the program goes on, and undo brings the scene back."""
        scene = self.models()
        self.edit(scene, "--validation", script="""
            wait-step 1
            click model
            click model[0]
            click tab Text
            click text
            key CTRL+A
            type =
            wait 0.3
            expect-control problems
            click model[0]
            key CTRL+D
            wait 0.3
            key DELETE
            wait 0.3
            click new model
            wait 0.3
            click tab View
            click "Keep it in the scene"
            click tab Text
            click text
            key CTRL+A
            type @
            wait 0.3
            click scene
            key CTRL+Z
            key CTRL+Z
            wait 0.3
            click sun
            click tab Properties
            set sun.elevation_deg 21
            key CTRL+S
            wait 0.5
            """)
        saved = tomllib.loads(scene.read_text(encoding="utf-8"))
        self.assertEqual(saved["sun"]["elevation_deg"], 21)
        self.assertEqual(saved["model"], tomllib.loads(MODELS)["model"])

    def test_any_character_and_any_end_of_a_line(self):
        """Characters beyond U+FFFF and private ones, in the text and in a value, stay what they are; a click changes nothing;
        and what is typed at the end of a line stands before its end."""
        scene = self.folder / "any.toml"
        text = "seed = 1 # \U0001f329\U0001f329\ue000\r\nname = \"m\U0001f329\"\r\n[lattice]\r\ncells = [12, 10, 8]\r\n"
        for more in ("", "q"):
            scene.write_text(text, encoding="utf-8", newline="")
            self.type_in_first_line(scene, more)
            self.assertEqual(scene.read_bytes().decode(), text.replace("\ue000\r", f"\ue000{more}\r"))
        # Other lines keep their ends, and what is no UTF-8 cannot be typed into.
        for content, typed in ((b"seed = 1\n# a\r\n# b\n", b"seed = 1q\n# a\r\n# b\n"), (b"seed = 1 # caf\xe9\n[lattice]\n", None)):
            scene.write_bytes(content)
            self.type_in_first_line(scene, "q")
            self.assertEqual(scene.read_bytes(), typed or content)
        scene.write_text(text, encoding="utf-8", newline="")
        self.edit(scene, script="""
            wait 1
            click scene
            click tab Properties
            wait 0.3
            click name
            key END
            type xy
            key ENTER
            wait 0.5
            key CTRL+S
            wait 0.5
            """)
        self.assertEqual(tomllib.loads(scene.read_bytes().decode())["name"], "m\U0001f329xy")

    def test_a_field_forgets_a_text_that_something_else_changed(self):
        """ImGui's fields have a copy of the text, and undo of their own: neither comes back over another text."""
        scene = self.folder / "a.toml"
        text = 'seed = 4\nname = "small"\n[lattice]\ncells = [16, 14, 8]\n'
        # The document's undo, with the field's way back behind it.
        for place in ("0.5", "0.01"):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"""
                wait-step 1
                click tab Text
                wait 0.3
                click-at text 0.6 {place}
                wait 0.3
                key END
                type xyz
                wait 0.3
                click tab View
                wait 0.3
                key CTRL+Z
                wait 0.5
                click tab Text
                wait 0.3
                click-at text 0.6 {place}
                wait 0.3
                key CTRL+Z
                wait 0.3
                key CTRL+S
                wait 0.5
                """)
            self.assertEqual(scene.read_text(encoding="utf-8"), text)
        # Another program, while the caret is in the text.
        script = self.folder / "script.txt"
        script.write_text("wait-step 1\nclick tab Text\nwait 0.3\nclick-at text 0.6 0.5\nwait 0.5\nhashes ready.txt\nwait 4\nkey CTRL+S\nwait 1\n",
                          encoding="utf-8")
        editor = subprocess.Popen([*self.command(scene), "--script", str(script)], cwd=self.folder, env=self.environment,
                                  stderr=subprocess.PIPE, text=True)
        self.wait_for(self.folder / "ready.txt", editor)
        other = text.replace("seed = 4", "seed = 77")
        scene.write_text(other, encoding="utf-8")
        _, said = editor.communicate(timeout=PATIENCE)
        self.assertEqual(editor.returncode, 0, said)
        self.assertEqual(scene.read_text(encoding="utf-8"), other)

    def test_reload_reads_the_files_that_a_scene_names(self):
        scene = self.folder / "r.toml"
        scene.write_text(MODELS[:MODELS.index("[[model]]")] + 'models = "m.toml"\n' + MODELS[MODELS.index("[[sky]]"):], encoding="utf-8")
        self.edit(scene, script="wait 1\nexpect-control problems\n")

        def bring_models():
            while not (self.folder / "ready.png").exists():
                time.sleep(0.1)
            other = self.folder / "other"
            other.write_text("seed = 1\n" + MODELS[MODELS.index("[[model]]"):MODELS.index("[[sky]]")], encoding="utf-8")
            other.rename(self.folder / "m.toml")

        threading.Thread(target=bring_models, daemon=True).start()
        self.edit(scene, script="wait 1\nscreenshot ready.png\nwait 2\nexpect-control problems\nclick \"menu File\"\nclick \"menu Reload\"\n"
                                "wait-step 1\n")

    def test_a_folder_of_scenes_and_other_things(self):
        folder = self.folder / "scenes"
        (folder / "a.toml").mkdir(parents=True)
        os.symlink("me@host.1:2", folder / ".#sky.toml")
        (folder / "._sky.toml").write_bytes(b"\0\5\26\7")
        (folder / "sky.toml").write_text(MODELS, encoding="utf-8")
        self.edit(folder, script="wait-step 1\nexpect-control model\n")

    def test_a_run_of_a_text_with_problems(self):
        """It is not that of the scene before, which the window still shows."""
        scene = self.models()
        said = self.edit(scene, status=1, script="""
            wait-step 1
            click tab Text
            click text
            key CTRL+A
            type q=
            wait 0.3
            click tab View
            key CTRL+R
            wait 0.5
            click "Start the run"
            """)
        self.assertIn("no control 'Start the run'", said)
        self.assertFalse((self.folder / "out").exists())

    def test_a_display_that_goes_away_keeps_the_edits(self):
        scene = self.models()
        script = self.folder / "script.txt"
        script.write_text("wait-step 1\nclick sun\nset sun.elevation_deg 21\nwait 0.3\nhashes ready.txt\nwait 100\n", encoding="utf-8")
        screen = Screen()
        editor = subprocess.Popen([NEPHOS, "edit", str(scene), "--size", "1280x800", "--script", str(script)], cwd=self.folder,
                                  env={**self.environment, "DISPLAY": screen.display}, stderr=subprocess.PIPE, text=True)
        self.wait_for(self.folder / "ready.txt", editor)
        screen.close()
        _, said = editor.communicate(timeout=PATIENCE)
        self.assertEqual(editor.returncode, 4, said)
        self.assertIn("the display is gone; unsaved edits are kept", said)
        self.assertIn("elevation_deg = 21", (self.folder / ".models.toml.autosave").read_text(encoding="utf-8"))

    def test_a_picture_of_a_scene_with_problems(self):
        """The window with what is wrong, and status 2 or 3; a script does not wait for a picture for ever."""
        for text, status, says in (("[sun]\nelevation_deg = 95\n", 2, "`sun.elevation_deg` is 95, too large"),
                                   ('[lattice]\ncells = [8, 8, 8]\ncell_size_m = 100\ninitial_state = "none.vdb"\n', 3, "none.vdb: No such file")):
            scene = self.folder / "p.toml"
            scene.write_text(text, encoding="utf-8")
            said = self.edit(scene, "--screenshot", "window.png", "--after", "1", status=status, timeout=PATIENCE)
            self.assertIn(says, said)
            self.assertEqual(self.image("window.png").size, (1280, 800))
        self.assertIn("script.txt:1: waited too long for a picture", self.edit(scene, script="picture y.png\n", status=1, timeout=PATIENCE))
        for line, says in (("random -5 1", "'-5' is no number from 0 to"), ("wait 0.1x", "'0.1x' is no number"), ("resize nan 9", "'nan' is no number"),
                           ("resize 100 1e30", "'1e30' is no number from 1 to 16384"), ("wait -1", "'-1' is no number")):
            self.assertIn(f"script.txt:1: {says}", self.edit(scene, script=line + "\n", status=1, timeout=PATIENCE))

    def test_every_new_element_is_valid(self):
        """What a `+` of the outline writes needs no hand in the text."""
        scene = self.folder / "new.toml"
        scene.write_text("[lattice]\ncells = [12, 10, 8]\n", encoding="utf-8")
        # Those of files, wind_field and field.grids, want their name.
        script = "wait 1\nclick field\nwait 0.5\n"
        for table in ("wind", "wind[0].levels", "wind", "wind", "lightning", "model", "sky", "field.profile", "field.profile[0].levels",
                      "field.profile", "field.ellipsoids", "field.scatters", "layer"):
            script += f'click "new {table}"\nwait 0.7\n'
        self.edit(scene, script=script + "key CTRL+S\nwait 0.5\n")
        written = tomllib.loads(scene.read_text(encoding="utf-8"))
        self.assertIn("levels", written["field"]["profile"][0])
        self.assertEqual([wind.get("time_s", 0) for wind in written["wind"]], [0, 600, 1200])
        done = subprocess.run([NEPHOS, "validate", scene], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_saving_over_another_file_asks(self):
        """Save as, onto a file that is there: the first press asks, another name takes the question back, and only
        Replace it overwrites. The scene's own file is no question."""
        scene = self.models()
        other = self.folder / "other.toml"
        other.write_text("seed = 99\n", encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait-step 1
            key CTRL+SHIFT+S
            set "file name" other.toml
            wait 0.3
            expect-control "Replace it"
            set "file name" third.toml
            wait 0.5
            key CTRL+SHIFT+S
            set "file name" other.toml
            click Cancel
            wait 0.3
            """)
        self.assertEqual(other.read_text(encoding="utf-8"), "seed = 99\n")
        self.assertEqual((self.folder / "third.toml").read_text(encoding="utf-8"), MODELS)
        self.edit(scene, script="""
            wait-step 1
            key CTRL+SHIFT+S
            set "file name" other.toml
            click "Replace it"
            wait 0.5
            """)
        self.assertEqual(other.read_text(encoding="utf-8"), MODELS)

    def test_a_dialog_that_is_cancelled_answers_nothing(self):
        """Open beside, cancelled: closing asks about unsaved edits as before. Keys do nothing while it asks: a new scene does not
        take the place of the end."""
        scene = self.models()
        self.edit(scene, "--validation", script="""
            wait-step 1
            click sun
            set sun.elevation_deg 21
            click "open simulation"
            wait 0.3
            click Cancel
            key CTRL+Q
            wait 0.3
            expect-control "unsaved models.toml"
            key CTRL+N
            wait 0.3
            expect-control "unsaved models.toml"
            click "Go on editing"
            wait 0.3
            key CTRL+Q
            wait 0.3
            key CTRL+N
            wait 0.3
            click "Save them"
            wait 0.5
            expect-end
            """)
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))

    def test_closing_asks_about_scenes_that_are_not_shown(self):
        """A scene with edits and a copy of it, which has them too: each is asked about, the copy although it was never edited
        itself. What was answered before one goes on is asked again."""
        scene = self.models()
        self.edit(scene, "--validation", script="""
            wait-step 1
            click sun
            set sun.elevation_deg 21
            click "copy simulation"
            wait-step 1
            click "new simulation"
            wait-step 1
            key CTRL+Q
            wait 0.3
            expect-control "unsaved models.toml"
            click "Discard them"
            wait 0.3
            expect-control "unsaved models-2.toml"
            click "Go on editing"
            wait 0.3
            key CTRL+Q
            wait 0.3
            expect-control "unsaved models-2.toml"
            click "Discard them"
            wait 0.3
            expect-control "unsaved models.toml"
            click "Save them"
            wait 0.5
            """)
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))
        self.assertEqual([path.name for path in self.folder.glob(".*autosave")], [])

    def test_edits_of_a_copy_come_back(self):
        """A copy that was never saved, of an editor that was killed: offered with its scene, and taken beside it."""
        scene = self.models()
        (self.folder / ".models-2.toml.autosave").write_text(MODELS.replace("seed = 4", "seed = 12"), encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait 0.5
            click "Take them"
            wait-step 1
            expect-control "simulation 2"
            key CTRL+S
            set "file name" copy.toml
            wait 0.5
            """)
        self.assertEqual(scene.read_text(encoding="utf-8"), MODELS)
        self.assertIn("seed = 12", (self.folder / "copy.toml").read_text(encoding="utf-8"))
        self.assertFalse((self.folder / ".models-2.toml.autosave").exists())

    def test_a_copy_that_came_back_is_unsaved_once_its_original_is_another(self):
        """Also where the edits of it were undone."""
        scene = self.models()
        (self.folder / ".models-2.toml.autosave").write_text(MODELS.replace("seed = 4", "seed = 12"), encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait 0.5
            click "Take them"
            wait-step 1
            key CTRL+Z
            wait 0.5
            click "simulation 1"
            wait 0.5
            click scene
            set seed 77
            wait 0.5
            key CTRL+S
            wait 0.5
            close-window
            wait 0.5
            expect-control "unsaved models-2.toml"
            """)
        self.assertIn("seed = 77", scene.read_text(encoding="utf-8"))

    def test_the_cross_while_something_is_asked(self):
        """One question after the other, none of which hides the next."""
        scene = self.models()
        for number, seed in (("", 12), (".77", 13)):
            (self.folder / f".models.toml{number}.autosave").write_text(MODELS.replace("seed = 4", f"seed = {seed}"), encoding="utf-8")
        taken = self.folder / "taken.toml"
        self.edit(scene, "--validation", script="""
            wait 0.5
            click "Take them"
            wait 0.5
            close-window
            wait 0.5
            click "Ask again next time"
            wait 0.5
            expect-control "unsaved models.toml"
            click "Go on editing"
            wait 0.5
            key F12
            wait 0.5
            close-window
            wait 0.5
            click Cancel
            wait 0.5
            expect-control "unsaved models.toml"
            click "Go on editing"
            wait 0.5
            key CTRL+SHIFT+S
            set "file name" taken.toml
            wait 0.5
            close-window
            expect-end
            """)
        self.assertEqual(scene.read_text(encoding="utf-8"), MODELS)
        self.assertRegex(taken.read_text(encoding="utf-8"), "seed = 1[23]")
        self.assertEqual(len(list(self.folder.glob(".models.toml*autosave"))), 1)  # asked again next time

    def test_the_cross_while_a_run_is_under_way(self):
        """Also while a file is chosen, whose dialog comes back."""
        scene = self.models()
        self.edit(scene, "--validation", script="""
            wait-step 1
            key CTRL+R
            wait 0.5
            click "Start the run"
            wait 0.5
            key F12
            wait 0.5
            close-window
            wait 0.5
            click "Go back"
            wait 0.5
            set "file name" window.png
            wait 0.5
            close-window
            wait 0.5
            click "Stop it and quit"
            expect-end
            """)
        self.assertTrue((self.folder / "window.png").is_file())
        self.assertTrue(list((self.folder / "out").iterdir()))

    def test_the_cross_before_edits_of_a_scene_that_is_gone(self):
        (self.folder / ".gone.toml.autosave").write_text(MODELS.replace("seed = 4", "seed = 12"), encoding="utf-8")
        for answer in ("Ask again next time", "Take them"):
            self.edit(self.folder / "gone.toml", "--validation", script=f"""
                wait 2
                close-window
                wait 0.5
                click "{answer}"
                wait 0.5
                """ + ("" if answer.startswith("Ask") else """
                expect-control "unsaved gone.toml"
                click "Save them"
                """) + "expect-end\n")
            self.assertEqual((self.folder / "gone.toml").exists(), answer == "Take them")
        self.assertIn("seed = 12", (self.folder / "gone.toml").read_text(encoding="utf-8"))

    def test_the_cross_leaves_a_dialog_to_its_scene(self):
        """What is answered is of the scene that was shown when it was asked, though another one has the edits."""
        scene = self.models()
        for ending in ("set \"file name\" copy.toml", "click Cancel"):
            self.edit(scene, "--validation", script=f"""
                wait-step 1
                click "copy simulation"
                wait-step 1
                click scene
                set seed 77
                click "simulation 1"
                wait 0.5
                key CTRL+SHIFT+S
                wait 0.5
                close-window
                wait 0.5
                {ending}
                wait 0.5
                expect-control "unsaved models-2.toml"
                click "Discard them"
                expect-end
                """)
            self.assertEqual(scene.read_text(encoding="utf-8"), MODELS)
        self.assertEqual((self.folder / "copy.toml").read_text(encoding="utf-8"), MODELS)

    def test_scripts_replace_no_file_of_the_scenes(self):
        scene, other = self.models(), self.folder / "other.toml"
        other.write_text(MODELS, encoding="utf-8")
        beside = f"click \"open simulation\"\nwait 0.5\nset \"file name\" {other}\nwait 1\nwait-step 1\nclick \"simulation 1\"\nwait 0.5\n"
        for command in ("picture", "hashes", "screenshot"):
            for path in (scene, other):
                said = self.edit(scene, script=f"wait-step 1\n{beside}wait-picture\n{command} {path}\nwait 1\n", status=2)
                self.assertIn("is the file that is read", said)
                self.assertEqual(path.read_text(encoding="utf-8"), MODELS)

    def test_a_grid_replaces_no_file_of_the_scene(self):
        scene, state = self.folder / "wind.toml", self.folder / "state.vdb"
        scene.write_text(WIND, encoding="utf-8")
        subprocess.run([NEPHOS, "state", scene, "--steps", "2", "-o", state], check=True, capture_output=True)
        scene.write_text(WIND.replace("[lattice]", "[lattice]\ninitial_state = \"state.vdb\""), encoding="utf-8")
        before = state.read_bytes()
        self.edit(scene, script=f"""
            wait-step 1
            click "menu File"
            click "menu Export the grid..."
            wait 0.5
            set "file name" {state}
            wait 0.5
            click "Replace it"
            wait 0.5
            expect-control Cancel
            click Cancel
            wait 0.5
            """)
        self.assertEqual(state.read_bytes(), before)

    def test_a_picture_that_cannot_be_saved(self):
        """A picture of the window into a folder that cannot be made: said, and the program goes on."""
        scene = self.models()
        self.edit(scene, script="""
            wait-step 1
            click sun
            set sun.elevation_deg 21
            key F12
            set "file name" /proc/nowhere/window.png
            wait 0.5
            expect-control sun.elevation_deg
            key CTRL+S
            wait 0.5
            """)
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))

    def test_an_older_autosave_is_not_taken_for_the_newer(self):
        """Edits of a crashed session beside a file that was written later: the question says so, and they can be kept
        as a scene of their own."""
        scene = self.models()
        autosave = self.folder / ".models.toml.autosave"
        autosave.write_text("seed = 5\n", encoding="utf-8")
        os.utime(autosave, (time.time() - 3600,) * 2)
        self.edit(scene, "--validation", script="""
            wait 0.5
            expect-control "the file is newer"
            click "Keep them in a file"
            wait 0.3
            click sun
            set sun.elevation_deg 21
            key CTRL+S
            wait 0.5
            """)
        self.assertFalse(autosave.exists())
        self.assertEqual((self.folder / "models-recovered.toml").read_text(encoding="utf-8"), "seed = 5\n")
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))

    def test_two_editors_of_one_scene(self):
        """The second editor is not asked about the edits of the first, which lives, and does not touch its file; killed, each
        leaves its edits, and the next editor asks about both."""
        scene = self.models()
        programs = []
        for number in (1, 2):
            script = self.folder / f"script-{number}.txt"
            script.write_text(f"wait-step 1\nclick sun\nset sun.elevation_deg {20 + number}\nwait 6\n"
                              f"hashes ready-{number}.txt\nwait 100\n", encoding="utf-8")
            programs.append(subprocess.Popen([*self.command(scene), "--script", str(script)], cwd=self.folder,
                                             env=self.environment, stderr=subprocess.PIPE, text=True))
            self.wait_for(self.folder / f"ready-{number}.txt", programs[-1])
        kept = sorted(self.folder.glob(".models.toml.*autosave"))
        self.assertEqual(len(kept), 2, kept)
        self.assertIn("elevation_deg = 21", (self.folder / ".models.toml.autosave").read_text(encoding="utf-8"))
        # A picture for the documentation asks nothing and overwrites nothing.
        before = {path: path.read_bytes() for path in kept}
        self.edit(scene, "--screenshot", self.folder / "picture.png", "--after", "6", script="""
            wait-step 1
            click sun
            set sun.elevation_deg 50
            wait 6
            """)
        self.assertEqual({path: path.read_bytes() for path in self.folder.glob(".models.toml.*autosave")}, before)
        for number, program in enumerate(programs, 1):
            name = f"script-{number}.txt"
            (editor,) = [int(pid) for pid in os.listdir("/proc") if pid.isdigit() and self.is_our_editor(pid, name)]
            os.kill(editor, signal.SIGKILL)
            program.communicate(timeout=PATIENCE)
        self.assertEqual(scene.read_text(encoding="utf-8"), MODELS)
        self.edit(scene, "--validation", script="""
            wait 0.5
            click "Keep them in a file"
            wait 0.3
            click "Take them"
            wait-step 1
            key CTRL+S
            wait 0.5
            """)
        self.assertIn("elevation_deg = 22", (self.folder / "models-recovered.toml").read_text(encoding="utf-8"))
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))
        self.assertEqual(list(self.folder.glob(".models.toml.*autosave")), [])

    def test_edits_that_cannot_be_read_are_a_question(self):
        """An autosave that is no text of a scene is said to be there, and stays until the user decides."""
        scene = self.models()
        autosave = self.folder / ".models.toml.autosave"
        with autosave.open("wb") as file:
            file.truncate(64 << 20)
        self.edit(scene, "--validation", script="""
            wait 0.5
            expect-control "unreadable edits"
            click "Ask again next time"
            wait-step 1
            click sun
            set sun.elevation_deg 21
            wait 6
            key CTRL+S
            wait 0.5
            """)
        self.assertEqual(autosave.stat().st_size, 64 << 20)
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))

    def test_a_signal_keeps_the_edits(self):
        """An end of the session: the program ends by SIGTERM within a moment, and unsaved edits are beside the scene."""
        scene = self.models()
        scene.chmod(0o600)
        ready = self.folder / "ready.txt"
        program = subprocess.Popen(self.command(scene, script="""
            wait-step 1
            click sun
            set sun.elevation_deg 21
            hashes ready.txt
            wait 60
            """), cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
        self.wait_for(ready, program)
        (editor,) = [int(pid) for pid in os.listdir("/proc") if pid.isdigit() and self.is_our_editor(pid)]
        os.kill(editor, signal.SIGTERM)
        program.communicate(timeout=PATIENCE)
        self.assertEqual(program.returncode, 128 + signal.SIGTERM)
        autosave = self.folder / ".models.toml.autosave"
        self.assertIn("elevation_deg = 21", autosave.read_text(encoding="utf-8"))
        self.assertEqual(autosave.stat().st_mode & 0o777, 0o600)  # as private as the scene may be
        self.assertEqual(scene.read_text(encoding="utf-8"), MODELS)

    def test_a_scene_with_problems_shows_none_of_the_clouds_before(self):
        """The clouds of one scene are not left under the title of the next, which cannot be simulated."""
        self.models()
        bad = self.folder / "other"
        bad.mkdir()
        (bad / "a.toml").write_text(MODELS, encoding="utf-8")
        (bad / "b.toml").write_text("[sun]\nelevation_deg = 95\n", encoding="utf-8")
        self.edit(bad, script="""
            wait-step 1
            key SPACE
            wait-picture
            screenshot clouds.png
            click menu File
            click "menu Scenes of the folder"
            click "menu b.toml"
            wait 1
            expect-control problems
            screenshot nothing.png
            """)
        box = (320, 80, 850, 550)
        self.assertGreater(ImageStat.Stat(self.image("clouds.png", box)).stddev[0], 10)
        self.assertLess(ImageStat.Stat(self.image("nothing.png", box)).stddev[0], 3)


class Layout(Case):
    def test_panels_stay_large_enough_to_be_read(self):
        """However far a bar is dragged, and whatever the settings have."""
        scene = self.scene("cumulus-by-hand.toml")
        settings = self.folder / "config/nephos/editor.conf"
        settings.parent.mkdir(parents=True)
        settings.write_text("left = 60\nright = 0\nbottom = 1\n", encoding="utf-8")
        self.edit(scene, script='wait-step 1\ndrag "left bar" -400 0\ndrag "right bar" 700 0\ndrag "bottom bar" 0 300\nwait 0.3\n')
        values = dict(line.split(" = ", 1) for line in settings.read_text(encoding="utf-8").splitlines())
        self.assertEqual([float(values[key]) for key in ("left", "right", "bottom")], [140, 220, 60])

    def test_it_is_remembered(self):
        """Size of the window, of panels, the tab, and recent files are those of the last session."""
        scene = self.scene("cumulus-by-hand.toml")
        self.edit(scene, script="""
            wait-step 1
            resize 1100 720
            wait 0.5
            drag "left bar" 70 0
            drag "bottom bar" 0 -40
            click menu View
            click menu Plots
            click tab View
            wait 0.3
            """)
        kept = (self.folder / "config/nephos/editor.conf").read_text(encoding="utf-8")
        values = dict(line.split(" = ", 1) for line in kept.splitlines())
        self.assertEqual((values["width"], values["height"]), ("1100", "720"))
        self.assertEqual((float(values["left"]), float(values["bottom"])), (320, 230))
        self.assertEqual((values["tab"], values["plots"]), ("1", "off"))
        self.assertEqual(values["recent"], str(scene))
        self.edit(size=None, script="""
            wait-step 1
            expect-control "Record as key frames"
            click menu File
            click menu Recent
            wait 0.3
            screenshot again.png
            """)
        self.assertEqual(self.image("again.png").size, (1100, 720))

    def test_small_text(self):
        """Smaller than normal: asked for, from the menu, of a display with large dots; and settings that no editor wrote."""
        scene = self.scene("cumulus-by-hand.toml")
        look = """
            wait-step 1
            click menu View
            wait 0.3
            click "menu Size of text"
            wait 0.3
            click "menu 80 %"
            wait 0.5
            """
        self.edit(scene, "--scale", "0.5", script=look)
        self.edit(scene, script=look)
        self.edit(scene, script=look, server=("-dpi", "48"))
        settings = self.folder / "config/nephos/editor.conf"
        self.assertIn("scale = 0.8", settings.read_text(encoding="utf-8"))
        settings.write_text("scale = 0.001\n", encoding="utf-8")
        self.edit(scene, script="wait-step 1")
        settings.unlink()
        os.mkfifo(settings)
        self.edit(scene, script="wait-step 1")

    def test_small_dots(self):
        """At 192 dots an inch window, text and panels are twice as large as at 96, and the picture has all the dots."""
        scene = self.scene("cumulus-by-hand.toml")
        for name, dots in (("normal", "96"), ("small", "192")):
            self.edit(scene, "--validation", size="760x480", server=("-dpi", dots), script=f"""
                wait-step 2
                key SPACE
                key HOME
                wait-picture
                screenshot {name}.png
                picture {name}-clouds.png
                """)
        normal, small = self.image("normal.png"), self.image("small.png")
        self.assertEqual(normal.size, (760, 480))
        self.assertEqual(small.size, (1520, 960))
        outline = (0, 25, 160, 440)
        halved = small.resize(normal.size, Image.Resampling.BOX).crop(outline)
        difference = ImageStat.Stat(ImageChops.difference(normal.crop(outline), halved)).mean[0]
        self.assertLess(difference, 8)
        clouds, many = self.image("normal-clouds.png"), self.image("small-clouds.png")
        self.assertAlmostEqual(many.width / clouds.width, 2, delta=0.05)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[1:]], verbosity=2)
