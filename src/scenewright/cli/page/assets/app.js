"use strict";
// The page around the player: conversation, versions, places. All text is set as text, never as markup.
const find = (id) => document.getElementById(id);
const token = new URLSearchParams(location.search).get("token") ?? "";
const app = { thread: null, state: null, busy: false, place: null, places: [], handles: [], words: [] };
const MOST_COMPLETIONS = 6;

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}
function address(path, query = {}) {
  return `${path}?${new URLSearchParams({ ...query, token })}`;
}
async function ask(path, { query = {}, body = null } = {}) {
  const options = { headers: { "x-token": token } };
  if (body !== null) Object.assign(options, { method: "POST", body: JSON.stringify(body) });
  const answer = await fetch(`${path}?${new URLSearchParams(query)}`, options);
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.reason);
  return value;
}
/** A request whose body is a file or plain text. */
async function send(path, { query = {}, body }) {
  const answer = await fetch(`${path}?${new URLSearchParams(query)}`, { method: "POST", headers: { "x-token": token }, body });
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.reason);
  return value;
}
const threadPath = (rest = "") => `/api/threads/${encodeURIComponent(app.thread)}${rest}`;

// ---- the log ------------------------------------------------------------------------------------
function addToLog(element) {
  find("log").append(element);
  element.scrollIntoView({ block: "end" });
}
function logWords(words) {
  addToLog(make("div", { className: "said", textContent: words }));
}
function logReply({ kind, lines, why = [], caveat = "" }) {
  const box = make("div", { className: `answer ${kind}${caveat ? " partly" : ""}` }, ...lines.map((line) => make("p", { textContent: line })));
  if (why.length) box.append(make("details", {}, make("summary", { textContent: "Why" }), ...why.map((line) => make("p", { textContent: line }))));
  addToLog(box);
}
function logFault(error) {
  logReply({ kind: "refused", lines: [error.message === "Failed to fetch" ? "The server does not answer; is `scenewright serve` still running?" : error.message] });
}
function offerChoices(choices) {
  find("choices").replaceChildren(...choices.map(({ label, action, argument }) => {
    const button = make("button", { type: "button", textContent: label });
    button.addEventListener("click", () => takeTurn(action, argument, label));
    return button;
  }));
  find("log").lastElementChild?.scrollIntoView({ block: "end" });
}

// ---- turns --------------------------------------------------------------------------------------
function setBusy(busy) {
  app.busy = busy;
  for (const id of ["send", "anew", "new", "save"]) find(id).disabled = busy;
  const none = !app.state?.versions?.length, changes = (app.state?.current ?? null) !== null;
  find("anew").hidden = !changes;
  find("send").textContent = changes ? "Change this scene" : "Make the scene";
  find("ask-words").textContent = changes ? "What shall be different? Or say a new scene." : "What shall happen?";
  find("words").placeholder = changes ? "Make it night" : "A van cuts off a cyclist at 8 am";
  find("save").disabled = busy || none;
  for (const id of ["undo", "redo", "branch", "by-hand", "making"]) find(id).disabled = none || (busy && !["by-hand", "making"].includes(id));
  for (const field of find("hand").querySelectorAll("input, select")) field.disabled = busy || field.dataset.never === "";
  if (!busy) find("progress").textContent = "";
}
async function takeTurn(action, argument = "", said = argument) {
  if (app.busy) return;
  setBusy(true);
  offerChoices([]);
  if (["say", "say_without", "make", "make_without", "plan"].includes(action)) logWords(said);
  try {
    if (app.thread === null) await createThread();
    const reply = await readTurn(action, argument);
    logReply(reply);
    offerChoices(reply.choices ?? []);
    await refresh();
  } catch (error) {
    logFault(error);
  } finally {
    setBusy(false);
    find("words").focus();
  }
}
async function readTurn(action, argument) {
  const answer = await fetch(threadPath("/turn"), { method: "POST", headers: { "x-token": token }, body: JSON.stringify({ action, argument }) });
  if (!answer.ok) throw new Error((await answer.json()).reason);
  const reader = answer.body.getReader(), decoder = new TextDecoder();
  let rest = "", reply = null;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    const lines = (rest + decoder.decode(value, { stream: true })).split("\n");
    rest = lines.pop();
    for (const line of lines.map((each) => JSON.parse(each))) {
      if (line.reply) reply = line.reply;
      else find("progress").textContent = `${line.stage.replaceAll("_", " ")}: ${line.line}`;
    }
  }
  if (reply === null) throw new Error("The server stopped in the middle of the turn; the scene is as it was.");
  return reply;
}

