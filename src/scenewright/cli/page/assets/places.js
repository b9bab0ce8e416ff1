"use strict";
// Intersections to choose from, and maps of one's own: dropped, then a junction chosen on the map.
function showPlaces(places, chosen) {
  app.place = chosen;
  app.places = places;
  find("places").replaceChildren(...places.map(({ name, title }) => {
    const picture = make("img", { src: address(`/api/intersections/${encodeURIComponent(name)}.png`), alt: "", loading: "lazy" });
    const button = make("button", { type: "button" }, picture, make("strong", { textContent: name }), make("span", { className: "quiet", textContent: title }));
    button.setAttribute("aria-pressed", String(name === chosen));
    button.addEventListener("click", () => { app.thread = null; find("thread").value = ""; showPlaces(places, name); });
    return button;
  }));
  showExamples();
  find("batch-place").replaceChildren(...places.map(({ name }) => make("option", { value: name, textContent: name, selected: name === chosen })));
}
const ownMap = { file: null, junction: "" };

async function readMap(file) {
  sayAboutMap(`Reading ${file.name} …`);
  find("own-choice").hidden = true;
  try {
    const found = await send(`/api/maps`, { query: { name: file.name }, body: file });
    Object.assign(ownMap, { file: found.map, junction: found.junctions.length === 1 ? found.junctions[0].id : "" });
    find("own-name").value = found.suggested;
    showJunctions(found);
    sayAboutMap(found.junctions.length > 1 ? `${found.junctions.length} junctions: choose one on the map or in the list.` : "Give it a name and import it.");
    find("own-choice").hidden = false;
  } catch (error) { sayAboutMap(error.message, true); }
}
function sayAboutMap(words, bad = false) {
  find("own-said").textContent = words;
  find("own-said").classList.toggle("bad", bad);
}
function showJunctions({ junctions, roads }) {
  const list = find("own-junction");
  list.replaceChildren(...junctions.map(({ id, legs, name }) => make("option", { value: id, textContent: `${name || id} (${legs} legs)`, selected: id === ownMap.junction })));
  list.hidden = junctions.length < 2;
  list.labels[0].hidden = list.hidden;
  const points = roads.flat();
  find("own-map").replaceChildren();
  find("own-map").toggleAttribute("hidden", !points.length);
  if (!points.length) return;
  const xs = points.map((each) => each[0]), ys = points.map((each) => -each[1]);
  const [west, north] = [Math.min(...xs), Math.min(...ys)], width = Math.max(...xs) - west, height = Math.max(...ys) - north;
  const size = Math.max(width, height), margin = 0.04 * size;
  find("own-map").setAttribute("viewBox", `${west - margin} ${north - margin} ${width + 2 * margin} ${height + 2 * margin}`);
  const road = roads.map((line) => `M ${line.map(([x, y]) => `${x} ${-y}`).join(" L ")}`).join(" ");
  find("own-map").append(draw("path", { d: road, class: "road", "stroke-width": size / 160 }));
  for (const junction of junctions) drawJunction(junction, size);
  chooseJunction(list.value);
}
function drawJunction({ id, xy: [x, y], legs, name }, size) {
  const dot = draw("circle", { cx: x, cy: -y, r: size / 55, class: "junction", "stroke-width": size / 400, tabindex: 0, role: "button" });
  dot.dataset.id = id;
  dot.setAttribute("aria-label", `${name || id}, ${legs} legs`);
  dot.append(draw("title", {}, `${name || id} (${legs} legs)`));
  dot.addEventListener("click", () => chooseJunction(id));
  dot.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); chooseJunction(id); } });
  find("own-map").append(dot);
}
function chooseJunction(id) {
  ownMap.junction = id;
  find("own-junction").value = id;
  for (const dot of find("own-map").querySelectorAll(".junction")) dot.classList.toggle("chosen", dot.dataset.id === id);
}
async function importMap() {
  find("own-import").disabled = true;
  sayAboutMap("Importing …");
  try {
    const left_hand = { left: true, right: false }[find("own-side").value] ?? null;
    const body = { name: find("own-name").value, junction: ownMap.junction || null, left_hand, signals: find("own-signals").value };
    const made = await ask(`/api/maps/${encodeURIComponent(ownMap.file)}/import`, { body });
    sayAboutMap(made.lines.join("\n"));
    showPlaces((await ask("/api/start")).intersections, made.name);
  } catch (error) { sayAboutMap(error.message, true); } finally { find("own-import").disabled = false; }
}
/** A place to drop a file on, which also opens the file chooser. */
function listenToDrop(area, input, take) {
  input.addEventListener("change", () => { if (input.files[0]) take(input.files[0]); input.value = ""; });
  area.addEventListener("dragover", (event) => { event.preventDefault(); area.classList.add("over"); });
  area.addEventListener("dragleave", () => area.classList.remove("over"));
  area.addEventListener("drop", (event) => {
    event.preventDefault();
    area.classList.remove("over");
    if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]);
  });
}
function listenToPlaces() {
  listenToDrop(find("own-drop"), find("own-file"), readMap);
  find("own-junction").addEventListener("change", (event) => chooseJunction(event.target.value));
  find("own-form").addEventListener("submit", (event) => { event.preventDefault(); importMap(); });
}
