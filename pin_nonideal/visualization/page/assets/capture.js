// Capture of the view: a picture, or a video during playback.

class Capture {
  constructor(player) {
    this.player = player;
    element("picture").addEventListener("click", () => this.still().toBlob((blob) => this.save(blob, "png")));
    element("video").hidden = typeof MediaRecorder === "undefined";
    element("video").addEventListener("click", () => (this.recorder ? this.recorder.stop() : this.record().then((blob) => this.save(blob, "webm"))));
  }

  /** Draws the view with its background, numbers, title and time on one canvas. */
  canvas(into = document.createElement("canvas")) {
    const { stage, run } = this.player, { canvas } = stage, ratio = canvas.width / Math.max(canvas.clientWidth, 1), c = into.getContext("2d", { willReadFrequently: true });
    stage.dirty = true;
    stage.render(); // WebGL keeps the drawn image until the end of this task
    if (into.width !== canvas.width || into.height !== canvas.height) { into.width = canvas.width; into.height = canvas.height; }
    c.putImageData(this.pixels(into), 0, 0);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.textBaseline = "middle"; c.textAlign = "center"; c.font = "600 11px system-ui, sans-serif";
    for (const span of stage.arrows.spans.filter((item) => item.style.visibility !== "hidden" && item.textContent)) {
      const [x, y] = span.place, wide = c.measureText(span.textContent).width + 8;
      c.fillStyle = ink("label"); c.fillRect(x - wide / 2, y - 8, wide, 16);
      c.fillStyle = span.style.color; c.fillText(span.textContent, x, y);
    }
    c.fillStyle = ink("ink"); c.textAlign = "left"; c.font = "600 14px system-ui, sans-serif";
    c.fillText(`${run.title}  ${this.player.time.toFixed(digitsFor(this.player.end - this.player.start))} s`, 12, 18);
    return into;
  }

  /** Reads the WebGL image and blends it over the background; reading through a 2D canvas is ten times slower. */
  pixels({ width, height }) {
    const gl = this.player.stage.renderer.getContext();
    if (!this.image || this.image.width !== width || this.image.height !== height) {
      this.image = new ImageData(width, height);
      this.drawnBytes = new Uint8Array(4 * width * height);
    }
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, this.drawnBytes);
    const sky = this.sky(height), [to, from, rows] = [this.image.data, this.drawnBytes, sky].map(({ buffer }) => new Uint32Array(buffer));
    for (let y = 0, i = 0; y < height; y++) {
      for (let k = (height - 1 - y) * width, end = k + width; k < end; k++, i++) {
        const word = from[k], left = 255 - (word >>> 24);
        if (left === 0) to[i] = word;
        else if (left === 255) to[i] = rows[y];
        else for (let part = 0; part < 4; part++) this.image.data[4 * i + part] = from8(this.drawnBytes[4 * k + part], sky[4 * y + part], left);
      }
    }
    return this.image;
  }

  /** Background, one pixel wide. */
  sky(height) {
    const colors = [0, 1, 2].map((i) => ink(`sky${i}`)), key = [height, ...colors].join();
    if (this.skyOf !== key) {
      const column = document.createElement("canvas"), c = column.getContext("2d", { willReadFrequently: true }), shade = c.createLinearGradient(0, 0, 0, height);
      Object.assign(column, { width: 1, height });
      [0, 0.45, 1].forEach((at, i) => shade.addColorStop(at, colors[i]));
      c.fillStyle = shade;
      c.fillRect(0, 0, 1, height);
      Object.assign(this, { skyOf: key, skyColumn: c.getImageData(0, 0, 1, height).data });
    }
    return this.skyColumn;
  }

  /** Draws the view on a canvas that is reused. */
  still() { return this.canvas((this.page = this.page || document.createElement("canvas"))); }

  /** Records a video of the whole run, or of the repeated part, at the current speed. */
  record(rate = 30) {
    const { player } = this, into = this.canvas(), [from, to] = player.loop || [player.start, player.end], parts = [];
    const type = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"].find((one) => MediaRecorder.isTypeSupported(one));
    const stream = into.captureStream(rate), recorder = (this.recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: 8e6 }));
    const repeats = element("loop").checked;
    element("loop").checked = false;
    player.seekByHand(from);
    element("video").classList.add("on");
    return new Promise((done) => {
      recorder.ondataavailable = ({ data }) => parts.push(data);
      recorder.onstop = () => {
        this.drawn = null; this.recorder = null;
        player.pause();
        element("loop").checked = repeats;
        element("video").classList.remove("on");
        done(new Blob(parts, { type: "video/webm" }));
      };
      this.drawn = () => {
        this.canvas(into);
        if (player.time < to && player.playing) return;
        this.drawn = null;
        setTimeout(() => recorder.state === "recording" && recorder.stop(), 3000 / rate); // the stream takes the last image first
      };
      recorder.start();
      player.play();
    });
  }

  save(blob, ending) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `${this.player.run.title.replace(/[^\w.-]+/g, "_").slice(0, 80) || "replay"}.${ending}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
}

/** Blends a color component over another one, which is visible by `left` of 255. */
function from8(over, under, left) { return over + (under * left) / 255; }

/** Bytes as base64 text. */
function base64(bytes) {
  let text = "";
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
}
