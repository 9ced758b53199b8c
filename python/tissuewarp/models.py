"""Before the operation: the patient's model. During it: updates."""

import os
import threading
from typing import Callable, Mapping, Optional, Sequence, Tuple

import numpy

from . import _core
from .errors import InvalidInput
from .images import Image, as_image, geometry_of, labels_volume
from .results import Result

Progress = Optional[Callable[[str, float], object]]
Moduli = Tuple[float, float]


class Model:
    """What prepare() makes: mesh, rest state and stiffness of one patient's organ. Not changed by updates."""

    def __init__(self, core):
        self._core = core

    @property
    def mesh(self) -> _core.Mesh:
        """The tetrahedra at rest, LPS mm of the preoperative image."""
        return self._core.mesh

    @property
    def labels(self) -> Image:
        """The label map that the model was made of, int32."""
        return Image._of(self._core.labels)

    def save(self, path) -> None:
        """Writes the model to a file (HDF5), so that it is prepared before the operation. Raises IoError."""
        _core.write_prepared(self._core, os.fspath(path))

    @classmethod
    def load(cls, path, progress: Progress = None) -> "Model":
        """Reads what save() wrote. Raises IoError, InvalidInput, Cancelled."""
        return cls(_core.read_prepared(os.fspath(path), progress))


def prepare(labels, *, image=None, contrasts: Sequence = (), mesh: Optional[_core.Mesh] = None,
            edge_length: Optional[float] = None, label_edge_length: Optional[Mapping[int, float]] = None,
            materials: Optional[Mapping[int, Moduli]] = None, default_material: Moduli = (3.0, 0.45),
            anchors: Sequence[int] = (), rigid_neighbours: Sequence[int] = (), resected: Sequence[int] = (),
            sliding: Sequence[Tuple[int, int]] = (), progress: Progress = None) -> Model:
    """Makes the model of a patient from a label map. Takes seconds to minutes.

    labels            label map (image of whole numbers, 0 is background)
    image             preoperative grey image, to register to a bare image (Updater.update(image=…)); without one the
                      model also gets what updates from labels and points take to find loads that nobody stated
    contrasts         further grey images in the frame of `image`
    mesh              tetrahedra of the same organ that exist already, in place of meshing
    edge_length       mm, of the tetrahedra; None: about 50 000 of them. suggested_edge_length_without_labels() gives
                      what suffices where no label map is registered to
    label_edge_length mm, by label
    materials         by label: (Young's modulus in kPa, Poisson's ratio); only ratios of the moduli tell
    default_material  of labels that `materials` lacks
    anchors           labels of tissue that stays where the rigid placement has it
    rigid_neighbours  labels of bone and the like, along which the organ slides
    resected          labels of tissue that is gone by the time of the operation: neither meshed nor matched
    sliding           pairs of labels whose tissue slides on one another where they touch
    progress          called as progress(stage, fraction in [0, 1]); returning False ends with Cancelled

    Raises InvalidInput, Cancelled.
    """
    if contrasts and image is None:
        raise InvalidInput("contrasts go beside an image; give image=")
    options = _core.PrepareOptions(0.0 if edge_length is None else edge_length, dict(label_edge_length or {}),
                                   dict(materials or {}), default_material, list(anchors), list(rigid_neighbours),
                                   list(resected), [tuple(pair) for pair in sliding])
    core = _core.prepare(labels_volume(labels, "labels"), mesh, options, progress)
    if image is None:
        _core.prepare_loads(core, progress)
    else:
        _core.prepare_image(core, as_image(image)._volume, progress)
        for contrast in contrasts:
            _core.prepare_contrast(core, as_image(contrast)._volume, progress)
    return Model(core)


def suggested_edge_length(labels) -> float:
    """mm, of tetrahedra that cut the labelled organ into about 50 000: to register to a label map."""
    return _core.suggested_edge_length(labels_volume(labels, "labels"))


def suggested_edge_length_without_labels(labels) -> float:
    """mm, of about 15 000: to register to an image or to points."""
    return _core.suggested_edge_length_without_labels(labels_volume(labels, "labels"))


