#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What is opened in the place of another scene, or dropped on the window, and a file that is gone. See case.py."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import unittest

from case import NEPHOS, PATIENCE
from kept import MODELS, WIND, Kept

STATE = 'seed = 4\n[lattice]\ncells = [16, 16, 12]\n'


class Opening(Kept):
    def two(self, first, second):
        """A folder of two scenes; the first is opened with it."""
        for name, text in (("a.toml", first), ("b.toml", second)):
            (self.folder / name).write_text(text, encoding="utf-8")
        return self.folder / "b.toml"

    OPEN_B = 'click "menu File"\nclick "menu Scenes of the folder"\nclick "menu b.toml"\nwait 1\nexpect-control "simulation 1"\n'

    def test_nothing_of_the_scene_before_is_left(self):
        """Clouds of its models, layers that are hidden, and recording, which would write key frames into the next one."""
        seed = "{ size_m = [400, 400, 200], position_m = [0, 0, 0] }"
        other = MODELS[:MODELS.index("seeds = [")] + f"seeds = [{seed}]\n" + MODELS[MODELS.index("[[sky]]"):]
        first = other.replace(seed, f"{seed}, {seed.replace('[0, 0, 0]', '[900, 0, 0]')}, {seed.replace('[0, 0, 0]', '[1800, 0, 0]')}")
        scene = self.two(first, other)
        sketched = 'click model\nclick model[0]\nclick "20 at once"\nwait 0.5\n'
        self.edit(self.folder, script=f'wait-step 1\nkey SPACE\n{sketched}click "cloud 2"\nwait 0.3\n{self.OPEN_B}{sketched}'
                                      'click "cloud 3"\nclick "Make it a base model"\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        made = tomllib.loads(scene.read_text(encoding="utf-8"))["model"][1]
        self.assertEqual([seed["position_m"] for seed in made["seeds"]], [[0, 0, 0]])
        wind = WIND.replace("7.5", "8")
        scene = self.two(WIND, wind)
        self.edit(self.folder, script='wait-step 1\nkey SPACE\nclick "tab View"\nclick "Record as key frames"\n' + self.OPEN_B +
                                      "key SPACE\nclick wind\nclick wind[0]\nclick wind[0].levels\nclick wind[0].levels[0]\nwait 0.3\n"
                                      'click "tab Properties"\nset wind[0].levels[0].speed_m_per_s 9\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        self.assertEqual(scene.read_text(encoding="utf-8"), wind.replace("= 8 ", "= 9 "))

    def test_a_name_with_quotes_is_kept(self):
        """Of a model that a cloud becomes."""
        scene = self.folder / "q.toml"
        scene.write_text(MODELS.replace('"bank"', "'big \"bank\"'"), encoding="utf-8")
        self.edit(scene, script='wait-step 1\nkey SPACE\nclick model\nclick model[0]\nclick "20 at once"\nwait 0.5\nclick "cloud 3"\n'
                                'click "Make it a base model"\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        names = [model["name"] for model in tomllib.loads(scene.read_text(encoding="utf-8"))["model"]]
        self.assertEqual(names, ['big "bank"', 'big "bank"-2'])

    def test_what_is_dropped_waits_for_an_answer(self):
        """A grid is asked about in the scene that it was dropped on; a scene is not opened under a dialog."""
        scene = self.two(STATE, STATE.replace("4", "5"))
        subprocess.run([NEPHOS, "state", scene, "--steps", "1", "--out", self.folder / "grid.vdb"], check=True, capture_output=True)
        self.edit(self.folder / "a.toml", script="wait-step 1\ndrop grid.vdb b.toml\nwait 0.5\nexpect-control refusal\n"
                                                 'click "Start from it"\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        self.assertEqual(tomllib.loads((self.folder / "a.toml").read_text(encoding="utf-8"))["lattice"]["initial_state"], "grid.vdb")
        self.assertEqual(scene.read_text(encoding="utf-8"), STATE.replace("4", "5"))
        self.edit(self.folder / "a.toml", script='wait-step 1\nkey CTRL+SHIFT+S\nwait 0.3\ndrop b.toml\nwait 0.5\nclick Cancel\n'
                                                 'wait 0.5\ndrop b.toml\nwait 1\nclick scene\nclick "tab Properties"\nset seed 77\nwait 0.3\nkey CTRL+S\nwait 0.5\n')
        self.assertIn("seed = 77", scene.read_text(encoding="utf-8"))

    def test_a_grid_is_no_reason_to_save(self):
        """It is asked about at once, whatever is edited."""
        scene = self.two(STATE, STATE)
        subprocess.run([NEPHOS, "state", scene, "--steps", "1", "--out", self.folder / "grid.vdb"], check=True, capture_output=True)
        self.edit(scene, script='wait-step 1\nclick scene\nclick "tab Properties"\nset seed 7\nwait 0.3\ndrop grid.vdb\nwait 0.5\n'
                                'click "Start from it"\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        self.assertIn("seed = 7", scene.read_text(encoding="utf-8"))
        self.assertIn("grid.vdb", scene.read_text(encoding="utf-8"))

    def removed_at(self, script):
        """Removes the scene when such a script writes its hashes; its end saves it."""
        scene, ready = self.two(STATE, STATE), self.folder / "ready.txt"
        script += 'expect-control "unsaved b.toml"\nclick "Save them"\nwait 0.5\n'
        editor = subprocess.Popen(self.command(scene, script=script), cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
        self.wait_for(ready, editor)
        scene.unlink()
        errors = editor.communicate(timeout=PATIENCE)[1]
        self.assertEqual(editor.returncode, 0, errors)
        self.assertEqual(scene.read_text(encoding="utf-8"), STATE)

    def test_a_file_that_is_gone_is_unsaved(self):
        """Its text is nowhere else: the editor asks before it ends, and saving makes the file anew."""
        self.removed_at("wait-step 1\nhashes ready.txt\nwait 2\nkey CTRL+Q\nwait 0.5\n")

    def test_a_file_that_comes_back_answers_no_question(self):
        """What the editor asks of a file that is gone waits for the user: what it had is in no other place."""
        scene = self.folder / "a.toml"
        scene.write_text(STATE, encoding="utf-8")
        gone, asked = self.folder / "gone.txt", self.folder / "asked.txt"
        editor = subprocess.Popen(self.command(scene, script="""
            wait-step 1
            hashes gone.txt
            wait 2
            close-window
            wait 0.5
            expect-control "unsaved a.toml"
            hashes asked.txt
            wait 4
            expect-control "unsaved a.toml"
            close-window
            wait 0.5
            expect-control "unsaved a.toml"
            click "Save them"
            wait 0.5
            click "Overwrite it"
            expect-end
            """), cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
        self.wait_for(gone, editor)
        scene.unlink()
        self.wait_for(asked, editor)
        scene.write_text(STATE.replace("4", "5"), encoding="utf-8")
        errors = editor.communicate(timeout=PATIENCE)[1]
        self.assertEqual(editor.returncode, 0, errors)
        self.assertEqual(scene.read_text(encoding="utf-8"), STATE)

    def test_a_file_that_goes_while_something_is_asked_is_asked_about(self):
        """The answer about another scene says nothing of it."""
        self.removed_at('wait-step 1\nclick "new simulation"\nwait-step 1\nclick scene\nclick "tab Properties"\nset seed 9\nwait 0.3\nclick "simulation 1"\n'
                        'wait 0.3\nkey CTRL+Q\nwait 0.5\nhashes ready.txt\nwait 2\nclick "Discard them"\nwait 0.5\n')

    def ended(self, scene, script, meanwhile=lambda: None, environment=None):
        """Runs such a script, then ends the editor by SIGTERM; returns what it said."""
        ready = self.folder / "ready.txt"
        editor = subprocess.Popen(self.command(scene, script=script + "hashes ready.txt\nwait 100\n"), cwd=self.folder,
                                  env={**self.environment, **(environment or {})}, stderr=subprocess.PIPE, text=True)
        self.wait_for(ready, editor)
        meanwhile()
        editor.terminate()
        said = editor.communicate(timeout=PATIENCE)[1]
        ready.unlink()
        return said

    TAKE = 'wait 1\nclick "Take them"\nwait 0.5\nkey CTRL+S\nwait 0.5\n'

    def test_edits_are_kept_where_the_disk_is_full(self):
        """In the folder of the settings; the next editor of the scene offers them, by whatever link it is reached."""
        scene = self.folder / "full/a.toml"
        scene.parent.mkdir()
        scene.write_text(STATE, encoding="utf-8")
        full = {"LD_PRELOAD": os.environ["FAILING_CALLS"], "FAIL_CALL": "write ENOSPC 1 1000000", "FAIL_PATH": "/full/", "FAIL_PROGRAM": "nephos-editor"}
        said = self.ended(scene, 'wait-step 1\nclick scene\nclick "tab Properties"\nset seed 9\nwait 0.3\n', environment=full)
        self.assertNotIn("could not be kept", said)
        self.assertEqual([path.name for path in scene.parent.iterdir()], ["a.toml"])
        (self.folder / "link").symlink_to("full")
        self.edit(self.folder / "link/a.toml", script=self.TAKE)
        self.assertEqual(scene.read_text(encoding="utf-8"), STATE.replace("4", "9"))

    def test_a_hidden_scene_whose_file_is_gone_is_kept(self):
        """And offered by the name of the file, which is not there; its folder may have been removed, too."""
        for remove in (lambda scene: scene.unlink(), lambda scene: shutil.rmtree(scene.parent)):
            scene = self.folder / "gone/a.toml"
            scene.parent.mkdir(exist_ok=True)
            scene.write_text(STATE, encoding="utf-8")
            self.ended(scene, 'wait-step 1\nclick "new simulation"\nwait-step 1\n', meanwhile=lambda: remove(scene))
            self.assertFalse(scene.exists())
            is_folder_left = scene.parent.exists()
            scene.parent.mkdir(exist_ok=True)
            self.edit(scene.parent if is_folder_left else scene, script=self.TAKE)
            self.assertEqual(scene.read_text(encoding="utf-8"), STATE)
            self.assertEqual([path.name for path in scene.parent.iterdir()], ["a.toml"])

    def test_what_is_left_of_a_file_that_is_gone_may_be_deleted(self):
        """Then nothing is left, and the editor goes to a new scene; a picture of it is none."""
        scene = self.folder / "gone/a.toml"
        scene.parent.mkdir()
        left = scene.parent / ".a.toml.autosave"
        left.write_text(STATE, encoding="utf-8")
        self.edit(scene, "--screenshot", "p.png", status=3)
        self.edit(scene.parent, "--screenshot", "p.png", status=2)
        self.assertFalse((self.folder / "p.png").exists())
        self.edit(scene, script='wait 1\nclick "Delete them"\nwait 6\nwait-step 1\nkey CTRL+Q\nwait 0.5\n')
        self.assertEqual(list(scene.parent.iterdir()), [])
        self.edit(scene.parent, status=2)
        # Of a copy alone: nothing is asked of the scene itself, which is nowhere.
        (scene.parent / ".a-2.toml.autosave").write_text(STATE, encoding="utf-8")
        self.edit(scene, script=self.TAKE.replace("key CTRL+S\nwait 0.5\n", 'key CTRL+Q\nwait 0.5\nexpect-control "unsaved a-2.toml"\nclick "Discard them"\nwait 0.5\n'))
        self.assertFalse(scene.exists())

    def test_a_file_that_cannot_be_opened_ends_a_drop(self):
        """Those behind it are not opened without a word."""
        self.two(STATE, STATE)
        self.edit(self.folder / "a.toml", script='wait-step 1\ndrop none.toml b.toml\nwait 0.5\nexpect-control refusal\nclick scene\n'
                                                 'click "tab Properties"\nwait 1\nset seed 9\nwait 0.3\nkey CTRL+S\nwait 0.5\n')
        self.assertEqual((self.folder / "b.toml").read_text(encoding="utf-8"), STATE)
        self.assertEqual((self.folder / "a.toml").read_text(encoding="utf-8"), STATE.replace("4", "9"))

    def test_an_exported_grid_is_the_frame_of_a_run(self):
        """Of a tile with wind: the same voxels and metadata, the lengths after which it repeats among them."""
        scene = self.folder / "t.toml"
        scene.write_text('name = "t"\ntile = true\nseed = 7\n[lattice]\ncells = [16, 16, 8]\ncell_size_m = 100\norigin_m = [-800, -800, 1000]\n'
                         '[field.background]\nhum = 0.1\nact = 0.05\next = 0.1\n'
                         '[[wind]]\nlevels = [{ height_m = 1000, from_deg = 250, speed_m_per_s = 12 }]\n'
                         '[time]\nstep_s = 10\nsteps = 40\n[frames]\nper_second = 1\ntime_scale = 10\n', encoding="utf-8")
        self.edit(scene, script='wait-step 3\nkey SPACE\nwait 0.5\nclick "menu File"\nclick "menu Export the grid..."\nwait 0.3\n'
                                'set "file name" g.vdb\nwait 1\n')
        subprocess.run([NEPHOS, "run", scene, "--no-render", "-q", "-o", self.folder / "run"], check=True)
        def grid(path):
            said = subprocess.run([NEPHOS, "info", path, "--json"], capture_output=True, text=True, check=True)
            return json.loads(said.stdout)["grids"][0]
        found = grid(self.folder / "g.vdb")
        step = round(float(found["metadata"]["nephos_time_s"]) / 10)
        frame = self.folder / f"run/density/t_{step + 1:04}.vdb"
        self.assertEqual(found, grid(frame))
        self.assertIn("1600", str(found["metadata"]["nephos_period_m"]))
        import numpy
        import pyopenvdb
        def voxels(path):
            array = numpy.zeros((16, 16, 8), "f4")
            pyopenvdb.read(str(path), "density").copyToArray(array)
            return array
        self.assertGreater(voxels(frame).max(), 0)
        numpy.testing.assert_array_equal(voxels(self.folder / "g.vdb"), voxels(frame))

    def test_a_grid_has_the_scene_that_it_is_of(self):
        """Not the one that could not be simulated, whose text is in the window."""
        scene = self.two(STATE, STATE)
        self.edit(scene, script='wait-step 3\nkey SPACE\nwait 0.5\nclick "menu File"\nclick "menu Export the grid..."\nwait 0.3\nset "file name" good.vdb\nwait 1\n'
                                'click "tab Text"\nclick text\nkey CTRL+A\ntype lattice={cells=[4000,4000,4000]}\nwait 1\n'
                                'click "menu File"\nclick "menu Export the grid..."\nwait 0.3\nset "file name" later.vdb\nwait 1\n')
        good, later = (json.loads(subprocess.run([NEPHOS, "info", "--json", self.folder / name], check=True, capture_output=True, text=True).stdout)
                       for name in ("good.vdb", "later.vdb"))
        for info in (good, later):
            del info["file"]
        self.assertEqual(good, later)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[1:]], verbosity=2)
