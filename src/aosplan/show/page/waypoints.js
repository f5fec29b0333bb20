"use strict";
// The map, the table of waypoints, the theme and the copies of a plan's page.  All data is in the page:
// the plan's document, the surroundings of the waypoints, and the columns of the waypoints as bytes.

for (const part of document.querySelectorAll("[data-script]")) part.hidden = false;

const element = (id) => document.getElementById(id);
const parsed = (id) => JSON.parse(element(id).textContent);
const plan = parsed("plan");
const scenery = parsed("scenery");

// Waypoints

/** Columns of the waypoints by name: typed arrays, or a single value that all have. */
function unpacked() {
  const columns = {};
  for (const script of document.querySelectorAll("script.column")) {
    const { name, packing } = script.dataset;
    if (packing === "same") {
      columns[name] = { same: JSON.parse(script.textContent) };
      continue;
    }
    const text = atob(script.textContent);
    const bytes = new Uint8Array(text.length);
    for (let place = 0; place < text.length; place += 1) bytes[place] = text.charCodeAt(place);
    columns[name] = packing === "u1" ? bytes : new Float64Array(bytes.buffer);
  }
  return columns;
}

const columns = unpacked();
const count = Number(element("chosen").max) + 1;

function value(name, index) {
  const column = columns[name];
  if ("same" in column) return column.same;
  return name === "photo" ? Boolean(column[index]) : column[index];
}

/** A waypoint in the form of the plan's document. */
function waypoint(index) {
  const found = { index };
  for (const name of Object.keys(columns)) found[name] = value(name, index);
  return found;
}

function floats(name) {
  const column = columns[name];
  return "same" in column ? new Float64Array(count).fill(column.same) : column;
}

const east = floats("east_m");
const north = floats("north_m");
const photo = (index) => !columns.photo || value("photo", index);

function flightOf(index) {
  return scenery.flights.findIndex(([first, last]) => index >= first && index <= last);
}

function metres(number, digits = 2) {
  return `${(Object.is(number, -0) ? 0 : number).toFixed(digits)} m`;
}

function described(index) {
  const it = waypoint(index);
  const lines = [
    `Waypoint ${index} of ${count}${photo(index) ? "" : ", a turn without a photo"}`,
    `east ${metres(it.east_m)}, north ${metres(it.north_m)}`,
    `${metres(it.altitude_m, 1)} above ground` +
      (it.ground_m === undefined ? "" : `, which is at ${metres(it.ground_m, 1)}`),
  ];
  if (it.latitude !== undefined) lines.push(`${it.latitude.toFixed(7)}, ${it.longitude.toFixed(7)}`);
  if (scenery.flights.length > 1) lines.push(`flight ${flightOf(index) + 1}`);
  return lines;
}

/** Points at which the path turns, so that a straight line of many photos is drawn at once. */
function corners() {
  const starts = new Set(scenery.flights.map(([first]) => first));
  const kept = [];
  for (let i = 0; i < count; i += 1) {
    if (i > 0 && i + 1 < count && !starts.has(i) && !starts.has(i + 1)) {
      const [ax, ay] = [east[i] - east[i - 1], north[i] - north[i - 1]];
      const [bx, by] = [east[i + 1] - east[i], north[i + 1] - north[i]];
      const straight = Math.abs(ax * by - ay * bx) <= 1e-6 * Math.hypot(ax, ay) * Math.hypot(bx, by);
      if (straight && ax * bx + ay * by > 0) continue;
    }
    kept.push(i);
  }
  return { places: Int32Array.from(kept), starts };
}

const path = corners();

/** Waypoints by cells of a lattice, to find the nearest one without a search of all. */
function lattice() {
  let [west, south, right, top] = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < count; i += 1) {
    west = Math.min(west, east[i]); right = Math.max(right, east[i]);
    south = Math.min(south, north[i]); top = Math.max(top, north[i]);
  }
  const size = Math.max(Math.max(right - west, top - south) / 1000,
    Math.sqrt(((right - west) * (top - south)) / count) * 2, 1e-3);
  const wide = Math.floor((right - west) / size) + 1;
  const high = Math.floor((top - south) / size) + 1;
  const cell = (x, y) => Math.floor((y - south) / size) * wide + Math.floor((x - west) / size);
  const begins = new Int32Array(wide * high + 1);
  for (let i = 0; i < count; i += 1) begins[cell(east[i], north[i]) + 1] += 1;
  for (let c = 0; c < wide * high; c += 1) begins[c + 1] += begins[c];
  const next = begins.slice();
  const members = new Int32Array(count);
  for (let i = 0; i < count; i += 1) members[next[cell(east[i], north[i])]++] = i;
  return { west, south, right, top, size, wide, high, begins, members };
}

const cells = lattice();

/** Index of the waypoint nearest to a place, within a distance; -1 if there is none. */
function nearest(x, y, within) {
  let [found, best] = [-1, within];
  const span = (low, from, most) => [
    Math.max(Math.floor((low - within - from) / cells.size), 0),
    Math.min(Math.floor((low + within - from) / cells.size), most - 1),
  ];
  const [left, right] = span(x, cells.west, cells.wide);
  const [bottom, top] = span(y, cells.south, cells.high);
  for (let row = bottom; row <= top; row += 1) {
    const [begin, end] = [row * cells.wide + left, row * cells.wide + right + 1];
    for (let k = cells.begins[begin]; k < (left <= right ? cells.begins[end] : 0); k += 1) {
      const i = cells.members[k];
      const distance = Math.hypot(east[i] - x, north[i] - y);
      if (distance < best) [found, best] = [i, distance];
    }
  }
  return found;
}
