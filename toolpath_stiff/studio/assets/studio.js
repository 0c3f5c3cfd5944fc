// The page: it asks for the state, draws it, posts what is to be done, and hears of every change.
const scene = new MachineScene();
let state = JSON.parse($("data")?.textContent ?? "null"), panel = "effects", here = -1, which = "now";
const readonly = state !== null;
document.body.classList.toggle("readonly", readonly);
if (readonly) for (const id of ["tools", "drop"]) $(id).remove();

async function post(path, body) {
  const answer = await fetch(path, { method: "POST", body, headers: typeof body === "string"
    ? { "Content-Type": "application/json" } : {} });
  const found = await answer.json();
  if (found.error) throw new Error(found.error);
  return found;
}
function tell(text, good = false) {
  $("message").hidden = !text;
  $("message").classList.toggle("notice", good);
  $("message").textContent = text;
}
// One thing after the other, in the order of the keys; until all is done the page's own placement holds.
let pending = 0, before = Promise.resolve();
const act = (asked) => {
  if (readonly) return before;
  pending++;
  before = before.then(async () => {
    try {
      const answer = await post("/do", JSON.stringify(asked));
      tell(answer.message ?? "");
    } catch (error) { tell(error.message); }
    pending--;
    // What is being asked for may be from before this.
    try { await asking; await refresh(); } catch (error) { tell(error.message); }
  });
  return before;
};
// Of what follows the pointer only the last is asked for, one question at a time.
function latest(ask, show) {
  let busy = false, next = null;
  return async (...asked) => {
    next = asked;
    if (busy || readonly) return;
    busy = true;
    while (next) { const now = next; next = null; try { show(await ask(...now), ...now); } catch (error) {
      tell(error.message); } }
    busy = false;
  };
}
const hand = latest((on) => post("/do", JSON.stringify({ do: "hand", on })), (found) => {
  state.gauge.now = found.mean_abs_error_percent;
  state.gauge.left_out = null;
  let k = 0;
  scene.deviation = state.readings.aside.map((gone) => (gone ? null : found.deviation_percent[k++]));
  $("gauge").replaceChildren(gaugeOf(state));
  view.redraw();
});
// The path where the work would lie with program zero elsewhere.
function carried({ path: p, origin: from }, origin) {
  const [q, r] = [turnOf(from), turnOf(origin)], xyz = [0, 1, 2].map(() => new Float32Array(p.x_mm.length));
  for (let i = 0; i < p.x_mm.length; i++) {
    const d = minus([p.x_mm[i], p.y_mm[i], p.z_mm[i]], from);
    moved(origin, r, [0, 1, 2].map((k) => dot3(q.map((row) => row[k]), d))).forEach((v, k) => { xyz[k][i] = v; });
  }
  return xyz;
}
function carry(origin) {
  if (!scene.paths[0]) return;
  scene.paths[0].move(carried(state.program, origin));
  if (here < 0) scene.pose = [...origin.slice(0, 3), 0, 0, 0];
  view.redraw();
}
const placed = latest((origin) => post("/do", JSON.stringify({ do: "at", origin })), (found) => {
  state.placement.now = found;
  $("pl")?.replaceWith(placementFigures(found, state, "pl"));
});
Object.assign(act, {
  scene, readonly, origin: [0, 0, 0, 0, 0, 0], redraw: () => drawPanel(), put: () => {},
  hand: (name, values) => hand({ ...Object.fromEntries(state.effects.filter((one) => one.on)
    .map((one) => [one.name, one.on])), [name]: values }),
  shift: (axis, by) => act.move(axis, act.origin[axis] + by, false),
  move: (axis, value, done) => {
    if (!Number.isFinite(value)) return;
    act.origin[axis] = axis === 5 ? ((value % 360) + 360) % 360 : value;
    act.put();
    carry(act.origin);
    for (const [name, k] of [["X", 0], ["Y", 1], ["Z", 2], ["C", 5]])
      for (const field of [$(`o-${name}`), $(`o-${name}n`)])
        if (field && document.activeElement !== field) field.value = Number(act.origin[k].toFixed(1));
    placed([...act.origin]);
    if (done) act.drop();
  },
  drop: () => act({ do: "place_at", origin: act.origin.map((v) => Number(v.toFixed(3))) })
    .then(() => { if (!scene.outline()?.every((p) => view.holds(view.project(p)))) view.turnTo("fit"); }),
});
// The machine, the profile.
const view = new Viewer($("scene"), scene, { point, pick, step: (by) => stepReading(by),
  enter: () => { if (scene.selected >= 0) aside(scene.selected); } });
