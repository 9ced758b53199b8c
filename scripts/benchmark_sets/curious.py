"""CuRIOUS 2018 on RESECT: preoperative MR to ultrasound before the dura is opened.

Layout (Xiao et al., Med. Phys. 2017, doi:10.1002/mp.12268; folders as users' scripts name them): NIFTI/CaseN/MRI/
CaseN-FLAIR.nii.gz, US/CaseN-US-before.nii.gz, Landmarks/CaseN-MRI-beforeUS.tag (MNI tags, RAS mm, MR first).
Rule (Xiao et al., IEEE TMI 2020, CuRIOUS2018): the mean distance of a case's landmarks, averaged over cases."""

import re

import numpy

from . import Benchmark, Case, Layout, required, rules


def read_tag(path):
    """(MR, US), LPS mm."""
    text = path.read_text(encoding="latin-1")
    lines = text.partition("Points =")[2].replace(";", "\n").splitlines()
    numbers = [re.findall(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", line.partition('"')[0])[:6] for line in lines]
    points = numpy.array([line for line in numbers if len(line) == 6], float)
    if len(points) == 0:
        raise Layout(f"'{path}' holds no pairs of points; give MNI tag files")
    return points[:, :3] * [-1, -1, 1], points[:, 3:] * [-1, -1, 1]


def cases(data, work):
    folders = sorted(required(data / "NIFTI").glob("Case*"), key=lambda path: int(path.name[4:]))
    for folder in folders:
        name = folder.name
        moving, fixed = read_tag(required(folder / "Landmarks" / f"{name}-MRI-beforeUS.tag"))
        yield Case(name, {"moving": required(folder / "MRI" / f"{name}-FLAIR.nii.gz"),
                          "fixed": required(folder / "US" / f"{name}-US-before.nii.gz"),
                          "landmarks": rules.write_landmarks(work / f"{name}.csv", moving, fixed)},
                   {"moving": moving, "fixed": fixed})


def score(case, folder):
    before, after = rules.errors(folder / rules.MOVING_TO_FIXED, case.truth["moving"], case.truth["fixed"])
    return {"mTRE before, mm": before.mean(), "mTRE, mm": after.mean()}


BENCHMARK = Benchmark(
    "CuRIOUS / RESECT, MR to ultrasound", {"no_align": "true"},
    (("initial, 22 cases", "mTRE 5.37 mm", "RESECT's paper; unchecked: compare 'mTRE before'"),
     ("specialised methods, 22 cases", "mTRE 1.27 to 1.9 mm", "published figures; unchecked")),
    cases, score, rules.means, ("the organ is what is bright in the MR: RESECT has no mask of the brain",))
