// Content of the page: gzip or plain bytes in base64; the run is a JSON header followed by typed arrays.

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

/** Runs the script in an element of the page. */
async function runScript(id) {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await carried(id));
  document.head.appendChild(script);
}

/** Returns the run: its header, in which each array reference {array: [type, offset, length]} is replaced by the array. */
async function loadRun() {
  const bytes = await carried("payload");
  const headerLength = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
  const body = bytes.byteOffset + 4 + headerLength;
  const types = { f4: Float32Array, f8: Float64Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
  const header = new TextDecoder().decode(bytes.subarray(4, 4 + headerLength));
  return JSON.parse(header, (key, value) => {
    if (value === null || typeof value !== "object" || !("array" in value)) return value;
    const [type, offset, length] = value.array;
    const size = types[type].BYTES_PER_ELEMENT;
    return new types[type](bytes.buffer.slice(body + offset, body + offset + length * size));
  });
}
