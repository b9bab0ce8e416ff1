"use strict";
// Batches: rows dropped as JSONL, watched while they are made, filtered, and opened one by one.
const FIGURE_NAMES = { pet: "PET [s]", clearance: "least distance [m]", path_ttc: "TTC [s]", relative_speed: "speed of contact [m/s]", drac: "braking needed [m/s²]",
  least_gap: "least gap [m]", least_headway: "least headway [s]" };
const SHOWN_ROWS = 300, WATCH_MS = 700;
const batch = { name: null, rows: new Map(), places: 0, timer: null };

async function startBatch(file) {
  sayAboutBatch(`Reading ${file.name} …`);
  try {
    const { batch: name } = await send("/api/batches/new", { query: { intersection: find("batch-place").value }, body: file });
    await listBatches(name);
  } catch (error) { sayAboutBatch(error.message, true); }
}
function sayAboutBatch(words, bad = false) {
  find("batch-said").textContent = words;
  find("batch-said").classList.toggle("bad", bad);
}
async function listBatches(chosen = null) {
  const { batches } = await ask("/api/batches");
  find("batch-name").replaceChildren(make("option", { value: "", textContent: "–" }), ...batches.map((name) => make("option", { value: name, textContent: name })));
  if (chosen !== null) find("batch-name").value = chosen;
  await openBatch(find("batch-name").value);
}
async function openBatch(name) {
  clearTimeout(batch.timer);
  Object.assign(batch, { name: name || null, rows: new Map(), places: 0 });
  find("batch-player").replaceChildren();
  find("batch-work").hidden = batch.name === null;
  if (batch.name !== null) await watchBatch();
}
async function watchBatch() {
  const name = batch.name;
  try {
    const state = await ask(`/api/batches/${encodeURIComponent(name)}`, { query: { after: batch.places } });
    if (name !== batch.name) return;
    for (const row of state.scenes) batch.rows.set(row.number, row);
    batch.places += state.scenes.length;
    showProgress(state);
    showRows();
    if (state.running || state.scenes.length) batch.timer = setTimeout(watchBatch, WATCH_MS);
  } catch (error) { sayAboutBatch(error.message, true); }
}
function showProgress({ rows, done, running, error }) {
  const counts = ["made", "refused", "failed"].map((status) => [status, [...batch.rows.values()].filter((each) => each.status === status).length]);
  const told = counts.filter(([, count]) => count).map(([status, count]) => `${count} ${status}`).join(", ");
  find("batch-progress").max = rows;
  find("batch-progress").value = done;
  find("batch-stop").disabled = !running;
  find("batch-go").disabled = running || done >= rows;
  sayAboutBatch(error || `${done} of ${rows} rows${told ? `: ${told}` : ""}${running ? "" : done < rows ? "; stopped" : "; done"}`, Boolean(error));
}
/** Whether a row passes the filters: status or event, words, and a figure of one of its events between two numbers. */
function passes(row) {
  const kind = find("batch-event").value, words = find("batch-words").value.trim().toLowerCase(), figure = find("batch-figure").value;
  if (words && !`${row.id} ${row.text} ${row.reason ?? ""}`.toLowerCase().includes(words)) return false;
  if (["made", "refused", "failed"].includes(kind) ? row.status !== kind : kind && !row.events.some((each) => each.type === kind)) return false;
  if (!figure) return true;
  const low = Number(find("batch-least").value || -Infinity), high = Number(find("batch-most").value || Infinity);
  return row.events.some(({ figures }) => figure in figures && figures[figure] >= low && figures[figure] <= high);
}
function showRows() {
  const found = [...batch.rows.values()].filter(passes).sort((a, b) => a.number - b.number);
  find("batch-count").textContent = `${found.length} of ${batch.rows.size} rows${found.length > SHOWN_ROWS ? `, the first ${SHOWN_ROWS} shown` : ""}`;
  find("batch-rows").tBodies[0].replaceChildren(...found.slice(0, SHOWN_ROWS).map(showRow));
}
function showRow(row) {
  const words = row.events.map((each) => [each.type.replaceAll("_", " "), ...Object.entries(each.figures).filter(([key]) => key in FIGURE_NAMES)
    .map(([key, value]) => `${FIGURE_NAMES[key].replace(/ \[.*/, "")} ${Number(value.toFixed(2))}`)].join(", ")).join("; ");
  const open = make("button", { type: "button", textContent: row.id, disabled: row.status !== "made" });
  open.addEventListener("click", () => openScene(row));
  return make("tr", {}, make("td", {}, open), make("td", { textContent: row.text }), make("td", { className: row.status !== "made" ? "bad" : row.caveat ? "amber" : "good", textContent: row.verdict ?? row.status }),
    make("td", { textContent: words || row.reason || "" }));
}
function openScene(row) {
  const src = address(`/api/batches/${encodeURIComponent(batch.name)}/${row.place}/page.html`);
  find("batch-player").replaceChildren(make("h2", { textContent: row.id }), make("iframe", { title: `Scene ${row.id}`, src }));
  find("batch-player").scrollIntoView({ block: "start" });
}
async function steerBatch(action) {
  try {
    await send(`/api/batches/${encodeURIComponent(batch.name)}/${action}`, { body: "" });
    clearTimeout(batch.timer);
    await watchBatch();
  } catch (error) { sayAboutBatch(error.message, true); }
}
function listenToBatches() {
  listenToDrop(find("batch-drop"), find("batch-file"), startBatch);
  find("batch-name").addEventListener("change", (event) => openBatch(event.target.value));
  find("batch-figure").append(...Object.entries(FIGURE_NAMES).map(([value, textContent]) => make("option", { value, textContent })));
  for (const id of ["batch-event", "batch-words", "batch-figure", "batch-least", "batch-most"]) find(id).addEventListener("input", showRows);
  find("batch-stop").addEventListener("click", () => steerBatch("stop"));
  find("batch-go").addEventListener("click", () => steerBatch("go"));
}
