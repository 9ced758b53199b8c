"""What is compared: for each case the targets with known motion, the organ, and each tool with what it is given.

A case is a function of the data folder and of a folder for inputs made here; it returns None when its data are missing.
To add an option of tissuewarp to the comparison, add one line to a case's `tools`.
"""

import dataclasses
import os
import pathlib

import numpy
from scipy import ndimage

from . import degrade, fields, scoring
from .tools import Elastix, Plastimatch, RigidIcp, Tissuewarp

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
DEPTH_CAP = 20.0  # mm

# Options of `tissuewarp register`: one set for all pairs of an organ, of what its user knows before seeing a result.
HEAD = ["--no-align"]  # navigation holds both images in one frame
LUNG = ["--resample-labels", "--default-poissons-ratio", "0.3"]  # the masks lie on grids of their own; air leaves the tissue


@dataclasses.dataclass
class Case:
    targets: dict  # name -> preoperative and intraoperative points, LPS mm, n x 3 each
    fixed_organ: pathlib.Path  # intraoperative mask or label map; folds inside it are counted apart
    moving_organ: pathlib.Path  # preoperative
    tools: dict  # name in the table -> tool


def made(path, make):
    """A file made once: `make` gets the path to write."""
    if not path.exists():
        unfinished = path.with_name(f"unfinished-{os.getpid()}-{path.name}")
        make(unfinished)
        unfinished.rename(path)
    return path


def depth_map(labels_path, folder):
    """Labels as the grey image that intensity-based programs follow best.

    20 mm plus the depth under the boundary of all labels together (outside: less the distance), between 0 and 40 mm, plus the
    same for every label but the first. Far outside it is 0, what those programs take for everything beyond the image, and its
    centre of gravity is the organ's.
    """
    def make(path):
        labels, affine = fields.read_image(labels_path)
        spacing = numpy.linalg.norm(affine[:3, :3], axis=0)
        depth = lambda mask: DEPTH_CAP + numpy.clip(ndimage.distance_transform_edt(mask, sampling=spacing)
                                                    - ndimage.distance_transform_edt(~mask, sampling=spacing), -DEPTH_CAP, DEPTH_CAP)
        inner = [value for value in numpy.unique(labels) if value > 0][1:]
        total = depth(labels > 0) + sum(depth(labels == value) for value in inner)
        fields.write_image(path, total.astype(numpy.float32), affine)
    name = labels_path.name.split(".")[0]
    return made(folder / f"{labels_path.parent.name}-{name}-depth.nii.gz", make)


def preop(data, labels="preop_labels"):
    """Arguments of `tissuewarp register` for what is known before the operation."""
    return ["--moving", data / "preop.nii.gz", "--moving-labels", data / f"{labels}.nii.gz"]


def intraop_labels(data, labels="intraop_labels"):
    return ["--fixed", data / "intraop.nii.gz", "--fixed-labels", data / f"{labels}.nii.gz"]


def intraop_surface(data, deviation_mm):
    """Points of the surface with the deviation that their maker states."""
    return ["--fixed-surface", data / "intraop_surface.ply", "--surface-sd", deviation_mm]


def brain_shift_folder(data):
    shared = data / "phantom-brainshift"
    return shared if shared.exists() else ROOT / "data" / "brainshift"


def brain_shift(data, tools):
    moving, fixed = scoring.read_csv_landmarks(data / "landmarks.csv")
    moved = scoring.distances(moving, fixed) > 2.0
    return Case(targets={"landmarks moved > 2 mm": (moving[moved], fixed[moved]),
                         "whole brain": scoring.truth_targets(data / "truth_forward.nii.gz", data / "truth_mask.nii.gz")},
                fixed_organ=data / "intraop_labels.nii.gz", moving_organ=data / "preop_labels.nii.gz", tools=tools)


def brain_shift_volume(data, inputs):
    data = brain_shift_folder(data)
    pair = data / "intraop.nii.gz", data / "preop.nii.gz"
    return brain_shift(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data), "--fixed", data / "intraop.nii.gz"]),
        "elastix": Elastix(*pair, ["elastix-bspline-correlation.txt"]),
        "plastimatch": Plastimatch(*pair, "plastimatch-mean-squares.txt"),
    })


