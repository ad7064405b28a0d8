"use strict";
// The viewers of a page. Each builds itself from its JSON when it comes near the window, so that a page of many opens
// at once. Nothing is fetched, and nothing is global.
(() => {
  const LAYERS = { image: "Image", noise: "Noise", difference: "Difference", z: "z-score of the difference" };
  const MODES = { side: "Side by side", flip: "Flip", split: "Split" };
  const REACH = 10; // stops by which the exposure can be moved either way
  const LARGEST = 64; // CSS pixels that a pixel of the picture may take, or more in a picture of few
  const TAP = 4; // CSS pixels that a finger may slip and still tap
  let viewers = 0;

  // ---- Data ----

  // The bytes of a PNG of one or three channels whose rows have no filter. They do not go through a canvas: some
  // browsers blur what is read back from one, against fingerprinting.
  async function plane(base64) {
    const file = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const view = new DataView(file.buffer);
    const data = [];
    for (let at = 8; at < file.length; at += 12 + view.getUint32(at)) {
      if (view.getUint32(at + 4) === 0x49444154) data.push(file.subarray(at + 8, at + 8 + view.getUint32(at))); // IDAT
    }
    const stream = new Blob(data).stream().pipeThrough(new DecompressionStream("deflate"));
    const rows = new Uint8Array(await new Response(stream).arrayBuffer());
    const [width, height, channels] = [view.getUint32(16), view.getUint32(20), file[25] === 0 ? 1 : 3];
    const length = width * channels;
    const bytes = new Uint8Array(length * height);
    for (let row = 0; row < height; row++) {
      bytes.set(rows.subarray(row * (length + 1) + 1, (row + 1) * (length + 1)), row * length);
    }
    return { bytes, channels };
  }

  // Linear values as the upper halves of their 32-bit floats: the upper rows hold their first bytes.
  async function linear(base64) {
    const { bytes, channels } = await plane(base64);
    const half = bytes.length / 2;
    const codes = new Uint16Array(half);
    for (let i = 0; i < half; i++) codes[i] = (bytes[i] << 8) | bytes[half + i];
    return { codes, channels };
  }

  const word = new Uint32Array(1);
  const float = new Float32Array(word.buffer);
  function value(code) {
    word[0] = code << 16;
    return float[0];
  }

  // What every code shows as: exposed, clipped to [0, 1], through the sRGB transfer, as `results::image` does it.
  // A table, since there are fewer codes than values in a picture.
  function tones(gain) {
    const table = new Uint8Array(65536);
    for (let code = 0; code <= 0x7f80; code++) {
      const x = Math.min(1, value(code) * gain);
      table[code] = Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
    }
    return table; // negative and not a number: 0
  }

  function colours(text) {
    return text.match(/.{6}/g).map((digits) => parseInt(digits, 16));
  }

  // ---- Words ----

  const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
  const signed = (x) => (x < 0 ? "−" : "+") + Math.abs(x);
  const percent = (x) => `${Number((100 * x).toPrecision(2))} %`;
  const number = (x) => (Number.isFinite(x) ? x.toPrecision(3).replace("-", "−") : String(x));

  function make(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  }

  function select(names) {
    return make("select", {}, ...Object.entries(names).map(([value, name]) => make("option", { value }, name)));
  }

  class Viewer {
    constructor(root, palettes) {
      this.root = root;
      this.palettes = palettes;
      this.data = JSON.parse(root.querySelector("script").textContent);
      this.id = `viewer-${++viewers}`;
      this.pictures = this.data.pictures.map((picture) => ({ ...picture, sheet: document.createElement("canvas") }));
      this.pointers = new Map();
      this.cache = new Map();
      this.state = { mode: "side", layer: "image", band: 0, pair: [0, Math.min(1, this.pictures.length - 1)], isFlipped: false };
      this.home();
      this.build();
      this.listen();
    }

    // The whole picture at the exposure of its file, the seam in the middle.
    home() {
      const { width, height } = this.data;
      Object.assign(this.state, { exposure: 0, zoom: 1, x: width / 2, y: height / 2, seam: 0.5, cursor: null });
    }

    // ---- The parts of the page ----

    build() {
      const { data, pictures } = this;
      const names = Object.fromEntries(pictures.map((picture, i) => [i, picture.name]));
      const modes = Object.entries(MODES).map(([value, name]) => {
        const input = make("input", { type: "radio", name: `${this.id}-mode`, value });
        return make("label", { class: "viewer-choice" }, input, name);
      });
      this.modes = make("fieldset", { "aria-label": "Arrangement" }, ...modes);
      this.layer = select(LAYERS);
      this.band = select(Object.fromEntries(data.bands.map((name, i) => [i, name])));
      this.pair = [select(names), select(names)];
      this.exposure = make("input", { type: "range", min: -REACH, max: REACH, step: 0.25 });
      this.stops = make("output");
      this.zoomed = make("output");
      const button = (label, text, act) => {
        const element = make("button", { type: "button", "aria-label": label, title: label }, text);
        element.addEventListener("click", act);
        return element;
      };
      const zoom = make("span", { class: "viewer-zoom" },
        button("Zoom out", "−", () => this.zoom(0.5)), button("Zoom in", "+", () => this.zoom(2)), this.zoomed,
        button("Reset zoom, exposure and seam", "Reset", () => this.reset()));
      this.flip = button("Show the other picture", "Flip", () => this.toggle());
      const labelled = (text, ...parts) => make("label", {}, text, ...parts);
      this.bandLabel = labelled("Band", this.band);
      this.pairLabels = [labelled("A", this.pair[0]), labelled("B", this.pair[1])];
      this.exposureLabel = labelled("Exposure", this.exposure, this.stops);
      this.exposureLabel.className = "viewer-exposure";
      this.keys = make("p", { id: `${this.id}-keys` });
      this.stage = make("div", { class: "viewer-stage", tabindex: 0, role: "application",
        "aria-roledescription": "picture viewer", "aria-describedby": this.keys.id });
      this.seam = make("input", { type: "range", min: 0, max: 1, step: 0.001 });
      this.seamLabel = make("label", { class: "viewer-seam" }, "Seam", this.seam);
      this.readout = make("div", { class: "viewer-readout", role: "status" });
      this.scale = make("div", { class: "viewer-scale" });
      this.notes = make("div", { class: "viewer-notes" });
      this.root.append(
        make("div", { class: "viewer-bar" }, this.modes, labelled("Layer", this.layer), this.bandLabel),
        make("div", { class: "viewer-bar" }, ...this.pairLabels, this.flip, this.exposureLabel, zoom),
        this.stage, this.seamLabel, this.scale, this.readout, this.notes,
        make("details", {}, make("summary", {}, "Keys and fingers"), this.keys));
      this.root.style.setProperty("--ratio", data.width / data.height);
      if (pictures.length < 2) this.modes.hidden = true;
      this.describeKeys();
    }

    describeKeys() {
      const keys = [["1 2 3", "side by side, flip, split"], ["F", "flip"], ["L", "next layer"], ["N", "next band"],
        ["B D", "brighter, darker by half a stop"], ["+ −", "zoom"], ["0", "reset"],
        ["Arrows", "move the pixel that is read out; in split the seam, with Shift the pixel"]];
      const parts = keys.flatMap(([key, what]) => [...key.split(" ").flatMap((k) => [make("kbd", {}, k), " "]), `${what}; `]);
      this.keys.append("With the pictures in focus: ", ...parts, "wheel to zoom (with Ctrl at any time). Drag to pan, in split to " +
        "move the seam, with Shift to pan. Two fingers zoom and pan; a tap flips.");
    }

    // ---- What happens ----

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
      on(stage, "pointerleave", () => this.pointers.size === 0 && this.point(null));
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

    key(event) {
      if (event.ctrlKey || event.altKey || event.metaKey || event.target !== this.stage) return;
      const { state, data } = this;
      const next = (list, item) => list[(list.indexOf(item) + 1) % list.length];
      const acts = {
        f: () => this.toggle(), " ": () => this.toggle(),
        l: () => this.set({ layer: next(Object.keys(LAYERS), state.layer) }),
        n: () => this.set({ band: (state.band + 1) % data.bands.length }),
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

    // Zooms by a factor; `at` in pixels of the picture stays where it is.
    zoom(factor, atCursor = false, at = null) {
      const { state } = this;
      const cursor = atCursor && state.cursor ? { x: state.cursor.x + 0.5, y: state.cursor.y + 0.5 } : null;
      const fixed = at ?? cursor ?? { x: state.x, y: state.y };
      const before = state.zoom;
      state.zoom = clamp(before * factor, 1, Math.max(8, LARGEST / this.fit()));
      for (const axis of ["x", "y"]) state[axis] = fixed[axis] + ((state[axis] - fixed[axis]) * before) / state.zoom;
      this.settle();
      this.draw();
    }

    // No edge of the picture comes into the view.
    settle() {
      const { state, data } = this;
      const [x, y] = [data.width / state.zoom / 2, data.height / state.zoom / 2];
      state.x = clamp(state.x, x, data.width - x);
      state.y = clamp(state.y, y, data.height - y);
    }

    wheel(event) {
      // The page scrolls over viewers that are not in use.
      if (!event.ctrlKey && document.activeElement !== this.stage) return;
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : 1;
      this.zoom(2 ** clamp((-event.deltaY * lines) / 200, -1, 1), false, this.place(event));
    }

    // ---- Pointers ----

    // CSS pixels that a pixel of the picture takes, unzoomed.
    fit() {
      const canvas = this.stage.querySelector("canvas");
      return canvas && canvas.clientWidth > 0 ? canvas.clientWidth / this.data.width : 1;
    }

    // Where a pointer is, in pixels of the picture; it may be on any panel.
    place(event) {
      const canvas = event.target.closest("canvas") ?? this.stage.querySelector("canvas");
      const box = canvas.getBoundingClientRect();
      const scale = this.fit() * this.state.zoom;
      return { x: this.state.x + (event.clientX - box.left - box.width / 2) / scale,
        y: this.state.y + (event.clientY - box.top - box.height / 2) / scale };
    }

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
      const box = event.target.getBoundingClientRect();
      this.slide((event.clientX - box.left) / box.width);
    }

    pan(dx, dy) {
      const scale = this.fit() * this.state.zoom;
      this.state.x -= dx / scale;
      this.state.y -= dy / scale;
      this.settle();
      this.draw();
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

    // ---- Drawing ----

    // Indices of the pictures in view, one a panel; in split both share one.
    shown() {
      const { mode, pair, isFlipped } = this.state;
      if (this.pictures.length < 2) return [0];
      return mode === "side" ? this.pictures.map((_, i) => i) : mode === "flip" ? [pair[Number(isFlipped)]] : pair;
    }

    // The map of a picture in the layer in view, as base64.
    map(picture) {
      const { layer, band } = this.state;
      return layer === "noise" ? picture.noise[band] : picture[layer]?.maps[band];
    }

    load(text, decode) {
      if (!this.cache.has(text)) this.cache.set(text, decode(text));
      return this.cache.get(text);
    }

    // Decodes what is in view, paints it, and says what it is.
    async refresh() {
      const ticket = (this.ticket = {});
      this.arrange();
      for (const picture of new Set(this.shown().map((i) => this.pictures[i]))) {
        picture.values = await this.load(picture.linear, linear);
        const map = this.state.layer === "image" ? null : this.map(picture);
        const indices = map ? await this.load(map, plane) : null;
        if (ticket !== this.ticket) return; // something else was asked for meanwhile
        picture.indices = indices?.bytes ?? null;
        this.paint(picture);
      }
      this.caption();
      this.draw();
      this.root.dataset.drawn = "true";
    }

    // The picture, a pixel a pixel, on a sheet of its own.
    paint(picture) {
      const { width, height, stops } = this.data;
      const { layer, exposure } = this.state;
      const key = `${layer} ${this.state.band} ${exposure}`;
      if (picture.painted === key) return;
      picture.painted = key;
      Object.assign(picture.sheet, { width, height });
      const image = new ImageData(width, height);
      const pixels = image.data;
      Object.assign(picture, { bright: 0, outside: 0 });
      if (layer === "image") {
        const gain = 2 ** (stops + exposure);
        if (this.tone?.gain !== gain) this.tone = { gain, table: tones(gain) };
        const { codes, channels } = picture.values;
        for (let i = 0; i < width * height; i++) {
          let [bright, outside] = [false, false];
          for (let c = 0; c < 3; c++) {
            const code = codes[i * channels + (channels === 3 ? c : 0)];
            pixels[4 * i + c] = this.tone.table[code];
            bright ||= value(code) * gain > 1;
            outside ||= code >= 0x7f80 && code !== 0x8000;
          }
          pixels[4 * i + 3] = 255;
          picture.bright += bright;
          picture.outside += outside;
        }
      } else if (picture.indices) {
        const palette = this.palettes[layer === "noise" ? "noise" : "signed"];
        for (let i = 0; i < width * height; i++) {
          const colour = palette[picture.indices[i]];
          pixels.set([colour >> 16, (colour >> 8) & 255, colour & 255, 255], 4 * i);
        }
      }
      picture.sheet.getContext("2d").putImageData(image, 0, 0);
    }

    // Panels and controls as the state has them.
    arrange() {
      const { state, stage, data } = this;
      const isSide = state.mode === "side" || this.pictures.length < 2;
      const count = isSide ? this.pictures.length : 1;
      while (stage.children.length > count) stage.lastChild.remove();
      while (stage.children.length < count) {
        stage.append(make("figure", {}, make("canvas", { role: "img" }), make("figcaption")));
      }
      stage.className = `viewer-stage ${count === 1 ? "one" : ""} ${isSide ? "side" : state.mode}`;
      this.modes.querySelectorAll("input").forEach((input) => (input.checked = input.value === state.mode));
      this.layer.value = state.layer;
      this.band.value = state.band;
      this.pair.forEach((menu, i) => (menu.value = state.pair[i]));
      this.exposure.value = state.exposure;
      const stops = Number((data.stops + state.exposure).toFixed(2));
      this.stops.textContent = `${signed(stops)} stops`;
      this.exposure.setAttribute("aria-valuetext", this.stops.textContent);
      this.slide(state.seam);
      this.exposureLabel.hidden = state.layer !== "image";
      this.bandLabel.hidden = state.layer === "image" || data.bands.length < 2;
      this.pairLabels.forEach((label) => (label.hidden = isSide));
      this.flip.hidden = isSide || state.mode !== "flip";
      this.seamLabel.hidden = isSide || state.mode !== "split";
    }

    caption() {
      const { state, stage } = this;
      const words = (picture) => {
        const { layer } = state;
        let about = picture.about;
        if (layer === "image") {
          if (picture.bright > 0) about += `; pixels too bright: ${picture.bright}`;
          if (picture.outside > 0) about += `; outside the gamut or not finite: ${picture.outside}`;
        } else if (layer !== "noise") {
          about = picture[layer] ? `compared with ${picture[layer].of}` : `no map: ${picture.alone}`;
        }
        return about;
      };
      const shown = this.shown().map((i) => this.pictures[i]);
      const figures = [...stage.children];
      figures.forEach((figure, panel) => {
        const here = figures.length === 1 ? shown : [shown[panel]];
        const side = state.mode === "split" ? ["Left: ", "Right: "] : state.mode === "flip" && here.length === 1
          ? [state.isFlipped ? "B: " : "A: "] : ["", ""];
        figure.lastChild.replaceChildren(...here.map((picture, i) =>
          make("span", {}, side[i], make("b", {}, picture.name), make("br"), words(picture))));
        figure.firstChild.setAttribute("aria-label", figure.lastChild.innerText);
      });
      stage.setAttribute("aria-label", `${LAYERS[state.layer]}: ${shown.map((picture) => picture.name).join(", ")}`);
      this.explain(shown);
    }

    // The colour bar and what there is to say of it.
    explain(shown) {
      const { data } = this;
      const { layer, band } = this.state;
      this.scale.hidden = layer === "image";
      const said = [];
      if (layer !== "image") {
        const palette = this.palettes[layer === "noise" ? "noise" : "signed"].slice(1);
        const stops = palette.filter((_, i) => i % 2 === 0).map((c) => `#${c.toString(16).padStart(6, "0")}`);
        const limit = layer === "z" ? data.z_limit : data.limit;
        const text = layer === "z" ? (x) => (x === 0 ? "0" : signed(x)) : (x) => (x === 0 ? "0" : (x < 0 ? "−" : "+") + percent(Math.abs(x)));
        const [low, high] = data.noise_range;
        const ticks = layer === "noise" ? [0, 1, 2, 3].map((i) => percent(low * (high / low) ** (i / 3)))
          : [-1, -0.5, 0, 0.5, 1].map((part) => text(part * limit));
        [ticks[0], ticks[ticks.length - 1]] = [`≤ ${ticks[0]}`, `≥ ${ticks[ticks.length - 1]}`];
        const bar = make("div", { style: `background: linear-gradient(to right, ${stops.join(",")})` });
        this.scale.replaceChildren(bar, make("div", { class: "viewer-ticks" }, ...ticks.map((tick) => make("span", {}, tick))));
        said.push({
          noise: "Standard error of a pixel over its mean. Grey: both are 0.",
          difference: "Difference from the other estimator's pixel, over that pixel. Grey: both are 0.",
          z: "Difference from the other estimator's pixel over the standard error of that difference, both sides' noise " +
            "added in squares. Grey: no standard error on either side.",
        }[layer] + (data.bands.length > 0 ? ` Band ${data.bands[band]}.` : "") + (data.bands_note ? ` ${data.bands_note}` : ""));
        for (const picture of new Set(shown)) {
          const note = picture[layer]?.notes?.[band]?.trim();
          if (note) said.push(`${picture.name}: ${note}`);
        }
      }
      this.notes.replaceChildren(...said.map((text) => make("p", {}, text)));
    }

    // Puts the painted sheets on the panels at the view's place and size.
    draw() {
      const { state, data, stage } = this;
      const shown = this.shown();
      const canvases = [...stage.querySelectorAll("canvas")];
      const ratio = window.devicePixelRatio || 1;
      canvases.forEach((canvas, panel) => {
        const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((length) => Math.round(length * ratio));
        if (width === 0 || height === 0) return;
        if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
        canvas.style.touchAction = state.zoom > 1 ? "none" : "pan-y";
        const scale = (width / data.width) * state.zoom;
        const [left, top] = [width / 2 - state.x * scale, height / 2 - state.y * scale];
        const context = canvas.getContext("2d");
        context.clearRect(0, 0, width, height);
        context.imageSmoothingEnabled = scale < 1; // a pixel is a square
        const sheet = (index) => context.drawImage(this.pictures[index].sheet, left, top, data.width * scale, data.height * scale);
        if (state.mode === "split" && shown.length > 1) {
          const seam = Math.round(state.seam * width);
          [[0, seam], [seam, width - seam]].forEach(([from, length], half) => {
            context.save();
            context.beginPath();
            context.rect(from, 0, length, height);
            context.clip();
            sheet(shown[half]);
            context.restore();
          });
          this.line(context, seam, height, ratio);
        } else {
          sheet(shown[panel]);
        }
        if (state.cursor) this.frame(context, left + state.cursor.x * scale, top + state.cursor.y * scale, scale, ratio);
      });
      this.zoomed.textContent = `${Number((this.fit() * state.zoom).toPrecision(2))}×`;
      this.zoomed.title = "CSS pixels a pixel";
      this.tell();
    }

    // Black beside white is seen on any picture.
    line(context, x, height, ratio) {
      context.fillStyle = "#000";
      context.fillRect(x - ratio, 0, ratio, height);
      context.fillStyle = "#fff";
      context.fillRect(x, 0, ratio, height);
    }

    frame(context, x, y, size, ratio) {
      const least = Math.max(size, 5 * ratio);
      const [left, top] = [x + size / 2 - least / 2, y + size / 2 - least / 2];
      [["#000", 3], ["#fff", 1]].forEach(([colour, width]) => {
        context.strokeStyle = colour;
        context.lineWidth = width * ratio;
        context.strokeRect(left - ratio, top - ratio, least + 2 * ratio, least + 2 * ratio);
      });
    }

    tell() {
      const { cursor, layer } = this.state;
      const { width } = this.data;
      if (!cursor) {
        this.readout.textContent = "Point at a pixel to read its values.";
        return;
      }
      const at = cursor.y * width + cursor.x;
      const rows = [...new Set(this.shown())].map((index) => {
        const picture = this.pictures[index];
        const { codes, channels } = picture.values ?? {};
        if (!codes) return "";
        const values = [0, 1, 2].map((c) => number(value(codes[at * channels + (channels === 3 ? c : 0)])));
        const cells = channels === 3 ? `R ${values[0]}  G ${values[1]}  B ${values[2]}` : values[0];
        const map = layer === "image" || !picture.indices ? "" : this.mapped(picture.indices[at]);
        return make("tr", {}, make("th", { scope: "row" }, picture.name), make("td", {}, cells), make("td", {}, map));
      });
      const place = make("div", {}, `Pixel x ${cursor.x}, y ${cursor.y}; linear sRGB:`);
      this.readout.replaceChildren(place, make("table", {}, ...rows));
    }

    // The value that an index into a palette stands for.
    mapped(index) {
      const { data } = this;
      if (index === 0) return "no value";
      const isEnd = index === 255 || index === 1;
      const side = isEnd ? (index === 255 ? "≥ " : "≤ ") : "≈ ";
      if (this.state.layer === "noise") {
        const [low, high] = data.noise_range;
        return `noise ${side}${percent(low * (high / low) ** ((index - 1) / 254))}`;
      }
      const part = (index - 128) / 127;
      return this.state.layer === "z" ? `z ${side}${number(part * data.z_limit)}`
        : `difference ${side}${part < 0 ? "−" : "+"}${percent(Math.abs(part * data.limit))}`;
    }
  }

  // ---- The page ----

  async function start(root, palettes) {
    try {
      if (typeof DecompressionStream === "undefined") throw new Error("this browser cannot unpack it (DecompressionStream)");
      await new Viewer(root, palettes).refresh();
    } catch (error) {
      const text = root.querySelector("noscript").textContent;
      root.replaceChildren(make("p", {}, `The viewer does not work here: ${error.message}. The pictures beside the page:`));
      root.insertAdjacentHTML("beforeend", text);
    }
  }

  const texts = JSON.parse(document.getElementById("viewer-palettes").textContent);
  const palettes = { noise: colours(texts.noise), signed: colours(texts.signed) };
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((entry) => entry.isIntersecting)) {
      observer.unobserve(entry.target);
      start(entry.target, palettes);
    }
  }, { rootMargin: "300px" });
  document.querySelectorAll(".viewer").forEach((root) => observer.observe(root));
})();
