"""A client of `tissuewarp serve` with Python's standard library alone: OpenIGTLink, version 1.

Coordinates are LPS mm; the wire's RAS stays in this file. See docs/manual/serve.md.

    with Client() as client:
        client.send_points("moving_points", {"vein": (-33.6, 18.7, 50.2)})
        client.send_points("fixed_points", {"vein": (-33.1, 19.0, 44.9)})
        answer = client.update(points_sd_mm=0.5)
        organ = client.newest("organ")
"""

import json
import socket
import struct
import time

try:
    import numpy
except ImportError:
    numpy = None

HEADER = struct.Struct(">H12s20sQQQ")
POINT = struct.Struct(">64s32s4B3ff20s")
IMAGE = struct.Struct(">HBBBB3H12f3H3H")
MOST_BYTES = 1 << 31
SCALARS = {"b": 2, "B": 3, "h": 4, "H": 5, "i": 6, "f": 10, "d": 11}  # codes of struct and of IMAGE
OK, DOUBTED = "ok", "doubted"


def _crc_table():
    table = []
    for byte in range(256):
        rest = byte << 56
        for _ in range(8):
            rest = (rest << 1) ^ (0x42F0E1EBA9EA3693 if rest >> 63 else 0)
            rest &= 0xFFFFFFFFFFFFFFFF
        table.append(rest)
    return table


_TABLE = _crc_table()


def crc64(data):
    """ECMA-182, most significant bit first, from 0. Images are long: with NumPy, where it is there, in lanes."""
    crc, at = _crc64_of_lanes(data) if numpy and len(data) > 1 << 20 else (0, 0)
    for byte in memoryview(data)[at:]:
        crc = ((crc << 8) & 0xFFFFFFFFFFFFFFFF) ^ _TABLE[(crc >> 56) ^ byte]
    return crc


def _crc64_of_lanes(data, lanes=4096):
    """Of the first bytes, and how many these are: lanes of equal length beside each other, each from 0. What comes
    before a lane is moved past it by a linear map, that of as many zeros."""
    length = len(data) // lanes
    table = numpy.array(_TABLE, numpy.uint64)
    shift, top = numpy.uint64(8), numpy.uint64(56)

    def run(crc, rows):
        for row in rows:
            crc = (crc << shift) ^ table[(crc >> top) ^ row]
        return crc

    rows = numpy.frombuffer(data, numpy.uint8, lanes * length).reshape(lanes, length).T
    parts = run(numpy.zeros(lanes, numpy.uint64), numpy.ascontiguousarray(rows))
    past = [int(v) for v in run(numpy.uint64(1) << numpy.arange(64, dtype=numpy.uint64), [0] * length)]
    crc = 0
    for part in parts:
        moved = int(part)
        for bit in range(64):
            if crc >> bit & 1:
                moved ^= past[bit]
        crc = moved
    return crc, lanes * length


def pack(kind, device, body, seconds=0):
    """Header and body of a message, of this time (s since 1970, or 0)."""
    return HEADER.pack(1, kind.encode(), device.encode()[:20], int(seconds * 2**32), len(body), crc64(body)) + body


def turned(place):
    """LPS to RAS and back."""
    return -place[0], -place[1], place[2]


def pack_text(text):
    data = text.encode()
    return struct.pack(">HH", 3, len(data)) + data


def pack_points(points):
    """Of a dictionary of names and places."""
    return b"".join(POINT.pack(name.encode()[:63], b"", 255, 255, 0, 255, *turned(place), 0, b"")
                    for name, place in points.items())


def pack_mesh(points, lines=(), triangles=()):
    """Lines and triangles are lists of numbers of points."""
    def cells(lists):
        return b"".join(struct.pack(f">{len(cell) + 1}I", len(cell), *cell) for cell in lists)
    line_bytes, triangle_bytes = cells(lines), cells(triangles)
    head = struct.pack(">10I", len(points), 0, 0, len(lines), len(line_bytes), len(triangles), len(triangle_bytes),
                       0, 0, 0)
    return head + b"".join(struct.pack(">3f", *turned(point)) for point in points) + line_bytes + triangle_bytes


