# SPDX-License-Identifier: Apache-2.0
"""Exports and reports in parsers of others that run in Node: ktx-parse, tinyusdz, metar-taf-parser (tests/vendor)."""

import json
import pathlib
import subprocess
import unittest

from case import Case, SOURCE
from metar_test import REAL, generated
from verify_test import PLACED

SCRIPTS = SOURCE / "tests/apps/command/clients"
FORECASTS = [
    "TAF EGLL 211100Z 2112/2218 24012KT 9999 FEW020 SCT045 BECMG 2115/2118 BKN030 TEMPO 2118/2122 4000 RA BKN012",
    "TAF LFPG 212300Z 2200/2306 09008KT CAVOK FM220800 18015G25KT 8000 -RA OVC015 BECMG 2214/2216 27010KT 9999 NSW SCT030",
]


def node(script, *arguments, given=None):
    return subprocess.run(["node", SCRIPTS / script, *arguments], input=given, capture_output=True, text=True)


class Formats(Case):
    def setUp(self):
        super().setUp()
        self.call("run", self.write("placed.toml", PLACED), "--no-render", "--out", "run")

    def test_ktx_parse_reads_every_type(self):
        # VkFormat, bytes of a voxel, and of BC4 of a block of 4 x 4; model of the data format descriptor.
        for kind, number, block, size, model in (("r8", 9, 1, 1, 1), ("r16f", 76, 1, 2, 1), ("r32f", 100, 1, 4, 1), ("bc4", 139, 4, 8, 131)):
            with self.subTest(type=kind):
                folder = f"ktx-{kind}"
                self.call("export", "run", "--to", "ktx2", "--to", "raw", "--type", kind, "--border", "zero", "-o", folder)
                path = self.folder / folder / "placed_0002.ktx2"
                said = node("read_ktx2.mjs", path)
                self.assertEqual(said.returncode, 0, said.stderr)
                found = json.loads(said.stdout)
                sidecar = json.loads((self.folder / folder / "placed.volume.json").read_text())
                self.assertEqual((found["vkFormat"], found["layers"], found["faces"], found["supercompression"]), (number, 0, 1, 0))
                self.assertEqual(found["size"], sidecar["size"])
                x, y, z = sidecar["size"]
                voxels = (self.folder / folder / "placed_0002.raw").read_bytes()
                self.assertEqual(len(voxels), -(-x // block) * -(-y // block) * z * size)
                self.assertEqual(found["levels"], [[len(voxels)] * 2])
                self.assertEqual(bytes(found["first"]), voxels[:4096])
                self.assertEqual(found["model"], model)
                self.assertEqual(found["texelBlock"][:2], [block - 1] * 2)
                self.assertEqual(found["bytesPlane"][0], size)
                self.assertEqual(found["keys"]["KTXorientation"].rstrip("\0"), "ruo")
                own = json.loads(found["keys"]["nephos"].rstrip("\0"))
                self.assertEqual((own["size"], own["min_m"], own["extinction_per_m"]),
                                 (sidecar["size"], sidecar["min_m"], sidecar["extinction_per_m"]))
                path.write_bytes(path.read_bytes()[:-len(voxels) // 2])
                self.assertNotEqual(node("read_ktx2.mjs", path).stdout.startswith("{") and
                                    json.loads(node("read_ktx2.mjs", path).stdout)["levels"], [[len(voxels)] * 2])

    def test_tinyusdz_parses_usda(self):
        self.call("export", "run", "--for", "omniverse", "-o", "usd")
        path = self.folder / "usd/placed.usda"
        said = node("parse_usda.mjs", path)
        self.assertEqual((said.returncode, said.stdout.strip()), (0, "parsed"), said.stderr)
        text = path.read_text()
        for broken in (text[:len(text) // 2], text.replace("token fieldName = ", "token fieldName ", 1)):
            path.write_text(broken)
            said = node("parse_usda.mjs", path)
            self.assertEqual(said.returncode, 1)
            self.assertIn("line", said.stderr)


class Reports(Case):
    def decoded(self, reports):
        said = node("decode_metar.mjs", given="\n".join(reports))
        self.assertEqual(said.returncode, 0, said.stderr)
        found = [json.loads(line) for line in said.stdout.splitlines()]
        self.assertEqual(len(found), len(reports))
        return found

    def check_clouds(self, report, theirs, layers):
        """Amount, height and type of each group that becomes a layer."""
        expected = sorted((cloud["height"], cloud["quantity"] + f"{cloud['height'] // 100:03}" + cloud.get("type", ""))
                          for cloud in theirs.get("clouds", []) if cloud.get("height") is not None and cloud["quantity"] in ("FEW", "SCT", "BKN", "OVC"))
        self.assertEqual([layer["group"] for layer in layers], [group for _, group in expected], report)
        for layer, (height, _) in zip(layers, expected):
            self.assertAlmostEqual(layer["base_m"], max(30, height * 0.3048), delta=0.01, msg=report)

    def test_metar_taf_parser_agrees_on_300_reports(self):
        reports = list(generated(300))
        for report, theirs in zip(reports, self.decoded(reports)):
            self.assertNotIn("error", theirs, report)
            ours = json.loads(self.call("metar", report, "--explain", "--json").stdout)
            self.check_clouds(report, theirs, ours["layers"])
            self.assertEqual(f"{theirs['wind']['degrees']:03}{theirs['wind']['speed']:02}", report.split()[2][:5], report)

    def test_real_reports_and_those_written_back(self):
        for report, theirs in zip(REAL, self.decoded([report.rstrip("=").removeprefix("METAR ") for report in REAL])):
            if "error" in theirs or "VV" in report or "CB///" in report:
                continue  # the parser leaves out a group of which it does not know what stands for a height
            self.check_clouds(report, theirs, json.loads(self.call("metar", report, "--explain", "--json").stdout)["layers"])
        report = "EDDM 211200Z 31015KT 9999 SCT020 BKN040 12/04 Q1018"
        self.call("metar", report, "--run", "--no-render", "--out", "run", "-q")
        self.call("export", "run", "--to", "metar", "--frames", "1", "-o", "back")
        back = next((self.folder / "back").glob("*.metar.txt")).read_text().strip()
        theirs = self.decoded([back])[0]
        self.assertEqual([cloud["quantity"] for cloud in theirs["clouds"]], ["SCT", "BKN"], back)
        self.assertLessEqual(abs(theirs["wind"]["degrees"] - 310), 10, back)

    def test_forecasts(self):
        """Changes, their times and their clouds, as metar-taf-parser has them; the scene is sound."""
        for forecast, theirs in zip(FORECASTS, self.decoded(FORECASTS)):
            ours = json.loads(self.call("metar", forecast, "--explain", "--json").stdout)
            day, hour = theirs["validity"]["startDay"], theirs["validity"]["startHour"]
            changes = [trend for trend in theirs["trends"] if trend["type"] in ("BECMG", "FM")]
            self.assertEqual(len(ours["periods"]), 1 + len(changes), forecast)
            for period, trend in zip(ours["periods"][1:], changes):
                start = trend["validity"]
                begin_s = ((start["startDay"] - day) * 24 + start["startHour"] - hour) * 3600 + 60 * start.get("startMinutes", 0)
                self.assertAlmostEqual(period["from_s"], begin_s, delta=600, msg=forecast)
                groups = sorted(cloud["quantity"] + f"{cloud['height'] // 100:03}" for cloud in trend["clouds"] if "height" in cloud)
                for group in groups:
                    self.assertIn(group, period["layers"], forecast)
            self.call("metar", forecast, "-o", "taf.toml", "--overwrite", "--date", "2024-06", "--at", "51.5,-0.5,25", "-q")
            self.call("validate", "taf.toml")


if __name__ == "__main__":
    unittest.main(verbosity=2)
