// Start of the page, and its interface for scripts and tests: window.replay.

function publicApi(player) {
  return {
    ready: true,
    seek: (time) => { player.pause(); player.seek(time); player.stage.render(); },
    play: () => player.play(),
    pause: () => player.pause(),
    poses: () => player.stage.poses(),
    ghosts: () => player.stage.ghosts.poses(),
    picture: (type = "image/png", time = player.time) => { player.seek(time); return player.capture.still().toDataURL(type, 0.95).split(",")[1]; },
    pictures: (type, times) => times.map((time) => { player.seek(time); return player.capture.still().toDataURL(type, 0.95).split(",")[1]; }),
    video: async (rate) => base64(new Uint8Array(await (await player.capture.record(rate)).arrayBuffer())),
    ringColors: (i) => player.stage.elements.ringColors(i),
    get forces() { return player.stage.arrows.items.filter((arrow) => arrow.drawn).map(({ name, value }) => ({ name, value })); },
    get flashes() { return player.stage.elements.flashing; },
    showForces: (shown) => { if (player.stage.arrows.shown !== shown) player.toggleForces(); },
    resetView: () => { player.resize(); player.stage.resetView(); },
    get runs() { return player.stage.ghosts.items.length + 1; },
    onScreen: (place) => player.stage.onScreen(new player.stage.THREE.Vector3(...place)),
    box: () => player.stage.box(),
    show: (what, shown) => player.stage.show(what, shown),
    get looks() { return player.plots.map((plot) => plot.curves.map(({ color, dash }) => `${color} ${dash}`)); },
    get curveHeights() { return player.plots.map((plot) => plot.bottom - plot.top); },
    get margin() { return player.timeline.axis.left; },
    get address() { return player.address.text(); },
    get gap() { return player.stage.marks.gap(); },
    get draws() { player.stage.dirty = true; player.stage.render(); const { calls, triangles } = player.stage.renderer.info.render; return { calls, triangles }; },
    get span() { return [player.span.start, player.span.end]; },
    get speed() { return player.speed; },
    get playing() { return player.playing; },
    get time() { return player.time; },
    get start() { return player.start; },
    get duration() { return player.end - player.start; },
    get times() { return Array.from(player.run.times); },
  };
}

async function main() {
  await runScript("library");
  const { THREE } = MeshCat, player = new Player(THREE, await loadRun());
  const loop = () => { requestAnimationFrame(loop); player.tick(); };
  player.tick();
  loop();
  element("message").hidden = true;
  window.replay = publicApi(player);
  window.replayDone = true;
  if (!/[#&]paused\b/.test(location.hash) && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
}
