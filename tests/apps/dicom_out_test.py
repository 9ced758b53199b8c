"""Results as DICOM objects, read by pydicom, plastimatch and dciodvfy, and compared with the files that are tested elsewhere."""

import json
import os
import subprocess
import unittest

import nibabel
import numpy
import pydicom
import pydicom.uid
import pydicom.valuerep

from deformable_registration import deformation_of
from phantom import FIXED_AFFINE, MOVING_AFFINE, SIZE, Phantom, PhantomTest

ITK = os.environ["TISSUEWARP_ITK_POINTS"]
INPUT = 2
MR = "1.2.840.10008.5.1.4.1.1.4"


def decimal(values):
    """Numbers as DICOM's decimal strings, of 16 letters at most."""
    return [pydicom.valuerep.DSfloat(float(value), auto_format=True) for value in values]


def write_series(array, affine, folder, frame_of_reference):
    """A folder of slices of MR, in a study of its own, whose axes and places are those of a NIfTI file."""
    folder.mkdir()
    study, series = pydicom.uid.generate_uid(), pydicom.uid.generate_uid()
    axes = affine[:3, :3] * [[-1], [-1], [1]]
    spacing = numpy.linalg.norm(axes, axis=0)
    axes = axes / spacing
    for k in range(array.shape[2]):
        image = pydicom.Dataset()
        image.SOPClassUID, image.SOPInstanceUID = MR, pydicom.uid.generate_uid()
        image.StudyInstanceUID, image.SeriesInstanceUID, image.FrameOfReferenceUID = study, series, frame_of_reference
        image.PatientName, image.PatientID, image.PatientSex, image.PatientBirthDate = "Doe^Jane", "42", "F", "19700101"
        image.StudyDate, image.StudyTime, image.StudyID, image.AccessionNumber = "20260102", "030405", "7", "A1"
        image.Modality, image.InstanceNumber = "MR", k + 1
        image.ImagePositionPatient = decimal((affine @ [0, 0, k, 1])[:3] * [-1, -1, 1])
        image.ImageOrientationPatient = decimal([*axes[:, 0], *axes[:, 1]])
        image.PixelSpacing, image.SliceThickness = decimal(spacing[[1, 0]]), decimal(spacing[2:])[0]
        image.Rows, image.Columns, image.SamplesPerPixel = array.shape[1], array.shape[0], 1
        image.BitsAllocated, image.BitsStored, image.HighBit, image.PixelRepresentation = 16, 16, 15, 0
        image.PhotometricInterpretation = "MONOCHROME2"
        image.PixelData = array[:, :, k].T.astype("<u2").tobytes()
        image.file_meta = pydicom.dataset.FileMetaDataset()
        image.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
        image.is_little_endian, image.is_implicit_VR = True, False
        pydicom.dcmwrite(folder / f"{k:03d}.dcm", image, write_like_original=False)
    return study, series


