"use strict";
// Plays one scene. All text from the data is set as text, never as markup.
const data = JSON.parse(document.getElementById("scene-data").textContent);
const find = (id) => document.getElementById(id);
const STEP = data.meta.step, END = data.meta.duration;
const STATUS = { keep: "#6C8EBF", stop: "#C1272D", proceed: "#3A9D6B", terminate: "#4A4A4A" };
const LIGHT = { green: "#19A974", yellow: "#F2B705", red: "#DB2B39" };
const EVENT = { collision: "collides with", near_miss: "has a near miss with", yielding: "yields to", follow: "follows" };
const LABEL_FONT = "600 12px system-ui, sans-serif";
const LABEL_STEPS = [0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5], LABEL_HEIGHT = 17, LEG_SIDES = [0, 8, -8, 10, -10, 12, -12, 14, -14, 17, -17, 20, -20, 24, -24, 30, -30];
const LEADER_PIXELS = 24, MARK_SECONDS = 2.5, LEAD_SECONDS = 2, OPENING_SECONDS = 5, BRAKING = 1.0, FURTHEST_TTC = 8;
const agents = new Map(data.agents.map((each) => [each.id, each]));
const state = { time: 0, playing: false, rate: 1, event: null, view: null, last: null, pointed: null, handles: [], drag: null, boxes: [], offsets: new Map(), hovered: null, followed: null };

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}
const UNASKED = data.proof?.figures.unasked_red_light_runs ?? [];
const describeRun = ({ agent, time }) => `${formatSeconds(time)}: ${describeAgent(agent)} runs a red light, which was not asked for`;
const describeAgent = (id) => (agents.has(id) ? agents.get(id).called : id === null ? "" : `agent ${id}`);
const formatNumber = (value) => (Math.abs(value) < 0.05 ? 0 : value).toFixed(1);
/** With the name that edits know, and what it is. */
function describeFully({ called, name, subtype, type }) {
  const noun = (subtype ?? type).replaceAll("_", " ");
  return [...new Set([called, ...(`${called} ${name}`.includes(noun) ? [] : [noun]), name])].join(" · ");
}
const formatSeconds = (value) => `${value.toFixed(1)} s`;
const formatSpeed = (value) => `${Math.round(3.6 * value)} km/h`;
const readVariable = (name, element = canvas) => getComputedStyle(element).getPropertyValue(name).trim();

// ---- samples -------------------------------------------------------------------------------
/** Where an agent is at a time: {x, y, heading, speed}; null where it is not in the scene. */
function sampleAgent(agent, time) {
  const at = (time - agent.start) / STEP, last = agent.xy.length - 1;
  if (at < -1e-6 || (at > last + 1e-6 && !agent.stays)) return null;
  const i = Math.min(Math.max(Math.floor(at), 0), last), j = Math.min(i + 1, last);
  const share = Math.min(Math.max(at - i, 0), 1), mix = (a, b) => a + (b - a) * share;
  const turn = Math.atan2(Math.sin(agent.heading[j] - agent.heading[i]), Math.cos(agent.heading[j] - agent.heading[i]));
  return {
    x: mix(agent.xy[i][0], agent.xy[j][0]), y: mix(agent.xy[i][1], agent.xy[j][1]),
    heading: agent.heading[i] + turn * share, speed: at > last ? 0 : mix(agent.speed[i], agent.speed[j]),
  };
}
const endOf = (agent) => agent.start + STEP * (agent.xy.length - 1);

function outline(agent, sample) {
  const half = agent.length / 2, side = agent.width / 2;
  let shape;
  if (agent.type === "pedestrian") {
    shape = Array.from({ length: 20 }, (_, n) => [half * Math.cos(n * Math.PI / 10), side * Math.sin(n * Math.PI / 10)]);
  } else if (agent.type === "vehicle") {
    const nose = half - Math.min(0.4, half / 2);
    shape = [[-half, -side], [nose, -side], [half, -0.55 * side], [half, 0.55 * side], [nose, side], [-half, side]];
  } else {
    shape = [[-half, 0], [-0.2, -side], [0.3, -side], [half, 0], [0.3, side], [-0.2, side]];
  }
  const c = Math.cos(sample.heading), s = Math.sin(sample.heading);
  return shape.map(([u, v]) => [sample.x + u * c - v * s, sample.y + u * s + v * c]);
}

/** Least distance between two outlines [m]; 0 where they touch. */
function measureGap(a, b) {
  if (contains(a, b[0]) || contains(b, a[0])) return 0;
  let least = Infinity;
  for (const [p, q] of [[a, b], [b, a]])
    for (const point of p)
      for (let i = 0; i < q.length; i += 1) least = Math.min(least, distanceToSegment(point, q[i], q[(i + 1) % q.length]));
  return least;
}
function contains(ring, [x, y]) {
  let inside = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i, i += 1) {
    const [xi, yi] = ring[i], [xj, yj] = ring[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}
function distanceToSegment([x, y], [ax, ay], [bx, by]) {
  const dx = bx - ax, dy = by - ay, length = dx * dx + dy * dy || 1e-12;
  const share = Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / length, 0), 1);
  return Math.hypot(x - ax - share * dx, y - ay - share * dy);
}

// ---- the map and the agents on it --------------------------------------------------------------
const canvas = find("map"), pen = canvas.getContext("2d");
const reach = Math.max(data.view[1] - data.view[0], data.view[3] - data.view[2]);
const HOME = { x: (data.view[0] + data.view[1]) / 2, y: (data.view[2] + data.view[3]) / 2, reach };

function toPixels([x, y]) {
  const { view } = state, scale = Math.min(canvas.clientWidth, canvas.clientHeight) / view.reach;
  return [canvas.clientWidth / 2 + (x - view.x) * scale, canvas.clientHeight / 2 - (y - view.y) * scale];
}
const pixelsPerMetre = () => Math.min(canvas.clientWidth, canvas.clientHeight) / state.view.reach;

function trace(points, close) {
  points.forEach((point, n) => pen[n ? "lineTo" : "moveTo"](...toPixels(point)));
  if (close) pen.closePath();
}
function fillAreas(areas, colour, edge) {
  pen.beginPath();
  for (const rings of areas) for (const ring of rings) trace(ring, true);
  pen.fillStyle = colour;
  pen.fill("evenodd");
  if (edge) { pen.strokeStyle = edge; pen.lineWidth = 1; pen.stroke(); }
}
function strokeLines(lines, colour, width, dash = []) {
  pen.beginPath();
  for (const line of lines) trace(line, false);
  pen.setLineDash(dash);
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
  pen.setLineDash([]);
}

function drawMap() {
  const metre = pixelsPerMetre(), thin = Math.max(0.15 * metre, 0.8), paint = readVariable("--paint");
  pen.fillStyle = readVariable("--ground");
  pen.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  const kerb = readVariable("--kerb");
  for (const area of data.map.walkable) fillAreas([area], readVariable("--walk"), kerb);
  for (const area of data.map.road) fillAreas([area], readVariable("--asphalt"), kerb);
  fillAreas(data.map.bars.map((bar) => [bar]), paint, null);
  strokeLines(data.map.paint.divider, paint, thin, [2 * metre, 2 * metre]);
  strokeLines(data.map.paint.edge, paint, thin);
  strokeLines(data.map.paint.median, readVariable("--median"), 1.4 * thin);
  strokeLines(data.map.stopLines, paint, Math.max(0.5 * metre, 1));
}

