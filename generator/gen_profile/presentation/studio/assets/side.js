// The way over stacks from the side. A hand, or the arrow keys, move a stack sideways and its top up and down.
"use strict";
const side = (() => {
  const { draw } = knobs;
  const [LEFT, BOTTOM, EDGE, HIGHEST] = [48, 38, 8, 520]; // pixels
  const GRIP = 9; // pixels of a stack's top that a hand can take
  const STEP = 0.1, FAR = 1; // m, by an arrow key, and with Shift
  const SHADES = { "#0072b2": "var(--accent)", "#b3261e": "var(--bad)" }; // of colours for light paper
  const DASH = { solid: "", dash: "7 4", dot: "2 3" };
  let shown = null; // what the picture shows, and how it is scaled
  let held = null; // what a hand is on, and where it took it

  const round = (value) => Number(value.toFixed(2));

  /** Pixels of places in m: one scale for both directions; what a hand is on stands still. */
  function scaled(part, most) {
    const all = (name) => part.lines.flatMap((line) => line[name].filter((value) => value !== null));
    const [xs, ys] = [all("x"), all("y")], [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const scale = Math.min((most - LEFT - EDGE) / (right - left), (HIGHEST - BOTTOM - EDGE) / (high - low));
    const [width, height] = [scale * (right - left) + LEFT + EDGE, scale * (high - low) + BOTTOM + EDGE];
    return { width, height, scale, ends: [left, right, low, high], x: (value) => LEFT + scale * (value - left), y: (value) => height - BOTTOM - scale * (value - low) };
  }

  function axes(svg, { ends: [left, right, low, high], x, y, width, height }, part, phrase) {
    for (const value of numbers.ticks(left, right, 10)) {
      draw(svg, "path", { class: "grid", d: `M${x(value)} ${EDGE}V${height - BOTTOM}` });
      draw(svg, "text", { x: x(value), y: height - BOTTOM + 15, "text-anchor": "middle" }, numbers.short(value));
    }
    for (const value of numbers.ticks(low, high, 6)) {
      draw(svg, "path", { class: "grid", d: `M${LEFT} ${y(value)}H${width - EDGE}` });
      draw(svg, "text", { x: LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, numbers.short(value));
    }
    draw(svg, "text", { x: (LEFT + width) / 2, y: height - 5, "text-anchor": "middle" }, phrase(part.x_label));
    draw(svg, "text", { x: 11, y: (height - BOTTOM) / 2, "text-anchor": "middle", transform: `rotate(-90 11 ${(height - BOTTOM) / 2})` }, phrase(part.y_label));
  }

  /** Give an element the look of a line, or of what it goes around. */
  function inked(node, { colour, fill, width, dash }) {
    const shade = SHADES[colour] ?? colour;
    Object.assign(node.style, fill ? { fill: shade, fillOpacity: fill } : { fill: "none", stroke: shade, strokeWidth: width, strokeDasharray: DASH[dash] });
  }

  function curve(svg, { x, y }, line) {
    const points = line.x.map((value, place) => `${x(value).toFixed(1)},${y(line.y[place]).toFixed(1)}`).join(" ");
    inked(draw(svg, line.fill ? "polygon" : "polyline", { points }), line);
  }

  /** All that a load keeps clear of, with the key of its numbers; what is overhead goes up, not down. */
  const obstaclesOf = (part) => ["stacks", "overhead"].flatMap((key) => part[key].map(({ number, row, shown }) => ({ path: `path.${key}.${number}`, number, up: key === "overhead", row, stack: [...shown] })));

  /** An obstacle's places on the screen, and what its handles say. */
  function place({ stack, top }, { up, stack: [from, to, height] }) {
    const { x, y, ends } = shown.frame, [left, right] = [x(from), x(to)];
    const [high, low] = up ? [y(ends[3]), y(height)] : [y(height), y(ends[2])];
    for (const [key, value] of Object.entries({ x: left, width: Math.max(right - left, 0), y: high, height: Math.max(low - high, 0) })) stack.setAttribute(key, value);
    for (const [key, value] of Object.entries({ x: left, width: Math.max(right - left, 0), y: y(height) - GRIP / 2, height: GRIP })) top.setAttribute(key, value);
    for (const [node, value] of [[stack, from], [top, height]]) {
      node.setAttribute("aria-valuenow", value);
      node.setAttribute("aria-valuetext", `${numbers.local(value)} m`);
    }
  }

  function handles(svg, part, phrase) {
    return obstaclesOf(part).map(({ number, up }, place) => Object.fromEntries(["stack", "top"].map((kind) => {
      const name = up ? { stack: "overhead", top: "underside" }[kind] : kind;
      const look = { class: kind, role: "slider", tabindex: "0", "aria-label": `${phrase(`side.${name}`)} ${number + 1}`, "data-number": place };
      return [kind, draw(svg, "rect", look)];
    })));
  }

  /** Move a stack along the way, or its top, by so much from where it was taken, and tell the spec. */
  function move({ number, kind, from: { stack: [low, high, height], row } }, [across, up]) {
    const top = kind === "top", moved = shown.obstacles[number], [x, y] = shown.part.way;
    moved.stack = top ? [low, high, round(height + up)] : [round(low + across), round(high + across), height];
    const places = row.slice(0, -1); // from and to in x, and perhaps in y
    moved.row = top ? [...places, round(row.at(-1) + up)] : [...places.map((value, place) => round(value + across * (place < 2 ? x : y))), row.at(-1)];
    place(shown.handles[number], moved);
    shown.options.drag(moved.path, moved.row);
  }

  const taken = (target) => (target.dataset.number === undefined ? null : { number: Number(target.dataset.number), kind: target.getAttribute("class"), from: { ...shown.obstacles[target.dataset.number] } });

  function listen(svg) {
    svg.addEventListener("pointerdown", (event) => {
      held = taken(event.target);
      if (!held) return;
      held.at = [event.clientX, event.clientY];
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
      event.target.focus();
    });
    svg.addEventListener("pointermove", (event) => {
      if (held) move(held, [(event.clientX - held.at[0]) / shown.frame.scale, (held.at[1] - event.clientY) / shown.frame.scale]);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      svg.addEventListener(name, () => {
        if (!held) return;
        held = null;
        shown.options.dropped();
        show(shown.host, shown.part, shown.options);
      });
    }
    svg.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key], handle = taken(event.target);
      if (!way || !handle || way[handle.kind === "top" ? 0 : 1]) return;
      event.preventDefault();
      move(handle, way.map((step) => step * (event.shiftKey ? FAR : STEP)));
      shown.options.dropped();
    });
  }

  /** Show what stands there and how the loads pass over it. */
  function show(host, part, options) {
    const { phrase } = options, width = Math.max(host.clientWidth, 280);
    const same = shown && host.childElementCount && shown.obstacles.length === obstaclesOf(part).length && shown.language === options.language;
    const frame = held ? shown.frame : scaled(part, width);
    if (!same) {
      host.replaceChildren();
      const svg = draw(host, "svg", { role: "group", "aria-label": phrase(part.title) });
      const behind = draw(svg, "g", { "aria-hidden": "true" });
      shown = { svg, behind, handles: handles(svg, part, phrase), front: draw(svg, "g", { "aria-hidden": "true", class: "front" }), legend: host.appendChild(knobs.element("ul", { class: "legend" })) };
      listen(svg);
    }
    // a stack stays where a hand has put it until the answer to that comes
    if (!same || (!held && options.newest && part !== shown.part)) shown.obstacles = obstaclesOf(part);
    Object.assign(shown, { host, part, options, frame, language: options.language });
    shown.svg.setAttribute("viewBox", `0 0 ${frame.width} ${frame.height}`);
    shown.svg.setAttribute("width", frame.width);
    shown.behind.replaceChildren();
    shown.front.replaceChildren();
    axes(shown.behind, frame, part, phrase);
    const lines = part.lines.filter((line) => !["stacks", "overhead"].includes(line.name));
    for (const line of lines) curve(shown.front, frame, line);
    shown.obstacles.forEach((one, number) => place(shown.handles[number], one));
    const named = new Map(lines.map((line) => [phrase(line.name), line]));
    shown.legend.replaceChildren(...[...named].map(([name, line]) => {
      const item = knobs.element("li", {}), sample = draw(item, "svg", { viewBox: "0 0 26 10", "aria-hidden": "true" });
      inked(draw(sample, "path", { d: line.fill ? "M0 0H26V10H0z" : "M0 5H26" }), line);
      item.append(name);
      return item;
    }));
  }

  new ResizeObserver(() => shown?.host.clientWidth && !held && show(shown.host, shown.part, shown.options)).observe(document.getElementById("side"));
  return { show };
})();
