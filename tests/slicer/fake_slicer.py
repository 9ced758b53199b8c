"""Stands in for 3D Slicer where its module is tested: nodes are files, and calls of slicer.util are kept or do file work.

It shows that the module's own logic is right, not that 3D Slicer takes these calls as they are meant: that is for the
module's self test in a running 3D Slicer. Qt, CTK and VTK are mocks that accept anything.
"""

import pathlib
import shutil
import sys
import tempfile
import types
import unittest
from unittest import mock


class Node:
    """A node of the scene that stands for a file; a segmentation has names of segments."""

    def __init__(self, kind, path=None, segments=()):
        self.kind, self.path, self.segments = kind, path, list(segments)
        self.name = pathlib.Path(path).stem if path else kind
        self.display = mock.MagicMock()

    def IsA(self, kind):
        return kind == self.kind

    def GetName(self):
        return self.name

    def SetName(self, name):
        self.name = name

    def GetDisplayNode(self):
        return self.display

    def GetSegmentation(self):
        segmentation = mock.MagicMock()
        segmentation.GetNumberOfSegments.return_value = len(self.segments)
        segmentation.GetNthSegment = lambda i: mock.MagicMock(GetName=lambda: self.segments[i])
        segmentation.GetSegmentIdBySegmentName = lambda name: f"id of {name}"
        return segmentation


class StringArray(list):
    def InsertNextValue(self, value):
        self.append(value)


class Scene:
    def __init__(self):
        self.removed = []

    def AddNewNodeByClass(self, kind, name):
        node = Node(kind)
        node.name = name
        return node

    def RemoveNode(self, node):
        self.removed.append(node)


def export_node(node, path, properties=None, world=False):
    """Copies the node's file as it is: readers go by the bytes, not by the ending that 3D Slicer would write."""
    if node.path is None:
        return False
    shutil.copyfile(node.path, path)
    return True


def loader(kind):
    def load(path):
        if not pathlib.Path(path).is_file():
            raise RuntimeError(f"{path} is not there")
        return Node(kind, path)
    return load


def install():
    """Puts the stand-ins where `import slicer` finds them; returns slicer."""
    slicer = types.ModuleType("slicer")
    slicer.mrmlScene = Scene()
    slicer.util = mock.MagicMock()
    slicer.util.exportNode = export_node
    slicer.util.startupEnvironment = lambda: None
    slicer.util.tempDirectory = lambda key: tempfile.mkdtemp(prefix=key)
    slicer.util.loadTransform = loader("vtkMRMLTransformNode")
    slicer.util.loadVolume = loader("vtkMRMLScalarVolumeNode")
    slicer.util.loadModel = loader("vtkMRMLModelNode")
    slicer.util.loadMarkups = loader("vtkMRMLMarkupsFiducialNode")
    slicer.modules = mock.MagicMock()
    slicer.app = mock.MagicMock()
    slicer.app.settings().value.side_effect = lambda key, default: default
    slicer.qMRMLNodeComboBox = mock.MagicMock
    slicer.vtkMRMLDisplayNode = mock.MagicMock()
    scripted = types.ModuleType("slicer.ScriptedLoadableModule")
    scripted.ScriptedLoadableModule = type("ScriptedLoadableModule", (), {"__init__": lambda self, parent: None})
    scripted.ScriptedLoadableModuleLogic = type("ScriptedLoadableModuleLogic", (), {})
    scripted.ScriptedLoadableModuleTest = unittest.TestCase
    scripted.ScriptedLoadableModuleWidget = type("ScriptedLoadableModuleWidget", (), {
        "setup": lambda self: setattr(self, "layout", mock.MagicMock())})
    slicer.ScriptedLoadableModule = scripted
    qt = mock.MagicMock()
    qt.QPushButton = lambda *_: mock.MagicMock()  # a mock called twice returns one object
    vtk = mock.MagicMock()
    vtk.vtkStringArray = StringArray
    sys.modules.update({"slicer": slicer, "slicer.ScriptedLoadableModule": scripted, "vtk": vtk, "qt": qt,
                        "ctk": mock.MagicMock()})
    return slicer
