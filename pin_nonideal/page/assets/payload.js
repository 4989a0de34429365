// What the page carries: gzip or plain bytes in base64; the run as a JSON header followed by typed arrays.

function fromBase64(text) {
  const raw = atob(text.trim()), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function unzip(bytes) {
  if (typeof DecompressionStream === "undefined")
    throw new Error("this browser cannot unpack the page; update it, or write the replay with compress=False");
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function carried(id) {
  const bytes = fromBase64(document.getElementById(id).textContent);
  return ZIPPED ? unzip(bytes) : bytes;
}

/** Runs the drawing library of the page and returns its three.js. */
async function loadLibrary() {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await carried("library"));
  document.head.appendChild(script);
  return MeshCat.THREE;
}

/** The run: its header with every array reference {array: [type, offset, length]} replaced by the array. */
async function loadRun() {
  const bytes = await carried("payload");
  const headerLength = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
  const body = bytes.byteOffset + 4 + headerLength;
  const types = { f4: Float32Array, f8: Float64Array, u2: Uint16Array, u4: Uint32Array };
  const header = new TextDecoder().decode(bytes.subarray(4, 4 + headerLength));
  return JSON.parse(header, (key, value) => {
    if (value === null || typeof value !== "object" || !("array" in value)) return value;
    const [type, offset, length] = value.array;
    const size = types[type].BYTES_PER_ELEMENT;
    return new types[type](bytes.buffer.slice(body + offset, body + offset + length * size));
  });
}

/** A number for a reader: four digits, and a power of ten when it is very small or large. */
function readable(x) {
  if (!Number.isFinite(x)) return String(x);
  const size = Math.abs(x);
  if (size === 0) return "0";
  if (size < 1e-3 || size >= 1e5) return x.toExponential(2);
  return String(+x.toPrecision(4));
}

/** The same with all four digits, so that a changing number keeps its width. */
function steady(x) {
  const size = Math.abs(x);
  return size >= 1e-3 && size < 1e4 ? x.toPrecision(4) : readable(x);
}

/** Index of the last entry of an ascending array that is not above x; at least 0. */
function lastBelow(values, x) {
  let low = 0, high = values.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (values[middle] <= x) low = middle; else high = middle - 1;
  }
  return low;
}

/** The interval [k, k + 1] of an ascending array around x, and how far x lies in it: 0 to 1. */
function bracket(values, x) {
  const k = Math.min(lastBelow(values, x), Math.max(values.length - 2, 0));
  const next = Math.min(k + 1, values.length - 1), length = values[next] - values[k];
  return { k, next, part: length > 0 ? Math.min(Math.max((x - values[k]) / length, 0), 1) : 0 };
}