let profile = null, playing = 0;
function describe(i) {
  const r = state.readings, d = scene.deviation[i], turned = [r.a_deg[i], r.b_deg[i], r.c_deg[i]];
  const along = ["dx", "dy", "dz"].map((k) => r[k][i]), axis = along.findIndex((v) => Math.abs(v) > 0.999);
  return [`${r.file[i]} line ${r.line[i]}${r.aside[i] ? ", set aside" : ""}`,
    `X${r.x_mm[i]} Y${r.y_mm[i]} Z${r.z_mm[i]} mm`
      + `${turned.some(Boolean) ? `, A${turned[0]} B${turned[1]} C${turned[2]} deg` : ""}`,
    `along ${axis < 0 ? along.map((v) => v.toFixed(2)).join(", ") : "XYZ"[axis]}, ${group(r.force_N[i])} N`,
    r.aside[i] ? `measured ${group(r.stiffness_N_per_mm[i])} N/mm`
      : `measured ${group(r.stiffness_N_per_mm[i])}, modelled `
        + `${group(r.stiffness_N_per_mm[i] / (1 + d / 100))} N/mm: ${d > 0 ? "+" : ""}${d.toFixed(1)} %`];
}
function select(i) {
  scene.selected = i;
  const r = state.readings;
  scene.pose = [r.x_mm[i], r.y_mm[i], r.z_mm[i], r.a_deg[i], r.b_deg[i], r.c_deg[i]];
  $("status").textContent =
    `${describe(i).join(" \u00b7 ")} \u00b7 ${readonly ? "" : "click or Enter sets it aside or uses it again"}`;
  view.redraw();
}
function point(i) {
  view.tip.hidden = true;
  if (i < 0) return;
  if (i >= PATH_FROM) { goTo(i - PATH_FROM); return; }
  select(i);
  const spot = scene.spots.find((one) => one[2] === i);
  if (spot) view.tell(spot, describe(i));
}
function pick(i) {
  if (i >= 0 && i < PATH_FROM) { select(i); aside(i); }
}
const aside = (i) => act({ do: "aside", file: state.readings.file[i], line: state.readings.line[i] });
function stepReading(by) {
  const n = state.readings?.line.length;
  if (n) select((scene.selected + by + n) % n);
}

function classify() {
  const path = state.program?.path;
  if (!path) { scene.paths = []; return; }
  const lines = scene.paths[0] ?? new Path([path.x_mm, path.y_mm, path.z_mm]);
  const shown = curve(), known = shown.filter((v, i) => v !== null && path.cut[i] && !path.plunge[i]);
  let low = Infinity, high = -Infinity;
  for (const v of known) { low = Math.min(low, v); high = Math.max(high, v); }
  scene.ends = [low, high];
  scene.shifted = which === "shift" ? shifted(path) : null;
  lines.classify((i) => {
    if (!path.cut[i]) return RAPIDS;
    if (shown[i] === null) return UNREACHED;
    return path.plunge[i] ? PLUNGES : classAt(shown[i], scene.ends, CLASSES);
  });
  scene.paths = [lines];
}
// Of a cut, what path and profile may show instead of stiffness: its unit and digits, what it is.
const LAYERS = { error: ["\u00b5m", 1, "error of the surface, + material left"], width: ["mm", 2, "width of cut"],
  shift: ["\u00b5m", 1, "shift of the compensated path, + to the left"] };
