"""What an update found, and how far it can be trusted."""

import dataclasses
import enum
from typing import Dict, List, Tuple

import numpy

from . import _core
from .errors import InvalidInput
from .images import Image, as_image, geometry_of, labels_volume
from .points import as_points


class Trust(enum.IntEnum):
    """What the data say of a place."""

    OUTSIDE = 0  #: no tissue of the model
    SHOWN = 1  #: data show it, and it lies within 5 mm with a probability of 95 %
    CARRIED = 2  #: no datum is near: mechanics carried it there, within 5 mm with 95 % all the same
    UNKNOWN = 3  #: do not trust: it may lie 5 mm off or more


@dataclasses.dataclass(frozen=True)
class Errors:
    """How far the true places of P points may lie from where a registration puts them; NaN outside the tissue."""

    deviation_mm: numpy.ndarray  #: (P,), 1 σ of all together
    interval_mm: numpy.ndarray  #: (P,): with a probability of 95 % the true place lies within
    trust: numpy.ndarray  #: (P,) uint8, values of Trust
    solver_mm: numpy.ndarray  #: (P,), what the solver left
    mesh_mm: numpy.ndarray  #: (P,), what the mesh cannot follow; NaN where there is no estimate of it
    data_mm: numpy.ndarray  #: (P,), what data and tissue leave open
    covariance_mm2: numpy.ndarray  #: (P, 3, 3), mm², axes of the moving frame


class Inverse:
    """The way back, from the operation to the preoperative image."""

    def __init__(self, result):
        self._result = result
        self._transform = None

    def transform(self, points) -> numpy.ndarray:
        """Where intraoperative points (P, 3) were before, (P, 3), LPS mm; NaN where the field folds."""
        points = as_points(points)
        if self._transform is None:
            self._transform = _core.InversePointTransform(self._result._core)
        return self._transform(points)

    def field(self, grid=None) -> Image:
        """Displacement, intraoperative → preoperative, on the grid of an image of the operation: vectors in LPS mm,
        what the resamplers of ITK, SimpleITK and ANTs take. `grid` None: that of the update."""
        return Image._of(self._result._field(self._result._grid_of(grid)))


class Result:
    """A registration: moving is before the operation, fixed during it. Lengths are mm, frames LPS."""

    def __init__(self, model, core, tolerance, grid):
        self._model, self._core, self._tolerance, self._grid = model, core, tolerance, grid
        self._transform = self._uncertainty = self._kept = None
        self.inverse = Inverse(self)

    @property
    def mesh(self) -> _core.Mesh:
        """The tetrahedra at rest, moving frame."""
        return self._core.mesh

    @property
    def displacement(self) -> numpy.ndarray:
        """(N, 3), mm, of the nodes before the placement: node n goes to placement · (nodes[n] + displacement[n])."""
        return self._core.displacement

    @property
    def placement(self) -> numpy.ndarray:
        """(4, 4), rigid motion, moving → fixed."""
        return self._core.placement

    @property
    def doubts(self) -> List[_core.Doubt]:
        """Reasons not to trust the result; those of the error estimate too, once it was asked for."""
        estimated = [] if self._uncertainty is None else self._uncertainty.doubts(self._tolerance)
        return self._core.doubts + estimated

    @property
    def began_at_last(self) -> bool:
        """Whether the update went on from an earlier one."""
        return self._core.began_at_last

    @property
    def why_begun_anew(self) -> str:
        """Why it did not, where it was given one; or empty."""
        return self._core.why_begun_anew

    @property
    def times(self) -> Dict[str, float]:
        """Seconds by stage."""
        return self._core.times

    @property
    def engine(self) -> str:
        """The device that solved."""
        return self._core.engine

    @property
    def min_jacobian(self) -> float:
        """Least det F of an element: 1 is no change of volume, 0 and less is folded."""
        return self._core.min_jacobian

    @property
    def cut_short(self) -> bool:
        """Whether the time budget ended the rounds early."""
        return self._core.cut_short

    def transform(self, points) -> numpy.ndarray:
        """Where preoperative points (P, 3) are now, (P, 3), LPS mm."""
        points = as_points(points)
        if self._transform is None:
            self._transform = _core.PointTransform(self._core)
        return self._transform(points)

    def field(self, grid=None) -> Image:
        """Displacement, preoperative → intraoperative, on the grid of a preoperative image: vectors in LPS mm. For
        points and meshes; resamplers take inverse.field(). `grid` None: that of the preoperative labels."""
        geometry = self._model.labels.geometry if grid is None else geometry_of(grid)
        return Image._of(_core.field_moving_to_fixed(self._core, geometry))

    def hold_surroundings(self, moving, fixed) -> None:
        """Bone stays bone: from now on fields, warp() and points outside the organ follow what the grey images before
        (moving) and during the operation (fixed) both show to have moved as one rigid body around it. The logger "tissuewarp"
        is told (INFO) where the organ slid along it."""
        _core.hold_surroundings(self._core, as_image(moving)._volume, as_image(fixed)._volume)
        self._transform = self._kept = None
        self.inverse = Inverse(self)

    def warp(self, image, grid=None, interpolation: str = "linear", outside: float = 0.0) -> Image:
        """Carries a preoperative image into the operation.

        image          grey image or label map of the moving frame; its voxel type is kept, of labels it becomes int32
        grid           image whose voxels the result has; None: that of the update
        interpolation  "linear", or "nearest" for labels
        outside        value of voxels whose tissue lay outside the image

        The field of the last grid is kept, so that a second image costs little.
        """
        field = self._field(self._grid_of(grid))
        if interpolation == "nearest":
            return Image._of(_core.warp_labels(labels_volume(image, "image"), field))
        if interpolation != "linear":
            raise InvalidInput(f"interpolation '{interpolation}'; give linear, or nearest for labels")
        return Image._of(_core.warp_image(as_image(image)._volume, field, outside))

    def error(self, points, progress=None) -> Errors:
        """How far off preoperative points (P, 3), LPS mm, may be carried. The first call takes seconds.

        Raises SolverFailure, Cancelled.
        """
        return Errors(**self._estimate(progress).at(as_points(points)))

    def error_image(self, grid=None, progress=None) -> Tuple[Image, Image]:
        """The same on the grid of an image of the operation: deviation (mm, 1 σ, float32, NaN outside the tissue) and
        trust (uint8, values of Trust)."""
        deviation, trust = self._estimate(progress).on_grid(self._core, self._grid_of(grid))
        return Image._of(deviation), Image._of(trust)

    def _estimate(self, progress):
        if self._uncertainty is None:
            self._uncertainty = _core.uncertainty(self._model, self._core, progress)
        return self._uncertainty

    def _grid_of(self, grid):
        if grid is not None:
            return geometry_of(grid)
        return self._grid if self._grid is not None else self._carried_grid()

    def _carried_grid(self):
        grid, placement = self._model.labels.geometry, self.placement
        return _core.Geometry(grid.size, placement[:3, :3] @ grid.origin + placement[:3, 3], grid.spacing,
                              placement[:3, :3] @ grid.direction)

    def _field(self, grid):
        key = (tuple(grid.size), grid.origin.tobytes(), grid.spacing.tobytes(), grid.direction.tobytes())
        if self._kept is None or self._kept[0] != key:
            self._kept = (key, _core.field_fixed_to_moving(self._core, grid))
        return self._kept[1]
