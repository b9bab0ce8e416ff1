"use strict";
// How a scene came about: the stages of the run as a picture, with retries, and what was refused and why.
const STAGES = ["scene_planner", "agent_generator", "waypoint_filter", "event_reasoner", "trajectory_refiner", "scene_verifier"];
const NODE = { width: 128, height: 46, gap: 26, top: 64 };

function draw(tag, attributes, words = null) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  if (words !== null) element.textContent = words;
  return element;
}
const describeStage = (stage) => stage.replaceAll("_", " ");
const nodeLeft = (stage) => 4 + STAGES.indexOf(stage) * (NODE.width + NODE.gap);
const nodeMiddle = (stage) => nodeLeft(stage) + NODE.width / 2;

/** Where each refusal led back to: [from, to] -> how often (graph/routes.py decides; this only counts). */
function countRetries(made) {
  const counts = new Map();
  let gentler = made.refinement?.retries ?? 0;
  for (const { stage } of made.rejections ?? []) {
    const refinesLess = stage === "scene_verifier" && gentler > 0;
    if (refinesLess) gentler -= 1;
    const to = stage === "scene_planner" ? stage : refinesLess ? "trajectory_refiner" : "agent_generator";
    const key = `${stage}>${to}`;
    counts.set(key, (counts.get(key) ?? 0) + 1);
  }
  return counts;
}
function drawRun(made) {
  const width = nodeLeft(STAGES.at(-1)) + NODE.width + 4, retries = countRetries(made);
  const picture = draw("svg", { viewBox: `0 ${retries.size ? 0 : 56} ${width} ${retries.size ? 124 : 68}`, role: "img", class: "run" });
  picture.setAttribute("aria-label", `Run of six stages with ${(made.rejections ?? []).length} refusals`);
  for (const stage of STAGES) drawStage(picture, stage, made);
  STAGES.slice(1).forEach((stage, n) => {
    const y = NODE.top + NODE.height / 2, from = nodeLeft(STAGES[n]) + NODE.width, to = nodeLeft(stage);
    picture.append(draw("path", { class: "flow", d: `M ${from} ${y} L ${to} ${y} m -6 -4 l 6 4 l -6 4` }));
  });
  [...retries].forEach(([key, count], n) => drawRetry(picture, ...key.split(">"), count, 12 + 9 * (n % 4)));
  return picture;
}
function drawStage(picture, stage, made) {
  const x = nodeLeft(stage), refusals = (made.rejections ?? []).filter((each) => each.stage === stage).length;
  const seconds = made.seconds?.[stage];
  const below = [seconds === undefined ? "" : `${seconds.toFixed(2)} s`, refusals ? `${refusals} refused` : ""].filter(Boolean).join(" · ");
  picture.append(
    draw("rect", { x, y: NODE.top, width: NODE.width, height: NODE.height, rx: 7, class: refusals ? "stage refusing" : "stage" }),
    draw("text", { x: nodeMiddle(stage), y: NODE.top + 20, "text-anchor": "middle" }, describeStage(stage)),
    draw("text", { x: nodeMiddle(stage), y: NODE.top + 37, "text-anchor": "middle", class: "soft" }, below),
  );
}
function drawRetry(picture, from, to, count, y) {
  const [x1, x2] = [nodeMiddle(from) + 10, nodeMiddle(to) - (from === to ? 14 : 10)];
  picture.append(
    draw("path", { class: "retry", d: `M ${x1} ${NODE.top} C ${x1} ${y}, ${x2} ${y}, ${x2} ${NODE.top} m -4 -6 l 4 6 l 4 -6` }),
    draw("text", { x: (x1 + x2) / 2, y: y + 8, "text-anchor": "middle", class: "soft" }, `${count} ×`),
  );
}
function describeMaking(made) {
  const refused = (made.rejections ?? []).map((each, n) => make("li", { textContent: `${n + 1}. ${describeStage(each.stage)}: ${each.detail}` }));
  const facts = [`backend ${typeof made.backend === "string" ? made.backend : JSON.stringify(made.backend ?? "")}`, `seed ${made.seed ?? "–"}`,
    made.patterns?.length ? `played as ${made.patterns.join(", ").replaceAll("_", " ")}` : ""].filter(Boolean).join(" · ");
  return make("div", {}, drawRun(made), make("p", { className: "quiet", textContent: facts }),
    ...(refused.length ? [make("h3", { textContent: "Refused on the way" }), make("ol", { className: "plain" }, ...refused)]
      : [make("p", { className: "quiet", textContent: "Nothing was refused on the way." })]));
}