function findLights(time) {
  const rows = data.signals.filter((row) => row.start <= time + 1e-6 && time + 1e-6 < row.end);
  return rows.map((row) => [row.stop_line ?? row.crosswalk, row.colour]);
}
function drawLights() {
  for (const [name, colour] of findLights(state.time))
    for (const place of data.map.lights[name] ?? []) {
      pen.beginPath();
      pen.arc(...toPixels(place), 5, 0, 2 * Math.PI);
      pen.fillStyle = LIGHT[colour];
      pen.fill();
      pen.strokeStyle = readVariable("--ink");
      pen.lineWidth = 1.2;
      pen.stroke();
    }
}

/** What stands in the scene, doors once they are open; what blocks the line of sight is dark. */
function drawObjects() {
  for (const { name, high, since, outline: ring } of data.objects) {
    if (state.time < since) continue;
    pen.beginPath();
    trace(ring, true);
    pen.fillStyle = readVariable(high ? "--soft" : "--kerb");
    pen.fill();
    pen.strokeStyle = readVariable("--soft");
    pen.lineWidth = 1.2;
    pen.stroke();
    const [x, y] = ring.reduce((sum, point) => [sum[0] + point[0] / ring.length, sum[1] + point[1] / ring.length], [0, 0]);
    writeLabel(name, [x, y], readVariable("--soft"));
  }
}

/** An agent of the other version that is laid over this one: its outline and its last seconds. */
function drawOther(agent) {
  const sample = sampleAgent(agent, state.time);
  if (sample === null) return;
  const from = Math.max(0, Math.ceil((state.time - 3 - agent.start) / STEP)), to = Math.min(agent.xy.length - 1, Math.floor((state.time - agent.start) / STEP));
  if (to > from) strokeLines([agent.xy.slice(from, to + 1)], readVariable("--ink"), 1.2, [2, 3]);
  pen.beginPath();
  if (agent.type === "pedestrian") pen.arc(...toPixels([sample.x, sample.y]), Math.max((agent.width / 2) * pixelsPerMetre(), 4.5), 0, 2 * Math.PI);
  else trace(outline(agent, sample), true);
  pen.setLineDash([4, 3]);
  pen.strokeStyle = readVariable("--ink");
  pen.lineWidth = 1.8;
  pen.stroke();
  pen.setLineDash([]);
  if (agent.role === "foreground") writeLabel(`${agent.called}, other version`, [sample.x, sample.y - agent.length / 2 - 14 / pixelsPerMetre()], readVariable("--soft"));
}
function drawTrail(agent) {
  const from = Math.max(0, Math.ceil((state.time - 3 - agent.start) / STEP));
  const to = Math.min(agent.xy.length - 1, Math.floor((state.time - agent.start) / STEP));
  if (to <= from) return;
  pen.globalAlpha = agent.role === "foreground" ? 0.7 : 0.3;
  strokeLines([agent.xy.slice(from, to + 1)], agent.colour, agent.role === "foreground" ? 2.5 : 1.5);
  pen.globalAlpha = 1;
}
function drawAgent(agent) {
  const sample = sampleAgent(agent, state.time);
  if (sample === null) return;
  if (agent.type === "pedestrian") return drawPedestrian(agent, sample);
  drawShape(() => trace(outline(agent, sample), true), agent);
  if (agent.type === "vehicle") drawWindscreen(agent, sample);
  else drawShape(() => pen.arc(...toPixels([sample.x, sample.y]), Math.max(0.25 * pixelsPerMetre(), 2.5), 0, 2 * Math.PI), agent);
}
function drawShape(shape, agent) {
  pen.beginPath();
  shape();
  pen.fillStyle = agent.colour;
  pen.fill();
  pen.strokeStyle = agent.role === "foreground" ? readVariable("--ink") : readVariable("--panel");
  pen.lineWidth = 1;
  pen.stroke();
}
/** What the headlights of a vehicle or rider light up at night, fading over 18 m. */
function drawHeadlights(agent) {
  const sample = agent.type === "pedestrian" ? null : sampleAgent(agent, state.time);
  if (sample === null) return;
  const c = Math.cos(sample.heading), s = Math.sin(sample.heading), put = (u, v) => toPixels([sample.x + u * c - v * s, sample.y + u * s + v * c]);
  const nose = put(agent.length / 2, 0), far = put(agent.length / 2 + 18, 0), light = pen.createLinearGradient(...nose, ...far);
  light.addColorStop(0, "rgba(255, 236, 170, .38)");
  light.addColorStop(1, "rgba(255, 236, 170, 0)");
  pen.beginPath();
  for (const [n, spot] of [put(agent.length / 2, -agent.width / 2), put(agent.length / 2 + 18, -4), put(agent.length / 2 + 18, 4), put(agent.length / 2, agent.width / 2)].entries()) pen[n ? "lineTo" : "moveTo"](...spot);
  pen.fillStyle = light;
  pen.fill();
}
/** A disc large enough to be seen, with a nose that shows the way it looks. */
function drawPedestrian(agent, sample) {
  const [x, y] = toPixels([sample.x, sample.y]), radius = Math.max((agent.width / 2) * pixelsPerMetre(), 4.5);
  const c = Math.cos(sample.heading), s = -Math.sin(sample.heading);
  drawShape(() => {
    pen.arc(x, y, radius, Math.atan2(s, c) + 0.6, Math.atan2(s, c) - 0.6);
    pen.lineTo(x + 1.5 * radius * c, y + 1.5 * radius * s);
    pen.closePath();
  }, agent);
}
function drawWindscreen(agent, sample) {
  const c = Math.cos(sample.heading), s = Math.sin(sample.heading), side = 0.4 * agent.width;
  const put = (u, v) => [sample.x + u * c - v * s, sample.y + u * s + v * c];
  const at = agent.length / 2 - Math.min(1.3, agent.length / 3);
  pen.beginPath();
  trace([put(at, -side), put(at - 0.5, -side), put(at - 0.5, side), put(at, side)], true);
  pen.fillStyle = "rgba(20, 28, 40, .55)";
  pen.fill();
}
/** Words near a place where they cover nothing, where they were before if that is free; a line leads back if they stand apart. */
function writeLabel(text, point, colour, spot = point) {
  pen.font = LABEL_FONT;
  const [x, y] = toPixels(point), half = pen.measureText(text).width / 2 + 3;
  if (x < -half || x > canvas.clientWidth + half || y < -20 || y > canvas.clientHeight + 20) return;
  const kept = state.offsets.get(text), offsets = [...(kept && !kept[0] && Math.abs(kept[1]) < 3 ? [kept] : []), ...LABEL_STEPS.flatMap((k) => [0, 1, -1].map((side) => [side, k])).sort(([a, b], [c, d]) => Math.abs(a) * 2 + Math.abs(b) - Math.abs(c) * 2 - Math.abs(d))];
  const found = offsets.map((offset) => [offset, placeBox(x + offset[0] * (half + 14), y + offset[1] * LABEL_HEIGHT, half)]).find(([, box]) => isFree(box));
  if (!found) return;
  const [offset, box] = found, [px, py] = toPixels(spot);
  state.offsets.set(text, offset);
  const near = [Math.min(Math.max(px, box[0]), box[2]), Math.min(Math.max(py, box[1]), box[3])];
  if (Math.hypot(px - near[0], py - near[1]) > LEADER_PIXELS) {
    pen.beginPath();
    pen.moveTo(...near);
    pen.lineTo(px, py);
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    pen.stroke();
  }
  putLabel(text, box, colour);
}
/** Where an agent of the instruction is drawn, so that no label covers it. */
function keepFree(agent) {
  const sample = sampleAgent(agent, state.time);
  if (agent.role !== "foreground" || sample === null) return;
  const spots = outline(agent, sample).map(toPixels), xs = spots.map(([x]) => x), ys = spots.map(([, y]) => y);
  state.boxes.push([Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)]);
}
/** A box for a label, held inside the picture: [left, top, right, bottom] in pixels. */
function placeBox(x, y, half) {
  const middle = Math.min(Math.max(x, half + 2), canvas.clientWidth - half - 2);
  const base = Math.min(Math.max(y, LABEL_HEIGHT), canvas.clientHeight - 6);
  return [middle - half, base - LABEL_HEIGHT + 4, middle + half, base + 4];
}
const isFree = (box) => !state.boxes.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]);
function putLabel(text, box, colour) {
  state.boxes.push(box);
  pen.font = LABEL_FONT;
  pen.textAlign = "center";
  pen.lineWidth = 4;
  pen.lineJoin = "round";
  pen.strokeStyle = readVariable("--halo");
  pen.strokeText(text, (box[0] + box[2]) / 2, box[3] - 4);
  pen.fillStyle = colour;
  pen.fillText(text, (box[0] + box[2]) / 2, box[3] - 4);
}
/** Names of the agents of the instruction, each on the side away from the others near it. */
function drawNames() {
  const shown = data.agents.filter((each) => each.role === "foreground").map((agent) => [agent, sampleAgent(agent, state.time)]).filter(([, at]) => at);
  for (const [agent, at] of shown.filter(([each]) => each !== state.hovered && each !== state.followed)) {
    const near = shown.filter(([other, place]) => other !== agent && Math.hypot(place.x - at.x, place.y - at.y) < 12);
    const below = near.some(([other, place]) => place.y > at.y || (place.y === at.y && other.id < agent.id));
    const away = Math.max(...outline(agent, at).map(([, y]) => Math.abs(y - at.y))) + 9 / pixelsPerMetre();
    writeLabel(agent.called, [at.x, at.y + (below ? -away - 8 / pixelsPerMetre() : away)], readVariable("--ink"));
  }
}
/** The name of every leg where it leaves the view, beside its road where there is room. */
function drawLegs() {
  const metre = pixelsPerMetre(), { view } = state;
  pen.font = LABEL_FONT;
  for (const leg of data.map.legs) {
    const text = leg.road && leg.road !== leg.name ? `${leg.name} · ${leg.road}` : leg.name, half = pen.measureText(text).width / 2 + 5;
    const ahead = [Math.cos(leg.bearing), Math.sin(leg.bearing)], centre = [view.x, view.y];
    const room = [(canvas.clientWidth / 2 - half) / metre, (canvas.clientHeight / 2 - 16) / metre];
    const reaches = [0, 1].filter((i) => Math.abs(ahead[i]) > 0.05).map((i) => (centre[i] + Math.sign(ahead[i]) * room[i]) / ahead[i]);
    const at = Math.min(data.map.extent - 4, ...reaches);
    if (at < 12) continue;
    const boxes = LEG_SIDES.map((aside) => toPixels([at * ahead[0] - aside * ahead[1], at * ahead[1] + aside * ahead[0]])).map(([x, y]) => placeBox(x, y, half));
    const chosen = boxes.find((box) => isFree(box) && isOffRoad(box)) ?? boxes.find(isFree);
    if (chosen) putLabel(text, chosen, readVariable("--soft"));
  }
}
function isOffRoad([left, top, right, bottom]) {
  const { view } = state, metre = pixelsPerMetre(), toMap = (x, y) => [view.x + (x - canvas.clientWidth / 2) / metre, view.y - (y - canvas.clientHeight / 2) / metre];
  const spots = [left, (left + right) / 2, right].flatMap((x) => [toMap(x, top), toMap(x, bottom)]);
  return !data.map.road.some(([ring]) => spots.some((spot) => contains(ring, spot)));
}