const layer = () => (state.program?.path?.[which] && LAYERS[which]) || ["N/mm", 0, ""];
// The compensated path beside the other, with its shift so many times larger that it is seen: stretches of points.
function shifted(path) {
  const most = Math.max(...path.shift.map(Math.abs)) / 1000 || 1, times = 10 ** Math.round(Math.log10(4 / most)),
    runs = [], last = path.s_mm.length - 1;
  path.shift.forEach((v, i) => {
    if (!v || !path.cut[i]) { if (runs.at(-1)?.length) runs.push([]); return; }
    const [a, b] = [Math.max(0, i - 1), Math.min(last, i + 1)], by = v / 1000 * times;
    const dx = path.x_mm[b] - path.x_mm[a], dy = path.y_mm[b] - path.y_mm[a], long = Math.hypot(dx, dy) || 1;
    if (!runs.length) runs.push([]);
    runs.at(-1).push([path.x_mm[i] - by * dy / long, path.y_mm[i] + by * dx / long, path.z_mm[i]]);
  });
  return { times, runs };
}
function curve() {
  const path = state.program.path;
  if (layer()[2]) return path[which];
  if (which === "difference" && path.given) return path.now.map((v, i) => (v === null || path.given[i] === null ? null
    : v - path.given[i]));
  return which === "given" && path.given ? path.given : path.now;
}
const numbers = (values, keep) => Float32Array.from(values, (v, i) => (v === null || !keep(i) ? NaN : v));
function drawProfile() {
  const path = state.program?.path;
  $("profile-card").hidden = !path;
  $("profile").classList.toggle("stale", Boolean(path?.stale));
  if (!path) { profile = null; return; }
  const s = Float32Array.from(path.s_mm), cut = (i) => path.cut[i] && !path.plunge[i], shown = numbers(curve(), cut);
  const curves = () => {
    const found = [];
    if (which === "now" && path.sd) for (const sign of [-1.96, 1.96]) found.push(
      { s, k: numbers(path.now.map((v, i) => (v === null ? null : v + sign * path.sd[i])), cut), colour: ink.rapid });
    if (which === "now" && path.given && path.given.some((v, i) => v !== path.now[i])) found.push(
      { s, k: numbers(path.given, cut), colour: ink.second });
    return [...found, { s, k: shown, colour: ink.curve }];
  };
  const model = {
    s, value: (i) => shown[i], curves, ends: () => scene.ends, unit: () => layer()[0],
    here: () => here,
    beside: () => null,
    levels: () => (state.program?.require && which !== "difference" && !layer()[2]
      ? [{ value: state.program.require, colour: ink.bad, dash: [6, 4], held: true }] : []),
  };
  if (profile) { profile.model = model; profile.all(); profile.redraw(); }
  else profile = new Profile($("profile"), model,
    { point: goTo, step: (by) => goTo(Math.max(0, Math.min(s.length - 1, here + by))) });
  $("scrub").max = path.s_mm.length - 1;
  const focus = document.activeElement?.id;
  $("which").replaceChildren(...["now", "given", ...(path.given ? ["difference"] : []),
    ...Object.keys(LAYERS).filter((name) => path[name])]
    .map((name) => h("button", { type: "button", id: `which-${name}`, "aria-pressed": String(which === name),
    onclick: () => { which = name; classify(); drawProfile(); drawLegend(); view.redraw();
      drawText(path.line[Math.max(0, here)]); } }, name)));
  refocus(focus, "");
  const other = which === "now" && path.given?.some((v, i) => v !== path.now[i]);
  $("curves").textContent = [layer()[2], other && "orange: given", which === "now" && path.sd && "grey: 95 % band",
    state.program.require && !layer()[2] && "dashed: required"].filter(Boolean).join(", ");
}
function goTo(i) {
  const path = state.program?.path;
  if (!path || !(i >= 0)) return;
  here = scene.sample = Math.round(i);
  scene.selected = -1;
  scene.pose = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"].map((k) => path[k][here]);
  $("scrub").value = here;
  const k = path.now[here];
  $("status").textContent =
    `line ${path.line[here]} \u00b7 ${k === null ? "out of reach" : `${group(k)} N/mm`}`
      + `${path.sd?.[here] ? ` \u00b1 ${group(1.96 * path.sd[here])} (95 %)` : ""}`
      + `${path.given?.[here] ? `, as given ${group(path.given[here])}` : ""} \u00b7 X${path.x_mm[here].toFixed(1)} `
      + `Y${path.y_mm[here].toFixed(1)} Z${path.z_mm[here].toFixed(1)} mm `
      + `\u00b7 margin ${path.margin[here]?.toFixed(3) ?? "\u2013"}`
      + Object.entries(LAYERS).map(([name, [unit, digits]]) => (typeof path[name]?.[here] === "number"
        ? ` \u00b7 ${name} ${path[name][here].toFixed(digits)} ${unit}` : "")).join("");
  view.redraw();
  profile?.drawOverlay();
  drawText(path.line[here]);
}
// The program's text; the bar of a line is its lowest stiffness, or what else the path shows at its worst.
let listing = null, barred = null;
function drawText(line) {
  const box = $("text"), p = state.program;
  if (!box || !p) return;
  const shown = p.path && (layer()[2] ? curve() : p.path.now), [unit, digits] = layer();
  if (listing?.element !== box || barred !== shown) {
    const lowest = new Map(), worse = (a, b) => (digits ? Math.abs(a) > Math.abs(b) : a < b);
    barred = shown;
    p.path?.line.forEach((n, i) => { if (p.path.cut[i] && shown[i] !== null
      && (!lowest.has(n) || worse(shown[i], lowest.get(n)))) lowest.set(n, shown[i]); });
    listing = new Listing(box, p.lines, {
      colour: (n) => (lowest.has(n) ? coloursNow()[classAt(lowest.get(n), scene.ends, CLASSES)] : undefined),
      title: (n) => (lowest.has(n) ? `${group(lowest.get(n), digits)} ${unit}` : ""),
      choose: (n) => { const i = p.path?.line.indexOf(n) ?? -1; if (i >= 0) goTo(i); else listing.show(n); },
    });
  }
  listing.show(line);
}
function play() {
  const path = state.program?.path;
  if (!playing || !path) return;
  goTo((here + Math.max(1, Math.round(path.s_mm.length / 900))) % path.s_mm.length);
  playing = requestAnimationFrame(play);
}
// Drawing the state.
function drawLegend() {
  const parts = [];
  if (state.readings) parts.push(h("div", { title: "Larger dots: larger errors. Rings: set aside." },
    `softer \u2212${group(scene.scale)} %`,
    h("span", { class: "ramp",
    style: `background:${ramp([-1, -0.5, 0, 0.5, 1].map((t) => errorColour(t * scene.scale, scene.scale)))}` }),
    `+${group(scene.scale)} % stiffer`));
  if (state.program?.path) { const [unit, digits] = layer(); parts.push(h("div", {},
    `path ${group(scene.ends[0], digits)}`, h("span", { class: "ramp" }),
    `${group(scene.ends[1], digits)} ${unit}`)); }
  if (scene.shifted) parts.push(h("div", {}, `orange: compensated, its shift ${group(scene.shifted.times)} times`));
  $("legend").replaceChildren(...parts);
}
function drawPanel() {
  const typed = document.activeElement, focus = typed?.id, [, , make] = PANELS.find(([name]) => name === panel);
  $("tabs").replaceChildren(...PANELS.map(([name, label]) => h("button", { type: "button", role: "tab",
    id: `tab-${name}`, "aria-selected": String(name === panel), "aria-controls": "panel", tabindex: name === panel ? "0"
    : "-1", onclick: () => open(name) }, label)));
  $("panel").setAttribute("aria-labelledby", `tab-${panel}`);
  const within = $("panel").contains(typed);
  $("panel").replaceChildren(...[make(state, act)].flat(9).filter(Boolean));
  if (panel === "program") drawText(state.program?.path?.line[Math.max(0, here)] ?? 1);
  refocus(focus, within ? "panel" : "");
}
// What was drawn anew takes the focus that it had; where it is gone or can no longer be used, its surroundings do.
function refocus(id, instead) {
  if (!id || document.activeElement?.id === id) return;
  $(id)?.focus({ preventScroll: true });
  if (document.activeElement?.id !== id && instead) $(instead).focus({ preventScroll: true });
}
function open(name) { panel = name; drawPanel(); $(`tab-${name}`).focus({ preventScroll: true }); }
$("tabs").addEventListener("keydown", (e) => {
  const by = { ArrowRight: 1, ArrowLeft: -1 }[e.key], names = PANELS.map(([name]) => name);
  if (by) { e.preventDefault(); open(names[(names.indexOf(panel) + by + names.length) % names.length]); }
  if (e.key === "Home" || e.key === "End") { e.preventDefault(); open(names.at(e.key === "Home" ? 0 : -1)); }
});
// While a finger or the mouse holds something of the panel, it is not drawn anew.
let held = false, late = false;
$("panel").addEventListener("pointerdown", () => { held = true; });
for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => {
  held = false;
  if (late) setTimeout(draw);  // after the change of what was held has been told
});
function draw() {
  late = held;
  if (held) return;
  scene.take(state, state.effects.filter((one) => one.on).map((one) => ({ link: one.link,
    name: one.on.strut ? `strut ${one.on.strut}` : one.on.element })));
  const r = state.readings, v = state.verdict;
  scene.deviation = r?.deviation ?? [];
  const sizes = scene.deviation.filter((d) => d !== null).map(Math.abs).sort((a, b) => a - b);
  if (!scene.scaled && sizes.length) { scene.scale = Math.max(5,
    5 * Math.ceil(sizes[Math.floor(0.95 * sizes.length)] / 5)); scene.scaled = true; }
  if (scene.selected >= (r?.line.length ?? 0)) scene.selected = -1;
  const home = (state.program?.origin ?? state.machine.origin).slice(0, 3);
  if (scene.selected < 0 && here < 0) scene.pose = [...home, 0, 0, 0];
  if (!pending) act.origin = [...(state.program?.origin ?? state.machine.origin)];
  $("title").textContent = state.case;
  $("machine-name").textContent =
    `${state.machine.title}${r ? `, ${r.line.length - r.aside.filter(Boolean).length} readings` : ""}`
      + `${state.program ? `, ${state.program.name}` : ""}`;
  document.title = `${state.case}: toolpath_stiff studio`;
  const waiting = !r ? "What does the machine do, and does the model say so?" : v ? "" : state.unjudged
    ? "The readings are not judged" : "Judging the readings";
  $("sentence").classList.toggle("waiting", Boolean(waiting));
  const [, said, name] = v?.sentence.match(/^(.*) \(([^()]*)\)$/) ?? [0, v?.sentence, ""];
  // The gauge has the errors, and "Why believe it?" the whole text.
  const rest = v?.text.slice(v.sentence.length + 2).split(/(?<=\.) (?=[A-Z])/).filter((one) =>
    !/^(Mean error|Of all rivals)/.test(one));
  $("sentence").replaceChildren(...(waiting ? [waiting, state.unjudged && r ? h("small", {}, told(state.unjudged), " ",
    button("Judge them", () => act({ do: "diagnose" }), { id: "judge" })) : ""]
    : [told(`${said}.`), h("small", {}, told([name ? `${name}.` : "", ...rest].join(" ")))]));
  $("gauge").replaceChildren(gaugeOf(state));
  if ($("undo")) $("undo").disabled = !state.history[1];
  scene.paths = [];
  if (state.program?.path && here >= state.program.path.s_mm.length) here = scene.sample = -1;
  classify();
  drawProfile();
  drawLegend();
  drawPanel();
  if (here >= 0 && scene.selected < 0) goTo(here);  // its figures are others now
  if (!scene.fitted) {
    scene.fitted = true;
    [view.yaw, view.pitch] = scene.iso;
    if (view.width) view.fit();
  }
  if (view.width) view.redraw();
}
const JOBS = { diagnose: "judging the readings", update: "fitting", analyze: "analyzing", compensate: "compensating",
  place: "searching", plan: "planning", compare: "comparing", draft: "drafting", set_up: "writing files" };
