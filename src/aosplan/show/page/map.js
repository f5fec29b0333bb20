// The map

const canvas = element("map");
const heading = (scenery.heading_deg * Math.PI) / 180;
const MANY = 20000; // most sites that are drawn as dots
const MOST_CORNERS = 40000;
const view = { x: 0, y: 0, scale: 1, least: 1, width: 1, height: 1, ratio: 1 };
const state = { chosen: -1, hovered: -1, waiting: false, printing: false };

/** Corners of a rectangle around a place; its size is along and across the heading. */
function rectangle(x, y, [along, across]) {
  const [sine, cosine] = [Math.sin(heading), Math.cos(heading)];
  return [[1, 1], [1, -1], [-1, -1], [-1, 1]].flatMap(([a, b]) => [
    x + 0.5 * (a * along * sine + b * across * cosine),
    y + 0.5 * (a * along * cosine - b * across * sine),
  ]);
}

function extent() {
  let { west, south, right, top } = cells;
  const include = (points) => {
    for (let i = 0; i < points.length; i += 2) {
      west = Math.min(west, points[i]); right = Math.max(right, points[i]);
      south = Math.min(south, points[i + 1]); top = Math.max(top, points[i + 1]);
    }
  };
  if (scenery.extent_m) {
    include(rectangle(0, 0, scenery.extent_m.map((side, k) => side + scenery.footprint_m[k])));
  }
  scenery.area.forEach(include);
  include([scenery.takeoff.east_m, scenery.takeoff.north_m]);
  if (right - west < 1e-6 && top - south < 1e-6) include(rectangle(west, south, scenery.footprint_m));
  return { west, south, right, top };
}

const whole = extent();

function fit() {
  const [wide, high] = [Math.max(whole.right - whole.west, 1e-3), Math.max(whole.top - whole.south, 1e-3)];
  // Leave the lowest line free for the scale bar.
  view.least = Math.min((view.width - 64) / wide, (view.height - 84) / high);
  view.scale = view.least;
  view.x = 0.5 * (whole.west + whole.right);
  view.y = 0.5 * (whole.south + whole.top) - 10 / view.scale;
  moved();
}

function moved() {
  const far = Math.max(whole.right - whole.west, whole.top - whole.south);
  view.scale = Math.min(Math.max(view.scale, view.least), Math.max(view.least, 2000));
  view.x = Math.min(Math.max(view.x, whole.west - 0.1 * far), whole.right + 0.1 * far);
  view.y = Math.min(Math.max(view.y, whole.south - 0.1 * far), whole.top + 0.1 * far);
  // If the whole map is visible, vertical swipes scroll the page.
  canvas.style.touchAction = view.scale > view.least * 1.001 ? "none" : "pan-y";
  canvas.dataset.scale = view.scale.toPrecision(6);
  draw();
}

function zoom(factor, px = view.width / 2, py = view.height / 2) {
  const [x, y] = [placeX(px), placeY(py)];
  const scale = Math.min(Math.max(view.scale * factor, view.least), Math.max(view.least, 2000));
  if (scale === view.least && factor < 1) return fit();
  view.scale = scale;
  view.x = x - (px - view.width / 2) / scale;
  view.y = y + (py - view.height / 2) / scale;
  return moved();
}

const pixelX = (x) => view.width / 2 + (x - view.x) * view.scale;
const pixelY = (y) => view.height / 2 - (y - view.y) * view.scale;
const placeX = (px) => view.x + (px - view.width / 2) / view.scale;
const placeY = (py) => view.y - (py - view.height / 2) / view.scale;

function resized() {
  const widest = view.scale <= view.least * 1.001;
  const box = canvas.getBoundingClientRect();
  [view.width, view.height] = [Math.max(box.width, 80), Math.max(box.height, 80)];
  view.ratio = state.printing ? 3 : Math.max(window.devicePixelRatio || 1, 1);
  canvas.width = Math.round(view.width * view.ratio);
  canvas.height = Math.round(view.height * view.ratio);
  const kept = { ...view };
  fit();
  if (!widest) { Object.assign(view, { x: kept.x, y: kept.y, scale: kept.scale }); moved(); }
}