/** What was measured of an event: its zone, both ways, who was where, the gap, the braking, the line of sight. */
function drawEvidence(event) {
  if (event.location === null) return;
  if (event.zone) {
    pen.beginPath();
    trace(event.zone, true);
    pen.setLineDash([5, 4]);
    pen.strokeStyle = readVariable("--bad");
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.setLineDash([]);
  }
  const pair = [event.from, event.to].filter((id) => agents.has(id)).map((id) => agents.get(id));
  pair.forEach((agent) => drawBraking(agent, event));
  pair.forEach((agent) => drawPassage(agent, event));
  if (pair.length === 2) drawGap(pair, event);
  for (const sight of data.proof?.figures.first_visible ?? []) if ([sight.observer, sight.subject].every((id) => id === event.from || id === event.to)) drawSight(sight);
}
/** The gap in time, as the checker has it, beside the place and with the time at which it is met. */
function drawGap(pair, event) {
  const { pet, other_cleared: cleared, entered } = event.evidence ?? {};
  if (typeof pet !== "number") return;
  const [x, y] = event.when?.pet?.location ?? event.location;
  const lines = [`${pet.toFixed(1)} s between the two (PET)${event.when?.pet ? `, at ${formatSeconds(event.when.pet.time)}` : ""}`];
  if (typeof cleared === "number" && typeof entered === "number") lines.push(`${pair[1].called} clears it at ${formatSeconds(cleared)}`, `${pair[0].called} enters at ${formatSeconds(entered)}`);
  lines.forEach((text, n) => writeLabel(text, [x, y + (30 + LABEL_HEIGHT * (lines.length - 1 - n)) / pixelsPerMetre()], readVariable("--bad"), [x, y]));
}
/** Where an agent brakes before the event, over its way, and how hard at the most. */
function drawBraking(agent, event) {
  const changes = measureAcceleration(agent).filter(([time]) => time <= event.time + 0.5 && time >= event.time - 8);
  const hard = changes.filter(([, value]) => value <= -BRAKING);
  if (!hard.length) return;
  const spots = hard.map(([time]) => { const { x, y } = sampleAgent(agent, time); return [x, y]; });
  pen.globalAlpha = 0.55;
  spots.slice(1).forEach((spot, n) => { if (hard[n + 1][0] - hard[n][0] < 2 * STEP) strokeLines([[spots[n], spot]], readVariable("--bad"), 6); });
  pen.globalAlpha = 1;
  const most = Math.min(...hard.map(([, value]) => value));
  writeLabel(`${agent.called} ${agent.type === "pedestrian" ? "slows" : "brakes"}, up to ${(-most).toFixed(1)} m/s²`, [spots[0][0], spots[0][1] + 14 / pixelsPerMetre()], readVariable("--bad"));
}
/** The line along which one first sees the other past what stands there. */
function drawSight({ observer, subject, first_visible: time }) {
  const ends = [observer, subject].map((id) => agents.has(id) && sampleAgent(agents.get(id), time));
  if (!ends.every(Boolean)) return;
  strokeLines([ends.map(({ x, y }) => [x, y])], readVariable("--accent"), 2, [2, 4]);
  writeLabel(`in sight from ${formatSeconds(time)}`, [(ends[0].x + ends[1].x) / 2, (ends[0].y + ends[1].y) / 2], readVariable("--accent"));
}
function findPassage(agent, event) {
  let best = 0, least = Infinity;
  agent.xy.forEach(([x, y], n) => {
    const away = Math.hypot(x - event.location[0], y - event.location[1]);
    if (away < least - 1e-9) { least = away; best = n; }
  });
  return agent.start + best * STEP;
}
function drawPassage(agent, event) {
  const time = event.type === "yielding" && agent.id === event.from ? event.time : findPassage(agent, event), sample = sampleAgent(agent, time);
  pen.globalAlpha = 0.35;
  strokeLines([agent.xy], agent.colour, 2, [6, 4]);
  pen.globalAlpha = 1;
  pen.beginPath();
  trace(outline(agent, sample), true);
  pen.strokeStyle = agent.colour;
  pen.lineWidth = 2;
  pen.stroke();
  writeLabel(`${agent.called}, ${formatSeconds(time)}`, [sample.x, sample.y - agent.width / 2 - 14 / pixelsPerMetre()], readVariable("--ink"), [sample.x, sample.y]);
}
/** A ring round the place, and what happens there, in words. */
function drawEventMark(event) {
  if (event.location === null || event.time === null || Math.abs(state.time - event.time) > MARK_SECONDS) return;
  const [x, y] = toPixels(event.location), near = 1 - Math.abs(state.time - event.time) / MARK_SECONDS;
  pen.beginPath();
  pen.arc(x, y, 16 + 8 * (1 - near), 0, 2 * Math.PI);
  pen.strokeStyle = readVariable("--bad");
  pen.globalAlpha = 0.3 + 0.7 * near;
  pen.lineWidth = 3;
  pen.stroke();
  pen.globalAlpha = 1;
  if (state.time >= event.time - STEP) writeLabel(`${event.type.replaceAll("_", " ")} · ${formatSeconds(event.time)}`, [event.location[0], event.location[1] - 38 / pixelsPerMetre()], readVariable("--bad"), event.location);
}

