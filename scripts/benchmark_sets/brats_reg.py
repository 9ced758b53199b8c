"""BraTS-Reg: glioma before surgery and at follow-up.

Layout (Baheti et al., arXiv:2112.06979): BraTSReg_NNN/BraTSReg_NNN_00_0000_CONTRAST.nii.gz (before) and _01_DAYS_CONTRAST
(follow-up), CONTRAST t1, t1ce, t2, flair, in one atlas's frame; ..._landmarks.csv with Landmark,X,Y,Z: LPS mm (y is 0 to
-239).
Rules: landmarks of the follow-up are carried to the scan before surgery; the median of a case's errors (MEE), the share of
landmarks that came nearer (robustness), and det J; both averaged over cases."""

import csv

import numpy

from tissuewarp_cohort.fields import Field

from . import Benchmark, Case, Layout, required, rules

CONTRASTS = ("t1ce", "t2")


def landmarks_of(path):
    with open(path, encoding="utf-8") as file:
        rows = {row["Landmark"]: [float(row[axis]) for axis in "XYZ"] for row in csv.DictReader(file)}
    if not rows:
        raise Layout(f"'{path}' holds no landmarks")
    return rows


def in_image(points, image):
    values, matrix = rules.load(image)
    index = (points - matrix[:3, 3]) @ numpy.linalg.inv(matrix[:3, :3]).T
    return bool(numpy.all((index > -1) & (index < numpy.array(values.shape[:3]))))


def cases(data, work):
    for folder in sorted(path for path in required(data).glob("BraTSReg_*") if path.is_dir()):
        stems = sorted({path.name.rsplit("_", 1)[0] for path in folder.glob("*.nii.gz")})
        if len(stems) != 2:
            raise Layout(f"'{folder}' holds {len(stems)} time points; two are expected")
        before, after = stems
        columns = {role: [required(folder / f"{stem}_{contrast}.nii.gz") for contrast in CONTRASTS]
                   for role, stem in (("moving", before), ("fixed", after))}
        truth = {}
        if (folder / f"{before}_landmarks.csv").exists():
            places = [landmarks_of(required(folder / f"{stem}_landmarks.csv")) for stem in stems]
            names = sorted(set(places[0]) & set(places[1]))
            truth = {role: numpy.array([table[name] for name in names]) for role, table in zip(("moving", "fixed"), places)}
            if not in_image(truth["moving"], columns["moving"][0]):
                raise Layout(f"landmarks in '{folder}' lie off their image as LPS mm")
            columns["landmarks"] = rules.write_landmarks(work / f"{folder.name}.csv", truth["moving"], truth["fixed"])
        yield Case(folder.name, columns, truth)


def score(case, folder):
    jacobian = rules.determinants(Field(str(folder / rules.FIXED_TO_MOVING)))
    result = {"least det J": float(jacobian.min()), "folded": float((jacobian <= 0).mean())}
    if case.truth:
        before, after = rules.errors(folder / rules.FIXED_TO_MOVING, case.truth["fixed"], case.truth["moving"])
        result.update({"MEE before, mm": float(numpy.median(before)), "MEE, mm": float(numpy.median(after)),
                       "robustness": float((after < before).mean())})
    return result


BENCHMARK = Benchmark(
    "BraTS-Reg", {"no_align": "true"},
    (("top-ranked team", "at or below the raters' variability for about 60 % of landmarks", "Baheti et al., arXiv:2112.06979"),),
    cases, score, rules.means, ("t1ce and t2 are matched, pair by pair", "the brain is what is bright: scans are skull-stripped"))
