"""Reads a VTU with meshio and prints what the test compares; with a second file, writes the mesh there."""
import sys

import meshio

mesh = meshio.read(sys.argv[1])
if len(sys.argv) > 2:
    ways = {"ascii": {"binary": False}, "binary": {"compression": None}, "zlib": {"compression": "zlib"}}
    mesh.write(sys.argv[2], **ways[sys.argv[3]])
    sys.exit()
tets = mesh.cells_dict["tetra"]
print(len(mesh.points), len(tets), repr(float(mesh.points.sum())), int(tets[-1].sum()),
      int(mesh.cell_data_dict["label"]["tetra"].sum()), repr(float(mesh.point_data["displacement"][3][1])),
      repr(float(mesh.cell_data_dict["energy <1>"]["tetra"][5])))
