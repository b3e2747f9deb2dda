// Files from the field: a logged swing that tells parameters, a measured move over the plan, a spec to open.
"use strict";
const logs = (() => {
  const { element } = knobs;
  const UNITS = { time: ["s", "ms"], position: ["", "m", "mm", "um", "rad", "deg", "counts"], sway: ["m", "mm", "um"], angle: ["rad", "deg"] };
  const AFTER_KNOBS = 400; // ms that knobs rest before a measured move is held against the new plan
  const $ = (id) => document.getElementById(id);
  let page = null; // what the page lends: words, its state, its socket
  let reading = null; // how the log is read; null where there is none
  let outcome = null; // what it told last
  let number = 0, later = null;

  /** Take a file that was dropped or chosen. */
  function take(file) {
    const most = page.mostUpload();
    if (file.size > most) return page.notice(page.filled("field.large", { name: file.name, most: Math.floor(most / 1e6) }));
    page.send(new Blob([JSON.stringify({ say: "drop", name: file.name }), "\n", file]));
    if (/\.toml$/i.test(file.name)) return;
    views.go("measure");
    reading = { source: file.name, use: "", columns: null, after: 0, at: [], free: [] };
    ask();
  }

  function ask() {
    const { use, columns, after, at, free } = reading;
    $("tells").replaceChildren(element("progress", { "aria-label": page.phrase("progress") }), ` ${page.phrase("field.reading")} `);
    page.say({ say: "read", number: ++number, state: page.state(), use, columns, after, at: reading.axes?.length > 1 ? at : [], free });
  }

  function forget() {
    page.say({ say: "forget" });
    reading = outcome = null;
    number++;
    clearTimeout(later);
    for (const part of [$("reading"), $("forget")]) part.hidden = true;
    $("tells").replaceChildren();
    curves.draw($("logged"), [], page.drawing());
  }

  /** Hold a measured move against the plan of now. */
  function planned() {
    clearTimeout(later);
    if (reading?.use === "move") later = setTimeout(ask, AFTER_KNOBS);
  }

  // how the log is read -------------------------------------------------------------------------------------

  const quantity = (base) => base.split("_").at(-1);

  /** Name what a column may hold. */
  function named(base) {
    const owner = base.slice(0, -quantity(base).length - 1);
    const words = page.phrase(`field.${quantity(base)}`);
    return owner ? `${words}, ${page.phrase(owner)}` : words;
  }

  /** Split "payload_sway_0.1mm" into what is measured, the size of one count, and its unit. */
  function split(meaning) {
    const base = reading.meanings.find((one) => meaning === one || meaning.startsWith(`${one}_`)) ?? "";
    const [, step, unit] = meaning.slice(base.length + 1).match(/^([\d.]*)(.*)$/);
    return [base, step, unit];
  }

  /** One column of the file: its name, what it holds, and the unit. */
  function column({ name, meaning }, place, changed) {
    const label = name || `${page.phrase("field.column")} ${place + 1}`;
    const [held, step, unit] = split(meaning);
    const meanings = element("select", { "aria-label": label }, element("option", { value: "" }, "–"), ...reading.meanings.map((base) => element("option", { value: base }, named(base))));
    const units = element("select", { "aria-label": `${label}, ${page.phrase("axis.unit")}` });
    const count = element("input", { ...numbers.kind(), min: "0", value: numbers.local(step), placeholder: "1", title: page.phrase("field.count"), "aria-label": `${label}, ${page.phrase("field.count")}` });
    const offer = (chosen) => {
      const known = UNITS[quantity(meanings.value)] ?? [];
      units.hidden = !known.length;
      count.hidden = !["sway", "angle"].includes(quantity(meanings.value)); // an axis' counts are in the spec
      units.replaceChildren(...known.map((one) => element("option", { value: one }, one || page.phrase("field.own"))));
      units.value = known.includes(chosen) ? chosen : known[0] ?? "";
    };
    meanings.value = held;
    offer(unit);
    meanings.addEventListener("change", () => { offer(""); changed(row); });
    for (const one of [count, units]) one.addEventListener("change", () => changed(row));
    const row = {
      host: element("div", { class: "column" }, element("span", {}, label), meanings, element("div", { class: "value" }, count, units)),
      free: () => { meanings.value = ""; offer(""); },
      get base() { return meanings.value; },
      get written() { return meanings.value && `${[meanings.value, `${count.hidden || !(numbers.typed(count.value) > 0) ? "" : numbers.typed(count.value)}${units.value}`].filter(Boolean).join("_")}=${place + 1}`; },
    };
    return row;
  }

  function choice(kind) {
    const box = element("input", { type: "radio", name: "use", value: kind, checked: reading.use === kind });
    box.addEventListener("change", () => { reading.use = kind; build(); ask(); });
    return element("label", {}, box, page.phrase(`field.${kind}`));
  }

  function build() {
    const form = $("reading");
    const rows = reading.table.map((one, place) => column(one, place, (row) => {
      for (const other of rows) if (other !== row && other.base === row.base) other.free(); // each is there once
      reading.columns = rows.map((other) => other.written).filter(Boolean).join(",") || null;
      reading.table = reading.table.map(({ name }, at) => ({ name, meaning: (rows[at].written || "=").split("=")[0] }));
      ask();
    }));
    const swing = reading.use === "swing" ? [after(), ...(reading.axes.length > 1 ? [stood()] : []), freed()] : [];
    form.replaceChildren(
      element("p", { class: "name" }, reading.source),
      element("fieldset", {}, element("legend", {}, page.phrase("field.use")), choice("swing"), choice("move")),
      ...swing,
      element("fieldset", { class: "columns" }, element("legend", {}, page.phrase("field.columns")), ...rows.map((row) => row.host)),
    );
    for (const part of [form, $("forget")]) part.hidden = false;
  }

  function after() {
    const field = element("input", { ...numbers.kind(), min: "0", value: numbers.local(reading.after) });
    field.addEventListener("change", () => { reading.after = Math.max(0, numbers.typed(field.value) || 0); ask(); });
    return element("label", { class: "after" }, page.phrase("field.after"), " ", field, " s");
  }

  /** Where the axes stood: a rope may be as long as its hoist has let out. */
  function stood() {
    const fields = reading.at.map((place, axis) => {
      const { name, unit } = reading.axes[axis];
      const field = element("input", { ...numbers.kind(), value: numbers.local(numbers.digits(place)) });
      field.addEventListener("change", () => { reading.at[axis] = numbers.typed(field.value) || 0; ask(); });
      return element("label", {}, page.phrase(name), field, unit);
    });
    return element("fieldset", {}, element("legend", {}, page.phrase("field.at")), ...fields);
  }

  function freed() {
    const boxes = reading.parameters.map(({ name, about }) => {
      const box = element("input", { type: "checkbox", value: name, checked: reading.free.includes(name) });
      box.addEventListener("change", () => {
        reading.free = boxes.map((label) => label.firstChild).filter((one) => one.checked).map((one) => one.value);
        if (reading.free.length) ask();
      });
      return element("label", { title: page.phrase(about) }, box, name);
    });
    return element("fieldset", {}, element("legend", {}, page.phrase("field.free")), ...boxes);
  }

  // what it tells -------------------------------------------------------------------------------------------

  const sentences = (list, kind = "") => list.map((one) => element("p", { class: kind }, page.phrase(one)));

  function tell(...parts) {
    $("tells").replaceChildren(...parts);
  }

  const command = (text) => element("pre", { tabindex: "0", "aria-label": page.phrase("same") }, text);

  function listed({ parameters, confidence }) {
    const heads = ["field.parameter", "field.found", "field.range", "field.before"].map((key) => element("th", { scope: "col" }, page.phrase(key)));
    const rows = parameters.map(({ name, value, half_range: half, given, unit }) => element("tr", {},
      element("th", { scope: "row" }, name),
      ...[`${numbers.digits(value)} ${unit}`, `± ${numbers.digits(half, 2)} ${unit}`, `${numbers.digits(given)} ${unit}`].map(numbers.local).map((text) => element("td", {}, text))));
    return [
      element("table", { class: "found" }, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows)),
      element("p", { class: "hint" }, page.filled("field.confidence", { share: Math.round(100 * confidence) })),
    ];
  }

  const parts = {
    log(part) {
      reading = { ...part, table: part.named ? part.columns : reading.table, columns: reading.columns };
      if (part.named || $("reading").hidden) build();
    },
    identified(part) {
      const button = element("button", { type: "button", class: "main" }, page.phrase("field.take"));
      button.addEventListener("click", () => page.edit(part.edits));
      tell(...listed(part), ...sentences(part.warnings.map((one) => `${page.phrase("warning")}: ${page.phrase(one)}.`)), button, command(part.command));
      curves.draw($("logged"), part.panels, page.drawing({ alone: true }));
    },
    measured(part) {
      const [verdict, ...others] = part.sentences;
      tell(element("p", { class: part.passed === null ? "" : part.passed ? "good" : "bad" }, page.phrase(verdict)), ...sentences(others), command(part.command));
      curves.draw($("logged"), part.panels, page.drawing());
    },
    unread(part) {
      tell(...sentences(part.sentences, "bad"));
      curves.draw($("logged"), part.panels ?? [], page.drawing({ alone: true }));
    },
  };
  parts.failure = parts.unread;

  /** Show a part of the newest answer. */
  function show(part) {
    if (part.serial !== number || !reading) return;
    if (part.part !== "log") outcome = part;
    parts[part.part]?.(part);
  }

  /** Show the same again in another language. */
  function speak() {
    if (!reading?.table) return;
    build();
    if (outcome) parts[outcome.part](outcome);
  }

  function begin(given) {
    page = given;
    $("choose").addEventListener("click", () => $("file").click());
    $("file").addEventListener("change", () => {
      if ($("file").files.length) take($("file").files[0]);
      $("file").value = "";
    });
    $("forget").addEventListener("click", forget);
    $("reading").addEventListener("submit", (event) => event.preventDefault());
    addEventListener("dragover", (event) => {
      if (!event.dataTransfer.types.includes("Files")) return;
      event.preventDefault();
      document.body.classList.add("dropping");
    });
    addEventListener("dragleave", (event) => event.relatedTarget === null && document.body.classList.remove("dropping"));
    addEventListener("drop", (event) => {
      document.body.classList.remove("dropping");
      if (!event.dataTransfer.files.length) return;
      event.preventDefault();
      take(event.dataTransfer.files[0]);
    });
  }

  return { begin, show, planned, speak, forget };
})();
