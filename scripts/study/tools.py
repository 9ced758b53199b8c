"""The programs that are compared: which commands make each of them register, and where it leaves its fields.

A tool has `package`, the Debian package of its program or None, `settings`, the files that steer it,
`commands(folder, machine)`, the commands in order with their environment, `backward(folder)`, its displacement field from
fixed to moving, and `forward(folder)`, the one from moving to fixed or None.
"""

import dataclasses
import pathlib
import sys

SCRIPTS = pathlib.Path(__file__).resolve().parent.parent
PEERS = SCRIPTS / "peers"


@dataclasses.dataclass
class Machine:
    program: pathlib.Path  # tissuewarp
    threads: int


@dataclasses.dataclass
class Tissuewarp:
    arguments: list
    package = None
    settings = ()

    def commands(self, folder, machine):
        return [([machine.program, "register", *self.arguments, "--output", folder, "--threads", machine.threads], {})]

    def backward(self, folder):
        return folder / "displacement_fixed_to_moving.nii.gz"

    def forward(self, folder):
        return folder / "displacement_moving_to_fixed.nii.gz"


@dataclasses.dataclass
class Elastix:
    fixed: pathlib.Path
    moving: pathlib.Path
    stages: list  # files of scripts/peers, in order
    view: pathlib.Path = None  # mask of the fixed image
    package = "elastix"

    @property
    def settings(self):
        return [PEERS / stage for stage in self.stages]

    def commands(self, folder, machine):
        register = ["elastix", "-f", self.fixed, "-m", self.moving, "-out", folder, "-threads", machine.threads]
        register += ["-fMask", self.view] if self.view else []
        for stage in self.settings:
            register += ["-p", stage]
        last = folder / f"TransformParameters.{len(self.stages) - 1}.txt"
        return [(register, {}), (["transformix", "-def", "all", "-tp", last, "-out", folder, "-threads", machine.threads], {})]

    def backward(self, folder):
        return folder / "deformationField.mha"

    def forward(self, folder):
        return None


@dataclasses.dataclass
class Plastimatch:
    fixed: pathlib.Path
    moving: pathlib.Path
    stages: str  # file of scripts/peers
    view: pathlib.Path = None  # mask of the fixed image
    package = "plastimatch"

    @property
    def settings(self):
        return [PEERS / self.stages]

    def commands(self, folder, machine):
        roi = f"fixed_roi={self.view}\n" if self.view else ""
        (folder / "command.txt").write_text(
            f"[GLOBAL]\nfixed={self.fixed}\nmoving={self.moving}\n{roi}vf_out={self.backward(folder)}\n"
            f"img_out={folder / 'warped.mha'}\n\n{self.settings[0].read_text()}")
        return [(["plastimatch", "register", folder / "command.txt"], dict(OMP_NUM_THREADS=str(machine.threads)))]

    def backward(self, folder):
        return folder / "field.mha"

    def forward(self, folder):
        return None


@dataclasses.dataclass
class RigidIcp:
    surface: pathlib.Path  # intraoperative points, .ply
    labels: pathlib.Path  # preoperative label map
    like: pathlib.Path  # whose grid the field takes
    package = None
    settings = (SCRIPTS / "study" / "rigid_icp.py",)

    def commands(self, folder, machine):
        threads = dict(OMP_NUM_THREADS=str(machine.threads), OPENBLAS_NUM_THREADS=str(machine.threads))
        return [([sys.executable, self.settings[0], self.surface, self.labels, self.like, self.backward(folder)], threads)]

    def backward(self, folder):
        return folder / "field.nii.gz"

    def forward(self, folder):
        return None
