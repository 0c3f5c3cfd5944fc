// The panels beside the machine. Each is a function of the state that gives elements; text is never taken for HTML.
const percent = (v, digits = 2) => (v === null || v === undefined ? "\u2013" : `${v.toFixed(digits)} %`);
const chance = (p) => (p > 0.99 ? "> 99 %" : p < 0.01 ? "< 1 %" : `${Math.round(100 * p)} %`);
const short = (v) => (typeof v !== "number" ? String(v) : Math.abs(v) >= 1e5 ? group(Number(v.toPrecision(4)))
  : String(Number(v.toPrecision(4))));
const button = (label, run, attributes = {}) => h("button", { type: "button", class: "live", onclick: run,
  ...attributes }, label);
// Text of a result: a figure stays beside its unit where a line breaks.
const told = (text) => text.replace(/ \+- /g, " \u00b1 ").replace(/N m\b/g, "N\u00a0m")
  .replace(/(\d) (?=%|([kM]?N|[mun]?m|deg|minutes)\b)/g, "$1\u00a0");
const list = (items) => h("ul", {}, items.map((text) => h("li", {}, told(text))));
const unfolded = new Set(["Plane by direction"]);  // titles
const folding = (title, rows, id) => h("details", { id, open: unfolded.has(title),
  ontoggle: (e) => unfolded[e.target.open ? "add" : "delete"](title) }, h("summary", {}, title), rows);
const table = (head, rows) => h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "table" },
  h("table", {}, h("thead", {}, h("tr", {}, head.map((t) => h("th", { scope: "col" }, t)))),
  h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell) => h("td", typeof cell === "string" && cell.length > 24
    ? { class: "long" } : {}, cell)))))));
const figures = (pairs) => h("div", { class: "figures" }, pairs.map(([name, value, id, before]) => h("div", {},
  h("b", id ? { id } : {}, value), h("span", {}, name), before ? h("span", { class: "before" }, before) : null)));
// The gauge.
const STAGES = [["as_given", "as the file stands"], ["refitted", "strut law refitted"], ["now", "effects on"],
  ["left_out", "at left-out points"]];
