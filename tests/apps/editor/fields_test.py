#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What is typed, dragged and recorded, through interruptions, changes by others and problems of the text. See case.py."""

import ctypes
import os
import signal
import subprocess
import sys
import time
import tomllib
import unittest

from case import NEPHOS, PATIENCE, Screen
from kept import MODELS, RECORD_WIND, WIND, Kept


class Fields(Kept):
    """What is typed into fields or dragged, while it is recorded, interrupted, taken back or changed by others."""

    def test_what_is_typed_counts_wherever_it_is_left(self):
        """Also by a click on what is drawn before the field, by Ctrl+S, and in a field of numbers; and Ctrl+Z in a field that was left
        is of the text that it has now."""
        scene = self.folder / "a.toml"
        text = 'name = "models"\nseed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n'
        typed = "wait-step 1\nclick scene\nwait 0.2\nclick name\nkey END\ntype xyz\nwait 0.2\n"
        for leave in ("click lattice", "click seed", "click \"menu Edit\"\nkey ESCAPE", "click \"tab View\"", "key ENTER", "key TAB", "key SHIFT+TAB", ""):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"{typed}{leave}\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("models", "modelsxyz"), leave)
        scene.write_text(text, encoding="utf-8")  # Tab goes on to the next field
        self.edit(scene, script=f"{typed}key TAB\nwait 0.3\ntype 77\nkey ENTER\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("models", "modelsxyz").replace("= 4", "= 77"))
        # Nothing is left of a way back to another text: refused, taken back by Escape, or changed by the document's undo.
        for edit in ("click name\nkey END\ntype abcdefghijklmnopqrs\nwait 0.1\nclick lattice\nwait 0.3\nclick \"tab View\"\nkey CTRL+Z\nwait 0.3\n"
                     "click scene\nwait 0.2\nclick name",
                     "click seed\nkey END\ntype 123456789012345678901\nkey ENTER\nwait 0.2\nclick seed",
                     "click name\nkey END\ntype xyz\nkey ESCAPE\nwait 0.1\nclick name"):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"wait-step 1\nclick scene\nclick \"tab Properties\"\nwait 0.2\n{edit}\nwait 0.1\n"
                                    "key CTRL+Z\nwait 0.1\nkey CTRL+Y\nkey CTRL+Z\nkey CTRL+Z\nwait 0.2\nkey ENTER\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text, edit)

    def test_a_window_over_a_field_takes_no_text_away(self):
        """F12 and F1 open windows, and what was typed counts; so do symbols beyond U+FFFF, and a seed that is none is told."""
        scene = self.folder / "b.toml"
        text = 'name = "models"\nseed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n'
        for key, close in (("F12", "click Cancel"), ("F1", "key F1")):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"wait-step 1\nclick scene\nwait 0.2\nclick name\nkey END\ntype \U0001f329\ue000\ua000z\nwait 0.2\n"
                                    f"key {key}\nwait 0.5\n{close}\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("models", "models\U0001f329\ue000\ua000z"), key)
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script="wait-step 1\nclick scene\nwait 0.2\nset seed 12abc\nwait 0.3\nexpect-control refusal\n")

    def test_tab_goes_on_and_on(self):
        """From field to field, as fast as one types."""
        scene = self.folder / "d.toml"
        text = 'name = "models"\nseed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n'
        for pause in ("wait 0.3\n", ""):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script="wait-step 1\nclick lattice\nwait 0.2\ndouble-click-at lattice.cells[0] 0.5 0.5\nkey CTRL+A\ntype 20\n"
                                    f"key TAB\n{pause}type 21\nkey TAB\n{pause}type 22\nwait 0.2\nkey ENTER\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("[16, 16, 12]", "[20, 21, 22]"), pause)
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"wait-step 1\nclick scene\nwait 0.2\nclick name\nkey END\ntype xyz\nkey TAB\n{pause}type 77\nwait 0.2\nkey ENTER\n"
                                    "wait 0.3\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("models", "modelsxyz").replace("= 4", "= 77"), pause)

    def test_a_recorded_wind_is_the_whole_number(self):
        """Typed key by key or dragged, while key frames are recorded; Escape records nothing."""
        scene = self.folder / "w.toml"
        typed = "double-click-at wind[0].levels[0].speed_m_per_s 0.5 0.5\nkey CTRL+A\ntype 1\nwait 0.3\ntype 2\nwait 0.3\ntype .5\nwait 0.3\n"
        for act, least, most in ((typed + "key ENTER\n", 12.4999, 12.5001), (typed + "key TAB\n", 12.4999, 12.5001),
                                 ("drag wind[0].levels[0].speed_m_per_s 60 0\n", 9, 13), (typed + "key ESCAPE\n", None, None)):
            scene.write_text(WIND, encoding="utf-8")
            self.edit(scene, script=f"{RECORD_WIND}{act}wait 0.3\nkey CTRL+S\nwait 0.5\n")
            written = scene.read_text(encoding="utf-8")
            if least is None:
                self.assertEqual(written, WIND)
                continue
            level, = tomllib.loads(written)["wind"][-1]["levels"]
            speed = (level["east_m_per_s"] ** 2 + level["north_m_per_s"] ** 2) ** 0.5
            self.assertTrue(least <= speed <= most, f"{act}\n{written}")

    def test_tab_goes_on_from_a_recorded_number(self):
        """To the next field, of the key frame that has just been made; backwards, too."""
        scene = self.folder / "w.toml"
        for first, typed, key, second in (("from_deg", "90", "TAB", "8"), ("speed_m_per_s", "8", "SHIFT+TAB", "90")):
            scene.write_text(WIND, encoding="utf-8")
            self.edit(scene, script=f"{RECORD_WIND}double-click-at wind[0].levels[0].{first} 0.5 0.5\nkey CTRL+A\ntype {typed}\nwait 0.3\n"
                                    f"key {key}\nwait 1\ntype {second}\nwait 0.3\nkey ENTER\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
            level, = tomllib.loads(scene.read_text(encoding="utf-8"))["wind"][-1]["levels"]
            self.assertAlmostEqual(level["east_m_per_s"], -8, 5, f"{key}\n{scene.read_text(encoding='utf-8')}")
            self.assertAlmostEqual(level["north_m_per_s"], 0, 5)

    def test_numbers_that_a_search_shows_are_recorded_together(self):
        """Where the key frame of before stays in sight: both are in the new one; and a signal keeps the same."""
        scene = self.folder / "w.toml"
        levels = "[{ height_m = 500, from_deg = 270, speed_m_per_s = 4 }, { height_m = 1000, from_deg = 270, speed_m_per_s = 6 }]"
        text = f'seed = 4\n[lattice]\ncells = [16, 16, 12]\n[[wind]]\nlevels = {levels}\n'
        script = RECORD_WIND[:RECORD_WIND.index("click wind")] + 'click "tab Properties"\nclick find\ntype speed_m\nwait 0.4\n'
        for n, speed in ((0, 11), (1, 17)):
            script += f"double-click-at wind[0].levels[{n}].speed_m_per_s 0.5 0.5\nkey CTRL+A\ntype {speed}\nwait 0.2\n" + "key ENTER\nwait 0.4\n" * (n == 0)
        scene.write_text(text, encoding="utf-8")
        kept = self.keep_by_signal(scene, script)
        self.edit(scene, script=script + "key ENTER\nwait 0.4\nkey CTRL+S\nwait 0.5\n")
        saved = scene.read_text(encoding="utf-8")
        self.assertEqual([round(level["east_m_per_s"], 6) if "east_m_per_s" in level else level["speed_m_per_s"]
                          for level in tomllib.loads(saved)["wind"][-1]["levels"]], [11, 17], saved)
        self.assertEqual(saved, kept)

    def test_a_search_after_undo_between_winds_and_of_times(self):
        """The key frame that was made is gone; another wind is recorded in between; the time of a key frame is its own."""
        scene = self.folder / "w.toml"
        levels = "levels = [{ height_m = 500, from_deg = 270, speed_m_per_s = 4 }, { height_m = 1000, from_deg = 270, speed_m_per_s = 6 }]"
        model = '[[model]]\nname = "a"\nseeds = [{ position_m = [0, 0, 200], size_m = [300, 200, 150] }]\n[[sky]]\nname = "fair"\nstate = 0\nclouds = 1\nmodels = ["a"]\n'
        text = ("seed = 4\n[lattice]\ncells = [16, 16, 12]\n[time]\nstep_s = 2\nsteps = 40\n" + model +
                "".join(f'[[layer]]\nname = "{name}"\nskies = ["fair"]\nbase_height_m = 200\nlattice = {{ cells = [16, 16, 8] }}\n[[layer.wind]]\ntime_s = 0\n{levels}\n'
                        for name in ("low", "high")))
        script = RECORD_WIND[:RECORD_WIND.index("click wind")] + 'click "tab Properties"\nclick find\ntype speed_m\nwait 0.4\n'
        def typed(layer, level, speed, key="speed_m_per_s"):
            place = f"levels[{level}].{key}" if key != "time_s" else key
            return f"double-click-at layer[{layer}].wind[0].{place} 0.5 0.5\nkey CTRL+A\ntype {speed}\nwait 0.2\nkey ENTER\nwait 0.4\n"
        def winds(do):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"{script}{do}key CTRL+S\nwait 0.5\n")
            saved = tomllib.loads(scene.read_text(encoding="utf-8"))
            return [[(key["time_s"], [round(level.get("east_m_per_s", level.get("speed_m_per_s")), 3) for level in key["levels"]]) for key in layer["wind"]]
                    for layer in saved["layer"]]
        low, high = winds(typed(0, 0, 11) + typed(1, 0, 12) + typed(0, 1, 13))
        self.assertEqual((low[-1][1], high[-1][1]), ([11, 13], [12, 6]))
        low, high = winds(typed(0, 0, 11) + "click scene\nwait 0.2\nkey CTRL+Z\nwait 0.3\n" + typed(0, 1, 17))
        self.assertEqual((low[-1][1], len(low), len(high)), ([4, 17], 3, 1))
        # A level at another height is told, and takes nothing away.
        low, _ = winds(typed(0, 0, 11) + "click find\nkey CTRL+A\ntype wind[\nwait 0.4\n" + typed(0, 1, 1100, "height_m") + typed(0, 1, 13) +
                       "expect-control refusal\n")
        self.assertEqual((low[-1][1], low[0][1]), ([11, 6], [4, 6]))
        low, _ = winds(typed(0, 0, 11) + "click find\nkey CTRL+A\ntype wind[\nwait 0.4\n" + typed(0, 0, 3, "time_s"))
        self.assertEqual(low[0][0], 3, low)

    def test_winds_recorded_between_key_frames_are_replayed(self):
        """Every step that was seen keeps its bits, those of clouds that are drawn directly between levels too."""
        scene = self.folder / "w.toml"
        def levels(low, high):
            return "levels = [" + ", ".join("{{ height_m = {}, east_m_per_s = {}, north_m_per_s = {} }}".format(*level)
                                            for level in ((100, *low), (1700, *high))) + "]\n"
        scene.write_text('seed = 4\n[lattice]\ncells = [16, 16, 12]\n[time]\nstep_s = 7\nsteps = 60\n'
                         '[[model]]\nname = "a"\nseeds = [{ position_m = [0, 0, 200], size_m = [300, 200, 150] }]\n'
                         '[[sky]]\nname = "fair"\nstate = 0\nclouds = 5\nmodels = ["a"]\n'
                         '[[layer]]\nname = "low"\nautomaton = false\nskies = ["fair"]\nbase_height_m = 750\nlattice = { cells = [16, 16, 8] }\n'
                         f"[[layer.wind]]\ntime_s = 0\n{levels((7.7, 2.4), (2.6, -3.1))}"
                         f"[[layer.wind]]\ntime_s = 399\n{levels((9.6, -0.2), (5.8, -2.3))}", encoding="utf-8")
        self.edit(scene, script='wait-step 30\nkey SPACE\nwait 0.5\nclick "tab View"\nclick "Record as key frames"\nclick "tab Properties"\n'
                                'click find\ntype east_m\nwait 0.4\ndouble-click-at layer[0].wind[0].levels[0].east_m_per_s 0.5 0.5\n'
                                'key CTRL+A\ntype 11\nwait 0.2\nkey ENTER\nwait 0.5\nwait-picture\nhashes seen.txt\nkey CTRL+S\nwait 0.5\n')
        seen = (self.folder / "seen.txt").read_text(encoding="utf-8").splitlines()
        self.assertGreater(len(tomllib.loads(scene.read_text(encoding="utf-8"))["layer"][0]["wind"]), 30)
        replay = subprocess.run([NEPHOS, "hash", scene, "--steps", str(len(seen) - 1)], capture_output=True, text=True, check=True)
        self.assertEqual(replay.stdout.splitlines(), seen)

    def test_a_wind_recorded_under_a_veil_goes_on(self):
        """Though the hash of a veil is made of its wind."""
        scene = self.folder / "v.toml"
        scene.write_text('seed = 4\n[lattice]\ncells = [16, 16, 12]\n[time]\nstep_s = 7\nsteps = 60\n'
                         '[[wind]]\nlevels = [{ height_m = 100, east_m_per_s = 4, north_m_per_s = 1 }, { height_m = 9500, east_m_per_s = 27, north_m_per_s = 9 }]\n'
                         '[[layer]]\nname = "Ci"\nlattice = { cells = [24, 24, 8], cell_size_m = 140, origin_m = [0, 0, 1000] }\n'
                         '[layer.veil]\nform = "cirrus"\noctaves = 3\n', encoding="utf-8")
        self.edit(scene, script='wait-step 10\nkey SPACE\nwait 0.5\nclick "tab View"\nclick "Record as key frames"\nclick "tab Properties"\n'
                                'click find\ntype east_m\nwait 0.4\ndouble-click-at wind[0].levels[0].east_m_per_s 0.5 0.5\n'
                                'key CTRL+A\ntype 11\nwait 0.2\nkey ENTER\nwait 0.5\nwait-picture\n'
                                'key HOME\nwait 0.5\nwait-picture\nkey SPACE\nwait-step 25\nkey CTRL+S\nwait 0.5\n')
        self.assertEqual([frame["levels"][0]["east_m_per_s"] for frame in tomllib.loads(scene.read_text(encoding="utf-8"))["wind"]], [4, 4, 11])

    def test_winds_recorded_between_steps_of_fractions_are_replayed(self):
        """The wind before is kept up to the time of the step before, to the last bit: 3.5 s, and not 4.2 s less 0.7 s."""
        scene = self.folder / "w.toml"
        scene.write_text('seed = 4\n[lattice]\ncells = [16, 16, 12]\n[time]\nstep_s = 0.7\nsteps = 60\n'
                         '[[wind]]\nlevels = [{ height_m = 1000, east_m_per_s = 100, north_m_per_s = 0 }]\n', encoding="utf-8")
        self.edit(scene, script='wait 0.3\nkey SPACE\nkey HOME\nwait 0.5\n' + "key .\nwait 0.3\n" * 4 + 'click "tab View"\nclick "Record as key frames"\n'
                                'click wind\nclick wind[0]\nclick wind[0].levels\nclick wind[0].levels[0]\nclick "tab Properties"\nwait 0.3\n'
                                'set wind[0].levels[0].east_m_per_s 190\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        times = [frame["time_s"] for frame in tomllib.loads(scene.read_text(encoding="utf-8"))["wind"][-2:]]
        step = round(times[1] / 0.7)
        self.assertEqual(times, [(step - 1) * 0.7, step * 0.7])
        self.assertIn(step, (6, 11, 12), "a step whose time less 0.7 s is another number")

    def test_what_is_recorded_on_the_way_to_a_step_is_of_that_step(self):
        """While the simulation is made anew up to what the time line shows: the steps that were seen keep their wind."""
        scene = self.folder / "w.toml"
        scene.write_text("seed = 4\n[lattice]\ncells = [192, 192, 48]\n" + WIND[WIND.index("[[wind]]"):], encoding="utf-8")
        self.edit(scene, script="wait-step 30\nkey SPACE\nwait 0.5\nclick scene\nclick \"tab Properties\"\nwait 0.3\nset seed 5\n"
                                'click "tab View"\nclick "Record as key frames"\nclick wind\nclick wind[0]\nclick "tab Properties"\nwait 0.2\n'
                                'drag "hodograph 0" 20 10\nwait 0.3\nkey CTRL+S\nwait 0.5\n')
        saved = tomllib.loads(scene.read_text(encoding="utf-8"))
        self.assertGreaterEqual(saved["wind"][1]["time_s"], 300, saved["wind"])
        self.assertLessEqual(len(saved["wind"]), 3, "one drag")

    def test_a_handle_moves_one_coordinate(self):
        scene = self.folder / "h.toml"
        text = ('seed = 4\n[lattice]\ncells = [32, 32, 24]\ncell_size_m = 100\n[field]\nellipsoids = [{ centre_m = [0.123456, 0.654321, 1200.5], '
                "semi_axes_m = [333.25, 444.5, 222.125] }]\n")
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script="wait-step 1\nclick field\nclick field.ellipsoids\nclick field.ellipsoids[0]\nwait 0.3\nkey F\nwait 0.5\n"
                                'drag "handle move east" 40 0\nwait 0.3\nkey CTRL+S\nwait 0.5\n')
        parcel = tomllib.loads(scene.read_text(encoding="utf-8"))["field"]["ellipsoids"][0]
        self.assertNotEqual(parcel["centre_m"][0], 0.123456)
        self.assertEqual(parcel["centre_m"][1:], [0.654321, 1200.5])
        self.assertEqual(parcel["semi_axes_m"], [333.25, 444.5, 222.125])

    def test_what_is_typed_into_a_number_is_one_step_of_undo(self):
        """However slowly; and Escape gives a colour back with all of its digits."""
        scene = self.folder / "c.toml"
        text = 'name = "models"\nseed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n[sun]\ncolour = [0.1234567, 0.5, 1]\n'
        slowly = "key CTRL+A\ntype 2\nwait 0.2\ntype 5\nwait 0.2\ntype 0\nwait 0.2\n"
        for leave in ("key ENTER", "key TAB", "click scene", ""):
            for undo, size in (("", 250), ('click "tab View"\nkey CTRL+Z\n', 100)):
                scene.write_text(text, encoding="utf-8")
                self.edit(scene, script="wait-step 1\nclick lattice\nwait 0.2\ndouble-click-at lattice.cell_size_m 0.5 0.5\n"
                                        f"{slowly}{leave}\nwait 0.2\n{undo}wait 0.2\nkey CTRL+S\nwait 0.5\n")
                self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("= 100", f"= {size}"), leave)
        for leave, first in (("key ESCAPE", "0.1234567"), ("key ENTER", "0.7654321")):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script="wait-step 1\nclick sun\nwait 0.2\ndouble-click-at sun.colour[0] 0.5 0.5\nkey CTRL+A\ntype 0.7654321\n"
                                    f"wait 0.2\n{leave}\nwait 0.2\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("0.1234567", first))

    def test_escape_leaves_a_number_as_it_was(self):
        """By the byte: its form, a key that the text does not have, one beyond its range; undo does not bring it back, and a
        number beside it that was typed before stays."""
        scene = self.folder / "e.toml"
        text = 'name = "models"\nseed = 4\n[lattice]\ncells = [16, 0x10, 12]\ncell_size_m = 1.0e2\n'
        for key, typed in (("lattice.cell_size_m", "250"), ("time.step_s", "3"), ("lattice.cell_size_m", "-7"),
                           ("lattice.cell_size_m", "1000")):
            section = key.partition(".")[0]
            for undo in ("", 'click "tab View"\nkey CTRL+Z\nwait 0.2\nkey CTRL+Y\n'):
                scene.write_text(text, encoding="utf-8")
                self.edit(scene, script=f"wait-step 1\nclick {section}\nwait 0.2\ndouble-click-at {key} 0.5 0.5\nkey CTRL+A\ntype {typed}\n"
                                        f"wait 0.2\nkey BACKSPACE\nwait 0.2\nkey ESCAPE\nwait 0.2\n{undo}wait 0.2\nkey CTRL+S\nwait 0.5\n")
                self.assertEqual(scene.read_text(encoding="utf-8"), text, key)
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script="wait-step 1\nclick lattice\nwait 0.2\ndouble-click-at lattice.cells[0] 0.5 0.5\nkey CTRL+A\ntype 20\nkey TAB\n"
                                "wait 0.3\ntype 21\nwait 0.2\nkey ESCAPE\nwait 0.2\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("[16,", "[20,"))

    def test_what_is_refused_is_told_by_ctrl_s_too(self):
        """Names that a model of a file has, or that are empty, and a seed that is none: each is said, and the scene saved without."""
        scene = self.folder / "r.toml"
        (self.folder / "m.toml").write_text("seed = 1\n" + MODELS[MODELS.index("[[model]]"):MODELS.index("[[sky]]")], encoding="utf-8")
        text = MODELS.replace("[[model]]", 'models = "m.toml"\n[[model]]', 1).replace('"bank"', '"own"')
        for select, key, typed in (("click model\nclick model[0]", "model[0].name", "bank"), ("click model\nclick model[0]", "model[0].name", ""),
                                   ("click scene", "seed", "##12abc")):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"wait-step 1\n{select}\nclick \"tab Properties\"\nwait 0.3\nclick {key}\nkey CTRL+A\nkey BACKSPACE\n"
                                    + (f"type {typed}\n" if typed else "") + "wait 0.2\nkey CTRL+S\nwait 0.5\nexpect-control refusal\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text, key)

    def test_an_integer_mends_a_number_that_is_none(self):
        scene = self.folder / "i.toml"
        text = 'name = "i"\nseed = 4\n[lattice]\ncells = [16.0, 14, 1_2] # odd\ncell_size_m = 1.0e2\n'
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script="wait 1\nclick lattice\nclick \"tab Properties\"\nwait 0.3\nset lattice.cells[1] 15\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("[16.0, 14,", "[16, 15,"))

    def test_names_that_are_empty_are_drawn(self):
        scene = self.models()
        scene.write_text(MODELS.replace('"bank"', '""').replace('"few"', '""'), encoding="utf-8")
        settings = self.folder / "config/nephos"
        settings.mkdir(parents=True)
        (settings / "editor.conf").write_text("recent = \n", encoding="utf-8")
        self.edit(scene, script="""
            wait 1
            click sky
            click sky[0]
            click "tab Properties"
            wait 0.3
            click sky[0].models
            wait 0.3
            """)
        self.edit(scene, script="""
            wait 1
            click layer
            click layer[0]
            click "tab Properties"
            wait 0.3
            click layer[0].skies
            wait 0.3
            """)
        self.edit(scene, script="wait 1\nclick \"menu File\"\nwait 0.3\nclick \"menu Recent\"\nwait 0.3\n")

    def test_scripts_without_commands_end(self):
        scene = self.models()
        self.edit(scene, script="# nothing\n", timeout=PATIENCE)
        self.assertIn("cannot be read", self.edit(scene, "--script", self.folder, status=3, timeout=PATIENCE))

    def test_one_number_of_several_is_changed(self):
        """Its neighbours keep their digits and their form, and what is typed has all of its own."""
        scene = self.folder / "c.toml"
        text = ('seed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n[camera]\nposition_m = [12345.678, -3_217.89, 7.1125e2]\n'
                'target_m = [0, 0, 1150]\n[georeference]\nlatitude_deg = 12\nlongitude_deg = 5\n[sun]\nelevation_deg = 40\nazimuth_deg = 200\n')
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script="wait-step 1\nclick camera\nclick \"tab Properties\"\nwait 0.3\nset camera.position_m[1] 5.123456789012\n"
                                "wait 0.2\nclick georeference\nwait 0.2\nset georeference.latitude_deg 47.37691234\nwait 0.2\nkey CTRL+S\nwait 0.5\n")
        typed = text.replace("-3_217.89", "5.123456789012").replace("latitude_deg = 12", "latitude_deg = 47.37691234")
        self.assertEqual(scene.read_text(encoding="utf-8"), typed)
        self.edit(scene, script="wait-step 1\nclick camera\nclick \"tab Properties\"\nwait 0.3\ndrag camera.position_m[0] 30 0\n"
                                "wait 0.2\nkey CTRL+S\nwait 0.5\n")
        saved = scene.read_text(encoding="utf-8")
        self.assertNotEqual(saved, typed)
        self.assertIn(", 5.123456789012, 7.1125e2]", saved)

    def test_texts_that_no_field_can_hold_stay(self):
        """A list whose member has a comma, and a text with a byte of 0."""
        scene = self.folder / "a.toml"
        for key, text in (("models", 'models = "a,b.toml"\nname = "s"\n'), ("name", 'name = "a\\u0000bc" # n\n')):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script=f"""
                wait 1
                click scene
                wait 0.2
                click {key}
                key END
                type x
                key ENTER
                wait 0.3
                key CTRL+S
                wait 0.5
                """)
            self.assertEqual(scene.read_text(encoding="utf-8"), text)

    def test_a_window_that_another_program_destroys_keeps_the_edits(self):
        scene = self.models()
        script = self.folder / "script.txt"
        script.write_text("wait-step 1\nclick sun\nset sun.elevation_deg 21\nwait 0.3\nhashes ready.txt\nwait 100\n", encoding="utf-8")
        screen = Screen()
        self.addCleanup(screen.close)
        editor = subprocess.Popen([NEPHOS, "edit", str(scene), "--size", "1280x800", "--script", str(script)], cwd=self.folder,
                                  env={**self.environment, "DISPLAY": screen.display}, stderr=subprocess.PIPE, text=True)
        self.wait_for(self.folder / "ready.txt", editor)
        x11 = ctypes.CDLL("libX11.so.6")
        x11.XOpenDisplay.restype = ctypes.c_void_p
        display = ctypes.c_void_p(x11.XOpenDisplay(screen.display.encode()))
        x11.XDefaultRootWindow.restype = ctypes.c_ulong
        root, parent, windows, count = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.POINTER(ctypes.c_ulong)(), ctypes.c_uint()
        x11.XQueryTree(display, ctypes.c_ulong(x11.XDefaultRootWindow(display)), ctypes.byref(root), ctypes.byref(parent),
                       ctypes.byref(windows), ctypes.byref(count))
        for n in range(count.value):
            x11.XDestroyWindow(display, ctypes.c_ulong(windows[n]))
        x11.XCloseDisplay(display)
        _, said = editor.communicate(timeout=PATIENCE)
        self.assertEqual(editor.returncode, 4, said)
        self.assertIn("the display is gone; unsaved edits are kept", said)
        self.assertIn("elevation_deg = 21", (self.folder / ".models.toml.autosave").read_text(encoding="utf-8"))

    def test_what_is_being_typed_is_kept(self):
        """In a field that still has the caret: every five seconds, and by a signal."""
        scene = self.folder / "t.toml"
        text = 'name = "models"\nseed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n'
        scene.write_text(text, encoding="utf-8")
        for key, typed, kept in (("name", "xyz", text.replace("models", "modelsxyz")), ("seed", "56", text.replace("= 4", "= 456")),
                                 ("seed", "x", text.replace("= 4", '= "4x"'))):
            for end in (signal.SIGTERM, signal.SIGKILL):
                script = f"wait-step 1\nclick scene\nwait 0.2\nclick {key}\nkey END\ntype {typed}\nwait 0.3\n"
                self.assertEqual(self.keep_by_signal(scene, script, end), kept)

    def test_a_recorded_number_that_is_being_typed_is_kept(self):
        """As the key frame that it is about to be; and a name with those that use it."""
        scene = self.folder / "w.toml"
        scene.write_text(WIND, encoding="utf-8")
        typed = RECORD_WIND + "double-click-at wind[0].levels[0].speed_m_per_s 0.5 0.5\nkey CTRL+A\ntype 12.5\nwait 0.3\n"
        for end in (signal.SIGTERM, signal.SIGKILL):
            first, *_, last = tomllib.loads(self.keep_by_signal(scene, typed, end))["wind"]
            self.assertGreater(last["time_s"], first.get("time_s", 0))
            level, = last["levels"]
            self.assertAlmostEqual((level["east_m_per_s"] ** 2 + level["north_m_per_s"] ** 2) ** 0.5, 12.5, 3)
        kept = self.keep_by_signal(self.models(), "wait-step 1\nclick model\nclick model[0]\nclick \"tab Properties\"\nwait 0.3\n"
                                   "click model[0].name\nkey END\ntype xyz\nwait 0.3\n")
        self.assertEqual(kept, MODELS.replace('"bank"', '"bankxyz"'))

    def test_a_number_of_another_program_stays(self):
        """Where the caret stands in its field, and nothing was typed."""
        scene = self.folder / "n.toml"
        text = 'seed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n'
        for leave in ("key ESCAPE\n", "click scene\n", "key ENTER\n", ""):
            scene.write_text(text, encoding="utf-8")
            editor = subprocess.Popen(
                self.command(scene, script='wait-step 1\nclick lattice\nclick "tab Properties"\nwait 0.2\ndouble-click-at lattice.cell_size_m 0.5 0.5\n'
                                           f"wait 0.3\nhashes ready.txt\nwait 3\n{leave}wait 0.3\nkey CTRL+S\nwait 0.5\n"),
                cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
            self.wait_for(self.folder / "ready.txt", editor)
            (self.folder / "new").write_text(text.replace("= 100", "= 150"), encoding="utf-8")
            os.replace(self.folder / "new", scene)
            said = editor.communicate(timeout=PATIENCE)[1]
            self.assertEqual((editor.returncode, scene.read_text(encoding="utf-8")), (0, text.replace("= 100", "= 150")), leave + said)
            (self.folder / "ready.txt").unlink()

    def test_what_is_recorded_is_of_the_scene_that_another_program_wrote(self):
        """While a wind or a sun is typed: its key frame joins those of the new text, and the window shows that scene's bits."""
        scene = self.folder / "w.toml"
        sun = 'seed = 4\n[lattice]\ncells = [16, 16, 12]\n[sun]\nelevation_deg = 40\npath = [{ time_s = 0, elevation_deg = 10, azimuth_deg = 90 }, { time_s = 200, elevation_deg = 20, azimuth_deg = 90 }]\n'
        wind = "double-click-at wind[0].levels[0].speed_m_per_s 0.5 0.5\nkey CTRL+A\ntype 12.5\n"
        start = 'wait 0.3\nkey SPACE\nkey HOME\nwait 0.3\nkey .\nkey .\nwait 0.4\n'
        for text, new, typed in ((WIND, WIND.replace("[16, 16, 12]", "[24, 20, 14]"), RECORD_WIND + wind),
                                 (sun, sun.replace("{ time_s = 200", "{ time_s = 70, elevation_deg = 15, azimuth_deg = 95 }, { time_s = 200"),
                                  f"{start}click sun\nclick \"tab Properties\"\nwait 0.3\ndouble-click-at sun.azimuth_deg 0.5 0.5\nkey CTRL+A\ntype 100\n")):
            scene.write_text(text, encoding="utf-8")
            editor = subprocess.Popen(self.command(scene, script=f"{typed}wait 0.3\nhashes ready.txt\nwait 3\nkey ENTER\nwait 0.3\nkey .\nkey .\nwait 0.5\n"
                                                   "hashes after.txt\nkey CTRL+S\nwait 0.5\n"),
                                      cwd=self.folder, env=self.environment, stderr=subprocess.PIPE, text=True)
            self.wait_for(self.folder / "ready.txt", editor)
            (self.folder / "new").write_text(new, encoding="utf-8")
            os.replace(self.folder / "new", scene)
            said = editor.communicate(timeout=PATIENCE)[1]
            self.assertEqual(editor.returncode, 0, said)
            saved = tomllib.loads(scene.read_text(encoding="utf-8"))
            if text == sun:
                self.assertEqual([key["elevation_deg"] for key in saved["sun"]["path"] if key["time_s"] in (0, 70, 200)], [10, 15, 20])
                self.assertEqual([key["azimuth_deg"] for key in saved["sun"]["path"] if key["time_s"] not in (0, 70, 200)], [100])
                done = subprocess.run([NEPHOS, "validate", scene], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stderr + scene.read_text())
            else:
                self.assertEqual((saved["lattice"]["cells"], len(saved["wind"]) > 1), ([24, 20, 14], True))
                shown = (self.folder / "after.txt").read_text().split()
                hashes = subprocess.run([NEPHOS, "hash", scene, "--steps", "12"], capture_output=True, text=True).stdout
                self.assertIn(shown[-1], hashes)
            (self.folder / "ready.txt").unlink()

    def test_a_recorded_sun_may_be_that_of_its_key(self):
        """The key frames hold, and not the key: setting its value is a change. Setting what is shown is none."""
        scene = self.folder / "w.toml"
        text = 'seed = 4\n[lattice]\ncells = [16, 16, 12]\n[sun]\nelevation_deg = 40\npath = [{ time_s = 0, elevation_deg = 10, azimuth_deg = 90 }]\n'
        for typed, elevations in (("40", [10, 40]), ("10", [10])):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script="wait 0.3\nkey SPACE\nkey HOME\nwait 0.3\nkey .\nkey .\nwait 0.4\nclick sun\nclick \"tab Properties\"\nwait 0.3\n"
                                    f"set sun.elevation_deg {typed}\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
            saved = tomllib.loads(scene.read_text(encoding="utf-8"))
            self.assertEqual([key["elevation_deg"] for key in saved["sun"]["path"]], elevations)

    def test_a_handle_that_goes_out_of_sight_is_let_go(self):
        """Behind the camera, by a quick drag: what is chosen next stays where it is."""
        scene = self.folder / "h.toml"
        second = "  { centre_m = [700, 1700, 900], semi_axes_m = [50, 60, 70] }, # second\n"
        scene.write_text("seed = 4\n[lattice]\ncells = [32, 32, 24]\ncell_size_m = 100\n[camera]\nposition_m = [0, -1500, 2000]\n"
                         "target_m = [0, 3000, 1200]\n[field]\nellipsoids = [\n  { centre_m = [0, 9000, 1200], semi_axes_m = [3330, 2440, 222] }, # first\n"
                         f"{second}]\n", encoding="utf-8")
        self.edit(scene, script="wait-step 1\nkey SPACE\nwait 0.2\nclick field\nclick field.ellipsoids\nclick field.ellipsoids[0]\nwait 0.3\n"
                                'drag "handle move north" 0 500\nwait 0.5\nclick field.ellipsoids[1]\nwait 0.3\nkey CTRL+S\nwait 0.5\n')
        saved = scene.read_text(encoding="utf-8")
        self.assertIn(second, saved)
        self.assertNotIn("[0, 9000, 1200]", saved)

    def test_looking_into_a_field_of_a_moving_sun_records_nothing(self):
        """While it moves, and a field of a number has the caret. A key frame that is added leaves the others as they are written."""
        scene = self.folder / "m.toml"
        text = ("seed = 4\n[lattice]\ncells = [16, 16, 12]\n[sun]\nelevation_deg = 40\nazimuth_deg = 200\ncolour = [0.9, 0.8, 0.7]\n"
                "[[sun.path]] # first\ntime_s = 0\nelevation_deg = 4.00e1\nazimuth_deg = 200\ncolour = [0.1, 0.2, 0.3]\n"
                "[[sun.path]] # late\ntime_s = 90_000 # b\nelevation_deg = 1.00e1 # mine\nazimuth_deg = 300\ncolour = [0.9, 0.8, 0.7]\n# the end\n")
        for leave in ("key ENTER", "click scene", "key TAB"):
            scene.write_text(text, encoding="utf-8")
            self.edit(scene, script='wait-step 2\nclick sun\nclick "tab Properties"\nwait 0.3\ndouble-click-at sun.colour[0] 0.5 0.5\nwait 1.5\n'
                                    f"{leave}\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
            self.assertEqual(scene.read_text(encoding="utf-8"), text, leave)
        self.edit(scene, script='wait-step 2\nkey SPACE\nclick sun\nclick "tab Properties"\nwait 0.3\nset sun.elevation_deg 33\nwait 0.3\nkey CTRL+S\nwait 0.5\n')
        saved = scene.read_text(encoding="utf-8")
        self.assertEqual([key["elevation_deg"] for key in tomllib.loads(saved)["sun"]["path"]], [40, 33, 10])
        self.assertTrue(saved.startswith(text[:text.index("[[sun.path]] # late")]), saved)
        self.assertTrue(saved.endswith(text[text.index("[[sun.path]] # late"):]), saved)

    def test_a_click_on_a_handle_changes_nothing(self):
        """Nor does a drag while the text has a problem, whose scene is that of an earlier one."""
        scene = self.folder / "h.toml"
        text = ('seed = 4\n[lattice]\ncells = [32, 32, 24]\ncell_size_m = 100\n[field]\nellipsoids = [{ centre_m = [0.123456, 0.654321, 1200.5], '
                "semi_axes_m = [333.25, 444.5, 222.125], yaw_deg = 270.25 }]\n")
        select = "wait-step 1\nclick field\nclick field.ellipsoids\nclick field.ellipsoids[0]\nwait 0.3\nkey F\nwait 0.5\n"
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script=select + "".join(f'click "handle {name}"\nwait 0.2\n' for name in ("move east", "turn", "size x")) + "key CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), text)
        scene.write_text(text.replace("seed = 4", "seed = -4"), encoding="utf-8")
        said = self.edit(scene, script=select.replace("wait-step 1", "wait 1") + 'drag "handle move east" 40 0\n', status=1)
        self.assertIn("no control 'handle move east'", said)

    def test_a_pasted_comma_is_a_point(self):
        """Also one that is typed right behind Tab."""
        scene = self.folder / "k.toml"
        text = 'seed = 4\n[lattice]\ncells = [16, 16, 12]\norigin_m = [0, 0, 0]\n'
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script='wait-step 1\nclick lattice\nclick "tab Properties"\nwait 0.2\nclick find\ntype 12,5\nkey CTRL+A\nkey CTRL+X\nwait 0.3\n'
                                "double-click-at lattice.origin_m[0] 0.5 0.5\nkey CTRL+A\nkey CTRL+V\nwait 0.2\nkey TAB\ntype 7,25\nwait 0.2\n"
                                "key ENTER\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("[0, 0, 0]", "[12.5, 7.25, 0]"))

    def test_an_end_waits_for_what_is_refused(self):
        """Once, so that it is seen; the second one ends the editor."""
        scene = self.folder / "q.toml"
        scene.write_text('seed = 4\n[lattice]\ncells = [16, 16, 12]\n', encoding="utf-8")
        typed = 'wait-step 1\nclick scene\nclick "tab Properties"\nwait 0.2\nclick seed\nkey END\ntype x\nwait 0.2\n'
        self.edit(scene, script=f"{typed}key CTRL+Q\nwait 0.5\nexpect-control refusal\nwait 1\nkey CTRL+Q\nwait 0.5\nexpect-end\n")
        self.assertIn("waited too long for the end", self.edit(scene, script=f"{typed}key CTRL+Q\nwait 0.5\nexpect-end\n", status=1))

    def test_a_comma_is_a_point(self):
        scene = self.folder / "k.toml"
        text = 'seed = 4\n[lattice]\ncells = [16, 16, 12]\ncell_size_m = 100\n'
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script='wait-step 1\nclick lattice\nclick "tab Properties"\nwait 0.2\ndouble-click-at lattice.cell_size_m 0.5 0.5\n'
                                "key CTRL+A\ntype 12,5\nwait 0.2\nkey ENTER\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), text.replace("= 100", "= 12.5"))

    def test_a_window_too_small_for_a_field_takes_no_text_away(self):
        """What is typed when the panel is drawn no more counts as if the field had been left; a name is followed by its users."""
        for select, key, size in (("click scene", "name", "300 300"), ("click model\nclick model[0]", "model[0].name", "300 800"),
                                  ("click scene", "name", "1280 60")):
            scene = self.models()
            self.edit(scene, script=f"wait-step 1\n{select}\nclick \"tab Properties\"\nwait 0.2\nclick {key}\nkey END\ntype xyz\nwait 0.2\n"
                                    f"resize {size}\nwait 0.5\nkey CTRL+S\nwait 0.5\n")
            name = "models" if key == "name" else "bank"
            self.assertEqual(scene.read_text(encoding="utf-8"), MODELS.replace(f'"{name}"', f'"{name}xyz"'), size)

    def test_a_file_that_another_program_changed(self):
        """Saving over what another program wrote meanwhile asks first; going back leaves the file as it is."""
        scene = self.models()
        script = """
            wait-step 1
            click sun
            set sun.elevation_deg 21
            wait 0.3
            hashes ready.txt
            wait 2
            key CTRL+S
            wait 0.5
            expect-control "Overwrite it"
            click "{}"
            wait 0.5
            quit
            """
        for answer, expected in (("Go back", "seed = 77\n"), ("Overwrite it", "elevation_deg = 21")):
            scene.write_text(MODELS, encoding="utf-8")
            ready = self.folder / "ready.txt"
            ready.unlink(missing_ok=True)
            program = subprocess.Popen(self.command(scene, script=script.format(answer)), cwd=self.folder,
                                       env=self.environment, stderr=subprocess.PIPE, text=True)
            self.wait_for(ready, program)
            time.sleep(0.1)
            scene.write_text("seed = 77\n", encoding="utf-8")
            errors = program.communicate(timeout=PATIENCE)[1]
            self.assertEqual(program.returncode, 0, errors)
            self.assertIn(expected, scene.read_text(encoding="utf-8"))


class Problems(Kept):
    """While the text has problems the scene is that of an earlier one: nothing is done to elements that stand elsewhere now, nor
    with values that the text does not have."""

    PROBLEM = 'click field\nclick "new field.grids"\nwait 0.5\nexpect-control problems\n'
    MENDED = "click field.grids\nclick field.grids[0]\nkey DELETE\nwait 0.5\n"
    AT_STEP_3 = "wait 0.5\nkey SPACE\nkey HOME\nkey .\nkey .\nkey .\nwait 0.5\n"
    HEAD = "seed = 4\n[lattice]\ncells = [16, 16, 12]\n[time]\nstep_s = 2\nsteps = 40\n"
    SUN = HEAD + ("[sun]\nelevation_deg = 40\nazimuth_deg = 200\ncolour = [0.1, 0.2, 0.3]\n"
                  "[[sun.path]] # first\ntime_s = 0\nelevation_deg = 40\nazimuth_deg = 200\n"
                  "[[sun.path]] # second\ntime_s = 20\nelevation_deg = 39.0\nazimuth_deg = 200\ncolour = [0.9, 0.8, 0.7]\n")

    def saved(self, text, script, **options):
        scene = self.folder / "p.toml"
        scene.write_text(text, encoding="utf-8")
        (self.folder / ".p.toml.autosave").unlink(missing_ok=True)  # of one that failed
        said = self.edit(scene, script=self.AT_STEP_3 + script + "key CTRL+S\nwait 0.5\n" * (not options), **options)
        return said if options else scene.read_text(encoding="utf-8")

    def test_there_are_no_marks_and_no_clouds(self):
        wind = "".join(f"[[wind]]\ntime_s = {time}\nlevels = [{{ height_m = 1000, from_deg = 250, speed_m_per_s = 5 }}]\n" for time in (0, 20, 50))
        for text, section in ((self.HEAD + wind, "wind"), (self.SUN, "sun")):
            mark = "wind[1]" if section == "wind" else "sun.path[1]"
            said = self.saved(text, f'expect-control "key frame {mark}"\n{self.PROBLEM}click "key frame {mark}"\n', status=1)
            self.assertIn(f"no control 'key frame {mark}'", said)
        models = self.HEAD + "".join(f'[[model]]\nname = "{name}"\nseeds = [{{ position_m = [0, 0, 200], size_m = [111, 112, 113] }}]\n' for name in "abc")
        choose = 'click model\nclick model[0]\nclick "tab Properties"\nwait 0.4\n'
        said = self.saved(models + '[[sky]]\nname = "fair"\nstate = 0\nclouds = 3\nmodels = ["a"]\n'
                          '[[layer]]\nname = "low"\nskies = ["fair"]\nbase_height_m = 1000\n',
                          f'{choose}expect-control "20 at once"\n{self.PROBLEM}{choose}click "20 at once"\n', status=1)
        self.assertIn("no control '20 at once'", said)

    def test_keys_of_a_moving_sun_are_those_of_the_text(self):
        typed = 'click sun\nclick "tab Properties"\nwait 0.3\ndouble-click-at sun.colour[1] 0.5 0.5\nkey CTRL+A\ntype 0,25\nkey ENTER\nwait 0.4\n'
        self.assertEqual(self.saved(self.SUN, self.PROBLEM + typed + self.MENDED), self.SUN.replace("[0.1, 0.2, 0.3]", "[0.1, 0.25, 0.3]"))
        # The dial, which shows the sun of the earlier text, moves nothing and says so.
        self.assertEqual(self.saved(self.SUN, self.PROBLEM + 'click sun\nclick "tab Properties"\nwait 0.3\ndrag "sun dial" 20 10\nwait 0.1\n'
                                    "expect-control refusal\n" + self.MENDED), self.SUN)

    def test_nothing_is_recorded(self):
        """It would hold from the first step on. What is typed is told, and an autosave has it."""
        record = 'click "tab View"\nclick "Record as key frames"\n'
        typed = ('click wind\nclick wind[0]\nclick wind[0].levels\nclick wind[0].levels[0]\nclick "tab Properties"\nwait 0.3\n'
                 "double-click-at wind[0].levels[0].speed_m_per_s 0.5 0.5\nkey CTRL+A\ntype 12.5\nwait 0.3\n")
        text = self.HEAD + WIND[WIND.index("[[wind]]"):]
        self.assertEqual(self.saved(text, record + self.PROBLEM + typed + "key ENTER\nwait 0.1\nexpect-control refusal\n" + self.MENDED), text)

    def test_what_a_signal_keeps_is_what_enter_records(self):
        scene = self.folder / "w.toml"
        typed = self.AT_STEP_3 + ('click "tab View"\nclick "Record as key frames"\nclick wind\nclick wind[0]\nclick wind[0].levels\n'
                 'click wind[0].levels[0]\nclick "tab Properties"\nwait 0.3\ndouble-click-at wind[0].levels[0].speed_m_per_s 0.5 0.5\n'
                 "key CTRL+A\ntype 12.5\nwait 0.3\n")
        text = self.HEAD + "# mine\n" + WIND[WIND.index("[[wind]]"):]
        scene.write_text(text, encoding="utf-8")
        kept = self.keep_by_signal(scene, typed, signal.SIGTERM)
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script=typed + "key ENTER\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), kept)
        self.assertTrue(kept.startswith(text), "the key frame that stays, and what its author wrote beside it\n" + kept)

    LEVELS = HEAD + "".join(f"[[wind]] # {name}\ntime_s = {time}\n[[wind.levels]] # low\nheight_m = 1000\nfrom_deg = 250\nspeed_m_per_s = {speed}\n"
                            for name, time, speed in (("a", 0, 5), ("b", 10, 6), ("c", 60, 7)))

    def test_levels_that_are_sections_are_recorded(self):
        """At the step of a key frame: it changes, the one before keeps its text; and a signal keeps the same."""
        scene = self.folder / "w.toml"
        typed = self.AT_STEP_3 + ('click "tab View"\nclick "Record as key frames"\nclick wind\nclick wind[1]\nclick wind[1].levels\n'
                 'click wind[1].levels[0]\nclick "tab Properties"\nwait 0.3\ndouble-click-at wind[1].levels[0].speed_m_per_s 0.5 0.5\n'
                 "key CTRL+A\ntype 12.5\nwait 0.3\n")
        scene.write_text(self.LEVELS, encoding="utf-8")
        kept = self.keep_by_signal(scene, typed, signal.SIGTERM)
        self.edit(scene, script=typed + "key ENTER\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
        self.assertEqual(scene.read_text(encoding="utf-8"), kept)
        self.assertTrue(kept.startswith(self.LEVELS[:self.LEVELS.index("[[wind]] # b")]), kept)
        last = tomllib.loads(kept)["wind"][-1]
        self.assertEqual(last["time_s"], 10)
        level, = last["levels"]
        self.assertAlmostEqual((level["east_m_per_s"] ** 2 + level["north_m_per_s"] ** 2) ** 0.5, 12.5, 3)

    def test_a_wind_has_one_form(self):
        """The fields of the other form show the same wind, and setting one of them changes the level to that form."""
        choose = 'click wind\nclick wind[0]\nclick wind[0].levels\nclick wind[0].levels[0]\nclick "tab Properties"\nwait 0.3\n'
        text = self.HEAD + "[[wind]]\nlevels = [{ height_m = 1000, east_m_per_s = 3, north_m_per_s = 4 }] # mine\n"
        level = "wind[0].levels[0]"
        for key, value, wanted in (("speed_m_per_s", "14", "from_deg = 216.8698976, speed_m_per_s = 14"), ("from_deg", "270", "from_deg = 270, speed_m_per_s = 5"),
                                   ("east_m_per_s", "5", "east_m_per_s = 5, north_m_per_s = 4")):
            saved = self.saved(text, f"{choose}set {level}.{key} {value}\nwait 0.3\n")
            self.assertEqual(saved, text.replace("east_m_per_s = 3, north_m_per_s = 4", wanted))
        polar = text.replace("east_m_per_s = 3, north_m_per_s = 4", "from_deg = 270, speed_m_per_s = 5")
        for key, value, wanted in (("north_m_per_s", "2", "east_m_per_s = 5, north_m_per_s = 2"), ("east_m_per_s", "3", "east_m_per_s = 3, north_m_per_s = 0")):
            self.assertEqual(self.saved(polar, f"{choose}set {level}.{key} {value}\nwait 0.3\n"),
                             text.replace("east_m_per_s = 3, north_m_per_s = 4", wanted))

    def test_a_change_of_the_climate_leaves_what_was_before(self):
        scene = self.folder / "c.toml"
        schedule = "schedule = [ # states\n  { time_s = 0, state = 0 }, # of 06:00\n  { time_s = 2, state = 0.25 }, # of 07:00\n] # end\n"
        text = self.HEAD + f"[climate]\n{schedule}" + MODELS[MODELS.index("[[model]]"):]
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script=self.AT_STEP_3 + 'click "tab View"\nwait 0.2\nclick "Start the change now"\nwait 0.5\nkey CTRL+S\nwait 0.5\n')
        saved = scene.read_text(encoding="utf-8")
        self.assertIn(schedule[:schedule.index("\n] # end")], saved)
        self.assertGreater(len(tomllib.loads(saved)["climate"]["schedule"]), 2)
        done = subprocess.run([NEPHOS, "validate", scene], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr + saved)

    def test_a_first_key_frame_leaves_the_others(self):
        """At the time of one that is there only its numbers change; one before the first comes in front of it."""
        at_start = 'click sun\nclick "tab Properties"\nwait 0.3\nkey HOME\nwait 0.4\n'
        self.assertEqual(self.saved(self.SUN, at_start + "set sun.elevation_deg 33\nwait 0.3\n"),
                         self.SUN.replace("time_s = 0\nelevation_deg = 40", "time_s = 0\nelevation_deg = 33"))
        late = self.SUN.replace("time_s = 0", "time_s = 10").replace("[[sun.path]] # first", "# the first\n[[sun.path]] # first")
        saved = self.saved(late, at_start + "set sun.elevation_deg 33\nwait 0.3\n")
        begin = late.index("# the first")
        self.assertEqual((saved[:begin], saved[-len(late[begin:]):]), (late[:begin], late[begin:]))
        self.assertEqual([(key["time_s"], key["elevation_deg"]) for key in tomllib.loads(saved)["sun"]["path"]], [(0, 33), (10, 40), (20, 39)])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[1:]], verbosity=2)
