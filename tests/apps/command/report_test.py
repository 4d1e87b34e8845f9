# SPDX-License-Identifier: Apache-2.0
"""`nephos report`: one page, the same for any order of runs, that shows what went wrong first, loads nothing, and works in
a browser (Chromium, headless) with and without scripts."""

import csv
import html
import http.server
import json
import pathlib
import re
import shlex
import shutil
import subprocess
import tempfile
import threading
import unittest
from html.parser import HTMLParser

import xxhash
from PIL import Image

from case import PATIENCE, SOURCE, Case
from sweep_test import NULL

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Tags(HTMLParser):
    """Elements that are opened and not closed, in a text of HTML; and the text outside of scripts."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.wrong, self.words, self.titles = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        pass

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append((tag, self.getpos()))

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)
            if self.open[-1] == "h2":
                self.titles.append(data)


class Listener(http.server.BaseHTTPRequestHandler):
    """Takes every request of a browser, to any host: it is its proxy."""

    def do_GET(self):
        self.server.requests.append(self.path)
        self.send_error(404)

    def do_CONNECT(self):
        self.do_GET()

    def log_message(self, *arguments):
        pass


class Report(Case):
    def sweep(self, out, *arguments, scene=None, axes=("field.background.ext=0.05,0.1,0.2",), status=0):
        scene = scene or self.write("null.toml", NULL)
        axes = [word for axis in axes for word in ("--axis", axis)]
        return self.call("sweep", scene, *axes, "--replicates", "3", "--steps", "200..800", "--out", out, *arguments,
                         status=status)

    def page(self, folder, *arguments):
        self.call("report", folder, *arguments)
        return (self.folder / folder / "report.html").read_text()

    def browse(self, page, *arguments):
        """Opens a page; returns its DOM afterwards, its messages on the console, and the requests of the browser."""
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Listener)
        server.requests = []
        threading.Thread(target=server.serve_forever, daemon=True).start()
        profile = tempfile.mkdtemp(dir=self.folder)
        try:
            result = subprocess.run(
                ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
                 "--disable-background-networking", "--disable-component-update", "--disable-sync",
                 "--disable-default-apps", "--disable-domain-reliability", "--disable-client-side-phishing-detection",
                 f"--user-data-dir={profile}", f"--proxy-server=127.0.0.1:{server.server_port}",
                 "--proxy-bypass-list=<-loopback>", "--enable-logging=stderr", "--window-size=1100,1400",
                 "--virtual-time-budget=5000", *arguments, pathlib.Path(page).as_uri()],
                capture_output=True, text=True, timeout=PATIENCE, cwd=self.folder)
        finally:
            server.shutdown()
            server.server_close()
        self.assertEqual(result.returncode, 0, result.stderr)
        # What Chromium asks its maker for, with any page and whatever it is told.
        own = re.compile(r"^(https?://)?([a-z0-9-]+\.)*(google|googleapis|gvt1|gstatic)\.com[:/]")
        return (result.stdout, re.findall(r"CONSOLE.*", result.stderr),
                [request for request in server.requests if not own.match(request)])

    def test_is_the_same_for_any_order_and_says_all(self):
        axes = ("field.background.ext=0.05,0.1,0.2", "field.background.act=0.001,0.002")
        self.sweep("one", "-j", "1", axes=axes)
        page = self.page("one")
        for shard in (2, 0, 1):
            self.sweep(f"part{shard}", "-j", "2", "--shard", f"{shard}/3", axes=axes)
        self.call("report", "part1", "part2", "part0", "--out", "parts.html")
        self.assertEqual((self.folder / "parts.html").read_text(), page)
        tags = Tags(page)
        self.assertEqual((tags.open, tags.wrong), ([], []))
        self.assertEqual(tags.titles, ["What needs care", "What was run", "Regimes", "Along the axes", "Profiles and sizes",
                                       "All at once", "Over time", "Last states", "Points, and how to repeat each run"])
        self.assertNotRegex(page.split("uPlot")[0], r"https?://")
        self.assertNotIn(str(self.folder), page)
        self.assertIn("6 points (grid) x 3 replicates = 18 runs: 18 done, 0 failed, 0 missing", page)
        self.assertEqual(page.count("data:image/png;base64,"), 6)
        self.assertEqual(page.count('<tr id="p'), 6)
        with open(self.folder / "one/points.csv", newline="") as file:
            for point in csv.DictReader(file):
                if point["cover"]:
                    self.assertIn(f"cover {float(point['cover']):.4g}", page)

    def test_a_command_of_it_repeats_the_run(self):
        self.sweep("a")
        commands = re.findall(r"nephos (run scene\.toml .*)", self.page("a"))
        self.assertEqual(len(commands), 9)
        with open(self.folder / "a/runs.csv", newline="") as file:
            runs = list(csv.DictReader(file))
        for number in (0, 5):
            words = commands[number].split()
            words[1] = "a/scene.toml"
            self.call(*words)
            with open(self.folder / words[-1] / "statistics.csv", newline="") as file:
                last = list(csv.DictReader(file))[-1]
            self.assertEqual((last["step"], last["hash"]), (runs[number]["steps"], runs[number]["state_hash"]))

    def test_failures_come_first_and_texts_are_no_markup(self):
        self.sweep("a")
        shard = self.folder / "a/shards/0000-of-0001.jsonl"
        lines = shard.read_text().splitlines(keepends=True)
        record = json.loads(lines[-3])
        failed = {key: record[key] for key in ("run", "statistics_version", "random_stream_version", "replicate", "seed", "values")}
        failed |= {"status": "failed", "message": "<img src=x onerror=alert(1)> </script> \"'"}
        text = json.dumps(failed)[:-1]
        sealed = f'{text},"xxh3":"{xxhash.xxh3_128_hexdigest(text)}"}}\n'
        shard.write_text("".join(lines[:-3]) + sealed)
        page = self.page("a")
        tags = Tags(page)
        self.assertEqual((tags.open, tags.wrong), ([], []))
        self.assertIn("2 runs are missing", page)
        self.assertIn("1 runs failed", page)
        self.assertIn("2 of 9 runs are missing in the page", self.call("report", "a").stderr)
        for words in ("2 runs are missing", "1 runs failed"):
            self.assertLess(page.index(words), page.index("What was run"))
        self.assertNotIn("<img src=x", page)
        self.assertIn("&lt;img src=x onerror=alert(1)&gt; &lt;/script&gt; &quot;&#39;", page)

    def test_refuses_what_is_no_sweep(self):
        self.refused(3, "report", "nowhere", says="sweep.toml")
        self.sweep("a")
        shutil.rmtree(self.folder / "a/shards")
        self.refused(2, "report", "a", says="no run of this sweep is done")
        self.sweep("a")
        self.refused(3, "report", "a", "--out", "null.toml/x.html", says="null.toml")

    def test_files_of_others_are_not_replaced(self):
        """An earlier page is, and an empty file, as mktemp makes it."""
        self.sweep("a")
        records = self.folder / "a/shards/0000-of-0001.jsonl"
        for name in (records, self.write("notes.txt", "notes of mine\n"), self.folder / "a/runs.csv"):
            before = pathlib.Path(name).read_bytes()
            self.refused(2, "report", "a", "--out", name, says=f"{name}: is there, but `nephos report` did not write it")
            self.assertEqual(pathlib.Path(name).read_bytes(), before)
        (self.folder / "link").symlink_to("a/shards/lock")
        for name in ("a/shards/lock", "a/shards/./lock", "link"):
            self.refused(2, "report", "a", "--out", name, says="is there, but")
            self.assertEqual((self.folder / "a/shards/lock").read_bytes(), b"")
        empty = self.write("empty.html", "")
        for name in (empty, empty):
            self.call("report", "a", "--out", name)
            self.assertTrue(pathlib.Path(name).read_text().startswith("<!DOCTYPE html>"))

    def test_figures_can_be_read(self):
        """Texts of figures are inside of them, on no other text, and curves are under no legend; values are short."""
        self.sweep("a", axes=("field.background.ext+field.background.hum=log:1e-3..4e-3:5", "field.background.act=log:1e-4..1e-2:4"))
        page = self.page("a")
        self.assertIn(">0.00141<title>0.00141421356237</title>", page)
        self.assertIn(">0.000464<title>0.000464158883361</title>", page)
        self.assertIn(">field.background.{ext,hum}<", page)
        script = """<script>
        const wrong = [];
        const apart = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1 || a.bottom <= b.top + 3 || b.bottom <= a.top + 3;
        for (const name of ["Regimes", "Vertical profiles", "Sizes of clouds"])
            for (const svg of document.querySelectorAll(`svg[aria-label="${name}"]`)) {
                const all = svg.getBoundingClientRect(), frame = svg.querySelector("path.frame")?.getBoundingClientRect();
                const texts = [...svg.querySelectorAll("text")].map((t) => [t.firstChild.data, t.getBoundingClientRect()]);
                texts.forEach(([words, box], n) => {
                    if (box.left < all.left - 1 || box.right > all.right + 1 || box.top < all.top - 1 || box.bottom > all.bottom + 1)
                        wrong.push(`${name}: ${words} is outside`);
                    for (const [other, place] of texts.slice(0, n))
                        if (!apart(box, place)) wrong.push(`${name}: ${words} is on ${other}`);
                    if (frame && !apart(box, frame)) wrong.push(`${name}: ${words} is on the curves`);
                });
                if (texts.length < 5) wrong.push(`${name}: few texts`);
            }
        document.body.dataset.wrong = JSON.stringify(wrong);
        document.body.dataset.figures = document.querySelectorAll('svg[aria-label="Regimes"]').length;
        </script></body>"""
        dom, console, _ = self.browse(self.write("checked.html", page.replace("</body>", script)), "--dump-dom")
        self.assertEqual(console, [])
        self.assertIn('data-figures="1"', dom)
        self.assertIn('data-wrong="[]"', dom, re.findall(r'data-wrong="[^"]*"', dom))

    def test_samples_lists_and_names_are_drawn(self):
        self.sweep("sobol", "--design", "sobol", "--points", "6",
                   axes=("field.background.ext=0.05..0.2", "field.background.act=log:1e-4..1e-2"))
        page = self.page("sobol")
        self.assertEqual(Tags(page).wrong, [])
        self.assertEqual(page.count('aria-label="Regimes over two axes"'), 1)
        self.sweep("names", axes=('lattice.initial=empty,field',))
        page = self.page("names")
        self.assertEqual(Tags(page).wrong, [])
        self.assertIn(">field<", page)
        command = html.unescape(re.search(r"nephos (run scene\.toml .*)", page).group(1))
        self.assertIn("""--set 'lattice.initial="empty"' --seed""", command)
        words = shlex.split(command)
        self.call(words[0], "names/scene.toml", *words[2:])
        self.call("sweep", self.write("null.toml", NULL), "--replicates", "1", "--steps", "200", "--out", "alone")
        page = self.page("alone")
        self.assertEqual(Tags(page).wrong, [])
        self.assertNotIn("Along the axes", page)

    def test_a_browser_shows_it_and_asks_for_nothing(self):
        self.sweep("a", "--axis", "field.background.act=0.001,0.002,0.004")
        page = self.page("a")
        path = self.folder / "a/report.html"
        dom, console, requests = self.browse(path, "--dump-dom")
        self.assertEqual((console, requests), ([], []))
        series = page.count('class="series"')
        self.assertEqual(series, 9)
        self.assertEqual(dom.count('class="uplot'), series)
        self.assertEqual(dom.count("<canvas"), series)
        self.assertEqual(dom.count('style="display: none'), series)
        # Without scripts all figures are there, and none was replaced.
        still = self.write("still.html", page.replace("script-src 'unsafe-inline'", "script-src 'none'"))
        dom, console, requests = self.browse(still, "--dump-dom")
        self.assertIn("Content Security Policy", " ".join(console))
        self.assertEqual(requests, [])
        self.assertEqual(dom.count("<canvas"), 0)
        self.assertEqual(dom.count("<svg"), page.count("<svg"))
        self.assertNotIn('style="display: none', dom)
        self.browse(still, f"--screenshot={self.folder / 'shot.png'}")
        with Image.open(self.folder / "shot.png") as image:
            colours = image.convert("RGB").getcolors(1 << 24)
        self.assertGreater(len(colours), 100)
        self.assertIn((0x2f, 0x9e, 0x77), {colour for _, colour in colours}, "the colour of steady runs")

    def test_the_check_of_the_browser_can_fail(self):
        policy = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
        self.sweep("a")
        page = self.page("a")
        picture = '<img src="http://pictures.test/x.png">'
        self.assertEqual(len(policy.findall(page)), 1)
        broken = self.write("broken.html", page.replace("</body>", "<script>noSuchThing()</script></body>"))
        self.assertIn("noSuchThing", " ".join(self.browse(broken, "--dump-dom")[1]))
        # The policy of the page stops a request; without it the listener hears it.
        kept = self.write("kept.html", page.replace("</body>", picture + "</body>"))
        _, console, requests = self.browse(kept, "--dump-dom")
        self.assertEqual(requests, [])
        self.assertIn("Content Security Policy", " ".join(console))
        loads = self.write("loads.html", policy.sub("", page).replace("</body>", picture + "</body>"))
        self.assertEqual(self.browse(loads, "--dump-dom")[2], ["http://pictures.test/x.png"])


if __name__ == "__main__":
    unittest.main()