/** The agent at a place of the map [m], or null: under it, or no farther than 10 pixels. */
function findAgent(place) {
  const shown = data.agents.map((agent) => [agent, sampleAgent(agent, state.time)]).filter(([, sample]) => sample);
  const near = shown.map(([agent, sample]) => { const ring = outline(agent, sample); return [agent, contains(ring, place) ? 0 : Math.min(...ring.map((each, n) => distanceToSegment(place, each, ring[(n + 1) % ring.length])))]; });
  const [agent, away] = near.reduce((best, each) => (each[1] <= best[1] ? each : best), [null, Infinity]);
  return away * pixelsPerMetre() <= 10 ? agent : null;
}
/** What the pointed or followed agent is and how fast it goes, and a ring round it. */
function drawPointed(agent) {
  const sample = sampleAgent(agent, state.time);
  if (sample === null) return;
  pen.beginPath();
  pen.arc(...toPixels([sample.x, sample.y]), (agent.length / 2) * pixelsPerMetre() + 6, 0, 2 * Math.PI);
  pen.strokeStyle = readVariable("--accent");
  pen.lineWidth = 2;
  pen.stroke();
  writeLabel(`${describeFully(agent)} · ${formatSpeed(sample.speed)}`, [sample.x, sample.y + agent.length / 2 + 12 / pixelsPerMetre()], readVariable("--accent"), [sample.x, sample.y]);
}
/** Keep an agent in the middle, or no longer if it is the one that is followed. */
function follow(agent) {
  state.followed = state.followed === agent ? null : agent;
  find("unfollow").hidden = state.followed === null;
  find("unfollow").textContent = state.followed === null ? "" : `Following ${state.followed.called} ✕`;
  for (const button of document.querySelectorAll(".lane button.label")) button.setAttribute("aria-pressed", String(Number(button.dataset.id) === state.followed?.id));
  if (state.followed) { find("who").value = String(state.followed.id); measureCharts(); }
  draw();
}
function drawUnaskedRun({ agent, time }) {
  const at = agents.has(agent) && Math.abs(state.time - time) <= MARK_SECONDS && sampleAgent(agents.get(agent), state.time);
  if (at) writeLabel(`runs red, unasked · ${formatSeconds(time)}`, [at.x, at.y - 30 / pixelsPerMetre()], readVariable("--amber"), [at.x, at.y]);
}
function draw() {
  const at = state.followed && sampleAgent(state.followed, state.time);
  if (at) Object.assign(state.view, { x: at.x, y: at.y });
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  state.boxes = [[0, canvas.clientHeight - 34, 130, canvas.clientHeight], [canvas.clientWidth - 44, 0, canvas.clientWidth, 26], [canvas.clientWidth - 50, canvas.clientHeight - 130, canvas.clientWidth, canvas.clientHeight]];
  data.agents.forEach(keepFree);
  for (const [name] of findLights(state.time)) for (const [x, y] of (data.map.lights[name] ?? []).map(toPixels)) state.boxes.push([x - 6, y - 6, x + 6, y + 6]);
  drawMap();
  if (data.night) data.agents.forEach(drawHeadlights);
  drawLights();
  data.agents.forEach(drawTrail);
  data.agents.forEach(drawAgent);
  (data.over ?? []).forEach(drawOther);
  state.handles.forEach(drawHandle);
  drawNames();
  for (const agent of new Set([state.followed, state.hovered])) if (agent) drawPointed(agent);
  if (state.event !== null) drawEvidence(data.events[state.event]);
  data.events.forEach(drawEventMark);
  UNASKED.forEach(drawUnaskedRun);
  drawObjects();
  drawLegs();
  drawScale();
}
function drawScale() {
  const metres = [50, 20, 10, 5, 2, 1].find((n) => n <= state.view.reach / 4) ?? 1, width = metres * pixelsPerMetre();
  const y = canvas.clientHeight - 14;
  pen.fillStyle = readVariable("--ink");
  pen.fillRect(12, y, width, 2);
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.fillText(`${metres} m`, 12, y - 5);
  pen.textAlign = "right";
  pen.fillText("N ↑", canvas.clientWidth - 10, 20);
}

