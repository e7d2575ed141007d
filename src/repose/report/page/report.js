// What moves on the page: the copy button, tables that sort, gauges, sliders, the 3-D view.
"use strict";

const content = JSON.parse(document.getElementById("content").textContent);
const byId = (id) => document.getElementById(id);

function made(tag, attributes, ...children) {
  const svg = ["svg", "rect", "line", "circle", "path", "text"].includes(tag);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function digits(value, count = 4) {
  return value === null || !Number.isFinite(value) ? "–" : String(Number(value.toPrecision(count)));
}

function percent(share) {
  if (share > 0.995) return "more than 99 %";
  return share < 0.005 ? "less than 1 %" : `${Math.round(100 * share)} %`;
}

// Abramowitz & Stegun 7.1.26: the normal distribution, to 1.5e-7.
function normalBelow(z) {
  const t = 1 / (1 + (0.3275911 * Math.abs(z)) / Math.SQRT2);
  const tail = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
  const half = (tail * Math.exp((-z * z) / 2)) / 2;
  return z < 0 ? half : 1 - half;
}

function shareInside(low, high, mean, std) {
  if (!(std > 0)) return mean >= low && mean <= high ? 1 : 0;
  return normalBelow((high - mean) / std) - normalBelow((low - mean) / std);
}

// One response on a line: the target's range, what was measured, what a simulation or the surrogate gives.
function gauge(target, value, error, word) {
  const [low, high] = target.axis, wide = 640, left = 8, x = (v) => left + ((v - low) / (high - low)) * (wide - 2 * left);
  const clipped = (v) => Math.max(low, Math.min(high, v));
  const box = made("svg", { viewBox: `0 0 ${wide} 62`, role: "img", class: "gauge" });
  box.append(
    made("line", { x1: x(low), x2: x(high), y1: 31, y2: 31, class: "axis" }),
    made("rect", { x: x(target.low), width: x(target.high) - x(target.low), y: 14, height: 34, class: "band" }),
    made("line", { x1: x(clipped(target.value - target.sd)), x2: x(clipped(target.value + target.sd)), y1: 22, y2: 22, class: "measured" }),
    made("path", { d: `M${x(target.value)} 15l6 7-6 7-6-7z`, class: "measured" }),
    made("text", { x: x(low), y: 61 }, digits(low, 3)), made("text", { x: x(high), y: 61, "text-anchor": "end" }, digits(high, 3)));
  if (value !== null && Number.isFinite(value)) {
    if (error > 0) box.append(made("line", { x1: x(clipped(value - 1.96 * error)), x2: x(clipped(value + 1.96 * error)), y1: 40, y2: 40, class: "found" }));
    box.append(made("circle", { cx: x(clipped(value)), cy: 40, r: 6, class: "found" }));
  }
  box.setAttribute("aria-label", `${target.label}: ${word} ${digits(value)}, target ${target.low} to ${target.high} ${target.unit}`);
  return box;
}

function drawChecks() {
  content.targets.forEach((target, k) => {
    byId("checks").append(made("div", {}, made("p", { class: "name" }, `${target.label} (${target.unit || "no unit"})`),
      gauge(target, target.simulated, target.error, "simulated")));
  });
}

// The curves of a surrogate other than the network: linear between their points, one parameter at a time.
function curvePredictor(model) {
  return function (values, moved) {
    const { low, high } = content.parameters.find((one) => one.name === moved);
    const { mean, std } = model.curves[moved], value = values[content.parameters.findIndex((one) => one.name === moved)];
    const at = ((value - low) / (high - low)) * (mean.length - 1), first = Math.min(Math.floor(at), mean.length - 2);
    const between = (rows) => rows[first].map((one, k) => one + (at - first) * (rows[first + 1][k] - one));
    return { mean: between(mean), std: between(std) };
  };
}

function setUpSliders() {
  const whole = content.model.kind === "network";
  const predict = whole ? networkPredictor(content.model) : curvePredictor(content.model);
  const answer = content.parameters.map((one) => one.value), values = [...answer];
  const free = content.parameters.filter((one) => !one.fixed);
  const rows = {};
  function update(moved) {
    const { mean, std } = predict(values, moved);
    byId("predictions").replaceChildren(...content.targets.map((target, k) => {
      const inside = shareInside(target.low, target.high, mean[k], std[k]);
      return made("div", { class: "prediction" },
        made("p", { class: "name" }, `${target.label}: `, made("b", { id: `predicted-${target.name}` }, `${digits(mean[k])} ± ${digits(1.96 * std[k], 2)} ${target.unit}`)),
        gauge(target, mean[k], std[k], "predicted"),
        made("p", { class: inside >= 0.5 ? "good" : "bad" }, `inside the target's range ${digits(target.low)} to ${digits(target.high)}: ${percent(inside)}`));
    }));
  }
  function set(index, value) {
    values[index] = value;
    const one = content.parameters[index], row = rows[one.name];
    row.input.value = value;
    row.shown.textContent = digits(value, 3);
  }
  const home = () => content.parameters.forEach((one, index) => { if (rows[one.name]) set(index, answer[index]); });
  content.parameters.forEach((one, index) => {
    if (one.fixed) return;
    const shown = made("output", {}, "");
    const input = made("input", { type: "range", min: one.low, max: one.high, step: (one.high - one.low) / 400, id: `slide-${one.name}` });
    rows[one.name] = { input, shown };
    input.addEventListener("input", () => {
      const value = Number(input.value);
      if (!whole) home();
      set(index, value);
      update(one.name);
    });
    byId("sliders").append(made("label", { for: input.id }, made("span", {}, made("code", {}, one.name), ` ${one.label}`), shown, input));
  });
  byId("home").addEventListener("click", () => { home(); update(free[0].name); });
  home();
  update(free[0].name);
}

function setUpCopy() {
  byId("copy").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(content.copy);
    } catch {
      const area = made("textarea", {});
      area.value = content.copy;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    byId("copy").textContent = "Copied";
    setTimeout(() => { byId("copy").textContent = "Copy the parameters"; }, 2000);
  });
}