function draw() {
  if (state.waiting) return;
  state.waiting = true;
  requestAnimationFrame(() => { state.waiting = false; paint(); });
}

/** Colours of the style sheet, because a canvas does not follow the light or dark theme. */
function inks() {
  const probe = document.createElement("i");
  if (state.printing) probe.style.colorScheme = "light";
  document.body.append(probe);
  const found = {};
  for (const name of ["ink", "faint", "line", "paper", "panel", "blue", "orange", "green", "red", "violet", "sky", "teal"]) {
    probe.style.color = `var(--${name})`;
    found[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return found;
}

function paint() {
  const pen = canvas.getContext("2d");
  const ink = inks();
  pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
  pen.clearRect(0, 0, view.width, view.height);
  pen.lineJoin = "round";
  shapes(pen, scenery.area, ink.ink, 0.05, []);
  shapes(pen, scenery.clear, ink.green, 0.18, []);
  shapes(pen, scenery.no_fly, ink.red, 0.18, [5, 3]);
  const middle = state.chosen >= 0 ? state.chosen : state.hovered;
  if (scenery.extent_m) {
    const sides = scenery.extent_m.map((side, k) => side + scenery.footprint_m[k]);
    shapes(pen, [rectangle(0, 0, sides)], ink.faint, 0, [2, 4]);
  }
  if (scenery.common_footprint_m) {
    shapes(pen, [rectangle(0, 0, scenery.common_footprint_m)], ink.sky, 0.22, []);
  }
  const shown = middle >= 0 ? middle : Math.floor(count / 2);
  shapes(pen, [rectangle(east[shown], north[shown], scenery.footprint_m)], ink.orange, middle >= 0 ? 0.08 : 0, [7, 4]);
  paintPath(pen, ink);
  paintSites(pen, ink);
  const dot = Math.max(radius(), 3.5);
  const { east_m: homeX, north_m: homeY, known } = scenery.takeoff;
  triangle(pen, pixelX(homeX), pixelY(homeY) + (known ? 0 : dot + 7), 7, -Math.PI / 2, ink.violet);
  mark(pen, 0, ink.green, dot + 1.5);
  if (count > 1) square(pen, pixelX(east[count - 1]), pixelY(north[count - 1]), dot + 1, ink.red);
  for (const [index, colour] of [[state.hovered, ink.orange], [state.chosen, ink.orange]]) {
    if (index < 0) continue;
    pen.beginPath();
    pen.arc(pixelX(east[index]), pixelY(north[index]), dot + 4, 0, 7);
    pen.strokeStyle = colour; pen.lineWidth = 2.5; pen.setLineDash([]); pen.stroke();
  }
  paintScale(pen, ink);
  paintNorth(pen, ink);
  canvas.dataset.painted = String(Number(canvas.dataset.painted || 0) + 1);
}

function shapes(pen, rings, colour, alpha, dash) {
  if (!rings.length) return;
  pen.beginPath();
  for (const ring of rings) {
    pen.moveTo(pixelX(ring[0]), pixelY(ring[1]));
    for (let i = 2; i < ring.length; i += 2) pen.lineTo(pixelX(ring[i]), pixelY(ring[i + 1]));
    pen.closePath();
  }
  pen.fillStyle = colour; pen.globalAlpha = alpha; pen.fill("evenodd"); pen.globalAlpha = 1;
  pen.strokeStyle = colour; pen.lineWidth = 1.5; pen.setLineDash(dash); pen.stroke(); pen.setLineDash([]);
}

const radius = () => Math.min(Math.max(scenery.spacing_m * view.scale * 0.22, 1), 6);

/** First and last share of a line within the map; if the first is larger, no part is visible. */
function visible(ax, ay, bx, by) {
  let [from, to] = [0, 1];
  for (const [at, step, most] of [[ax, bx - ax, view.width], [ay, by - ay, view.height]]) {
    if (step === 0) { if (at < 0 || at > most) return [1, 0]; continue; }
    const [one, other] = [-at / step, (most - at) / step];
    from = Math.max(from, Math.min(one, other));
    to = Math.min(to, Math.max(one, other));
  }
  return [from, to];
}

/** Flights on different batteries alternate between two colours. */
const flightInk = (ink, flight) => (flight % 2 ? ink.teal : ink.blue);

function paintPath(pen, ink) {
  const { places, starts } = path;
  if (places.length > MOST_CORNERS && scenery.spacing_m * view.scale < 3) return;
  pen.lineWidth = 1.5;
  pen.globalAlpha = 0.7;
  const lines = scenery.flights.map(() => new Path2D());
  const arrows = [];
  let flight = 0;
  let since = 60;
  for (let k = 1; k < places.length; k += 1) {
    const [i, j] = [places[k - 1], places[k]];
    if (starts.has(j)) { flight += 1; continue; }
    const [ax, ay, bx, by] = [pixelX(east[i]), pixelY(north[i]), pixelX(east[j]), pixelY(north[j])];
    const [from, to] = visible(ax, ay, bx, by);
    if (from >= to) continue;
    lines[flight].moveTo(ax, ay);
    lines[flight].lineTo(bx, by);
    const length = Math.hypot(bx - ax, by - ay);
    const legs = Math.max(j - i, 1);
    since += (to - from) * length;
    const most = length / legs < 14 ? 0 : Math.min(Math.floor(since / 90), 400 - arrows.length);
    if (most > 0) since = 0;
    for (let n = 1; n <= most; n += 1) {
      // Between two sites, so that no dot hides the arrow.
      const share = (Math.floor((from + ((to - from) * n) / (most + 1)) * legs) + 0.5) / legs;
      arrows.push([ax + share * (bx - ax), ay + share * (by - ay), Math.atan2(by - ay, bx - ax), flight]);
    }
  }
  lines.forEach((line, index) => { pen.strokeStyle = flightInk(ink, index); pen.stroke(line); });
  pen.globalAlpha = 1;
  for (const [x, y, angle, index] of arrows) triangle(pen, x, y, 4.5, angle, flightInk(ink, index));
}

function paintSites(pen, ink) {
  const inside = [];
  let many = 0;
  const [left, right] = [placeX(-8), placeX(view.width + 8)];
  const [bottom, top] = [placeY(view.height + 8), placeY(-8)];
  for (let i = 0; i < count; i += 1) {
    if (east[i] < left || east[i] > right || north[i] < bottom || north[i] > top) continue;
    many += 1;
    if (many <= MANY) inside.push(i);
  }
  canvas.dataset.sites = String(many);
  if (many > MANY) return dust(pen, ink);
  const dot = radius();
  pen.strokeStyle = ink.faint;
  pen.lineWidth = 1.2;
  let flight = 0;
  for (const i of inside) {
    while (i > scenery.flights[flight][1]) flight += 1;
    pen.fillStyle = flightInk(ink, flight);
    const [x, y] = [pixelX(east[i]), pixelY(north[i])];
    if (!photo(i)) { pen.strokeRect(x - dot * 0.7, y - dot * 0.7, dot * 1.4, dot * 1.4); continue; }
    if (dot < 1.5) { pen.fillRect(x - dot, y - dot, 2 * dot, 2 * dot); continue; }
    pen.beginPath(); pen.arc(x, y, dot, 0, 7); pen.fill();
  }
  const digits = String(inside.at(-1)).length;
  if (scenery.spacing_m * view.scale < 18 + 7 * digits) return undefined;
  pen.font = "11px system-ui, sans-serif";
  pen.textAlign = "left"; pen.textBaseline = "bottom"; pen.fillStyle = ink.faint;
  for (const i of inside) pen.fillText(String(i), pixelX(east[i]) + dot + 1, pixelY(north[i]) - dot);
  return undefined;
}

/** Draw very many sites as single pixels. */
function dust(pen, ink) {
  const [wide, high] = [canvas.width, canvas.height];
  const layer = new OffscreenCanvas(wide, high);
  const brush = layer.getContext("2d");
  const image = brush.createImageData(wide, high);
  const [red, green, blue] = ink.blue.match(/[\d.]+/g).map(Number);
  const pixels = new Uint32Array(image.data.buffer);
  const colour = (220 << 24) | (blue << 16) | (green << 8) | red;
  const scale = view.scale * view.ratio;
  for (let i = 0; i < count; i += 1) {
    const x = Math.floor(wide / 2 + (east[i] - view.x) * scale);
    const y = Math.floor(high / 2 - (north[i] - view.y) * scale);
    if (x >= 0 && x < wide && y >= 0 && y < high) pixels[y * wide + x] = colour;
  }
  brush.putImageData(image, 0, 0);
  pen.drawImage(layer, 0, 0, view.width, view.height);
}

function mark(pen, index, colour, size) {
  pen.beginPath();
  pen.arc(pixelX(east[index]), pixelY(north[index]), size, 0, 7);
  pen.fillStyle = colour; pen.fill();
}

function square(pen, x, y, size, colour) {
  pen.fillStyle = colour;
  pen.fillRect(x - size, y - size, 2 * size, 2 * size);
}

function triangle(pen, x, y, size, angle, colour) {
  pen.beginPath();
  for (const turn of [0, 2.5, -2.5]) pen.lineTo(x + size * Math.cos(angle + turn), y + size * Math.sin(angle + turn));
  pen.closePath(); pen.fillStyle = colour; pen.fill();
}

/** A translucent background for text over the map. */
function ground(pen, ink, x, y, width, height) {
  pen.fillStyle = ink.panel; pen.globalAlpha = 0.85;
  pen.fillRect(x, y, width, height);
  pen.globalAlpha = 1;
}

function paintScale(pen, ink) {
  const rough = 130 / view.scale;
  const unit = 10 ** Math.floor(Math.log10(rough));
  const length = [5, 2, 1].map((factor) => factor * unit).find((one) => one <= rough);
  const [x, y, width] = [16, view.height - 16, length * view.scale];
  ground(pen, ink, x - 8, y - 24, width + 16, 32);
  pen.strokeStyle = ink.ink; pen.lineWidth = 1.5; pen.setLineDash([]);
  pen.beginPath();
  pen.moveTo(x, y - 5); pen.lineTo(x, y); pen.lineTo(x + width, y); pen.lineTo(x + width, y - 5);
  pen.stroke();
  pen.font = "12px system-ui, sans-serif"; pen.fillStyle = ink.ink;
  pen.textAlign = "left"; pen.textBaseline = "bottom";
  pen.fillText(length >= 1000 ? `${length / 1000} km` : `${Number(length.toPrecision(1))} m`, x + 5, y - 4);
}

function paintNorth(pen, ink) {
  const [x, y] = [view.width - 26, 40];
  ground(pen, ink, x - 14, y - 34, 28, 56);
  pen.strokeStyle = ink.ink; pen.fillStyle = ink.ink; pen.lineWidth = 1.5;
  pen.beginPath(); pen.moveTo(x, y + 16); pen.lineTo(x, y - 4); pen.stroke();
  triangle(pen, x, y - 8, 7, -Math.PI / 2, ink.ink);
  pen.font = "600 12px system-ui, sans-serif"; pen.textAlign = "center"; pen.textBaseline = "bottom";
  pen.fillText("N", x, y - 16);
}

// Pointers, wheel and keys

const tip = element("tip");

function hover(px, py) {
  const found = nearest(placeX(px), placeY(py), 16 / view.scale);
  if (found !== state.hovered) { state.hovered = found; draw(); }
  tip.hidden = found < 0;
  if (found < 0) return;
  tip.textContent = described(found).join("\n");
  const [x, y] = [pixelX(east[found]), pixelY(north[found])];
  tip.style.left = `${Math.max(Math.min(x + 14, view.width - tip.offsetWidth - 4), 4)}px`;
  tip.style.top = `${y + 14 + tip.offsetHeight > view.height ? y - 14 - tip.offsetHeight : y + 14}px`;
}

function choose(index, { centre = true } = {}) {
  state.chosen = Math.min(Math.max(Math.round(index) || 0, 0), count - 1);
  element("chosen").value = state.chosen;
  element("readout").textContent = described(state.chosen).join("; ");
  const [px, py] = [pixelX(east[state.chosen]), pixelY(north[state.chosen])];
  if (centre && (px < 10 || py < 10 || px > view.width - 10 || py > view.height - 10)) {
    [view.x, view.y] = [east[state.chosen], north[state.chosen]];
    moved();
  }
  draw();
}

const pointers = new Map();
let travelled = 0;

function within(event) {
  const box = canvas.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

canvas.addEventListener("pointerdown", (event) => {
  pointers.set(event.pointerId, within(event));
  travelled = 0;
  try { canvas.setPointerCapture(event.pointerId); } catch { /* the pointer no longer exists */ }
});
canvas.addEventListener("pointermove", (event) => {
  const [px, py] = within(event);
  const before = pointers.get(event.pointerId);
  if (!before) { if (event.pointerType === "mouse") hover(px, py); return; }
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
  pointers.set(event.pointerId, [px, py]);
  travelled += Math.hypot(px - before[0], py - before[1]);
  if (others.length) {
    const [ox, oy] = others[0];
    const [was, is] = [Math.hypot(before[0] - ox, before[1] - oy), Math.hypot(px - ox, py - oy)];
    if (was > 4) zoom(is / was, ox, oy);
    return;
  }
  if (travelled < 4) return;
  tip.hidden = true;
  view.x -= (px - before[0]) / view.scale;
  view.y += (py - before[1]) / view.scale;
  moved();
});
function released(event) {
  if (pointers.delete(event.pointerId) && event.type === "pointerup" && travelled < 6) {
    const [px, py] = within(event);
    hover(px, py);
    if (state.hovered >= 0) choose(state.hovered, { centre: false });
  }
}
canvas.addEventListener("pointerup", released);
canvas.addEventListener("pointercancel", released);
canvas.addEventListener("pointerleave", () => { tip.hidden = true; state.hovered = -1; draw(); });

let scrolled = -Infinity;
window.addEventListener("scroll", () => { scrolled = performance.now(); }, { passive: true });
canvas.addEventListener("wheel", (event) => {
  // Let the page scroll if it is scrolling, or if the whole map is visible and cannot be reduced.
  const widest = view.scale <= view.least * 1.001 && event.deltaY > 0;
  if (widest || performance.now() - scrolled < 200) return;
  event.preventDefault();
  const step = event.deltaMode === 1 ? 30 * event.deltaY : event.deltaY;
  zoom(Math.exp(-Math.min(Math.max(step, -300), 300) / 400), ...within(event));
}, { passive: false });

const KEYS = {
  "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5), 0: fit,
  ArrowLeft: () => pan(-1, 0), ArrowRight: () => pan(1, 0), ArrowUp: () => pan(0, 1), ArrowDown: () => pan(0, -1),
  n: () => choose(state.chosen + 1), p: () => choose(state.chosen - 1),
  Home: () => choose(0), End: () => choose(count - 1),
};

function pan(right, up) {
  view.x += (right * 60) / view.scale;
  view.y += (up * 60) / view.scale;
  moved();
}

canvas.addEventListener("keydown", (event) => {
  const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  act();
});
canvas.addEventListener("focus", () => { if (state.chosen < 0 && canvas.matches(":focus-visible")) choose(0); });
element("zoom-in").addEventListener("click", () => zoom(1.5));
element("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
element("zoom-fit").addEventListener("click", fit);
element("next").addEventListener("click", () => choose(state.chosen + 1));
element("previous").addEventListener("click", () => choose(state.chosen < 0 ? count - 1 : state.chosen - 1));
element("chosen").addEventListener("change", (event) => choose(Number(event.target.value)));
new ResizeObserver(resized).observe(canvas);

// Printing: light theme, the whole map, high resolution

let before = null;
function printing(on) {
  if (on) before = { x: view.x, y: view.y, scale: view.scale };
  state.printing = on;
  resized();
  if (on) fit();
  else if (before.scale > view.least) { Object.assign(view, before); moved(); }
  paint();
}
window.addEventListener("beforeprint", () => printing(true));
window.addEventListener("afterprint", () => printing(false));