def brain_shift_labels(data, inputs):
    data = brain_shift_folder(data)
    pair = [depth_map(data / f"{when}_labels.nii.gz", inputs) for when in ("intraop", "preop")]
    return brain_shift(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data), *intraop_labels(data)]),
        "elastix": Elastix(*pair, ["elastix-labels.txt"]),
        "plastimatch": Plastimatch(*pair, "plastimatch-mean-squares.txt"),
    })


def brain_shift_degraded(data, inputs):
    data = brain_shift_folder(data)
    image, view = inputs / "brain-shift-degraded.nii.gz", inputs / "brain-shift-degraded-view.nii.gz"
    if not (image.exists() and view.exists()):
        degrade.degrade_files(data / "intraop.nii.gz", data / "intraop_labels.nii.gz", data / "intraop_surface.ply", image, view)
    pair = image, data / "preop.nii.gz"
    return brain_shift(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data), "--fixed", image]),
        "elastix, told the view": Elastix(*pair, ["elastix-bspline-mutual-information.txt"], view),
        "elastix": Elastix(*pair, ["elastix-bspline-mutual-information.txt"]),
        "plastimatch, told the view": Plastimatch(*pair, "plastimatch-mutual-information.txt", view),
        "plastimatch": Plastimatch(*pair, "plastimatch-mutual-information.txt"),
    })


def brain_shift_surface(data, inputs):
    data = brain_shift_folder(data)
    return brain_shift(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data), *intraop_surface(data, 0.3)]),
        "rigid ICP": RigidIcp(data / "intraop_surface.ply", data / "preop_labels.nii.gz", data / "intraop.nii.gz"),
    })


def brain_sag(data, tools):
    targets = scoring.truth_targets(data / "truth_forward.nii.gz", data / "preop_mask.nii.gz")
    return Case(targets={"whole brain": targets}, fixed_organ=data / "intraop_mask.nii.gz",
                moving_organ=data / "preop_mask.nii.gz", tools=tools)


def brain_sag_volume(data, inputs):
    data = data / "phantom-brain-sag"
    pair = data / "intraop.nii.gz", data / "preop.nii.gz"
    return brain_sag(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data, "preop_mask"), "--fixed", data / "intraop.nii.gz"]),
        "elastix": Elastix(*pair, ["elastix-bspline-correlation.txt"]),
        "plastimatch": Plastimatch(*pair, "plastimatch-mean-squares.txt"),
    })


def brain_sag_degraded(data, inputs):
    data = data / "phantom-brain-sag"
    pair, view = (data / "intraop_degraded.nii.gz", data / "preop.nii.gz"), data / "intraop_fov_mask.nii.gz"
    return brain_sag(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data, "preop_mask"), "--fixed", data / "intraop_degraded.nii.gz"]),
        "elastix, told the view": Elastix(*pair, ["elastix-bspline-mutual-information.txt"], view),
        "elastix": Elastix(*pair, ["elastix-bspline-mutual-information.txt"]),
        "plastimatch, told the view": Plastimatch(*pair, "plastimatch-mutual-information.txt", view),
        "plastimatch": Plastimatch(*pair, "plastimatch-mutual-information.txt"),
    })


def brain_sag_masks(data, inputs):
    data = data / "phantom-brain-sag"
    pair = [depth_map(data / f"{when}_mask.nii.gz", inputs) for when in ("intraop", "preop")]
    return brain_sag(data, {
        "tissuewarp": Tissuewarp([*HEAD, *preop(data, "preop_mask"), *intraop_labels(data, "intraop_mask")]),
        "elastix": Elastix(*pair, ["elastix-labels.txt"]),
        "plastimatch": Plastimatch(*pair, "plastimatch-mean-squares.txt"),
    })


def lung(data, tools):
    targets = scoring.read_elastix_points(data / "moving_pts.txt"), scoring.read_elastix_points(data / "fixed_pts.txt")
    return Case(targets={"landmarks": targets}, fixed_organ=data / "fixed_mask.mha", moving_organ=data / "moving_mask.mha",
                tools=tools)


def lung_preop(data):
    return ["--moving", data / "moving.mha", "--moving-labels", data / "moving_mask.mha", "--fixed", data / "fixed.mha"]


def lung_volume(data, inputs):
    data = data / "lung-ct"
    masks = ["--fixed-labels", data / "fixed_mask.mha", "--match-image"]
    pair = data / "fixed.mha", data / "moving.mha"
    stages = ["elastix-rigid.txt", "elastix-affine.txt", "elastix-bspline-correlation.txt"]
    return lung(data, {
        "tissuewarp, told the lung": Tissuewarp([*LUNG, *lung_preop(data), *masks]),
        "tissuewarp": Tissuewarp([*LUNG, *lung_preop(data)]),
        "elastix, told the lung": Elastix(*pair, stages, data / "fixed_mask.mha"),
        "elastix": Elastix(*pair, stages),
        "plastimatch": Plastimatch(*pair, "plastimatch-lung.txt"),
    })


