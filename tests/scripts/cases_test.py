"""Every case of scripts/compare on small files of its data's names: what its tools are given exists, and the program takes it."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
from study import cases, fields, tools

AFFINE = numpy.diag([2.0, -2.0, 2.0, 1.0])
SHAPE = (32, 30, 28)
SHIFT = numpy.array([3.0, -2.0, 1.0])  # mm, moving -> fixed
POINTS = fields.grid_points(SHAPE, AFFINE)
CENTRE = POINTS.mean(axis=0)


def block(place):
    return (numpy.abs(POINTS - place).max(axis=1) < 18.0).reshape(SHAPE).astype(numpy.uint8)


def write_metaimage(path, voxels):
    header = (f"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n"
              f"TransformMatrix = 1 0 0 0 -1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = 2 2 2\n"
              f"DimSize = {' '.join(map(str, SHAPE))}\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n")
    path.write_bytes(header.encode() + voxels.transpose(2, 1, 0).tobytes())


def write_ply(path, points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())


def make_phantom(folder):
    """A block that shifts, under all names that the phantoms' cases read."""
    folder.mkdir(parents=True)
    for when, place in (("preop", CENTRE), ("intraop", CENTRE + SHIFT)):
        labels = block(place)
        for name in (f"{when}_labels", f"{when}_mask"):
            fields.write_image(folder / f"{name}.nii.gz", labels, AFFINE)
        fields.write_image(folder / f"{when}.nii.gz", 100 * labels, AFFINE)
    fields.write_image(folder / "intraop_degraded.nii.gz", 100 * block(CENTRE + SHIFT), AFFINE)
    fields.write_image(folder / "intraop_fov_mask.nii.gz", block(CENTRE), AFFINE)
    fields.write_image(folder / "truth_mask.nii.gz", block(CENTRE), AFFINE)
    fields.write_field(folder / "truth_forward.nii.gz", numpy.broadcast_to(SHIFT, SHAPE + (3,)), AFFINE)
    row = ",".join(map(str, [*CENTRE, *(CENTRE + SHIFT), 1]))
    (folder / "landmarks.csv").write_text(f"pre_x,pre_y,pre_z,intra_x,intra_y,intra_z,label\n{row}\n{row}\n")
    inside = POINTS[block(CENTRE).ravel() > 0]
    write_ply(folder / "intraop_surface.ply", inside[inside[:, 2] == inside[:, 2].max()] + SHIFT)


def make_lung(folder):
    folder.mkdir(parents=True)
    for when, place in (("moving", CENTRE), ("fixed", CENTRE + SHIFT)):
        write_metaimage(folder / f"{when}_mask.mha", block(place))
        write_metaimage(folder / f"{when}.mha", 100 * block(place))
        (folder / f"{when}_pts.txt").write_text(f"point\n2\n{' '.join(map(str, place))}\n{' '.join(map(str, place))}\n")


def make_breaths(folder):
    folder.mkdir(parents=True)
    for number in ("01", "03", "05", "07", "09"):
        for when, place in (("insp", CENTRE), ("exp", CENTRE + SHIFT)):
            fields.write_image(folder / f"copd{number}_{when}_mask.nii.gz", block(place), AFFINE)
        row = ",".join(map(str, [1, *CENTRE, *(CENTRE + SHIFT)]))
        (folder / f"copd{number}_landmarks_LPS.csv").write_text(f"label,ix,iy,iz,ex,ey,ez\n{row}\n{row}\n")


def options(tool):
    """What the program is told besides which files are which data, and how good points of a surface are."""
    data = ["--moving", "--moving-labels", "--fixed", "--fixed-labels", "--fixed-surface", "--match-image"]
    told = [part for part in tool.arguments if not isinstance(part, pathlib.Path) and part not in data]
    if "--surface-sd" in told:
        at = told.index("--surface-sd")
        del told[at:at + 2]
    return tuple(told)


class Cases(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        data, inputs = pathlib.Path(cls.folder.name) / "data", pathlib.Path(cls.folder.name) / "inputs"
        inputs.mkdir()
        for name in ("phantom-brainshift", "phantom-brain-sag", "phantom-liver"):
            make_phantom(data / name)
        make_lung(data / "lung-ct")
        make_breaths(data / "real" / "lung-copd-masks")
        cls.cases = {name: cases.build(name, data, inputs) for name in cases.CASES}

    def each_tool(self):
        for name, case in self.cases.items():
            for tool_name, tool in case.tools.items():
                yield f"{name}: {tool_name}", tool

    def test_every_file_that_a_tool_is_given_exists(self):
        for name, tool in self.each_tool():
            values = [part for value in vars(tool).values() for part in (value if isinstance(value, list) else [value])]
            for path in [part for part in [*values, *tool.settings] if isinstance(part, pathlib.Path)]:
                self.assertTrue(path.is_file(), f"{name} is given {path}, which is not there")

    def test_every_case_holds_tissuewarp_and_something_beside_it(self):
        for name, case in self.cases.items():
            kinds = {type(tool) for tool in case.tools.values()}
            self.assertIn(tools.Tissuewarp, kinds, name)
            self.assertGreater(len(kinds), 1, name)

    def test_one_organ_one_set_of_options(self):
        of_organ = {}
        for name, tool in self.each_tool():
            if isinstance(tool, tools.Tissuewarp):
                organ = "head" if "brain" in name else name.split(",")[0]
                self.assertEqual(of_organ.setdefault(organ, options(tool)), options(tool), name)

    def test_the_program_takes_what_it_is_told(self):
        machine = tools.Machine(pathlib.Path(os.environ["TISSUEWARP"]), 1)
        for name, tool in self.each_tool():
            if isinstance(tool, tools.Tissuewarp):
                [(command, _)] = tool.commands(pathlib.Path(self.folder.name) / "out", machine)
                done = subprocess.run([*map(str, command), "--dry-run"], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, f"{name}: {done.stderr}")


if __name__ == "__main__":
    unittest.main()
