"""The problems of data/reference as scenes, through `simulate`, against the solutions of independent codes.

Each is solved on two meshes. The finer one must agree within the reference's uncertainty and 1.5 times the distance to
the coarser one, which is more than it has left to go itself if it converges in first order or better. The strict bars,
on four meshes, are those of docs/lab/verification.md. Corners, where the solutions are singular, are left out. Bars that
bend and ν = 0.45 take averaged pressure, where plain tetrahedra lock. mm, kPa and s; the references are in SI.
"""

import csv
import h5py
import json
import math
import os
import pathlib
import subprocess
import tempfile
import unittest

import meshio
import numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["TISSUEWARP"]
LAWS = {"iso": "neo-hookean-iso", "lnJ": "neo-hookean-lnj"}
METRE = 1000.0
EQUILIBRIUM = 'kind = "equilibrium"\ntolerance_mm = 0.01'
BENDING = EQUILIBRIUM + '\nelement = "averaged-pressure"'


def reference(name):
    return json.loads((ROOT / "data" / "reference" / f"{name}.json").read_text())


def tissue(law, material, label=1, stiffer=1.0):
    """[label.n] of one of the reference's two laws, from its constants in Pa."""
    nu = material.get("nu", 0.0)
    if "lambda_Pa" in material:
        first, shear = material["lambda_Pa"], material["mu_Pa"]
        modulus, nu = shear * (3 * first + 2 * shear) / (first + shear), first / (2 * (first + shear))
    else:
        modulus = material["E_Pa"]
    return (f'[label.{label}]\nlaw = "{LAWS[law]}"\nyoungs_modulus_kpa = {1e-3 * stiffer * modulus!r}\n'
            f"poissons_ratio = {nu!r}\n")


def box(size, cells, lower=(0, 0, 0)):
    return f"[geometry]\nbox = {{ size_mm = {list(size)}, cells = {list(cells)}, lower_mm = {list(lower)} }}\n"


def side(name, which):
    return f'[set.{name}]\nside = "{which}"\n'


def fixed(name, axes="xyz"):
    return f'[[fixed]]\nset = "{name}"\naxes = "{axes}"\n'


def moved(name, displacement, axes="xyz"):
    return f'[[motion]]\nset = "{name}"\ndisplacement_mm = {list(displacement)}\naxes = "{axes}"\n'


def rms(vectors):
    return math.sqrt(numpy.mean(numpy.sum(numpy.square(vectors), axis=1)))


