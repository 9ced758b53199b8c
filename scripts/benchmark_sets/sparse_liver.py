"""The Image-to-Physical Liver Registration Sparse Data Challenge: a phantom's liver, 112 sparse clouds of its surface.

The public descriptions (Collins et al., IEEE TMI 36, 2017; Heiselman et al., J. Med. Imaging 11, 2024,
doi:10.1117/1.JMI.11.1.015001) tell what the set holds, not the form of its files, and its 159 targets are kept back: results
are sent in. The layout here is this project's: liver.EXT (a closed surface or tetrahedra), sets/NAME.EXT (one cloud each),
nodes.csv (x,y,z: points to carry and send in). Coordinates are taken as they are, mm."""

from . import Benchmark, Case, Layout, required, rules

SURFACES, MESHES = (".stl", ".ply", ".obj", ".vtp", ".vtk"), (".vtu", ".msh", ".inp")
CLOUDS = (".xyz", ".csv", ".ply", ".vtp", ".vtk")


def organ_of(data):
    for ends, column in ((MESHES, "moving_mesh"), (SURFACES, "moving_surface")):
        for end in ends:
            if (data / f"liver{end}").exists():
                return {column: data / f"liver{end}"}
    raise Layout(f"'{data}' holds no liver.stl, .ply, .obj, .vtp, .vtk, .vtu, .msh or .inp")


def cases(data, work):
    del work
    organ = organ_of(data)
    nodes = {"points": data / "nodes.csv"} if (data / "nodes.csv").exists() else {}
    clouds = sorted(path for path in required(data / "sets").iterdir() if path.suffix in CLOUDS)
    if not clouds:
        raise Layout(f"'{data / 'sets'}' holds no point cloud ({', '.join(CLOUDS)})")
    for cloud in clouds:
        yield Case(cloud.stem, {**organ, "fixed_surface": cloud, **nodes}, {"nodes": bool(nodes)})


def score(case, folder):
    """Nothing to score with: whether there is something to send in."""
    return {"nodes to send in": float((folder / "warped_points.csv").exists())}


SOURCE = "Heiselman et al. 2024, abstract, mean and deviation over 159 targets and 112 sets"
BENCHMARK = Benchmark(
    "Sparse-data liver challenge", {"tissue": "liver"},
    (("two biomechanical methods", "TRE 3.1 ± 1.8 and 3.3 ± 1.9 mm", SOURCE),
     ("rigid methods", "TRE 3.8 ± 2.4 to 7.7 ± 4.5 mm", SOURCE)),
    cases, score, rules.means,
    ("the form of the set's files could not be read: this layout is this project's own",
     "targets are kept back: send in cohort/pairs/NAME/warped_points.csv of each set"))
