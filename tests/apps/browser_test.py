"""report.html as a person meets it: a browser without a window opens it, scrolls, wipes and turns.

Skipped without Debian's chromium and chromedriver, which scripts/setup --browser installs."""

import base64
import os
import unittest

import numpy

from browser import Browser, installed
from phantom import Phantom

PANELS = ("axial", "coronal", "sagittal", "surface")


@unittest.skipUnless(installed(), "no chromium with chromedriver; run scripts/setup --browser")
class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = Phantom()
        cls.addClassCleanup(cls.phantom.temporary.cleanup)
        result = cls.phantom.register("--edge-length", "4", "--rounds", "2", "--device", "cpu")
        assert result.returncode == 0, result.stderr
        cls.page = cls.phantom.output / "report.html"
        cls.browser = Browser()
        cls.addClassCleanup(cls.browser.end)

    def setUp(self):
        self.browser.open(self.page)
        self.browser.wait("document.getElementById('viewer').dataset.ready")

    def pixels(self, panel):
        """Of a panel's canvas, rows x columns x RGB from 0 to 255."""
        width, text = self.browser.run("""
            const from = document.getElementById(arguments[0]), canvas = document.createElement("canvas");
            canvas.width = canvas.height = from.width / 2;
            const context = canvas.getContext("2d");
            context.drawImage(from, 0, 0, canvas.width, canvas.width);
            let text = "";
            for (const byte of context.getImageData(0, 0, canvas.width, canvas.width).data) text += String.fromCharCode(byte);
            return [canvas.width, btoa(text)];""", panel)
        return numpy.frombuffer(base64.b64decode(text), numpy.uint8).reshape(width, width, 4)[..., :3].astype(float)

    def text(self, identity):
        return self.browser.run("return document.getElementById(arguments[0]).textContent", identity)

    def click(self, selector):
        self.browser.run("document.querySelector(arguments[0]).click()", selector)
        self.browser.settle()

    def changed(self, before, panel):
        return (numpy.abs(self.pixels(panel) - before) > 24).any(axis=-1).mean()

    def test_all_views_are_drawn_without_complaint(self):
        self.assertEqual(self.browser.run("return document.getElementById('viewer').dataset.ready"), "solid",
                         self.text("no-surface"))
        for panel in PANELS:
            self.assertGreater(self.pixels(panel).std(), 15, panel)
        solid = self.pixels("surface")
        self.assertGreater(((solid.max(axis=-1) - solid.min(axis=-1)) > 40).mean(), 0.05, "no colours of displacement")
        self.assertIn("moved", self.text("readout"))
        self.assertEqual(self.browser.log(), [])
        self.assertEqual(self.browser.run("return performance.getEntriesByType('resource')"
                                          ".filter((entry) => !entry.name.startsWith('data:')).length"), 0)
        self.assertLess(os.path.getsize(self.page), 6_000_000)

    def test_what_is_doubtful_stands_above_the_views(self):
        self.assertTrue(self.browser.run(
            "const box = document.querySelector('.box'), viewer = document.getElementById('viewer');"
            "return Boolean(box.compareDocumentPosition(viewer) & Node.DOCUMENT_POSITION_FOLLOWING)"))

    def test_a_click_in_one_plane_moves_the_others(self):
        self.browser.run("document.getElementById('axial').scrollIntoView()")
        before = {panel: self.pixels(panel) for panel in PANELS}
        place = self.text("readout")
        self.browser.drag("#axial", (0.35, 0.4), (0.37, 0.42))
        self.assertNotEqual(self.text("readout"), place)
        for panel in PANELS[:3]:
            self.assertGreater(self.changed(before[panel], panel), 0.002, panel)

    def test_a_slider_scrolls_its_plane(self):
        before = self.pixels("coronal")
        self.browser.run("const slider = document.getElementById('at-coronal'); slider.value = 12.5;"
                         "slider.dispatchEvent(new Event('input'))")
        self.browser.settle()
        self.assertIn("P 12.5", self.text("readout"))
        self.assertGreater(self.changed(before, "coronal"), 0.002)

    def test_the_line_wipes_from_before_to_after(self):
        """Left of it the preoperative image, right of it the warped one: what is swept over changes."""
        self.browser.run("document.getElementById('axial').scrollIntoView()")
        self.click("button[data-side=left][data-image=before]")
        self.click("#outlines")
        before = self.pixels("axial")
        self.browser.drag("#axial", (0.5, 0.9), (0.9, 0.9))
        self.assertGreater(self.changed(before, "axial"), 0.005)
        self.click("button[data-side=left][data-image=after]")
        after = self.pixels("axial")
        self.assertGreater((numpy.abs(after - before) > 24).any(axis=-1).mean(), 0.005)

    def test_the_organ_turns_and_shows_what_is_asked_for(self):
        self.browser.run("document.getElementById('surface').scrollIntoView()")
        for action, least in ((lambda: self.browser.drag("#surface", (0.3, 0.5), (0.7, 0.6)), 0.02),
                              (lambda: self.click("#through"), 0.02),
                              (lambda: self.browser.run(
                                  "const s = document.getElementById('moved'); s.value = 0;"
                                  "s.dispatchEvent(new Event('input'))"), 0.005),
                              (lambda: self.browser.run(
                                  "const s = document.getElementById('colour'); s.value = 'error';"
                                  "s.dispatchEvent(new Event('change'))"), 0.02)):
            before = self.pixels("surface")
            action()
            self.browser.settle()
            self.assertGreater(self.changed(before, "surface"), least)
        self.assertEqual(self.browser.log(), [])


if __name__ == "__main__":
    unittest.main()