// A click on a head sorts by that column, a second one the other way round.
function setUpTables() {
  for (const table of document.querySelectorAll("table.sorts")) {
    table.querySelectorAll("thead th").forEach((head, column) => {
      const button = made("button", { type: "button" }, head.textContent);
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const up = head.getAttribute("aria-sort") !== "ascending", body = table.tBodies[0];
        table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", up ? "ascending" : "descending");
        const key = (row) => row.cells[column].textContent;
        const rows = [...body.rows].sort((a, b) => {
          const [p, q] = [key(a), key(b)], numbers = [Number(p), Number(q)];
          if (!p || !q) return p ? -1 : q ? 1 : 0; // empty cells last, either way
          const order = numbers.every(Number.isFinite) ? numbers[0] - numbers[1] : p.localeCompare(q);
          return up ? order : -order;
        });
        body.append(...rows);
      });
    });
  }
}

// A figure opens at its full size; Escape, the button or a click beside it closes.
function setUpLarge() {
  const large = byId("large"), shown = large.querySelector("img");
  for (const button of document.querySelectorAll("button.enlarge")) {
    button.addEventListener("click", () => {
      const { src, alt } = button.querySelector("img");
      Object.assign(shown, { src, alt });
      large.setAttribute("aria-label", alt);
      large.showModal();
    });
  }
  large.addEventListener("click", (event) => { if (event.target === large) large.close(); });
}

function setUpView() {
  if (!content.pour) return;
  const slider = byId("time"), times = content.pour.times_s;
  let view, timer = null;
  try {
    view = pourView(byId("pile"), content.pour);
  } catch (error) {
    byId("view").replaceChildren(made("p", { class: "note" }, "This browser draws no 3-D pictures (WebGL is off)."));
    return;
  }
  slider.max = times.length - 1;
  slider.value = times.length - 1;
  const show = (frame) => {
    slider.value = frame;
    byId("clock").textContent = `${times[frame].toFixed(1)} s`;
    view.show(frame);
  };
  const stop = () => { clearInterval(timer); timer = null; byId("play").textContent = "Play the pour"; };
  slider.addEventListener("input", () => {
    stop();
    if (view.looksAt() !== "pour") view.look("pour");
    show(Number(slider.value));
  });
  byId("play").addEventListener("click", () => {
    if (timer) { stop(); return; }
    view.look("pour");
    if (Number(slider.value) >= times.length - 1) show(0);
    byId("play").textContent = "Stop";
    timer = setInterval(() => {
      const next = Number(slider.value) + 1;
      if (next >= times.length) stop(); else show(next);
    }, 90);
  });
  for (const name of ["side", "above", "pour"]) byId(`look-${name}`).addEventListener("click", () => view.look(name));
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const dress = () => view.dress(dark.matches);
  dark.addEventListener("change", dress);
  window.addEventListener("beforeprint", () => { stop(); view.look("side"); view.dress(false); show(times.length - 1); });
  window.addEventListener("afterprint", dress);
  dress();
  show(times.length - 1);
}

drawChecks();
setUpCopy();
setUpTables();
setUpLarge();
if (content.model) setUpSliders();
setUpView();
