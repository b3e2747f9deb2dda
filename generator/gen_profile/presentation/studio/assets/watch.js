// A controller that is watched meanwhile: how its block stands, and its setpoints over those that its table has.
"use strict";
const watched = (() => {
  const { element } = knobs;
  const EVERY = 200; // ms between an answer and the next question
  const PILLS = { open: "watch.open", passed: "watch.proved", failed: "watch.unproved" };
  const $ = (id) => document.getElementById(id);
  let page = null, last = null, waiting = false;

  function ask() {
    if (waiting || views.current() !== "watch") return;
    waiting = true;
    page.say({ say: "watch" });
  }

  function show(part) {
    last = part;
    waiting = false;
    tell(part);
    if (!part.faults.length) setTimeout(ask, EVERY);
  }

  function tell(part) {
    const { axes, phase, faults } = part;
    $("watched-name").textContent = part.name;
    pill(faults.length ? "failed" : phase ? "passed" : "open");
    $("unproved").replaceChildren(...faults.map((one) => element("p", {}, page.phrase(one))));
    if (!phase) return;
    const seconds = (value) => `${numbers.local(value.toFixed(2))} s`;
    const planner = "promise" in part;
    const ofMotion = () => [
      ["watch.runs", [part.runs, part.motion === null ? "" : `nProfile ${part.motion}`].filter(String).join(", ")],
      ["watch.time", `${numbers.local(part.time.toFixed(2))} / ${seconds(part.duration)}`],
      ["watch.rate", numbers.local(part.rate.toFixed(2))],
    ];
    const ofPlanner = () => [
      ["watch.command", [page.phrase(`watch.command.${part.command}`), ...(part.command ? [part.commanded.map(numbers.short).join("; ")] : [])].join(" ")],
      ["watch.to_go", seconds(part.to_go)],
      ["watch.promise", page.phrase(`watch.promise.${part.promise}`)],
    ];
    const rows = [
      ["watch.phase", [page.phrase(`watch.${phase}`), part.error ? `nErrorId ${part.error}` : "", part.changed ? page.phrase("watch.changed") : ""].filter(Boolean).join(", ")],
      ...(planner ? ofPlanner() : ofMotion()),
    ].map(([key, value]) => [page.phrase(key), value]);
    const named = (name, order) => `${page.phrase(name)}: ${page.phrase(["position", "velocity", "acceleration"][order])}`;
    for (const [axis, { name, unit }] of axes.entries()) {
      part.setpoints[axis].forEach((value, order) => rows.push([named(name, order), `${numbers.short(value)} ${unit}${["", "/s", "/s²"][order]}`]));
    }
    $("stands").replaceChildren(...rows.map(([key, value]) => element("div", {}, element("dt", {}, key), element("dd", {}, value))));
    const panels = [0, 1].flatMap((order) => axes.map(({ name, unit, planned, seen }) => ({
      title: named(name, order), x_label: page.phrase("drive.time"), y_label: `${unit}${order ? "/s" : ""}`, x: part.times, levels: [], bands: [],
      curves: [
        { name: planner ? "watch.commanded" : "watch.table", colour: "ghost", dash: "dash", width: 1.2, y: planned[order] },
        { name: "watch.controller", colour: "#0072b2", dash: "solid", width: 2.4, y: seen[order], spans: true },
      ],
    })));
    curves.draw($("course"), panels, { phrase: page.phrase, language: words.language(), alone: true });
  }

  /** Say whether all is as proved; a screen reader gets changes only. */
  function pill(kind) {
    if ($("proved").dataset.kind === kind) return;
    $("proved").dataset.kind = kind;
    $("proved").className = `pill ${kind}`;
    $("proved").textContent = page.phrase(PILLS[kind]);
  }

  /** Show the same in another language. */
  function speak() {
    delete $("proved").dataset.kind;
    if (last) tell(last);
  }

  function lend(given) {
    page = given;
    views.watch(ask);
  }

  /** Begin, once it is known whether there is anything to watch. */
  function begin(there) {
    document.querySelector("#places [data-view=watch]").hidden = !there;
    waiting = !there;
    ask();
  }

  return { lend, begin, show, speak };
})();