// ---- time ------------------------------------------------------------------------------------
function seek(time) {
  state.time = Math.min(Math.max(time, 0), END);
  find("scrub").value = state.time.toFixed(1);
  find("scrub").setAttribute("aria-valuetext", formatSeconds(state.time));
  find("clock").textContent = `${state.time.toFixed(1)} / ${END.toFixed(1)} s`;
  for (const cursor of document.querySelectorAll(".cursor")) cursor.style.left = `${(100 * state.time) / END}%`;
  draw();
  drawCharts();
}
function play(on) {
  state.playing = on;
  find("play").textContent = on ? "❚❚" : "▶";
  find("play").setAttribute("aria-label", on ? "Pause" : "Play");
  if (on) {
    if (state.time >= END - 1e-6) seek(0);
    state.last = null;
    requestAnimationFrame(advance);
  } else describeNow();
}
function advance(stamp) {
  if (!state.playing) return;
  if (state.last !== null) seek(state.time + ((stamp - state.last) / 1000) * state.rate);
  state.last = stamp;
  if (state.time >= END) play(false);
  else requestAnimationFrame(advance);
}
function step(by) {
  play(false);
  seek(Math.round((state.time + by) / STEP) * STEP);
  describeNow();
}
/** Says in words what the picture shows, for readers of the page by ear. */
function describeNow() {
  const seen = data.agents.filter((each) => each.role === "foreground");
  const words = seen.map((agent) => {
    const sample = sampleAgent(agent, state.time);
    if (!sample) return `${agent.called} is not in the scene`;
    return `${agent.called} ${sample.speed < 0.3 ? "stands" : `goes at ${formatSpeed(sample.speed)}`}`;
  });
  const count = data.agents.filter((each) => sampleAgent(each, state.time)).length;
  find("now").textContent = `${formatSeconds(state.time)}: ${[...words, `${count} agents in view`].join("; ")}.`;
}

// ---- timeline ----------------------------------------------------------------------------------
function addBar(track, start, end, colour, title) {
  const bar = make("span", { className: "bar", title });
  bar.style.left = `${(100 * Math.max(start, 0)) / END}%`;
  bar.style.width = `${(100 * (Math.min(end, END) - Math.max(start, 0))) / END}%`;
  bar.style.background = colour;
  track.append(bar);
}
function addLane(text, colour, agent = null) {
  const label = agent ? make("button", { type: "button", className: "label", title: `Follow ${text}` }) : make("span", { className: "label", title: text });
  if (agent) {
    label.dataset.id = agent.id;
    label.setAttribute("aria-pressed", "false");
    label.addEventListener("click", () => follow(agent));
  }
  if (colour) {
    const dot = make("span", { className: "dot" });
    dot.style.background = colour;
    label.append(dot);
  }
  label.append(text);
  const track = make("div", { className: "track" });
  track.addEventListener("click", (click) => {
    if (track.dataset.dragged) { delete track.dataset.dragged; return; }
    const box = track.getBoundingClientRect();
    step(((click.clientX - box.left) / box.width) * END - state.time);
  });
  find("timeline").append(make("div", { className: "lane" }, label, track));
  return track;
}
function buildTimeline() {
  const marks = addLane("Events");
  data.events.forEach((event, n) => {
    if (event.time === null) return;
    const tick = make("button", { type: "button", className: "tick", title: formatEvent(event) });
    tick.setAttribute("aria-label", formatEvent(event));
    tick.style.left = `${(100 * event.time) / END}%`;
    tick.addEventListener("click", (click) => { click.stopPropagation(); showEvent(n); });
    marks.append(tick);
  });
  for (const run of UNASKED) {
    const tick = make("button", { type: "button", className: "tick unasked", title: describeRun(run) });
    tick.setAttribute("aria-label", describeRun(run));
    tick.style.left = `${(100 * run.time) / END}%`;
    tick.addEventListener("click", (click) => { click.stopPropagation(); step(run.time - state.time); });
    marks.append(tick);
  }
  const named = data.agents.filter((each) => each.role === "foreground").sort((a, b) => a.id - b.id);
  for (const agent of named) {
    const track = addLane(agent.called, agent.colour, agent);
    listenToBars(track, agent);
    if (!agent.segments.length) addBar(track, agent.start, endOf(agent), agent.colour, "in the scene");
    for (const segment of agent.segments)
      addBar(track, segment.start, segment.end, STATUS[segment.status], `${segment.status}, ${formatSeconds(segment.start)} to ${formatSeconds(segment.end)}`);
  }
  for (const name of listLights(named)) {
    const track = addLane(`light, ${name.replace(":stop", " stop line").replace(":", " ")}`);
    for (const row of data.signals.filter((each) => (each.stop_line ?? each.crosswalk) === name))
      addBar(track, row.start, row.end, LIGHT[row.colour], row.colour);
  }
  for (const track of document.querySelectorAll(".track")) track.append(make("span", { className: "cursor" }));
}
/** Lights that the agents of the instruction meet. */
function listLights(named) {
  const met = named.map((each) => (each.crosswalk ? [each.crosswalk, "crosswalk"] : [each.entry, "stop_line"]));
  const names = data.signals.filter((row) =>
    met.some(([leg, key]) => row[key] && row[key].split(":")[0] === leg)).map((row) => row.stop_line ?? row.crosswalk);
  return [...new Set(names)].sort();
}

// ---- proof -------------------------------------------------------------------------------------
function formatEvent(event) {
  const when = event.time === null ? "" : `${formatSeconds(event.time)}: `;
  if (event.type === "normal" || event.from === null) return `${when}nothing but ordinary traffic`;
  const kind = event.kind ? ` (${event.kind.replaceAll("_", " ")})` : "";
  return `${when}${describeAgent(event.from)} ${EVENT[event.type] ?? event.type} ${describeAgent(event.to)}${kind}`;
}
const SECONDS = (value) => `${Number(value.toFixed(1))} s`, METRES = (value) => `${Number(value.toFixed(1))} m`, BRAKES = (value) => `${value.toFixed(1)} m/s²`;
const FIGURES = { pet: ["gap in time (PET)", SECONDS], clearance: ["least distance", METRES], path_ttc: ["time to collision along the paths", SECONDS],
  ttc_2d: ["time to collision", SECONDS], drac: ["braking needed", BRAKES], relative_speed: ["speed of contact", formatSpeed],
  least_headway: ["least headway", SECONDS], least_gap: ["least gap", METRES], until: ["until", SECONDS], approach_speed: ["approach at", formatSpeed],
  lowest_speed: ["slowest", formatSpeed], begins_to_slow: ["slows from", SECONDS], braking: ["brakes with", BRAKES], other_cleared: ["the other is past at", SECONDS],
  entered: ["enters at", SECONDS], would_have_entered: ["would have entered at", SECONDS], speed_from: ["its speed", formatSpeed], speed_to: ["the other's speed", formatSpeed],
  angle: ["angle between them", (value) => `${Math.round((180 * value) / Math.PI)}°`], cause_agent: ["caused by", describeAgent] };
