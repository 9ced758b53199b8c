"""The verbs as command-line modules of 3D Slicer: their XML against the schema, and a run as its execution model makes it."""

import os
import pathlib
import re
import subprocess
import sys
import unittest
import xml.etree.ElementTree

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE.parent / "apps"))
from phantom import PhantomTest, run  # noqa: E402

MODULES = ["register", "mesh", "warp", "simulate"]
# No choice of a run in a panel, or one that the values which 3D Slicer always passes would override (config).
LEFT_OUT = {"register": {"help", "help-all", "config", "dry-run", "quiet"}, "mesh": {"help", "help-all", "quiet"}, "warp": {"help", "help-all", "quiet"},
            "simulate": {"help", "help-all", "quiet", "init", "ablate"}}
RETURNED = {"register": {"doubts"}, "mesh": {"tetrahedra"}}


def description(verb):
    return run(verb, "--xml").stdout


def parameters(verb):
    groups = xml.etree.ElementTree.fromstring(description(verb)).findall("parameters")
    return [parameter for group in groups for parameter in group if parameter.find("name") is not None]


def options_of_help(verb):
    return set(re.findall(r"^  (?:-\w,)?--([a-z-]+)", run(verb, "--help-all").stdout, re.MULTILINE))


def launcher(verb, folder):
    """The script as it is installed for this verb."""
    path = folder / f"tissuewarp-{verb}"
    path.symlink_to(ROOT / "slicer" / "cli-modules" / "tissuewarp-module")
    return path


class Description(unittest.TestCase):
    def test_it_keeps_to_the_schema(self):
        for verb in MODULES:
            text = description(verb)
            self.assertTrue(text.startswith("<?xml "), text[:20])
            result = subprocess.run(["xmllint", "--noout", "--schema", HERE / "module_description.xsd", "-"],
                                    input=text, capture_output=True, text=True)
            self.assertEqual(result.returncode, 0, f"{verb}: {result.stderr}")

    def test_the_schema_refuses_what_slicer_refuses(self):
        text = description("register")
        for good, bad in [("<longflag>moving_labels<", "<longflag>moving-labels<"), ("<directory>", "<folder>"),
                          ('type="label"', 'type="labels"'), ("<channel>input<", "<channel>in<"),
                          ("<name>fixed<", "<name>moving<")]:
            self.assertIn(good, text)
            broken = text.replace(good, bad, 1).replace("</directory>", "</folder>" if bad == "<folder>" else "</directory>", 1)
            result = subprocess.run(["xmllint", "--noout", "--schema", HERE / "module_description.xsd", "-"],
                                    input=broken, capture_output=True, text=True)
            self.assertNotEqual(result.returncode, 0, bad)

    def test_every_option_is_in_it_or_left_out(self):
        for verb in MODULES:
            described = {p.findtext("longflag").replace("_", "-") for p in parameters(verb) if p.find("longflag") is not None}
            self.assertEqual(described | LEFT_OUT[verb], options_of_help(verb), verb)
            self.assertEqual(described & LEFT_OUT[verb], set(), verb)
            returned = {p.findtext("name") for p in parameters(verb) if p.find("longflag") is None and p.find("index") is None}
            self.assertEqual(returned, RETURNED.get(verb, set()))

    def test_files_have_the_kind_that_their_readers_take(self):
        kinds = {p.findtext("name"): (p.tag, p.get("type"), p.findtext("channel")) for p in parameters("register")}
        self.assertEqual(kinds["moving"], ("image", "scalar", "input"))
        self.assertEqual(kinds["fixed_labels"], ("image", "label", "input"))
        self.assertEqual(kinds["fixed_surface"], ("geometry", "model", "input"))
        self.assertEqual(kinds["moving_points"], ("pointfile", None, "input"))
        self.assertEqual(kinds["initial_transform"], ("transform", None, "input"))
        self.assertEqual(kinds["output"], ("directory", None, "output"))
        self.assertEqual(kinds["rounds"][0], "integer")
        self.assertEqual(kinds["element"][0], "string-enumeration")

    def test_spin_boxes_hold_the_defaults(self):
        for verb in MODULES:
            for parameter in parameters(verb):
                limits = parameter.find("constraints")
                if limits is None:
                    continue
                default, step = float(parameter.findtext("default")), float(limits.findtext("step"))
                self.assertLessEqual(float(limits.findtext("minimum")), default)
                self.assertLessEqual(default, float(limits.findtext("maximum")))
                self.assertAlmostEqual(default / step, round(default / step), places=6, msg=parameter.findtext("name"))

    def test_other_verbs_are_no_modules(self):
        result = run("evaluate", "--xml")
        self.assertEqual(result.returncode, 2)
        self.assertIn("there is no option '--xml'", result.stderr)


