"""Learn2Reg's folder: LungCT, NLST, and ReMIND2Reg, which is handed out in the same form.

Layout (the sets' *_dataset.json and the challenge's pages, learn2reg.grand-challenge.org): imagesTr/NAME_NNNN_0000.nii.gz
(fixed) and _0001 (moving); masksTr and keypointsTr or landmarksTr with the same names; pairs in registration_val, or
training_paired_images. Keypoints are lines x,y,z in voxels.
Rules (Hering et al., IEEE TMI 42, 2023): mean TRE in mm; standard deviation of log det J; Dice of masks. The challenge's
ranks over teams cannot be had for one method."""

import json

import numpy

from tissuewarp_cohort.fields import Field

from . import Benchmark, Case, Layout, required, rules

POINTS = ("landmarksTr", "landmarksTs", "keypointsTr", "keypointsTs")


def pairs_of(data, task):
    described = required(data / f"{task}_dataset.json")
    description = json.loads(described.read_text(encoding="utf-8"))
    for key in ("registration_val", "training_paired_images"):
        if description.get(key):
            return description[key]
    raise Layout(f"'{described}' names no pairs (registration_val, training_paired_images)")


def beside(image, folders, end):
    """The file of the same name in one of the folders beside imagesTr or imagesTs."""
    for folder in folders:
        path = image.parent.parent / folder / image.name.replace(".nii.gz", end)
        if path.exists():
            return path
    return None


def points_of(image):
    path = beside(image, POINTS, ".csv")
    if path is None:
        return None
    indices = numpy.loadtxt(path, delimiter=",", ndmin=2)[:, :3]
    return rules.to_places(indices, rules.load(image)[1])


def case_of(data, work, pair):
    moving, fixed = (required(data / pair[role]) for role in ("moving", "fixed"))
    name = fixed.name.replace(".nii.gz", "")
    columns, truth = {"moving": moving, "fixed": fixed}, {}
    masks = [beside(image, ("masksTr", "masksTs"), ".nii.gz") for image in (moving, fixed)]
    if None not in masks:
        columns.update(labels=masks[0], fixed_labels=masks[1])
        truth["masks"] = masks
    points = [points_of(image) for image in (moving, fixed)]
    if points[0] is not None and points[1] is not None:
        columns["landmarks"] = rules.write_landmarks(work / f"{name}.csv", *points)
        truth.update(moving=points[0], fixed=points[1])
    return Case(name, columns, truth)


def cases_of(task):
    def cases(data, work):
        for pair in pairs_of(data, task):
            yield case_of(data, work, pair)
    return cases


def score(case, folder):
    field, result = Field(str(folder / rules.FIXED_TO_MOVING)), {}
    if "fixed" in case.truth:
        before, after = rules.errors(folder / rules.FIXED_TO_MOVING, case.truth["fixed"], case.truth["moving"])
        result.update({"TRE before, mm": before.mean(), "TRE, mm": after.mean()})
    if "masks" in case.truth:
        moving, matrix = rules.load(case.truth["masks"][0])
        fixed, _ = rules.load(case.truth["masks"][1])
        result["Dice"] = rules.dice(rules.warped(moving, matrix, field) > 0, fixed > 0)
    return {**result, "SDlogJ": rules.sd_log_j(field)}


SOURCE = "learn2reg.grand-challenge.org has the leaderboards; none is quoted here"
LUNG = {"tissue": "lung", "match_image": "true"}
BENCHMARKS = {
    "learn2reg-lung": Benchmark("Learn2Reg LungCT", LUNG, (("all teams", "–", SOURCE),), cases_of("LungCT"), score, rules.means,
                                ("masks are registered to and scored: their Dice is no independent measure",)),
    "learn2reg-nlst": Benchmark("Learn2Reg NLST", LUNG, (("all teams", "–", SOURCE),), cases_of("NLST"), score, rules.means,
                                ("masks are registered to and scored: their Dice is no independent measure",
                                 "keypoints are found automatically by the challenge; its test landmarks are not handed out")),
    "remind2reg": Benchmark("ReMIND2Reg, MR to ultrasound after resection", {"no_align": "true"},
                            (("all teams", "–", SOURCE + "; Dorent et al., arXiv:2508.09649"),), cases_of("ReMIND2Reg"), score,
                            rules.means, ("without landmarks, which are kept back, only SDlogJ is scored",)),
}
