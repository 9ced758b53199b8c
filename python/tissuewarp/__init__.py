"""Registers images of soft tissue by simulating the tissue. Lengths in mm, stiffness in kPa, points in LPS.

    model = tissuewarp.prepare(preop_labels)                # before the operation
    updater = tissuewarp.Updater(model)
    result = updater.update(labels=intraop_labels)          # during it, again and again
    tumour_now = result.transform(tumour_before)            # (P, 3), LPS mm
    within = result.error(tumour_before).interval_mm        # 95 %

Images are tissuewarp.Image, or objects of nibabel, SimpleITK and ITK. Notes go to the logger "tissuewarp".
Long calls release Python's lock; one Updater works on one update at a time.
"""

from . import _core
from ._core import Doubt, Mesh, let_solves_take_one_blas_thread
from .errors import Cancelled, Error, GpuUnavailable, InvalidInput, IoError, SolverFailure
from .images import Image, as_image, read_image, read_labels
from .models import (Model, Updater, prepare, suggested_edge_length, suggested_edge_length_without_labels, update)
from .points import Curves, PointPairs, SurfacePoints
from .results import Errors, Inverse, Result, Trust
from .scenes import Simulation, simulate

__version__ = _core.version

__all__ = [
    "Cancelled", "Curves", "Doubt", "Error", "Errors", "GpuUnavailable", "Image", "Inverse", "InvalidInput", "IoError",
    "Mesh", "Model", "PointPairs", "Result", "Simulation", "SolverFailure", "SurfacePoints", "Trust", "Updater",
    "as_image", "let_solves_take_one_blas_thread", "prepare", "read_image", "read_labels", "simulate",
    "suggested_edge_length", "suggested_edge_length_without_labels", "update",
]

# As the program does: triangular solves on small supernodes are slower on many threads, and their last bits differ. For
# that time alone other users of OpenBLAS in this process have one thread too.
let_solves_take_one_blas_thread(True)
