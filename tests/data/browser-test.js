"use strict";
// Runs at the end of a copy of a report, as a reader's hand would: real events, and what the canvases then show. `TEST`
// holds what the test knows of the record by other ways. The outcome goes to the console as one line of JSON.
(async () => {
  const failures = [];
  let checks = 0;
  const check = (holds, what, detail = "") => {
    checks++;
    if (!holds && failures.length < 40) failures.push(`${what} ${typeof detail === "string" ? detail : JSON.stringify(detail)}`);
  };
  const say = (outcome) => console.log("BROWSER-TEST " + JSON.stringify(outcome));
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const settle = async () => {
    await wait(20);
    for (let i = 0; i < 500 && document.querySelector("[aria-busy=true]"); i++) await wait(5);
    await wait(20);
  };
  const drawn = async (root) => {
    const section = root.closest(".viewer-cell");
    if (section?.hidden) {
      const index = [...section.parentElement.querySelectorAll(".viewer-cell")].indexOf(section);
      const menu = document.querySelector(".viewer-choose select");
      menu.value = index;
      menu.dispatchEvent(new Event("change", { bubbles: true }));
      await wait(20);
    }
    root.scrollIntoView({ block: "center" });
    for (let i = 0; i < 200 && !root.dataset.drawn; i++) await wait(10);
    if (!root.dataset.drawn) throw new Error("a viewer was not drawn within two seconds");
    await settle();
  };
  const roots = [...document.querySelectorAll(".viewer")];

  // ---- A viewer's parts ----

  const parts = (root) => ({
    root,
    stage: root.querySelector(".viewer-stage"),
    canvases: () => [...root.querySelectorAll(".viewer-stage canvas")],
    mode: (name) => root.querySelector(`input[value=${name}]`),
    menu: (label) => [...root.querySelectorAll("label")].find((l) => l.firstChild.data === label).querySelector("select"),
    exposure: root.querySelector(".viewer-exposure input"),
    seam: root.querySelector(".viewer-seam input"),
    readout: () => root.querySelector(".viewer-readout").textContent,
    notes: () => root.querySelector(".viewer-notes").textContent,
    caption: () => root.querySelector("figcaption").textContent,
    zoom: () => parseFloat(root.querySelector(".viewer-zoom output").textContent),
    button: (label) => root.querySelector(`button[aria-label^="${label}"]`),
  });
  const key = async (viewer, name, more = {}) => {
    viewer.stage.focus();
    viewer.stage.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true, ...more }));
    await settle();
  };
  const pointer = (canvas, type, u, v, more = {}) => {
    const box = canvas.getBoundingClientRect();
    const at = { clientX: box.left + u * box.width, clientY: box.top + v * box.height };
    canvas.dispatchEvent(new PointerEvent(type, { bubbles: true, cancelable: true, pointerId: 1, ...at, ...more }));
  };
  const choose = async (menu, value) => {
    menu.value = value;
    menu.dispatchEvent(new Event("change", { bubbles: true }));
    await settle();
  };
  const slide = async (input, value) => {
    input.value = value;
    input.dispatchEvent(new Event("input", { bubbles: true }));
    await settle();
  };
  const leave = async (viewer) => {
    viewer.stage.dispatchEvent(new PointerEvent("pointerleave", { pointerId: 1, pointerType: "mouse" }));
    await settle();
  };
  const pixels = (canvas) => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const at = (image, x, y) => [...image.data.slice(4 * (y * image.width + x), 4 * (y * image.width + x) + 3)];
  const near = (a, b, levels) => a.every((x, c) => Math.abs(x - b[c]) <= levels);

  // ---- What should be seen ----

  const { width, height } = TEST;
  const transfer = (x) => {
    const c = Math.min(1, Math.max(0, x));
    return Math.round(255 * (c <= 0.0031308 ? 12.92 * c : 1.055 * Math.pow(c, 1 / 2.4) - 0.055));
  };
  // The centres of all pixels of a panel that shows the whole picture.
  const whole = (canvas, expected, levels, what) => {
    const image = pixels(canvas);
    for (let i = 0; i < width * height; i++) {
      const [x, y] = [i % width, Math.floor(i / width)];
      const seen = at(image, Math.floor(((x + 0.5) / width) * image.width), Math.floor(((y + 0.5) / height) * image.height));
      check(near(seen, expected(i), levels), what, { x, y, seen, expected: expected(i) });
    }
  };
  const mix = (a, b, part) => a.map((x, c) => Math.round(x + part * (b[c] - x)));
  const diverging = (x) => {
    const [half, end] = x < 0 ? [[67, 147, 195], [5, 48, 97]] : [[214, 96, 77], [103, 0, 31]];
    const size = Math.min(1, Math.abs(x));
    return size < 0.5 ? mix([247, 247, 247], half, 2 * size) : mix(half, end, 2 * size - 1);
  };

  // ---- The tests ----

  async function exposures(viewer, cell) {
    viewer.canvases().forEach((canvas, panel) => {
      whole(canvas, (i) => cell[panel].png.slice(3 * i, 3 * i + 3), 1, "default exposure is the PNG");
    });
    const brighter = (stops) => viewer.canvases().forEach((canvas, panel) => {
      whole(canvas, (i) => cell[panel].rgb[i].map((x) => transfer(x * 2 ** stops)), 1, `${stops} stops`);
    });
    await slide(viewer.exposure, 1);
    brighter(1);
    check(viewer.exposure.parentElement.textContent.includes("+1 stops"), "the exposure is named");
    await key(viewer, "b");
    await key(viewer, "b");
    brighter(2);
    for (let i = 0; i < 7; i++) await key(viewer, "d");
    brighter(-1.5);
    await key(viewer, "0");
    brighter(0);
  }

  async function flips(viewer, cell) {
    const shows = (index, what, letter = "AB"[index]) => {
      check(viewer.canvases().length === 1, "flip has one panel");
      whole(viewer.canvases()[0], (i) => cell[index].png.slice(3 * i, 3 * i + 3), 1, what);
      check(viewer.caption().includes(`${letter}: ${cell[index].name}`), `${what}: the label`, viewer.caption());
    };
    viewer.mode("flip").click();
    await settle();
    shows(0, "flip shows A");
    await key(viewer, "f");
    shows(1, "F shows B");
    viewer.button("Show the other").click();
    await settle();
    shows(0, "the button flips");
    const canvas = viewer.canvases()[0];
    pointer(canvas, "pointerdown", 0.5, 0.5);
    pointer(canvas, "pointerup", 0.5, 0.5);
    await leave(viewer);
    shows(1, "a tap flips");
    await choose(viewer.menu("A"), 1);
    await choose(viewer.menu("B"), 0);
    shows(0, "another B is shown", "B");
    await choose(viewer.menu("A"), 0);
    await choose(viewer.menu("B"), 1);
  }

  async function splits(viewer, cell) {
    await key(viewer, "3");
    const canvas = viewer.canvases()[0];
    const seam = (part, what) => {
      const image = pixels(canvas);
      const column = Math.round(part * canvas.width);
      for (const [offset, side] of [[-4, 0], [4, 1]]) {
        const u = column + offset;
        let told = 0;
        for (let y = 0; y < height; y++) {
          const i = y * width + Math.floor(((u + 0.5) / canvas.width) * width);
          const [own, other] = [side, 1 - side].map((s) => cell[s].png.slice(3 * i, 3 * i + 3));
          const seen = at(image, u, Math.floor(((y + 0.5) / height) * canvas.height));
          check(near(seen, own, 1), `${what}: side ${side} of the seam`, { y, seen, own, other });
          told += !near(own, other, 3);
        }
        check(told > 0, `${what}: A and B differ at the seam`);
      }
    };
    await leave(viewer);
    seam(0.5, "in the middle");
    pointer(canvas, "pointerdown", 0.31, 0.4);
    await leave(viewer);
    pointer(canvas, "pointermove", 0.42, 0.4);
    pointer(canvas, "pointerup", 0.42, 0.4);
    await leave(viewer);
    seam(0.42, "dragged");
    await key(viewer, "ArrowRight");
    seam(0.44, "by a key");
    await slide(viewer.seam, 0.6);
    seam(0.6, "by the slider");
    await key(viewer, "1");
  }

  // Columns (rows) of the canvas at which a pixel's square ends, from its centre.
  async function zooms(viewer, cell) {
    const fit = viewer.zoom();
    viewer.stage.focus();
    for (let i = 0; i < 2; i++) await key(viewer, "+");
    check(Math.abs(viewer.zoom() / fit - 4) < 0.1, "two keys zoom four times", viewer.zoom() / fit);
    const square = (canvas, png, x, y, what) => {
      const size = (canvas.width / width) * 4;
      const [left, top] = [canvas.width / 2 + (x - width / 2) * size, canvas.height / 2 + (y - height / 2) * size];
      const image = pixels(canvas);
      const own = png.slice(3 * (y * width + x), 3 * (y * width + x) + 3);
      for (let v = Math.ceil(top) + 1; v < top + size - 2; v++) {
        for (let u = Math.ceil(left) + 1; u < left + size - 2; u++) {
          if (u < 0 || v < 0 || u >= image.width || v >= image.height) continue;
          check(near(at(image, u, v), own, 1), what, { x, y, u, v, seen: at(image, u, v), own });
        }
      }
    };
    viewer.canvases().forEach((canvas, panel) => {
      for (const [x, y] of [[5, 5], [6, 5], [5, 6]]) square(canvas, cell[panel].png, x, y, "a pixel is a square");
    });
    // A drag by one pixel to the left shows the next pixel, on both panels.
    const step = 4 / width;
    const canvas = viewer.canvases()[0];
    pointer(canvas, "pointerdown", 0.6, 0.6);
    pointer(canvas, "pointermove", 0.6 - step, 0.6);
    pointer(canvas, "pointerup", 0.6 - step, 0.6);
    await leave(viewer);
    viewer.canvases().forEach((canvas, panel) => {
      const size = Math.floor((canvas.width / width) * 4);
      const seen = at(pixels(canvas), canvas.width / 2 - Math.floor(size / 2), canvas.height / 2 + Math.floor(size / 2));
      const i = 6 * width + 6;
      check(near(seen, cell[panel].png.slice(3 * i, 3 * i + 3), 1), "a drag pans all panels", { panel, seen });
    });
    await key(viewer, "0");
    check(viewer.zoom() === fit, "reset");
    const wheel = () => canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -200, bubbles: true, cancelable: true }));
    viewer.stage.blur();
    check(wheel() && viewer.zoom() === fit, "the page scrolls over a viewer that is not in use");
    viewer.stage.focus();
    check(!wheel() && Math.abs(viewer.zoom() / fit - 2) < 0.1, "the wheel zooms", viewer.zoom() / fit);
    viewer.button("Zoom out").click();
    check(viewer.zoom() === fit, "the button zooms out");
  }

  async function pinches(viewer, cell) {
    const fit = viewer.zoom();
    for (const mode of ["side", "split"]) {
      viewer.mode(mode).click();
      await settle();
      const canvas = viewer.canvases()[0];
      const base = viewer.zoom();
      const [one, two] = [{ pointerId: 11, pointerType: "touch" }, { pointerId: 12, pointerType: "touch" }];
      pointer(canvas, "pointerdown", 0.4, 0.5, one);
      pointer(canvas, "pointerdown", 0.6, 0.5, two);
      pointer(canvas, "pointermove", 0.3, 0.5, one);
      pointer(canvas, "pointermove", 0.7, 0.5, two);
      const pinched = viewer.zoom() / base;
      check(Math.abs(pinched - 2) < 0.1, `two fingers zoom in ${mode}`, pinched);
      pointer(canvas, "pointermove", 0.3, 0.9, one);
      pointer(canvas, "pointermove", 0.7, 0.9, two);
      pointer(canvas, "pointerup", 0.3, 0.9, one);
      pointer(canvas, "pointerup", 0.7, 0.9, two);
      await leave(viewer);
      // Moved down by 0.4 panels, of which 0.25 are there: the picture's first row is at the top.
      const x = Math.floor(width / 2);
      const seen = at(pixels(canvas), Math.floor(canvas.width * (0.5 + 1 / width)), 2);
      const own = cell[mode === "split" ? 1 : 0].png.slice(3 * x, 3 * x + 3); // right of the seam
      check(near(seen, own, 1), `two fingers pan in ${mode}`, { seen, own });
      if (mode === "split") {
        check(Math.abs(viewer.seam.value - 0.4) < 0.01, "the first finger alone had moved the seam", viewer.seam.value);
      }
      await key(viewer, "0");
    }
    await key(viewer, "1");
    check(viewer.zoom() === fit, "as before");
  }

  async function layers(viewer, cell) {
    const palettes = JSON.parse(document.getElementById("viewer-palettes").textContent);
    const colour = (text, index) => [0, 2, 4].map((c) => parseInt(text.slice(6 * index + c, 6 * index + c + 2), 16));
    for (let band = 0; band < TEST.bands.length; band++) {
      const value = (picture, i) => [picture.mean[band][i], picture.error[band][i]];
      await choose(viewer.menu("Layer"), "noise");
      await choose(viewer.menu("Band"), band);
      viewer.canvases().forEach((canvas, panel) => whole(canvas, (i) => {
        const [mean, error] = value(cell[panel], i);
        if (mean === 0 && error === 0) return [128, 128, 128];
        const part = Math.min(1, Math.max(0, Math.log10(error / mean / 0.001) / 3));
        return colour(palettes.noise, 1 + Math.round(254 * part));
      }, 3, "noise"));
      // Of scores that are never negative: the skewness of the mean is at least this.
      const isSkewed = (mean, error) => mean > 0 && error / mean - mean / (TEST.passes * error) > 0.1;
      const scores = cell[0].mean[band].map((_, i) => {
        const [[a, ea], [b, eb]] = [value(cell[1], i), value(cell[0], i)];
        const z = isSkewed(a, ea) || isSkewed(b, eb) ? NaN : (a - b) / Math.hypot(ea, eb);
        return [z, (a - b) / b];
      });
      check(scores.some(([z]) => !Number.isNaN(z)) && scores.some(([z]) => Number.isNaN(z)), "some pixels are judged, some are not");
      for (const [layer, index, limit] of [["z", 0, 4], ["difference", 1, TEST.limits[cell.index]]]) {
        await choose(viewer.menu("Layer"), layer);
        whole(viewer.canvases()[1], (i) => {
          const x = scores[i][index];
          return Number.isNaN(x) ? [128, 128, 128] : diverging(Math.round((127 * Math.min(1, Math.max(-1, x / limit)))) / 127);
        }, 1, `${layer} of band ${band}`);
      }
      await choose(viewer.menu("Layer"), "z");
      const beyond = scores.filter(([z]) => Math.abs(z) > 4).length;
      const judged = scores.filter(([z]) => !Number.isNaN(z)).length;
      check(viewer.notes().includes(`${beyond} of ${judged} pixels are beyond ±4 (`), "how many are beyond", viewer.notes());
      check(viewer.notes().includes("; by chance it would be at most"), "what chance would do", viewer.notes());
      check(viewer.notes().includes("pixels are not judged"), "what is not judged", viewer.notes());
      const i = scores.findIndex(([z]) => Math.abs(z) > 0.5 && Math.abs(z) < 3.5);
      pointer(viewer.canvases()[1], "pointermove", ((i % width) + 0.5) / width, (Math.floor(i / width) + 0.5) / height);
      const said = Number(/z ≈ (\S+)/.exec(viewer.readout())?.[1].replace("−", "-"));
      check(Math.abs(said - scores[i][0]) < 0.03, "the readout's z", [said, scores[i][0]]);
      await leave(viewer);
    }
    check(viewer.root.querySelector(".viewer-ticks").textContent === "≤ −4−20+2≥ +4", "the bar's labels",
      viewer.root.querySelector(".viewer-ticks").textContent);
    await choose(viewer.menu("Layer"), "image");
    check(viewer.root.querySelector(".viewer-scale").hidden, "an image has no bar");
  }

  async function reads(viewer, cell) {
    const says = (x, y) => {
      const text = viewer.readout();
      check(text.includes(`x ${x}, y ${y};`), "the readout's place", text);
      const rows = [...viewer.root.querySelectorAll(".viewer-readout tr")];
      check(rows.length === cell.length, "a row a picture");
      rows.forEach((row, index) => {
        const said = row.children[1].textContent.match(/[\d.e+-]+/g).map(Number);
        const own = cell[index].rgb[y * width + x];
        check(said.every((s, c) => Math.abs(s - own[c]) <= 0.009 * own[c]), "the readout's values", { said, own });
      });
    };
    pointer(viewer.canvases()[1], "pointermove", 5.5 / width, 4.5 / height);
    says(5, 4);
    await leave(viewer);
    check(!viewer.readout().includes("x 5"), "gone with the pointer");
    await key(viewer, "ArrowRight");
    says(width / 2, height / 2);
    await key(viewer, "ArrowUp");
    says(width / 2, height / 2 - 1);
    await key(viewer, "Escape");
  }

  async function keyboard(viewer) {
    const names = [...viewer.root.querySelectorAll("input, select, button, [tabindex], summary")].map((control) => {
      const name = control.getAttribute("aria-label") ?? control.closest("label")?.textContent ?? control.textContent;
      check(name.trim() !== "", "every control has a name", control.outerHTML);
      check(control.tabIndex === 0, "every control can be reached", control.outerHTML);
      return name;
    });
    check(names.length >= 14, "controls", names);
    await key(viewer, "l");
    check(viewer.menu("Layer").value === "noise", "L changes the layer");
    const band = Number(viewer.menu("Band").value);
    await key(viewer, "n");
    check(Number(viewer.menu("Band").value) === (band + 1) % TEST.bands.length, "N changes the band");
    for (let i = 0; i < 3; i++) await key(viewer, "l");
    check(viewer.menu("Layer").value === "image", "and back");
    check(document.activeElement === viewer.stage, "the focus stays");
    const style = getComputedStyle(viewer.stage);
    viewer.menu("Layer").focus();
    check(getComputedStyle(viewer.stage).outlineStyle === "none", "no focus, no ring");
    viewer.stage.focus({ focusVisible: true });
    check(style.outlineStyle === "solid" && parseFloat(style.outlineWidth) >= 2, "the focus is seen", style.outline);
  }

  // One cell is shown at a time; exposure and zoom go with the choice.
  async function carried(viewers, cells) {
    await drawn(viewers[0].root);
    await slide(viewers[0].exposure, 3);
    await key(viewers[0], "+");
    const zoom = viewers[0].zoom();
    const shown = () => [...document.querySelectorAll(".viewer-cell")].map((section) => section.checkVisibility());
    check(JSON.stringify(shown()) === "[true,false]", "one cell is shown", shown());
    const buttons = [...document.querySelectorAll(".viewer-sheet button")];
    check(buttons.length === cells.length && buttons.every((b) => b.querySelector("img").naturalWidth === width), "a thumbnail a cell");
    buttons[1].click();
    await settle();
    check(JSON.stringify(shown()) === "[false,true]", "the other cell is shown", shown());
    check(buttons[1].getAttribute("aria-pressed") === "true", "the sheet says which");
    check(viewers[1].exposure.value === "3" && viewers[1].zoom() === zoom, "the view goes with the choice",
      [viewers[1].exposure.value, viewers[1].zoom(), zoom]);
    await key(viewers[1], "0");
    viewers[1].canvases().forEach((canvas, panel) => {
      whole(canvas, (i) => cells[1][panel].png.slice(3 * i, 3 * i + 3), 1, "the other viewer");
    });
    await drawn(viewers[0].root);
    check(viewers[0].exposure.value === "0", "and back");
    const ids = [...document.querySelectorAll("[id]")].map((element) => element.id);
    check(new Set(ids).size === ids.length, "ids are unique");
    const groups = viewers.map((viewer) => viewer.mode("side").name);
    check(new Set(groups).size === groups.length, "radio groups are unique");
    check(Object.keys(window).every((name) => !/viewer/i.test(name) || window[name] instanceof Element), "nothing global");
    await key(viewers[0], "0");
  }

  // The grid of both cells: a seam in every tile.
  async function grids(root) {
    check(root.querySelector("canvas") === null, "folded, and not built");
    root.closest("details").open = true;
    await drawn(root);
    const viewer = parts(root);
    check(viewer.mode("split").checked && viewer.canvases().length === 1, "it begins split");
    const canvas = viewer.canvases()[0];
    const columns = 2 * width;
    const shows = (expected, levels, what) => {
      const image = pixels(canvas);
      for (let i = 0; i < columns * height; i++) {
        const [x, y] = [i % columns, Math.floor(i / columns)];
        const seen = at(image, Math.floor(((x + 0.5) / columns) * image.width), Math.floor(((y + 0.5) / height) * image.height));
        check(near(seen, expected(i, x), levels), what, { x, y, seen, expected: expected(i, x) });
      }
    };
    shows((i) => TEST.grid.slice(3 * i, 3 * i + 3), 1, "seams in the middle are the picture");
    const whole = [];
    for (const flipped of [0, 1]) {
      viewer.mode("flip").click();
      await settle();
      if (flipped) await key(viewer, "f");
      const image = pixels(canvas);
      whole.push(Array.from({ length: columns * height }, (_, i) =>
        at(image, Math.floor((((i % columns) + 0.5) / columns) * image.width),
          Math.floor(((Math.floor(i / columns) + 0.5) / height) * image.height))));
    }
    await key(viewer, "3");
    pointer(canvas, "pointerdown", 0.5 + 0.25 / 2, 0.5);
    pointer(canvas, "pointerup", 0.5 + 0.25 / 2, 0.5);
    await leave(viewer);
    shows((i, x) => whole[x % width < width / 4 ? 0 : 1][i], 0, "one drag moves every seam");
  }

  async function behaviour() {
    const cells = TEST.cells.map((cell, index) => Object.assign(cell, { index }));
    const grid = roots.pop();
    for (const root of [...roots].reverse()) await drawn(root);
    const viewers = roots.map(parts);
    check(viewers.length === cells.length && cells.length === 2, "a viewer a cell", viewers.length);
    roots[0].scrollIntoView();
    for (const test of [exposures, flips, splits]) await test(viewers[0], cells[0]);
    viewers[0].mode("side").click();
    await settle();
    for (const test of [zooms, pinches, layers, reads, keyboard]) await test(viewers[0], cells[0]);
    await drawn(roots[1]);
    await layers(viewers[1], cells[1]);
    await carried(viewers, cells);
    await grids(grid);
  }

  // ---- Looks ----

  const states = async (viewer, act) => {
    for (const mode of ["side", "flip", "split"]) {
      viewer.mode(mode).click();
      for (const layer of ["image", "noise", "difference", "z"]) {
        await choose(viewer.menu("Layer"), layer);
        act(`${mode} ${layer}`);
      }
    }
  };

  function luminance(colour) {
    const [r, g, b] = colour.match(/[\d.]+/g).map((x) => x / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : Math.pow((c + 0.055) / 1.055, 2.4)));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  }

  async function contrast() {
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    check(dark === TEST.dark, "the scheme asked for", String(dark));
    await drawn(roots[0]);
    const viewer = parts(roots[0]);
    roots[0].querySelectorAll("details").forEach((details) => (details.open = true));
    let least = Infinity;
    await states(viewer, (state) => {
      const walker = document.createTreeWalker(roots[0], NodeFilter.SHOW_TEXT);
      while (walker.nextNode()) {
        const element = walker.currentNode.parentElement;
        if (!walker.currentNode.data.trim() || !element.checkVisibility() || element.closest("script, noscript, option")) continue;
        let behind = element;
        while (behind && /^rgba\(.*, 0\)$/.test(getComputedStyle(behind).backgroundColor)) behind = behind.parentElement;
        const [ink, paper] = [getComputedStyle(element).color, getComputedStyle(behind ?? document.body).backgroundColor];
        const [high, low] = [luminance(ink), luminance(paper)].sort((a, b) => b - a);
        const ratio = (high + 0.05) / (low + 0.05);
        least = Math.min(least, ratio);
        check(ratio >= 4.5, `contrast in ${state}`, { text: walker.currentNode.data, ink, paper, ratio });
      }
    });
    return { least, dark };
  }

  async function narrow() {
    check(innerWidth === 360, "the width asked for", String(innerWidth));
    await drawn(roots[0]);
    const fits = (state) => check(document.documentElement.scrollWidth <= 360, `no overflow: ${state}`, document.documentElement.scrollWidth);
    document.querySelectorAll("details").forEach((details) => (details.open = true));
    fits("all that opens is open");
    await states(parts(roots[0]), fits);
    await key(parts(roots[0]), "1");
    await key(parts(roots[0]), "ArrowRight", { shiftKey: true });
    fits("the readout");
  }

  // Milliseconds from the start of a navigation until the page is loaded and its first viewer drawn, of several opens in
  // one browser.
  async function speed() {
    if (document.readyState !== "complete") await new Promise((done) => addEventListener("load", done));
    roots[0].scrollIntoView();
    while (!roots[0].dataset.drawn) await wait(1);
    const times = [...JSON.parse(sessionStorage.getItem("times") ?? "[]"), performance.now()];
    if (times.length < 7) {
      sessionStorage.setItem("times", JSON.stringify(times));
      location.reload();
      return null;
    }
    return { times, viewers: roots.length, late: roots.filter((root) => !root.dataset.drawn).length };
  }

  try {
    const more = await { behaviour, contrast, narrow, speed }[TEST.what]();
    if (more !== null) say({ checks, failures, ...more });
  } catch (error) {
    say({ checks, failures: [...failures, String(error.stack)] });
  }
})();