def lung_masks(data, inputs):
    data = data / "lung-ct"
    pair = [depth_map(data / f"{when}_mask.mha", inputs) for when in ("fixed", "moving")]
    return lung(data, {
        "tissuewarp": Tissuewarp([*LUNG, *lung_preop(data), "--fixed-labels", data / "fixed_mask.mha"]),
        "elastix": Elastix(*pair, ["elastix-rigid.txt", "elastix-affine.txt", "elastix-labels.txt"]),
        "plastimatch": Plastimatch(*pair, "plastimatch-labels.txt"),
    })


def whole_breath(number):
    """Masks of both lungs at full inspiration and at full expiration, with 300 points that an expert found in both."""
    def build(data, inputs):
        folder = data / "real" / "lung-copd-masks"
        moving, fixed = [folder / f"copd{number}_{when}_mask.nii.gz" for when in ("insp", "exp")]
        fixed_map, moving_map = [depth_map(mask, inputs) for mask in (fixed, moving)]
        rows = numpy.genfromtxt(folder / f"copd{number}_landmarks_LPS.csv", delimiter=",", skip_header=1)[:, -6:]
        return Case(targets={"landmarks": (rows[:, :3], rows[:, 3:])}, fixed_organ=fixed, moving_organ=moving, tools={
            "tissuewarp": Tissuewarp(["--moving-labels", moving, "--fixed-labels", fixed, "--tissue", "lung"]),
            "elastix": Elastix(fixed_map, moving_map, ["elastix-affine.txt", "elastix-labels.txt"]),
            "plastimatch": Plastimatch(fixed_map, moving_map, "plastimatch-labels.txt"),
        })
    return build


def liver(data, tools):
    return Case(targets={"landmarks": scoring.read_csv_landmarks(data / "landmarks.csv")},
                fixed_organ=data / "intraop_labels.nii.gz", moving_organ=data / "preop_labels.nii.gz", tools=tools)


def liver_labels(data, inputs):
    data = data / "phantom-liver"
    pair = [depth_map(data / f"{when}_labels.nii.gz", inputs) for when in ("intraop", "preop")]
    return liver(data, {
        "tissuewarp": Tissuewarp([*preop(data), *intraop_labels(data)]),
        "elastix": Elastix(*pair, ["elastix-rigid.txt", "elastix-affine.txt", "elastix-labels.txt"]),
        "plastimatch": Plastimatch(*pair, "plastimatch-labels.txt"),
    })


def liver_surface(data, inputs):
    data = data / "phantom-liver"
    return liver(data, {
        "tissuewarp": Tissuewarp([*preop(data), *intraop_surface(data, 0.7)]),
        "rigid ICP": RigidIcp(data / "intraop_surface.ply", data / "preop_labels.nii.gz", data / "intraop.nii.gz"),
    })


# Case in the table -> what builds it and the folder that it needs.
CASES = {
    "brain shift, complete volume": (brain_shift_volume, "phantom-brainshift"),
    "brain shift, labels": (brain_shift_labels, "phantom-brainshift"),
    "brain shift, degraded volume": (brain_shift_degraded, "phantom-brainshift"),
    "brain shift, surface patch": (brain_shift_surface, "phantom-brainshift"),
    "brain sag, complete volume": (brain_sag_volume, "phantom-brain-sag"),
    "brain sag, degraded volume": (brain_sag_degraded, "phantom-brain-sag"),
    "brain sag, masks": (brain_sag_masks, "phantom-brain-sag"),
    "lung, volume": (lung_volume, "lung-ct"),
    "lung, masks": (lung_masks, "lung-ct"),
    **{f"whole breath {number}, masks": (whole_breath(number), "real/lung-copd-masks") for number in ("01", "03", "05", "07", "09")},
    "liver, labels": (liver_labels, "phantom-liver"),
    "liver, partial surface": (liver_surface, "phantom-liver"),
}


def build(name, data, inputs):
    """The case of a name, or None without its data."""
    function, folder = CASES[name]
    present = (data / folder).exists() or folder == "phantom-brainshift"
    return function(data, inputs) if present else None
