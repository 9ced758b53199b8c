"""Registers soft tissue by simulating it: a module of 3D Slicer that runs the program tissuewarp."""

import pathlib

import ctk
import qt
import slicer
import vtk
from slicer.ScriptedLoadableModule import (ScriptedLoadableModule, ScriptedLoadableModuleLogic,
                                           ScriptedLoadableModuleTest, ScriptedLoadableModuleWidget)

from TissueWarpLib.registration_run import (FILE_ENDINGS, RegistrationRun, RunError, command_line, find_program,
                                            require_complete, segment_order)

SEGMENTS = ["vtkMRMLSegmentationNode", "vtkMRMLLabelMapVolumeNode"]
VOLUMES = ["vtkMRMLScalarVolumeNode"]
POINTS = ["vtkMRMLMarkupsFiducialNode"]

# (heading, [(option, what the user reads, kinds of nodes)])
CHOICES = [
    ("Before (moving)", [("moving", "Volume", VOLUMES), ("moving-labels", "Segmentation", SEGMENTS)]),
    ("During the operation (fixed)", [("fixed", "Volume", VOLUMES), ("fixed-labels", "Segmentation", SEGMENTS),
                                      ("fixed-surface", "Part of the surface", ["vtkMRMLModelNode"])]),
    ("Points to register to", [("moving-points", "Before", POINTS), ("fixed-points", "During", POINTS)]),
    ("Landmarks, to score only", [("landmarks-moving", "Before", POINTS), ("landmarks-fixed", "During", POINTS)]),
]
ERROR_SHOWN_MM = 5.0  # the end of the colour scale
PROGRAM_SETTING = "TissueWarp/Program"
POLL_MS = 200


class TissueWarp(ScriptedLoadableModule):
    def __init__(self, parent):
        super().__init__(parent)
        parent.title = "TissueWarp"
        parent.categories = ["Registration"]
        parent.contributors = ["tissuewarp maintainers"]
        parent.helpText = ("Carries images of soft tissue, taken before an operation, to where the tissue lies now, by "
                           "simulating the tissue. It says how far off places may lie. Not a medical device.")
        parent.acknowledgementText = "The program tissuewarp does the work (GPL)."


