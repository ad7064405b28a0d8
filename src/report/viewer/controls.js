// A viewer's controls, and its texts.

const LAYERS = { image: "Image", noise: "Noise", difference: "Difference", z: "z-score of the difference" };
const ABOUT = {
  noise: "Standard error of a pixel over its mean. Grey: both are 0.",
  difference: "Difference from the other estimator's pixel, over that pixel. Grey: both are 0.",
  z: "Difference from the other estimator's pixel over the standard error of that difference, both sides' noise added in " +
    "squares. Grey: no standard error on either side, or passes too skewed to judge.",
};
const MODES = { side: "Side by side", flip: "Flip", split: "Split" };
const REACH = 10; // stops by which the exposure can be moved either way

class Controls extends Canvases {
  // The number tells the viewers of a page apart.
  constructor(root, palettes, number) {
    super(root, palettes);
    this.id = `viewer-${number}`;
    this.build();
  }

  build() {
    const { data, pictures } = this;
    const names = Object.fromEntries(pictures.map((picture, i) => [i, picture.name]));
    const modes = Object.entries(MODES).map(([value, name]) => {
      const input = make("input", { type: "radio", name: `${this.id}-mode`, value });
      return make("label", { class: "viewer-choice" }, input, name);
    });
    this.modes = make("fieldset", { "aria-label": "Arrangement" }, ...modes);
    // A picture alone differs from nothing.
    const isPair = pictures.length > 1 && !this.isGrid;
    const has = { image: true, noise: !this.isGrid, difference: isPair, z: isPair };
    const layers = Object.entries(LAYERS).filter(([layer]) => has[layer]);
    this.layers = layers.map(([layer]) => layer);
    this.layer = select(Object.fromEntries(layers));
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
    this.layerLabel = labelled("Layer", this.layer);
    this.layerLabel.hidden = layers.length < 2;
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
      make("div", { class: "viewer-bar" }, this.modes, this.layerLabel, this.bandLabel),
      make("div", { class: "viewer-bar" }, ...this.pairLabels, this.flip, this.exposureLabel, zoom),
      make("div", { class: "viewer-body" }, make("div", { class: "viewer-panels" }, this.stage, this.seamLabel),
        make("div", { class: "viewer-words" }, this.scale, this.readout, this.notes)),
      make("details", {}, make("summary", {}, "Keys and fingers"), this.keys));
    this.root.style.setProperty("--ratio", data.width / data.height);
    this.root.style.setProperty("--count", pictures.length);
    if (pictures.length < 2) this.modes.hidden = true;
    this.describeKeys();
  }

  describeKeys() {
    const keys = [["1 2 3", "side by side, flip, split"], ["F", "flip"], ["L", "next layer"], ["N", "next band"],
      ["B D", "brighter, darker by half a stop"], ["+ −", "zoom"], ["0", "reset"],
      ["Arrows", "move the pixel that is read out; in split the seam, with Shift the pixel"]];
    const parts = keys.flatMap(([key, what]) => [...key.split(" ").flatMap((k) => [make("kbd", {}, k), " "]), `${what}; `]);
    this.keys.append("With the pictures in focus: ", ...parts, "wheel to zoom (with Ctrl at any time). Drag to pan, in " +
      "split to move the seam, with Shift to pan. Two fingers zoom and pan; a tap flips.");
  }

  // Decodes, paints and describes the layer in view.
  async refresh() {
    const ticket = (this.ticket = {});
    this.stage.setAttribute("aria-busy", "true");
    this.arrange();
    for (const picture of new Set(this.shown().map((i) => this.pictures[i]))) {
      picture.values = await this.load(picture.linear, linear);
      const map = this.map(picture);
      const indices = map ? await this.load(map, plane) : null;
      if (ticket !== this.ticket) return; // something else was asked for meanwhile
      picture.indices = indices?.bytes ?? null;
      this.paint(picture);
    }
    this.caption();
    this.draw();
    this.stage.setAttribute("aria-busy", "false");
    this.root.dataset.drawn = "true";
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
    this.exposureLabel.hidden = this.shown().every((i) => this.has(this.pictures[i]));
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
        const isBasis = this.pictures.some((other) => other[layer]?.of === picture.name);
        const why = isBasis ? "others are compared with it" : `no map: ${picture.alone}`;
        about = picture[layer] ? `compared with ${picture[layer].of}` : `its image; ${why}`;
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

  // The colour bar and its description.
  explain(shown) {
    const { data } = this;
    const { layer, band } = this.state;
    this.scale.hidden = layer === "image";
    this.notes.replaceChildren();
    if (layer === "image") return;
    const palette = this.palettes[layer === "noise" ? "noise" : "signed"].slice(1);
    const stops = palette.filter((_, i) => i % 2 === 0).map((colour) => `#${colour.toString(16).padStart(6, "0")}`);
    const ticks = this.ticks(layer);
    this.scale.replaceChildren(
      make("div", { style: `background: linear-gradient(to right, ${stops.join(",")})` }),
      make("div", { class: "viewer-ticks" }, ...ticks.map((tick, i) =>
        make("span", { style: `left: ${(100 * i) / (ticks.length - 1)}%` }, tick))));
    this.notes.append(make("p", {}, `${ABOUT[layer]} Band ${data.bands[band]}. ${data.bands_note}`));
    for (const picture of new Set(shown)) {
      const note = picture[layer]?.notes?.[band]?.trim();
      if (note) this.notes.append(make("p", {}, `${picture.name}: ${note}`));
    }
  }

  // Labels at equal steps of the colour bar.
  ticks(layer) {
    const { limit, z_limit: zLimit, noise_range: [low, high] } = this.data;
    const words = {
      noise: () => [0, 1, 2, 3].map((i) => percent(low * (high / low) ** (i / 3))),
      difference: () => [`−${percent(limit)}`, "0", `+${percent(limit)}`],
      z: () => [-1, -0.5, 0, 0.5, 1].map((part) => (part === 0 ? "0" : signed(part * zLimit))),
    }[layer]();
    return words.map((word, i) => (i === 0 ? `≤ ${word}` : i === words.length - 1 ? `≥ ${word}` : word));
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
      const map = !picture.indices ? "" : this.mapped(picture.indices[at]);
      return make("tr", {}, make("th", { scope: "row" }, picture.name), make("td", {}, cells), make("td", {}, map));
    });
    const place = make("div", {}, `Pixel x ${cursor.x}, y ${cursor.y}; linear sRGB${this.isGrid ? " over white" : ""}:`);
    this.readout.replaceChildren(place, make("table", {}, ...rows));
  }

  // The value of an index into a palette.
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
    return this.state.layer === "z" ? `z ${side}${(part * data.z_limit).toFixed(2).replace("-", "−")}`
      : `difference ${side}${part < 0 ? "−" : "+"}${percent(Math.abs(part * data.limit))}`;
  }
}
