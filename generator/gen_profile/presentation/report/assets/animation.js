// Plays the machines' moves: every machine in a picture of its own, all at the same time of the move.
// A page that has its animations as data gets them played; others call playAnimation(host, animation, words).
"use strict";
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const WORDS = { play: "Play", pause: "Pause", of: "of", arrived: "arrived", number: String };
  const LOOKS = {
    rail: { stroke: "#8a949d", "stroke-width": 2 },
    plumb: { stroke: "#9aa4ad", "stroke-width": 1, "stroke-dasharray": "4 3" },
    rope: { stroke: "currentColor", "stroke-width": 1.6 },
    spring: { stroke: "currentColor", "stroke-width": 1.6 },
    frame: { stroke: "currentColor", "stroke-width": 3 },
    liquid: { fill: "#7fb6de", stroke: "none" },
    body: { fill: "#5a6672" },
    hook: { fill: "currentColor" },
  };
  const COILS = 6;

  function element(parent, name, attributes) {
    const made = parent.appendChild(document.createElementNS(SVG, name));
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  }

  function zigzag([[x0, y0], [x1, y1]], width) {
    const points = [[x0, y0]];
    for (let coil = 0; coil <= 2 * COILS; coil += 1) {
      const share = 0.2 + (0.6 * coil) / (2 * COILS);
      const side = coil === 0 || coil === 2 * COILS ? 0 : (coil % 2 ? 1 : -1) * width;
      points.push([x0 + share * (x1 - x0), y0 + share * (y1 - y0) + side]);
    }
    points.push([x1, y1]);
    return points;
  }

  /** One machine from one side: an SVG and the function that sets its time. */
  function picture(host, view, moving, colour, obstacles) {
    const [left, bottom, width, height] = view.bounds;
    const [place, swing] = view.units;
    const scale = 1000 / width;
    const toScreen = ([x, y]) => [(x - left) * scale, (bottom + height - y) * scale];
    const svg = element(host, "svg", { viewBox: `0 0 1000 ${height * scale}`, role: "img", "aria-label": view.title });
    for (const [x, y, w, h] of obstacles) {
      const [across, up] = toScreen([x, y + h]);
      element(svg, "rect", { x: across, y: up, width: w * scale, height: h * scale, fill: "#8a949d", "fill-opacity": 0.6 });
    }
    const shapes = moving.shapes.map((shape) => {
      const line = ["rail", "plumb", "rope", "spring", "frame", "liquid"].includes(shape.kind);
      const look = { fill: "none", "vector-effect": "non-scaling-stroke", "stroke-linejoin": "round", ...LOOKS[shape.kind] };
      if (shape.kind === "load") look.fill = colour;
      const round = shape.kind === "hook";
      return { ...shape, line, node: element(svg, line ? "polyline" : round ? "ellipse" : "rect", look) };
    });

    return function show(frame, factor, { rest, swing: away } = moving) {
      const before = Math.min(Math.floor(frame), rest.length - 2);
      const share = frame - before;
      const mix = (rows, at) => rows[before][at] * (1 - share) + rows[before + 1][at] * share;
      const point = (index, swung) =>
        [0, 1].map((c) => mix(rest, 2 * index + c) * place + swung * mix(away, 2 * index + c) * swing);
      for (const { kind, line, node, points, size } of shapes) {
        let found = points.map((index) => toScreen(point(index, kind === "plumb" ? 0 : factor)));
        if (line) {
          if (kind === "spring") found = zigzag(found, 9);
          node.setAttribute("points", found.map((p) => p.map((v) => v.toFixed(2)).join()).join(" "));
        } else {
          const [[x, y]] = found;
          const [rx, ry] = size.map((half) => half * scale);
          if (node.tagName === "ellipse") {
            for (const [key, value] of Object.entries({ cx: x, cy: y, rx, ry })) node.setAttribute(key, value);
          } else {
            const box = { x: x - rx, y: y - ry, width: 2 * rx, height: 2 * ry, rx: 0.25 * ry };
            for (const [key, value] of Object.entries(box)) node.setAttribute(key, value);
          }
        }
      }
    };
  }

  /** The sway of all machines over time, with the limit after the arrival, and a cursor. */
  function strip(svg, animation) {
    const duration = animation.step * (animation.frames - 1);
    const greatest = Math.max(animation.limit_mm, ...animation.actors.flatMap((actor) => actor.sway_mm.map(Math.abs)));
    const x = (time) => (1000 * time) / duration;
    const y = (sway) => 50 - (46 * sway) / greatest;
    svg.setAttribute("viewBox", "0 0 1000 100");
    const limit = animation.limit_mm;
    element(svg, "rect", { x: x(animation.arrival), width: 1000, y: y(limit), height: y(-limit) - y(limit), fill: "#1b6e3c", opacity: 0.16 });
    const fine = { fill: "none", "vector-effect": "non-scaling-stroke" };
    element(svg, "path", { ...fine, d: `M${x(animation.arrival)} 0V100`, stroke: "#6b7680", "stroke-dasharray": "2 3" });
    for (const actor of animation.actors) {
      const points = actor.sway_mm.map((sway, frame) => `${x(frame * animation.step).toFixed(2)},${y(sway).toFixed(2)}`);
      element(svg, "polyline", { ...fine, points: points.join(" "), stroke: actor.colour, "stroke-width": 1.5 });
    }
    const cursor = element(svg, "path", { ...fine, stroke: "currentColor", "stroke-width": 1.5 });
    return (time) => cursor.setAttribute("d", `M${x(time)} 0V100`);
  }

  function cast(stage, animation, number = String) {
    stage.style.gridTemplateColumns = `repeat(${animation.actors.length}, 1fr)`;
    stage.style.setProperty("--views", animation.views.length); // all of them shall fit a screen
    return animation.actors.map((actor) => {
      const host = stage.appendChild(document.createElement("div"));
      host.className = "actor";
      host.style.borderTopColor = actor.colour;
      const title = host.appendChild(document.createElement("h3"));
      title.append(actor.name);
      const value = title.appendChild(document.createElement("span"));
      const pictures = animation.views.map((view, index) => {
        const show = picture(host, view, actor.views[index], actor.colour, index ? [] : animation.obstacles ?? []);
        if (animation.views.length > 1) host.appendChild(document.createElement("small")).append(view.title);
        return show;
      });
      return (frame, factor, moving = actor) => {
        const sway = moving.sway_mm[Math.round(frame)];
        value.textContent = `${animation.load} ${sway < 0 ? "−" : "+"}${number(Math.abs(sway).toFixed(2))} mm`;
        pictures.forEach((show, index) => show(frame, factor, moving.views[index]));
      };
    });
  }

  /** Play an animation, and give the means to put another one in its place, and to set the time in s. */
  function stage(host, animation, words = WORDS) {
    const find = (name) => host.querySelector(`.${name}`);
    const [slider, play, clock, speed, scale] = ["time", "play", "clock", "speed", "scale"].map(find);
    let actors, moveCursor, duration;
    let time = 0;
    let request = null; // of the next frame; null while nothing plays
    let last = null; // when the latest frame was shown; null before the first one

    function take(next) {
      animation = next;
      duration = animation.step * (animation.frames - 1);
      find("stage").replaceChildren();
      find("strip").replaceChildren();
      actors = cast(find("stage"), animation, words.number);
      moveCursor = strip(find("strip"), animation);
      slider.max = duration;
      time = Math.min(time, duration);
      show();
    }
    function show() {
      const frame = Math.min(time / animation.step, animation.frames - 1);
      for (const actor of actors) actor(frame, Number(scale.value));
      moveCursor(time);
      slider.value = time;
      const arrived = time >= animation.arrival ? `, ${words.arrived}` : "";
      clock.textContent = words.number(`${time.toFixed(2)} s ${words.of} ${duration.toFixed(1)} s${arrived}`);
      play.textContent = request === null ? words.play : words.pause;
    }
    function tick(now) {
      time = Math.min(time + (Number(speed.value) * (now - (last ?? now))) / 1000, duration);
      last = now;
      if (time >= duration) pause();
      else request = requestAnimationFrame(tick);
      show();
    }
    function pause() {
      cancelAnimationFrame(request);
      request = last = null;
    }
    play.addEventListener("click", () => {
      if (request !== null) {
        pause();
      } else {
        if (time >= duration) time = 0;
        request = requestAnimationFrame(tick);
      }
      show();
    });
    slider.addEventListener("input", () => {
      pause();
      time = Number(slider.value);
      show();
    });
    scale.addEventListener("change", show);
    // paper shows one moment: that of the greatest sway of the first machine
    let before = 0;
    addEventListener("beforeprint", () => {
      pause();
      const sways = animation.actors[0].sway_mm.map(Math.abs);
      before = time;
      time = animation.step * sways.indexOf(Math.max(...sways));
      show();
    });
    addEventListener("afterprint", () => { time = before; show(); });
    take(animation);
    return {
      take,
      /** Show a time, unless it plays. */
      seek(at) {
        if (request !== null) return;
        time = Math.min(Math.max(at, 0), duration);
        show();
      },
    };
  }

  window.playAnimation = stage;
  window.castAnimation = cast; // for what moves by steps given from outside: (frame, factor, the actor's new places) of every machine
  const data = document.getElementById("data");
  const animations = data ? JSON.parse(data.textContent).animations : [];
  document.querySelectorAll(".animation").forEach((host, index) => animations[index] && stage(host, animations[index]));
})();
