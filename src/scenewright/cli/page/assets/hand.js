"use strict";
// Changes by hand: numbers and ways in a table, and what was dragged in the player. All become typed edits.
const hand = { open: false };

async function toggleHand() {
  hand.open = find("hand").hidden;
  find("hand").hidden = !hand.open;
  find("by-hand").setAttribute("aria-expanded", String(hand.open));
  await offerHandles();
}
/** The table, and the handles of the player, of the version that is shown if it is the current one. */
async function offerHandles() {
  const current = app.state?.current ?? null, shown = Number(find("version").value), ours = hand.open && current !== null && shown === current;
  const { handles } = ours ? await ask(threadPath("/handles")) : { handles: [] };
  app.handles = handles;
  find("hand").replaceChildren(ours ? showHandles(handles) : make("p", { className: "quiet", textContent: "Only the version that is worked on can be changed; go back to it with undo or redo." }));
  tellPlayer();
}
function tellPlayer() {
  const dark = document.documentElement.classList.contains("dark");
  for (const frame of document.querySelectorAll("#players iframe, #batch-player iframe"))
    frame.contentWindow?.postMessage({ scenewright: "handles", dark, handles: frame.closest("#players") ? app.handles ?? [] : [] }, location.origin);
}
function showHandles(handles) {
  const head = make("tr", {}, ...["Agent", "Comes later [s]", "Stops further on [m]", "Waits longer [s]", "Way"].map((textContent) => make("th", { scope: "col", textContent })));
  const rows = handles.filter((each) => each.ways.length).map(showHandle);
  return make("div", {}, make("p", { className: "quiet", textContent: "Type a number and press Enter, or choose a way: the scene is then solved and checked anew. Or drag a bar of the timeline, or the red bar where somebody stops. Negative numbers mean sooner, before, shorter." }),
    make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows)));
}
function showHandle({ agent, called, stop, ways }) {
  const number = (name, edit, key, usable) => {
    const field = make("input", { type: "number", step: 0.5, min: -15, max: 15, disabled: !usable });
    field.setAttribute("aria-label", `${called}: ${name}`);
    if (!usable) field.dataset.never = "";
    field.addEventListener("change", () => { if (Number(field.value)) changeByHand({ edit, agent, [key]: Number(field.value) }); });
    return make("td", {}, field);
  };
  return make("tr", {}, make("th", { scope: "row", textContent: called }), number("comes later", "come_later", "seconds", true),
    number("stops further on", "move_stop", "metres", stop !== null), number("waits longer", "wait_longer", "seconds", stop !== null), make("td", {}, chooseWay(agent, called, ways)));
}
function chooseWay(agent, called, ways) {
  const words = ({ entry, exit, movement, crosswalk }) => (crosswalk ? `over the ${crosswalk} crosswalk, ${entry} to ${exit}${movement === "jaywalking" ? ", away from it" : ""}` : `${entry} to ${exit} (${movement})`);
  const select = make("select", {}, ...ways.map((way, n) => make("option", { value: n, textContent: words(way), selected: way.now })));
  select.setAttribute("aria-label", `${called}: way`);
  select.addEventListener("change", () => {
    const { now, ...way } = ways[Number(select.value)];
    changeByHand({ edit: "choose_way", agent, ...way });
  });
  return select;
}
function changeByHand(edit) {
  takeTurn("edit", JSON.stringify([edit]));
}
/** Messages of our own players alone; what they ask for is read and checked by the server. */
function listenToPlayers() {
  window.addEventListener("message", (event) => {
    const ours = [...document.querySelectorAll("#players iframe, #batch-player iframe")].some((frame) => frame.contentWindow === event.source);
    if (!ours || event.origin !== location.origin) return;
    if (event.data?.scenewright === "ready") tellPlayer();
    if (event.data?.scenewright === "edit") changeByHand(event.data.edit);
  });
}
