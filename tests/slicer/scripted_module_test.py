"""The module of 3D Slicer with stand-ins for 3D Slicer (fake_slicer.py) and the real program, on the small phantom."""

import os
import pathlib
import shutil
import sys
import unittest
from unittest import mock

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "apps"), str(HERE.parents[1] / "slicer" / "TissueWarp")]
import fake_slicer  # noqa: E402

slicer = fake_slicer.install()
import TissueWarp  # noqa: E402
from phantom import CENTRE_LPS, PROGRAM, SHIFT_LPS, Phantom  # noqa: E402
from TissueWarpLib.registration_run import FILE_ENDINGS, RunError  # noqa: E402

Node = fake_slicer.Node
QUICK = "--edge-length 8 --rounds 1 --device cpu"


def markups(path, point):
    path.write_text('{"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": [{"label": "centre", '
                    f'"position": {list(map(float, point))}}}]}}]}}')
    return Node("vtkMRMLMarkupsFiducialNode", path)


class WholeRun(unittest.TestCase):
    """As the user goes: choose, register, look. One run that all methods look at."""

    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = Phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        volume, labels = "vtkMRMLScalarVolumeNode", "vtkMRMLLabelMapVolumeNode"
        nodes = {"moving": Node(volume, phantom.moving), "moving-labels": Node(labels, phantom.moving_labels),
                 "fixed": Node(volume, phantom.fixed), "fixed-labels": Node(labels, phantom.fixed_labels),
                 "landmarks-moving": markups(phantom.folder / "before.mrk.json", CENTRE_LPS),
                 "landmarks-fixed": markups(phantom.folder / "during.mrk.json", CENTRE_LPS + SHIFT_LPS)}
        cls.widget = widget = TissueWarp.TissueWarpWidget()
        # The phantom is NIfTI, which the stand-in copies unchanged.
        with mock.patch.dict(FILE_ENDINGS, {option: ".nii.gz" for option in list(nodes)[:4]}):
            widget.setup()
            for option, selector in widget.selectors.items():
                selector.currentNode.return_value = nodes.get(option)
            widget.program.currentPath, widget.more.text = PROGRAM, QUICK
            widget.onStart()
        cls.addClassCleanup(shutil.rmtree, widget.run.folder)
        assert widget.cancel.enabled and not widget.start.enabled
        widget.run.wait(100)
        widget.onPoll()

    def test_everything_is_loaded(self):
        self.assertEqual(slicer.util.errorDisplay.call_args_list, [])
        loaded = self.widget.logic.loaded
        self.assertEqual(set(loaded), {"transform", "warped", "organ", "error", "landmarks"})
        self.assertEqual(loaded["transform"].kind, "vtkMRMLTransformNode")
        self.assertEqual(pathlib.Path(loaded["error"].path).name, "uncertainty.nii.gz")

    def test_the_organ_is_coloured_by_a_scalar_that_it_has(self):
        organ = self.widget.logic.loaded["organ"]
        name = organ.display.SetActiveScalar.call_args[0][0]
        self.assertIn(f'Name="{name}"'.encode(), pathlib.Path(organ.path).read_bytes())
        organ.display.SetScalarVisibility.assert_called_with(True)

    def test_the_slider_goes_from_the_moving_to_the_warped_volume(self):
        self.widget.logic.showBetween(0.25)
        layers = slicer.util.setSliceViewerLayers.call_args.kwargs
        self.assertEqual(layers["background"].path, self.phantom.moving)
        self.assertEqual(layers["foreground"], self.widget.logic.loaded["warped"])
        self.assertEqual(layers["foregroundOpacity"], 0.25)

    def test_progress_and_doubts_are_shown(self):
        self.assertEqual(self.widget.progress.value, 100)
        self.assertIn("<p", self.widget.doubts.text)
        self.assertTrue(self.widget.start.enabled)
        self.assertFalse(self.widget.cancel.enabled)


class Segmentations(unittest.TestCase):
    def setUp(self):
        self.logic = TissueWarp.TissueWarpLogic()
        self.export = slicer.modules.segmentations.logic().ExportSegmentsToLabelmapNode
        self.export.reset_mock()
        self.moving = Node("vtkMRMLSegmentationNode", segments=["skin", "brain"])

    def test_segments_of_one_name_get_one_label(self):
        volumes = {option: Node("vtkMRMLScalarVolumeNode", option) for option in ("moving", "fixed")}
        fixed = Node("vtkMRMLSegmentationNode", segments=["brain", "probe"])
        maps = self.logic.labelMaps({"moving-labels": self.moving, "fixed-labels": fixed, **volumes})
        self.assertEqual(set(maps), {"moving-labels", "fixed-labels"})
        calls = [(call.args[0], list(call.args[1]), call.args[3]) for call in self.export.call_args_list]
        self.assertEqual(calls, [(self.moving, ["id of brain", "id of skin"], volumes["moving"]),
                                 (fixed, ["id of brain"], volumes["fixed"])])

    def test_a_segmentation_and_a_label_map_are_refused(self):
        labels = Node("vtkMRMLLabelMapVolumeNode", "labels.nrrd")
        with self.assertRaisesRegex(RunError, "choose two of a kind"):
            self.logic.labelMaps({"moving-labels": self.moving, "fixed-labels": labels})

    def test_label_maps_leave_the_scene_whatever_happens(self):
        with self.assertRaisesRegex(RunError, "cannot be written"):
            self.logic.write({"moving-labels": self.moving}, pathlib.Path("run"))
        self.assertEqual(slicer.mrmlScene.removed[-1].kind, "vtkMRMLLabelMapVolumeNode")

    def test_a_node_that_cannot_be_written_is_named(self):
        nodes = {"moving": Node("vtkMRMLScalarVolumeNode")}
        with self.assertRaisesRegex(RunError, "'vtkMRMLScalarVolumeNode' cannot be written"):
            self.logic.write(nodes, pathlib.Path("run"))


class Choices(unittest.TestCase):
    def test_every_input_can_be_chosen(self):
        offered = [option for _, choices in TissueWarp.CHOICES for option, _, _ in choices]
        self.assertEqual(sorted(offered), sorted(FILE_ENDINGS))

    def test_an_incomplete_choice_is_told_and_nothing_starts(self):
        widget = TissueWarp.TissueWarpWidget()
        widget.setup()
        for selector in widget.selectors.values():
            selector.currentNode.return_value = None
        with mock.patch.object(slicer.util, "errorDisplay") as display:
            widget.onStart()
        self.assertIn("choose the moving volume", display.call_args[0][0])
        self.assertIsNone(widget.run)


if __name__ == "__main__":
    unittest.main()
