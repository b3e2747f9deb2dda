// Designs beside one another: methods of the comparison and pinned designs, as points and as a table.
"use strict";
const designs = (() => {
  const { element, draw } = knobs;
  const OVER = { acceleration: 1, duration: 1, sway: 1e3 }; // how many of the unit shown make one SI unit
  const ROOM = { left: 52, right: 16, top: 22, bottom: 40 }, HEIGHT = 300, LETTER = 6.3; // pixels
  const select = document.getElementById("over"), plot = document.getElementById("pareto"), table = document.getElementById("designs");
  let shown = null; // what was shown last, to be drawn again in another width
  let options = null;

  /** Find a place for every name beside its point where it lies on no other; those that another design beats come last. */
  function named(points, width) {
    const taken = points.map(({ x, y, r }) => [x - r, y - r, x + r, y + r]);
    const order = [...points].sort((one, other) => other.matters - one.matters);
    for (const point of order) {
      const { x, y, r } = point, long = LETTER * point.name.length, gap = r + 4;
      const tries = [[gap, 4, "start"], [-gap, 4, "end"], [0, -gap, "middle"], [0, gap + 9, "middle"], [gap, -8, "start"], [-gap, -8, "end"], [gap, 16, "start"], [-gap, 16, "end"]];
      for (const [right, down, anchor] of tries) {
        const left = x + right - { start: 0, middle: long / 2, end: long }[anchor];
        const box = [left, y + down - 10, left + long, y + down + 3];
        if (box[0] < 2 || box[2] > width - 2 || box[1] < 12 || box[3] > HEIGHT - ROOM.bottom + 2) continue;
        const own = points.indexOf(point);
        if (taken.some((other, place) => place !== own && box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3])) continue;
        taken.push(box);
        point.label = { x: x + right, y: y + down, "text-anchor": anchor };
        break;
      }
    }
  }

  /** Worst residual sway over another objective: down and to the left is better; what is beaten is faint. */
  function points() {
    plot.replaceChildren();
    const { rows, limit, unit } = shown;
    if (!rows.length) return;
    const over = select.value, factor = OVER[over];
    const width = Math.max(plot.clientWidth, 240);
    const x = rows.map((row) => factor * row[over]), top = Math.min(Math.max(...rows.map((row) => row.residual)), 4 * limit) * 1.1;
    const [low, high] = [Math.min(...x), Math.max(...x)], room = 0.08 * (high - low || high || 1);
    const across = (value) => ROOM.left + ((value - low + room) / (high - low + 2 * room)) * (width - ROOM.left - ROOM.right);
    const up = (value) => HEIGHT - ROOM.bottom - (Math.min(value, top) / top) * (HEIGHT - ROOM.top - ROOM.bottom);
    const svg = draw(plot, "svg", { viewBox: `0 0 ${width} ${HEIGHT}`, width, height: HEIGHT, role: "img", "aria-label": options.phrase("designs") });
    for (const tick of numbers.ticks(0, 1e3 * top)) {
      draw(svg, "path", { class: "grid", d: `M${ROOM.left} ${up(tick / 1e3)}H${width - ROOM.right}` });
      draw(svg, "text", { x: ROOM.left - 6, y: up(tick / 1e3) + 4, "text-anchor": "end" }, numbers.short(tick));
    }
    for (const tick of numbers.ticks(low - room, high + room)) {
      draw(svg, "path", { class: "grid", d: `M${across(tick)} ${HEIGHT - ROOM.bottom}v4` });
      draw(svg, "text", { x: across(tick), y: HEIGHT - ROOM.bottom + 16, "text-anchor": "middle" }, numbers.short(tick));
    }
    if (limit <= top) draw(svg, "path", { class: "limit", d: `M${ROOM.left} ${up(limit)}H${width - ROOM.right}` });
    draw(svg, "text", { x: width - ROOM.right, y: HEIGHT - 6, "text-anchor": "end" }, `${options.phrase(`over.${over}`)} (${over === "acceleration" ? `${unit}/s²` : over === "sway" ? "mm" : "s"})`);
    draw(svg, "text", { x: 4, y: 10 }, `${options.residual} (mm)`);
    const marks = rows.map((row, place) => ({
      row, x: across(x[place]), y: up(row.residual), r: row.own ? 7 : 5, name: options.phrase(row.method),
      matters: (row.own || row.pinned ? 2 : 0) + (row.pareto ? 1 : 0),
    }));
    named(marks, width);
    for (const { row, x: cx, y: cy, r, name, label } of marks) {
      const kind = row.pinned ? "pinned" : row.own ? "own" : row.method.startsWith("optimal") ? "optimal" : "shaper";
      const mark = draw(svg, "g", { class: `point ${kind}${row.pareto || row.own || row.pinned ? "" : " beaten"}` });
      draw(mark, "circle", { cx, cy, r });
      if (label) draw(mark, "text", label, name);
      draw(mark, "title", {}, name);
      if (!row.own) mark.addEventListener("click", () => options.take(row));
    }
  }

  function listed() {
    const { rows, limit, unit } = shown;
    const head = [...["designs.method", "over.duration", "over.acceleration", "over.sway"].map((key) => options.phrase(key)), options.residual];
    const units = ["", "s", `${unit}/s²`, "mm", "mm"];
    const body = rows.map((row) => {
      const values = [...[row.duration, row.acceleration].map(numbers.short), ...[row.sway, row.residual].map((metres) => numbers.millimetres(numbers.digits(1e3 * metres, 3)))];
      const line = element("tr", { class: row.own ? "own" : row.residual > limit ? "failed" : "" });
      const best = Object.entries(shown.recommended).filter(([, method]) => method === (row.own ? shown.own : row.method) && !row.pinned).map(([kind]) => options.phrase(kind));
      line.append(element("th", { scope: "row" }, options.phrase(row.method), ...best.map((kind) => element("span", { class: "badge" }, kind))));
      values.forEach((value, place) => line.append(element("td", { "data-head": head[place + 1] }, value, element("small", {}, ` ${units[place + 1]}`))));
      const cell = element("td");
      if (!row.own) {
        const take = element("button", { type: "button", "aria-label": `${options.phrase("take")}: ${options.phrase(row.method)}` }, options.phrase("take"));
        take.addEventListener("click", () => options.take(row));
        cell.append(take);
      }
      if (row.pinned) {
        const drop = element("button", { type: "button", "aria-label": `${options.phrase("unpin")}: ${row.method}` }, "×");
        drop.addEventListener("click", () => options.unpin(row));
        cell.append(drop);
      }
      line.append(cell);
      return line;
    });
    const heads = [...head.map((word) => element("th", { scope: "col" }, word)), element("td")];
    table.replaceChildren(element("table", {}, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...body)));
  }

  /** Show the comparison, the design of now, and what was pinned. */
  function show(comparison, own, pins, given) {
    options = given;
    const others = (comparison?.rows ?? []).filter((row) => row.method !== comparison.own);
    const mine = own ? [{ ...own, own: true, pareto: true }] : [];
    const limit = comparison?.limit ?? given.limit;
    if (!limit) return;
    shown = {
      rows: [...mine, ...pins.map((pin) => ({ ...pin.point, method: pin.name, pinned: true, pareto: true, pin })), ...others],
      limit, unit: comparison?.unit ?? "m", own: comparison?.own, recommended: comparison?.recommended ?? {},
    };
    const chosen = select.value || "acceleration";
    select.replaceChildren(...Object.keys(OVER).map((key) => element("option", { value: key }, options.phrase(`over.${key}`))));
    select.value = chosen;
    points();
    listed();
  }
  select.addEventListener("change", () => shown && points());
  new ResizeObserver(() => shown && points()).observe(plot.parentElement);
  return { show };
})();