// ---- threads and versions -------------------------------------------------------------------------
async function createThread() {
  const made = await ask("/api/threads", { body: { intersection: app.place } });
  app.thread = made.thread;
  addThread(made.thread);
}
function addThread(name) {
  if (![...find("thread").options].some((each) => each.value === name)) find("thread").append(make("option", { value: name, textContent: name }));
  find("thread").value = name;
}
async function openThread(name) {
  app.thread = name || null;
  find("log").replaceChildren();
  offerChoices([]);
  await refresh();
  const turns = app.thread === null ? [] : (await ask(threadPath("/log"))).turns;
  for (const turn of turns) {
    if (turn.words) logWords(turn.words);
    logReply(turn);
  }
  offerChoices(turns.at(-1)?.choices ?? []);
  if (app.state?.interrupted) logReply({ kind: "nothing", lines: [`The last turn was cut short and left nothing behind: ${app.state.interrupted}`] });
  if (app.state?.busy) waitUntilFree();
}
async function waitUntilFree() {
  setBusy(true);
  find("progress").textContent = "A turn is still being worked on …";
  while (app.state?.busy) {
    await new Promise((done) => setTimeout(done, 500));
    await refresh();
  }
  setBusy(false);
}
async function refresh(shown = null) {
  app.state = app.thread === null ? null : await ask(threadPath());
  setBusy(app.busy);
  history.replaceState(null, "", address("/", app.thread ? { thread: app.thread } : {}));
  const versions = app.state?.versions ?? [], current = shown ?? app.state?.current ?? null;
  fillVersions(find("version"), versions, current, null);
  fillVersions(find("against"), versions, null, "–");
  drawTree(versions, current);
  showVersion(current);
  form.words = null;
  await followWords();
}
function fillVersions(select, versions, chosen, none) {
  const options = versions.map((each) => make("option", { value: String(each.number), textContent: `${each.number}: ${each.words.slice(0, 40)}` }));
  select.replaceChildren(...(none ? [make("option", { value: "", textContent: none })] : []), ...options);
  if (chosen !== null) select.value = String(chosen);
}
async function showVersion(number, against = "") {
  const shown = number !== null, overlaid = against !== "" && find("overlay").checked;
  const versions = shown ? [number, overlaid ? "" : against].filter((each) => each !== "") : [];
  find("start").hidden = shown;
  const frames = versions.map((version) => make("iframe", {
    title: `Version ${version}${overlaid ? ` with version ${against} over it` : ""}`, src: address(threadPath("/page.html"), { version, ...(overlaid ? { over: against } : {}) }),
  }));
  const before = [...find("players").children].map((each) => each.src).join();
  if (frames.map((each) => each.src).join() !== before) find("players").replaceChildren(...frames); // a scene that plays is not begun anew
  find("made").hidden = true;
  find("making").setAttribute("aria-expanded", "false");
  offerHandles().catch(logFault);
  find("differences").hidden = against === "";
  if (against === "") return;
  try {
    const { lines } = await ask(threadPath("/compare"), { query: { first: number, second: against } });
    find("differences").replaceChildren(...lines.map((line) => make("li", { textContent: line.trim() })));
  } catch (error) { logFault(error); }
}
/** Versions from left to right, a branch below what it grew from. */
function drawTree(versions, current) {
  const tree = find("tree"), rows = new Map(), column = new Map();
  tree.replaceChildren();
  let most = 0;
  versions.forEach((version, n) => {
    const taken = versions.slice(0, n).some((each) => each.parent === version.parent && version.parent !== null);
    const row = version.parent === null ? 0 : rows.get(version.parent) + (taken ? 1 : 0);
    rows.set(version.number, row);
    column.set(version.number, n);
    most = Math.max(most, row);
  });
  const at = (number) => [18 + 34 * column.get(number), 16 + 28 * rows.get(number)];
  tree.style.height = `${32 + 28 * most}px`;
  for (const { number, parent } of versions) if (parent !== null && column.has(parent)) {
    const [x1, y1] = at(parent), [x2, y2] = at(number);
    tree.append(draw("line", { x1, y1, x2, y2 }));
  }
  for (const { number, words } of versions) {
    const [cx, cy] = at(number), text = draw("text", { x: cx, y: cy + 4, "text-anchor": "middle" }), title = draw("title", {});
    text.textContent = String(number);
    title.textContent = words;
    const node = draw("g", { class: `node${number === current ? " current" : ""}` });
    node.append(title, draw("circle", { cx, cy, r: 12 }), text);
    node.addEventListener("click", () => chooseVersion(number));
    tree.append(node);
  }
}
function chooseVersion(number) {
  find("version").value = String(number);
  find("against").value = "";
  drawTree(app.state.versions, number);
  showVersion(number);
}
/** One of the files of the version that is shown, as a download; what hinders it goes to the log. */
async function saveAs(choice) {
  const [name, format = ""] = choice.split(":"), version = find("version").value;
  find("save").value = "";
  find("progress").textContent = `Writing ${format || name} …`;
  try {
    const answer = await fetch(`${threadPath(`/${name}`)}?${new URLSearchParams({ version, format })}`, { headers: { "x-token": token } });
    if (!answer.ok) throw new Error((await answer.json()).reason);
    const link = make("a", { href: URL.createObjectURL(await answer.blob()), download: format ? `${app.thread}-${version}-${format}.zip` : `${app.thread}-${version}-${name}` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  } catch (error) { logFault(error); }
  find("progress").textContent = "";
}
/** Words that may go on from what stands before the cursor: road users, events, and places of the map. */
function complete() {
  const field = find("words"), before = field.value.slice(0, field.selectionStart), place = app.places.find((each) => each.name === (app.state?.setting.intersection ?? app.place));
  const known = [...(place?.words ?? []), ...app.words];
  const spoken = before.split(/\s/);
  let found = [], typed = "";
  for (let n = Math.max(spoken.length - 5, 0); n < spoken.length && !found.length; n += 1) {
    typed = spoken.slice(n).join(" ");
    if (typed.length >= 2) found = known.filter((each) => each.toLowerCase().startsWith(typed.toLowerCase()) && each.length > typed.length);
  }
  find("completions").replaceChildren(...found.slice(0, MOST_COMPLETIONS).map((word) => {
    const button = make("button", { type: "button", textContent: word });
    button.addEventListener("click", () => {
      field.setRangeText(`${word} `, field.selectionStart - typed.length, field.selectionStart, "end");
      field.focus();
      complete();
    });
    return button;
  }));
}
async function toggleMaking() {
  const box = find("made"), open = box.hidden;
  find("making").setAttribute("aria-expanded", String(open));
  box.hidden = !open;
  if (!open) return;
  try {
    const made = await ask(threadPath("/made"), { query: { version: find("version").value } });
    box.replaceChildren(describeMaking(made));
  } catch (error) { logFault(error); }
}
// ---- tabs and settings ----------------------------------------------------------------------------
function showTab(name) {
  for (const tab of document.querySelectorAll('[role="tab"]')) {
    const chosen = tab.dataset.tab === name;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    find(tab.dataset.tab).hidden = !chosen;
  }
  if (name === "batch") listBatches(batch.name).catch((error) => sayAboutBatch(error.message, true));
}
function listenToTabs() {
  const tabs = [...document.querySelectorAll('[role="tab"]')];
  tabs.forEach((tab, n) => {
    tab.addEventListener("click", () => showTab(tab.dataset.tab));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = tabs[(n + step + tabs.length) % tabs.length];
      next.focus();
      showTab(next.dataset.tab);
    });
  });
}
function showSettings({ backend, keys }) {
  find("backend").textContent = `backend: ${backend}`;
  find("backend-name").value = backend;
  find("keys").replaceChildren(...Object.entries(keys).map(([name, there]) => make("li", { textContent: `${name}: ${there ? "set in the environment" : "not set"}` })));
}
async function openSettings() {
  find("settings-said").textContent = "";
  try { showSettings(await ask("/api/settings")); } catch (error) { find("settings-said").textContent = error.message; }
  find("settings").showModal();
}
async function chooseBackend() {
  try {
    showSettings(await ask("/api/settings/backend", { body: { backend: find("backend-name").value.trim(), base_url: find("base-url").value.trim() } }));
    find("settings").close();
  } catch (error) { find("settings-said").textContent = error.message; }
}
function showExamples() {
  const { examples = [] } = app.places.find((each) => each.name === app.place) ?? {};
  find("examples").replaceChildren(...examples.map((text) => {
    const button = make("button", { type: "button", textContent: text });
    button.addEventListener("click", () => takeTurn("say", text));
    return make("li", {}, button);
  }));
}
function chooseTheme(dark) {
  document.documentElement.classList.toggle("dark", dark);
  find("theme").setAttribute("aria-pressed", String(dark));
  tellPlayer();
}

