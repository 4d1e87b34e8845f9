# SPDX-License-Identifier: Apache-2.0
"""`nephos metar`, summaries of layers, and the way from a report to clouds and back."""

import json
import random
import re
import subprocess
import unittest

from case import Case

REAL = [  # groups as real reports have them
    "EGLL 211350Z 24012KT 9999 FEW020 SCT045 BKN200 14/08 Q1017 NOSIG",
    "METAR KDEN 211353Z /////KT 10SM FEW080 SCT220 22/M02 A3012 RMK AO2 SLP117 T02221022",
    "LFPG 210500Z AUTO 14040G52KT 100V180 0350 R27L/0400 FG VV002 08/08 Q1021=",
    "EDDF 211320Z 28012 G25KT 9000 -SHRA FEW025CB/// SCT033TCU BKN048 12/09 Q1009 RETS BECMG 9999",
    "UUEE 211330Z 05003MPS 3000 -SN BR OVC006 M02/M03 Q0998 R24/490350",
    "YSSY 211300Z 20010KT CAVOK 21/12 Q1020 RMK RF00.0/000.0",
    "LIRF 211320Z AUTO VRB02KT 9999 NCD 18/12 Q1016",
    "ENGM 211320Z 00000KT //// // ////// 05/04 Q1010",
    "KJFK 211351Z 18015G22KT 1 1/2SM +RA BR BKN008 OVC015CB 18/17 A2975 RMK PK WND 18025/1340",
    "CYYZ 211400Z 27008KT 15SM SKC 10/02 A3002",
    "RJTT 211330Z 34008KT 9999 ///026/// 15/// Q////",
    "EKCH 211350Z 19009KT 9999 NSC 13/09 Q1014",
]


def generated(count):
    """Reports from the grammar of FM 15, always the same ones."""
    draw = random.Random(1)
    for _ in range(count):
        words = ["".join(draw.choice("ABCDEFGHIJKLMNOPQRSTUVWXYZ") for _ in range(4)),
                 f"{draw.randint(1, 28):02}{draw.randint(0, 23):02}{draw.randint(0, 59):02}Z"]
        speed = draw.randint(3, 30)
        words.append(f"{draw.randint(1, 36) * 10:03}{speed:02}" + (f"G{speed + 10:02}" if draw.random() < 0.2 else "") + "KT")
        if draw.random() < 0.1:
            words.append("CAVOK")
        else:
            visibility = draw.choice([500, 1200, 3000, 5000, 8000, 9999, 9999])
            words.append(f"{visibility:04}")
            weather = draw.choice(["", "", "-RA", "RA", "+RA", "-SN", "SHRA", "TSRA", "DZ", "BR", "FG"])
            words += [weather] if weather else []
            height = draw.randint(3, 20)
            for amount in sorted(draw.sample(range(4), draw.randint(1, 3))):
                words.append(("FEW", "SCT", "BKN", "OVC")[amount] + f"{height:03}")
                height += draw.randint(20, 60)
        words += [f"{draw.randint(5, 25):02}/{draw.randint(0, 4):02}", f"Q{draw.randint(980, 1035):04}"]
        yield " ".join(words)


