// What the page holds of images, labels, values and surface, unpacked into arrays; nothing is fetched.
"use strict";

// Viridis (van der Walt, Smith) at nine places, as the picture above has it.
const VIRIDIS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129],
                 [92, 200, 99], [170, 220, 50], [253, 231, 37]];

/// Colour of a part from 0 to 1: [red, green, blue] to 255.
function viridis(part) {
  const at = Math.min(Math.max(part, 0), 1) * (VIRIDIS.length - 1), low = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[low].map((value, c) => value + (VIRIDIS[low + 1][c] - value) * (at - low));
}

/// A volume on a grid along LPS: voxels[c] are bytes of a channel, index i + nx (j + ny k).
class BrickVolume {
  constructor(grid, voxels) {
    this.size = grid.size; this.origin = grid.origin; this.spacing = grid.spacing; this.voxels = voxels;
  }
  /// Offset of the voxel nearest to a point in LPS mm, or -1 outside.
  offset(point) {
    let at = 0;
    for (let axis = 2; axis >= 0; --axis) {
      const index = Math.round((point[axis] - this.origin[axis]) / this.spacing);
      if (index < 0 || index >= this.size[axis]) return -1;
      at = at * this.size[axis] + index;
    }
    return at;
  }
}

/// Bytes of the first `channels` colours of a picture of tiles.
async function unpack(url, grid, channels) {
  const picture = new Image();
  picture.src = url;
  await picture.decode();
  const canvas = document.createElement("canvas");
  canvas.width = picture.width; canvas.height = picture.height;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0);
  const rgba = context.getImageData(0, 0, picture.width, picture.height).data, [nx, ny, nz] = grid.size;
  const voxels = Array.from({ length: channels }, () => new Uint8Array(nx * ny * nz));
  for (let k = 0, at = 0; k < nz; ++k) {
    const left = k % grid.columns * nx, top = Math.floor(k / grid.columns) * ny;
    for (let j = 0; j < ny; ++j)
      for (let i = 0, from = 4 * ((top + j) * picture.width + left); i < nx; ++i, ++at, from += 4)
        for (let c = 0; c < channels; ++c) voxels[c][at] = rgba[from + c];
  }
  return new BrickVolume(grid, voxels);
}

/// Area-weighted normals of the nodes where they are now.
function normals(positions, triangles) {
  const sums = new Float32Array(positions.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((corner) => 3 * triangles[t + corner]), u = [0, 0, 0], v = [0, 0, 0];
    for (let axis = 0; axis < 3; ++axis) {
      u[axis] = positions[b + axis] - positions[a + axis];
      v[axis] = positions[c + axis] - positions[a + axis];
    }
    for (let axis = 0; axis < 3; ++axis) {
      const p = (axis + 1) % 3, q = (axis + 2) % 3, normal = u[p] * v[q] - u[q] * v[p];
      for (const corner of [a, b, c]) sums[corner + axis] += normal;
    }
  }
  return sums;
}

function unpackSurface(surface) {
  const text = atob(surface.data.split(",")[1]), bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
  const view = new DataView(bytes.buffer), nodes = surface.nodes;
  const positions = (start) => Float32Array.from({ length: 3 * nodes }, (_, k) =>
    surface.lower[k % 3] + surface.extent[k % 3] * view.getUint16(start + 2 * k, true) / 65535);
  const triangles = Uint16Array.from({ length: 3 * surface.triangles },
                                     (_, k) => view.getUint16(12 * nodes + 2 * k, true));
  const values = 12 * nodes + 6 * surface.triangles, part = (n) => bytes.slice(values + n * nodes, values + (n + 1) * nodes);
  const after = positions(6 * nodes);
  return { before: positions(0), after, triangles, outer: surface.outer, normals: normals(after, triangles),
           displacement: part(0), error: part(1), trust: part(2) };
}

/// images: what can be shown, by name; labels: channels fixed, before, after; values: displacement, error, trust.
async function unpackScene(json) {
  const scene = { ...json, images: {} };
  for (const name of ["fixed", "before", "after"])
    if (json[name]) scene.images[name] = await unpack(json[name], json.grid, 1);
  scene.labels = await unpack(json.labels, json.grid, 3);
  scene.values = json.values ? await unpack(json.values.picture, json.values.grid, 3) : null;
  scene.displaced = json.values?.displacement_mm !== undefined;
  scene.surface = json.surface ? unpackSurface(json.surface) : null;
  return scene;
}
