# SPDX-License-Identifier: Apache-2.0
"""`nephos metar` with forecasts (TAF): their periods, and the scenes that they become."""

import csv
import json
import tomllib
import unittest

from case import Case

HEAD = "TAF EGLL 211100Z 2112/2218 24012KT 9999 "


def rain_at(scene, time_s):
    """The strongest rain of each layer, mm/h."""
    found = {}
    for layer in scene["layer"]:
        for area in layer.get("rain", {}).get("placed", []):
            weight = 1
            if "fade_s" in area:
                weight = min(1, (time_s - area.get("start_s", -1e9)) / area["fade_s"], (area.get("end_s", 1e9) - time_s) / area["fade_s"])
            if weight > 0:
                found[layer["name"]] = max(found.get(layer["name"], 0), weight * area["intensity_mm_per_h"])
    return found


class Forecast(Case):
    def explained(self, forecast, *arguments):
        return json.loads(self.call("metar", forecast, "--explain", "--json", *arguments).stdout)

    def scene_of(self, forecast, *arguments):
        return tomllib.loads(self.call("metar", forecast, "-q", *arguments).stdout)

    def reports_of(self, forecast, *times_s, run="told"):
        """The words of the reports that a run of a forecast's scene gives at moments that are evenly apart."""
        self.write("told.toml", self.call("metar", forecast, "-q").stdout)
        self.call("run", "told.toml", "--no-render", "--set", f"frames.start_s={times_s[0]}", "--set", "frames.per_second=1",
                  "--set", f"frames.time_scale={times_s[1] - times_s[0]}", "--frames", f"1..{len(times_s)}", "--out", run, "-q")
        self.call("export", run, "--to", "metar", "-o", f"{run}-reports")
        return [line.split() for line in next((self.folder / f"{run}-reports").glob("*.metar.txt")).read_text().splitlines()]

    def said(self, forecast, *arguments):
        """The one line of an error."""
        return self.call("metar", forecast, *arguments, status=2).stderr.splitlines()[0]

    def test_changes_that_meet(self):
        """One begins where another ends, overlaps it or lies within it; moments that no day has are refused."""
        def periods(changes):
            explained = self.call("metar", "TAF EGLL 2112/2218 24012KT 9999 FEW020 " + changes, "--explain", "--json")
            self.call("metar", "TAF EGLL 2112/2218 24012KT 9999 FEW020 " + changes, "-o", "taf.toml", "--overwrite", "-q")
            self.call("validate", "taf.toml")
            return json.loads(explained.stdout)
        found = periods("BECMG 2113/2115 BKN030 FM211500 30015KT 9999 SCT045")
        self.assertEqual([(p["from_s"], p["until_s"]) for p in found["periods"]], [(0, 0), (3600, 10800), (10800, 11400)])
        found = periods("BECMG 2113/2116 BKN030 FM211500 30015KT 9999 SCT045")  # ends it
        self.assertEqual([(p["from_s"], p["until_s"]) for p in found["periods"]], [(0, 0), (3600, 10800), (10800, 11400)])
        self.assertIn("`BECMG 2113/2116` ends where `FM211500` begins", " ".join(found["notes"]))
        found = periods("BECMG 2113/2116 BKN030 BECMG 2115/2118 30015KT")
        self.assertEqual([(p["from_s"], p["until_s"]) for p in found["periods"]], [(0, 0), (3600, 14400), (14400, 21600)])
        self.assertIn("which it overlaps", " ".join(found["notes"]))
        found = periods("BECMG 2113/2116 BKN030 BECMG 2113/2116 30015KT")
        self.assertEqual(len(found["periods"]), 2)
        self.assertIn("30015KT", found["periods"][1]["weather"])
        self.assertIn("BKN030", found["periods"][1]["weather"])
        for changes in ("BECMG 2113/2199 BKN030", "BECMG 0013/0016 BKN030", "FM211270 BKN030", "FM219900 BKN030", "BECMG 2115/2113 BKN030",
                        "BECMG 2115/2118 BKN030 BECMG 2117/2116 OVC010"):
            self.assertIn("expected", self.call("metar", "TAF EGLL 2112/2218 24012KT 9999 FEW020 " + changes, status=2).stderr)
        self.assertIn("expected a validity", self.call("metar", "TAF EGLL 2124/2218 24012KT 9999 FEW020", status=2).stderr)

    def test_the_next_month(self):
        def told(*arguments):
            return json.loads(self.call("metar", "TAF EGLL 301700Z 3018/0100 24012KT 9999 FEW020", "--explain", "--json", *arguments).stdout)
        for date, hours in (("2024-06", 6), ("2024-07", 30), ("2024-07-30", 30)):
            found = told("--date", date)
            self.assertEqual(found["length_s"], 3600 * hours)
            self.assertFalse([note for note in found["notes"] if "month" in note])
        for date in ("2024-13", "2024-6", "june", "2024"):
            self.refused(2, "metar", "TAF EGLL 3018/0100 24012KT 9999 FEW020", "--explain", "--date", date,
                         says=f"--date '{date}' is no month")
        self.assertIn("from 01 to 30", self.call("metar", "TAF EGLL 3018/0100 24012KT 9999 FEW020 BECMG 3106/3108 BKN030",
                                                 "--date", "2024-06", status=2).stderr)
        found = told()
        self.assertEqual(found["length_s"], 3600 * 6)
        self.assertIn("the month is taken to end on day 30", " ".join(found["notes"]))

    def test_issued_before_the_month_ends(self):
        """--date is the month of issue, its day that of issue or of validity."""
        for date in ("2024-06", "2024-06-30", "2024-07-01"):
            scene = self.scene_of("TAF EGLL 302300Z 0100/0206 24012KT 9999 FEW020", "--date", date, "--at", "51.5,-0.4,25")
            self.assertEqual(scene["georeference"]["start_utc"], "2024-07-01T00:00:00Z")
        scene = self.scene_of("TAF EGLL 312300Z 0100/0206 24012KT 9999 FEW020", "--date", "2024-12", "--at", "51.5,-0.4,25")
        self.assertEqual(scene["georeference"]["start_utc"], "2025-01-01T00:00:00Z")
        for issued, valid, date, start in (("220015Z", "2118/2218", "2024-06", "2024-06-21T18"), ("310010Z", "3018/3124", "2024-01", "2024-01-30T18"),
                                           ("010015Z", "3118/0124", "2024-06", "2024-05-31T18"), ("010015Z", "3118/0124", "2024-06-01", "2024-05-31T18")):
            scene = self.scene_of(f"TAF AMD UUDD {issued} {valid} 24012KT 9999 FEW020", "--date", date, "--at", "55.4,37.9,179")
            self.assertEqual(scene["georeference"]["start_utc"][:13], start)
        self.assertIn("does not fit the forecast's day 1", self.said("TAF EGLL 302300Z 0100/0206 24012KT 9999 FEW020", "--date", "2024-06-29"))
        self.assertIn("from day 01 to 30, the last of the month in which it becomes valid", self.said("TAF EGLL 3123/0206 24012KT 9999 FEW020", "--date", "2024-06"))
        self.assertIn("--date '2024-06' has no day 31", self.said("TAF EGLL 312300Z 3123/0206 24012KT 9999 FEW020", "--date", "2024-06"))
        # A day that there is not is not taken for the month's last one.
        self.assertIn("`3318/3320`: expected days from 01 to 31", self.said("TAF EGLL 3018/0100 24012KT 9999 FEW020 BECMG 3318/3320 BKN030"))

    def test_a_new_weather_ends_what_is_under_way(self):
        """FM replaces all of the weather, changes too that had not come by then."""
        def periods(changes):
            found = self.explained(HEAD + "FEW020 " + changes)
            return [(p["change"], p["from_s"], p["until_s"]) for p in found["periods"]], " ".join(found["notes"])
        found, notes = periods("BECMG 2115/2118 BKN030 BECMG 2116/2120 OVC010 FM211700 30015KT 9999 SCT045")
        self.assertEqual(found, [("", 0, 0), ("BECMG 2115/2118", 10800, 18000), ("FM211700", 18000, 18600)])
        self.assertIn("`BECMG 2116/2120` is not in the scene: `FM211700` comes before it", notes)
        found, notes = periods("BECMG 2115/2118 BKN030 FM211500 30015KT 9999 SCT045")
        self.assertEqual(found, [("", 0, 0), ("FM211500", 10200, 11400)])
        self.assertIn("`BECMG 2115/2118` is not in the scene", notes)
        found, notes = periods("FM211500 30015KT 9999 SCT045 FM211505 30018KT 9999 SCT050")
        self.assertEqual(found, [("", 0, 0), ("FM211500", 10200, 11100), ("FM211505", 11100, 11700)])
        found, notes = periods("FM211500 30015KT 9999 SCT045 BECMG 2115/2116 BKN050")
        self.assertEqual(found, [("", 0, 0), ("FM211500", 10200, 11400), ("BECMG 2115/2116", 11400, 14400)])
        self.assertNotIn("overlaps", notes)
        found, notes = periods("BECMG 2113/2119 BKN030 BECMG 2114/2115 30010KT")
        self.assertIn("`BECMG 2114/2115` is a part of `BECMG 2113/2119`", notes)
        for changes in ("FM211500 30015KT 9999 SCT045 FM211500 30015KT 9999 SCT050", "BECMG 2116/2120 BKN030 FM211500 30015KT 9999 SCT045",
                        "FM221800 30015KT 9999 SCT045", "FM211100 30015KT 9999 SCT045", "BECMG 2218/2219 BKN030"):
            self.assertIn("expected changes in the order of time, within the validity", self.said(HEAD + "FEW020 " + changes))

    def test_what_a_change_has_to_name(self):
        self.assertIn("names no wind: that before it goes on", " ".join(self.explained(HEAD + "FEW020 FM211500 9999 SCT045")["notes"]))
        wind = self.scene_of(HEAD + "FEW020 FM211500 9999 SCT045")["wind"]
        self.assertEqual([key["levels"][0]["from_deg"] for key in wind], [240])
        self.assertIn("names no clouds: there are none", " ".join(self.explained(HEAD + "FEW020 FM211500 30015KT 9999")["notes"]))
        for text, expected in ((HEAD + "FEW020 FM211500", "from then on"), (HEAD + "FEW020 BECMG 2115/2117", "that it becomes"),
                               ("TAF EGLL 2112/2218", "of the beginning"), (HEAD + "FEW020 BECMG 2115/2117 QNH2992INS", "that it becomes")):
            self.assertRegex(self.said(text), "expected (the )?wind, visibility, weather or clouds " + expected)

    def test_mistakes_hide_no_change(self):
        """What lasts a while is left out, but read: a change that it swallowed would be missed in silence."""
        for mistake, word in (("FM21150 30015KT 9999 OVC005", "FM21150"), ("FM 211500 30015KT 9999 OVC005", "FM"), ("BECMG2115/2117 OVC005", "BECMG2115/2117"),
                              ("BECMGX 2115/2117 OVC005", "BECMGX"), ("BKN0I0 OVC020", "BKN0I0"), ("TEMPO -SN", "-SN"), ("PROB30 -SN", "-SN"),
                              ("PROBX0 2113/2115 SHRA", "PROBX0")):
            for lenient in ((), ("--lenient",) if word != "BKN0I0" else ()):
                error = self.call("metar", HEAD + "FEW020 TEMPO 2113/2115 SHRA " + mistake, *lenient, status=2).stderr.splitlines()
                self.assertIn(f"error: `{word}`: expected ", error[0])
                self.assertEqual(error[2], " " * error[1].rindex(word) + "^" * len(word))
        self.assertIn("`2115/2118`: expected BECMG, TEMPO, INTER or PROB in front", self.said(HEAD + "FEW020 2115/2118 BKN030", "--lenient"))
        self.assertIn("`EGL\"`: expected the four capital letters", self.said(HEAD.replace("EGLL", 'EGL"') + "FEW020"))
        for second in (HEAD + "FEW020 TEMPO 2113/2115 SHRA= TAF EGKK 211100Z 2112/2218 30015KT 9999 SCT030=",
                       HEAD + "FEW020 TAF EGKK 211100Z 2112/2218 30015KT 9999 SCT030", HEAD + "FEW020 TEMPO 2113/2115 SHRA TAF EGKK 211100Z 2112/2218"):
            self.assertIn("expected one", self.said(second, "--lenient"))
        for usual in ("PROB30 2113/2115 TSRA", "PROB40 TEMPO 2113/2115 +TSRA BKN010CB", "INTER 2113/2115 SHRA", "TEMPO 2113/2115 NSW", "AMD NOT SKED",
                      "RMK NXT FCST BY 18Z", "TX18/2115Z TN09/2205Z", "WS020/24045KT", "QNH2992INS"):
            self.assertIn("is not in the scene", " ".join(self.explained(HEAD + "FEW020 " + usual)["notes"]))

    def test_what_is_left_out_is_told_once(self):
        found = self.explained(HEAD.replace("24012KT", "24015G30KT") + "MIFG VCSH SCT030 FEW///CB BECMG 2115/2117 VRB03KT RA SN BLSN BECMG 2119/2120 RA SN VV///")
        self.assertEqual([p["weather"][:12] for p in found["periods"]], ["EGLL 211200Z", "EGLL 211700Z", "EGLL 212000Z"])
        for text in ("gusts are not simulated", "MIFG is not in the scene, as the visibility is not lessened", "`VCSH` (weather in the vicinity) is not in the scene",
                     "`FEW///CB` (cloud of unknown amount or height) is not in the scene", "the wind's direction follows from the seed",
                     "of what falls RA alone is in the scene, not SN", "BLSN is not in the scene", "VV///: no layer is in the scene, as no height is told",
                     "the sun is not that of the forecast: it takes --date and --at"):
            self.assertEqual(found["notes"].count(text), 1, (text, found["notes"]))
        made = json.loads(self.call("metar", found["forecast"], "--json").stdout)
        self.assertEqual(sorted(set(made["notes"]) & set(found["notes"])), sorted(found["notes"]))
        for changes in ("FM220000 30015KT 3000 MIFG FEW020", "BECMG 2115/2117 4000 HZ"):
            notes = self.explained(HEAD + "FEW020 " + changes)["notes"]
            self.assertIn("visibility, fog, mist or haze that changes is not in the scene: it is that of the beginning", notes)
            self.assertFalse([text for text in notes if "is in the scene" in text], notes)
        self.assertIn("MIFG is in the scene as fog everywhere", self.explained(HEAD.replace("9999", "0800") + "MIFG FEW020")["notes"])
        long = "X" * 3900
        (self.folder / "taf.txt").write_text(HEAD + "FEW020 BECMG " + long)
        said = self.call("metar", "@taf.txt", status=2).stderr
        self.assertIn("taf.txt: `" + "X" * 60 + "...`: expected the time of the change", said)
        self.assertLess(len(said), 300)

    def test_rain_goes_on_where_it_is_forecast(self):
        """Outside of changes it is as strong as told, and of two that follow each other one is always there."""
        scene = self.scene_of(HEAD + "RA OVC010 BECMG 2115/2118 30020KT FM220000 30010KT 9999 RA OVC010")
        for hour in range(31):
            self.assertEqual(rain_at(scene, 3600 * hour), {"RA": 5}, hour)
        scene = self.scene_of(HEAD + "NSC BECMG 2114/2116 -RA OVC010 BECMG 2118/2120 +RA FM220000 30010KT 9999 SHSN BKN010 FM220300 30010KT CAVOK")
        for hour, expected in ((0, {}), (2, {}), (3, {"RA": 1}), (5, {"RA": 1}), (6, {"RA": 1}), (7, {"RA": 15}), (8, {"RA": 15}), (11.8, {"RA": 15}),
                               (12.2, {"SN": 5}), (14.8, {"SN": 5}), (15.2, {}), (29, {})):
            found = rain_at(scene, 3600 * hour)
            self.assertEqual(found.keys(), expected.keys(), hour)
            for code, rate in expected.items():
                self.assertAlmostEqual(found[code], rate, msg=hour)
        for second in range(6 * 3600, 8 * 3600, 60):
            self.assertGreaterEqual(rain_at(scene, second).get("RA", 0), 1)

    def test_one_kind_is_drawn(self):
        forecast = HEAD + "RA OVC010 FM220000 30010KT 9999 SN OVC010"
        scene = self.scene_of(forecast)
        self.assertEqual(scene["precipitation"]["kind"], "snow")
        self.assertEqual(scene["wet_ground"], {"enabled": True})  # it lies when it has fallen
        self.assertIn("rain and snow fall: all of it is drawn as snow, of which more falls", self.explained(forecast)["notes"])
        self.assertEqual(self.scene_of(HEAD + "SN OVC010")["wet_ground"], {"enabled": True, "initial_snow_mm": 2})
        self.assertEqual(self.scene_of(HEAD + "RA OVC010")["wet_ground"], {"enabled": True, "initial_water_mm": 1})
        self.assertEqual(self.scene_of(HEAD + "NSC FM220000 30010KT 9999 RA OVC010")["wet_ground"], {"enabled": True})
        self.assertEqual([("RA" in told, "SN" in told) for told in self.reports_of(forecast, 36000, 57600)], [(True, False), (False, True)])
        # The strongest of what falls at once says how it is drawn, too.
        self.assertNotIn("kind", self.scene_of(HEAD + "+RA -SN OVC010")["precipitation"])
        self.assertEqual(self.scene_of(HEAD + "-RA +SN OVC010")["precipitation"]["kind"], "snow")

    def test_no_showers_in_a_change(self):
        told = self.reports_of("TAF EGLL 211100Z 2112/2118 24012KT 9999 RA OVC010 BECMG 2113/2115 +RA", 1800, 7200)
        self.assertEqual([[word for word in words if "RA" in word] for words in told], [["RA"], ["+RA"]])
        told = self.reports_of("TAF EGLL 211100Z 2112/2118 24012KT 9999 SHRA BKN010 BECMG 2115/2117 NSW", 1800, 3600, run="showers")
        self.assertIn("SHRA", told[0])

    def test_thunder_is_when_it_is_forecast(self):
        scene = self.scene_of(HEAD + "FEW020 FM220000 30010KT 9999 TSRA SCT015 SCT030CB FM220400 30010KT 9999 NSC FM220900 30010KT 9999 TS FEW040CB FM220910 30010KT CAVOK")
        flashes = scene["lightning"]
        hours = [flash["time_s"] / 3600 for flash in flashes]
        for minute in range(12 * 60 + 10, 15 * 60 + 50):
            self.assertLessEqual(min(abs(minute / 60 - hour) for hour in hours), 0.5, minute)
        self.assertTrue(12 + 1 / 6 <= hours[0] and hours[-2] <= 15 + 5 / 6, hours)
        self.assertAlmostEqual(hours[-1], 21.1, delta=0.2)
        self.assertTrue(all(flash["time_s"] % 300 == 0 for flash in flashes), hours)  # frames are so far apart
        self.assertAlmostEqual(flashes[0]["position_m"][2], 3000 * 0.3048 + 800, places=3)  # of the tower, not of the lowest cloud

        # It goes on through changes of something else; none is after the end.
        hours = [flash["time_s"] / 3600 for flash in self.scene_of(HEAD + "TSRA SCT030CB BECMG 2113/2117 30020KT BECMG 2120/2122 SCT040CB")["lightning"]]
        for minute in range(30 * 60):
            self.assertLessEqual(min(abs(minute / 60 - hour) for hour in hours), 0.5, minute)
        self.assertNotIn("lightning", self.scene_of("TAF EGLL 2112/2118 24012KT 9999 NSC BECMG 2117/2119 TSRA SCT030CB"))
        forecast = HEAD + "FEW020 FM220000 30010KT 9999 TSRA SCT030CB FM220400 30010KT 9999 NSC"
        told = self.reports_of(forecast, 36000, 48000, 60000)
        self.assertEqual([("TSRA" in words, "SCT030CB" in words) for words in told], [(False, False), (True, True), (False, False)], told)

    def test_covers_over_their_time(self):
        """What is told is what a run of the scene has at those moments, on average within half an okta of what is wanted."""
        forecast = "TAF EGLL 211100Z 2112/2118 24012KT 9999 SCT030 BKN230 FM211500 30020KT 9999 SCT030 FEW060"
        made = json.loads(self.call("metar", forecast, "-o", "covers.toml", "--json").stdout)
        layers = {layer["group"]: layer for layer in made["layers"]}
        for layer in layers.values():
            self.assertLessEqual(abs(layer["cover"] - layer["wanted"]), 0.5 / 8, layer)
            self.assertTrue(layer["least_cover"] <= layer["cover"] <= layer["most_cover"], layer)
        self.call("run", "covers.toml", "--no-render", "--out", "covers", "-q")
        rows = csv.DictReader((self.folder / f"covers/statistics/{layers['SCT030']['name']}.csv").read_text().splitlines())
        found = [float(row["optical_cover"]) for row in rows if row["optical_cover"]]
        self.assertEqual(len(found), 73)
        self.assertAlmostEqual(sum(found) / 73, layers["SCT030"]["cover"], delta=0.01)
        self.assertAlmostEqual(min(found), layers["SCT030"]["least_cover"], delta=0.03)
        self.assertAlmostEqual(max(found), layers["SCT030"]["most_cover"], delta=0.03)

    def test_many_groups(self):
        """Of more than 16 layers the lowest have fine detail; of more than a scene has there is an error of the forecast."""
        def forecast(periods, groups):
            text = "TAF KORD 211130Z 2112/2218 22008KT P6SM -RA FEW005"
            for n in range(periods):
                text += f" FM21{13 + n // 2:02}{30 * (n % 2):02} 24012KT P6SM " + " ".join(f"SCT{10 + groups * n + k:03}" for k in range(groups))
            return text
        found = self.scene_of(forecast(9, 2))
        detail = [layer["detail"].get("enabled", True) for layer in found["layer"]]
        self.assertEqual(detail, [True] * 16 + [False] * 4)  # three groups, and the rain
        self.assertIn("the lowest 16 layers alone have fine detail, as scenes have room for no more", self.explained(forecast(9, 2))["notes"])
        self.explained(forecast(15, 4))
        self.assertIn("the forecast has 66 different groups of clouds and of what falls: expected at most 64", self.said(forecast(16, 4)))


if __name__ == "__main__":
    unittest.main(verbosity=2)