class Updater:
    """Registers one model again and again; keeps what updates share: engine, device, images.

    model          of prepare(); it may be shared
    align          False: the images are in one frame already
    rounds         of correspondence and equilibrium
    tolerance      mm, accepted error of each equilibrium
    time_budget    s that an update may take; 0: as long as it takes
    device         "auto", "cpu", "gpu" or "gpu:N", N counting EGL devices

    Raises GpuUnavailable where a GPU was asked for and there is none.
    """

    def __init__(self, model: Model, *, align: bool = True, rounds: int = 8, tolerance: float = 0.05,
                 time_budget: float = 0.0, device: str = "auto", progress: Progress = None):
        self._model = model
        self._tolerance = tolerance
        self._busy = threading.Lock()
        options = _core.UpdateOptions(align, rounds, tolerance, time_budget, *_device(device))
        self._core = _core.Updater(model._core, options, progress)

    def update(self, *, labels=None, image=None, contrasts: Sequence = (), surface=None, points=None, curves=None,
               start=None, grid=None, last: Optional[Result] = None, progress: Progress = None) -> Result:
        """Registers the model to what was seen: any of these, alone or together. One update at a time.

        labels     label map with the numbers of the preoperative one
        image      grey values, any modality; the model needs prepare(…, image=…)
        contrasts  further images, in the order of the model's
        surface    SurfacePoints
        points     PointPairs
        curves     Curves
        start      (4, 4), moving → fixed, LPS mm: where the organ is known to lie, in place of the headers' placement
        grid       image on whose voxels results are given by default; None: that of `image` or `labels`, or else the
                   preoperative one, carried along by the placement
        last       result of an earlier update of the same model, from which this one goes on in a fraction of the time;
                   where what is seen does not agree with it, the update is made from its beginning
                   (Result.why_begun_anew)
        progress   called as progress(stage, fraction in [0, 1]); returning False ends with Cancelled

        Raises InvalidInput, SolverFailure, GpuUnavailable, Cancelled.
        """
        seen = _core.Intraoperative()
        seen.labels = None if labels is None else labels_volume(labels, "labels")
        seen.image = None if image is None else as_image(image)._volume
        seen.contrasts = [as_image(contrast)._volume for contrast in contrasts]
        seen.surface = None if surface is None else surface._data
        seen.points = None if points is None else points._data
        seen.curves = None if curves is None else curves._data
        if start is not None:
            seen.set_start(_rigid_motion(start))
        if not self._busy.acquire(blocking=False):
            raise InvalidInput("this Updater is at work already; wait for its update, or make another Updater")
        try:
            result = self._core.update(seen, None if last is None else last._core, progress)
        finally:
            self._busy.release()
        shown = next((given for given in (grid, image, labels) if given is not None), None)
        return Result(self._model._core, result, self._tolerance, None if shown is None else geometry_of(shown))



def update(model: Model, *, align: bool = True, rounds: int = 8, tolerance: float = 0.05, time_budget: float = 0.0,
           device: str = "auto", progress: Progress = None, **seen) -> Result:
    """One update: Updater(model, …).update(…)."""
    updater = Updater(model, align=align, rounds=rounds, tolerance=tolerance, time_budget=time_budget, device=device,
                      progress=progress)
    return updater.update(progress=progress, **seen)


def _device(name):
    kinds = {"auto": 0, "cpu": 1, "gpu": 2}
    kind, _, index = name.partition(":")
    if kind not in kinds or (index and (kind != "gpu" or not index.isdigit())):
        raise InvalidInput(f"device '{name}'; give auto, cpu, gpu or gpu:<number>")
    return kinds[kind], int(index) if index else -1


def _rigid_motion(matrix):
    matrix = numpy.asarray(matrix, dtype=float)
    rotation = matrix[:3, :3]
    if matrix.shape != (4, 4) or not (numpy.allclose(rotation.T @ rotation, numpy.eye(3), atol=1e-3)
                                      and numpy.linalg.det(rotation) > 0 and numpy.isfinite(matrix).all()):
        raise InvalidInput(f"start: {matrix.tolist()} is no rigid motion; give (4, 4), moving to fixed, LPS mm")
    return matrix