class Reference(unittest.TestCase):
    def simulate(self, scene, points=(), solve=EQUILIBRIUM, files=lambda folder: None):
        """Displacements at the points, frames × points × 3 (rest is left out), and the nodes and theirs at the end."""
        with tempfile.TemporaryDirectory(prefix="tissuewarp-test-") as name:
            folder = pathlib.Path(name)
            files(folder)
            probes = "".join(f'[[probe]]\nname = "{i}"\nat_mm = {[float(x) for x in p]}\n' for i, p in enumerate(points))
            (folder / "scene.toml").write_text(f"{scene}[solve]\n{solve}\n{probes}")
            run = subprocess.run([PROGRAM, "simulate", folder / "scene.toml", "--output", folder / "out", "--device", "cpu",
                                  "--quiet"], capture_output=True, text=True)
            self.assertEqual(run.returncode, 0, run.stderr)
            with h5py.File(folder / "out" / "displacement.h5") as record:
                nodes, end = record["mesh/nodes"][:].astype(float), record["displacement"][-1].astype(float)
            with (folder / "out" / "probes.csv").open() as table:
                rows = list(csv.DictReader(table))
        at = [[float(row[axis]) for axis in ("dx_mm", "dy_mm", "dz_mm")] for row in rows]
        return numpy.array(at).reshape(-1, max(len(points), 1), 3)[1:], nodes, end

    def require_agreement(self, scene_of, sizes, points, expected, uncertainty, axes=(0, 1, 2), files_of=None, solve=EQUILIBRIUM):
        """scene_of(size) on the coarser and the finer of two sizes; numbers in mm."""
        found = [self.simulate(scene_of(size), points, solve, files_of(size) if files_of else lambda folder: None)[0][-1]
                 for size in sizes]
        coarse, fine, expected = (numpy.asarray(each)[:, list(axes)] for each in (*found, expected))
        self.assertGreater(rms(expected), 1, "a problem that moves")
        off, left = rms(fine - expected), rms(fine - coarse)
        self.assertLess(off, 1.5 * left + uncertainty, f"of {rms(expected):.2f} mm")
        self.assertLess(left, 0.25 * rms(expected), "meshes that tell")

    def require_cube(self, name, displacement):
        problem = reference(name)
        for law, values in problem["values"].items():
            with self.subTest(problem=name, law=law):
                self.require_agreement(
                    lambda n: box([100] * 3, [n] * 3) + tissue(law, problem["material"]) + side("low", "-z") + fixed("low") +
                    side("high", "+z") + moved("high", displacement), (8, 16), METRE * numpy.array(problem["points"]),
                    METRE * numpy.array(values["u"]["value"]), METRE * rms(values["u"]["uncertainty"]))

    def test_a_cube_pulled(self):
        self.require_cube("p1_cube_stretch", (0, 0, 20))

    def test_a_cube_sheared(self):
        self.require_cube("p2_cube_shear", (50, 0, 0))

    def test_a_cube_pressed(self):
        self.require_cube("p2_cube_compress_mild", (0, 0, -15))
        self.require_cube("p2_cube_compress", (0, 0, -30))

    def test_homogeneous_states(self):
        held = "".join(side(name, which) + fixed(name, which[1])
                       for name, which in (("x", "-x"), ("y", "-y"), ("z", "-z")))
        for states in reference("p3_patch")["values"]:
            if states["form"] not in LAWS:
                continue
            material = tissue(states["form"], {"lambda_Pa": states["lambda"], "mu_Pa": states["mu"]})
            for kind, sides in (("uniaxial_z", "z"), ("equibiaxial_xy", "xy")):
                for state in states[kind]:
                    stretch = numpy.diag(state["F"])
                    moves = "".join(side(f"moved_{axis}", f"+{axis}") +
                                    moved(f"moved_{axis}", 100 * (stretch - 1), axis) for axis in sides)
                    with self.subTest(law=states["form"], kind=kind, stretch=state["F"][2][2]):
                        _, nodes, end = self.simulate(box([100] * 3, [3] * 3) + material + held + moves)
                        self.assertLess(numpy.abs(end - nodes * (stretch - 1)).max(), 0.01)

    def require_cook(self, name, law, key, values, cells_z):
        material = {"E_Pa": 3000.0, "nu": float(key.split("=")[1])}
        flat = "" if cells_z > 1 else "[set.all]\n" + fixed("all", "z")
        quantities = ("tip_mid_z_mid", "tip_mid_z_face") if cells_z > 1 else ("tip_mid",)
        points = [(48, 52, 0), (48, 52, 5)][:len(quantities)]
        axes = (0, 1, 2) if cells_z > 1 else (0, 1)

        def files_of(n):
            return lambda folder: write_cook(folder / "cook.vtu", n, max(1, n * (cells_z > 1) // 4 * 2))

        expected = numpy.zeros((len(points), 3))
        for row, quantity in enumerate(quantities):
            expected[row, :len(values[quantity]["value"])] = METRE * numpy.array(values[quantity]["value"])
        with self.subTest(problem=name, law=law, key=key):
            self.require_agreement(
                lambda n: '[geometry]\nmesh = "cook.vtu"\n' + tissue(law, material) + side("wall", "-x") + fixed("wall") +
                side("end", "+x") + '[[traction]]\nset = "end"\ntraction_kpa = [0, 0.08, 0]\n' + flat,
                (8, 16), points, expected, METRE * max(max(values[q]["uncertainty"]) for q in quantities), axes, files_of,
                BENDING)

    def test_cooks_membrane(self):
        for key, laws in reference("p4_cook_3d")["values"].items():
            for law, values in laws.items():
                self.require_cook("p4_cook_3d", law, key, values, 2)

    def test_cooks_membrane_in_plane_strain(self):
        for key, laws in reference("p4_cook_plane_strain")["values"].items():
            for law, values in laws.items():
                self.require_cook("p4_cook_plane_strain", law, key, values, 1)

    def test_a_cantilever(self):
        problem = reference("p5_cantilever")
        for law, values in problem["values"].items():
            with self.subTest(law=law):
                self.require_agreement(
                    lambda n: box([1000, 250, 250], [4 * n, n, n], [0, -125, -125]) + tissue(law, problem["material"]) +
                    side("wall", "-x") + fixed("wall") + "[gravity]\nto = [0, -1, 0]\n", (4, 8),
                    METRE * numpy.array(problem["points"]), METRE * numpy.array(values["u"]["value"]),
                    METRE * rms(values["u"]["uncertainty"]), solve=BENDING)

    def test_a_bar_twisted_by_half_a_turn(self):
        problem = reference("p5_twist")
        for law, values in problem["values"].items():
            with self.subTest(law=law):
                self.require_agreement(
                    lambda n: box([1000, 1000, 6000], [n, n, 3 * n], [-500, -500, 0]) + tissue(law, problem["material"]) +
                    side("low", "-z") + fixed("low") + side("high", "+z") + '[[motion]]\nset = "high"\nrotation = '
                    "{ point_mm = [0, 0, 6000], axis = [0, 0, 1], degrees = 180 }\n", (4, 8),
                    METRE * numpy.array(problem["points"]), METRE * numpy.array(values["u"]["value"]),
                    METRE * rms(values["u"]["uncertainty"]))

    def test_an_ellipsoid_pressed(self):
        for name, inclusion in (("p6_ellipsoid_plain", False), ("p6_ellipsoid_inclusion", True)):
            problem = reference(name)
            for law, values in problem["values"].items():
                shapes = "[[geometry.shape]]\nellipsoid = { centre_mm = [0, 0, 0], radii_mm = [70, 55, 50] }\n"
                tissues = tissue(law, problem["material"])
                if inclusion:
                    shapes += ("[[geometry.shape]]\nlabel = 2\nellipsoid = { centre_mm = [20, 0, 5], "
                               "radii_mm = [10, 10, 10] }\n")
                    tissues += tissue(law, problem["material"], 2, 20)
                patches = ("[set.below]\nsurface_of = 0\nhalf_space = { point_mm = [0, 0, -30], normal = [0, 0, 1] }\n" +
                           fixed("below") + "[set.above]\nsurface_of = 0\nhalf_space = { point_mm = [0, 0, 40], "
                           "normal = [0, 0, -1] }\n" + moved("above", (0, 0, -10)))
                with self.subTest(problem=name, law=law):
                    self.require_agreement(
                        lambda edge: f"[geometry]\nedge_length_mm = {edge}\n" + shapes + tissues + patches, (8, 4.5),
                        METRE * numpy.array(problem["points"]), METRE * numpy.array(values["u"]["value"]),
                        METRE * rms(values["u"]["uncertainty"]))

    def test_a_half_ball_under_gravity(self):
        problem = reference("p7_breast")
        points = [(METRE * r, 0, METRE * z) for r, z in problem["points"]]
        for posture, to in (("prone", 1), ("supine", -1)):
            for law, values in problem["values"][posture].items():
                expected = [(METRE * r, 0, METRE * z) for r, z in values["u_rz"]["value"]]
                with self.subTest(posture=posture, law=law):
                    self.require_agreement(
                        lambda edge: half_ball(60, edge) + tissue(law, problem["material"]) + side("wall", "-z") +
                        f"depth_mm = {0.2 * edge}\n" + fixed("wall") + f"[gravity]\nto = [0, 0, {to}]\n", (9, 5), points,
                        expected, METRE * rms(values["u_rz"]["uncertainty"]), (0, 2))

    def test_a_bar_that_vibrates(self):
        problem = reference("p8_bar_vibration")
        for key in ("A_nu0", "B_roller_nu0.3", "B_clamped_nu0.3", "B_roller_nu0.45", "B_clamped_nu0.45"):
            case = problem["values"][key]
            roller = fixed("base", "xyz" if "clamped" in key else "z")
            middle = '[set.axis]\nbox = { lower_mm = [-0.1, -0.1, -1], upper_mm = [0.1, 0.1, 200] }\n' + fixed("axis", "xy")
            solve = ('kind = "dynamics"\nduration_s = 0.3\nframes = 300\ndamping_per_s = 0')
            with self.subTest(key):
                # Weight that is there at once: the end swings about where it will hang and is back after a period.
                found, _, _ = self.simulate(
                    box([20, 20, 100], [4, 4, 20], [-10, -10, 0]) + tissue("iso", {"E_Pa": 3000.0, "nu": case["nu"]}) +
                    side("base", "-z") + roller + (middle if "clamped" not in key else "") +
                    "[gravity]\nto = [0, 0, 1]\nmagnitude_mm_s2 = 100\ncurve = [[0, 1]]\n", [(0, 0, 100)], solve)
                height = found[:, 0, 2]
                turn = 150 + int(numpy.argmin(height[150:]))  # frames of 1 ms
                a, b, c = height[turn - 1:turn + 2]
                period = 1e-3 * (turn + 1 + 0.5 * (a - c) / (a - 2 * b + c))
                self.assertGreater(height.max(), 0.1)
                self.assertAlmostEqual(period, case["period_T1"], delta=0.02 * case["period_T1"])

    def test_a_viscous_cube_held(self):
        problem = reference("p8_viscoelastic")
        case, material = problem["values"]["c_uniaxial_step"], problem["material"]
        times = [t for t in problem["values"]["t"] if 0.3 <= t <= 1]  # later than the waves of the jump
        scene = ("density_kg_m3 = 100\n" + box([100] * 3, [4] * 3) + tissue("iso", material) +
                 f"prony = [[{material['g1']}, {material['tau1_s']}]]\n" +
                 "".join(side(name, which) + fixed(name, which[1]) for name, which in (("x", "-x"), ("y", "-y"), ("z", "-z"))) +
                 side("high", "+z") + moved("high", (0, 0, 20), "z") + "curve = [[0, 0], [0.02, 1]]\n")
        found, _, _ = self.simulate(scene, [(100, 50, 50)],
                                    'kind = "dynamics"\nduration_s = 1\nframes = 20\ndamping_per_s = 100')
        for time in times:
            expected = case["lateral_stretch"][problem["values"]["t"].index(time)]
            self.assertAlmostEqual(1 + found[round(20 * time) - 1, 0, 0] / 100, expected, delta=4e-5, msg=f"at {time} s")

    def test_a_block_between_planes(self):
        problem = reference("p9_block_contact")
        for law, states in problem["values"].items():
            for state in states:
                stretch = state["lateral_stretch"]
                with self.subTest(law=law, compression=state["compression"]):
                    _, nodes, end = self.simulate(
                        box([100] * 3, [4] * 3) + tissue(law, problem["material"]) + "".join(
                            side(name, which) + fixed(name, which[1])
                            for name, which in (("x", "-x"), ("y", "-y"), ("z", "-z"))) +
                        "[[contact]]\nplane = { point_mm = [0, 0, 100], normal = [0, 0, -1] }\n"
                        f"displacement_mm = [0, 0, {-100 * state['compression']}]\n")
                    expected = nodes * (numpy.array([stretch, stretch, 1 - state["compression"]]) - 1)
                    self.assertLess(numpy.abs(end - expected).max(), 0.05)

    def test_a_half_ball_pressed_by_a_plane(self):
        problem = reference("p9_halfball_contact")
        for law, values in problem["values"].items():
            depth, widest = [(depth, METRE * widest) for depth, widest in
                             zip(problem["delta_over_R"], values["max_radius_m"]["value"]) if widest is not None][-1]

            def bulge(edge):
                _, nodes, end = self.simulate(
                    half_ball(50, edge) + tissue(law, problem["material"]) + side("wall", "-z") +
                    f"depth_mm = {0.2 * edge}\n" + fixed("wall") +
                    "[[contact]]\nplane = { point_mm = [0, 0, 50], normal = [0, 0, -1] }\n"
                    f"displacement_mm = [0, 0, {-50 * depth}]\n")
                return numpy.linalg.norm((nodes + end)[:, :2], axis=1).max()

            with self.subTest(law):
                coarse, fine = bulge(8), bulge(5)
                self.assertGreater(widest, 50.2)
                self.assertLess(abs(fine - widest), 1.5 * abs(fine - coarse) + 0.05)


def half_ball(radius, edge):
    return (f"[geometry]\nedge_length_mm = {edge}\n[[geometry.shape]]\nellipsoid = {{ centre_mm = [0, 0, 0], radii_mm = "
            f"{[radius] * 3} }}\n[[geometry.shape]]\nlabel = 0\nbox = {{ lower_mm = {[-2 * radius] * 3}, "
            f"upper_mm = {[2 * radius, 2 * radius, 0]} }}\n")


def write_cook(path, cells, cells_z):
    """Cook's membrane of cells × cells × cells_z times six tetrahedra."""
    axes = [numpy.arange(cells + 1) / cells, numpy.arange(cells + 1) / cells, numpy.arange(cells_z + 1) / cells_z]
    s, t, w = (each.ravel() for each in numpy.meshgrid(*axes, indexing="ij"))
    nodes = numpy.stack([48 * s, (1 - t) * 44 * s + t * (44 + 16 * s), 10 * w - 5], axis=1)
    index = numpy.arange(len(nodes)).reshape(cells + 1, cells + 1, cells_z + 1)
    tets = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        step = numpy.zeros((4, 3), int)
        for k, axis in enumerate(order):
            step[k + 1:, axis] = 1
        corners = [index[a:cells + a, b:cells + b, c:cells_z + c].ravel() for a, b, c in step]
        even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        tets.append(numpy.stack(corners if even else [corners[0], corners[2], corners[1], corners[3]], axis=1))
    tets = numpy.concatenate(tets)
    meshio.Mesh(nodes, [("tetra", tets)], cell_data={"label": [numpy.ones(len(tets), numpy.int32)]}).write(path)


if __name__ == "__main__":
    unittest.main()
