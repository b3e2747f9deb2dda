// What cards show beside curves: what they wait for while they are empty, and the margins to the limits.
"use strict";
const cards = (() => {
  const { element } = knobs;
  // parts of an answer, and where they are shown
  const PLACES = { curves: ["#margins", "#sway", "#motion"], spectrum: ["#spectrum"], robustness: ["#robustness"], comparison: ["#designs"] };

  function say(kind, words) {
    for (const place of PLACES[kind]) document.querySelector(place).closest(".card").querySelector(".waiting").textContent = words;
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
      return element("div", { class: share !== null && share > 1 ? "share bad" : "share" },
        element("span", {}, name),
        element("span", { class: "amount" }, `${numbers.short(takes)} ${unit}`),
        share === null ? element("span", { class: "hint" }, phrase("unlimited")) : bar,
        element("span", { class: "amount" }, share === null ? "" : `${(100 * share).toFixed(0)} %`));
    });
    document.getElementById("margins").replaceChildren(...rows);
  }

  return { wait, come, margins };
})();
