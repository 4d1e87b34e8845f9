# SPDX-License-Identifier: Apache-2.0
"""`nephos export --for blender` in Blender, without a window. Exits with 77, which the test suite counts as skipped,
where there is no Blender (packages.txt, group blender)."""

import re
import shutil
import subprocess
import sys
import unittest

from case import PATIENCE, SCENE, Case

IMPORT = """
import bpy, sys
folder, count = sys.argv[-2], int(sys.argv[-1])
bpy.ops.object.volume_import(directory=folder, files=[{"name": "windy_%04d.vdb" % n} for n in range(1, count + 1)],
                             use_sequence_detection=True)
volume = bpy.context.object.data
volume.grids.load()
print("FOUND", [g.name for g in volume.grids], volume.is_sequence, volume.frame_duration, volume.frame_start, volume.velocity_grid)
print("PLACE", *bpy.context.object.location, *(volume.grids[0].matrix_object[row][3] for row in range(3)), volume.grids[0].matrix_object[0][0])
"""


class Blender(Case):
    def test_grids_sequence_and_place(self):
        scene = self.write("windy.toml", SCENE + "[[wind]]\nlevels = [{ height_m = 0, from_deg = 270, speed_m_per_s = 7 }]\n")
        self.call("run", scene, "--no-render", "--out", "run", "--set", "lattice.origin_m=[1000, -2000, 300]", "--set", "lattice.cell_size_m=40")
        self.call("export", "run", "--for", "blender", "-o", "blender")
        script = self.write("import.py", IMPORT)
        said = subprocess.run(["blender", "--background", "--factory-startup", "--python", script, "--", str(self.folder / "blender") + "/", "5"],
                              capture_output=True, text=True, timeout=PATIENCE).stdout
        self.assertIn("FOUND ['density', 'velocity'] True 5 1 velocity", said)
        place = [float(number) for number in re.search(r"PLACE (.*)", said)[1].split()]
        # The centre of the first voxel, moved by half a voxel: the corner of the box.
        self.assertEqual(place, [0, 0, 0, 1000, -2000, 300, 40])


if __name__ == "__main__":
    if shutil.which("blender") is None:
        print("there is no Blender: not run")
        sys.exit(77)
    unittest.main(verbosity=2)