function gaugeOf(state) {
  const g = state.gauge;
  if (!g) return h("p", { class: "muted" },
    "Drop a measurement file on the page, or start a blind exercise: the error of the model stands here then.");
  const most = Math.max(...STAGES.map(([key]) => g[key] ?? 0), g.floor ?? 0) * 1.04 || 1, width = (v) =>
    `${100 * Math.min(1, v / most)}%`;
  const stages = STAGES.filter(([key]) => key !== "refitted" || state.machine.scene.joints);  // struts alone have a law
  return h("dl", { class: "gauge", "aria-label": "Mean error of the model" }, stages.map(([key, label]) => {
    const note = key === "left_out" && g[key] === null ? "after Fit" : percent(g[key]);
    return [h("dt", {}, label), h("dd", { class: "track", "aria-hidden": "true" },
      h("span", { class: `fill ${key}`, style: `width:${width(g[key] ?? 0)}` }),
      g.floor === null ? null : h("span", { class: "floor", style: `left:${width(g.floor)}` })),
        h("dd", { class: "number", id: `g-${key}` }, note)];
  }), h("dt", {}, "noise floor"), h("dd", { class: "muted" }, "dashed line"),
    h("dd", { class: "number", id: "g-floor" }, percent(g.floor)));
}
// Effects.
function effectsPanel(state, act) {
  if (!state.effects.length) return h("p", {}, "All effects of the catalogue are in the machine.");
  const sets = state.verdict?.entries ?? [], done = new Set(), rows = [], folded = [];
  for (const effect of state.effects) {
    if (done.has(effect.name)) continue;
    const set = sets.find((names) => names.includes(effect.name)) ?? [effect.name];
    const members = state.effects.filter((one) => set.includes(one.name));
    members.forEach((one) => done.add(one.name));
    const drawn = members.map((one) => effectRow(one, act));
    const matters = !state.verdict || rows.length < 2 || members.some((one) => one.on || one.probability >= 0.01);
    (matters ? rows : folded).push(members.length > 1 ? h("fieldset", { class: "together" },
      h("legend", {}, "these data cannot tell these apart"), drawn) : drawn);
  }
  const on = state.effects.some((one) => one.on), fit = state.fit;
  return [
    h("h2", {}, "Which effect is missing?"),
    h("div", { class: "actions" }, button("Fit", () => act({ do: "fit" }), { id: "fit", class: "main live",
      disabled: !on || !state.readings, title: on ? null : "switch an effect on first" }),
      button("Accept the fit", () => act({ do: "accept" }), { id: "accept", disabled: !(fit?.accepted && fit.holds) }),
      state.machine.effects.length ? h("span", { class: "muted" },
        `in the machine: ${state.machine.effects.join(", ")}`) : null),
    fit ? h("p", { id: "fit-text", class: fit.accepted ? "" : "warning" }, told(fit.text)) : null,
    (fit?.support ?? []).flatMap((one) => one.reasons).map((reason) => h("p", { class: "muted" }, told(reason))),
    portrait(state.verdict?.portrait, act),
    state.verdict ? null : h("p", { class: "muted" }, state.readings ? "The ranking comes with the diagnosis."
      : "Without readings nothing is ranked."),
    rows,
    folded.length ? folding("further effects, each less likely than 1 %", folded, "unlikely") : null,
    h("p", { class: "muted live" },
      "Drop a Python file with an effect of your own on the page: it joins these; dropped again, it is replaced."),
  ];
}
// What no effect explains, as far as the readings describe it.
function portrait(p, act) {
  if (!p) return null;
  const bars = (rows, key) => h("ul", { class: "shares" },
    rows.map((one) => h("li", {}, h("span", { class: "bars", "aria-hidden": "true" },
    h("i", { style: `width:${100 * (one.probability ?? 0)}%` })), ` ${one[key]} ${chance(one.probability ?? 0)}`)));
  return h("section", { class: "portrait", id: "portrait" }, h("h3", {}, "What the missing thing looks like"),
    h("p", {}, told(p.text)),
    h("div", { class: "two" }, h("div", {}, h("b", {}, "where"), bars(p.links, "link")),
      h("div", {}, h("b", {}, "varies with"), bars(p.variables, "variable"))),
    figures([["rms at left-out points", percent(p.held_out_rms_percent)],
      ["noise there", percent(p.noise_floor_percent)],
      ["of the misfit explained", percent(p.explained_percent, 0)]]),
    p.terms.length ? h("div", { class: "actions live" }, button("Draft it as an effect", () => act({ do: "draft" }),
      { id: "draft" }), h("span", { class: "muted" },
      "a commented file that competes with the others; new readings must confirm it")) : null);
}
function effectRow(effect, act) {
  const id = `sw-${effect.name}`, on = effect.on !== null;
  const toggle = (e) => act({ do: "switch", effect: effect.name, values: e.target.checked
    ? Object.fromEntries(effect.sliders.map((s) => [s.key, s.start])) : null });
  return h("div", { class: "effect" }, h("div", { class: "row" },
    h("input", { type: "checkbox", role: "switch", class: "switch", id, checked: on, onchange: toggle,
      "aria-checked": String(on), disabled: act.readonly }),
    h("label", { class: "name", for: id }, effect.title, h("code", {}, effect.name)),
    effect.probability === null ? null : h("span", { class: "chance" },
      h("span", { class: "bars", "aria-hidden": "true" }, h("i", { style: `width:${100 * effect.probability}%` })),
      chance(effect.probability))),
    effect.finding ? h("div", { class: "note" },
      [`${effect.finding}: mean error ${percent(effect.mean_abs_error_percent)}, `
        + `${percent(effect.held_out_error_percent)} at left-out points`, effect.words].filter(Boolean).join("; "))
      : effect.words ? h("div", { class: "note" }, [effect.words, effect.remark].filter(Boolean).join("; ")) : null,
    on ? h("div", { class: "sizes" }, effect.sliders.map((s) => slider(effect, s, act))) : null);
}
function slider(effect, s, act) {
  const id = `${effect.name}-${s.key}`, value = effect.on[s.key], set = (v) => ({ ...effect.on, [s.key]: v });
  if (s.choices) {
    const change = (e) => act({ do: "switch", effect: effect.name, values: set(s.kind === "integer"
      ? Number(e.target.value) : e.target.value) });
    return [h("label", { for: id }, s.name), h("select", { id, class: "wide", onchange: change, disabled: act.readonly
      }, s.choices.map((c) => h("option", { value: String(c), selected: c === value }, String(c) || "(none)")))];
  }
  const text = (v) =>
    `${short(v)} ${s.unit}${s.interval ? `  (${short(s.interval[0])} to ${short(s.interval[1])})` : ""}`;
  const out = h("output", { for: id, title: s.interval ? "95 % interval of the diagnosis" : "" }, text(value));
  return [h("label", { for: id, title: s.meaning }, s.name), h("input", { type: "range", id, min: s.low, max: s.high,
    step: (s.high - s.low) / 400, value, disabled: act.readonly,
    oninput: (e) => { out.textContent = text(Number(e.target.value));
      act.hand(effect.name, set(Number(e.target.value))); },
    onchange: (e) => act({ do: "switch", effect: effect.name, values: set(Number(e.target.value)) }) }), out];
}
// Why believe it.
const AGAINST = [["line", "line of the file"], ["x_mm", "X, mm"], ["y_mm", "Y, mm"], ["z_mm", "Z, mm"],
  ["a_deg", "A, deg"], ["b_deg", "B, deg"], ["c_deg", "C, deg"], ["force_N", "force, N"], ["stiffness_N_per_mm",
  "measured, N/mm"]];
