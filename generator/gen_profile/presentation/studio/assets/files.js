// What is taken away: the archive or report that passed the full check, and the command line that makes the same.
"use strict";
const files = (() => {
  const { element } = knobs;
  const $ = (id) => document.getElementById(id);
  let page = null; // what the page lends: words, its state, its socket
  let number = 0; // of the newest order; what comes of older ones is not heard
  let ordered = null; // the design and the formats of it
  let told = null; // what came of it last
  let setting = null; // what the studio says of the state of now; null until it has

  const formats = () => [...$("formats").querySelectorAll("input:checked")].map((box) => box.value);
  const design = () => JSON.stringify([page.state(), formats()]);

  function order(report) {
    ordered = design();
    told = null;
    page.say({ say: "make", number: ++number, state: page.state(), report, formats: formats() });
    show();
  }

  function stop() {
    page.say({ say: "stop" });
    number += 1;
    told = null;
  }

  const parts = {
    progress({ stage, done: so, total, remark }) {
      const share = total ? ` ${so} / ${total}` : "";
      const bar = element("progress", { "aria-label": page.phrase("progress"), ...(total ? { max: String(total), value: String(so) } : {}) });
      return [bar, ` ${page.phrase(stage)}${share} ${remark}`];
    },
    made({ passed, sentences, scenarios, file }) {
      const link = file ? [element("a", { href: file.link, download: file.name, class: "main" }, `${file.name} (${Math.ceil(file.bytes / 1024)} kB)`)] : [];
      const verdict = element("p", { class: passed ? "good" : "bad" }, passed ? page.filled("checked", { scenarios }) : page.phrase("unchecked"));
      return [verdict, ...sentences.map((one) => element("p", {}, page.phrase(one))), ...link];
    },
    failure: ({ sentences }) => parts.made({ passed: false, sentences }), // the process that made them has ended
  };

  /** Show what came of the order; nothing of it stays beside another design. */
  function show() {
    const outdated = told && ordered !== design();
    if (outdated && told.part === "progress") stop();
    $("stop").hidden = told?.part !== "progress";
    $("outcome").replaceChildren(...(outdated ? [page.phrase("outdated")] : told ? parts[told.part](told) : []));
  }

  function hear(part) {
    if (part.serial !== number) return;
    told = part;
    show();
  }

  /** Write the command line that makes the files that are ticked; it writes a CSV where none is named. */
  function command() {
    const named = formats().join() === "csv" ? [] : formats();
    $("command").textContent = setting ? [setting.command, ...named.map((name) => `--export ${name}`)].join(" ") : "";
  }

  /** Withdraw what is of another state; the command line, too, once it is known that its answer takes time, or that none comes. */
  function changed() {
    setting = null;
    allow();
    show();
  }

  const allow = () => { for (const name of ["copy", "spec"]) $(name).disabled = !setting; };

  /** Take how else the state of now is stated. */
  function state(part) {
    setting = part;
    allow();
    command();
  }

  /** Offer formats, none of whose files there are yet. */
  function offer(known) {
    const boxes = Object.entries(known).map(([name, about]) => element("label", { title: about }, element("input", { type: "checkbox", value: name, checked: name === "csv" }), name));
    if (!$("formats").querySelector("input")) $("formats").append(...boxes);
    ordered = told = null; // a studio that was started again has none
    show();
  }

  $("formats").addEventListener("change", () => { command(); show(); });
  $("make").addEventListener("click", () => order(false));
  $("report").addEventListener("click", () => order(true));
  $("stop").addEventListener("click", () => { stop(); show(); });
  $("spec").addEventListener("click", () => {
    const link = element("a", { href: URL.createObjectURL(new Blob([setting.text], { type: "application/toml" })), download: `${setting.name}.toml` });
    link.click();
    URL.revokeObjectURL(link.href);
  });
  $("copy").addEventListener("click", async () => {
    await navigator.clipboard.writeText($("command").textContent);
    $("copy").textContent = page.phrase("copied");
    setTimeout(() => { $("copy").textContent = page.phrase("copy"); }, 1500);
  });
  return { lend: (lent) => { page = lent; }, offer, hear, changed, command, state, speak: show };
})();
