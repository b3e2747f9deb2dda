// Draws what `state` tells of a running stream, ten times a second, until it is over.
"use strict";

const PAUSE = 100; // ms
const SVG = "http://www.w3.org/2000/svg";

// Points of a curve in a picture of 1 by 1, in runs without gaps.
function runs(values, low, high) {
  const found = [[]];
  values.forEach((value, k) => {
    if (value === null) found.push([]);
    else found.at(-1).push(`${k / Math.max(1, values.length - 1)},${1 - (value - low) / (high - low || 1)}`);
  });
  return found.filter((run) => run.length > 1);
}

function picture(axis) {
  const known = [...axis.planned, ...axis.actual].filter((value) => value !== null);
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 1 1");
  svg.setAttribute("preserveAspectRatio", "none");
  for (const kind of ["planned", "actual"]) {
    for (const run of runs(axis[kind], low, high)) {
      const curve = document.createElementNS(SVG, "polyline");
      curve.setAttribute("points", run.join(" "));
      curve.setAttribute("class", kind);
      svg.append(curve);
    }
  }
  return svg;
}

function draw(state) {
  const words = `${state.name}: ${state.phase}, ${state.time.toFixed(1)} of ${state.duration.toFixed(1)} s`;
  document.title = words;
  document.querySelector("h1").textContent = `${words}, late by ${state.late_us.toFixed(0)} µs at most`;
  document.querySelector("main").replaceChildren(...state.axes.flatMap((axis) => {
    const head = document.createElement("h2");
    head.textContent = `${axis.name}: at most ${(1e3 * axis.apart).toPrecision(3)} m${axis.unit} off the motion`;
    return [head, picture(axis)];
  }));
}

async function follow() {
  for (let over = false; !over; ) {
    try {
      const state = await (await fetch("state")).json();
      draw(state);
      over = state.over;
    } catch {
      document.title += " (ended)"; // the program is gone
      return;
    }
    await new Promise((resolve) => setTimeout(resolve, PAUSE));
  }
}

follow();
