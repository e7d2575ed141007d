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

// Draw one response on a line: the target's range, the measured mean and a value, each with its
// standard error; thin, the standard deviation of single repetitions. `word` names the value: simulated
// or predicted.
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
    line(target.value - target.sd, target.value + target.sd, 22, "single"),
    line(target.value - target.standardError, target.value + target.standardError, 22, "measured"),
    make("path", { d: `M${x(target.value)} 15l6 7-6 7-6-7z`, class: "measured" }),
    make("text", { x: x(low), y: 61 }, digits(low, 3)),
    make("text", { x: x(high), y: 61, "text-anchor": "end" }, digits(high, 3)),
  );
  if (value !== null && Number.isFinite(value)) {
    if (error > 0) drawing.append(line(value - error, value + error, 40, "found"));
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

// The coordinate in which a parameter's slider and curves are even: its value or the logarithm of it.
function coordinateOf(parameter, value) {
  return parameter.scale === "log" ? Math.log(value) : value;
}

function valueAt(parameter, coordinate) {
  return parameter.scale === "log" ? Math.exp(coordinate) : coordinate;
}

// Place of a parameter's value among points that are spread evenly over its range: the number of the
// point before it, and the share of the way to the next one.
function placeAmong(name, values, count) {
  const index = content.parameters.findIndex((parameter) => parameter.name === name);
  const parameter = content.parameters[index];
  const low = coordinateOf(parameter, parameter.low);
  const high = coordinateOf(parameter, parameter.high);
  const place = ((coordinateOf(parameter, values[index]) - low) / (high - low)) * (count - 1);
  const before = Math.max(0, Math.min(Math.floor(place), count - 2));
  return { before, share: place - before };
}

function between(start, end, share) {
  return start.map((value, k) => value + share * (end[k] - value));
}

// Make the predictor of a surrogate of curves and planes: linear between their points, over the one
// or two parameters that were moved, whose names are `moved`.
function curvePredictor(model) {
  const responses = content.targets.length;
  const count = model.planePoints;
  const planes = {};
  for (const [names, { mean, std }] of Object.entries(model.planes)) {
    planes[names] = { mean: unpacked(mean, Float32Array), std: unpacked(std, Float32Array) };
  }

  function onCurve(values, name) {
    const { mean, std } = model.curves[name];
    const { before, share } = placeAmong(name, values, mean.length);
    const interpolate = (points) => between(points[before], points[before + 1], share);
    return { mean: interpolate(mean), std: interpolate(std) };
  }

  function onPlane(values, first, second) {
    const down = placeAmong(first, values, count);
    const across = placeAmong(second, values, count);
    const interpolate = (numbers) => {
      const at = (row, column) => {
        const start = (row * count + column) * responses;
        return Array.from(numbers.subarray(start, start + responses));
      };
      const alongRow = (row) => between(at(row, across.before), at(row, across.before + 1), across.share);
      return between(alongRow(down.before), alongRow(down.before + 1), down.share);
    };
    const { mean, std } = planes[`${first} ${second}`];
    return { mean: interpolate(mean), std: interpolate(std) };
  }

  return function (values, moved) {
    if (moved.length < 2) return onCurve(values, moved[0]);
    const [first, second] = moved;
    return `${first} ${second}` in planes ? onPlane(values, first, second) : onPlane(values, second, first);
  };
}

// By how much the prediction at the answer is expected to be too favourable.
function optimismText({ optimism, optimismError, unit }) {
  if (optimism === null) return "The expected optimism of this prediction was not computed.";
  const sign = optimism < 0 ? "" : "+";
  const error = optimismError === null ? "" : ` ± ${digits(optimismError, 1)}`;
  return `expected optimism at the answer: ${sign}${digits(optimism, 2)}${error} ${unit}`;
}

// The probability to lie in the target's range, at the answer also without the expected optimism.
function insideText(target, mean, std, isAtAnswer) {
  const range = `${digits(target.low)} to ${digits(target.high)}`;
  const predicted = percent(shareInside(target.low, target.high, mean, std));
  const text = `inside the target's range ${range}: ${predicted}`;
  if (!isAtAnswer || target.optimism === null) return text;
  const expectedStd = Math.hypot(std, target.optimismError ?? 0);
  const expected = shareInside(target.low, target.high, mean - target.optimism, expectedStd);
  return `${text}; less the expected optimism: ${percent(expected)}`;
}

function drawPredictions({ mean, std }, isAtAnswer) {
  const drawings = content.targets.map((target, k) => {
    const share = shareInside(target.low, target.high, mean[k], std[k]);
    const value = `${digits(mean[k])} ± ${digits(std[k], 2)} ${target.unit}`;
    return make(
      "div",
      { class: "prediction" },
      make("p", { class: "name" }, `${target.label}: `, make("b", { id: `predicted-${target.name}` }, value)),
      gauge(target, mean[k], std[k], "predicted"),
      make("p", { class: "note" }, optimismText(target)),
      make("p", { class: share >= 0.5 ? "good" : "bad" }, insideText(target, mean[k], std[k], isAtAnswer)),
    );
  });
  byId("predictions").replaceChildren(...drawings);
}

// The texts of the constraints that values of the parameters violate.
function violatedConstraints(values) {
  const sizeOf = ({ factor, name }) =>
    factor * values[content.parameters.findIndex((parameter) => parameter.name === name)];
  const isViolated = ({ smaller, larger }) => {
    const left = sizeOf(smaller);
    const right = sizeOf(larger);
    // The answer may lie on a constraint, to within the rounding of its table.
    return left - right > 1e-9 * (Math.abs(left) + Math.abs(right));
  };
  return content.constraints.filter(isViolated).map(({ text }) => text);
}

// The study asks for no run where a constraint is violated, so the surrogate need not hold there.
function drawForbidden(texts) {
  const words = `No prediction: the study excludes these values, which violate ${texts.join(" and ")}.`;
  byId("predictions").replaceChildren(make("p", { class: "bad", id: "forbidden" }, words));
}

function setUpSliders() {
  const isNetwork = content.model.kind === "network";
  const network = isNetwork ? networkPredictor(content.model) : null;
  const ofNetwork = (values) =>
    network(values.map((value, index) => coordinateOf(content.parameters[index], value)));
  const predict = isNetwork ? ofNetwork : curvePredictor(content.model);
  const values = content.parameters.map((parameter) => parameter.value);
  const sliders = []; // {index, parameter, input, output}
  let moved = []; // names of the parameters that were moved, the last one at the end

  function moveSlider(slider, value) {
    values[slider.index] = value;
    slider.input.value = coordinateOf(slider.parameter, value);
    slider.output.textContent = digits(value, 3);
  }

  function moveBack(isKept) {
    for (const slider of sliders) {
      if (!isKept(slider.parameter.name)) moveSlider(slider, slider.parameter.value);
    }
  }

  content.parameters.forEach((parameter, index) => {
    if (parameter.fixed) return;
    const min = coordinateOf(parameter, parameter.low);
    const max = coordinateOf(parameter, parameter.high);
    const step = (max - min) / 400;
    const input = make("input", { type: "range", min, max, step, id: `slide-${parameter.name}` });
    const output = make("output", {}, "");
    const slider = { index, parameter, input, output };
    sliders.push(slider);
    input.addEventListener("input", () => {
      const value = valueAt(parameter, Number(input.value));
      moved = [...moved.filter((name) => name !== parameter.name), parameter.name];
      if (!isNetwork) {
        // The planes run through the answer: all but two parameters stay there.
        moved = moved.slice(-2);
        moveBack((name) => moved.includes(name));
      }
      moveSlider(slider, value);
      const violated = violatedConstraints(values);
      if (violated.length) drawForbidden(violated);
      else drawPredictions(predict(values, moved), false);
    });
    const name = make("span", {}, make("code", {}, parameter.name), parameter.label ? ` ${parameter.label}` : "");
    byId("sliders").append(make("label", { for: input.id }, name, output, input));
  });

  function showAnswer() {
    moved = [];
    moveBack(() => false);
    drawPredictions(predict(values, [sliders[0].parameter.name]), true);
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

function setUpCopy(button, text) {
  const words = button.textContent;
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      copyBySelection(text);
    }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = words; }, 2000);
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
    view = pourView(byId("pile"), byId("scale"), content.pour);
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
setUpCopy(byId("copy"), content.copy);
if (content.copyMaterial) setUpCopy(byId("copy-material"), content.copyMaterial);
setUpTables();
setUpLarge();
if (content.model) setUpSliders();
setUpView();