class ExecutionModel(PhantomTest):
    def as_slicer_runs(self, verb, *arguments):
        """All defaults of the XML are passed but empty ones, as 3D Slicer does."""
        command = [launcher(verb, self.phantom.folder)]
        for parameter in parameters(verb):
            default = parameter.findtext("default")
            if default and parameter.find("longflag") is not None and parameter.tag != "boolean":
                command += ["--" + parameter.findtext("longflag"), default]
        return subprocess.run(list(map(str, [*command, *arguments])), capture_output=True, text=True, timeout=110,
                              env={**os.environ, "LD_LIBRARY_PATH": "/nowhere"})

    def test_register_tells_progress_and_doubts(self):
        returned = self.phantom.folder / "returned.params"
        result = self.as_slicer_runs(
            "register", "--moving", self.phantom.moving, "--moving_labels", self.phantom.moving_labels, "--fixed",
            self.phantom.fixed, "--fixed_labels", self.phantom.fixed_labels, "--output", self.phantom.output,
            "--edge_length", 8, "--rounds", 1, "--device", "cpu", "--returnparameterfile", returned)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue((self.phantom.output / "transform.h5").is_file())
        fractions = [float(f) for f in re.findall(r"<filter-progress>([^<]*)</filter-progress>", result.stdout)]
        self.assertGreater(len(fractions), 5)
        self.assertEqual(fractions, sorted(fractions))
        self.assertTrue(0 <= fractions[0] and fractions[-1] <= 1)
        starts = re.findall(r"<filter-start>\s*<filter-name>([^<]*)</filter-name>", result.stdout)
        ends = re.findall(r"<filter-end>\s*<filter-name>([^<]*)</filter-name>", result.stdout)
        self.assertEqual(starts, ends)
        self.assertEqual(starts[0], "reading")
        self.assertRegex(returned.read_text(), r"^doubts = (none|[a-z]+\.[a-z_]+(, [a-z]+\.[a-z_]+)*)\n$")

    def test_mesh_returns_its_size(self):
        returned, mesh = self.phantom.folder / "returned.params", self.phantom.folder / "mesh.vtu"
        result = self.as_slicer_runs("mesh", "--output", mesh, "--returnparameterfile", returned, "--edge_length", 8,
                                     "--label_edge_length", "1=8,2=6", self.phantom.moving_labels)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue(mesh.is_file())
        self.assertRegex(returned.read_text(), r"^tetrahedra = [1-9]\d+\n$")

    def test_warp_takes_what_slicer_writes(self):
        self.assertEqual(self.phantom.register("--edge-length", 8, "--rounds", 1, "--no-error-estimate").returncode, 0)
        warped = self.phantom.folder / "warped.nrrd"
        result = self.as_slicer_runs("warp", "--output", warped, "--displacement",
                                     self.phantom.output / "displacement_fixed_to_moving.nii.gz", self.phantom.moving)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue(warped.is_file())
        self.assertIn("<filter-name>warping</filter-name>", result.stdout)

    def test_simulate(self):
        scene, frames = self.phantom.folder / "cube.toml", self.phantom.folder / "frames"
        self.assertEqual(run("simulate", "--init", "cube", scene).returncode, 0)
        result = self.as_slicer_runs("simulate", "--output", frames, scene)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue((frames / "summary.json").is_file())
        self.assertIn("<filter-name>simulating</filter-name>", result.stdout)

    def test_people_see_no_tags(self):
        result = run("mesh", self.phantom.moving_labels, "-o", self.phantom.folder / "mesh.vtu", "--edge-length", 8)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn("<filter", result.stdout)


if __name__ == "__main__":
    unittest.main()