let against = "z_mm";
function whyPanel(state, act) {
  const v = state.verdict;
  if (!v) return h("p", {}, state.readings ? "The diagnosis is under way." : "There are no readings yet.");
  const gates = Number.isFinite(v.gates?.squares_probability) && [
    ["a model without a further effect", v.gates.baseline_probability], ["sum of squares", v.gates.squares_probability],
    ["structure", v.gates.structure_probability], ["gain of the best effect", v.gates.gain_probability]];
  const c = state.compare;
  return [
    h("h2", {}, "Why believe it?"), h("p", {}, told(v.text)), list([...v.why, ...v.warnings]),
    h("h3", {}, "Residuals"), residuals(state, act),
    c ? folding("Plane by direction", [table(["readings", "number", "mean error", "bias", "rms"],
      Object.entries(c.by_plane_and_direction).map(([name, one]) => [name, one.readings,
        ...["mean_abs_error", "bias", "rms"].map((key) => percent(one[`${key}_percent`]))])),
    h("p", {}, told(c.text)), list(c.findings.map((one) => one.text)),
    h("a", { class: "live", href: `/case/${c.result}/report.html`, target: "_blank", rel: "noreferrer" },
      "the whole comparison, with residuals against every variable")])
      : button("Where the model fails", () => act({ do: "compare" }), { id: "compare" }),
    gates && folding("How often scatter alone would look so", table(["test", "probability"],
      gates.map(([name, p]) => [name, p === null ? "\u2013" : short(p)]))),
    folding("What is assumed", list(v.assumptions)), v.notes.length ? folding("Notes", list(v.notes)) : null,
  ];
}
function residuals(state, act) {
  const r = state.readings, values = r[against], dev = act.scene.deviation, pad = 42, end = 24, H = 210;
  const W = Math.min(520, $("panel").clientWidth - 24);  // letters keep their size on a phone
  const used = values.map((_, i) => i).filter((i) => !r.aside[i]), low = Math.min(...used.map((i) => values[i])),
    high = Math.max(...used.map((i) => values[i]));
  const most = Math.max(1, ...used.map((i) => Math.abs(dev[i] ?? 0))) * 1.08, x = (v) => pad + (v - low) / (high - low
    || 1) * (W - pad - end), y = (v) => H / 2 - 8 - v / most * (H / 2 - 26);
  const pick = h("select", { id: "against", "aria-label": "Variable", onchange: (e) => { against = e.target.value;
    act.redraw(); } }, AGAINST.map(([key, label]) => h("option", { value: key, selected: key === against }, label)));
  return [h("div", { class: "bar" }, h("label", { for: "against" }, "against "), pick),
    h("svg", { viewBox: `0 0 ${W} ${H}`, class: "drag", style: "cursor:default", role: "img",
    "aria-label": `Errors of ${used.length} readings against ${against}` },
    grid(ticks(-most, most, 4), false, y, pad, W - end), grid(ticks(low, high > low ? high : low + 1, W / 90), true, x,
      20, H - 32), h("line", { x1: pad, x2: W - end, y1: y(0), y2: y(0), stroke: "var(--muted)" }),
      h("text", { x: 4, y: 12 }, "error %"),
    used.map((i) => h("circle", { cx: x(values[i]).toFixed(1), cy: y(dev[i] ?? 0).toFixed(1), r: 3,
      fill: errorColour(dev[i] ?? 0, act.scene.scale), "fill-opacity": 0.8 })))];
}
// What to measure next.
function nextPanel(state, act) {
  const p = state.plan, count = h("input", { type: "number", id: "poses", min: 1, max: 60, value: p?.poses ?? 6 });
  return [
    h("h2", {}, "What to measure next"),
    h("p", { class: "muted" }, state.readings ? "Poses at which the explanations that are left differ most."
      : "A first campaign: poses that show most effects."),
    h("div", { class: "actions live" }, h("label", { for: "poses" }, "poses "), count, button("Make a plan",
      () => act({ do: "plan", n: Number(count.value) }), { id: "make-plan", class: "main live" })),
    p ? [list(p.text),
      h("p", {}, `${p.poses} poses, ${p.readings} readings, about ${Math.round(p.minutes)} minutes. `
        + `Diamonds in the machine.`),
      h("div", { class: "actions live" }, h("a", { class: "button", id: "plan-file",
        href: `/case/${p.result}/plan.csv` }, "Download plan.csv"), button("Print", () => print()),
        state.exercise.folder ? button("Measure on the exercise's machine", () => act({ do: "measure" }),
          { id: "measure", class: "main live" }) : h("span", { class: "muted" },
          "fill in the stiffness and drop the file on the page")),
      table(["clamping", "X mm", "Y mm", "Z mm", "A deg", "B deg", "C deg", "forces N", "why"], p.visits
        .map((v) => [v.clamp, v.x_mm, v.y_mm, v.z_mm, v.a_deg, v.b_deg, v.c_deg, v.forces_N.join(", "), v.why]
        .map(String)))] : null,
  ];
}
// The program.
function programPanel(state, act) {
  const p = state.program;
  if (!p) return [h("h2", {}, "The program"),
    h("p", {}, "Drop an NC program on the page, or open one: its path is coloured by stiffness, "
      + "and profile and text are linked. With the setup of its cut (cut.toml) by the error of its surface too.")];
  const s = p.summary, n = group;
  const need = h("input", { type: "number", id: "require", min: 0, step: 1000, value: p.require || "",
    placeholder: "none", onchange: (e) => act({ do: "require", value: Number(e.target.value || 0) }),
    disabled: act.readonly });
  return [
    h("h2", {}, p.name),
    p.error ? h("p", { class: "warning", id: "program-error" }, p.error, " ",
      button("Try again", () => act({ do: s ? "compensate" : "analyze" }))) : null,
    s ? [figures([["mean N/mm", n(s.mean_N_per_mm), "p-mean"], ["weakest N/mm", n(s.min_N_per_mm), "p-min"],
      ["range N/mm", n(s.range_N_per_mm), "p-range"], ["weakest in line", String(s.weakest?.line ?? "\u2013")],
      ...(s.plunges ? [["plunges, mean N/mm", n(s.plunges.mean_N_per_mm)]] : [])]),
      s.out_of_reach_samples ? h("p", { class: "warning", id: "out-of-reach" },
        `${s.out_of_reach_samples} samples of cuts are out of reach: red in the path`) : null,
      s.warnings.map((text) => h("p", { class: "warning" }, text))] : h("p", { class: "muted" }, p.error ? ""
        : "It is being analyzed."),
    s?.cut?.walls ? figures([["error of walls, mean \u00b5m", n(s.cut.walls.mean_um, 1), "p-error"],
      ["95 % within \u00b5m", n(s.cut.walls.p95_um, 1)], ...(p.compensated ? [["compensated, mean size \u00b5m",
      n(p.compensated.walls.mean_after_um, 2), "p-compensated"]] : [])]) : null,
    p.compensated ? h("p", { class: "live" }, h("a", { class: "button", href: `/case/${p.compensated.written}` },
      "Compensated program")) : null,
    h("div", { class: "actions" }, h("label", { for: "require" }, "required N/mm "), need, s?.required
      ? h("span", { id: "below", class: s.required.lines?.length ? "bad" : "good" }, s.required.lines?.length
      ? `${s.required.lines.length} lines are below` : "every cut has it") : null),
    h("div", { class: "listing", id: "text", tabindex: "0", role: "group", "aria-label": "Program text" }),
  ];
}
// The placement.
function placementPanel(state, act) {
  const p = state.placement;
  if (!p) return [h("h2", {}, "Placement"), h("p", {}, "Open a program first.")];
  const at = act.origin, ends = endsOf(state.machine.scene.reach.flat()), best = p.chosen?.number;
  const axes = [...["X", "Y", "Z"].map((name, k) => [name, k, ...ends[k].map(Math.round)]), ["C", 5, 0, 360]];
  return [
    h("h2", {}, "Where the work sits"),
    placementFigures(p.now, state, "pl"),
    h("div", { class: "where" }, dragMap(state, act), h("div", { class: "place live" }, axes
      .map(([name, axis, low, high]) => {
      const number = h("input", { type: "number", id: `o-${name}n`, "aria-label": `${name} of program zero`,
        step: axis === 5 ? 1 : 5, value: Number(at[axis].toFixed(3)), onchange: (e) => act.move(axis,
        Number(e.target.value), true) });
      return [h("label", { for: `o-${name}` }, name), h("input", { type: "range", id: `o-${name}`, min: low, max: high,
        step: 1, value: at[axis], oninput: (e) => { number.value = e.target.value;
        act.move(axis, Number(e.target.value), false); }, onchange: (e) => act.move(axis, Number(e.target.value), true)
        }), number];
    }))),
    h("div", { class: "actions live" }, button("Best", () => act({ do: "place" }), { id: "best", class: "main live" }),
      h("span", { class: "muted" },
      "searches the whole workspace; none of mean, range and weakest gets worse where that can be avoided")),
    setUp(p, state, act),
    p.front ? [(p.warnings ?? []).map((text) => h("p", { class: "warning" }, told(text))), h("h3", {}, "What it found"),
      table(["", "mean N/mm", "range N/mm", "weakest N/mm", "X mm", "Y mm", "Z mm", "C deg", ""], [...p.front]
        .sort((a, b) => (b.number === best) - (a.number === best)).map((row) => [row.number === best
          ? "recommended" : String(row.number), ...["mean", "range", "min"].map((k) => group(row[`${k}_N_per_mm`])),
        ...["x_mm", "y_mm", "z_mm", "rotation_deg"].map((k) => row[k].toFixed(1)),
        button("use", () => act({ do: "place_at", origin: [row.x_mm, row.y_mm, row.z_mm, row.a_deg, row.b_deg,
          row.rotation_deg] }), { id: `use-${row.number}`, "aria-label": `use point ${row.number}` })]))] : null,
  ];
}
const offsets = (blocks) => Object.entries(blocks ?? {}).filter(([name]) => !name.endsWith("_reason"))
  .map(([name, text]) => h("p", {}, `${name}: `, text ? h("code", {}, text) : h("span", { class: "muted" },
  blocks[`${name}_reason`] ?? "no block can say it")));