class Metar(Case):
    def explained(self, report, *arguments):
        return json.loads(self.call("metar", report, "--explain", "--json", *arguments).stdout)

    def test_real_reports_are_read(self):
        for report in REAL:
            with self.subTest(report=report):
                groups = self.explained(report)["groups"]
                self.assertEqual(" ".join(g["group"] for g in groups), report.rstrip("="))
                fitted = json.loads(self.call("metar", report, "-o", "sky.toml", "--json").stdout)
                for layer in fitted["layers"]:
                    self.assertLessEqual(abs(layer["cover"] - layer["wanted"]), 0.5 / 8, layer)
                self.call("validate", "sky.toml")

    def test_layers(self):
        layers = {layer["group"]: layer for layer in self.explained(REAL[0])["layers"]}
        self.assertEqual([(g, layers[g]["genus"]) for g in layers], [("FEW020", "Cu"), ("SCT045", "Cu"), ("BKN200", "Cs")])
        self.assertAlmostEqual(layers["SCT045"]["base_m"], 4500 * 0.3048)
        self.assertEqual([layer["genus"] for layer in self.explained(REAL[3])["layers"]], ["Cb", "Cu", "Sc"])
        self.assertEqual([layer["genus"] for layer in self.explained("ENBR 211350Z 24012KT 9999 RA OVC010 08/07 Q0998")["layers"]], ["Ns"])

    def test_mistakes_have_a_caret(self):
        for report, word in (("EGLL 211350Z 24012KT 9999 FEWO20 14/08 Q1017", "FEWO20"), ("EGLL 321350Z 24012KT 9999", "321350Z"),
                             ("EGLL 211350Z 24012KT 28012KT 9999", "28012KT"), ("EGLL 211350Z NIL", "NIL"), ("EGLLX 211350Z", "EGLLX"),
                             ("EGLL 211350Z 37012KT 9999", "37012KT")):
            error = self.call("metar", report, status=2).stderr
            lines = error.splitlines()
            caret = next(n for n, line in enumerate(lines) if set(line.strip()) == {"^"})
            begin = lines[caret].index("^")
            self.assertEqual(lines[caret - 1][begin:begin + len(word)], word, error)
        self.assertIn("CAVOK", self.call("metar", "EGLL 211350Z 24012KT CAVOK FEW020", status=2).stderr)
        self.assertIn("empty", self.call("metar", "", status=2).stderr)
        self.assertIn("left out", self.call("metar", "EGLL 211350Z 24012KT 9999 FEWO20", "--lenient", "--explain").stderr)
        self.assertIn("does not fit", self.call("metar", REAL[0], "--date", "2024-06-22", status=2).stderr)

    def test_another_decoder_agrees(self):
        """Geo::METAR on 300 generated reports: wind, clouds, temperature, pressure."""
        program = r"""use Geo::METAR; while (<STDIN>) { chomp; my $m = new Geo::METAR; $m->metar($_);
            print join("|", $m->WIND_DIR_DEG // "", $m->WIND_KTS // "", $m->TEMP_C // "", $m->DEW_C // "", $m->pressure // ""), "\n"; }"""
        reports = list(generated(300))
        lines = subprocess.run(["perl", "-e", program], input="\n".join(reports), capture_output=True, text=True, check=True).stdout.splitlines()
        self.assertEqual(len(lines), 300)
        for report, line in zip(reports[:60], lines):
            self.explained(report)
        for report, line in zip(reports, lines):
            direction, knots, temperature, dew, _ = line.split("|")
            wind = re.search(r"(\d{3})(\d\d)(?:G\d\d)?KT", report)
            self.assertEqual((int(direction), int(knots)), (int(wind[1]), int(wind[2])), report)
            degrees = re.search(r" (\d\d)/(\d\d) ", report)
            self.assertEqual((int(temperature), int(dew)), (int(degrees[1]), int(degrees[2])), report)

    def groups_of(self, metar):
        clouds = re.findall(r"\b(FEW|SCT|BKN|OVC)(\d{3})(CB)?", metar)
        wind = re.search(r"(\d{3})(\d\d)KT", metar)
        weather = re.findall(r" ([-+]?(?:SH|TS)?(?:RA|SN|DZ))\b", metar)
        return clouds, (int(wind[1]), int(wind[2])), weather

    def test_there_and_back(self):
        """Report -> scene -> run -> report: amounts, bases within 100 ft, weather, wind within 10 degrees and 2 kt."""
        reports = ["EGLL 211350Z 24012KT 9999 FEW020 14/08 Q1017", "LFPG 210800Z 09008KT 9999 SCT035 18/10 Q1015",
                   "EDDM 211200Z 31015KT 9999 BKN040 12/04 Q1018", "EHAM 210600Z 20020KT 8000 -RA OVC008 09/08 Q0999",
                   "ENGM 211200Z 35005KT 1500 SN OVC012 M03/M04 Q1002", "LIMC 211500Z 18010KT 9999 SHRA FEW025 BKN060 20/16 Q1010",
                   "YSSY 210000Z 16012KT CAVOK 22/12 Q1020"]
        for report in reports:
            with self.subTest(report=report):
                self.call("metar", report, "-o", "sky.toml", "--run", "--no-render", "--out", "run", "--date", "2024-06", "--at", "51.5,-0.5,0", "-q")
                self.call("export", "run", "--to", "metar", "--frames", "1", "-o", "back")
                back = next((self.folder / "back").glob("*.metar.txt")).read_text().strip()
                clouds, wind, weather = self.groups_of(report)
                found_clouds, found_wind, found_weather = self.groups_of(back)
                self.assertEqual([c[0] for c in clouds], [c[0] for c in found_clouds], back)
                for wanted, found in zip(clouds, found_clouds):
                    self.assertLessEqual(abs(int(wanted[1]) - int(found[1])), 1, back)
                self.assertEqual(weather, found_weather, back)
                self.assertLessEqual(abs((wind[0] - found_wind[0] + 180) % 360 - 180), 10, back)
                self.assertLessEqual(abs(wind[1] - found_wind[1]), 2, back)
                self.assertEqual(report[:4], back[:4])
                for folder in ("run", "back"):
                    subprocess.run(["rm", "-r", self.folder / folder], check=True)

    def test_the_same_report_is_the_same_scene(self):
        first = self.call("metar", REAL[0], "-q").stdout
        self.assertEqual(first, self.call("metar", REAL[0], "-q", "--threads", 1).stdout)
        self.assertNotEqual(first, self.call("metar", REAL[0], "-q", "--seed", 2).stdout)