let began = { of: "", at: 0, done: 0 };  // the work that runs, when it was first seen, how far it was then
function drawJob(job) {
  if (readonly) return;
  const name = job ? JOBS[job.text] ?? job.text : "", now = performance.now();
  if (name !== began.of || (job && job.done < began.done)) began = { of: name, at: now, done: job?.done ?? 0 };
  const run = job?.total ? (now - began.at) / 1000 * (job.total - job.done) / Math.max(job.done - began.done, 1e-9) : 0;
  $("job").classList.toggle("busy", Boolean(job));
  $("job").textContent = !job ? "" : [name, job.total ? `${Math.round(100 * job.done / job.total)} %` : "",
    job.total && job.done > began.done && run > 1 ? `about ${Math.ceil(run)} s left` : ""].filter(Boolean).join(", ");
  $("cancel").hidden = !job;
}
let asking = null, version = -1;
async function refresh() {
  if (readonly) return;
  asking ??= (async () => {
    try {
      const found = await (await fetch("/state")).json();
      if (found.error) { tell(found.error); return; }
      const [was, now] = [state?.program, found.program];
      // Until the program is analyzed anew its path stands where it lies now, with the figures of before, pale.
      if (was?.path && now && !now.path && !now.error && was.name === now.name) {
        const [x_mm, y_mm, z_mm] = carried(was, now.origin);
        now.path = { ...was.path, x_mm, y_mm, z_mm, stale: true };
      }
      state = found;
      version = found.version;
      drawJob(found.job);
      draw();
    } finally { asking = null; }
  })();
  await asking;
}
// Controls.
for (const one of document.querySelectorAll("[data-focus]")) one.addEventListener("click", () => {
  scene.focus = one.dataset.focus;
  for (const other of document.querySelectorAll("[data-focus]")) other.setAttribute("aria-pressed",
    String(other === one));
  view.turnTo("fit");
});
$("scrub").addEventListener("input", (e) => goTo(Number(e.target.value)));
$("play").addEventListener("click", () => {
  if (playing) cancelAnimationFrame(playing);
  playing = playing ? 0 : 1;
  $("play").setAttribute("aria-pressed", String(Boolean(playing)));
  $("play").textContent = playing ? "Pause" : "Play";
  play();
});
watchTheme(() => { if (state) { drawLegend(); view.redraw(); profile?.redraw(); } });

