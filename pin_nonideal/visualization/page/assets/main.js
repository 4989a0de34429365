// Unpacks the scripts of the page and starts it; errors are shown in its place.

window.addEventListener("error", (event) => { window.replayError = window.replayError || String(event.message); });
runScript("scripts").then(() => main()).catch((error) => {
  window.replayError = String(error);
  document.body.className = "failed";
  document.getElementById("message").hidden = false;
  document.getElementById("message").textContent = `This replay cannot be shown.\n${error.message || error}`;
  console.error(error);
});
