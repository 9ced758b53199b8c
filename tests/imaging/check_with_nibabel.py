"""Files of nibabel read by tissuewarp, and files of tissuewarp read by nibabel: affine, voxels, intent.

usage: check_with_nibabel.py IMAGING_CONVERT        (exit code 77: nibabel is not installed)
"""
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import nibabel
    import numpy as np
except ImportError:
    print("nibabel or numpy is not installed")
    sys.exit(77)

RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
converter = sys.argv[1]
random = np.random.default_rng(5)
checks = 0


def affine(oblique=True, left_handed=False):
    x, z = np.radians(20.0), np.radians(-35.0)
    rotation = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    matrix = np.eye(4)
    spacing = np.diag([0.8, 1.1, -2.5 if left_handed else 2.5])
    matrix[:3, :3] = (rotation if oblique else np.eye(3)) @ spacing
    matrix[:3, 3] = [-80.5, 33.25, 12.0]
    return matrix


def convert(source, target):
    done = subprocess.run([converter, str(source), str(target)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{source.name}: {done.stderr}")
    return done.stdout


def expect(condition, what):
    global checks
    checks += 1
    if not condition:
        sys.exit(f"FAILED: {what}")


def nrrd_header_and_data(path, dtype, shape):
    """A minimal NRRD reader, so that our LPS geometry is seen without any NIfTI code of ours."""
    import gzip
    head, _, body = path.read_bytes().partition(b"\n\n")
    fields = dict(line.split(": ", 1) for line in head.decode().splitlines() if ": " in line)
    body = gzip.decompress(body) if fields["encoding"].startswith("gz") else body
    columns = [np.array(v.strip("()").split(","), float) for v in fields["space directions"].split() if v != "none"]
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack(columns, axis=1)
    matrix[:3, 3] = np.array(fields["space origin"].strip("()").split(","), float)
    return fields, matrix, np.frombuffer(body, dtype).reshape(shape, order="F")


def close(a, b, tolerance=1e-4):
    return np.abs(np.asarray(a, float) - np.asarray(b, float)).max() <= tolerance


def check_types(folder):
    for dtype in ("int8", "uint8", "int16", "uint16", "int32", "float32", "float64"):
        data = random.integers(0, 100, (6, 7, 8)).astype(dtype)
        for extension in (".nii", ".nii.gz"):
            source = folder / f"{dtype}{extension}"
            nibabel.save(nibabel.Nifti1Image(data, affine(), dtype=dtype), source)
            convert(source, folder / f"ours{extension}")
            ours = nibabel.load(folder / f"ours{extension}")
            expect(ours.get_data_dtype() == np.dtype(dtype), f"{dtype}: type {ours.get_data_dtype()}")
            expect(np.array_equal(np.asarray(ours.dataobj), data), f"{dtype}{extension}: voxels")
            expect(close(ours.affine, affine()), f"{dtype}{extension}: affine")
            expect(close(ours.get_qform(), affine(), 1e-3), f"{dtype}{extension}: qform")
            expect(close(ours.get_sform(), affine()), f"{dtype}{extension}: sform")


def check_wide_types(folder):
    for dtype, expected in (("uint32", "int32"), ("int64", "int32")):
        data = random.integers(0, 2**31 - 1, (6, 7, 8)).astype(dtype)
        nibabel.save(nibabel.Nifti1Image(data, affine(), dtype=dtype), folder / "wide.nii")
        convert(folder / "wide.nii", folder / "ours.nii")
        ours = nibabel.load(folder / "ours.nii")
        expect(ours.get_data_dtype() == np.dtype(expected), f"{dtype} became {ours.get_data_dtype()}")
        expect(np.array_equal(np.asarray(ours.dataobj), data), f"{dtype}: voxels")


def check_forms(folder):
    data = random.integers(0, 100, (6, 7, 8)).astype("int16")
    for name, q, s in (("sform only", 0, 4), ("qform only", 1, 0), ("both", 1, 1), ("aligned sform", 0, 2)):
        for oblique in (False, True):
            for left_handed in (False, True):
                matrix = affine(oblique, left_handed)
                image = nibabel.Nifti1Image(data, matrix)
                image.set_qform(matrix if q else None, q)
                image.set_sform(matrix if s else None, s)
                nibabel.save(image, folder / "forms.nii.gz")
                convert(folder / "forms.nii.gz", folder / "forms.nrrd")
                _, lps, voxels = nrrd_header_and_data(folder / "forms.nrrd", "<i2", data.shape)
                what = f"{name}, oblique {oblique}, left-handed {left_handed}"
                expect(close(lps, RAS_TO_LPS @ matrix, 2e-4), f"{what}: geometry\n{lps}\n{RAS_TO_LPS @ matrix}")
                expect(np.array_equal(voxels, data), f"{what}: voxels")


def check_disagreeing_forms(folder):
    image = nibabel.Nifti1Image(np.zeros((6, 7, 8), "int16"), affine())
    moved = affine()
    moved[0, 3] += 5.0
    image.set_qform(moved, 1)
    image.set_sform(affine(), 1)
    nibabel.save(image, folder / "disagree.nii")
    notes = convert(folder / "disagree.nii", folder / "ours.nii")
    expect("sform and qform disagree" in notes, f"no note on disagreeing forms: {notes!r}")
    used = nibabel.load(folder / "ours.nii").affine
    named = affine() if "the sform is used" in notes else moved
    expect(close(used, named), f"the note names the wrong form: {notes!r}")


def check_scaling(folder):
    stored = random.integers(-1000, 1000, (6, 7, 8)).astype("int16")
    image = nibabel.Nifti1Image(stored, affine())
    image.header.set_slope_inter(0.5, -7.0)
    nibabel.save(image, folder / "scaled.nii.gz")
    theirs = nibabel.load(folder / "scaled.nii.gz")
    expect(theirs.dataobj.slope == 0.5 and theirs.dataobj.inter == -7.0, "the scaled file carries its slope")
    convert(folder / "scaled.nii.gz", folder / "ours.nii.gz")
    ours = nibabel.load(folder / "ours.nii.gz")
    expect(close(ours.get_fdata(), theirs.get_fdata()), "slope and intercept")
    expect(ours.get_data_dtype() == np.dtype("float32"), f"scaled type {ours.get_data_dtype()}")


def check_vectors(folder):
    field = random.normal(size=(6, 7, 8, 1, 3)).astype("float32")
    for intent, name in ((1007, "vector"), (1006, "displacement vector")):
        image = nibabel.Nifti1Image(field, affine())
        image.header.set_intent(intent)
        nibabel.save(image, folder / "field.nii.gz")
        convert(folder / "field.nii.gz", folder / "ours.nii.gz")
        ours = nibabel.load(folder / "ours.nii.gz")
        expect(ours.shape == field.shape, f"{name}: shape {ours.shape}")
        expect(int(ours.header["intent_code"]) == 1007, f"{name}: written intent {ours.header['intent_code']}")
        signs = np.array([1, 1, 1] if intent == 1007 else [-1, -1, 1])
        expect(np.array_equal(np.asarray(ours.dataobj), field * signs), f"{name}: components")
        convert(folder / "field.nii.gz", folder / "ours.nrrd")
        fields, _, voxels = nrrd_header_and_data(folder / "ours.nrrd", "<f4", (3, 6, 7, 8))
        expect(fields["kinds"].startswith("vector"), f"{name}: kinds {fields['kinds']}")
        expect(np.array_equal(np.moveaxis(voxels, 0, -1), field[..., 0, :] * signs), f"{name}: NRRD components")


def check_large_file(folder):
    """Several deflate blocks: 20 MB of noise."""
    data = random.normal(size=(170, 171, 172)).astype("float32")
    nibabel.save(nibabel.Nifti1Image(data, affine()), folder / "large.nii")
    convert(folder / "large.nii", folder / "ours.nii.gz")
    expect(np.array_equal(np.asarray(nibabel.load(folder / "ours.nii.gz").dataobj), data), "blocks of a large file")


def check_big_endian(folder):
    data = random.integers(0, 30000, (6, 7, 8)).astype(">i2")
    image = nibabel.Nifti1Image(data, affine(), nibabel.Nifti1Header(endianness=">"))
    image.header.set_data_dtype(">i2")
    nibabel.save(image, folder / "big.nii")
    expect(nibabel.load(folder / "big.nii").header.endianness == ">", "the file is big-endian")
    convert(folder / "big.nii", folder / "ours.nii")
    expect(np.array_equal(np.asarray(nibabel.load(folder / "ours.nii").dataobj), data), "big-endian voxels")


with tempfile.TemporaryDirectory() as name:
    for check in (check_types, check_wide_types, check_forms, check_disagreeing_forms, check_scaling, check_vectors,
                  check_large_file, check_big_endian):
        check(Path(name))
print(f"{checks} checks passed")
