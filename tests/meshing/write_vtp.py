"""Writes the files of tests/meshing/vtp with VTK's own writer, in every way that it knows (VTK 9.1, python3-vtk9):
    write_vtp.py FOLDER
Six points, lines 0 1 2 and 2 4, a square 0 1 3 5 with normals along z, and the name of the system as 3D Slicer writes it."""
import itertools
import pathlib
import sys

from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkFloatArray, vtkPoints, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

POINTS = [(0, 0, 0), (5, 0, 0), (10, 0.25, 0), (5, 5, 0), (10, 10, -0.125), (0, 5, 0)]


def cells(*each):
    array = vtkCellArray()
    for nodes in each:
        array.InsertNextCell(len(nodes))
        for node in nodes:
            array.InsertCellPoint(node)
    return array


def polydata(system):
    points = vtkPoints()
    normals = vtkFloatArray()
    normals.SetName("up")
    normals.SetNumberOfComponents(3)
    depth = vtkDoubleArray()
    depth.SetName("depth")
    for point in POINTS:
        points.InsertNextPoint(point)
        normals.InsertNextTuple((0, 0, 1))
        depth.InsertNextValue(point[2])
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetLines(cells((0, 1, 2), (2, 4)))
    data.SetPolys(cells((0, 1, 3, 5)))
    data.GetPointData().SetNormals(normals)
    data.GetPointData().SetScalars(depth)
    space = vtkStringArray()
    space.SetName("SPACE")
    space.InsertNextValue(system)
    data.GetFieldData().AddArray(space)
    return data


def write(path, system="LPS", mode="Appended", base64=False, compressor="None", wide=True):
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(polydata(system))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetEncodeAppendedData(base64)
    writer.SetBlockSize(32)  # several blocks
    writer.SetHeaderTypeToUInt64() if wide else writer.SetHeaderTypeToUInt32()
    assert writer.Write() == 1


folder = pathlib.Path(sys.argv[1])
write(folder / "ascii.vtp", mode="Ascii")
for compressor, wide in itertools.product(("None", "ZLib"), (False, True)):
    end = f"{compressor.lower()}-{64 if wide else 32}.vtp"
    write(folder / f"inline-{end}", mode="Binary", compressor=compressor, wide=wide)
    write(folder / f"raw-{end}", compressor=compressor, wide=wide)
    write(folder / f"base64-{end}", base64=True, compressor=compressor, wide=wide)
write(folder / "lz4.vtp", compressor="LZ4")
write(folder / "ras.vtp", system="RAS", compressor="ZLib")
