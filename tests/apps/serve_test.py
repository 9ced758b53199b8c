"""serve: a patient over OpenIGTLink, to the client of python/ and to Debian's own library."""

import json
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import unittest
import unittest.mock

import h5py
import nibabel
import numpy

from patient_test import prepared, surface_of
from phantom import CENTRE_LPS, FIXED_AFFINE, MOVING_AFFINE, PROGRAM, SHIFT_LPS, SIZE, Phantom, lps_of_voxels, run, save
from points_test import pairs_of, save_points

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "python"))
from tissuewarp_client import Client, Lost, crc64, pack, pack_points, pack_text  # noqa: E402


class Server:
    """The program, serving on a port that is free."""

    def __init__(self, patient, *options):
        self.process = subprocess.Popen([PROGRAM, "serve", str(patient), "--port", "0", "--device", "cpu",
                                         *map(str, options)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.said = []
        for line in self.process.stdout:
            self.said.append(line)
            if line.startswith("serving"):
                self.port = int(line.split()[-1])
                return
        raise AssertionError(f"no server: {self.process.stderr.read()}")

    def client(self):
        return Client(port=self.port)

    def stop(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        out, error = self.process.communicate(timeout=60)
        self.said += out.splitlines()
        return self.process.returncode, error


class Receiving(unittest.TestCase):
    """The client, against a server that is slow."""

    def test_long_messages_have_the_checksum_of_short_ones(self):
        random = numpy.random.default_rng(3)
        for size in ((1 << 20) + 1, (1 << 20) + 4095, 1_500_000):
            data = random.bytes(size)
            with unittest.mock.patch("tissuewarp_client.numpy", None):
                byte_by_byte = crc64(data)
            self.assertEqual(crc64(data), byte_by_byte, size)

    def test_a_message_that_comes_late_is_not_lost(self):
        with socket.create_server(("127.0.0.1", 0)) as listener:
            with Client(port=listener.getsockname()[1]) as client:
                server, _ = listener.accept()
                with server:
                    message = pack("STRING", "slow", pack_text("here it is"), 1234.5)
                    server.sendall(message[:60])
                    for _ in range(2):
                        self.assertRaises(TimeoutError, client.receive, 0.05)
                    server.sendall(message[60:] + pack("STRING", "next", pack_text("and more")))
                    self.assertEqual(client.receive(), ("STRING", "slow", "here it is"))
                    self.assertEqual(client.receive(), ("STRING", "next", "and more"))
                    self.assertEqual(client.time_of("slow"), 1234.5)


def lps_pairs(phantom):
    table = numpy.loadtxt(pairs_of(phantom), delimiter=",", skiprows=1)
    names = [f"p{n}" for n in range(len(table))]
    return dict(zip(names, table[:, :3].tolist())), dict(zip(names, table[:, 3:].tolist()))


def deformed_nodes(record):
    with h5py.File(record) as file:
        moved = file["mesh/nodes"][:] + file["displacement"][:]
        placement = file["placement"][:]
    return moved @ placement[:3, :3].T + placement[:3, 3]


def furthest(points, nodes):
    """From points to the nearest node, mm."""
    return max(numpy.min(numpy.linalg.norm(nodes - point, axis=1)) for point in numpy.asarray(points))


class Serving(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = Phantom()
        cls.addClassCleanup(cls.phantom.temporary.cleanup)
        cls.patient = prepared(cls.phantom)
        cls.folder = cls.phantom.folder / "shared"
        cls.folder.mkdir()
        targets = save_points(numpy.array([CENTRE_LPS, CENTRE_LPS + [5, 0, 0]]), cls.phantom.folder / "targets.csv")
        cls.server = Server(cls.patient, "--folder", cls.folder, "--targets", targets)
        cls.addClassCleanup(cls.server.stop)

    def setUp(self):
        self.client = self.server.client()
        self.addCleanup(self.client.close)
        self.client.answer(self.client.request("forget", names=["fixed", "fixed_labels", "fixed_surface",
                                                                "fixed_points", "start"]))

    def updated(self, *seen):
        """What the verb makes of the same data."""
        output = self.phantom.folder / "verb"
        result = run("update", self.patient, *seen, "--device", "cpu", "--output", output)
        self.assertEqual(result.returncode, 0, result.stderr)
        return output

    def assert_same_doubts(self, answer, verb):
        def codes(doubts):
            return {doubt["code"] for doubt in doubts if doubt["severity"] == "doubt"}
        doubts = codes(answer["doubts"])
        self.assertEqual(doubts, codes(json.loads((verb / "report.json").read_text())["doubts"]))
        self.assertEqual(answer["status"], "doubted" if doubts else "ok")

    def send_pairs(self):
        moving, fixed = lps_pairs(self.phantom)
        self.client.send_points("moving_points", moving)
        self.client.send_points("fixed_points", fixed)

    def test_pairs_give_what_update_gives(self):
        self.send_pairs()
        answer = self.client.update(points_sd_mm=0.5)
        self.assertEqual(answer["status"], "ok", answer)
        self.assertFalse(answer["outdated"])
        organ = self.client.newest("organ")
        self.assertAlmostEqual(self.client.time_of("organ"), answer["time"], delta=1e-6)
        verb = self.updated("--fixed-points", pairs_of(self.phantom), "--points-sd", 0.5)
        self.assertLess(furthest(organ["points"], deformed_nodes(verb / "record.h5")), 0.02)
        errors = organ["arrays"]
        self.assertEqual(len(errors["interval_95_mm"]), len(organ["points"]))
        self.assertGreater(min(errors["interval_95_mm"]), 0)
        self.assertEqual(max(errors["doubted"]), 0)

    def test_targets_with_their_errors(self):
        self.send_pairs()
        self.client.update(points_sd_mm=0.5)
        self.client.seen.pop(("targets_now", "POINT"), None)  # of an update before
        while self.client.newest("targets_now") is None:
            self.client.receive()
        place, group = self.client.newest("targets_now")["target 1"]
        numpy.testing.assert_allclose(place, CENTRE_LPS + [2, -1.5, 1], atol=0.7)
        self.assertIn("95 % within", group)

    def test_surface(self):
        points = numpy.loadtxt(surface_of(self.phantom), delimiter=",", skiprows=1)
        self.client.send_surface(points.tolist())
        answer = self.client.update(surface_sd_mm=0.3)
        self.assertIn(answer["status"], ("ok", "doubted"), answer)
        verb = self.updated("--fixed-surface", surface_of(self.phantom), "--surface-sd", 0.3)
        self.assertLess(furthest(self.client.newest("organ")["points"], deformed_nodes(verb / "record.h5")), 0.05)
        self.assert_same_doubts(answer, verb)

    def test_a_stylus_gives_what_the_points_of_its_touches_give(self):
        points = numpy.loadtxt(surface_of(self.phantom), delimiter=",", skiprows=1).tolist()
        self.client.answer(self.client.request("gather", names=["StylusTip"], spacing_mm=0.1))
        for place in points:
            self.client.send_touch(place, "StylusTip")
        self.assertEqual(self.client.answer(self.client.request("pause"))["status"], "ok")
        self.assertIn(f"points touched: {len(points)}", self.client.answer(self.client.request("info"))["why"])
        touched = self.client.update(surface_sd_mm=0.3, begin_anew=True, use=["touched"])
        self.client.answer(self.client.request("forget", names=["touched"]))
        self.client.send_surface(points)
        self.assertEqual(self.client.update(surface_sd_mm=0.3, begin_anew=True)["digest"], touched["digest"])

    # Of bytes in the axes of the file: i runs along -L, j along -P.
    grid = ("B", (SIZE,) * 3, (1, 1, 1), (FIXED_AFFINE[:3, 3] * [-1, -1, 1]).tolist(), ((-1, 0, 0), (0, -1, 0), (0, 0, 1)))

    def send_labels(self):
        self.client.send_image("fixed_labels", self.phantom.fixed_labels_array.transpose(2, 1, 0).tobytes(), *self.grid)

    def test_labels_and_the_field_as_an_image(self):
        self.send_labels()
        answer = self.client.update(send=["field", "warped"])
        field = self.client.newest("field", "IMAGE")
        verb = self.updated("--fixed-labels", self.phantom.fixed_labels)
        self.assert_same_doubts(answer, verb)
        written = nibabel.load(verb / "displacement_fixed_to_moving.nii.gz")
        self.assertEqual(field["components"], 3)
        lps = numpy.asarray(written.dataobj).squeeze()
        ras = numpy.frombuffer(field["voxels"], "<f4").reshape(SIZE, SIZE, SIZE, 3).transpose(2, 1, 0, 3)
        numpy.testing.assert_allclose(ras * [-1, -1, 1], lps, atol=0.01)
        numpy.testing.assert_allclose(field["origin"], FIXED_AFFINE[:3, 3] * [-1, -1, 1], atol=1e-4)
        warped = self.client.newest("warped", "IMAGE")
        expected = nibabel.load(verb / "warped.nii.gz").get_fdata()
        got = numpy.frombuffer(warped["voxels"], numpy.dtype(warped["kind"])).reshape((SIZE,) * 3).transpose(2, 1, 0)
        numpy.testing.assert_allclose(got, expected, atol=0.5)

    def test_bone_around_the_organ_stays(self):
        """Both images show the same structure around the organ, which moves by 2.7 mm."""
        waves, phases = numpy.random.default_rng(3).normal(0, 0.5, (12, 3)), numpy.random.default_rng(4).uniform(0, 6, 12)

        def with_bone(affine, grey):
            places = lps_of_voxels(affine)
            bone = numpy.linalg.norm(places - CENTRE_LPS - SHIFT_LPS / 2, axis=-1) > 19
            structure = 128 + 12 * numpy.sin(places @ waves.T + phases).sum(axis=-1)
            return numpy.where(bone, structure, grey).clip(0, 255).astype(numpy.uint8), bone

        moving, _ = with_bone(MOVING_AFFINE, self.phantom.moving_array)
        fixed, bone = with_bone(FIXED_AFFINE, self.phantom.fixed_array)
        patient = prepared(self.phantom, name="bone.tw", moving=save(moving, MOVING_AFFINE, self.phantom.folder / "bone.nii.gz"))
        server = Server(patient)
        self.addCleanup(server.stop)
        self.client.close()
        self.client = server.client()
        self.addCleanup(self.client.close)
        self.send_labels()
        self.client.send_image("fixed", fixed.transpose(2, 1, 0).tobytes(), *self.grid)
        answer = self.client.update(send=["field"])
        self.assertIn(answer["status"], ("ok", "doubted"), answer)
        field = numpy.frombuffer(self.client.newest("field", "IMAGE")["voxels"], "<f4").reshape(SIZE, SIZE, SIZE, 3)
        moved = numpy.linalg.norm(field.transpose(2, 1, 0, 3), axis=-1)
        self.assertLess(numpy.percentile(moved[bone], 95), 0.05)  # its edge is soft
        self.assertGreater(moved[self.phantom.fixed_labels_array > 0].mean(), 2)

    def test_debians_own_library(self):
        moving, fixed = lps_pairs(self.phantom)
        turn = numpy.array([-1, -1, 1])
        lines = "".join(" ".join([name, *map(str, moving[name] * turn), *map(str, fixed[name] * turn)]) + "\n"
                        for name in moving)
        result = subprocess.run([os.environ["TISSUEWARP_IGTL_CLIENT"], str(self.server.port)], input=lines, text=True,
                                capture_output=True, timeout=100, check=True)
        said = result.stdout.splitlines()
        answers = [json.loads(line.removeprefix("string ")) for line in said if line.startswith("string")]
        self.assertEqual([a["status"] for a in answers if a["sequence"] in (1, 2)], ["ok", "ok"], answers)
        at = next(n for n, line in enumerate(said) if line.startswith("organ"))
        count, triangles, *arrays = said[at].split()[1:]
        self.assertIn("interval_95_mm", arrays)
        organ = numpy.loadtxt(said[at + 1:at + 1 + int(count)]) * turn
        with self.server.client() as own:
            own.answer(own.request("update", points_sd_mm=0.5))
            while own.newest("organ") is None:
                own.receive()
            self.assertEqual(len(own.newest("organ")["triangles"]), int(triangles))
            numpy.testing.assert_allclose(organ, own.newest("organ")["points"], atol=1e-4)

    def test_the_example(self):
        root = pathlib.Path(__file__).parents[2]
        result = subprocess.run([sys.executable, root / "examples/navigation/over_openigtlink.py",
                                 pairs_of(self.phantom), str(self.server.port)], capture_output=True, text=True,
                                timeout=100, env={**os.environ, "PYTHONPATH": str(root / "python")})
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("points of the surface moved by up to", result.stdout)

    def assert_still_serves(self):
        with self.server.client() as other:
            self.assertEqual(other.answer(other.request("info"))["status"], "ok")

    def assert_lost(self, client):
        with self.assertRaises((Lost, ConnectionError)):
            while True:
                client.receive(timeout=30)

    def test_bytes_that_are_no_messages_cost_the_connection_alone(self):
        header = struct.pack(">H12s20sQQQ", 1, b"IMAGE", b"fixed", 0, 1 << 60, 0)
        for bad in (b"GET / HTTP/1.0\r\n\r\n" + b" " * 60, header, pack("POINT", "targets", bytes(137)),
                    pack("STRING", "x", b"\0\3\0\5abcde")[:-1] + b"X"):
            with self.server.client() as client:
                client.socket.sendall(bad)
                self.assert_lost(client)
            self.assert_still_serves()

    def test_half_messages(self):
        with self.server.client() as client:
            client.socket.sendall(pack("POINT", "targets", pack_points({"a": (1, 2, 3)}))[:100])
            self.assert_still_serves()
        self.assert_still_serves()

    def test_a_half_closed_connection_gets_its_answer(self):
        with self.server.client() as client:
            number = client.request("info")
            client.socket.shutdown(socket.SHUT_WR)
            self.assertEqual(client.answer(number)["status"], "ok")

    def test_who_does_not_read_delays_nobody(self):
        self.send_labels()
        with self.server.client() as deaf:
            for _ in range(4):
                deaf.request("update", send=["field"], rounds=1, error_estimate=False)
            # Each of the four may take the place of one of these, whenever it arrives.
            answers = [self.client.update(rounds=1, error_estimate=False)["status"] for _ in range(8)]
            self.assertGreaterEqual(sum(status in ("ok", "doubted") for status in answers), 4, answers)

    def test_requests_that_are_none(self):
        for text in ("hello", '{"do": "fly"}', '{"do": "update", "rounds": -1}'):
            self.client.send("STRING", "request", pack_text(text))
            self.assertEqual(self.client.answer(0)["status"], "refused")

    def test_files_of_the_folder_alone(self):
        for name in ("../moving.nii.gz", "/etc/passwd", "none.nii.gz"):
            answer = self.client.answer(self.client.request("load", file=name, names=["fixed"]))
            self.assertEqual(answer["status"], "refused", name)
        (self.folder / "labels.nii.gz").write_bytes(self.phantom.fixed_labels.read_bytes())
        (self.folder / "pointer.mhd").write_text("ElementDataFile = /etc/passwd\n")
        answer = self.client.answer(self.client.request("load", file="pointer.mhd", names=["fixed"]))
        self.assertEqual(answer["status"], "refused")
        answer = self.client.answer(self.client.request("load", file="labels.nii.gz", names=["fixed_labels"]))
        self.assertEqual(answer["status"], "ok", answer)
        self.client.update(rounds=1)
        answer = self.client.answer(self.client.request("save", file="organ.vtp", names=["organ"]))
        self.assertEqual(answer["status"], "ok", answer)
        self.assertEqual(run("info", self.folder / "organ.vtp").returncode, 0)
        outside = self.client.answer(self.client.request("save", file="../organ.vtp", names=["organ"]))
        self.assertEqual(outside["status"], "refused")
        self.assertFalse((self.folder.parent / "organ.vtp").exists())


class Logs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = Phantom()
        cls.addClassCleanup(cls.phantom.temporary.cleanup)
        cls.patient = prepared(cls.phantom, moving=None)

    def newest_organ(self, client):
        while client.newest("organ") is None:
            client.receive()
        return client.newest("organ")

    def test_killed_it_goes_on_with_the_same_bits(self):
        log = self.phantom.folder / "session.log"
        server = Server(self.patient, "--log", log)
        moving, fixed = lps_pairs(self.phantom)
        with server.client() as client:
            client.send_points("moving_points", moving)
            client.send_points("fixed_points", fixed)
            first = client.update(points_sd_mm=0.5)
            organ = self.newest_organ(client)
            client.send_points("fixed_points", {name: (x + 1, y, z) for name, (x, y, z) in fixed.items()})
            client.request("update")
        server.stop(signal.SIGKILL)
        with log.open("ab") as file:
            file.write(b"M\0\0")  # as if it had been killed while it wrote
        server = Server(self.patient, "--log", log)
        with server.client() as client:
            self.newest_organ(client)
            client.send_points("fixed_points", fixed)
            self.assertIn("began", client.update(points_sd_mm=0.5))  # from the last one, or why not
            again = client.update(points_sd_mm=0.5, begin_anew=True)
            self.assertFalse(again["began"]["at_last"])
            self.assertEqual(again["digest"], first["digest"])
            self.assertEqual(client.newest("organ")["points"], organ["points"])
            self.assertGreater(again["state"], first["state"])
        self.assertEqual(server.stop(), (0, ""))
        replayed = run("serve", self.patient, "--replay", log, "--device", "cpu")
        self.assertEqual(replayed.returncode, 0, replayed.stderr)
        self.assertIn("0 with other bits", replayed.stdout)

    def test_it_says_that_it_does_not_stretch_lungs(self):
        for tissue, says in (("lung", True), ("liver", False)):
            server = Server(prepared(self.phantom, "--tissue", tissue, moving=None, name=f"{tissue}.tw"))
            server.stop()
            self.assertEqual(any("does not stretch" in line for line in server.said), says, server.said)

    def test_of_another_patient(self):
        log = self.phantom.folder / "other.log"
        log.write_bytes(b"tissuewarp server log 1 " + b"0" * 64 + b"\n")
        result = run("serve", self.patient, "--log", log, "--port", 0)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("no log of this patient", result.stderr)

    def test_a_port_that_is_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            result = run("serve", self.patient, "--port", taken.getsockname()[1])
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("port", result.stderr)

    def test_an_address_that_is_none(self):
        result = run("serve", self.patient, "--bind", "localhost.example", "--port", 0)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("127.0.0.1", result.stderr)


if __name__ == "__main__":
    unittest.main()
