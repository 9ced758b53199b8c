"""µ-RegPro: prostate, MR to transrectal ultrasound.

Layout (muregpro.github.io, its repository Baseline-Networks, doi:10.5281/zenodo.7870104): train/ and val/ with mr_images,
us_images, mr_labels, us_labels, caseNNNNNN.nii.gz in each; labels have a fourth axis: the gland, then landmarks.
Rules (muregpro.github.io/assessment): DSC, RDSC, TRE, RTRE, RTs, HD95 and the score made of them. Landmarks' distances are
those of centroids; the page's "l1 norm" is read as the distance, mm."""

import numpy
import scipy.ndimage

from tissuewarp_cohort.fields import Field

from . import Benchmark, Case, required, rules

KEPT = 0.68  # robust measures: of the best cases
BEST_TARGETS = 3


def gland(path, work, name):
    values, matrix = rules.load(path)
    return rules.save(work / f"{name}.nii.gz", (values[..., 0] > 0.5).astype(numpy.uint8), matrix)


def cases(data, work):
    for part in ("train", "val"):
        if not (data / part).is_dir():
            continue
        for moving in sorted(required(data / part / "mr_images").glob("case*.nii.gz")):
            name = moving.name.replace(".nii.gz", "")
            files = {role: required(data / part / role / moving.name) for role in ("us_images", "mr_labels", "us_labels")}
            yield Case(f"{part}_{name}", {
                "moving": moving, "labels": gland(files["mr_labels"], work, f"{part}_{name}_mr"),
                "fixed": files["us_images"], "fixed_labels": gland(files["us_labels"], work, f"{part}_{name}_us")},
                {"moving": files["mr_labels"], "fixed": files["us_labels"]})


def surface_distances(a, b, spacing):
    """95th percentile of the distances of boundary voxels, both ways, mm."""
    edges = [mask & ~scipy.ndimage.binary_erosion(mask) for mask in (a, b)]
    if not (edges[0].any() and edges[1].any()):
        return float("nan")
    far = [scipy.ndimage.distance_transform_edt(~edge, sampling=spacing) for edge in edges]
    return float(numpy.percentile(numpy.concatenate([far[1][edges[0]], far[0][edges[1]]]), 95))


def centroid(mask, matrix):
    return rules.to_places(numpy.argwhere(mask).mean(axis=0), matrix) if mask.any() else None


def target_distances(moved, fixed, matrix):
    """Of landmarks that both have, mm."""
    result = []
    for channel in range(1, fixed.shape[3]):
        a, b = centroid(moved[..., channel] > 0.5, matrix), centroid(fixed[..., channel] > 0.5, matrix)
        if a is not None and b is not None:
            result.append(float(numpy.linalg.norm(a - b)))
    return result


class Still:
    """The field that moves nothing, on the grid of another."""

    def __init__(self, field):
        self.values, self.matrix = numpy.zeros_like(field.values), field.matrix

    def __call__(self, places):
        return places


def measured(moving, moving_matrix, fixed, field):
    channels = [rules.warped((moving[..., k] > 0.5).astype(numpy.uint8), moving_matrix, field) for k in range(moving.shape[3])]
    moved = numpy.stack(channels, axis=-1)
    spacing = numpy.linalg.norm(field.matrix[:3, :3], axis=0)
    targets = sorted(target_distances(moved, fixed, field.matrix))
    return {"DSC": rules.dice(moved[..., 0] > 0, fixed[..., 0] > 0.5),
            "HD95, mm": surface_distances(moved[..., 0] > 0, fixed[..., 0] > 0.5, spacing),
            "TRE, mm": float(numpy.sqrt(numpy.mean(numpy.square(targets)))) if targets else float("nan"),
            "RTs, mm": float(numpy.mean(targets[:BEST_TARGETS])) if targets else float("nan"),
            "largest target, mm": max(targets, default=float("nan"))}


def score(case, folder):
    (moving, matrix), (fixed, _) = (rules.load(case.truth[role]) for role in ("moving", "fixed"))
    field = Field(str(folder / rules.FIXED_TO_MOVING))
    after, before = measured(moving, matrix, fixed, field), measured(moving, matrix, fixed, Still(field))
    return {**after, "StDJD": rules.sd_log_j(field), "HD95 before, mm": before["HD95, mm"],
            "largest target before, mm": before["largest target, mm"], "TRE before, mm": before["TRE, mm"]}


def best(values, highest):
    ordered = sorted(values, reverse=highest)
    return float(numpy.mean(ordered[:max(1, round(KEPT * len(ordered)))]))


def total(scores):
    result = rules.means(scores)
    tres = [score["TRE, mm"] for score in scores if numpy.isfinite(score["TRE, mm"])]
    result["RDSC"] = best([score["DSC"] for score in scores], True)
    limit = numpy.nanmax([score["largest target before, mm"] for score in scores])
    if tres:
        result["RTRE, mm"] = best(tres, False)
        share = [min(1.0, result[name] / limit) for name in ("TRE, mm", "RTRE, mm", "RTs, mm")]
        surface = min(1.0, result["HD95, mm"] / result["HD95 before, mm"])
        result["score"] = (0.2 * result["DSC"] + 0.1 * result["RDSC"] + 0.3 * (1 - share[0]) + 0.1 * (1 - share[1])
                           + 0.1 * (1 - share[2]) + 0.2 * (1 - surface))
    return result


SOURCE = "muregpro.github.io/leaderboard, 35 test cases"
BENCHMARK = Benchmark(
    "µ-RegPro, prostate MR to ultrasound", {"tissue": "prostate"},
    (("Tiny (two stages)", "DSC 0.830, RDSC 0.879, HD95 5.910, TRE 1.857, score 0.797", SOURCE),
     ("LocalNet, baseline", "DSC 0.553, RDSC 0.632, HD95 11.631, TRE 7.654, score 0.425", SOURCE),
     ("VoxelMorph, baseline", "DSC 0.352, RDSC 0.431, HD95 13.131, TRE 10.727, score 0.210", SOURCE)),
    cases, score, total,
    ("registered to the gland's masks of both images, which the challenge's teams did not have for its test cases: DSC and "
     "HD95 are no independent measures, and only TRE can be set beside theirs",))
