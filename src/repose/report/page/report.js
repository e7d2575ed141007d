// What moves on the page: the copy button, tables that sort, gauges, sliders, figures, the 3-D view.
"use strict";

const content = JSON.parse(document.getElementById("content").textContent);
const SVG_TAGS = ["svg", "rect", "line", "circle", "path", "text"];

function byId(id) {
  return document.getElementById(id);
}

// Make an element with attributes and children.
function make(tag, attributes, ...children) {
  const element = SVG_TAGS.includes(tag)
    ? document.createElementNS("http://www.w3.org/2000/svg", tag)
    : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function digits(value, count = 4) {
  if (value === null || !Number.isFinite(value)) return "–";
  return String(Number(value.toPrecision(count)));
}

function percent(share) {
  if (share > 0.995) return "more than 99 %";
  if (share < 0.005) return "less than 1 %";
  return `${Math.round(100 * share)} %`;
}

// The cumulative normal distribution to 1.5e-7, by Abramowitz and Stegun 7.1.26.
function normalBelow(z) {
  const t = 1 / (1 + (0.3275911 * Math.abs(z)) / Math.SQRT2);
  const polynomial =
    t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
  const tail = (polynomial * Math.exp((-z * z) / 2)) / 2;
  return z < 0 ? tail : 1 - tail;
}

// The share of a normal distribution that lies in a range.
function shareInside(low, high, mean, std) {
  if (!(std > 0)) return mean >= low && mean <= high ? 1 : 0;
  return normalBelow((high - mean) / std) - normalBelow((low - mean) / std);
}

// --- Gauges --------------------------------------------------------------------------------

// Draw one response on a line: the target's range, the measurement, and a value with its standard
// error, which `word` names: simulated or predicted.
function gauge(target, value, error, word) {
  const [low, high] = target.axis;
  const width = 640;
  const margin = 8;
  const x = (number) => margin + ((number - low) / (high - low)) * (width - 2 * margin);
  const clippedX = (number) => x(Math.max(low, Math.min(high, number)));
  const line = (from, to, y, kind) =>
    make("line", { x1: clippedX(from), x2: clippedX(to), y1: y, y2: y, class: kind });

  const drawing = make("svg", { viewBox: `0 0 ${width} 62`, role: "img", class: "gauge" });
  const bandWidth = x(target.high) - x(target.low);
  drawing.append(
    line(low, high, 31, "axis"),
    make("rect", { x: x(target.low), width: bandWidth, y: 14, height: 34, class: "band" }),
    line(target.value - target.sd, target.value + target.sd, 22, "measured"),
    make("path", { d: `M${x(target.value)} 15l6 7-6 7-6-7z`, class: "measured" }),
    make("text", { x: x(low), y: 61 }, digits(low, 3)),
    make("text", { x: x(high), y: 61, "text-anchor": "end" }, digits(high, 3)),
  );
  if (value !== null && Number.isFinite(value)) {
    if (error > 0) drawing.append(line(value - 1.96 * error, value + 1.96 * error, 40, "found"));
    drawing.append(make("circle", { cx: clippedX(value), cy: 40, r: 6, class: "found" }));
  }
  drawing.setAttribute(
    "aria-label",
    `${target.label}: ${word} ${digits(value)}, target ${target.low} to ${target.high} ${target.unit}`,
  );
  return drawing;
}

function drawChecks() {
  for (const target of content.targets) {
    const name = make("p", { class: "name" }, `${target.label} (${target.unit || "no unit"})`);
    byId("checks").append(make("div", {}, name, gauge(target, target.simulated, target.error, "simulated")));
  }
}

// --- Sliders -------------------------------------------------------------------------------

// Make the predictor of a surrogate of curves: linear between their points, over the one parameter
// that was moved.
function curvePredictor(model) {
  return function (values, moved) {
    const index = content.parameters.findIndex((parameter) => parameter.name === moved);
    const { low, high } = content.parameters[index];
    const { mean, std } = model.curves[moved];
    const place = ((values[index] - low) / (high - low)) * (mean.length - 1);
    const first = Math.min(Math.floor(place), mean.length - 2);
    const interpolate = (points) =>
      points[first].map((value, k) => value + (place - first) * (points[first + 1][k] - value));
    return { mean: interpolate(mean), std: interpolate(std) };
  };
}

// By how much the prediction at the answer is expected to be too favourable.
function optimismText({ optimism, optimismError, unit }) {
  const sign = optimism < 0 ? "" : "+";
  const error = optimismError === null ? "" : ` ± ${digits(optimismError, 1)}`;
  return `expected optimism at the answer: ${sign}${digits(optimism, 2)}${error} ${unit}`;
}

function drawPredictions({ mean, std }) {
  const drawings = content.targets.map((target, k) => {
    const share = shareInside(target.low, target.high, mean[k], std[k]);
    const value = `${digits(mean[k])} ± ${digits(1.96 * std[k], 2)} ${target.unit}`;
    const range = `${digits(target.low)} to ${digits(target.high)}`;
    return make(
      "div",
      { class: "prediction" },
      make("p", { class: "name" }, `${target.label}: `, make("b", { id: `predicted-${target.name}` }, value)),
      gauge(target, mean[k], std[k], "predicted"),
      ...(target.optimism === null ? [] : [make("p", { class: "note" }, optimismText(target))]),
      make("p", { class: share >= 0.5 ? "good" : "bad" }, `inside the target's range ${range}: ${percent(share)}`),
    );
  });
  byId("predictions").replaceChildren(...drawings);
}

function setUpSliders() {
  const isNetwork = content.model.kind === "network";
  const predict = isNetwork ? networkPredictor(content.model) : curvePredictor(content.model);
  const values = content.parameters.map((parameter) => parameter.value);
  const sliders = []; // {index, parameter, input, output}

  function moveSlider(slider, value) {
    values[slider.index] = value;
    slider.input.value = value;
    slider.output.textContent = digits(value, 3);
  }

  function moveAllBack() {
    for (const slider of sliders) moveSlider(slider, slider.parameter.value);
  }

  content.parameters.forEach((parameter, index) => {
    if (parameter.fixed) return;
    const step = (parameter.high - parameter.low) / 400;
    const input = make("input", {
      type: "range", min: parameter.low, max: parameter.high, step, id: `slide-${parameter.name}`,
    });
    const output = make("output", {}, "");
    const slider = { index, parameter, input, output };
    sliders.push(slider);
    input.addEventListener("input", () => {
      const value = Number(input.value);
      if (!isNetwork) moveAllBack(); // the curves run through the answer
      moveSlider(slider, value);
      drawPredictions(predict(values, parameter.name));
    });
    const name = make("span", {}, make("code", {}, parameter.name), ` ${parameter.label}`);
    byId("sliders").append(make("label", { for: input.id }, name, output, input));
  });

  function showAnswer() {
    moveAllBack();
    drawPredictions(predict(values, sliders[0].parameter.name));
  }
  byId("home").addEventListener("click", showAnswer);
  showAnswer();
}

// --- Buttons, tables, figures --------------------------------------------------------------

// Copy in a browser that gives a page of a file no clipboard.
function copyBySelection(text) {
  const area = make("textarea", {});
  area.value = text;
  document.body.append(area);
  area.select();
  document.execCommand("copy");
  area.remove();
}

function setUpCopy() {
  const button = byId("copy");
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(content.copy);
    } catch {
      copyBySelection(content.copy);
    }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = "Copy the parameters"; }, 2000);
  });
}