class Weather(Case):
    def setUp(self):
        super().setUp()
        self.call("metar", REAL[0], "-o", "sky.toml", "--run", "--no-render", "--out", "run", "--date", "2024-06", "--at", "51.5,-0.5,25", "-q")

    def test_layers_and_simulators(self):
        self.call("export", "run", "--to", "layers", "--to", "xplane", "--to", "wpr", "--frames", "1..2", "-o", "weather")
        self.call("verify", "weather")
        layers = json.loads((self.folder / "weather/EGLL.layers.json").read_text())
        self.assertEqual(len(layers["frames"]), 2)
        low = layers["frames"][0]["layers"][0]
        self.assertAlmostEqual(low["coverage"], 0.19, delta=0.07)
        self.assertAlmostEqual(low["cloud_base_m"], 2000 * 0.3048 + 25, delta=31)
        self.assertEqual(layers["frames"][0]["utc"], "2024-06-21T14:00:00Z")
        xplane = json.loads((self.folder / "weather/EGLL.xplane.json").read_text())["frames"][0]
        self.assertEqual([cloud["cloud_type"] for cloud in xplane["cloud_layers"]], [2, 2, 0])
        subprocess.run(["xmllint", "--noout", self.folder / "weather/EGLL.wpr"], check=True)

    def test_wireshark_decodes_cigi(self):
        self.call("export", "run", "--for", "cigi", "--frames", "1..2", "-o", "cigi")
        layers = self.call("export", "run", "--to", "layers", "--frames", "1..2", "-o", "layers") and json.loads(
            (self.folder / "layers/EGLL.layers.json").read_text())["frames"][0]["layers"]
        said = subprocess.run(["tshark", "-r", self.folder / "cigi/EGLL.pcap", "-d", "udp.port==8005,cigi", "-V"], capture_output=True, text=True, check=True).stdout
        self.assertEqual(len(re.findall(r"Weather Control \(56 bytes\)", said)), 2 * len(layers), said[:3000])
        coverage = [float(value) for value in re.findall(r"Cloud Coverage[^:]*: ([\d.]+)", said)]
        for expected, found in zip(layers, coverage):
            self.assertAlmostEqual(100 * expected["coverage"], found, delta=0.01)
        bases = [float(value) for value in re.findall(r"Base Elevation[^:]*: ([\d.]+)", said)]
        for expected, found in zip(layers, bases):
            self.assertAlmostEqual(expected["cloud_base_m"], found, delta=0.1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