// For the shop floor, of the placement as it stands: offsets, set-up sheet, the program written for it, every warning.
function setUp(p, state, act) {
  const made = p.set_up, moved = state.program.placed;
  return [
    h("div", { class: "actions live" }, button("Offsets, set-up sheet, program", () => act({ do: "set_up" }),
      { id: "set-up", disabled: !moved }), h("span", { class: "muted" }, moved ? "for this placement, as files"
      : "move the work first")),
    made ? h("div", { id: "set-up-files" }, made.warnings.map((text) => h("p", { class: "warning" }, told(text))),
      offsets(made.offset_blocks),
      h("p", { class: "actions live" }, [["sheet", "Set-up sheet", `${made.result}/setup.pdf`],
        ["written", made.written.endsWith("not_written.txt") ? "Why the program was not written"
          : "Program for this placement", made.written], ["page", "Report", `${made.result}/report.html`]]
        .map(([key, label, file]) => h("a", { class: "button", id: `set-up-${key}`, href: `/case/${file}`,
          target: key === "page" ? "_blank" : null, rel: "noreferrer" }, label)))) : null,
  ];
}
function placementFigures(now, state, id) {
  const figure = (one, key) => (!Number.isFinite(one?.[key]) ? "\u2013"
    : key.endsWith("margin") ? group(100 * one[key], 1) : group(one[key]));
  const shown = [["mean N/mm", "mean_N_per_mm", "pl-mean"], ["range N/mm", "range_N_per_mm", "pl-range"],
    ["weakest N/mm", "min_N_per_mm", "pl-min"], ["margin of cuts, %", "margin", "pl-margin"],
    ["margin of rapids, %", "rapid_margin"]];
  return h("div", { id }, figures(shown.map(([name, key, label]) => [name, figure(now, key), label,
    ` before ${figure(state.placement?.before, key)}`])),
  now && now.mean_N_per_mm === null ? h("p", { class: "warning" }, "A cut is out of reach here.") : null);
}
// The boundary of the reach at the height of program zero, from above: the farthest crossing of each meridian.
function outline(reach, z) {
  const found = [];
  for (let k = 0; k < reach[0].length; k++) {
    let best = null;
    for (let i = 1; i < reach.length; i++) {
      const [a, b] = [reach[i - 1][k], reach[i][k]];
      if ((a[2] - z) * (b[2] - z) > 0 || a[2] === b[2]) continue;
      const [x, y] = between(a, b, (z - a[2]) / (b[2] - a[2]));
      const far = Math.hypot(x - reach[0][0][0], y - reach[0][0][1]);
      if (!best || far > best[2]) best = [x, y, far];
    }
    if (best) found.push([best[0], best[1]]);
  }
  return found;
}
function dragMap(state, act) {
  const reach = outline(state.machine.scene.reach, act.origin[2]), path = state.program?.path;
  const bounded = act.scene.body.hangs || act.scene.body.slides;  // rays from the middle of a hollow space say little
  const [[left, right], [near, far]] = endsOf(state.machine.scene.reach.flat()), pen = (right - left) / 300;
  const [xs, ys] = path ? carried(state.program, [0, 0, 0, 0, 0, 0]) : [[], []], step = Math.ceil(xs.length / 900);
  const points = Array.from(xs, (x, i) => [x, ys[i]]).filter((_, i) => i % step === 0 && path.cut[i]);
  const work = h("g", {}, h("polyline", { points: points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" "),
    fill: "none", stroke: "var(--blue)", "stroke-width": pen }), h("circle", { r: 2.4 * pen, fill: "var(--pink)" }),
    h("line", { x1: 0, y1: 0, x2: 18 * pen, y2: 0, stroke: "var(--pink)", "stroke-width": pen }));
  const put = () => work.setAttribute("transform",
    `translate(${act.origin[0]} ${act.origin[1]}) rotate(${act.origin[5]})`);
  put();
  act.put = put;
  const viewBox = [left - 9 * pen, -far - 9 * pen, right - left + 18 * pen, far - near + 18 * pen].join(" ");
  const where = (e) => { const m = svg.getScreenCTM().inverse(), p = new DOMPoint(e.clientX, e.clientY).matrixTransform(
    m); return [p.x, -p.y]; };
  let last = null;
  const svg = h("svg", { viewBox, class: "drag live", id: "drag", role: "application", tabindex: "0",
    "aria-label": "Work over the reach boundary, from above. Drag or use arrow keys to move, Shift to turn.",
    onpointerdown: (e) => { svg.setPointerCapture(e.pointerId); last = where(e); },
    onpointermove: (e) => {
      if (!last) return;
      const [dx, dy] = minus(where(e), last);
      if (e.shiftKey) act.shift(5, dx / 4); else { act.shift(0, dx); act.shift(1, dy); }
      last = where(e);
    },
    onpointerup: () => { if (last) act.drop(); last = null; },
    onkeydown: (e) => {
      const by = { ArrowLeft: [0, -10], ArrowRight: [0, 10], ArrowUp: [1, 10], ArrowDown: [1, -10] }[e.key];
      if (!by) return;
      e.preventDefault();
      if (e.shiftKey) act.shift(5, Math.sign(by[1]) * 5); else act.shift(...by);
      act.drop();
    } },
  h("g", { transform: "scale(1 -1)" }, bounded && h("polygon", { points: reach.map((p) => p.map((v) => v.toFixed(0))
    .join(",")).join(" "), fill: "var(--soft)", stroke: "var(--muted)", "stroke-width": pen }),
  [[12 * pen, 0], [0, 12 * pen]].map(([x, y]) => h("line", { x1: -x, x2: x, y1: -y, y2: y, stroke: "var(--muted)",
    "stroke-width": pen / 2 })), work));
  return svg;
}
// The exercise, the history.
function exercisePanel(state, act) {
  const seed = h("input", { type: "number", id: "seed", min: 0, value: 7 }), r = state.exercise.reveal;
  const layout = h("select", { id: "layout", "aria-label": "Campaign" }, h("option", { value: "tilted" },
    "24 tilted poses, 288 readings"), h("option", { value: "paper" }, "14 points along X, Y, Z, 42 readings"));
  const claim = h("select", { id: "claim" }, ["none", "outside", ...state.effects.map((one) => one.name),
    ...state.machine.effects].map((name) => h("option", { value: name, selected: name === state.verdict?.best },
    name)));
  return [
    h("h2", {}, "Blind exercise"), h("p", { class: "muted" },
      "A simulated machine hides something. It shares no stiffness code with the model. "
        + "Find out what, say it, then open the seal."),
    h("div", { class: "actions live" }, h("label", { for: "seed" }, "seed "), seed, layout, button("Start an exercise",
      () => act({ do: "exercise", seed: Number(seed.value), layout: layout.value }), { id: "start-exercise",
      class: state.exercise.folder ? "live" : "main live" })),
    state.exercise.folder ? [h("div", { class: "actions live" }, h("label", { for: "claim" }, "what is hidden? "),
      claim, button("Reveal", () => act({ do: "claim", effects: claim.value }), { id: "reveal", class: "main live" }))]
      : null,
    r ? [h("p", { id: "revealed", class: r.verdict === "wrong" ? "bad" : "good" },
      `claim ${r.claim.join(", ")}: ${r.verdict}`),
      r.effects.length ? list(r.effects
        .map((e) => `hidden: ${e.effect} (${Object.entries(e.parameters).map(([k, v]) => `${k} ${short(v)}`)
          .join(", ")}); changes the readings by ${percent(100 * e.size, 1)} (rms)`))
        : h("p", {}, "nothing was hidden")] : null,
  ];
}
function historyPanel(state, act) {
  const copy = (text) => button("copy", (e) => { navigator.clipboard?.writeText(text); e.target.textContent = "copied";
    }, { "aria-label": `copy ${text.slice(0, 40)}` });
  const line = (text) => (text ? h("div", { class: "line" }, h("code", {}, text), copy(text)) : null);
  const step = (one) => h("div", { class: "step" }, h("b", {}, one.stops > 1 ? `${one.text} (${one.stops} stops)`
    : one.text), line(one.command), line(one.python));
  return [h("h2", {}, "What was done"), h("p", { class: "muted" },
    "Commands run in the case's folder; Python lines on case = tps.Case.open(folder)."),
    h("div", { class: "steps" }, folded([...state.history].reverse()).map(step))];
}
// Steps, latest first: of the stops of one slider, or of one move of the work, the latest stands for all.
// What was worked out at a stop that has passed goes with it.
function folded(steps) {
  const rows = [], of = (one) => (["switch", "place_at"].includes(one?.kind) ? `${one.kind} ${one.text.split(" ")[0]}`
    : null);
  for (const one of steps) {
    const last = rows.findLastIndex((row) => !["analyze", "compensate"].includes(row.kind));
    if (of(one) && of(one) === of(rows[last])) { rows[last].stops++; rows.length = last + 1; }
    else rows.push({ ...one, stops: 1 });
  }
  return rows;
}
const PANELS = [["effects", "Effects", effectsPanel], ["why", "Why believe it?", whyPanel], ["next", "Next", nextPanel],
  ["program", "Program", programPanel], ["placement", "Placement", placementPanel], ["exercise", "Exercise",
  exercisePanel], ["history", "History", historyPanel]];