function formatEvidence({ evidence, when, worst, time }) {
  const say = (key, value, at) => `${FIGURES[key][0]} ${FIGURES[key][1](value)}${at === undefined || Math.abs(at - time) <= 0.25 ? "" : ` at ${formatSeconds(at)}`}`;
  const own = Object.entries(evidence ?? {}).filter(([key, value]) => typeof value === "number" && FIGURES[key]);
  const known = { path_ttc: Infinity, ttc_2d: Infinity, ...evidence };
  const worse = Object.entries(worst ?? {}).filter(([key, { value }]) => (key === "drac" ? value > known[key] : value < known[key]));
  return [...own.map(([key, value]) => say(key, value, when?.[key]?.time)), ...worse.map(([key, { value, time: at }]) => `worse later or before: ${say(key, value, at)}`)].join(" · ");
}
function showEvent(n) {
  const event = data.events[n];
  state.event = state.event === n ? null : n;
  if (event.from !== null) find("who").value = String(event.from);
  if (event.to !== null) find("other").value = String(event.to);
  markEvent();
  if (event.time !== null) step(event.time - state.time);
  find("map").scrollIntoView({ block: "nearest" }); // it is above the proof on a narrow screen
}
function markEvent() {
  document.querySelectorAll("#events button").forEach((button, n) => button.setAttribute("aria-current", String(n === state.event)));
}
function buildProof() {
  const verified = data.proof?.verified;
  const words = data.proof === null ? "Not checked: the folder holds no proof" : `${verified ? "✓" : "✗"} ${data.proof.verdict[0].toUpperCase()}${data.proof.verdict.slice(1)}`;
  find("verdict").textContent = words;
  find("verdict").className = !verified ? "bad" : data.proof.caveat ? "amber" : "good";
  data.events.forEach((event, n) => {
    const figures = make("span", { className: "figures", textContent: formatEvidence(event) });
    const button = make("button", { type: "button" }, make("span", { textContent: formatEvent(event) }), figures);
    button.addEventListener("click", () => showEvent(n));
    find("events").append(make("li", {}, button));
  });
  markEvent();
  if (data.proof === null) return;
  for (const [key, title] of [["missing", "Asked for, not found"], ["interference", "Would be mistaken for the event"],
    ["implausible", "Implausible motion"], ["signal_violations", "Signals not kept"]]) listFindings(data.proof[key], title, "bad");
  listFindings(UNASKED.map(describeRun), "Red lights run unasked", "amber");
  const ordinary = data.proof.incidental.map((each) => formatEvent(each));
  if (ordinary.length) find("findings").append(make("details", {}, make("summary", { textContent: `Ordinary traffic: ${ordinary.length}` }),
    make("ul", {}, ...ordinary.map((text) => make("li", { textContent: text })))));
}
function listFindings(rows, title, colour) {
  if (!rows || !rows.length) return;
  const items = rows.map((row) => make("li", { textContent: typeof row === "string" ? row : row.detail ?? JSON.stringify(row) }));
  find("findings").append(make("h2", { className: colour, textContent: title }), make("ul", {}, ...items));
}

// ---- the account of words ------------------------------------------------------------------------
function buildInstruction() {
  const letters = [...data.meta.user_prompt], title = find("instruction");
  let at = 0;
  for (const each of [...data.account].sort((a, b) => a.start - b.start)) {
    if (each.start < at || each.end <= each.start) continue;
    title.append(letters.slice(at, each.start).join(""));
    title.append(make("mark", { className: each.state, title: describeWords(each), textContent: letters.slice(each.start, each.end).join("") }));
    at = each.end;
  }
  title.append(letters.slice(at).join("") || (at ? "" : "Untitled scene"));
}
/** "class taxi" is what the program calls it. */
const TURNS = { left: "a left turn", right: "a right turn", straight: "straight on", uturn: "a U-turn", "left/right/uturn": "a turn" };
const describeClaim = (claim) => (claim ?? "").replace(/^movement (\S+)$/, (_, way) => TURNS[way] ?? way).replace(/^class /, "").replace(/^(\w+) (?=\1\b)/, "").replace(/^event /, "").replace(/^side (\w+)$/, "the $1 side").replace(/^crosswalk a /, "a ").replace(/^object /, "").replace(/^sight$/, "hidden from sight");
/** "north of the car" is where it comes from, not what lies north of it. */
const describeEvidence = ({ claim, evidence }) => (/^(?:side|movement) /.test(claim ?? "") ? (evidence ?? "").replace(/^(\S+) of (.+)$/, (_, what, whom) => `${whom}: ${TURNS[what] ?? what}`) : evidence);
const describeWords = (each) => [each.state.replaceAll("_", " "), describeClaim(each.claim), describeEvidence(each)].filter(Boolean).join(": ");
function buildAccount() {
  const body = find("account").tBodies[0];
  for (const each of data.account) {
    const whom = each.agents.map(describeAgent).join(", "), claim = `${describeClaim(each.claim)}${whom ? ` (${whom})` : ""}`;
    body.append(make("tr", { className: each.state }, make("td", { textContent: each.words }), make("td", { className: "state", textContent: each.state.replaceAll("_", " ") }),
      make("td", { textContent: claim }), make("td", { textContent: describeEvidence(each) })));
  }
  if (!data.account.length) body.append(make("tr", {}, make("td", { colSpan: 4, textContent: "There is no account of words." })));
}

