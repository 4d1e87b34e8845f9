# SPDX-License-Identifier: Apache-2.0
"""What the tests of edits share: scenes, and how edits are kept."""

import signal
import subprocess
import time

from case import PATIENCE, Case

MODELS = """name = "models"
seed = 4
[[model]]
name = "bank"
light_distance_m = 900
seeds = [{ size_m = [700, 600, 300], billboards = [4, 8], billboard_width_m = [200, 400], billboard_height_m = [150, 250], \
texture = "dense", roots = [{ pitch_deg = 30, open_yaw_deg = 360, seeds_start = 3, seeds_end = 2, reproductions = [1, 2] }] }]
[[sky]]
name = "few"
state = 0
clouds = 3
models = "bank"
[[layer]]
name = "low"
skies = "few"
automaton = false
base_height_m = 1000
lattice = { cells = [32, 32, 8], cell_size_m = 80, origin_m = [-1280, -1280, 900] }
"""

WIND = """name = "w"
[lattice]
cells = [16, 16, 12]
[[wind]]
levels = [{ height_m = 1000, from_deg = 250, speed_m_per_s = 7.5 }] # low
"""
RECORD_WIND = """wait 0.3
key SPACE
key HOME
wait 0.3
key .
key .
wait 0.4
click "tab View"
click "Record as key frames"
click wind
click wind[0]
click wind[0].levels
click wind[0].levels[0]
wait 0.3
"""


class Kept(Case):
    """What the tests of edits share."""

    def models(self):
        path = self.folder / "models.toml"
        path.write_text(MODELS, encoding="utf-8")
        return path

    def type_in_first_line(self, scene, text):
        """Puts the caret at its end in the Text tab, types, and saves."""
        typed = f"type {text}" if text else ""
        self.edit(scene, script=f"""
            wait 1
            click tab Text
            wait 0.3
            click-at text 0.6 0.02
            wait 0.5
            key END
            {typed}
            wait 0.5
            click tab View
            wait 0.5
            key CTRL+S
            wait 0.5
            """)

    def keep_by_signal(self, scene, script, end=signal.SIGTERM):
        """What is kept of the edits of such a script when a signal ends the editor."""
        ready, autosave = self.folder / "ready.txt", scene.parent / f".{scene.name}.autosave"
        editor = subprocess.Popen(self.command(scene, script=script + "hashes ready.txt\nwait 100\n"), cwd=self.folder,
                                  env=self.environment, stderr=subprocess.PIPE, text=True)
        self.wait_for(ready, editor)
        if end == signal.SIGKILL:
            self.wait_for(autosave, editor)
        editor.send_signal(end)
        editor.communicate(timeout=PATIENCE)
        kept = autosave.read_text(encoding="utf-8")
        autosave.unlink()
        ready.unlink()
        return kept

    def wait_for(self, path, program):
        for _ in range(1200):
            if path.exists() and path.stat().st_size > 0:  # its name may be claimed before it is written
                return
            self.assertIsNone(program.poll(), "it ended")
            time.sleep(0.1)
        program.kill()
        self.fail(f"no {path} after two minutes")

    def is_our_editor(self, pid, script="script.txt"):
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                words = file.read().split(b"\0")
        except OSError:
            return False
        return words[0].endswith(b"nephos-editor") and str(self.folder / script).encode() in words
