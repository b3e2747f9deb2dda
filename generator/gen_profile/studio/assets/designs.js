// Designs beside one another: methods of the comparison and pinned designs, as points and as a table.
"use strict";
const designs = (() => {
  const { element, draw } = knobs;
  const OVER = { acceleration: 1, duration: 1, sway: 1e3 }; // how many of the unit shown make one SI unit
  const ROOM = { left: 52, right: 16, top: 14, bottom: 34 }, HEIGHT = 230;
  const select = document.getElementById("over"), plot = document.getElementById("pareto"), table = document.getElementById("designs");
  let shown = null; // what was shown last, to be drawn again in another width
  let options = null;

  function nice(most) {
    const step = 10 ** Math.floor(Math.log10(most / 4)), times = [1, 2, 5, 10].find((k) => most / (k * step) <= 5);
    return Array.from({ length: Math.floor(most / (times * step)) + 1 }, (_, k) => k * times * step);
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
    for (const tick of nice(1e3 * top)) {
      draw(svg, "path", { class: "grid", d: `M${ROOM.left} ${up(tick / 1e3)}H${width - ROOM.right}` });
      draw(svg, "text", { x: ROOM.left - 6, y: up(tick / 1e3) + 4, "text-anchor": "end" }, curves.short(tick));
    }
    for (const tick of nice(high).filter((value) => value >= low - room)) {
      draw(svg, "text", { x: across(tick), y: HEIGHT - ROOM.bottom + 16, "text-anchor": "middle" }, curves.short(tick));
    }
    if (limit <= top) draw(svg, "path", { class: "limit", d: `M${ROOM.left} ${up(limit)}H${width - ROOM.right}` });
    draw(svg, "text", { x: width - ROOM.right, y: HEIGHT - 2, "text-anchor": "end" }, `${options.phrase(`over.${over}`)} (${over === "acceleration" ? `${unit}/s²` : over === "sway" ? "mm" : "s"})`);
    draw(svg, "text", { x: 4, y: 10 }, `${options.residual} (mm)`);
    rows.forEach((row, place) => {
      const kind = row.pinned ? "pinned" : row.own ? "own" : row.method.startsWith("optimal") ? "optimal" : "shaper";
      const mark = draw(svg, "g", { class: `point ${kind}${row.pareto || row.own || row.pinned ? "" : " beaten"}` });
      draw(mark, "circle", { cx: across(x[place]), cy: up(row.residual), r: row.own ? 7 : 5 });
      const left = across(x[place]) > 0.8 * width;
      draw(mark, "text", { x: across(x[place]) + (left ? -9 : 9), y: up(row.residual) + 4, "text-anchor": left ? "end" : "start" }, options.phrase(row.method));
      draw(mark, "title", {}, row.method);
      if (!row.own) mark.addEventListener("click", () => options.take(row));
    });
  }

  function listed() {
    const { rows, limit, unit } = shown;
    const head = [...["designs.method", "over.duration", "over.acceleration", "over.sway"].map((key) => options.phrase(key)), options.residual];
    const units = ["", "s", `${unit}/s²`, "mm", "mm"];
    const body = rows.map((row) => {
      const values = [row.duration, row.acceleration, 1e3 * row.sway, 1e3 * row.residual].map(curves.short);
      const line = element("tr", { class: row.own ? "own" : row.residual > limit ? "failed" : "" });
      const best = Object.entries(shown.recommended).filter(([, method]) => method === row.method && !row.pinned).map(([kind]) => options.phrase(kind));
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
      limit, unit: comparison?.unit ?? "m", recommended: comparison?.recommended ?? {},
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
