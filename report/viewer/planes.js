// The three planes: images side by side at a line that is drawn across, outlines, colours, crosshair.
"use strict";

// Axes of LPS to the right and downwards, as radiologists look: the patient's right, or front, is on the left.
const PLANES = [
  { name: "axial", normal: 2, right: 0, down: 1, flip: 1, letters: ["R", "L", "A", "P"], colour: "#ff6b5e" },
  { name: "coronal", normal: 1, right: 0, down: 2, flip: -1, letters: ["R", "L", "S", "I"], colour: "#5fd07c" },
  { name: "sagittal", normal: 0, right: 1, down: 2, flip: -1, letters: ["A", "P", "S", "I"], colour: "#ffd75e" },
];
const OUTLINES = { fixed: { channel: 0, colour: "#4be06a", width: 2 },
                   before: { channel: 1, colour: "#ff5a4d", width: 1.5 },
                   after: { channel: 2, colour: "#ff5a4d", width: 1.5 } };
const TAGS = { fixed: "intraoperative", before: "preoperative, as it lay", after: "preoperative, warped" };

class PlaneView {
  constructor(canvas, plane, scene) {
    Object.assign(this, { canvas, plane, scene });
    const grid = scene.labels;
    this.columns = grid.size[plane.right]; this.rows = grid.size[plane.down];
    this.pixels = document.createElement("canvas");
    this.pixels.width = this.columns; this.pixels.height = this.rows;
    const step = [1, grid.size[0], grid.size[0] * grid.size[1]];
    this.stepRight = step[plane.right]; this.stepDown = plane.flip * step[plane.down]; this.stepNormal = step[plane.normal];
    this.first = plane.flip < 0 ? (this.rows - 1) * step[plane.down] : 0;
    this.onFixed = grid.voxels[0].some(Boolean) ? ["fixed"] : ["after"];  // the organ where nobody drew it
    this.longest = Math.max(...grid.size) * grid.spacing;
  }
  slice(point) {
    const { labels } = this.scene, n = this.plane.normal;
    return Math.min(Math.max(Math.round((point[n] - labels.origin[n]) / labels.spacing), 0), labels.size[n] - 1);
  }
  /// LPS mm of a pixel of the plane, or of one between.
  point(column, row, slice) {
    const { labels } = this.scene, { right, down, normal, flip } = this.plane, p = [0, 0, 0];
    p[right] = labels.origin[right] + labels.spacing * column;
    p[down] = labels.origin[down] + labels.spacing * (flip < 0 ? this.rows - 1 - row : row);
    p[normal] = labels.origin[normal] + labels.spacing * slice;
    return p;
  }
  /// Pixel of the plane of a point.
  pixel(point) {
    const { labels } = this.scene, { right, down, flip } = this.plane;
    const at = (axis) => (point[axis] - labels.origin[axis]) / labels.spacing;
    return [at(right), flip < 0 ? this.rows - 1 - at(down) : at(down)];
  }
  /// Grey values left and right of the line, coloured where asked for.
  paint(state) {
    const slice = this.slice(state.point), { images } = this.scene, context = this.pixels.getContext("2d");
    const picture = context.createImageData(this.columns, this.rows), rgba = picture.data;
    const left = images[state.left], right = images[state.right], line = state.swipe * this.columns;
    for (let row = 0, to = 0; row < this.rows; ++row)
      for (let column = 0, at = this.first + row * this.stepDown + slice * this.stepNormal; column < this.columns;
           ++column, at += this.stepRight, to += 4) {
        const image = column < line ? left : right, grey = image ? image.voxels[0][at] : 24;
        rgba[to] = rgba[to + 1] = rgba[to + 2] = grey;
        rgba[to + 3] = 255;
      }
    if (state.tint) this.tint(rgba, state, slice);
    context.putImageData(picture, 0, 0);
  }
  /// Half the colour of displacement or estimated error, in tissue; what is not to be trusted is striped.
  tint(rgba, state, slice) {
    const { values, labels } = this.scene, channel = state.colour === "error" ? 1 : 0, tissue = labels.voxels[2];
    if (!values) return;
    for (let row = 0, to = 0; row < this.rows; ++row)
      for (let column = 0, own = this.first + row * this.stepDown + slice * this.stepNormal; column < this.columns;
           ++column, own += this.stepRight, to += 4) {
        const at = values.offset(this.point(column, row, slice));
        if (at < 0 || !tissue[own] || (channel === 1 && !values.voxels[2][at])) continue;
        const colour = viridis(values.voxels[channel][at] / 255);
        const striped = channel === 1 && values.voxels[2][at] > 200 && (column + row) % 6 < 2;
        for (let c = 0; c < 3; ++c) rgba[to + c] = striped ? 0.2 * rgba[to + c] : 0.45 * rgba[to + c] + 0.55 * colour[c];
      }
  }
  layout() {
    const scale = devicePixelRatio || 1, width = Math.round(this.canvas.clientWidth * scale);
    if (this.canvas.width !== width || this.canvas.height !== width) this.canvas.width = this.canvas.height = width;
    this.zoom = 0.96 * width * this.scene.labels.spacing / this.longest;
    this.left = (width - this.columns * this.zoom) / 2; this.top = (width - this.rows * this.zoom) / 2;
    this.unit = scale;
  }
  draw(state) {
    this.layout();
    this.paint(state);
    const context = this.canvas.getContext("2d"), { width } = this.canvas;
    context.fillStyle = "#101214";
    context.fillRect(0, 0, width, width);
    context.imageSmoothingQuality = "high";
    context.drawImage(this.pixels, this.left, this.top, this.columns * this.zoom, this.rows * this.zoom);
    if (state.outlines) this.outlines(context, state);
    this.cross(context, state);
    if (state.left !== state.right) this.line(context, state);
    this.words(context, state);
  }
  outlines(context, state) {
    const line = this.left + state.swipe * this.columns * this.zoom, { width } = this.canvas;
    const sides = state.left === state.right ? [[state.left, 0, width]] : [[state.left, 0, line], [state.right, line, width]];
    for (const [name, from, to] of sides)
      for (const shown of name === "fixed" ? this.onFixed : ["fixed", name]) {
        const style = OUTLINES[shown];
        context.save();
        context.beginPath(); context.rect(from, 0, to - from, width); context.clip();
        context.beginPath();
        this.contours(context, this.scene.labels.voxels[style.channel], this.slice(state.point));
        context.strokeStyle = style.colour; context.lineWidth = style.width * this.unit; context.stroke();
        context.restore();
      }
  }
  /// Marching squares at the half of each label's smoothed indicator.
  contours(context, labels, slice) {
    const { columns, rows } = this, own = new Uint8Array(columns * rows), present = new Set();
    for (let row = 0; row < rows; ++row)
      for (let column = 0, at = this.first + row * this.stepDown + slice * this.stepNormal; column < columns;
           ++column, at += this.stepRight) present.add(own[row * columns + column] = labels[at]);
    present.delete(0);
    const level = new Float32Array(columns * rows);
    for (const label of present) {
      level.fill(0);
      for (let row = 1; row < rows - 1; ++row)
        for (let column = 1, at = row * columns + 1; column < columns - 1; ++column, ++at) {
          let sum = 0;
          for (const down of [-columns, 0, columns])
            sum += (own[at + down - 1] === label) + (own[at + down] === label) * 2 + (own[at + down + 1] === label);
          level[at] = sum / 12 - 0.5;
        }
      this.march(context, level);
    }
  }
  march(context, level) {
    const { columns, rows } = this;
    const x = (column) => this.left + (column + 0.5) * this.zoom, y = (row) => this.top + (row + 0.5) * this.zoom;
    for (let row = 0; row < rows - 1; ++row)
      for (let column = 0, at = row * columns; column < columns - 1; ++column, ++at) {
        const a = level[at], b = level[at + 1], c = level[at + columns + 1], d = level[at + columns], cuts = [];
        if (a > 0 !== b > 0) cuts.push([x(column + a / (a - b)), y(row)]);
        if (b > 0 !== c > 0) cuts.push([x(column + 1), y(row + b / (b - c))]);
        if (d > 0 !== c > 0) cuts.push([x(column + d / (d - c)), y(row + 1)]);
        if (a > 0 !== d > 0) cuts.push([x(column), y(row + a / (a - d))]);
        for (let k = 0; k + 1 < cuts.length; k += 2) { context.moveTo(...cuts[k]); context.lineTo(...cuts[k + 1]); }
      }
  }
  cross(context, state) {
    const [column, row] = this.pixel(state.point), { width } = this.canvas, gap = 9 * this.unit;
    const x = this.left + (column + 0.5) * this.zoom, y = this.top + (row + 0.5) * this.zoom;
    const colour = (axis) => PLANES.find((plane) => plane.normal === axis).colour;
    context.lineWidth = this.unit; context.globalAlpha = 0.75;
    for (const [axis, lines] of [[this.plane.right, [[x, 0, x, y - gap], [x, y + gap, x, width]]],
                                 [this.plane.down, [[0, y, x - gap, y], [x + gap, y, width, y]]]]) {
      context.strokeStyle = colour(axis);
      context.beginPath();
      for (const [x1, y1, x2, y2] of lines) { context.moveTo(x1, y1); context.lineTo(x2, y2); }
      context.stroke();
    }
    context.globalAlpha = 1;
  }
  line(context, state) {
    const x = this.left + state.swipe * this.columns * this.zoom, { width } = this.canvas, handle = 7 * this.unit;
    const y = width - 40 * this.unit;
    context.strokeStyle = context.fillStyle = "#ffffff"; context.lineWidth = 1.5 * this.unit;
    context.beginPath(); context.moveTo(x, 0); context.lineTo(x, width); context.stroke();
    context.beginPath();
    for (const way of [-1, 1]) {
      context.moveTo(x + way * handle * 2, y); context.lineTo(x + way * 4 * this.unit, y - handle);
      context.lineTo(x + way * 4 * this.unit, y + handle);
    }
    context.fill();
  }
  words(context, state) {
    const { width } = this.canvas, size = 12.5 * this.unit, edge = 7 * this.unit, [right, left, top, bottom] = this.plane.letters;
    const write = (text, x, y, align, colour) => {
      context.font = `${size}px system-ui, "DejaVu Sans", Arial, sans-serif`;
      context.textAlign = align; context.textBaseline = "middle";
      context.lineWidth = 3.5 * this.unit; context.strokeStyle = "#101214"; context.fillStyle = colour;
      context.lineJoin = "round"; context.strokeText(text, x, y); context.fillText(text, x, y);
    };
    write(right, edge, width / 2, "left", "#e8eaec"); write(left, width - edge, width / 2, "right", "#e8eaec");
    const line = this.left + state.swipe * this.columns * this.zoom;  // letters stay clear of it
    const middle = Math.abs(line - width / 2) < size ? line - size : width / 2;
    write(top, middle, edge + size / 2, "center", "#e8eaec");
    write(bottom, middle, width - edge - size / 2, "center", "#e8eaec");
    const n = this.plane.normal;
    write(`${this.plane.name}  ${"xyz"[n]} = ${state.point[n].toFixed(1)} mm`, edge, edge + size / 2, "left", this.plane.colour);
    if (this.plane.normal !== 2) return;
    write(TAGS[state.left], edge, width - edge - size / 2, "left", "#ffffff");
    if (state.left !== state.right) write(TAGS[state.right], width - edge, width - edge - size / 2, "right", "#ffffff");
  }
}
