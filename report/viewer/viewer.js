// Controls of the viewer: one state, drawn by all four views whenever it changes.
"use strict";

async function startViewer() {
  const get = (id) => document.getElementById(id), section = get("viewer");
  const scene = await unpackScene(JSON.parse(get("viewer-scene").textContent));
  const shown = (name) => Boolean(scene.images[name]);
  const state = { point: scene.focus.slice(), left: shown("fixed") ? "fixed" : "before", right: shown("after") ? "after" : "fixed",
                  swipe: 0.5, outlines: true, tint: false, colour: "displacement", cut: true, through: false, moved: 1 };
  if (!shown(state.left)) state.left = state.right;
  const planes = PLANES.map((plane) => new PlaneView(get(plane.name), plane, scene));
  let surface = null;
  try {
    if (scene.surface) surface = new SurfaceView(get("surface"), get("letters"), scene, planes);
  } catch (problem) {
    get("no-surface").textContent = `No three-dimensional view: this browser says "${problem.message}".`;
  }
  if (!surface) for (const element of section.querySelectorAll(".solid")) element.hidden = true;
  if (!scene.values) get("tint").parentNode.hidden = true;

  let waiting = false;
  const draw = () => {
    waiting = false;
    for (const plane of planes) plane.draw(state);
    if (surface) surface.draw(state);
    say();
  };
  const change = () => { if (!waiting) { waiting = true; requestAnimationFrame(draw); } };

  function say() {
    const sides = [["R", "L"], ["A", "P"], ["I", "S"]];
    const place = state.point.map((x, axis) => `${sides[axis][x < 0 ? 0 : 1]} ${Math.abs(x).toFixed(1)}`).join("  ");
    const at = scene.values ? scene.values.offset(state.point) : -1, own = scene.labels.offset(state.point), words = [`${place} mm`];
    const labelled = own >= 0 && (scene.labels.voxels[2][own] || scene.labels.voxels[0][own]);
    const tissue = labelled || (at >= 0 && scene.values.voxels[2][at]);
    if (at >= 0 && tissue) {
      const [displacement, error, trust] = scene.values.voxels;
      const mm = (byte, limit) => (byte / 255 * limit).toFixed(1);
      if (scene.displaced) words.push(`moved ${mm(displacement[at], scene.displacement_mm)} mm`);
      if (trust[at]) words.push(`estimated error ${mm(error[at], scene.error_mm)} mm`,
                                ["", "shown by data", "carried by mechanics", "do not trust"][Math.round(trust[at] / 80)]);
    } else words.push("outside the tissue");
    get("readout").textContent = words.join(" · ");
    for (const plane of PLANES) get(`at-${plane.name}`).value = state.point[plane.normal];
    for (const button of section.querySelectorAll("button[data-side]"))
      button.setAttribute("aria-pressed", state[button.dataset.side] === button.dataset.image);
    for (const [name, limit] of [["displacement", scene.displacement_mm], ["error", scene.error_mm]])
      if (name === state.colour) get("bar-end").textContent = `${limit.toFixed(1)} mm`;
    get("moved-percent").textContent = `${Math.round(100 * state.moved)} %`;
  }

  const clamped = (axis, x) => {
    const { origin, spacing, size } = scene.labels;
    return Math.min(Math.max(x, origin[axis]), origin[axis] + spacing * (size[axis] - 1));
  };
  const moveTo = (point) => { state.point = point.map((x, axis) => clamped(axis, x)); change(); };

  for (const view of planes) {
    const { canvas, plane } = view, pixel = (event) => {
      const box = canvas.getBoundingClientRect(), scale = canvas.width / box.width;
      return [((event.clientX - box.left) * scale - view.left) / view.zoom, ((event.clientY - box.top) * scale - view.top) / view.zoom];
    };
    let dragging = null;
    canvas.addEventListener("pointerdown", (event) => {
      const near = Math.abs(pixel(event)[0] - state.swipe * view.columns) * view.zoom < 12 * view.unit;
      dragging = near && state.left !== state.right ? "line" : "cross";
      canvas.setPointerCapture(event.pointerId);
      follow(event);
    });
    const follow = (event) => {
      const [column, row] = pixel(event);
      if (dragging === "line") { state.swipe = Math.min(Math.max(column / view.columns, 0), 1); change(); }
      if (dragging === "cross") {
        const point = view.point(column - 0.5, row - 0.5, 0);
        point[plane.normal] = state.point[plane.normal];
        moveTo(point);
      }
    };
    canvas.addEventListener("pointermove", follow);
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { dragging = null; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      moveTo(state.point.map((x, axis) => x + (axis === plane.normal ? -Math.sign(event.deltaY) * scene.labels.spacing : 0)));
    }, { passive: false });
    const slider = get(`at-${plane.name}`), axis = plane.normal;
    slider.min = scene.labels.origin[axis]; slider.step = "any";
    slider.max = scene.labels.origin[axis] + scene.labels.spacing * (scene.labels.size[axis] - 1);
    slider.addEventListener("input", () => moveTo(state.point.map((x, k) => (k === axis ? Number(slider.value) : x))));
  }

  for (const button of section.querySelectorAll("button[data-side]")) {
    button.disabled = !shown(button.dataset.image);
    button.addEventListener("click", () => { state[button.dataset.side] = button.dataset.image; change(); });
  }
  for (const name of ["outlines", "tint", "cut", "through"])
    get(name).addEventListener("change", (event) => { state[name] = event.target.checked; change(); });
  get("colour").addEventListener("change", (event) => { state.colour = event.target.value; change(); });
  get("moved").addEventListener("input", (event) => { state.moved = event.target.value / 100; change(); });
  if (!scene.least_known) { get("least-known").hidden = true; get("colour").parentNode.hidden = true; }
  const visit = (point) => { if (surface) surface.face(point); moveTo(point); };
  get("least-known").addEventListener("click", () => visit(scene.least_known));
  get("moved-most").hidden = !scene.moved_most;
  get("moved-most").addEventListener("click", () => visit(scene.focus));
  if (surface) {
    const { canvas } = surface;
    let last = null;
    canvas.addEventListener("pointerdown", (event) => { last = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      surface.azimuth -= (event.clientX - last[0]) * 0.01;
      surface.height = Math.min(Math.max(surface.height + (event.clientY - last[1]) * 0.01, -1.57), 1.57);
      last = [event.clientX, event.clientY];
      change();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { last = null; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      surface.zoom = Math.min(Math.max(surface.zoom * Math.exp(-event.deltaY * 0.001), 0.5), 8);
      change();
    }, { passive: false });
    get("through").parentNode.hidden = scene.surface.outer * 3 >= scene.surface.triangles.length;
  }
  const ramp = Array.from({ length: 9 }, (_, k) => `rgb(${viridis(k / 8).map(Math.round).join(",")})`).join(",");
  get("bar").style.background = `linear-gradient(to right, ${ramp})`;
  addEventListener("resize", change);
  draw();
  section.dataset.ready = surface ? "solid" : "flat";
}
startViewer().catch((problem) => { document.getElementById("readout").textContent = `The viewer failed: ${problem.message}`; });