class TissueWarpWidget(ScriptedLoadableModuleWidget):
    def setup(self):
        super().setup()
        self.logic = TissueWarpLogic()
        self.run = None
        self.selectors = {}
        for heading, choices in CHOICES:
            self.addChoices(heading, choices)
        self.addSettings()
        self.addRun()
        self.addResults()
        self.timer = qt.QTimer()
        self.timer.setInterval(POLL_MS)
        self.timer.timeout.connect(self.onPoll)

    def addSection(self, heading, collapsed=False):
        section = ctk.ctkCollapsibleButton()
        section.text = heading
        section.collapsed = collapsed
        self.layout.addWidget(section)
        return qt.QFormLayout(section)

    def addChoices(self, heading, choices):
        form = self.addSection(heading)
        for option, label, kinds in choices:
            selector = slicer.qMRMLNodeComboBox()
            selector.nodeTypes = kinds
            selector.showChildNodeTypes = False  # a label map is a kind of volume
            selector.noneEnabled = True
            selector.addEnabled = False
            selector.removeEnabled = False
            selector.setMRMLScene(slicer.mrmlScene)
            selector.setCurrentNode(None)
            selector.setToolTip(f"tissuewarp register --{option}")
            form.addRow(label + ":", selector)
            self.selectors[option] = selector

    def addSettings(self):
        form = self.addSection("Program", collapsed=True)
        self.program = ctk.ctkPathLineEdit()
        self.program.filters = ctk.ctkPathLineEdit.Files
        self.program.currentPath = slicer.app.settings().value(PROGRAM_SETTING, "")
        self.program.setToolTip("Empty: the installed program")
        form.addRow("Program:", self.program)
        self.more = qt.QLineEdit()
        self.more.setToolTip("As on the command line, for instance --edge-length 6 --device cpu")
        form.addRow("More options:", self.more)

    def addRun(self):
        self.start = qt.QPushButton("Register")
        self.start.clicked.connect(self.onStart)
        self.cancel = qt.QPushButton("Cancel")
        self.cancel.enabled = False
        self.cancel.clicked.connect(self.onCancel)
        self.progress = qt.QProgressBar()
        self.progress.setRange(0, 100)
        for widget in (self.start, self.cancel, self.progress):
            self.layout.addWidget(widget)

    def addResults(self):
        form = self.addSection("Result")
        self.slider = ctk.ctkSliderWidget()
        self.slider.minimum, self.slider.maximum, self.slider.singleStep = 0, 1, 0.05
        self.slider.enabled = False
        self.slider.valueChanged.connect(self.logic.showBetween)
        form.addRow("Before … after:", self.slider)
        self.doubts = qt.QLabel()
        self.doubts.wordWrap = True
        form.addRow(self.doubts)
        self.layout.addStretch(1)

    def nodes(self):
        chosen = {option: selector.currentNode() for option, selector in self.selectors.items()}
        return {option: node for option, node in chosen.items() if node is not None}

    def onStart(self, *_):
        slicer.app.settings().setValue(PROGRAM_SETTING, self.program.currentPath)
        try:
            self.run = self.logic.start(self.nodes(), self.program.currentPath, self.more.text)
        except RunError as error:
            slicer.util.errorDisplay(str(error))
            return
        self.setRunning(True)
        self.timer.start()

    def onCancel(self, *_):
        if self.run:
            self.run.cancel()

    def onPoll(self):
        fraction, stage, running = self.run.poll()
        self.progress.value = int(100 * fraction)
        self.progress.format = f"{stage or 'starting'}  %p%"
        if not running:
            self.timer.stop()
            self.setRunning(False)
            self.onEnd()

    def onEnd(self):
        try:
            results = self.run.results()
        except RunError as error:
            self.doubts.text = ""
            if not self.run.cancelled:
                slicer.util.errorDisplay(str(error))
            return
        self.progress.value = 100
        self.logic.load(results)
        self.doubts.text = results.doubts_html()
        self.slider.enabled = "warped" in results.files
        self.slider.value = 1

    def setRunning(self, running):
        self.start.enabled = not running
        self.cancel.enabled = running

    def cleanup(self):
        self.timer.stop()
        if self.run and self.run.poll()[2]:
            self.run.cancel()


