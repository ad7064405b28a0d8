// The viewers of a page, and what they do. Each builds itself from its JSON when it comes near the window, so that a page
// of many opens at once. Nothing is fetched, and nothing is global.

const TAP = 4; // CSS pixels that a finger may slip and still tap

class Viewer extends Controls {
  constructor(root, palettes, number) {
    super(root, palettes, number);
    this.pointers = new Map();
    this.listen();
  }

  listen() {
    const { state, stage } = this;
    const on = (element, type, act) => element.addEventListener(type, act);
    on(this.modes, "change", (event) => this.set({ mode: event.target.value }));
    on(this.layer, "change", () => this.set({ layer: this.layer.value }));
    on(this.band, "change", () => this.set({ band: Number(this.band.value) }));
    this.pair.forEach((menu, i) => on(menu, "change", () => {
      state.pair[i] = Number(menu.value);
      this.set({ isFlipped: i === 1 && state.mode === "flip" });
    }));
    on(this.exposure, "input", () => this.set({ exposure: Number(this.exposure.value) }));
    on(this.seam, "input", () => this.slide(Number(this.seam.value)));
    on(stage, "keydown", (event) => this.key(event));
    on(stage, "wheel", (event) => this.wheel(event));
    on(stage, "pointerdown", (event) => this.press(event));
    on(stage, "pointermove", (event) => this.move(event));
    for (const type of ["pointerup", "pointercancel"]) on(stage, type, (event) => this.release(event));
    // A finger leaves its pixel to be read.
    on(stage, "pointerleave", (event) => event.pointerType === "mouse" && this.pointers.size === 0 && this.point(null));
    new ResizeObserver(() => this.draw()).observe(stage);
  }

  set(change) {
    Object.assign(this.state, change);
    this.refresh();
  }

  reset() {
    this.home();
    this.refresh();
  }

  toggle() {
    this.set({ mode: "flip", isFlipped: this.state.mode === "flip" && !this.state.isFlipped });
  }

  // Moves the seam, a part of the panel's width from its left.
  slide(seam) {
    this.state.seam = clamp(seam, 0, 1);
    this.seam.value = this.state.seam;
    this.seam.setAttribute("aria-valuetext", `${Math.round(100 * this.state.seam)} %`);
    this.draw();
  }