// Compare two cells, as numbers if both are; empty cells come last, either way.
function compareCells(a, b, isAscending) {
  if (!a && !b) return 0;
  if (!a) return 1;
  if (!b) return -1;
  const areNumbers = Number.isFinite(Number(a)) && Number.isFinite(Number(b));
  const order = areNumbers ? Number(a) - Number(b) : a.localeCompare(b);
  return isAscending ? order : -order;
}

// A click on a head sorts by that column, a second one the other way round.
function setUpTables() {
  for (const table of document.querySelectorAll("table.sorts")) {
    const heads = table.querySelectorAll("thead th");
    heads.forEach((head, column) => {
      const button = make("button", { type: "button" }, head.textContent);
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const isAscending = head.getAttribute("aria-sort") !== "ascending";
        for (const other of heads) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", isAscending ? "ascending" : "descending");
        const body = table.tBodies[0];
        const cell = (row) => row.cells[column].textContent;
        const rows = [...body.rows].sort((a, b) => compareCells(cell(a), cell(b), isAscending));
        body.append(...rows);
      });
    });
  }
}

// A figure opens at its full size; Escape, the button or a click beside it closes it.
function setUpLarge() {
  const dialog = byId("large");
  const largeImage = dialog.querySelector("img");
  for (const button of document.querySelectorAll("button.enlarge")) {
    button.addEventListener("click", () => {
      const image = button.querySelector("img");
      largeImage.src = image.src;
      largeImage.alt = image.alt;
      dialog.setAttribute("aria-label", image.alt);
      dialog.showModal();
    });
  }
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
}

// --- The 3-D view --------------------------------------------------------------------------

function setUpView() {
  if (!content.pour) return;
  const times = content.pour.times_s;
  const last = times.length - 1;
  const slider = byId("time");
  let view;
  try {
    view = pourView(byId("pile"), content.pour);
  } catch {
    const words = "This browser draws no 3-D pictures (WebGL is off).";
    byId("view").replaceChildren(make("p", { class: "note" }, words));
    return;
  }
  slider.max = last;

  function show(frame) {
    slider.value = frame;
    byId("clock").textContent = `${times[frame].toFixed(1)} s`;
    view.show(frame);
  }

  let timer = null;
  function stop() {
    clearInterval(timer);
    timer = null;
    byId("play").textContent = "Play the pour";
  }

  function play() {
    view.look("pour");
    if (Number(slider.value) >= last) show(0);
    byId("play").textContent = "Stop";
    timer = setInterval(() => {
      const next = Number(slider.value) + 1;
      if (next > last) stop();
      else show(next);
    }, 90);
  }

  slider.addEventListener("input", () => {
    stop();
    if (view.looksAt() !== "pour") view.look("pour");
    show(Number(slider.value));
  });
  byId("play").addEventListener("click", () => {
    if (timer) stop();
    else play();
  });
  for (const name of ["side", "above", "pour"]) {
    byId(`look-${name}`).addEventListener("click", () => view.look(name));
  }

  const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");
  const dress = () => view.dress(darkScheme.matches);
  darkScheme.addEventListener("change", dress);
  window.addEventListener("beforeprint", () => {
    stop();
    view.look("side");
    view.dress(false);
    show(last);
  });
  window.addEventListener("afterprint", dress);
  dress();
  show(last);
}

drawChecks();
setUpCopy();
setUpTables();
setUpLarge();
if (content.model) setUpSliders();
setUpView();
