# SPDX-License-Identifier: Apache-2.0
"""`nephos metar`, summaries of layers, and the way from a report to clouds and back."""

import json
import math
import random
import re
import shutil
import subprocess
import unittest

from case import Case
from verify_test import PLACED

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

    def test_winds_of_layers(self):
        """Each height has the wind of the layer that holds it, in all formats of weather."""
        layer = """
[[layer]]
name = "{}"
lattice = {{ cells = [12, 12, 6], cell_size_m = 100, origin_m = [0, 0, {}] }}
wind = [{{ levels = [{{ height_m = 0, from_deg = {}, speed_m_per_s = {} }}] }}]
veil = {{ form = "stratus", octaves = 1, wavelength_m = 4000, base_m = {}, top_m = {} }}
"""
        scene = self.write("winds.toml", 'name = "winds"\n[time]\nsteps = 2\n[frames]\ncount = 1\n' +
                           layer.format("Cu", 500, 270, 5, 550, 1000) + layer.format("Ac", 3000, 90, 20, 3050, 3500))
        self.call("run", scene, "--no-render", "--out", "winds", "-q")
        self.call("export", "winds", "--to", "xplane", "--to", "wpr", "--to", "layers", "-o", "told")
        frame = json.loads((self.folder / "told/winds.xplane.json").read_text())["frames"][0]
        found = [(wind["alt_msl"], wind["direction"], wind["speed"]) for wind in frame["wind_layers"]]
        self.assertEqual([(round(m), round(deg)) for m, deg, _ in found], [(0, 270), (550, 270), (1050, 270), (2950, 270), (3050, 90), (3550, 90), (3650, 270)])
        self.assertAlmostEqual(found[4][2] / found[0][2], 4, 3)

    def test_real_reports_are_read(self):
        for report in REAL:
            with self.subTest(report=report):
                groups = self.explained(report)["groups"]
                self.assertEqual(" ".join(g["group"] for g in groups), report.rstrip("="))
                fitted = json.loads(self.call("metar", report, "-o", "sky.toml", "--overwrite", "--json").stdout)
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
                             ("EGLL 211350Z 24012KT 28012KT 9999", "28012KT"), ("EGLL 211350Z 24012KT 9999 14/08 13/M01", "13/M01"), ("EGLL 211350Z NIL", "NIL"),
                             ("TAF AMD EGLL 211406Z 2114/2218 CNL", "CNL"), ("TAF EGLL 211406Z CNL", "CNL"), ("EGLLX 211350Z", "EGLLX"),
                             ("EGLL 211350Z 37012KT 9999", "37012KT"), ("EGLL 211350Z 24012KT 200V370 9999", "200V370"),
                             ("KJFK 211350Z 24012KT 9999999SM", "9999999SM"), ("KJFK 211350Z 24012KT 1/99999999999SM", "1/99999999999SM"),
                             ("KJFK 211350Z 24012G99999999999KT 9999", "24012G99999999999KT"),
                             ("EGLL 211350Z 24012KT 9999 " + "FEW020 " * 8 + "BKN099", "BKN099"),
                             ("EGLL 211350Z 24012KT 9999\x01", "9999")):
            error = self.call("metar", report, status=2).stderr
            lines = error.splitlines()
            caret = next(n for n, line in enumerate(lines) if set(line.strip()) == {"^"})
            begin = lines[caret].index("^")
            self.assertEqual(lines[caret - 1][begin:begin + len(word)], word, error)
        said = self.call("metar", "EGLL 211350Z 24012KT CAVOK FEW020", status=2).stderr.splitlines()
        self.assertEqual(said[-1], "  " + " " * len("EGLL 211350Z 24012KT CAVOK ") + "^" * len("FEW020"), said)
        for nothing in ("EGLL 211350Z", "METAR KXYZ 211350Z AUTO RMK AO2"):
            self.assertIn("tells nothing but place and time", self.call("metar", nothing, status=2).stderr)
        self.assertIn("empty", self.call("metar", "", status=2).stderr)
        for two in ("EGLL 211350Z 24012KT 9999= EGKK 211350Z 24012KT 9999=", "METAR EGLL 211350Z 24012KT 9999 NOSIG=\nMETAR EGKK 211350Z 24012KT 9999"):
            for lenient in ((), ("--lenient",)):
                self.assertIn("expected one report, which ends with `=`", self.call("metar", two, *lenient, status=2).stderr)
        self.assertIn("the text of a forecast begins with TAF", self.call("metar", "EGLL 211100Z 2112/2218 24012KT 9999", "--lenient", status=2).stderr)
        # Of a file: its name, and all that is wrong, whatever byte is in it.
        (self.folder / "report.txt").write_bytes(b"METAR EGLL 211350Z 24012KT 9999 SC\0T045")
        self.assertIn("report.txt: `SC\\u0000T045`: expected ", self.call("metar", "@report.txt", status=2).stderr)
        (self.folder / "report.txt").write_bytes(b"\xef\xbb\xbfMETAR EGLL 211350Z 24012KT 9999\r\n")  # a byte order mark is none of it
        self.call("metar", "@report.txt", "--explain")
        (self.folder / "report.txt").write_bytes(b"METAR EGLL 211350Z 24012KT " + b"X" * 3900)
        said = self.call("metar", "@report.txt", status=2).stderr
        self.assertIn("report.txt: `" + "X" * 60 + "...`: expected", said)
        self.assertLess(len(said), 300)
        self.assertIn("left out", self.call("metar", "EGLL 211350Z 24012KT 9999 FEWO20", "--lenient", "--explain").stderr)
        text = json.loads(self.call("metar", REAL[0], "--json").stdout)["text"]
        self.assertEqual(text, self.call("metar", REAL[0]).stdout)
        for option in (("--out", "run"), ("--no-render",), ("--resume",), ("--overwrite",)):
            self.assertIn("--run", self.call("metar", REAL[0], *option, status=2).stderr)
        for explain in ((), ("--explain",)):
            self.assertIn("does not fit", self.call("metar", REAL[0], "--date", "2024-06-22", *explain, status=2).stderr)
            self.assertIn('"a/b", which makes no file names', self.call("metar", REAL[0], "--name", "a/b", *explain, status=2).stderr)

    def test_storms_of_100_knots(self):
        """P99KT stands for all that is stronger."""
        for report, meaning in (("EGLL 211350Z 240P99KT 9999 FEW020", "wind at 10 m, as told or stronger"),
                                ("EGLL 211350Z 24080GP99KT 9999 FEW020", "wind at 10 m, as told or stronger, gusts are not simulated"),
                                ("EGLL 211350Z 240120KT 9999 FEW020", "wind at 10 m")):
            groups = self.explained(report)["groups"]
            self.assertEqual((groups[2]["meaning"], groups[2]["used"]), (meaning, True))
        text = self.call("metar", "EGLL 211350Z 240P99KT 9999 FEW020", "-q").stdout
        self.assertIn("{ height_m = 10, from_deg = 240, speed_m_per_s = 50.93 }", text)

    def test_groups_of_no_effect_say_so(self):
        groups = {group["group"]: group for group in self.explained("EGLL 211350Z 24012KT 200V280 4000 8000 FEW020")["groups"]}
        self.assertEqual([groups[word]["used"] for word in ("200V280", "4000", "8000")], [False, True, False])
        self.assertEqual(groups["8000"]["meaning"], "a second visibility")

    def test_places_at_the_edges(self):
        """Bar Yehuda lies 378 m below the sea; the last direction of a large seed is a direction."""
        text = self.call("metar", "LLMZ 210600Z VRB05KT 9999 FEW020", "--at", "31.3,35.4,-378", "--seed", 1000000000, "-q").stdout
        self.assertIn("height_m = -378", text)
        for direction in re.findall(r"from_deg = (-?\d+)", text):
            self.assertIn(int(direction), range(360))
        for place in ("0,-190,0", "0,190,0", "-95,0,0"):
            self.assertIn("beyond", self.call("metar", REAL[0], "--at", place, status=2).stderr)

    def test_names_that_no_scene_may_have_are_refused(self):
        for name in ('My "sky"', "a\\b", "a\nb"):
            self.assertIn("--name", self.call("metar", REAL[0], "--name", name, "-o", "x.toml", status=2).stderr)

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
        """Clouds, wind, visibility in metres and weather of a report."""
        clouds, weather, visibility = [], [], 9999
        for word in metar.split()[2:]:
            if match := re.fullmatch(r"(FEW|SCT|BKN|OVC|VV)(\d{3})(CB|TCU)?", word):
                clouds.append((match[1], int(match[2]), match[3] or ""))
            elif match := re.fullmatch(r"(\d{3})(\d\d)KT", word):
                wind = (int(match[1]), int(match[2]))
            elif match := re.fullmatch(r"(\d+)SM", word):
                visibility = 9999 if int(match[1]) >= 7 else int(int(match[1]) * 1609.344 // 1000 * 1000)
            elif re.fullmatch(r"\d{4}", word):
                visibility = int(word)
            elif re.fullmatch(r"[-+]?([A-Z]{2}){1,3}", word) and word not in ("AUTO", "NOSIG"):
                weather.append(word)
        return clouds, wind, visibility, weather

    def test_there_and_back(self):
        """Report -> scene -> run -> report: amounts and types, bases within 100 ft, visibility, weather, wind within 10 degrees
        and 2 kt."""
        reports = ["EGLL 211350Z 24012KT 9999 FEW020 14/08 Q1017", "LFPG 210800Z 09008KT 9999 SCT035 18/10 Q1015",
                   "EDDM 211200Z 31015KT 9999 BKN040 12/04 Q1018", "EHAM 210600Z 20020KT 8000 -RA OVC008 09/08 Q0999",
                   "ENGM 211200Z 35005KT 1500 SN OVC012 M03/M04 Q1002", "LIMC 211500Z 18010KT 9999 SHRA FEW025 BKN060 20/16 Q1010",
                   "YSSY 210000Z 16012KT CAVOK 22/12 Q1020", "KORD 211351Z 22015KT 6SM -TSRA BR FEW018 BKN045CB 22/20 A2975",
                   "LSZH 210920Z 18006KT 9999 FEW030TCU SCT060 19/12 Q1014", "WSSS 210700Z 20006KT 9999 TS FEW016CB BKN140 31/25 Q1008",
                   "EFHK 210450Z 12009KT 4000 FZRA BR OVC006 M01/M01 Q1003", "UUEE 211330Z 05010KT 2500 -RASN BR BKN009 OVC020 01/01 Q0998",
                   "EIDW 210330Z 24018KT 3000 DZ BR OVC004 11/11 Q1009", "EGPD 210520Z 15016KT 7000 -DZ BKN005 09/09 Q1013",
                   "OMDB 210900Z 32010KT 4500 HZ NSC 36/18 Q1002", "LOWI 210620Z 00000KT 0350 FG VV002 02/02 Q1021",
                   "ESSA 210850Z 18012KT 1200 +SN VV008 M02/M02 Q0991", "EGCC 211150Z 29022KT 9999 FEW012 SCT025 BKN070 OVC120 13/09 Q1005",
                   "KJFK 211251Z 18014KT 10SM SCT010 BKN250 20/17 A2999", "CYUL 210400Z 03011KT 3000 FZDZ OVC003 M02/M02 Q1010"]
        for report in reports:
            with self.subTest(report=report):
                for folder in ("run", "back"):
                    shutil.rmtree(self.folder / folder, ignore_errors=True)
                self.call("metar", report, "-o", "sky.toml", "--overwrite", "--date", "2024-06", "--at", "51.5,-0.5,0", "-q")
                self.call("run", "sky.toml", "--no-render", "--frames", "1", "--out", "run", "-q")
                self.call("export", "run", "--to", "metar", "-o", "back")
                back = next((self.folder / "back").glob("*.metar.txt")).read_text().strip()
                clouds, wind, visibility, weather = self.groups_of(report)
                found_clouds, found_wind, found_visibility, found_weather = self.groups_of(back)
                self.assertEqual([(c[0], c[2]) for c in clouds], [(c[0], c[2]) for c in found_clouds], back)
                for wanted, found in zip(clouds, found_clouds):
                    self.assertLessEqual(abs(wanted[1] - found[1]), 1, back)
                self.assertEqual((weather, visibility), (found_weather, found_visibility), back)
                self.assertLessEqual(abs((wind[0] - found_wind[0] + 180) % 360 - 180), 10, back)
                self.assertLessEqual(abs(wind[1] - found_wind[1]), 2, back)
                self.assertEqual(report[:4], back[:4])

    def test_the_same_report_is_the_same_scene(self):
        first = self.call("metar", REAL[0], "-q").stdout
        self.assertEqual(first, self.call("metar", REAL[0], "-q", "--threads", 1).stdout)
        self.assertNotEqual(first, self.call("metar", REAL[0], "-q", "--seed", 2).stdout)


class Weather(Case):
    def setUp(self):
        super().setUp()
        run = ("metar", REAL[0], "-o", "sky.toml", "--run", "--no-render", "--out", "run", "--date", "2024-06", "--at", "51.5,-0.5,25", "-q")
        self.call(*run)
        self.call(*run, "--resume")  # complete: there is nothing to do
        self.call(*run, "--overwrite")
        self.refused(2, *run, "--overwrite", "--resume", says="exclude each other")
        self.refused(2, "metar", REAL[0], "--resume", says="--resume requires --run")

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

    def test_limits_of_simulators_are_told(self):
        """Three layers of clouds, 13 winds, one moment: what is merged or left out is a note."""
        self.call("metar", "EDDM 211350Z 24010KT 9999 FEW010 SCT020 BKN080 OVC200 20/15 Q1013", "-o", "four.toml", "-q")
        winds = ", ".join(f"{{ height_m = {200 * n}, from_deg = {240 + n}, speed_m_per_s = {5 + n} }}" for n in range(31))
        text = re.sub(r"levels = \[.*?\n\]", f"levels = [{winds}]", (self.folder / "four.toml").read_text(), count=1, flags=re.S)
        self.call("run", self.write("four.toml", text), "--no-render", "--frames", "1..2", "--out", "four", "-q")
        said = self.call("export", "four", "--to", "xplane", "--to", "cigi", "--to", "wpr", "--to", "layers", "-o", "limits").stderr
        self.assertIn("xplane, wpr, cigi: up to 4 layers of clouds, but there is room for three", said.replace("cigi, wpr, xplane", "xplane, wpr, cigi"))
        self.assertIn("xplane: the wind is told at 31 heights, but there is room for 13", said)
        self.assertIn("wpr: a preset has one moment: that of frame 1", said)
        frame = json.loads((self.folder / "limits/EDDM.xplane.json").read_text())["frames"][0]
        self.assertEqual([wind["alt_msl"] for wind in frame["wind_layers"]], [1000 * (n // 2) + 600 * (n % 2) for n in range(13)])
        self.assertEqual(len(frame["cloud_layers"]), 3)
        said = self.call("export", "four", "--to", "layers", "--to", "metar", "-o", "all").stderr
        self.assertNotIn("room for", said)
        self.assertEqual(len(json.loads((self.folder / "all/EDDM.layers.json").read_text())["frames"][0]["layers"]), 4)

    def cigi(self, run, folder):
        """The Weather Controls of the first frame by their layer, as Wireshark names their fields; and all that it says."""
        self.call("export", run, "--for", "cigi", "--frames", "1", "-o", folder)
        said = subprocess.run(["tshark", "-r", next((self.folder / folder).glob("*.pcap")), "-d", "udp.port==8005,cigi", "-V"],
                              capture_output=True, text=True, check=True).stdout
        packets = {}
        for text in re.split(r"CIGI 3 *, Weather Control|Weather Control \(56 bytes\)", said)[1:]:
            fields = {name.strip(): value.strip() for name, value in re.findall(r"^ +(?:[.01 ]+= )?([^:\n]+): ([^\n]*)$", text, re.M)}
            packets[fields["Layer ID"]] = fields
        return packets, said

    def number(self, fields, name):
        return float(re.match(r"-?[\d.]+", next(value for key, value in fields.items() if key.startswith(name)))[0])

    def test_wireshark_decodes_cigi(self):
        self.call("export", "run", "--to", "layers", "--frames", "1", "-o", "layers")
        layers = json.loads((self.folder / "layers/EGLL.layers.json").read_text())["frames"][0]["layers"]
        packets, said = self.cigi("run", "cigi")
        self.assertEqual(len(packets), 4, said[:6000])
        clouds = [fields for name, fields in packets.items() if "Cloud" in name]
        self.assertEqual((len(clouds), len(layers)), (3, 3), list(packets))
        for expected, found in zip(layers, clouds):
            self.assertIn("Enable", found["Weather Enable"])
            self.assertAlmostEqual(100 * expected["coverage"], self.number(found, "Coverage"), delta=0.01)
            self.assertAlmostEqual(expected["cloud_base_m"], self.number(found, "Base Elevation"), delta=0.1)
        fog = next(fields for name, fields in packets.items() if "Fog" in name)
        self.assertNotIn("Enable", fog["Weather Enable"])
        self.assertIn("Active", re.search(r"Region State: ([^\n]*)", said)[1])

    def test_wireshark_decodes_every_field_of_cigi(self):
        """Each frame against the layers that `layers` tells; and the file of packets is what the datagrams carry."""
        self.call("export", "run", "--to", "layers", "--to", "cigi", "--frames", "1..2", "-o", "both")
        frames = json.loads((self.folder / "both/EGLL.layers.json").read_text())["frames"]
        said = subprocess.run(["tshark", "-r", self.folder / "both/EGLL.pcap", "-d", "udp.port==8005,cigi", "-V"],
                              capture_output=True, text=True, check=True).stdout
        messages = said.split("IG Control (24 bytes)")[1:]
        self.assertEqual(len(messages), 2)
        types = {"Ac": 1, "As": 2, "Cc": 3, "Cs": 4, "Ci": 5, "Cb": 6, "Cu": 7, "Ns": 8, "Sc": 9, "St": 10}
        for number, (frame, message) in enumerate(zip(frames, messages), 1):
            control, region, *weather = [
                {name.split(" (")[0].strip(): value.strip() for name, value in re.findall(r"^ +(?:[.01 ]+= )?([^:\n]+): ([^\n]*)$", packet, re.M)}
                for packet in re.split(r"Environmental Region Control \(48 bytes\)|Weather Control \(56 bytes\)", message)]
            self.assertEqual((control["CIGI Version"], control["Minor Version"], control["IG Mode"], control["Byte Swap"]),
                             ("3", "3", "Operate (1)", "Big-Endian (0x8000)"))
            self.assertEqual((control["Host Frame Number"], control["Timestamp Valid"]), (str(number), "Invalid"))
            numbers = {"Region ID": 1, "Latitude": 51.5, "Longitude": -0.5, "Size X": 20000, "Size Y": 20000, "Corner Radius": 0, "Rotation": 0,
                       "Transition Perimeter": 2000}
            for name, value in numbers.items():
                self.assertAlmostEqual(float(region[name]), value, places=4, msg=name)
            self.assertEqual(region["Region State"], "Active (1)")
            self.assertEqual([region[name] for name in region if name.startswith("Merge")], ["Use Last"] * 4)
            self.assertEqual([packet["Layer ID"] for packet in weather], ["Ground Fog (0)"] + [f"Cloud Layer {n} ({n})" for n in (1, 2, 3)])
            for packet in weather:
                self.assertEqual((packet["Entity ID/Region ID"], packet["Scope"], packet["Severity"]), ("1", "Regional (1)", "0"))
                self.assertEqual((packet["Scud Enable"], packet["Random Winds Enable"], packet["Random Lightning Enable"]), ("Disabled", "Disabled", "0"))
            for name, value in list(weather[0].items())[-12:]:
                self.assertEqual(value, "0", name)  # there is no fog
            for packet, layer in zip(weather[1:], frame["layers"]):
                self.assertEqual((packet["Weather Enable"], packet["Humidity"]), ("Enabled", "95"))
                self.assertIn(f"({types[layer['genus']]})", packet["Cloud Type"])
                base = layer["cloud_base_m"]
                expected = {"Air Temperature": 15 - 0.0065 * base, "Visibility Range": 100, "Scud Frequency": 0, "Coverage": 100 * layer["coverage"],
                            "Base Elevation": base, "Thickness": layer["top_m"] - base, "Transition Band": layer["transition_m"],
                            "Horizontal Wind Speed": layer["wind_m_per_s"], "Vertical Wind Speed": 0,
                            "Wind Direction": (layer["wind_from_deg"] + 180) % 360 - 180,
                            "Barometric Pressure": 1013.25 * (1 - 0.0065 / 288.15 * base) ** 5.25588, "Aerosol Concentration": 0}
                for name, value in expected.items():
                    self.assertAlmostEqual(float(packet[name]), value, delta=1e-5 * abs(value) + 1e-4, msg=name)
        packets, at = (self.folder / "both/EGLL.cigi").read_bytes(), 24
        capture, carried = (self.folder / "both/EGLL.pcap").read_bytes(), b""
        while at < len(capture):
            size = int.from_bytes(capture[at + 8:at + 12], "little")
            carried += capture[at + 16 + 42:at + 16 + size]
            at += 16 + size
        self.assertEqual(packets, carried)
        self.assertEqual((len(packets), packets[:3]), (2 * (24 + 48 + 4 * 56), bytes([1, 24, 3])))

    def test_cigi_regions_and_high_clouds(self):
        """A region's X axis points north; clouds of the stratosphere are no colder than its air."""
        self.call("run", self.write("placed.toml", PLACED), "--no-render", "--frames", "1", "--out", "placed", "-q")
        _, said = self.cigi("placed", "region")
        x_m, y_m = (float(re.search(rf"Size {axis}[^:]*: ([\d.]+)", said)[1]) for axis in "XY")
        self.assertAlmostEqual(x_m / y_m, 24 / 32, msg=said[:4000])  # of 32 cells to the east and 24 to the north
        high = PLACED.replace("[lattice]\n", "[lattice]\norigin_m = [0, 0, 50000]\n").replace("[density]\n", "[density]\nextinction_per_m = 0.2\n")
        self.call("run", self.write("high.toml", high), "--no-render", "--frames", "1", "--out", "high", "-q")
        packets, said = self.cigi("high", "cold")
        cloud = next(fields for name, fields in packets.items() if "Enable" in fields["Weather Enable"])
        self.assertAlmostEqual(self.number(cloud, "Air Temperature"), -56.5, delta=0.1)
        # ISO 2533 continued: 226.32 hPa at 11 km, a scale height of 6,341.6 m.
        base_m = self.number(cloud, "Base Elevation")
        self.assertAlmostEqual(self.number(cloud, "Barometric Pressure"), 226.32 * math.exp((11000 - base_m) / 6341.62), delta=0.01)

    def test_cigi_switches_off_what_is_not_there(self):
        """Fog is a layer of its own; clouds that are not there any more, and the region of an earlier sky, do not stay."""
        self.call("metar", "LOWI 210620Z 00000KT 0350 FG VV002 02/02 Q1021", "-o", "fog.toml", "-q")
        self.call("run", "fog.toml", "--no-render", "--frames", "1", "--out", "fog", "-q")
        packets, said = self.cigi("fog", "fogged")
        self.assertEqual(["Enable" in fields["Weather Enable"] for fields in packets.values()], [True, True, False, False], said[:6000])
        fog = next(fields for name, fields in packets.items() if "Fog" in name)
        self.assertAlmostEqual(self.number(fog, "Visibility"), 350, delta=1)
        self.assertIn("Destroyed", re.search(r"Region State: ([^\n]*)", said)[1])

    def test_cigi_lightning_comes_from_the_cumulonimbus(self):
        """Not from the scattered cumulus below it; and a merge of layers keeps the cumulonimbus."""
        for number, (groups, layer) in enumerate((("SCT010 BKN045CB", 2), ("FEW010 SCT020CB BKN030 OVC090", 2))):
            with self.subTest(groups=groups):
                self.call("metar", f"EDDM 211350Z 24010KT 9999 TS {groups} 20/15 Q1013", "-o", f"ts{number}.toml", "-q")
                self.call("run", f"ts{number}.toml", "--no-render", "--frames", "1", "--out", f"ts{number}", "-q")
                packets, said = self.cigi(f"ts{number}", f"thunder{number}")
                clouds = [fields for name, fields in packets.items() if "Cloud" in name]
                found = [n + 1 for n, fields in enumerate(clouds)
                         if next(value for name, value in fields.items() if "Lightning" in name) == "1"]
                self.assertEqual(found, [layer], said[:6000])
                self.assertIn("umulonimbus", next(value for name, value in clouds[layer - 1].items() if "Cloud Type" in name))

    def test_heights_above_the_ellipsoid(self):
        """Simulators count from mean sea level: 45 m above the ellipsoid here."""
        heights = {}
        for geoid in ("", "geoid_height_m = 45\n"):
            text = (self.folder / "sky.toml").read_text().replace("height_m = 25\n", f'height_m = 70\nheight_datum = "ellipsoid"\n{geoid}')
            self.call("run", self.write("high.toml", text), "--no-render", "--frames", "1", "--out", "high", "--overwrite", "-q")
            said = self.call("export", "high", "--to", "layers", "--to", "xplane", "-o", "told" + geoid[:5]).stderr
            self.assertEqual("geoid_height_m" in said, not geoid)
            layers = json.loads(next((self.folder / ("told" + geoid[:5])).glob("*.layers.json")).read_text())
            self.assertEqual(layers["heights"], "metres above mean sea level" if geoid else "metres above the ellipsoid")
            xplane = json.loads(next((self.folder / ("told" + geoid[:5])).glob("*.xplane.json")).read_text())
            heights[geoid] = (layers["frames"][0]["layers"][0]["cloud_base_m"], xplane["frames"][0]["ground_altitude_msl"])
        self.assertAlmostEqual(heights[""][0] - 45, heights["geoid_height_m = 45\n"][0])
        self.assertEqual((heights[""][1], heights["geoid_height_m = 45\n"][1]), (70, 25))


if __name__ == "__main__":
    unittest.main(verbosity=2)
