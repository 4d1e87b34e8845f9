# SPDX-License-Identifier: Apache-2.0
"""The editor as a user has it, for the tests of this folder: the window under Xvfb with the software driver, moved by
scripts of clicks and keys. Environment: NEPHOS the command, SOURCE the source tree."""

import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from PIL import Image

NEPHOS = os.environ["NEPHOS"]
SOURCE = pathlib.Path(os.environ["SOURCE"])
# Seconds after which what takes a few is taken for hanging, also on a machine that does much else.
PATIENCE = 600


class Screen:
    """An X server of its own without a screen, at the first display that is free. xvfb-run is not used: where it cannot
    remove its folder, which happens, its status is 5 whatever the program's was."""

    def __init__(self, *arguments):
        read, write = os.pipe()
        self.server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1600x1000x24", "-noreset",
                                        "-nolisten", "tcp", *arguments], pass_fds=[write], stderr=subprocess.PIPE)
        os.close(write)
        with os.fdopen(read) as answer:
            number = answer.readline().strip()
        if not number:
            raise RuntimeError(self.server.communicate()[1].decode(errors="replace"))
        self.display = f":{number}"

    def close(self):
        self.server.terminate()
        self.server.communicate()


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos-editor-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.environment = {**os.environ, "XDG_CONFIG_HOME": str(self.folder / "config"), "VK_LOADER_LAYERS_ENABLE": ""}

    def command(self, *arguments, script=None, display=True, size="1280x800", server=(), patient=True):
        """The words of a call of the editor. `server`: more arguments of the X server. `patient`: the script gives up
        only after what is a hang on any machine."""
        command = [NEPHOS, "edit", *map(str, arguments)]
        if script is not None:
            path = self.folder / "script.txt"
            path.write_text(("patience 9\n" if patient else "") + script, encoding="utf-8")
            command += ["--script", str(path)]
        if display:
            command += ["--size", size] if size else []
            screen = Screen(*server)
            self.addCleanup(screen.close)
            command = ["env", f"DISPLAY={screen.display}", *command]
        return command

    def edit(self, *arguments, status=0, environment=None, timeout=PATIENCE, **call):
        """Runs the editor; returns what it printed. A hang ends it after `timeout` seconds."""
        done = subprocess.run(self.command(*arguments, patient=status != 1, **call), capture_output=True, text=True, timeout=timeout,
                              cwd=self.folder, env={**self.environment, **(environment or {})}, check=False)
        output = done.stdout + done.stderr
        self.assertEqual(done.returncode, status, output)
        return output

    def image(self, name, box=None):
        """A picture of the test's folder in grey, or a part of it."""
        with Image.open(self.folder / name) as image:
            return image.convert("L").crop(box or (0, 0, *image.size))

    def scene(self, name):
        """A copy of a shipped scene in the test's folder."""
        text = (SOURCE / "scenes" / name).read_text(encoding="utf-8")
        path = self.folder / pathlib.Path(name).name
        path.write_text(text, encoding="utf-8")
        return path
