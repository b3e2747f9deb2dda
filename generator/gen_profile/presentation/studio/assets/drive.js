// A planner block driven by hand: a stick and a target for every axis, and the machines that follow, moment by moment.
"use strict";
const driving = (() => {
  const { draw, element } = knobs;
  const ENDS = 2; // frames before those to be shown, at the ends of the travel
  const MINUTE = 60, FIRST = 10; // s that the curves show at most, and at first
  const $ = (id) => document.getElementById(id);
  let page = null; // what the page lends: words, its state, its socket
  let drive = 0, number = 0;
  let running = false, pointing = false, order = null, sent = null, live = {}, sensor = {}, wind = [];
  let helm = null; // the controls, once it is known what there is to control
  let actors = null, playing = null, next = null, told = null;
  let history = null; // of the last minute: times, and what every curve was at them
  let still = false; // while another view is looked at, time stands still

  function begin() {
    park();
    drive += 1;
    running = true;
    order = { command: "", values: [] };
    live = {};
    sensor = {};
    wind = [];
    history = null;
    $("undriven").textContent = page.phrase("drive.preparing");
    $("undriven").className = "";
    ask();
  }

  function park() {
    if (!running) return;
    running = false;
    cancelAnimationFrame(playing);
    playing = next = actors = helm = told = null;
    $("undriven").textContent = "";
    for (const name of ["helm", "driven"]) $(name).replaceChildren();
    curves.draw($("minute"), [], {});
    document.querySelector("#drive .stage").replaceChildren();
    page.say({ say: "park" });
    buttons();
  }

  function ask() {
    sent = order;
    page.say({ say: "drive", number: ++number, state: page.state(), drive, ...order, live, sensor, wind });
  }

  function command(name, values = []) {
    order = { command: name, values };
  }

  // what comes ----------------------------------------------------------------------------------------------

  const parts = {
    driven(part) {
      part.answers = sent; // no later one was sent yet
      if (!actors) build(part);
      if (playing) next = part;
      else play(part);
    },
    undriven({ faults }) {
      park();
      const missing = faults.map(({ place }) => page.knob(place)).filter((knob) => knob?.optional && knob.value === null);
      const told = faults.map((fault) => element("p", {}, page.placed(fault)));
      const button = element("button", { type: "button" }, page.phrase("drive.limits"));
      button.addEventListener("click", () => {
        page.edit(Object.fromEntries(missing.map((knob) => [knob.path, page.begin(knob)])));
        begin();
      });
      $("undriven").replaceChildren(...told, ...(missing.length ? [button] : []));
      $("undriven").className = "bad";
    },
  };
  parts.failure = ({ sentences }) => parts.undriven({ faults: sentences.map((sentence) => ({ place: "", sentence })) });

  function show(part) {
    if (running && part.serial === number) parts[part.part]?.(part);
  }

  /** Show a moment while the next one is asked for. */
  function play(part) {
    const began = performance.now(), last = part.animation.frames - 1;
    still = views.current() !== "drive";
    if (!still) ask();
    tell(part);
    remember(part);
    const tick = (now) => {
      const share = Math.min(Math.max((now - began) / (1000 * part.seconds), 0), 1);
      actors.forEach((actor, index) => actor(ENDS + share * (last - ENDS), 1, part.animation.actors[index]));
      if (share < 1) playing = requestAnimationFrame(tick);
      else if (next) {
        const coming = next;
        next = null;
        play(coming);
      } else playing = null;
    };
    playing = requestAnimationFrame(tick);
  }

  /** Add a moment to the curves of the last minute, and draw them. */
  function remember(part) {
    const { axes, animation, trace } = part;
    const rows = axes.flatMap((_, axis) => [trace.position[axis], trace.low[axis], trace.high[axis], trace.position[axis].map(() => part.target?.[axis] ?? null), trace.velocity[axis]]);
    const sways = animation.actors.map((actor) => actor.sway_mm.slice(-trace.times.length));
    const all = [...rows, ...sways, ...(part.sensor ? [trace.estimated] : [])];
    history ??= { times: [], rows: all.map(() => []), now: 0, rested: 0 };
    if (part.busy || !part.promise) history.rested = history.now + part.seconds; // until then the load may swing
    history.times.push(...trace.times.map((time) => history.now + time));
    all.forEach((row, place) => history.rows[place].push(...row));
    history.now += part.seconds;
    const old = history.times.findIndex((time) => time > history.now - MINUTE);
    for (const row of [history.times, ...history.rows]) row.splice(0, old);
    if (!still) drawMinute(part);
  }

  function drawMinute({ axes, animation, sensor }) {
    const of = 5, end = Math.max(history.now, FIRST); // rows of an axis; end of the time that is shown
    const curve = (name, colour, y, more = {}) => ({ name, colour, dash: "solid", width: 1.6, y, ...more });
    const faint = { width: 0.8, colour: "ghost" };
    const panel = (title, unit, list, more = {}) => ({
      title, x_label: page.phrase("drive.time"), y_label: unit, x: history.times, curves: list, levels: [], bands: [],
      window: [Math.max(0, end - MINUTE), end], ...more,
    });
    const titled = (key, axis) => [page.phrase(key), axes.length > 1 ? page.phrase(axis.name) : ""].filter(Boolean).join(", ");
    const scaled = (axis, row) => row.map((value) => (value === null ? null : value * axis.factor));
    const panels = axes.flatMap((axis, index) => {
      const [position, low, high, target, velocity] = history.rows.slice(of * index, of * index + of);
      return [
        panel(titled("drive.position", axis), axis.unit, [
          curve("drive.position", "#0072b2", scaled(axis, position)),
          curve("drive.high", "", scaled(axis, high), faint),
          curve("drive.low", "", scaled(axis, low), faint),
          curve("drive.target", "#d55e00", scaled(axis, target), { dash: "dash" }),
        ], { area: [1, 2] }),
        panel(titled("drive.velocity", axis), `${axis.si}/s`, [curve("drive.velocity", "#0072b2", velocity)]),
      ];
    });
    const sways = animation.actors.map((actor, index) => curve(actor.name, actor.colour, history.rows[of * axes.length + index]));
    if (sensor) sways.push(curve("drive.estimated", "#d55e00", history.rows.at(-1), { dash: "dash" }));
    const kept = history.rested < history.now ? [animation.limit_mm, -animation.limit_mm] : [];
    const limits = kept.map((value) => ({ value, between: [history.rested, end] }));
    panels.push(panel(page.phrase("drive.sway"), "mm", sways, { levels: limits }));
    curves.draw($("minute"), panels, { phrase: page.phrase, language: words.language(), alone: true });
  }

  /** Write a place in the unit of the controller, to the millimetre or so. */
  const bare = (axis, value) => numbers.local((axis.factor * value).toFixed(Math.max(0, 3 - Math.round(Math.log10(axis.factor)))));
  const place = (axis, value) => `${bare(axis, value)} ${axis.unit}`;

  function tell(part) {
    told = part;
    const lines = part.axes.flatMap((axis) => {
      const name = part.axes.length > 1 ? `${page.phrase(axis.name)}: ` : "";
      return [
        [`${name}${page.phrase("position")}`, place(axis, axis.position)],
        [`${name}${page.phrase("velocity")}`, `${numbers.local(axis.velocity.toFixed(3))} ${axis.si}/s`],
        [`${name}${page.phrase("drive.stops")}`, `${bare(axis, axis.stop_low)} … ${place(axis, axis.stop_high)}`],
      ];
    });
    if (part.sensor) lines.push([page.phrase("drive.sensor"), sensorWords(part.sensor)]);
    $("driven").replaceChildren(...lines.map(([name, value]) => element("div", {}, element("dt", {}, name), element("dd", {}, value))));
    const kept = part.promise ? "promise" : "open";
    if ($("promise").dataset.kept !== kept) { // a screen reader gets changes only
      $("promise").dataset.kept = kept;
      $("promise").className = `pill ${part.promise ? "passed" : "open"}`;
      $("promise").textContent = page.phrase(`drive.${kept}`);
    }
    $("undriven").textContent = part.error ? page.filled("drive.error", { error: part.error }) : "";
    for (const slider of helm.live) slider.disabled = part.busy;
    for (const { mark, envelope, at, view } of helm.views) {
      mark.toggleAttribute("hidden", !part.target);
      if (part.target) mark.setAttribute("transform", at.put(part.marks[view]));
      const [from, to] = part.stops.map((ends) => at.screen(ends[view]));
      envelope.setAttribute("d", `M${from.join()}L${to.join()}`);
    }
    if (part.target && order.command === "point" && part.answers === order) {
      helm.targets.forEach(({ range, put }, index) => { range.value = String(part.target[index]); put(); });
      if (!pointing) command("target", part.target);
    }
    buttons();
  }

  function sensorWords({ fault, used, damping }) {
    if (fault) return page.filled("drive.sensor.fault", { fault });
    return page.phrase(damping ? "drive.sensor.damping" : used ? "drive.sensor.used" : "drive.sensor.unused");
  }

  function buttons() {
    $("begin").textContent = page.phrase(running ? "drive.anew" : "drive.begin");
    for (const name of ["halt", "brake", "leave", "promise"]) $(name).hidden = !told;
  }

  // controls ------------------------------------------------------------------------------------------------

  /** A slider with its name and, beside, the value that it stands for. */
  function slider(name, { least, most, value }, write, act) {
    const range = element("input", { type: "range", min: String(least), max: String(most), step: String((most - least) / 200), "aria-label": name });
    range.value = String(value);
    const output = element("span", { class: "unit" });
    const put = () => {
      output.textContent = write(Number(range.value));
      range.setAttribute("aria-valuetext", output.textContent);
    };
    range.addEventListener("input", () => { put(); act(); });
    put();
    return { range, put, host: element("label", { class: "lever" }, element("span", { class: "name" }, name), output, range) };
  }

  function build(part) {
    document.querySelector("#drive .stage").replaceChildren();
    actors = castAnimation(document.querySelector("#drive .stage"), { ...part.animation, load: page.phrase(part.animation.load), actors: part.animation.actors.map((actor) => ({ ...actor, name: page.phrase(actor.name) })), views: part.animation.views.map((view) => ({ ...view, title: page.phrase(view.title) })) }, numbers.local);
    const named = (key, axis) => [page.phrase(key), part.axes.length > 1 ? page.phrase(axis.name) : ""].filter(Boolean).join(", ");
    const sticks = part.axes.map((axis) => slider(named("drive.stick", axis), { least: -axis.fastest, most: axis.fastest, value: 0 }, (value) => `${numbers.local(value.toFixed(2))} ${axis.si}/s`, steer));
    const targets = part.axes.map((axis) => slider(named("move.target", axis), { least: axis.travel[0], most: axis.travel[1], value: axis.position }, (value) => place(axis, value), aim));
    function steer() { command("velocity", sticks.map(({ range }) => Number(range.value))); }
    function aim() { command("target", targets.map(({ range }) => Number(range.value))); }
    const gust = part.sensor?.wind ?? 0;
    const winds = (gust ? part.axes : []).map((axis) => slider(named("drive.wind", axis), { least: -gust, most: gust, value: 0 }, (value) => `${numbers.local(value.toFixed(2))} m/s²`, blow));
    function blow() { wind = winds.map(({ range }) => Number(range.value)); }
    for (const [levers, act] of [[sticks, steer], [winds, blow]]) {
      for (const { range, put } of levers) {
        range.addEventListener("pointerup", () => { // what is let go springs back
          range.value = "0";
          put();
          act();
        });
      }
    }
    const errors = (part.sensor?.knobs ?? []).map((knob) => slider(page.phrase(`drive.sensor.${knob.name}`), knob, (now) => numbers.local(now.toPrecision(2)), () => {
      for (const [index, { name }] of part.sensor.knobs.entries()) sensor[name] = Number(errors[index].range.value);
    }));
    const ropes = part.live.map(({ name, value, least, most, unit }) => slider(name, { least, most, value }, (now) => `${numbers.local(now.toFixed(2))} ${unit}`, () => {
      live = Object.fromEntries(ropes.map(({ range }, index) => [part.live[index].name, Number(range.value)]));
    }));
    const views = [...document.querySelectorAll("#drive .stage svg")].map((svg, place) => pictured(svg, part.animation.views, place % part.animation.views.length));
    helm = { sticks, targets, views, live: ropes.map(({ range }) => range) };
    const silent = element("input", { type: "checkbox" });
    silent.checked = Boolean(sensor.lost);
    silent.addEventListener("change", () => { sensor.lost = Number(silent.checked); });
    const silence = element("label", { class: "lever" }, element("span", {}, silent, ` ${page.phrase("drive.sensor.lost")}`));
    $("helm").replaceChildren(...[...sticks, ...targets, ...ropes, ...winds, ...errors].map(({ host }) => host), ...(part.sensor ? [silence] : []));
  }

  /** Let the target be dragged in a picture, and mark where the load will hang. */
  function pictured(svg, views, view) {
    const [left, bottom, width, height] = views[view].bounds, scale = 1000 / width;
    const envelope = draw(svg, "path", { class: "envelope" });
    const mark = draw(svg, "path", { class: "target", d: "M-8 0H8M0-8V8M-5 0a5 5 0 1 0 10 0a5 5 0 1 0-10 0" });
    const point = (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      command("point", [view, left + x / scale, bottom + height - y / scale]);
    };
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(event.pointerId);
      pointing = true;
      point(event);
    });
    svg.addEventListener("pointermove", (event) => { if (pointing) point(event); });
    for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => { pointing = false; });
    const screen = ([x, y]) => [(x - left) * scale, (bottom + height - y) * scale];
    const put = (at) => `translate(${screen(at).join(" ")}) scale(${1 / svg.getScreenCTM().a})`;
    return { mark, envelope, view, at: { screen, put } };
  }

  function stop(name) {
    for (const { range, put } of helm.sticks) {
      range.value = "0";
      put();
    }
    command(name);
  }

  /** Show the same in another language. */
  function speak() {
    delete $("promise").dataset.kept;
    if (told) {
      build(told);
      tell(told);
      drawMinute(told);
    }
    buttons();
  }

  function lend(given) {
    page = given;
    $("begin").addEventListener("click", begin);
    $("halt").addEventListener("click", () => stop("stop"));
    $("brake").addEventListener("click", () => stop("quick_stop"));
    $("leave").addEventListener("click", park);
    views.watch((name) => {
      if (running && still && name === "drive") {
        still = false;
        ask();
      }
    });
    buttons();
  }

  return { lend, show, speak };
})();
