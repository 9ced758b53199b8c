// The organ's surface in three dimensions, by WebGL 2: coloured, cut open where the planes are, moving from where it lay.
"use strict";

const COMMON = `#version 300 es
precision highp float;
uniform vec3 middle, right, up, viewer, cut, side;
uniform float scale, cutting;
vec4 placed(vec3 p) {
  vec3 q = p - middle;
  return vec4(dot(right, q) * scale, dot(up, q) * scale, -dot(viewer, q) * scale * 0.5, 1.0);
}
bool removed(vec3 p) { return cutting > 0.5 && all(greaterThan((p - cut) * side, vec3(0.0))); }
`;
const SURFACE_VERTEX = COMMON + `
in vec3 before, after, normal;
in float value, trust;
uniform float moved;
out vec3 place, across;
out float shade, level;
void main() {
  place = mix(before, after, moved); across = normal; shade = value; level = trust;
  gl_Position = placed(place);
}`;
const SURFACE_FRAGMENT = COMMON + `
in vec3 place, across;
in float shade, level;
uniform sampler2D colours;
uniform float opacity, stripes, pixel;
out vec4 result;
void main() {
  if (removed(place)) discard;
  vec3 n = normalize(across) * (gl_FrontFacing ? 1.0 : -1.0);
  vec3 light = normalize(viewer + 0.35 * up - 0.3 * right);
  vec3 colour = texture(colours, vec2(shade * 0.996 + 0.002, 0.5)).rgb;
  if (stripes > 0.5 && level > 2.5 && mod(gl_FragCoord.x + gl_FragCoord.y, 9.0 * pixel) < 3.0 * pixel) colour *= 0.25;
  float lit = max(dot(n, light), 0.0);
  colour = colour * (0.38 + 0.7 * lit) + 0.12 * pow(lit, 24.0);
  result = vec4(gl_FrontFacing ? colour : colour * 0.55, 1.0) * opacity;
}`;
const SLICE_VERTEX = COMMON + `
in vec3 corner;
in vec2 pixel;
out vec3 place;
out vec2 at;
void main() { place = corner; at = pixel; gl_Position = placed(corner); }`;
const SLICE_FRAGMENT = COMMON + `
in vec3 place;
in vec2 at;
uniform sampler2D picture;
uniform vec3 within;
out vec4 result;
void main() {
  vec4 colour = texture(picture, at);
  if (colour.a < 0.5 || any(lessThan((place - cut) * side * within, vec3(0.0)))) discard;
  result = vec4(colour.rgb, 1.0);
}`;

function program(gl, vertex, fragment) {
  const result = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(result, shader);
  }
  gl.linkProgram(result);
  if (!gl.getProgramParameter(result, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(result));
  return result;
}

