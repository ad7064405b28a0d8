// Formats the values in the data of viewers. All files of this folder are one script.

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