def pack_image(voxels, kind, size, spacing, origin, axes=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    """`voxels`: bytes, little endian, first axis fastest, of the type that struct calls `kind`; `origin`: LPS mm of the
    first voxel; `axes`: unit vectors along i, j, k in LPS."""
    columns = [[spacing[a] * axes[a][c] for c in range(3)] for a in range(3)]
    middle = [origin[c] + sum(0.5 * (size[a] - 1) * columns[a][c] for a in range(3)) for c in range(3)]
    numbers = [value for column in (*columns, middle) for value in turned(column)]
    return IMAGE.pack(1, 1, SCALARS[kind], 2, 1, *size, *numbers, 0, 0, 0, *size) + voxels


def pack_transform(rotation, translation):
    """Rows of a rotation and a translation, moving → fixed, LPS mm."""
    sign = (-1, -1, 1)
    columns = [[sign[r] * rotation[r][c] * sign[c] for r in range(3)] for c in range(3)]
    return struct.pack(">12f", *[v for column in columns for v in column], *turned(translation))


def _text(data):
    return data.split(b"\0", 1)[0].decode(errors="replace")


def unpack_points(body):
    """Names, and (place, group) of each."""
    return {_text(entry[0]): (turned(entry[6:9]), _text(entry[1])) for entry in POINT.iter_unpack(body)}


def unpack_mesh(body):
    """{"points": [...], "triangles": [...], "arrays": {name: values}}"""
    head = struct.unpack_from(">10I", body)
    at = 40
    flat = struct.unpack_from(f">{3 * head[0]}f", body, at)
    points = [turned(flat[3 * n:3 * n + 3]) for n in range(head[0])]
    at += 12 * head[0] + head[2] + head[4]
    numbers = struct.unpack_from(f">{head[6] // 4}I", body, at)
    triangles, n = [], 0
    for _ in range(head[5]):
        triangles.append(numbers[n + 1:n + 1 + numbers[n]])
        n += 1 + numbers[n]
    at += head[6] + head[8]
    kinds = [struct.unpack_from(">BBI", body, at + 6 * k) for k in range(head[9])]
    at += 6 * head[9]
    begin, names = at, []
    for _ in kinds:
        end = body.index(b"\0", at)
        names.append(body[at:end].decode(errors="replace"))
        at = end + 1
    at += (at - begin) % 2
    arrays = {}
    for (_, components, count), name in zip(kinds, names):
        arrays[name] = struct.unpack_from(f">{components * count}f", body, at)
        at += 4 * components * count
    return {"points": points, "triangles": triangles, "arrays": arrays}


def unpack_image(body):
    """Voxels as bytes, and where they lie (LPS mm)."""
    (_, components, scalar, endian, _, *rest) = IMAGE.unpack_from(body)
    size, numbers = rest[:3], rest[3:15]
    columns = [turned(numbers[3 * n:3 * n + 3]) for n in range(4)]
    spacing = [sum(v * v for v in column) ** 0.5 for column in columns[:3]]
    origin = [columns[3][c] - sum(0.5 * (size[a] - 1) * columns[a][c] for a in range(3)) for c in range(3)]
    kind = next(k for k, code in SCALARS.items() if code == scalar)
    return {"size": size, "components": components, "kind": ("<" if endian == 2 else ">") + kind, "spacing": spacing,
            "origin": origin, "axes": [[v / spacing[a] for v in columns[a]] for a in range(3)],
            "voxels": body[IMAGE.size:]}


def unpack_status(body):
    code, _, name = struct.unpack_from(">HQ20s", body)
    return {"code": code, "name": _text(name), "text": _text(body[30:])}


def unpack(kind, body):
    """What a message says; bytes where its type is not known here."""
    if kind == "STRING":
        return body[4:4 + struct.unpack_from(">H", body, 2)[0]].decode(errors="replace")
    known = {"POINT": unpack_points, "POLYDATA": unpack_mesh, "IMAGE": unpack_image, "STATUS": unpack_status}
    return known[kind](body) if kind in known else body


class Lost(ConnectionError):
    """The server ended the connection."""


class Client:
    def __init__(self, host="127.0.0.1", port=18944, timeout=60):
        self.socket = socket.create_connection((host, port), timeout)
        self.timeout, self.sequence, self.buffer, self.seen = timeout, 0, bytearray(), {}

    def close(self):
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def send(self, kind, device, body):
        self.socket.sendall(pack(kind, device, body, time.time()))

    def send_points(self, device, points):
        self.send("POINT", device, pack_points(points))

    def send_surface(self, points, device="fixed_surface"):
        self.send("POLYDATA", device, pack_mesh(points))

    def send_touch(self, place, device="stylus"):
        """Where the tip of a tracked stylus is; a touch after the request "gather"."""
        self.send("TRANSFORM", device, pack_transform(((1, 0, 0), (0, 1, 0), (0, 0, 1)), place))

    def send_curves(self, device, lines):
        """Lists of places."""
        points = [place for line in lines for place in line]
        numbers, at = [], 0
        for line in lines:
            numbers.append(list(range(at, at + len(line))))
            at += len(line)
        self.send("POLYDATA", device, pack_mesh(points, numbers))

    def send_image(self, device, *image, **named):
        self.send("IMAGE", device, pack_image(*image, **named))

    def request(self, do, **more):
        """Sends a request and returns its number."""
        self.sequence += 1
        self.send("STRING", "request", pack_text(json.dumps({"do": do, "sequence": self.sequence, **more})))
        return self.sequence

    def receive(self, timeout=None):
        """The next message: type, device, content. Throws TimeoutError, after which it may be called again, and
        Lost."""
        end = time.monotonic() + (self.timeout if timeout is None else timeout)
        self._fill(HEADER.size, end)
        _, kind, device, stamp, count, crc = HEADER.unpack_from(self.buffer)
        if count > MOST_BYTES:
            raise Lost(f"a message of {count} bytes")
        self._fill(HEADER.size + count, end)
        body = bytes(memoryview(self.buffer)[HEADER.size:HEADER.size + count])
        del self.buffer[:HEADER.size + count]
        if crc64(body) != crc:
            raise Lost("the checksum of a message is not that of its bytes")
        kind, device = _text(kind), _text(device)
        content = unpack(kind, body)
        self.seen.pop((device, kind), None)
        self.seen[device, kind] = content, stamp / 2**32
        return kind, device, content

    def newest(self, device, kind=None):
        """What was last received from a device, or None."""
        return self._seen(device, kind)[0]

    def time_of(self, device, kind=None):
        """When the server had that, seconds since 1970: what is of one update has the "time" of its answer."""
        return self._seen(device, kind)[1]

    def _seen(self, device, kind):
        return next((seen for (name, of), seen in reversed(self.seen.items())
                     if name == device and kind in (None, of)), (None, None))

    def answer(self, sequence):
        """Receives until the server has answered this request."""
        while True:
            kind, _, content = self.receive()
            if kind == "STRING" and (answer := json.loads(content)).get("sequence") == sequence:
                return answer

    def update(self, **more):
        """An update of all that was sent, its answer; organ, targets and images are among what newest() gives."""
        answer = self.answer(self.request("update", **more))
        if answer["status"] in (OK, DOUBTED):
            wanted = {("organ", "POLYDATA"), *((name, "IMAGE") for name in more.get("send", ()))}
            while wanted:
                kind, device, _ = self.receive()
                wanted.discard((device, kind))
        return answer

    def _fill(self, count, end):
        while len(self.buffer) < count:
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutError("the server did not send in time")
            self.socket.settimeout(left)
            more = self.socket.recv(1 << 20)
            if not more:
                raise Lost("the server ended the connection")
            self.buffer += more
