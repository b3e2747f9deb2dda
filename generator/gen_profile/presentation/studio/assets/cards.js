// What cards show beside curves: what they wait for while they are empty, margins to the limits, and maps of errors.
"use strict";
const cards = (() => {
  const { element } = knobs;
  const ROUNDING = 1e-6; // of a limit, by which what takes all of it may be off
  // parts of an answer, and where they are shown
  const PLACES = { curves: ["#margins", "#sway", "#motion"], spectrum: ["#spectrum"], robustness: ["#robustness"], comparison: ["#designs"] };

  const cardsOf = (kind) => PLACES[kind].map((place) => document.querySelector(place).closest(".card"));

  function say(kind, words) {
    for (const card of cardsOf(kind)) card.querySelector(".waiting").textContent = words;
  }

  /** Mark cards whose part is of another state than that of now. */
  function age(come, serial) {
    for (const kind of ["spectrum", "robustness", "comparison"]) for (const card of cardsOf(kind)) card.ariaBusy = come[kind] !== undefined && come[kind].serial !== serial;
  }

  /** Say in the cards of parts that have not come what they wait for, or why nothing comes. */
  function wait(words, come = {}) {
    for (const kind of Object.keys(PLACES)) if (!come[kind]) say(kind, words);
  }

  /** Note that a part has come: a card that stays empty has nothing to show. */
  const come = (kind, phrase) => say(kind, phrase("nothing"));

  /** Show how much of every limit the motion takes. */
  function margins(list, phrase) {
    const rows = list.map(({ quantity, axis, unit, takes, allowed }) => {
      const share = allowed === null ? null : takes / allowed;
      const name = [phrase(`limits.${quantity}`), phrase(axis)].filter(Boolean).join(", ");
      const bar = element("meter", { min: "0", max: "1", value: String(Math.min(share ?? 0, 1)), "aria-label": name });
      return element("div", { class: share !== null && share > 1 + ROUNDING ? "share bad" : "share" },
        element("span", {}, name),
        element("span", { class: "amount" }, `${numbers.short(takes)} ${unit}`),
        share === null ? element("span", { class: "hint" }, phrase("unlimited")) : bar,
        element("span", { class: "amount" }, share === null ? "" : `${(100 * share).toFixed(0)} %`));
    });
    document.getElementById("margins").replaceChildren(...rows);
  }

  return { wait, come, age, margins };
})();

// Maps of two parameters' errors: how much of the allowed residual sway the worst load takes, cell by cell.
const maps = (() => {
  const { element, draw } = knobs;
  const [WIDTH, HEIGHT, LEFT, BOTTOM, TOP] = [400, 250, 46, 36, 6];

  /** Ends of a cell: halfway to its neighbours. */
  const ends = (at, place) => [
    place ? (at[place - 1] + at[place]) / 2 : at[0],
    place < at.length - 1 ? (at[place] + at[place + 1]) / 2 : at[place],
  ];

  function figure({ title, x_label: across, y_label: upwards, x, y, values, frame }, { phrase }) {
    const greatest = Math.max(...values.flat().filter((value) => value !== null));
    const label = `${phrase(title)}: ${phrase("map.most")} ${Math.round(greatest)} %`;
    const right = (value) => LEFT + ((value - x[0]) / (x.at(-1) - x[0])) * (WIDTH - LEFT - 4);
    const up = (value) => HEIGHT - BOTTOM - ((value - y[0]) / (y.at(-1) - y[0])) * (HEIGHT - BOTTOM - TOP);
    const host = element("figure", {}, element("figcaption", {}, label));
    const svg = draw(host, "svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label, class: "map" });
    values.forEach((row, v) => row.forEach((value, h) => {
      if (value === null) return;
      const [from, to] = ends(x, h).map(right), [low, high] = ends(y, v).map(up);
      const cell = draw(svg, "rect", { x: from, y: high, width: to - from + 0.3, height: low - high + 0.3, class: value > 100 ? "beyond" : "within", "fill-opacity": value > 100 ? Math.min(0.35 + value / 600, 1) : 0.08 + (0.8 * value) / 100 });
      draw(cell, "title", {}, `${numbers.short(x[h])} %, ${numbers.short(y[v])} %: ${numbers.short(value)} %`);
    }));
    host.append(element("p", { class: "hint" }, phrase("map.hint")));
    if (frame) draw(svg, "rect", { x: right(-frame[0]), y: up(frame[1]), width: right(frame[0]) - right(-frame[0]), height: up(-frame[1]) - up(frame[1]), class: "frame" });
    for (const value of [x[0], 0, x.at(-1)]) draw(svg, "text", { x: right(value), y: HEIGHT - BOTTOM + 14, "text-anchor": value === 0 ? "middle" : value < 0 ? "start" : "end" }, numbers.short(value));
    for (const value of [y[0], 0, y.at(-1)]) draw(svg, "text", { x: LEFT - 5, y: up(value) + (value === 0 ? 4 : value < 0 ? 0 : 9), "text-anchor": "end" }, numbers.short(value));
    draw(svg, "text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 4, "text-anchor": "middle" }, phrase(across));
    draw(svg, "text", { x: 10, y: (HEIGHT - BOTTOM) / 2, "text-anchor": "middle", transform: `rotate(-90 10 ${(HEIGHT - BOTTOM) / 2})` }, phrase(upwards));
    return host;
  }

  const show = (host, list, options) => host.replaceChildren(...list.map((map) => figure(map, options)));
  return { show };
})();
