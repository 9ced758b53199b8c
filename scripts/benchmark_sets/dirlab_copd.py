"""DIR-Lab COPDgene: full inspiration to expiration, ten cases, 300 landmarks each.

Layout and sizes (Castillo et al., Phys. Med. Biol. 58, 2013, doi:10.1088/0031-9155/58/9/2861, and the set's page): copdN/
copdN/ or copdN/ with copdN_iBHCT.img, copdN_eBHCT.img (int16, little endian, 512 x 512 x slices, no header) and
copdN_300_iBH_xyz_r1.txt, copdN_300_eBH_xyz_r1.txt (voxels, counted from 1).
Rule: mean and deviation of the 300 distances a case, here without snapping to voxels; inspiration moves."""

import numpy
import scipy.ndimage

from . import Benchmark, Case, Layout, required, rules

SLICES = {1: 121, 2: 102, 3: 126, 4: 126, 5: 131, 6: 119, 7: 112, 8: 115, 9: 116, 10: 135}
STEPS_MM = {1: 0.625, 2: 0.645, 3: 0.652, 4: 0.590, 5: 0.647, 6: 0.633, 7: 0.625, 8: 0.586, 9: 0.664, 10: 0.742}
WIDTH, SLICE_MM = 512, 2.5


def volume(path, slices, width=WIDTH):
    values = numpy.fromfile(path, "<i2")
    if values.size != width * width * slices:
        raise Layout(f"'{path}' has {values.size} voxels, not {width} x {width} x {slices}; give the file as handed out")
    return values.reshape((width, width, slices), order="F")


def threshold(values):
    """Otsu's, between air and tissue."""
    counts, edges = numpy.histogram(values, 256)
    middle = (edges[:-1] + edges[1:]) / 2
    below, above = numpy.cumsum(counts), numpy.cumsum(counts[::-1])[::-1]
    low = numpy.cumsum(counts * middle) / numpy.maximum(below, 1)
    high = (numpy.cumsum((counts * middle)[::-1]) / numpy.maximum(above[::-1], 1))[::-1]
    return middle[numpy.argmax(below[:-1] * above[1:] * (low[:-1] - high[1:]) ** 2)]


def lungs(values):
    """Air that does not touch the sides of the image, small pieces left out, vessels closed."""
    pieces, _ = scipy.ndimage.label(values < threshold(values))
    sides = numpy.unique(numpy.concatenate([pieces[0].ravel(), pieces[-1].ravel(), pieces[:, 0].ravel(), pieces[:, -1].ravel()]))
    sizes = numpy.bincount(pieces.ravel())
    sizes[sides], sizes[0] = 0, 0
    if sizes.max() == 0:
        raise Layout("no lung was found in the image; its air touches every side")
    kept = numpy.isin(pieces, numpy.flatnonzero(sizes > 0.1 * sizes.max()))
    return scipy.ndimage.binary_closing(kept, iterations=2).astype(numpy.uint8)


def state(folder, work, number, breath):
    """(image, labels, matrix) as files of the work folder."""
    values = volume(required(folder / f"copd{number}_{breath}CT.img"), SLICES[number])
    matrix = numpy.diag([STEPS_MM[number], STEPS_MM[number], SLICE_MM, 1.0])
    image, labels = work / f"copd{number}_{breath}.nii.gz", work / f"copd{number}_{breath}_lungs.nii.gz"
    if not labels.exists():
        rules.save(image, values, matrix)
        rules.save(labels, lungs(values), matrix)
    return image, labels, matrix


def cases(data, work):
    for number in SLICES:
        folder = next((path for path in (data / f"copd{number}" / f"copd{number}", data / f"copd{number}") if
                       (path / f"copd{number}_iBHCT.img").exists()), None)
        if folder is None:
            continue
        (moving, moving_labels, matrix), (fixed, fixed_labels, _) = (state(folder, work, number, breath)
                                                                     for breath in ("iBH", "eBH"))
        points = [rules.to_places(numpy.loadtxt(required(folder / f"copd{number}_300_{breath}_xyz_r1.txt")) - 1, matrix)
                  for breath in ("iBH", "eBH")]
        landmarks = rules.write_landmarks(work / f"copd{number}.csv", *points)
        yield Case(f"copd{number}", {"moving": moving, "labels": moving_labels, "fixed": fixed,
                                     "fixed_labels": fixed_labels, "landmarks": landmarks},
                   {"moving": points[0], "fixed": points[1]})


def score(case, folder):
    before, after = rules.errors(folder / rules.MOVING_TO_FIXED, case.truth["moving"], case.truth["fixed"])
    return {"TRE before, mm": before.mean(), "TRE, mm": after.mean(), "TRE deviation, mm": after.std()}


BENCHMARK = Benchmark(
    "DIR-Lab COPDgene", {"tissue": "lung", "match_image": "true"},
    (("initial, cases 1 to 10", "26.3, 21.8, 12.6, 29.6, 30.1, 28.5, 21.6, 26.5, 14.9, 21.8 mm",
      "the set's page, as quoted by Lung250M-4B"),
     ("observers", "0.65 to 1.06 mm and more", "Castillo et al. 2013, repeated picks"),
     ("keypoint correspondences", "mean 0.82 mm", "Rühaak et al., IEEE TMI 36, 2017; unchecked")),
    cases, score, rules.means, ("lungs are found by a threshold: the set has no masks",))
