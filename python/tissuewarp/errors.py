"""The exceptions of tissuewarp. Every message states the value at fault, the limit that it broke and the remedy."""


class Error(Exception):
    """Base of everything that tissuewarp raises on purpose."""


class InvalidInput(Error, ValueError):
    """Data or parameters that cannot be used: wrong geometry, empty label, a value that is not finite."""


class IoError(Error, OSError):
    """A file that cannot be read or written."""


class SolverFailure(Error, RuntimeError):
    """The numerics did not reach an answer that can be trusted."""


class GpuUnavailable(Error, RuntimeError):
    """No usable OpenGL 4.5 device, or the device refused."""


class Cancelled(Error):
    """The function given as `progress` returned False."""