function sendWords(action) {
  const words = find("words").value.trim();
  if (app.busy) return;
  if (!words && action === "make") { find("new").click(); return; }
  if (!words) return;
  const plan = takePlan(words);
  find("words").value = "";
  complete();
  if (plan) takeTurn("plan", JSON.stringify(plan), words);
  else takeTurn(action, words);
}
function listen() {
  find("form").addEventListener("submit", (event) => {
    event.preventDefault();
    sendWords("say");
  });
  find("anew").addEventListener("click", () => sendWords("make"));
  find("words").addEventListener("input", complete);
  find("save").addEventListener("change", (event) => { if (event.target.value) saveAs(event.target.value); });
  find("words").addEventListener("keydown", (event) => {
    if (event.key === "Enter" && !event.shiftKey) { event.preventDefault(); find("form").requestSubmit(); }
  });
  find("undo").addEventListener("click", () => takeTurn("undo"));
  find("redo").addEventListener("click", () => takeTurn("redo"));
  find("branch").addEventListener("click", () => { find("name").value = ""; find("ask").showModal(); });
  find("ask").addEventListener("close", () => { if (find("ask").returnValue === "ok") takeTurn("branch", find("name").value); });
  find("new").addEventListener("click", () => { find("thread").value = ""; openThread(null).catch(logFault); });
  find("thread").addEventListener("change", (event) => openThread(event.target.value).catch(logFault));
  find("version").addEventListener("change", (event) => chooseVersion(Number(event.target.value)));
  find("against").addEventListener("change", (event) => showVersion(find("version").value, event.target.value));
  find("overlay").addEventListener("change", () => showVersion(find("version").value, find("against").value));
  find("making").addEventListener("click", toggleMaking);
  find("by-hand").addEventListener("click", () => toggleHand().catch(logFault));
  find("open-settings").addEventListener("click", openSettings);
  find("settings-form").addEventListener("submit", (event) => { event.preventDefault(); chooseBackend(); });
  find("settings-close").addEventListener("click", () => find("settings").close());
  listenToTabs();
  listenToPlaces();
  listenToBatches();
  listenToPlayers();
  listenToPlan();
  find("theme").addEventListener("click", () => chooseTheme(!document.documentElement.classList.contains("dark")));
}
async function start() {
  chooseTheme(window.matchMedia("(prefers-color-scheme: dark)").matches);
  listen();
  try {
    const facts = await ask("/api/start");
    find("backend").textContent = `backend: ${facts.backend}`;
    find("thread").append(make("option", { value: "", textContent: "new" }), ...facts.threads.map((name) => make("option", { value: name, textContent: name })));
    app.words = facts.words;
    for (const [name, title] of Object.entries(facts.formats)) find("save").append(make("option", { value: `export.zip:${name}`, textContent: `${name}: ${title}` }));
    showPlaces(facts.intersections, facts.intersection);
    if (facts.missing) sayAboutMap(facts.missing);
    const wanted = new URLSearchParams(location.search).get("thread");
    if (wanted && facts.threads.includes(wanted)) addThread(wanted);
    await openThread(find("thread").value);
  } catch (error) { logFault(error); }
  find("words").focus();
}
start();
