"""Simulations without a registration."""

import os
from typing import Dict

import numpy

from . import _core


class Simulation:
    """The frames of a scene. Frame 0 is at rest."""

    def __init__(self, core):
        self._core = core

    @property
    def mesh(self) -> _core.Mesh:
        """The tetrahedra at rest, LPS mm."""
        return self._core.mesh

    @property
    def times(self) -> numpy.ndarray:
        """(F,), s."""
        return numpy.array(self._core.times)

    def __len__(self):
        return len(self._core.times)

    def displacement(self, frame: int = -1) -> numpy.ndarray:
        """(N, 3), mm, of the nodes in a frame; NaN where tissue is gone. A read-only view."""
        return self._core.displacement(range(len(self))[frame])

    @property
    def probes(self) -> Dict[str, numpy.ndarray]:
        """By name (F, 3): displacement of each probe, mm; NaN where its tissue is gone."""
        by_frame = numpy.array([self._core.probes(frame) for frame in range(len(self))])
        return {name: by_frame[:, n] for n, name in enumerate(self._core.probe_names)}

    @property
    def engine(self) -> str:
        """The device that solved."""
        return self._core.engine

    @property
    def min_jacobian(self) -> float:
        """Least det F of all frames."""
        return self._core.min_jacobian


def simulate(scene, *, folder=".", progress=None) -> Simulation:
    """Runs a scene (the manual, simulate).

    scene     path of a scene file (str without a line break, or os.PathLike), or the text of one
    folder    where files lie that a text names
    progress  called as progress(stage, fraction in [0, 1]); returning False ends with Cancelled

    Raises IoError, InvalidInput, SolverFailure, GpuUnavailable, Cancelled.
    """
    if isinstance(scene, str) and "\n" in scene:
        return Simulation(_core.simulate_text(scene, os.fspath(folder), progress))
    return Simulation(_core.simulate_file(os.fspath(scene), progress))