class SurfaceView {
  constructor(canvas, letters, scene, planes) {
    Object.assign(this, { canvas, letters, scene, planes });
    const gl = this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("no WebGL 2");
    this.surfaceProgram = program(gl, SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.sliceProgram = program(gl, SLICE_VERTEX, SLICE_FRAGMENT);
    const { surface } = scene, points = surface.after;
    this.middle = [0, 1, 2].map((axis) => {
      let low = Infinity, high = -Infinity;
      for (let k = axis; k < points.length; k += 3) { low = Math.min(low, points[k]); high = Math.max(high, points[k]); }
      return (low + high) / 2;
    });
    this.reach = 0;
    for (let k = 0; k < points.length; k += 3)
      this.reach = Math.max(this.reach, Math.hypot(...[0, 1, 2].map((axis) => points[k + axis] - this.middle[axis])));
    this.zoom = 1;
    this.face(scene.focus);
    this.makeSurface(gl, surface);
    this.makeSlices(gl);
  }
  /// Turns a place to the viewer, somewhat from the side.
  face(point) {
    const [x, y, z] = point.map((value, axis) => (value - this.middle[axis]) / this.reach);
    this.azimuth = Math.atan2(x, -y) + 0.3;
    this.height = Math.min(Math.max(Math.asin(Math.min(Math.max(z, -1), 1)), -0.9), 0.9);
  }
  buffer(gl, shader, name, values, size, kind, normalised) {
    const place = gl.getAttribLocation(shader, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, kind, normalised, 0, 0);
  }
  makeSurface(gl, surface) {
    this.arrays = {};
    for (const name of ["displacement", "error"]) {
      this.arrays[name] = gl.createVertexArray();
      gl.bindVertexArray(this.arrays[name]);
      for (const vectors of ["before", "after"]) this.buffer(gl, this.surfaceProgram, vectors, surface[vectors], 3, gl.FLOAT, false);
      this.buffer(gl, this.surfaceProgram, "normal", surface.normals, 3, gl.FLOAT, false);
      this.buffer(gl, this.surfaceProgram, "value", surface[name], 1, gl.UNSIGNED_BYTE, true);
      this.buffer(gl, this.surfaceProgram, "trust", surface.trust, 1, gl.UNSIGNED_BYTE, false);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, surface.triangles, gl.STATIC_DRAW);
    }
    this.colours = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.colours);
    const ramp = new Uint8Array(Array.from({ length: 256 }, (_, k) => [...viridis(k / 255), 255]).flat());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, ramp);
    this.smooth(gl);
  }
  smooth(gl) {
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, key, gl.LINEAR);
    for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, key, gl.CLAMP_TO_EDGE);
  }
  makeSlices(gl) {
    this.slices = this.planes.map((view) => {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      this.buffer(gl, this.sliceProgram, "pixel", new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), 2, gl.FLOAT, false);
      const corners = gl.createBuffer(), place = gl.getAttribLocation(this.sliceProgram, "corner");
      gl.bindBuffer(gl.ARRAY_BUFFER, corners);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      this.smooth(gl);
      return { view, array, corners, texture };
    });
  }
  /// Where the picture is looked at from: unit vectors in LPS.
  axes() {
    const [s, c, h, w] = [Math.sin(this.azimuth), Math.cos(this.azimuth), Math.sin(this.height), Math.cos(this.height)];
    return { right: [c, s, 0], up: [-s * h, c * h, w], viewer: [s * w, -c * w, h] };
  }
  draw(state) {
    const gl = this.gl, ratio = devicePixelRatio || 1, size = Math.round(this.canvas.clientWidth * ratio);
    if (this.canvas.width !== size || this.canvas.height !== size) this.canvas.width = this.canvas.height = size;
    const axes = this.axes(), cutting = state.cut && state.moved > 0.999;
    gl.viewport(0, 0, size, size);
    gl.clearColor(0.063, 0.07, 0.078, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const common = (shader) => {
      gl.useProgram(shader);
      const set = (name, value) => gl.uniform3fv(gl.getUniformLocation(shader, name), value);
      set("middle", this.middle); set("right", axes.right); set("up", axes.up); set("viewer", axes.viewer);
      set("cut", state.point); set("side", axes.viewer.map((v) => (v < 0 ? -1 : 1)));
      gl.uniform1f(gl.getUniformLocation(shader, "scale"), 0.92 * this.zoom / this.reach);
      gl.uniform1f(gl.getUniformLocation(shader, "cutting"), cutting ? 1 : 0);
    };
    if (cutting) this.drawSlices(gl, state, common);
    this.drawSurface(gl, state, common, ratio);
    this.write(axes);
  }
  drawSurface(gl, state, common, ratio) {
    const { surface } = this.scene, set = (name, value) => gl.uniform1f(gl.getUniformLocation(this.surfaceProgram, name), value);
    common(this.surfaceProgram);
    gl.bindVertexArray(this.arrays[state.colour]);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.colours);
    set("moved", state.moved); set("stripes", state.colour === "error" ? 1 : 0); set("pixel", ratio);
    const part = (opacity, from, to) => {
      set("opacity", opacity);
      gl.drawElements(gl.TRIANGLES, 3 * (to - from), gl.UNSIGNED_SHORT, 6 * from);
    };
    part(1, surface.outer, surface.triangles.length / 3);
    if (!state.through) return part(1, 0, surface.outer);
    gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA); gl.depthMask(false); gl.enable(gl.CULL_FACE);
    part(0.3, 0, surface.outer);
    gl.disable(gl.CULL_FACE); gl.depthMask(true); gl.disable(gl.BLEND);
  }
  drawSlices(gl, state, common) {
    common(this.sliceProgram);
    for (const { view, array, corners, texture } of this.slices) {
      gl.bindVertexArray(array);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, view.columns, view.rows, 0, gl.RGBA, gl.UNSIGNED_BYTE, organPixels(view, state));
      const [left, right, top, bottom] = [-0.5, view.columns - 0.5, -0.5, view.rows - 0.5], slice = view.slice(state.point);
      const points = [[left, top], [right, top], [left, bottom], [right, bottom]].map(([c, r]) => view.point(c, r, slice));
      for (const point of points) point[view.plane.normal] = state.point[view.plane.normal];
      gl.bindBuffer(gl.ARRAY_BUFFER, corners);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.STREAM_DRAW);
      const within = [1, 1, 1];
      within[view.plane.normal] = 0;
      gl.uniform3fv(gl.getUniformLocation(this.sliceProgram, "within"), within);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
  }
  /// Letters of the patient's sides about the organ.
  write(axes) {
    for (const span of this.letters.children) {
      const axis = "LPS".indexOf(span.textContent), way = axis < 0 ? -1 : 1;
      const k = axis < 0 ? "RAI".indexOf(span.textContent) : axis, depth = axes.viewer[k] * way;
      span.style.left = `${50 + 46 * way * axes.right[k]}%`;
      span.style.top = `${50 - 46 * way * axes.up[k]}%`;
      span.style.opacity = Math.abs(depth) > 0.92 ? 0 : depth < -0.3 ? 0.45 : 1;
    }
  }
}

/// A plane of the right-hand image, see-through outside the organ.
function organPixels(view, state) {
  const { images, labels } = view.scene, image = images[state.right] || images[state.left], slice = view.slice(state.point);
  const rgba = new Uint8Array(4 * view.columns * view.rows), [fixed, , warped] = labels.voxels;
  for (let row = 0, to = 0; row < view.rows; ++row)
    for (let column = 0, at = view.first + row * view.stepDown + slice * view.stepNormal; column < view.columns;
         ++column, at += view.stepRight, to += 4) {
      rgba[to] = rgba[to + 1] = rgba[to + 2] = image ? image.voxels[0][at] : 90;
      rgba[to + 3] = warped[at] || fixed[at] ? 255 : 0;
    }
  return rgba;
}