// ---- figures over time -----------------------------------------------------------------------------
const charts = [];
function addChart(title, unit, measure) {
  const board = make("canvas", {});
  board.setAttribute("role", "img");
  const caption = make("p", {});
  board.addEventListener("click", (click) => {
    const box = board.getBoundingClientRect();
    step(((click.clientX - box.left) / box.width) * END - state.time);
  });
  const chart = { board, caption, title, unit, measure };
  board.addEventListener("pointermove", (move) => {
    const box = board.getBoundingClientRect();
    state.pointed = ((move.clientX - box.left) / box.width) * END;
    drawCharts();
  });
  board.addEventListener("pointerleave", () => { state.pointed = null; drawCharts(); });
  find("charts").append(make("div", { className: "chart" }, caption, board));
  charts.push(chart);
}
/** Series of [time, value] of the chosen agents: their speeds. */
const measureSpeed = (agent) => agent.xy.map((_, n) => [agent.start + n * STEP, 3.6 * agent.speed[n]]);
function measureAcceleration(agent) {
  const width = 3; // over 0.6 s, as a difference of speeds over one step is mostly rounding
  return agent.xy.map((_, n) => {
    const i = Math.max(n - width, 0), j = Math.min(n + width, agent.xy.length - 1);
    return [agent.start + n * STEP, j > i ? (agent.speed[j] - agent.speed[i]) / ((j - i) * STEP) : 0];
  });
}
function measureDistance(agent, other) {
  if (!other || other === agent) return [];
  const found = [];
  for (let time = Math.max(agent.start, other.start); time <= Math.min(endOf(agent), endOf(other)) + 1e-6; time += STEP)
    found.push([time, measureGap(outline(agent, sampleAgent(agent, time)), outline(other, sampleAgent(other, time)))]);
  return found;
}
/** Seconds until the outlines would touch if both kept speed and course; only where that is within FURTHEST_TTC. */
function measureTtc(agent, other) {
  if (!other || other === agent) return [];
  const found = [], reaches = (agent.length + other.length) / 2 + 1;
  for (let time = Math.max(agent.start, other.start); time <= Math.min(endOf(agent), endOf(other)) + 1e-6; time += STEP) {
    const a = sampleAgent(agent, time), b = sampleAgent(other, time), velocity = (at) => [at.speed * Math.cos(at.heading), at.speed * Math.sin(at.heading)];
    const [va, vb] = [velocity(a), velocity(b)], ttc = findContact(agent, other, a, b, [va[0] - vb[0], va[1] - vb[1]], reaches);
    if (ttc !== null) found.push([time, ttc]);
  }
  return found;
}
function findContact(agent, other, a, b, [vx, vy], reaches) {
  for (let ahead = 0; ahead <= FURTHEST_TTC; ahead += STEP) {
    const moved = { ...a, x: a.x + vx * ahead, y: a.y + vy * ahead };
    if (Math.hypot(moved.x - b.x, moved.y - b.y) > reaches) continue;
    if (measureGap(outline(agent, moved), outline(other, b)) === 0) return ahead;
  }
  return null;
}
let series = [];
function measureCharts() {
  const pair = [agents.get(Number(find("who").value)), agents.get(Number(find("other").value))];
  series = charts.map((chart) => chart.measure(...pair));
  drawCharts();
}
function drawCharts() {
  charts.forEach((chart, n) => drawChart(chart, series[n] ?? []));
}
function drawChart(chart, lines) {
  const { board, caption, title, unit } = chart, ratio = window.devicePixelRatio || 1;
  const width = board.clientWidth, height = board.clientHeight, brush = board.getContext("2d");
  Object.assign(board, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  brush.setTransform(ratio, 0, 0, ratio, 0, 0);
  const values = lines.flatMap((line) => line.points.map((point) => point[1]));
  const high = Math.max(1, ...values), low = Math.min(0, ...values);
  const px = (time) => (time / END) * width, py = (value) => height - 6 - ((value - low) / (high - low)) * (height - 12);
  brush.fillStyle = readVariable("--soft", board);
  brush.font = "11px system-ui, sans-serif";
  brush.fillText(`${Number(high.toFixed(1))} ${unit}`, 4, 11);
  brush.strokeStyle = readVariable("--line", board);
  brush.beginPath(); brush.moveTo(0, py(0)); brush.lineTo(width, py(0)); brush.stroke();
  for (const line of lines) {
    brush.beginPath();
    line.points.forEach(([time, value], i) => brush[i && time - line.points[i - 1][0] < 1.5 * STEP ? "lineTo" : "moveTo"](px(time), py(value)));
    brush.strokeStyle = line.colour;
    brush.lineWidth = 1.6;
    brush.stroke();
  }
  brush.strokeStyle = readVariable("--ink", board);
  brush.lineWidth = 1;
  brush.beginPath(); brush.moveTo(px(state.time), 0); brush.lineTo(px(state.time), height); brush.stroke();
  const at = state.pointed ?? state.time;
  if (state.pointed !== null) { brush.globalAlpha = 0.5; brush.beginPath(); brush.moveTo(px(at), 0); brush.lineTo(px(at), height); brush.stroke(); brush.globalAlpha = 1; }
  const now = lines.map((line) => [line.name, findValue(line.points, at)]).filter(([, value]) => value !== null);
  caption.textContent = `${title}${state.pointed === null ? "" : ` at ${formatSeconds(at)}`}: ${now.length ? now.map(([name, value]) => `${name} ${formatNumber(value)} ${unit}`).join(", ") : "–"}`;
  board.setAttribute("aria-label", caption.textContent);
}
function findValue(points, at) {
  const near = points.find(([time]) => Math.abs(time - at) <= STEP / 2 + 1e-6);
  return near ? near[1] : null;
}
const asLines = (measure) => (...pair) => pair.filter((each, n) => each && pair.indexOf(each) === n)
  .map((agent) => ({ name: agent.called, colour: agent.colour, points: measure(agent) }));
function buildCharts() {
  addChart("Speed", "km/h", asLines(measureSpeed));
  addChart("Acceleration", "m/s²", asLines(measureAcceleration));
  addChart("Distance between the two", "m", (agent, other) => {
    const points = measureDistance(agent, other);
    return points.length ? [{ name: "gap", colour: readVariable("--accent"), points }] : [];
  });
  addChart("Time to collision, both keeping speed and course", "s", (agent, other) => {
    const points = measureTtc(agent, other);
    return points.length ? [{ name: "TTC", colour: readVariable("--bad"), points }] : [];
  });
  const event = data.events.find((each) => each.from !== null);
  const ids = [...agents.keys()].sort((a, b) => a - b);
  for (const [select, chosen] of [[find("who"), event?.from ?? ids[0]], [find("other"), event?.to ?? ids[1]]]) {
    for (const id of ids) select.append(make("option", { value: String(id), textContent: describeAgent(id), selected: id === chosen }));
    select.addEventListener("change", measureCharts);
  }
}
function buildAgents() {
  const body = find("agents").tBodies[0];
  for (const agent of [...data.agents].sort((a, b) => a.id - b.id)) {
    const top = Math.max(...agent.speed);
    const cells = [describeFully(agent), `${agent.entry} to ${agent.exit}, ${agent.movement}`,
      `${formatSeconds(agent.start)} to ${formatSeconds(endOf(agent))}`, formatSpeed(top)];
    body.append(make("tr", {}, ...cells.map((text) => make("td", { textContent: text }))));
  }
}

// ---- changes by hand, where the page around this one allows them ---------------------------------
const HANDLE_PIXELS = 14, LINE_SPACING = 0.5, LEAST_SHIFT = 0.15;
const inPage = window.parent !== window && location.protocol.startsWith("http");

/** Where on a line, whose points lie LINE_SPACING apart, a place is nearest [m]. */
function findNearestOn(line, [x, y]) {
  let best = 0, least = Infinity;
  line.forEach(([px, py], n) => { const away = Math.hypot(px - x, py - y); if (away < least) { least = away; best = n; } });
  return best * LINE_SPACING;
}
function findOnLine(line, at) {
  const n = Math.min(Math.max(Math.round(at / LINE_SPACING), 0), line.length - 1), before = line[Math.max(n - 1, 0)], after = line[Math.min(n + 1, line.length - 1)];
  return { spot: line[n], ahead: Math.atan2(after[1] - before[1], after[0] - before[0]) };
}
const handleAt = (handle) => (state.drag?.agent === handle.agent ? state.drag.at : handle.stop.at);
function drawHandle(handle) {
  if (!handle.stop) return;
  const { spot: [x, y], ahead } = findOnLine(handle.stop.line, handleAt(handle)), half = 1.6, c = Math.cos(ahead), s = Math.sin(ahead);
  if (state.drag?.agent === handle.agent) strokeLines([handle.stop.line], readVariable("--bad"), 1.5, [3, 4]);
  strokeLines([[[x - half * s, y + half * c], [x + half * s, y - half * c]]], readVariable("--bad"), 4);
  pen.beginPath();
  pen.arc(...toPixels([x, y]), 6, 0, 2 * Math.PI);
  pen.fillStyle = readVariable("--panel");
  pen.fill();
  pen.strokeStyle = readVariable("--bad");
  pen.lineWidth = 2;
  pen.stroke();
  const moved = handleAt(handle) - handle.stop.at;
  if (Math.abs(moved) > LEAST_SHIFT) writeLabel(`${moved > 0 ? "+" : "−"}${Math.abs(moved).toFixed(1)} m`, [x, y + 2.4], readVariable("--bad"));
}
function findHandle(place) {
  for (const handle of state.handles) {
    if (!handle.stop) continue;
    const { spot } = findOnLine(handle.stop.line, handle.stop.at);
    if (Math.hypot(spot[0] - place[0], spot[1] - place[1]) * pixelsPerMetre() <= HANDLE_PIXELS) return { ...handle, at: handle.stop.at };
  }
  return null;
}
function dropHandle() {
  const drag = state.drag;
  state.drag = null;
  if (drag === null) return;
  const metres = Math.round((drag.at - drag.stop.at) * 2) / 2;
  if (metres) askForEdit({ edit: "move_stop", agent: drag.agent, metres });
  draw();
}
/** Dragging an agent's bars shifts the time at which it comes. */
function listenToBars(track, agent) {
  let from = null;
  const shift = (event) => ((event.clientX - from) / track.getBoundingClientRect().width) * END;
  const slide = (seconds) => track.querySelectorAll(".bar").forEach((bar) => { bar.style.transform = seconds ? `translateX(${(seconds / END) * track.clientWidth}px)` : ""; });
  track.addEventListener("pointerdown", (event) => {
    if (!state.handles.some((each) => each.agent === agent.name)) return;
    from = event.clientX;
    track.setPointerCapture(event.pointerId);
  });
  track.addEventListener("pointermove", (event) => { if (from !== null) slide(shift(event)); });
  track.addEventListener("pointercancel", () => { from = null; slide(0); });
  track.addEventListener("pointerup", (event) => {
    if (from === null) return;
    const seconds = Math.round(shift(event) * 10) / 10;
    from = null;
    slide(0);
    if (Math.abs(seconds) <= LEAST_SHIFT) return;
    track.dataset.dragged = "yes";
    askForEdit({ edit: "come_later", agent: agent.name, seconds });
  });
}
function askForEdit(edit) {
  window.parent.postMessage({ scenewright: "edit", edit }, location.origin);
}
function listenToPage() {
  if (!inPage) return;
  find("theme").hidden = true; // the page around has one for both
  window.addEventListener("message", (event) => {
    if (event.source !== window.parent || event.origin !== location.origin || event.data?.scenewright !== "handles") return;
    state.handles = event.data.handles;
    chooseTheme(event.data.dark);
    document.body.classList.toggle("by-hand", state.handles.length > 0);
    draw();
  });
  window.parent.postMessage({ scenewright: "ready" }, location.origin);
}

// ---- view and keys -------------------------------------------------------------------------------
function zoom(by, about = null) {
  const { view } = state, reach = Math.min(Math.max(view.reach * by, 6), 3 * data.map.extent);
  const share = 1 - reach / view.reach;
  if (about) Object.assign(view, { x: view.x + (about[0] - view.x) * share, y: view.y + (about[1] - view.y) * share });
  view.reach = reach;
  draw();
}
function toMetres(event) {
  const box = canvas.getBoundingClientRect(), metre = pixelsPerMetre(), { view } = state;
  return [view.x + (event.clientX - box.left - box.width / 2) / metre, view.y - (event.clientY - box.top - box.height / 2) / metre];
}
function listenToPointer() {
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(event.deltaY > 0 ? 1.15 : 1 / 1.15, toMetres(event)); }, { passive: false });
  let grabbed = null, pressed = null;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pressed = [event.clientX, event.clientY];
    state.drag = findHandle(toMetres(event));
    if (state.drag === null) grabbed = toMetres(event);
  });
  canvas.addEventListener("pointerup", (event) => {
    const clicked = grabbed !== null && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4;
    grabbed = null;
    dropHandle();
    const agent = clicked ? findAgent(toMetres(event)) : null;
    if (agent) follow(agent);
  });
  canvas.addEventListener("pointerleave", () => { state.hovered = null; draw(); });
  canvas.addEventListener("pointercancel", () => { grabbed = null; state.drag = null; draw(); });
  canvas.addEventListener("pointermove", (event) => {
    if (state.drag !== null) { state.drag.at = findNearestOn(state.drag.stop.line, toMetres(event)); draw(); return; }
    if (grabbed === null) {
      const agent = findAgent(toMetres(event));
      canvas.style.cursor = agent ? "pointer" : "";
      if (agent !== state.hovered) { state.hovered = agent; draw(); }
      return;
    }
    if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4) return;
    if (state.followed) follow(state.followed);
    const [x, y] = toMetres(event);
    state.view.x += grabbed[0] - x;
    state.view.y += grabbed[1] - y;
    draw();
  });
}
function goToNextEvent() {
  const dated = data.events.map((event, n) => [event.time, n]).filter(([time]) => time !== null).sort((a, b) => a[0] - b[0]);
  if (!dated.length) return;
  const [time, n] = dated.find(([at]) => at > state.time + LEAD_SECONDS) ?? dated[0];
  state.event = n;
  markEvent();
  step(time - LEAD_SECONDS - state.time);
  play(true);
}
const KEYS = { " ": () => play(!state.playing), ArrowLeft: () => step(-1), ArrowRight: () => step(1), ",": () => step(-STEP),
  ".": () => step(STEP), Home: () => step(-END), End: () => step(END), e: goToNextEvent, "+": () => zoom(1 / 1.2), "-": () => zoom(1.2), Escape: () => { if (state.followed) follow(state.followed); } };
