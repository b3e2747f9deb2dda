// The page: holds the state (a start and edits), asks the server for its picture, and shows every part that comes.
"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  const { element } = knobs;
  const { phrase, filled, placed, loaded } = words;
  await words.load();
  const COME_BACK = 2000; // ms between looks whether the studio is there again
  const ONCE = new Set(["hello", "state", "opened", "consent"]); // parts that do something: no other language shows them again
  let state = { preset: "", edits: {} };
  let kept = JSON.stringify(state); // the state that undo leads back from
  const undone = [], done = [];
  const latest = {}; // the newest part of every kind
  const pins = [];
  const turned = new Map(); // serial → when the hand turned the knob that it answers
  let serial = 0, pictured = 0, handles = [], asked = null, wanted = 0, player = null, waiting = null, painting = false;
  const inbox = []; // what came while the browser was to draw

  // words ---------------------------------------------------------------------------------------------------

  const mm = (metres) => `${numbers.millimetres(1e3 * metres)} mm`;

  function speak() {
    for (const part of document.querySelectorAll("[data-text]")) part.textContent = phrase(part.dataset.text);
    for (const part of document.querySelectorAll("[data-words]")) {
      part.setAttribute("aria-label", phrase(part.dataset.words));
      if (part.matches("button")) part.title = phrase(part.dataset.words);
    }
    $("language").textContent = words.other().toUpperCase();
    cards.wait(phrase("waiting"));
    player = null;
    logs.speak();
    files.speak();
    driving.speak();
    watched.speak();
    for (const part of Object.values(latest)) if (!ONCE.has(part.part)) take(part);
  }

  /** Name the page by the spec and the view, for the browser's list of what is open. */
  function titled() {
    document.title = [latest.setting?.name, phrase(`view.${views.current()}`), "gen-profile studio"].filter(Boolean).join(" · ");
  }

  // state ---------------------------------------------------------------------------------------------------

  const setting = () => ({ phrase, turn, begin, language: words.language() });

  /** Take a knob's new value into the state; the end of a gesture is what undo steps over. */
  function turn(knob, value, end) {
    edit(edits(knob, value), end);
  }

  /** What a knob's new value changes in the spec: some values go together. */
  function edits(knob, value) {
    const every = latest.setting.knobs;
    const known = (path) => every.find((one) => one.path === path)?.value;
    if (knob.kind === "interval") {
      const name = knob.path.split(".").at(-1);
      const others = every.some((one) => one.kind === "interval" && one.path !== knob.path && one.value);
      if (!value) return { [knob.path]: null, ...(others ? {} : { "robustness.method": "none" }) };
      const [low, high] = value;
      return {
        [`plant.${name}`]: numbers.digits((low + high) / 2),
        [knob.path]: Math.min(numbers.digits((high - low) / (high + low)), 0.9),
        ...(known("robustness.method") === "none" ? { "robustness.method": "sensitivity" } : {}),
      };
    }
    if (knob.path === "actuator.type") return { [knob.path]: value, "actuator.tau": value === "ideal" ? null : known("actuator.tau") ?? 0.1 };
    if (knob.index === undefined) return { [knob.path]: value };
    const array = every.filter((one) => one.path === knob.path).map((one) => state.edits[knob.path]?.[one.index] ?? one.value);
    array[knob.index] = value;
    return { [knob.path]: array };
  }

  const at = (path) => latest.setting.knobs.find((knob) => knob.path === path);

  /** What a value begins with that the spec has left out: what the motion takes now, or a usual one. */
  function begin(knob) {
    const taken = (latest.curves?.margins ?? []).filter((one) => [one.place, `limits.${one.quantity}`].includes(knob.path)).map((one) => one.takes);
    if (knob.kind === "interval" || (knob.kind === "pair" && knob.about)) {
      const nominal = at(`plant.${knob.name}`).value;
      return nominal ? [numbers.digits(0.9 * nominal), numbers.digits(1.1 * nominal)] : [0, 0.1];
    }
    if (knob.kind === "pair") {
      const ends = latest.setting.knobs.filter((one) => /^move\.(distance|target|start)$/.test(one.path) && (!knob.name || one.name === knob.name));
      return [Math.min(0, ...ends.map((one) => one.value)), Math.max(0, ...ends.map((one) => one.value))];
    }
    if (taken.length) return numbers.digits((1.05 * Math.max(...taken)).toPrecision(3));
    if (knob.path === "limits.sway") return numbers.digits((1.05 * (latest.verdict?.sway_worst ?? 0.1)).toPrecision(3));
    return knob.usual ?? knob.span?.[0] ?? 1;
  }

  function edit(changes, end = true) {
    state = { ...state, edits: { ...state.edits, ...changes } };
    wanted = window.event?.timeStamp ?? performance.now();
    if (end) keep();
    ask();
  }

  function keep() {
    const now = JSON.stringify(state);
    if (now === kept) return;
    done.push(kept);
    undone.length = 0;
    kept = now;
    arrows();
    tellAddress();
  }

  /** Put the state into the address at the end of a gesture: browsers refuse one that changes all the time. */
  function tellAddress() {
    const { address, serial: of } = latest.setting ?? {};
    if (of === serial && kept === JSON.stringify(state)) views.keep(address);
  }

  function arrows() {
    $("undo").disabled = !done.length;
    $("redo").disabled = !undone.length;
  }

  function step(from, to) {
    if (!from.length) return;
    to.push(kept);
    kept = from.pop();
    go(JSON.parse(kept));
    arrows();
  }

  function go(next) {
    state = next;
    wanted = performance.now();
    $("preset").value = state.preset;
    ask();
  }

  function ask() {
    const now = JSON.stringify(state);
    if (now === asked) return;
    $("pin").disabled = true;
    files.changed();
    if (socket.readyState !== WebSocket.OPEN) return files.command();
    asked = now;
    turned.set(++serial, wanted);
    expect();
    say({ say: "show", serial, state });
  }

  /** Say so when the answer takes its time: an older one could be taken for it. */
  function expect() {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      document.body.classList.add("busy");
      document.body.classList.toggle("stale", pictured !== serial);
      judge("open", phrase("overdue"), [], []);
      files.command();
      cards.wait(phrase("waiting"), latest);
    }, 250);
  }

  // parts ---------------------------------------------------------------------------------------------------

  const drawing = (more = {}) => ({ phrase, language: words.language(), drag: (path, value) => edit({ [path]: value }, false), dropped: keep, ...more });

  /** Give the limits' places to the panels that show them, so that they can be dragged. */
  function withLimits(panels, margins) {
    return panels.map((panel) => {
      const margin = margins.find((one) => panel.title.values?.quantity?.toLowerCase() === one.quantity && (!one.axis || panel.title.values.name === one.axis));
      return { ...panel, limit: margin && margin.allowed !== null ? { path: margin.place, factor: 1 } : null };
    });
  }

  /** Tell which knobs are the end of the move and the limit in the curves of the loads; null where there is none. */
  function draggable() {
    const every = latest.setting?.knobs ?? [];
    const duration = every.find((knob) => knob.path === "move.duration");
    return [typeof duration?.value === "number" ? duration.path : null, every.find((knob) => knob.words === "check.residual_sway")?.path ?? null];
  }

  const ghosts = (panel) => pins.flatMap((pin) => {
    const same = pin.panels.find((one) => JSON.stringify(one.title) === JSON.stringify(panel.title));
    if (!same) return [];
    const [{ y }] = same.curves;
    const at = (time) => {
      const place = same.x.findIndex((x) => x >= time);
      return place < 0 ? null : y[place];
    };
    return [{ name: pin.name, colour: "ghost", dash: "dash", width: 1.3, y: panel.x.map(at) }];
  });

  const parts = {
    hello({ presets, opened, start, formats, watching }) {
      watched.begin(watching);
      $("preset").replaceChildren(started("", start.replace("--preset ", "")), ...Object.entries(presets).filter(([name]) => start !== `--preset ${name}`).map(([name]) => element("option", { value: name }, name)));
      opened.forEach(offer);
      files.offer(formats);
      $("preset").value = state.preset;
    },
    state({ preset, edits: taken }) {
      state = { preset, edits: taken };
      kept = asked = JSON.stringify(state);
      $("preset").value = preset;
    },
    notice: ({ sentence }) => notice(sentence),
    opened({ preset }) {
      offer(preset);
      restart(preset);
    },
    sketch: (part) => parts.side(part),
    side(part) {
      $("passage").hidden = false;
      const answered = performance.now();
      side.show($("side"), part, drawing({ newest: part.serial === serial }));
      pictured = part.serial;
      if (pictured === serial) document.body.classList.remove("stale");
      if (turned.has(part.serial)) paint(part.serial, answered);
    },
    curves(part) {
      const { motion, sway, margins, duration } = part;
      handles = draggable();
      const [path, limit] = handles;
      cards.come("curves", phrase);
      const loads = sway.map((panel) => ({ ...panel, end: { at: duration, path }, limit: limit && { path: limit, factor: 1e3 } }));
      const options = drawing({ ghosts, seek: (time) => player?.seek(time) });
      const answered = performance.now();
      curves.draw($("sway"), loads, options);
      curves.draw($("motion"), withLimits(motion, margins), options);
      cards.margins(margins, phrase);
      pictured = part.serial;
      if (pictured === serial) document.body.classList.remove("stale");
      paint(part.serial, answered);
    },
    animation({ animation }) {
      const host = document.querySelector(".animation");
      host.hidden = false;
      const views = animation.views.map((view) => ({ ...view, title: phrase(view.title) }));
      const actors = animation.actors.map((actor) => ({ ...actor, name: phrase(actor.name) }));
      const shown = { ...animation, views, actors, load: phrase(animation.load) };
      if (player) player.take(shown);
      else player = playAnimation(host, shown, { play: phrase("play"), pause: phrase("pause"), of: phrase("of"), arrived: phrase("arrived"), number: numbers.local });
    },
    setting(part) {
      if (!part.knobs.some((knob) => knob.group === "path")) $("passage").hidden = true;
      $("name").textContent = part.name;
      $("summary").textContent = phrase(part.summary);
      titled();
      knobs.show(part.knobs, setting());
      knobs.blame([]);
      if (part.serial === serial) files.state(part);
      notice(part.warnings.length ? `${phrase("warning")}: ${part.warnings.map(placed).join(" ")}` : "");
      if (latest.curves && String(handles) !== String(draggable())) take(latest.curves); // they came before their knobs
      tellAddress();
    },
    verdict(part) {
      const word = part.passed ? "passed" : "failed";
      $("pin").disabled = part.serial !== serial;
      if (part.serial === serial) settled(false);
      else expect();
      logs.planned();
      judge(word, filled(word, { load: loaded(part.load), residual: mm(part.residual), allowed: mm(part.allowed), machine: phrase(part.machine) }), [], []);
      const facts = [
        ["over.duration", `${numbers.local(numbers.digits(part.duration))} s`],
        ["over.acceleration", `${numbers.short(part.point.acceleration)} ${latest.curves.margins[0].unit.replace("/s", "/s²")}`],
        ["sway", mm(part.sway)],
        ["sway.worst", mm(part.sway_worst)],
        ["residual", mm(part.residual)],
        ["margin", mm(part.allowed - part.residual)],
      ];
      if (part.one_by_one) facts.splice(1, 0, ["over.one_by_one", `${numbers.local(numbers.digits(part.one_by_one, 4))} s`]);
      if (part.room !== null) facts.push(["over.room", mm(part.room)]);
      $("facts").replaceChildren(...facts.map(([key, value]) => element("div", {}, element("dt", {}, filled(key, { load: phrase(part.load) })), element("dd", {}, value))));
      listDesigns();
    },
    faults({ faults }) {
      cards.wait(phrase("none"), latest);
      const others = knobs.blame(faults.map((one) => ({ ...one, sentence: phrase(one.sentence) })));
      judge("failed", phrase("faulty"), (others.length ? others : faults).map(placed), []);
      settled(true);
    },
    failure({ answer, sentences, cures }) {
      cards.wait(phrase(answer), latest);
      judge("failed", phrase(answer), sentences.map((one) => phrase(one)), cures);
      settled(true);
    },
    spectrum({ panels }) {
      cards.come("spectrum", phrase);
      curves.draw($("spectrum"), panels, drawing());
    },
    robustness({ panels }) {
      cards.come("robustness", phrase);
      curves.draw($("robustness"), panels, drawing());
    },
    maps: (part) => maps.show($("maps"), part.maps, drawing()),
    comparison({ missing }) {
      cards.come("comparison", phrase);
      $("missing").hidden = !missing.length;
      $("missing").querySelector("ul").replaceChildren(...missing.map((one) => element("li", {}, phrase(one))));
      listDesigns();
    },
    consent({ files, changed }) {
      $("programs").replaceChildren(...files.map((path) => element("li", {}, element("code", {}, path))));
      $("changed").hidden = !changed;
      $("trust").checked = false;
      $("agree").disabled = true;
      if (!$("consent").open) $("consent").showModal();
      $("refuse").focus();
    },
  };

  function take(part) {
    parts[part.part]?.(part);
  }

  /** A start to choose: of a path the file's name, which a list has room for. */
  const started = (value, path) => element("option", { value, title: path }, path.split(/[\\/]/).at(-1));

  /** Offer a spec that was opened as a start. */
  function offer(name) {
    if (![...$("preset").options].some((one) => one.value === name)) $("preset").append(started(name, name));
  }

  function restart(preset) {
    state = { preset, edits: {} };
    wanted = performance.now();
    $("preset").value = preset;
    keep();
    ask();
  }

  function judge(kind, answer, reasons, cures) {
    $("verdict").className = `card verdict ${kind}`;
    $("pill").className = `pill ${kind}`;
    $("pill").textContent = phrase(`pill.${kind}`);
    $("answer").textContent = answer;
    $("reasons").replaceChildren(...reasons.map((one) => element("li", {}, one)));
    $("cures").replaceChildren(...cures.map((changes) => {
      const words = Object.entries(changes).map(([path, value]) => `${path} = ${Array.isArray(value) ? `[${value}]` : value}`).join(", ");
      const button = element("button", { type: "button", class: "main" }, words);
      button.addEventListener("click", () => edit(changes));
      return button;
    }));
  }

  /** Show whether what is seen belongs to the knobs, now that there is an answer: stale pictures fade. */
  function settled(stale) {
    clearTimeout(waiting);
    document.body.classList.remove("busy");
    document.body.classList.toggle("stale", stale);
    files.command();
  }

  /** Let the browser draw the curves before anything else is done, and note how long it took from the hand to them. */
  function paint(of, answered) {
    const began = turned.get(of);
    for (const old of turned.keys()) if (old <= of) turned.delete(old);
    painting = !document.hidden;
    requestAnimationFrame(() => setTimeout(() => {
      painting = false;
      if (began === undefined) document.documentElement.dataset.drawn = "true";
      else performance.measure("picture", { start: began, end: performance.now(), detail: { answered: answered - began } });
      receive();
    }));
  }

  function listDesigns() {
    designs.show(latest.comparison, latest.verdict?.point && { ...latest.verdict.point, method: "now" }, pins, {
      phrase, limit: latest.verdict?.allowed, residual: filled("residual", { load: phrase(latest.animation?.animation.load ?? "load") }),
      take: (row) => (row.pin ? (keep(), done.push(kept), kept = JSON.stringify(row.pin.state), go(row.pin.state), arrows()) : edit(row.edits)),
      unpin: (row) => { pins.splice(pins.indexOf(row.pin), 1); listDesigns(); take(latest.curves); },
    });
  }

  function notice(sentence) {
    $("notice").textContent = sentence;
    $("notice").hidden = !sentence;
  }

  // wiring --------------------------------------------------------------------------------------------------

  let socket;
  const send = (message) => socket.readyState === WebSocket.OPEN && socket.send(message);
  const say = (message) => send(JSON.stringify(message));

  /** Talk to the studio; one that is back gets the state that this page has. */
  function connect() {
    socket = new WebSocket(`ws://${location.host}/live`);
    socket.addEventListener("open", () => {
      if (asked === null) return say({ say: "open", address: views.state() });
      asked = null;
      notice("");
      logs.forget();
      ask();
    });
    socket.addEventListener("close", comeBack);
    socket.addEventListener("message", ({ data }) => {
      inbox.push(data);
      receive();
    });
  }

  /** Wait until the studio is there again, and this browser is let in. */
  async function comeBack() {
    const answer = await fetch("words.json").catch(() => null);
    if (answer?.ok) return connect();
    notice(phrase(answer ? "restarted" : "closed"));
    setTimeout(comeBack, COME_BACK);
  }

  /** Take what has come, unless the browser is to draw first. */
  function receive() {
    while (inbox.length && !painting) hear(JSON.parse(inbox.shift()));
  }

  function hear(part) {
    const lost = part.part === "failure";
    const elsewhere = { log: logs.show, drive: driving.show, watch: watched.show, files: files.hear, depth: lost && (() => {}) }[part.of];
    if (elsewhere) {
      elsewhere(part);
      return;
    }
    // while a hand is on a knob, curves of a moment ago are welcome, but nothing that would take the knob back
    if (part.serial < serial && !["hello", "sketch", "side", "curves", "animation"].includes(part.part)) return;
    latest[part.part] = part;
    if (part.part === "verdict") for (const old of ["failure", "faults"]) delete latest[old];
    if (["failure", "faults"].includes(part.part)) delete latest.verdict;
    take(part);
    cards.age(latest, serial);
  }

  $("undo").addEventListener("click", () => step(done, undone));
  $("redo").addEventListener("click", () => step(undone, done));
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || knobs.typing(event.target)) return;
    if (event.key === "z" && !event.shiftKey) step(done, undone);
    else if (event.key === "y" || (event.key === "Z" && event.shiftKey)) step(undone, done);
    else return;
    event.preventDefault();
  });
  $("preset").addEventListener("change", () => restart($("preset").value));
  $("pin").addEventListener("click", () => {
    const name = `${phrase("pinned")} ${1 + Math.max(0, ...pins.map((pin) => pin.number))}`;
    pins.push({ name, number: pins.length + 1, state, point: latest.verdict.point, panels: [...latest.curves.sway, ...latest.curves.motion] });
    listDesigns();
    take(latest.curves);
  });
  $("theme").addEventListener("click", () => {
    const dark = getComputedStyle(document.documentElement).getPropertyValue("--dark").trim() === "1";
    document.documentElement.dataset.theme = dark ? "light" : "dark";
    localStorage.setItem("theme", document.documentElement.dataset.theme);
    curves.redraw();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", curves.redraw);
  $("language").addEventListener("click", () => {
    words.speak(words.other());
    speak();
  });
  $("trust").addEventListener("change", () => { $("agree").disabled = !$("trust").checked; });
  $("agree").addEventListener("click", () => { $("consent").close("agreed"); say({ say: "agree", files: latest.consent.files }); });
  $("refuse").addEventListener("click", () => $("consent").close());
  $("consent").addEventListener("close", () => {
    if (!$("consent").returnValue) hear({ part: "failure", answer: "refused", sentences: [], cures: [], serial });
    $("consent").returnValue = "";
  });
  views.watch(() => {
    titled();
    curves.fit();
  });
  driving.lend({ phrase, filled, placed, say, edit, begin, knob: at, state: () => state });
  watched.lend({ phrase, say });
  files.lend({ phrase, filled, say, state: () => state });
  logs.begin({
    phrase, filled, notice, edit, drawing, say, send, state: () => state,
    mostUpload: () => latest.hello.most_upload,
  });
  const theme = localStorage.getItem("theme");
  if (theme) document.documentElement.dataset.theme = theme;
  speak();
  connect();
})();