// What a program is read with comes before the program.
const ordered = (files) => [...files].sort((a, b) => /\.(tbl|var|toml|csv)$/i.test(b.name)
  - /\.(tbl|var|toml|csv)$/i.test(a.name));
async function take(file, run = false) {
  try {
    const found = await post(`/file?name=${encodeURIComponent(file.name)}${run ? "&run=yes" : ""}`, file);
    if (found.confirm) {
      $("ask-text").textContent = found.confirm;
      $("yes").onclick = () => { $("ask").close(); take(file, true); };
      $("no").onclick = () => $("ask").close();
      $("ask").showModal();
      return;
    }
    await refresh();
    tell(found.message, true);
    if (state.program && !/\.(csv|xlsx|toml|py)$/i.test(file.name)) open("program");
  } catch (error) { tell(error.message); }
}
// What one does first, until it is put away.
$("guide").hidden = readonly || document.cookie.includes("tps_guided");  // the port is another at each start
$("guided").addEventListener("click", () => { $("guide").hidden = true;
  document.cookie = "tps_guided=yes; max-age=31536000; SameSite=Strict"; });
window.tpsStudio = { spots: () => scene.spots.map((spot) => [...spot]) };  // where readings stand on the screen
if (readonly) draw();
else {
  for (const name of ["undo", "cancel"]) $(name).addEventListener("click", () => act({ do: name }));
  $("open").addEventListener("click", () => $("file").click());
  $("file").addEventListener("change", async (e) => { for (const file of ordered(e.target.files)) await take(file);
    e.target.value = ""; });
  addEventListener("dragover", (e) => { e.preventDefault(); $("drop").hidden = false; });
  addEventListener("dragleave", (e) => { if (!e.relatedTarget) $("drop").hidden = true; });
  addEventListener("drop", async (e) => { e.preventDefault(); $("drop").hidden = true;
    for (const file of ordered(e.dataTransfer.files)) await take(file); });
  addEventListener("keydown", (e) => {
    if (!(e.ctrlKey || e.metaKey) || e.target.matches("input[type=number]")) return;
    if (e.key.toLowerCase() === "z") { e.preventDefault(); act({ do: "undo" }); }
  });
  const news = new EventSource("/events");
  news.onmessage = async (e) => {
    const told = JSON.parse(e.data);
    drawJob(told.job);
    if (told.message) tell(told.message);
    for (let k = 0; k < 2 && told.version !== version; k++) await refresh();  // one under way may be of before
  };
  news.onerror = () => { $("job").textContent = "the studio does not answer; it resumes when it is started again"; };
  refresh();
}
