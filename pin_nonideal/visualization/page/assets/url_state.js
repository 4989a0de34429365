// State of the page in its address: #t=1.5&view=x,y,z&speed=0.1&span=0,2. A view that frames the motion
// stores its direction only, so that other windows frame the motion too. A view moved by hand or a following
// camera stores cam=azimuth,elevation,distance,x,y,z.

class UrlState {
  constructor(player) {
    this.player = player;
    this.last = "";
    this.read();
    window.addEventListener("hashchange", () => { if (location.hash.slice(1) !== this.last) this.read(); });
    setInterval(() => this.write(), 400);
  }

  read() {
    const { player } = this, given = new URLSearchParams(location.hash.slice(1)), numbers = (key, count) => {
      const found = (given.get(key) || "").split(",").map(Number);
      return found.length === count && found.every(Number.isFinite) && given.has(key) ? found : null;
    };
    const camera = numbers("cam", 6), view = numbers("view", 3), time = numbers("t", 1), speed = numbers("speed", 1), span = numbers("span", 2);
    if (speed && SPEEDS.includes(speed[0])) { [player.speed] = speed; element("speed").value = player.speed; }
    if (span && span[1] > span[0]) player.span.set(...span);
    if (time) player.seekByHand(time[0]);
    if (view && Math.hypot(...view) > 0) player.stage.resetView(view);
    if (!camera) return;
    const { orbit } = player.stage;
    [orbit.azimuth, orbit.elevation, orbit.distance] = camera;
    orbit.target.set(...camera.slice(3));
    orbit.moved = true;
    orbit.place();
  }

  /** State for a reload or a copied link; it is not written during playback. */
  text() {
    const { player } = this, { orbit, following } = player.stage, digits = (x) => Number(x.toPrecision(6));
    const byHand = orbit.moved || following || !orbit.away;
    const camera = byHand ? `cam=${[orbit.azimuth, orbit.elevation, orbit.distance, ...orbit.target.toArray()].map(digits).join()}` : `view=${orbit.away.toArray().map(digits).join()}`;
    const zoomed = player.span.start !== player.span.full[0] || player.span.end !== player.span.full[1];
    return `paused&t=${digits(player.time)}&${camera}&speed=${player.speed}${zoomed ? `&span=${digits(player.span.start)},${digits(player.span.end)}` : ""}`;
  }

  write() {
    if (this.player.playing || document.hidden) return;
    const text = this.text();
    if (text === this.last) return;
    this.last = text;
    try { history.replaceState(null, "", `#${text}`); } catch (error) { this.last = text; } // a page in a notebook has no address
  }
}
