// The knobs: native controls for every value of the spec, built from what the spec itself says of them.
"use strict";
const knobs = (() => {
  const DECADE = 900; // steps of a logarithmic slider: all numbers of three digits
  const STEPS = 200; // of another slider, at least
  const SVG = "http://www.w3.org/2000/svg";
  const OPEN = new Set(["move", "plant", "robustness"]);
  const panel = document.getElementById("knobs");
  let rows = [];
  let shape = "";

  const { digits, local } = numbers;
  const element = (name, attributes = {}, ...children) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key in made && typeof value !== "string") made[key] = value;
      else made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
  };

  /** Append an element of SVG. */
  const draw = (parent, name, attributes, text = "") => {
    const made = parent.appendChild(document.createElementNS(SVG, name));
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(text);
    return made;
  };

  /** Positions of a slider, which stand for round values in the unit that is shown, and its ends. */
  function scale({ span, logarithmic, whole, factor = 1 }) {
    const [low, high] = span.map((end) => end * factor);
    const made = (value, index) => ({
      least: index(low, Math.ceil), most: index(high, Math.floor),
      value: (at) => (whole ? Math.round : digits)(value(at) / factor),
      place: (known) => index(known * factor, Math.round),
    });
    if (logarithmic && low > 0) {
      return made(
        (at) => (at - DECADE * Math.floor(at / DECADE) + 100) * 10 ** (Math.floor(at / DECADE) - 2),
        (value, round) => {
          const power = Math.floor(Math.log10(value) + 1e-9);
          return DECADE * power - 100 + round(digits(value / 10 ** (power - 2), 9));
        },
      );
    }
    const step = whole ? 1 : 10 ** Math.floor(Math.log10((high - low) / STEPS || 1));
    return made((at) => at * step, (value, round) => round(digits(value / step, 9)));
  }

  /** Whether a hand has typed what it has not yet entered. */
  const typing = (field) => field.matches("[type=text], [type=number]") && document.activeElement === field && field.value !== field.defaultValue;

  /** Show a value, unless a hand is typing another one. */
  function write(field, text) {
    if (!typing(field)) field.value = field.defaultValue = text;
  }

  /** A field that tells the number that is entered; what is none leaves the value out where that may be, or else as it is. */
  function entry(label, tell, optional = false) {
    const field = element("input", { ...numbers.kind(), "aria-label": label });
    field.addEventListener("change", () => {
      const value = numbers.typed(field.value);
      const known = field.defaultValue;
      if (Number.isFinite(value)) field.defaultValue = field.value;
      else field.value = known;
      if (Number.isFinite(value)) tell(value);
      else if (optional) tell(null);
    });
    return field;
  }

  /** A number's field and its slider, which tell a value in SI units. */
  function number(knob, label, tell) {
    const field = entry(label, (value) => tell(value === null ? null : value / factor, true), knob.optional && knob.kind === "number");
    const slider = element("input", { type: "range", step: "1", "aria-label": label });
    const factor = knob.factor ?? 1;
    const slid = (done) => tell(scale(row.knob).value(Number(slider.value)), done);
    slider.addEventListener("input", () => slid(false));
    slider.addEventListener("change", () => slid(true));
    const row = {
      knob, field, slider,
      show(next, value) {
        row.knob = next;
        const known = typeof value === "number";
        write(field, known ? local(digits(value * factor)) : "");
        slider.hidden = !next.span || !known;
        if (slider.hidden) return;
        const { least, most, place } = scale(next);
        Object.assign(slider, { min: least, max: most });
        if (document.activeElement !== slider || !slider.matches(":active")) slider.value = place(value);
        slider.setAttribute("aria-valuetext", `${local(digits(value * factor))} ${next.unit ?? ""}`);
      },
    };
    return row;
  }

  const kinds = {
    number(knob, label, turn) {
      const one = number(knob, label, (value, done) => turn(value, done));
      const unit = element("span", { class: "unit" }, knob.unit ?? "");
      const parts = [element("div", { class: "value" }, one.field, unit), one.slider];
      const words = (knob.choices ?? []).map((choice) => {
        const box = element("input", { type: "checkbox" });
        box.addEventListener("change", () => turn(box.checked ? choice : one.last ?? knob.span?.[0], true));
        parts.push(element("label", { class: "word" }, box, knob.phrase(`${knob.words}.${choice}`)));
        return [choice, box];
      });
      return {
        parts,
        show(next) {
          if (typeof next.value === "number") one.last = next.value;
          for (const [choice, box] of words) box.checked = next.value === choice;
          one.field.disabled = words.some(([, box]) => box.checked);
          one.show(next, next.value);
        },
      };
    },
    interval(knob, label, turn) {
      const ends = ["from", "to"].map((end, which) => number(knob, `${label}, ${knob.phrase(end)}`, (value, done) => {
        const range = [...held.value];
        range[which] = value;
        turn(range.sort((a, b) => a - b), done);
      }));
      const share = element("span", { class: "unit" });
      const held = { value: null };
      const fields = element("div", { class: "value" }, ends[0].field, "–", ends[1].field, element("span", { class: "unit" }, knob.unit));
      const sliders = element("div", { class: "two" }, ...ends.map((end) => end.slider));
      return {
        parts: [fields, sliders, share],
        show(next) {
          held.value = next.value;
          for (const part of [fields, sliders, share]) part.hidden = !next.value;
          ends.forEach((end, which) => end.show(next, next.value?.[which]));
          if (!next.value) return;
          const [low, high] = next.value;
          share.textContent = local(`± ${digits((100 * (high - low)) / (high + low), 3)} %`);
        },
      };
    },
    pair(knob, label, turn) {
      const fields = ["from", "to"].map((end) => entry(`${label}, ${knob.phrase(end)}`, () => turn(fields.map((one) => numbers.typed(one.value)), true)));
      const value = element("div", { class: "value" }, fields[0], "–", fields[1], element("span", { class: "unit" }, knob.unit));
      return {
        parts: [value],
        show(next) {
          value.hidden = !next.value;
          if (next.value) fields.forEach((field, which) => write(field, local(digits(next.value[which]))));
        },
      };
    },
    choice(knob, label, turn) {
      const select = element("select", { "aria-label": label }, ...knob.choices.map((choice) =>
        element("option", { value: String(choice) }, knob.phrase(`${knob.words}.${choice}`, String(choice)))));
      select.addEventListener("change", () => turn(knob.choices[select.selectedIndex], true));
      return { parts: [select], show: (next) => { select.value = String(next.value); } };
    },
    several(knob, label, turn) {
      const boxes = knob.choices.map(() => element("input", { type: "checkbox" }));
      const taken = () => knob.choices.filter((_, place) => boxes[place].checked);
      for (const box of boxes) box.addEventListener("change", () => turn(taken(), true));
      const rows = boxes.map((box, place) => element("label", { class: "word" }, box, knob.phrase(knob.choices[place])));
      return {
        parts: [element("div", { role: "group", "aria-label": label }, ...rows)],
        show: (next) => boxes.forEach((box, place) => { box.checked = next.value.includes(knob.choices[place]); }),
      };
    },
    switch(knob, label, turn) {
      const box = element("input", { type: "checkbox", "aria-label": label });
      box.addEventListener("change", () => turn(box.checked, true));
      return { parts: [element("div", { class: "value" }, box)], show: (next) => { box.checked = next.value; } };
    },
    text(knob, label, turn) {
      const field = element("input", { type: "text", maxlength: "64", "aria-label": label });
      field.addEventListener("change", () => {
        field.defaultValue = field.value;
        turn(field.value, true);
      });
      return { parts: [field], show: (next) => write(field, next.value) };
    },
  };

  /** One knob with its name, and a box that states it or leaves it out. */
  function row(knob, options) {
    const about = knob.about ? options.phrase(knob.about) : "";
    const prefix = ["plant", "robustness.uncertain"].includes(knob.words) ? "" : `${options.phrase(knob.words)} `;
    const label = about ? `${prefix}${knob.name}: ${about}` : [options.phrase(knob.words), options.phrase(knob.name ?? "")].filter(Boolean).join(", ");
    const host = element("div", { class: `knob ${knob.kind}` });
    const made = kinds[knob.kind]({ ...knob, phrase: options.phrase }, label, (value, done) => options.turn(one.knob, value, done));
    const name = element(knob.optional ? "label" : "span", { class: "name" });
    let box = null;
    if (knob.optional) {
      box = element("input", { type: "checkbox" });
      box.addEventListener("change", () => options.turn(one.knob, box.checked ? options.begin(one.knob) : null, true));
      name.append(box);
    }
    if (about) name.append(prefix, element("b", {}, knob.name), ` ${about}`);
    else name.append(label);
    const help = element("a", { class: "help", href: knob.help, target: "gen-profile-help", hreflang: "en", "aria-label": `${options.phrase("help")}: ${label}`, title: options.phrase("help") }, "?");
    const fault = element("p", { class: "fault", hidden: true });
    host.append(name, ...made.parts, help, fault);
    const one = {
      knob, host, fault,
      show(next) {
        one.knob = next;
        if (box) box.checked = next.value !== null;
        host.classList.toggle("off", next.optional === true && next.value === null);
        made.show(next);
      },
    };
    return one;
  }

  function build(list, options) {
    const open = new Set([...panel.querySelectorAll("details[open]")].map((part) => part.dataset.group));
    const first = panel.childElementCount === 0;
    panel.replaceChildren();
    rows = list.map((knob) => row(knob, options));
    for (const group of new Set(list.map((knob) => knob.group))) {
      const part = element("details", { "data-group": group, open: first ? OPEN.has(group) : open.has(group) });
      part.append(element("summary", {}, options.phrase(`group.${group}`)));
      part.append(...rows.filter((one) => one.knob.group === group).map((one) => one.host));
      panel.append(part);
    }
  }

  /** Show knobs, and keep the controls while they are the same ones: a hand may be on one of them. */
  function show(list, options) {
    const next = JSON.stringify([options.language, list.map(({ path, index, kind, choices }) => [path, index, kind, choices])]);
    if (next !== shape) build(list, options);
    shape = next;
    list.forEach((knob, place) => rows[place].show(knob));
  }

  /** Say at a knob what is wrong with it, and give those that no knob shows. */
  function blame(faults) {
    const left = [...faults];
    for (const one of rows) {
      const found = left.findIndex(({ place }) => place && (place === one.knob.path || one.knob.path.startsWith(`${place}.`) || place.startsWith(`${one.knob.path}.`)));
      one.fault.hidden = found < 0;
      one.host.classList.toggle("wrong", found >= 0);
      if (found < 0) continue;
      one.fault.textContent = left[found].sentence;
      one.host.closest("details").open = true;
      left.splice(found, 1);
    }
    return left;
  }

  return { show, blame, typing, element, draw, scale };
})();