  // ---- Keys and wheel ----

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target !== this.stage) return;
    const { state, data } = this;
    const next = (list, item) => list[(list.indexOf(item) + 1) % list.length];
    const acts = {
      f: () => this.toggle(), " ": () => this.toggle(),
      l: () => this.set({ layer: next(this.layers, state.layer) }),
      n: () => this.set({ band: (state.band + 1) % Math.max(1, data.bands.length) }),
      b: () => this.set({ exposure: Math.min(REACH, state.exposure + 0.5) }),
      d: () => this.set({ exposure: Math.max(-REACH, state.exposure - 0.5) }),
      "+": () => this.zoom(2, true), "=": () => this.zoom(2, true), "-": () => this.zoom(0.5, true),
      0: () => this.reset(),
      arrowleft: () => this.arrow(-1, 0, event.shiftKey), arrowright: () => this.arrow(1, 0, event.shiftKey),
      arrowup: () => this.arrow(0, -1, event.shiftKey), arrowdown: () => this.arrow(0, 1, event.shiftKey),
      escape: () => this.point(null),
    };
    Object.keys(MODES).forEach((mode, i) => (acts[i + 1] = () => this.pictures.length > 1 && this.set({ mode })));
    const act = acts[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  }

  arrow(dx, dy, shift) {
    const { state, data } = this;
    if (state.mode === "split" && !shift) {
      this.slide(state.seam + 0.02 * dx);
      return;
    }
    const from = state.cursor ?? { x: Math.floor(state.x) - dx, y: Math.floor(state.y) - dy };
    const cursor = { x: clamp(from.x + dx, 0, data.width - 1), y: clamp(from.y + dy, 0, data.height - 1) };
    // The picture follows the pixel out of sight.
    const reach = { x: data.width / state.zoom / 2 - 0.5, y: data.height / state.zoom / 2 - 0.5 };
    for (const axis of ["x", "y"]) {
      const middle = cursor[axis] + 0.5;
      state[axis] = clamp(state[axis], middle - Math.max(0, reach[axis]), middle + Math.max(0, reach[axis]));
    }
    this.settle();
    this.point(cursor, true);
    this.draw();
  }

  wheel(event) {
    // The page scrolls over viewers that are not in use.
    if (!event.ctrlKey && document.activeElement !== this.stage) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : 1;
    this.zoom(2 ** clamp((-event.deltaY * lines) / 200, -1, 1), false, this.place(event));
  }

  // ---- Pointers ----

  press(event) {
    if (!event.target.closest("canvas")) return;
    try {
      event.target.setPointerCapture(event.pointerId);
    } catch {
      // A pointer that is gone already.
    }
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, slipped: 0 });
    if (this.pointers.size > 1) this.pointers.forEach((pointer) => (pointer.slipped = Infinity)); // no tap
    this.drag(event);
    this.read(event);
  }

  move(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (pointer) {
      const middle = () => {
        const all = [...this.pointers.values()];
        const mean = (f) => all.reduce((sum, p) => sum + f(p), 0) / all.length;
        const [x, y] = [mean((p) => p.x), mean((p) => p.y)];
        return { x, y, spread: mean((p) => Math.hypot(p.x - x, p.y - y)) };
      };
      const before = middle();
      pointer.slipped += Math.hypot(event.clientX - pointer.x, event.clientY - pointer.y);
      Object.assign(pointer, { x: event.clientX, y: event.clientY });
      const after = middle();
      if (before.spread > 0 && after.spread > 0) {
        const at = this.place({ target: event.target, clientX: before.x, clientY: before.y });
        this.zoom(after.spread / before.spread, false, at);
      }
      const isSeam = this.state.mode === "split" && this.pointers.size === 1 && !event.shiftKey;
      if (isSeam) this.drag(event);
      else this.pan(after.x - before.x, after.y - before.y);
    }
    this.read(event);
  }

  release(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (pointer && pointer.slipped < TAP && this.state.mode === "flip" && event.type === "pointerup") this.toggle();
  }

  drag(event) {
    if (this.state.mode !== "split" || this.pointers.size > 1 || event.shiftKey) return;
    const { width, columns } = this.data;
    const box = event.target.getBoundingClientRect();
    const tile = (this.place(event).x / width) * columns;
    this.slide(columns > 1 ? tile - Math.floor(tile) : (event.clientX - box.left) / box.width);
  }

  read(event) {
    const { width, height } = this.data;
    const at = this.place(event);
    const [x, y] = [Math.floor(at.x), Math.floor(at.y)];
    const isInside = event.target.closest("canvas") && x >= 0 && y >= 0 && x < width && y < height;
    this.point(isInside ? { x, y } : null);
  }

  // Reads a pixel out. Only what keys ask for is spoken: a mouse would never be quiet.
  point(cursor, byKey = false) {
    this.state.cursor = cursor;
    this.readout.setAttribute("aria-live", byKey ? "polite" : "off");
    this.draw();
  }
}

// What was asked of another cell's viewer: the same layer, exposure, and part of the picture.
function carry(from, to) {
  const [old, own] = [from.state, to.state];
  const kept = { mode: old.mode, exposure: old.exposure, seam: old.seam };
  if (to.layers.includes(old.layer)) kept.layer = old.layer;
  if (old.band < to.data.bands.length) kept.band = old.band;
  if (to.pictures.length === from.pictures.length) Object.assign(kept, { pair: [...old.pair], isFlipped: old.isFlipped });
  kept.x = (old.x / from.data.width) * to.data.width;
  kept.y = (old.y / from.data.height) * to.data.height;
  Object.assign(own, kept, { zoom: old.zoom, cursor: null });
  to.settle();
  return to.refresh();
}

const texts = JSON.parse(document.getElementById("viewer-palettes").textContent);
const palettes = { noise: colours(texts.noise), signed: colours(texts.signed) };
const roots = [...document.querySelectorAll(".viewer")];
const started = new Map(); // root -> promise of its viewer; none where it does not work

async function build(root) {
  try {
    if (typeof DecompressionStream === "undefined") throw new Error("this browser cannot unpack it (DecompressionStream)");
    const viewer = new Viewer(root, palettes, roots.indexOf(root));
    await viewer.refresh();
    return viewer;
  } catch (error) {
    const text = root.querySelector("noscript")?.textContent ?? "";
    root.replaceChildren(make("p", {}, `The viewer does not work here: ${error.message}. The pictures beside the page:`));
    root.insertAdjacentHTML("beforeend", text);
    return null;
  }
}

function start(root) {
  if (!started.has(root)) started.set(root, build(root));
  observer.unobserve(root);
  return started.get(root);
}

const observer = new IntersectionObserver((entries) => {
  for (const entry of entries.filter((entry) => entry.isIntersecting)) start(entry.target);
}, { rootMargin: "300px" });
roots.forEach((root) => observer.observe(root));