class DicomOut(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = Phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        cls.moving_frame, cls.fixed_frame = pydicom.uid.generate_uid(), pydicom.uid.generate_uid()
        cls.moving, cls.fixed = phantom.folder / "preop", phantom.folder / "intraop"
        write_series(phantom.moving_array, MOVING_AFFINE, cls.moving, cls.moving_frame)
        cls.study, cls.series = write_series(phantom.fixed_array, FIXED_AFFINE, cls.fixed, cls.fixed_frame)
        names = phantom.folder / "names.ctbl"
        names.write_text("# Color table file\n0 Background 0 0 0 0\n2 right_lobe 128 174 128 255\n")
        cls.result = phantom.register("--edge-length", 4, "--write", "dicom", "--label-names", names, moving=cls.moving,
                                      fixed=cls.fixed)
        cls.output = phantom.output

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)

    def read(self, name, frame_of_reference, sop_class):
        object_ = pydicom.dcmread(self.output / name)
        self.assertEqual(object_.SOPClassUID, sop_class)
        self.assertEqual(object_.file_meta.MediaStorageSOPClassUID, sop_class)
        self.assertEqual(object_.FrameOfReferenceUID, frame_of_reference)
        self.assertEqual((str(object_.PatientName), object_.PatientID, object_.PatientSex, object_.AccessionNumber),
                         ("Doe^Jane", "42", "F", "A1"))
        self.assertNotEqual(object_.SeriesInstanceUID, self.series)
        return object_

    def test_the_report_names_them(self):
        report = json.loads((self.output / "report.json").read_text())
        self.assertEqual(sorted(report["outputs"]), sorted(path.name for path in self.output.iterdir()))
        self.assertLessEqual({"registration.dcm", "structures.dcm", "uncertainty.dcm", "jacobian.dcm"},
                             set(report["outputs"]))

    def test_they_keep_to_the_standard(self):
        for name in ("registration.dcm", "structures.dcm", "uncertainty.dcm", "jacobian.dcm"):
            result = subprocess.run(["dciodvfy", self.output / name], capture_output=True, text=True)
            self.assertNotIn("Error", result.stdout + result.stderr, name)

    def test_registration_maps_points_as_the_standard_says(self):
        object_ = self.read("registration.dcm", self.fixed_frame, "1.2.840.10008.5.1.4.1.1.66.3")
        self.assertEqual((object_.Modality, object_.StudyInstanceUID), ("REG", self.study))
        item, registered = object_.DeformableRegistrationSequence
        self.assertEqual(registered.SourceFrameOfReferenceUID, self.fixed_frame)
        self.assertNotIn("DeformableRegistrationGridSequence", registered)
        self.assertEqual((len(item.ReferencedImageSequence), len(registered.ReferencedImageSequence)), (SIZE, SIZE))
        self.assertEqual(item.SourceFrameOfReferenceUID, self.moving_frame)
        before, after, grid, vectors, axes = deformation_of(item)
        index = numpy.random.default_rng(2).integers(5, 43, size=(60, 3))
        points = numpy.array(grid.ImagePositionPatient, float) + index @ axes.T
        deformed = points @ before[:3, :3].T + before[:3, 3] + vectors[index[:, 2], index[:, 1], index[:, 0]]
        found = deformed @ after[:3, :3].T + after[:3, 3]
        text = "\n".join(" ".join(f"{x:.17g}" for x in point) for point in points)
        itk = subprocess.run([ITK, str(self.output / "transform.h5")], input=text, capture_output=True, text=True)
        expected = numpy.array([[float(x) for x in line.split()] for line in itk.stdout.splitlines()])
        self.assertLess(numpy.linalg.norm(found - expected, axis=1).max(), 2e-3)  # transform.h5 is rounded, this is not
        self.assertGreater(numpy.linalg.norm(vectors, axis=-1).max(), 0.5)
        (own,) = object_.ReferencedSeriesSequence
        self.assertEqual((own.SeriesInstanceUID, len(own.ReferencedInstanceSequence)), (self.series, SIZE))
        (other,) = object_.StudiesContainingOtherReferencedInstancesSequence
        self.assertEqual(len(other.ReferencedSeriesSequence[0].ReferencedInstanceSequence), SIZE)

    def test_structures_are_the_warped_labels(self):
        object_ = self.read("structures.dcm", self.fixed_frame, "1.2.840.10008.5.1.4.1.1.481.3")
        self.assertEqual({int(roi.ROINumber): roi.ROIName for roi in object_.StructureSetROISequence},
                         {1: "label 1", 2: "right lobe"})
        (frame,) = object_.ReferencedFrameOfReferenceSequence
        self.assertEqual(frame.FrameOfReferenceUID, self.fixed_frame)
        heights = {pydicom.dcmread(path).SOPInstanceUID: k for k, path in enumerate(sorted(self.fixed.iterdir()))}
        drawn = {int(roi.ReferencedROINumber): roi.ContourSequence for roi in object_.ROIContourSequence}
        for contour in drawn[2]:
            points = numpy.array(contour.ContourData, float).reshape(-1, 3)
            self.assertEqual(len(points), contour.NumberOfContourPoints)
            k = heights[contour.ContourImageSequence[0].ReferencedSOPInstanceUID]
            numpy.testing.assert_allclose(points[:, 2], FIXED_AFFINE[2, 3] + k, atol=1e-6)
        labels = numpy.asarray(nibabel.load(self.output / "warped_labels.nii.gz").dataobj)
        drawn = self.phantom.folder / "drawn.nii.gz"
        result = subprocess.run(["plastimatch", "convert", "--input", self.output / "structures.dcm", "--fixed",
                                 self.output / "warped_labels.nii.gz", "--output-labelmap", drawn],
                                capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        numpy.testing.assert_array_equal(numpy.asarray(nibabel.load(drawn).dataobj), labels)

    def test_maps_hold_the_values_of_the_volumes(self):
        for name, frame, values in (
                ("uncertainty.dcm", self.fixed_frame, nibabel.load(self.output / "uncertainty.nii.gz").get_fdata()),
                ("jacobian.dcm", self.moving_frame, None)):
            object_ = self.read(name, frame, "1.2.840.10008.5.1.4.1.1.30")
            frames = object_.pixel_array
            self.assertEqual(frames.shape, (SIZE, SIZE, SIZE))
            shared = object_.SharedFunctionalGroupsSequence[0]
            unit = shared.RealWorldValueMappingSequence[0].MeasurementUnitsCodeSequence[0].CodeValue
            self.assertEqual(unit, "mm" if name.startswith("unc") else "1")
            places = [f.PlanePositionSequence[0].ImagePositionPatient for f in object_.PerFrameFunctionalGroupsSequence]
            affine = FIXED_AFFINE if frame == self.fixed_frame else MOVING_AFFINE
            expected = [(affine @ [0, 0, k, 1])[:3] * [-1, -1, 1] for k in range(SIZE)]
            numpy.testing.assert_allclose(numpy.array(places, float), expected, atol=1e-9)
            if values is not None:
                numpy.testing.assert_array_equal(frames.transpose(2, 1, 0),
                                                 numpy.where(numpy.isnan(values), -1, values).astype(numpy.float32))
            else:
                self.assertAlmostEqual(float(numpy.median(frames)), 1, delta=0.1)


class DicomOutRefused(PhantomTest):
    def test_without_a_fixed_series_there_is_no_study_to_write_into(self):
        self.assert_refused(self.phantom.register("--write", "dicom"), INPUT, "--write dicom", "--fixed as DICOM")

    def test_a_series_without_a_frame_of_reference_is_refused(self):
        folder = self.phantom.folder / "intraop"
        write_series(self.phantom.fixed_array, FIXED_AFFINE, folder, "1.2.3")
        for path in folder.iterdir():
            image = pydicom.dcmread(path)
            del image.FrameOfReferenceUID
            image.save_as(path)
        result = self.phantom.register("--write", "dicom", "--dry-run", fixed=folder)
        self.assert_refused(result, INPUT, "intraop", "Frame of Reference UID")


if __name__ == "__main__":
    unittest.main()
