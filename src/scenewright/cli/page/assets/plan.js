"use strict";
// The plan of the words as a form, made from the JSON Schema of plan files: one follows the other.
const form = { open: false, plan: null, words: null, schema: null, timer: 0, asked: 0 };
const SECTIONS = { agents: "Who takes part", relations: "What happens", objects: "What stands there", measures: "Figures", ties: "Where they come from" };
const NEW = {
  agents: (plan) => ({ id: nameNext(plan.agents, "vehicle") }),
  relations: (plan) => ({ type: "near_miss", from: plan.agents?.[0]?.id ?? "", to: plan.agents?.[1]?.id ?? "" }),
  objects: (plan) => ({ id: nameNext(plan.objects, "object"), kind: "parked" }),
  measures: (plan) => ({ kind: "speed", agent: plan.agents?.[0]?.id ?? "", value: "30 km/h" }),
  ties: (plan) => ({ agent: plan.agents?.[0]?.id ?? "", of: plan.agents?.[1]?.id ?? "", side: "opposite" }),
};
const SPOKEN = { collide_at: "collision", yield_to: "giving way" };
const spell = (name) => SPOKEN[name] ?? name.replaceAll("_", " ");

function nameNext(list, kind) {
  for (let n = 1; ; n += 1) if (!(list ?? []).some((each) => each.id === `${kind}-${n}`)) return `${kind}-${n}`;
}
async function togglePlan() {
  form.open = find("plan").hidden;
  find("plan").hidden = !form.open;
  find("as-form").setAttribute("aria-expanded", String(form.open));
  if (!form.open) return;
  form.schema ??= await ask("/api/plan/schema");
  await followWords();
}
/** The form of what is typed, else of the scene that is shown. */
async function followWords() {
  const words = find("words").value.trim(), number = (form.asked += 1);
  if (!form.open || (words !== "" && words === form.words)) return;
  const shown = app.state?.current ?? null, body = { intersection: app.state?.setting.intersection ?? app.place };
  if (words === "" && shown === null) { showPlan({ plan: { agents: [] }, words: null }); return; }
  await describePlan(number, words === "" ? { thread: app.thread } : { ...body, words });
}
/** The words of a form that was changed. */
async function followForm(plan) {
  form.plan = plan;
  clearTimeout(form.timer); // words typed before count no more
  const number = (form.asked += 1);
  await describePlan(number, { intersection: app.state?.setting.intersection ?? app.place, plan });
}
async function describePlan(number, body) {
  try {
    const found = await ask("/api/plan", { body });
    if (number !== form.asked) return; // something was changed meanwhile
    if (body.plan) find("words").value = found.words;
    showPlan({ plan: body.plan ?? found.plan, words: found.words });
  } catch (error) {
    if (number === form.asked) sayAboutPlan(error.message, Boolean(body.plan));
  }
}
function sayAboutPlan(message, changed) {
  const [, path = ""] = /^plan, ([\w.[\]]+):/.exec(message) ?? [];
  for (const field of find("plan-fields").querySelectorAll("[data-path]")) field.toggleAttribute("aria-invalid", field.dataset.path === path);
  find("plan-said").textContent = message.replace(/^plan, /, "");
  if (changed) form.words = null; // the words stay as they were, and are not those of the form
}
function showPlan({ plan, words }) {
  const held = document.activeElement?.dataset?.path;
  Object.assign(form, { plan, words });
  find("plan-said").textContent = "";
  find("plan-fields").replaceChildren(...Object.keys(SECTIONS).map(showSection), showContext());
  if (held) find("plan-fields").querySelector(`[data-path="${held}"]`)?.focus();
}
function getModel(section) {
  const own = form.schema.properties[section], name = (own.items?.$ref ?? own.$ref).split("/").at(-1);
  return form.schema.$defs[name].properties;
}
function showSection(section) {
  const entries = form.plan[section] ?? [];
  const add = make("button", { type: "button", textContent: "Add" });
  add.setAttribute("aria-label", `Add to: ${SECTIONS[section]}`);
  add.addEventListener("click", () => changePlan((plan) => { plan[section] = [...(plan[section] ?? []), NEW[section](plan)]; }));
  return make("fieldset", {}, make("legend", { textContent: SECTIONS[section] }),
    ...entries.map((entry, n) => showEntry(entry, getModel(section), [section, n], (plan) => { plan[section].splice(n, 1); })), add);
}
function showContext() {
  const context = form.plan.context ?? {}, { background, ...own } = getModel("context");
  const counts = form.schema.$defs.Background.properties;
  return make("fieldset", {}, make("legend", { textContent: "When, and who else" }), showEntry(context, own, ["context"]),
    showEntry(context.background ?? {}, counts, ["context", "background"]));
}
/** The fields that are set, and a list of those that can be. */
function showEntry(entry, model, path, remove = null) {
  const simple = Object.keys(model).filter((name) => !["others"].includes(name) && !(name === "type" && path[0] === "agents"));
  const box = make("div", { className: "entry" }, ...simple.filter((name) => entry[name] !== undefined && entry[name] !== null && entry[name] !== false).map((name) => showField(name, entry[name], model[name], [...path, name])));
  if (Array.isArray(entry.others)) box.append(make("span", { className: "quiet", textContent: `met by ${entry.others.map((each) => each.agent).join(", ")} too` }));
  const free = simple.filter((name) => entry[name] === undefined || entry[name] === null || entry[name] === false);
  const more = make("select", {}, make("option", { value: "", textContent: "more …" }), ...free.map((name) => make("option", { value: name, textContent: spell(name) })));
  more.setAttribute("aria-label", `Set more of ${path.join(" ")}`);
  more.addEventListener("change", () => { if (more.value) addField(more, model[more.value], [...path, more.value]); });
  box.append(more);
  if (remove) {
    const button = make("button", { type: "button", textContent: "Remove" });
    button.setAttribute("aria-label", `Remove ${entry.id ?? path.join(" ")}`);
    button.addEventListener("click", () => changePlan(remove));
    box.append(button);
  }
  return box;
}
function addField(more, schema, path) {
  const field = showField(path.at(-1), "", schema, path);
  more.before(field);
  more.value = "";
  field.querySelector("input, select").focus();
}
function listChoices(schema) {
  const parts = [schema, ...(schema.anyOf ?? []).flatMap((each) => [each, ...(each.anyOf ?? [])])];
  return { values: parts.find((each) => each.enum)?.enum ?? null, boolean: parts.some((each) => each.type === "boolean"), agent: parts.some((each) => /^\^\((vehicle|pedestrian)/.test(each.pattern ?? "")), list: parts.some((each) => each.type === "array" && each.items) };
}
function showField(name, value, schema, path) {
  const { values, boolean, agent, list } = listChoices(schema), own = name === "id";
  const names = agent && !own ? (form.plan.agents ?? []).map((each) => each.id) : values;
  let field;
  if (boolean) field = make("input", { type: "checkbox", checked: value === true || value === "" });
  else if (names) field = make("select", {}, ...["", ...names].map((each) => make("option", { value: each, textContent: each === "" ? "–" : spell(each), selected: each === value })));
  else field = make("input", { type: "text", value: showValue(value, schema), size: 12, placeholder: schema.unit ? `in ${schema.unit}` : "" });
  field.dataset.path = path.reduce((text, step) => (typeof step === "number" ? `${text}[${step}]` : `${text}${text ? "." : ""}${step}`), "");
  field.title = schema.description ?? "";
  field.setAttribute("aria-label", `${spell(name)} of ${path.slice(0, -1).join(" ")}`);
  field.addEventListener("change", () => changePlan((plan) => setValue(plan, path, boolean ? field.checked : readValue(field.value, { names, list }))));
  if (boolean && value === "") changePlan((plan) => setValue(plan, path, true));
  return make("label", {}, spell(name), field);
}
function showValue(value, schema) {
  if (Array.isArray(value)) return value.join(" .. ");
  const number = typeof value === "number" ? Number(value.toPrecision(6)) : value;
  return typeof value === "number" && schema.unit ? `${number} ${schema.unit}` : String(number);
}
function readValue(text, { names, list }) {
  if (text.trim() === "") return undefined;
  if (list && !names) return text.split("..").map((each) => each.trim());
  return !names && /^-?\d+$/.test(text.trim()) ? Number(text) : text.trim();
}
function setValue(plan, path, value) {
  let target = plan;
  for (const step of path.slice(0, -1)) target = target[step] ??= {};
  if (value === undefined || value === false) delete target[path.at(-1)];
  else target[path.at(-1)] = value;
}
function changePlan(change) {
  const plan = structuredClone(form.plan);
  change(plan);
  delete plan.read_as; // from now on the fields count, not the words
  showPlan({ plan, words: form.words });
  followForm(plan);
}
/** The form's plan, if the words are still those of the form; null if they were typed. */
function takePlan(words) {
  return form.open && form.plan && form.words === words && form.plan.read_as === undefined ? form.plan : null;
}
function listenToPlan() {
  find("as-form").addEventListener("click", () => togglePlan().catch(logFault));
  find("words").addEventListener("input", () => { clearTimeout(form.timer); form.timer = setTimeout(() => followWords().catch(logFault), 500); });
}
