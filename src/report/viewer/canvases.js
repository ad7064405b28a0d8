// A viewer's canvases: what is in view, and how it is painted.

const LARGEST = 64; // CSS pixels that a pixel of the picture may take, or more in a picture of few

class Canvases {
  constructor(root, palettes) {
    this.root = root;
    this.palettes = palettes;
    this.data = JSON.parse(root.querySelector("script").textContent);
    this.pictures = this.data.pictures.map((picture) => ({ ...picture, sheet: document.createElement("canvas") }));
    this.cache = new Map();
    this.isGrid = this.data.bands.length === 0;
    const pair = [0, Math.min(1, this.pictures.length - 1)];
    this.state = { mode: this.isGrid ? "split" : "side", layer: "image", band: 0, pair, isFlipped: false };
    this.home();
  }

  // The whole picture at the exposure of its file, the seam in the middle.
  home() {
    const { width, height } = this.data;
    Object.assign(this.state, { exposure: 0, zoom: 1, x: width / 2, y: height / 2, seam: 0.5, cursor: null });
  }

  // Indices of the pictures in view, one a panel; in split both share one.
  shown() {
    const { mode, pair, isFlipped } = this.state;
    if (this.pictures.length < 2) return [0];
    return mode === "side" ? this.pictures.map((_, i) => i) : mode === "flip" ? [pair[Number(isFlipped)]] : pair;
  }

  // The map of a picture in the layer in view, as base64; images have none.
  map(picture) {
    const { layer, band } = this.state;
    return layer === "noise" ? picture.noise[band] : picture[layer]?.maps[band];
  }

  // Where a picture has no map in the layer in view, its image is shown there.
  has(picture) {
    return this.map(picture) !== undefined;
  }

  load(text, decode) {
    if (!this.cache.has(text)) this.cache.set(text, decode(text));
    return this.cache.get(text);
  }

  // The picture, a pixel a pixel, on a sheet of its own.
  paint(picture) {
    const { width, height, stops } = this.data;
    const { band, exposure } = this.state;
    const layer = this.has(picture) ? this.state.layer : "image";
    const key = layer === "image" ? `image ${exposure}` : `${layer} ${band}`;
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
    } else {
      const palette = this.palettes[layer === "noise" ? "noise" : "signed"];
      for (let i = 0; i < width * height; i++) {
        const colour = palette[picture.indices[i]];
        pixels.set([colour >> 16, (colour >> 8) & 255, colour & 255, 255], 4 * i);
      }
    }
    picture.sheet.getContext("2d").putImageData(image, 0, 0);
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
      const sheet = (index) =>
        context.drawImage(this.pictures[index].sheet, left, top, data.width * scale, data.height * scale);
      if (state.mode === "split" && shown.length > 1) {
        // One seam in the view; in a grid one in every tile, which zoom and pan with it.
        const tile = data.columns > 1 ? { left, width: (data.width * scale) / data.columns } : { left: 0, width };
        const starts = Array.from({ length: data.columns }, (_, i) => tile.left + i * tile.width);
        const seams = starts.map((start) => Math.round(start + state.seam * tile.width));
        shown.forEach((index, half) => {
          context.save();
          context.beginPath();
          starts.forEach((start, i) => half === 0 ? context.rect(start, 0, seams[i] - start, height)
            : context.rect(seams[i], 0, start + tile.width - seams[i], height));
          context.clip();
          sheet(index);
          context.restore();
        });
        seams.forEach((seam) => this.line(context, seam, height, ratio));
      } else {
        sheet(shown[panel]);
      }
      if (state.cursor) this.frame(context, left + state.cursor.x * scale, top + state.cursor.y * scale, scale, ratio);
    });
    this.zoomed.textContent = `${Number((this.fit() * state.zoom).toPrecision(3))}×`;
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

  // ---- The view ----

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

  pan(dx, dy) {
    const scale = this.fit() * this.state.zoom;
    this.state.x -= dx / scale;
    this.state.y -= dy / scale;
    this.settle();
    this.draw();
  }
}