function listenToKeys() {
  document.addEventListener("keydown", (event) => {
    const typing = /^(SELECT|INPUT|TEXTAREA)$/.test(event.target.tagName);
    const pressing = event.key === " " && event.target.tagName === "BUTTON";
    if (typing || pressing || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
}
function chooseTheme(dark) {
  document.documentElement.classList.toggle("dark", dark);
  find("theme").setAttribute("aria-pressed", String(dark));
  if (state.view) seek(state.time);
}

function start() {
  canvas.parentElement.classList.toggle("night", data.night);
  find("facts").textContent = [data.map.title || data.map.name, data.meta.time_of_day, formatSeconds(END),
    `${data.agents.length} agents`, `seed ${data.meta.seed}`].join(" · ");
  find("scrub").max = String(END);
  chooseTheme(window.matchMedia?.("(prefers-color-scheme: dark)").matches ?? false);
  buildInstruction();
  buildProof();
  buildTimeline();
  buildAccount();
  buildAgents();
  state.view = { ...HOME };
  buildCharts();
  measureCharts();
  find("play").addEventListener("click", () => play(!state.playing));
  find("back").addEventListener("click", () => step(-STEP));
  find("forward").addEventListener("click", () => step(STEP));
  find("rate").addEventListener("change", (event) => { state.rate = Number(event.target.value); });
  find("scrub").addEventListener("input", (event) => step(Number(event.target.value) - state.time));
  find("next-event").addEventListener("click", goToNextEvent);
  find("theme").addEventListener("click", () => chooseTheme(!document.documentElement.classList.contains("dark")));
  find("zoom-in").addEventListener("click", () => zoom(1 / 1.3));
  find("zoom-out").addEventListener("click", () => zoom(1.3));
  find("zoom-fit").addEventListener("click", () => { if (state.followed) follow(state.followed); state.view = { ...HOME }; draw(); });
  find("unfollow").addEventListener("click", () => follow(state.followed));
  listenToPointer();
  listenToKeys();
  new ResizeObserver(() => seek(state.time)).observe(canvas);
  const still = window.matchMedia?.("(prefers-reduced-motion: reduce)").matches ?? false;
  seek(still ? data.mainTime : Math.max(data.mainTime - OPENING_SECONDS, 0));
  describeNow();
  listenToPage();
  if (!still) play(true);
}
start();