class TissueWarpLogic(ScriptedLoadableModuleLogic):
    """Between the scene and the files of a run."""

    def __init__(self):
        super().__init__()
        self.moving = None
        self.loaded = {}

    def start(self, nodes, program="", more=""):
        """Writes the nodes to files and starts the program. Throws RunError."""
        require_complete(nodes)
        program = find_program(program, pathlib.Path(__file__).parent)
        folder = pathlib.Path(slicer.util.tempDirectory("tissuewarp"))
        command = command_line(program, self.write(nodes, folder), folder, more)
        self.moving = nodes.get("moving")
        # The program's libraries are not those of 3D Slicer.
        return RegistrationRun(command, folder, slicer.util.startupEnvironment())

    def write(self, nodes, folder):
        """{option: file} of the nodes, transforms applied."""
        files = {option: folder / (option + FILE_ENDINGS[option]) for option in nodes}
        labels = self.labelMaps(nodes)
        try:
            for option, node in {**nodes, **labels}.items():
                if not slicer.util.exportNode(node, str(files[option]), world=True):
                    raise RunError(f"'{node.GetName()}' cannot be written to '{files[option]}'; is the disk full?")
        finally:
            for node in labels.values():
                slicer.mrmlScene.RemoveNode(node)
        return files

    def labelMaps(self, nodes):
        """Label maps made of the segmentations among the nodes, for the time of writing."""
        segmentations = {option: nodes[option] for option in ("moving-labels", "fixed-labels")
                         if option in nodes and nodes[option].IsA("vtkMRMLSegmentationNode")}
        if not segmentations:
            return {}
        if len(segmentations) == 1 and {"moving-labels", "fixed-labels"} <= nodes.keys():
            raise RunError("one of the images has a segmentation and the other a label map; choose two of a kind")
        names = {option: self.segmentNames(node) for option, node in segmentations.items()}
        if "moving-labels" in names:
            orders = segment_order(names["moving-labels"], names.get("fixed-labels"))
        else:
            orders = [], names["fixed-labels"]
        references = {"moving-labels": nodes.get("moving"), "fixed-labels": nodes.get("fixed")}
        return {option: self.labelMap(segmentations[option], order, references[option])
                for option, order in zip(("moving-labels", "fixed-labels"), orders) if option in segmentations}

    def segmentNames(self, node):
        segmentation = node.GetSegmentation()
        return [segmentation.GetNthSegment(i).GetName() for i in range(segmentation.GetNumberOfSegments())]

    def labelMap(self, node, names, reference):
        """Segments as labels 1, 2, …, in the order of their names, on the grid of the reference or their own."""
        segmentation = node.GetSegmentation()
        ids = vtk.vtkStringArray()
        for name in names:
            ids.InsertNextValue(segmentation.GetSegmentIdBySegmentName(name))
        result = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLLabelMapVolumeNode", node.GetName() + " labels")
        if not slicer.modules.segmentations.logic().ExportSegmentsToLabelmapNode(node, ids, result, reference):
            slicer.mrmlScene.RemoveNode(result)
            raise RunError(f"segmentation '{node.GetName()}' cannot be made a label map; is it empty?")
        return result

    def load(self, results):
        """Loads what the run wrote; the results of the run before go."""
        for node in self.loaded.values():
            slicer.mrmlScene.RemoveNode(node)
        load = {"transform": slicer.util.loadTransform, "warped": slicer.util.loadVolume, "organ": slicer.util.loadModel,
                "error": slicer.util.loadVolume, "landmarks": slicer.util.loadMarkups}
        self.loaded = {role: load[role](str(path)) for role, path in results.files.items()}
        for role, node in self.loaded.items():
            node.SetName("tissuewarp " + role)
        if "organ" in self.loaded:
            self.colourByError(self.loaded["organ"])
        self.showBetween(1)

    def colourByError(self, model):
        display = model.GetDisplayNode()
        display.SetActiveScalar("deviation_mm", vtk.vtkAssignAttribute.POINT_DATA)
        display.SetAndObserveColorNodeID("vtkMRMLColorTableNodeFileColdToHotRainbow.txt")
        display.SetScalarRangeFlag(slicer.vtkMRMLDisplayNode.UseManualScalarRange)
        display.SetScalarRange(0, ERROR_SHOWN_MM)
        display.SetScalarVisibility(True)

    def showBetween(self, fraction):
        """0: the moving volume as it was; 1: the warped one."""
        if "warped" in self.loaded and self.moving is not None:
            slicer.util.setSliceViewerLayers(background=self.moving, foreground=self.loaded["warped"],
                                             foregroundOpacity=fraction)


class TissueWarpTest(ScriptedLoadableModuleTest):
    """Run it in 3D Slicer: Edit, Application Settings, Developer, Enable developer mode; then Reload and Test."""

    def setUp(self):
        slicer.mrmlScene.Clear()

    def runTest(self):
        self.setUp()
        self.test_ball_moves()

    def test_ball_moves(self):
        """A ball of 12 mm that moved by 4 mm to the right (R)."""
        nodes = {option: self.ball(option, shift) for option, shift in (("moving-labels", 0), ("fixed-labels", 4))}
        logic = TissueWarpLogic()
        run = logic.start(nodes, more="--edge-length 6 --rounds 2 --device cpu")
        run.wait(120)
        results = run.results()
        logic.load(results)
        self.assertIn("organ", logic.loaded)
        moved = logic.loaded["transform"].GetTransformToParent().TransformPoint([20, 20, 20])
        self.assertLess(abs(moved[0] - 24), 0.5)
        self.delayDisplay("The ball arrived.")

    def ball(self, name, shift):
        import numpy
        z, y, x = numpy.mgrid[:40, :40, :44]
        array = ((x - 20 - shift) ** 2 + (y - 20) ** 2 + (z - 20) ** 2 < 144).astype(numpy.uint8)
        return slicer.util.addVolumeFromArray(array, name=name, nodeClassName="vtkMRMLLabelMapVolumeNode")
