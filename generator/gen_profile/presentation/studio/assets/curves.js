// Draws panels of curves with uPlot: limits that can be dragged, pinned designs behind, one cursor for all.
"use strict";
const curves = (() => {
  const HEIGHT = 190, GRIP = 8; // pixels
  const LINE = { solid: [], dash: [7, 4], dot: [2, 3] };
  const cursor = uPlot.sync("time");
  const hosts = new Map(); // element → its charts
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const { short } = numbers;

  /** Ends of the vertical axis: those of the curves and of the limits beside them, with some room. */
  function ends(chart, panel) {
    if (panel.span) return panel.span;
    const values = chart.data.slice(1).flatMap((row) => row.filter((value) => value !== null));
    if (panel.decades) {
      const top = Math.max(...values);
      return [top / 10 ** panel.decades, top * 1.6];
    }
    const shown = [...values, ...panel.levels.map((level) => level.value)];
    const low = Math.min(...shown), high = Math.max(...shown);
    const room = 0.06 * (high - low || Math.abs(high) || 1);
    return [low - room, high + room];
  }

  function behind(chart, panel) {
    const { ctx, bbox } = chart;
    for (const [low, high] of panel.bands) {
      const x = chart.valToPos(low, "x", true), width = chart.valToPos(high, "x", true) - x;
      ctx.fillStyle = colour("--band");
      if (width > 0) ctx.fillRect(x, bbox.top, width, bbox.height);
      else rule(chart, [x, bbox.top, x, bbox.top + bbox.height], colour("--quiet"), [2, 3]);
    }
  }

  function rule(chart, [x0, y0, x1, y1], stroke, dash, width = 1.2) {
    const { ctx } = chart;
    ctx.save();
    ctx.beginPath();
    ctx.rect(chart.bbox.left, chart.bbox.top, chart.bbox.width, chart.bbox.height);
    ctx.clip();
    ctx.strokeStyle = stroke;
    ctx.lineWidth = width * devicePixelRatio;
    ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
    ctx.beginPath();
    ctx.moveTo(x0, y0);
    ctx.lineTo(x1, y1);
    ctx.stroke();
    ctx.restore();
  }

  function inFront(chart, panel) {
    const { left, width } = chart.bbox;
    for (const { value, between } of panel.levels) {
      const [x0, x1] = between ? between.map((at) => chart.valToPos(at, "x", true)) : [left, left + width];
      const y = chart.valToPos(value, "y", true);
      rule(chart, [x0, y, x1, y], colour("--bad"), [6, 4], 1.4);
    }
  }

  /** Let limits, and the end of the move, be dragged where they are drawn. */
  function draggable(chart, holder) {
    let held = null; // what is dragged: a function from the event to an edit
    const near = (event) => {
      const { panel } = holder;
      const box = chart.over.getBoundingClientRect();
      const [x, y] = [event.clientX - box.left, event.clientY - box.top];
      const level = panel.levels.find((one) => {
        const [from, to] = one.between ?? [-Infinity, Infinity], at = chart.posToVal(x, "x");
        return panel.limit && from <= at && at <= to && Math.abs(chart.valToPos(one.value, "y") - y) < GRIP;
      });
      if (level) return ["ns-resize", (e) => [panel.limit.path, Math.abs(chart.posToVal(e.clientY - box.top, "y")) / panel.limit.factor]];
      const end = panel.end && panel.end.path && Math.abs(chart.valToPos(panel.end.at, "x") - x) < GRIP;
      return end ? ["ew-resize", (e) => [panel.end.path, chart.posToVal(e.clientX - box.left, "x")]] : null;
    };
    const tell = (event) => {
      const [path, value] = held(event);
      if (value > 0) holder.options.drag(path, Number(value.toPrecision(3)));
    };
    chart.over.addEventListener("pointerdown", (event) => {
      const found = near(event);
      if (!found) return;
      held = found[1];
      const { x, y } = chart.scales;
      holder.frozen = { x: [x.min, x.max], y: [y.min, y.max] }; // what a hand is on stands still
      chart.over.setPointerCapture(event.pointerId);
      event.stopImmediatePropagation();
      event.preventDefault();
    }, true);
    chart.over.addEventListener("pointermove", (event) => {
      if (held) tell(event);
      else chart.over.style.cursor = near(event)?.[0] ?? "";
    });
    for (const name of ["pointerup", "pointercancel"]) {
      chart.over.addEventListener(name, () => {
        if (!held) return;
        held = holder.frozen = null;
        holder.options.dropped();
        paint(holder);
      });
    }
  }

  function axis(label, more = {}) {
    return {
      stroke: () => colour("--quiet"), font: "11px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif",
      grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { stroke: () => colour("--grid"), width: 1, size: 4 },
      label, labelSize: 16, gap: 3, ...more,
    };
  }

  /** Data of a panel: its curves, and those of pinned designs that show the same. */
  function rows(panel, ghosts) {
    const all = [...panel.curves, ...ghosts];
    return [panel.x, ...all.map((curve) => curve.y)];
  }

  function make(host, holder, options) {
    const { panel } = holder;
    const timed = /^time/.test(panel.x_label) && !options.alone;
    const series = [...panel.curves, ...holder.ghosts].map((curve) => ({
      label: options.phrase(curve.name), stroke: curve.colour === "ghost" ? () => colour("--quiet") : curve.colour, width: curve.width,
      dash: LINE[curve.dash] ?? [], points: { show: false }, spanGaps: curve.spans ?? false,
      value: (_, value) => (value === null ? "" : short(value)),
    }));
    const chart = new uPlot({
      width: Math.max(host.clientWidth, 200), height: HEIGHT,
      legend: { show: series.length > 1, live: false, markers: { width: 2 } },
      cursor: { sync: timed ? { key: cursor.key, scales: ["x", null] } : undefined, drag: { x: false, y: false }, points: { size: 5 } },
      scales: {
        x: { time: false, range: (_, low, high) => holder.frozen?.x ?? holder.panel.window ?? [low, high] },
        y: { range: (self) => holder.frozen?.y ?? (self.data?.[1]?.length ? ends(self, holder.panel) : [0, 1]), distr: panel.decades ? 3 : 1 },
      },
      axes: [
        axis(options.phrase(panel.x_label), { size: 30, space: 60, values: (_, ticks) => ticks.map(short) }),
        axis(options.phrase(panel.y_label), { size: 48, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : short(tick))) }),
      ],
      series: [{}, ...series],
      bands: panel.area ? [{ series: panel.area.map((place) => place + 1), fill: () => colour("--band") }] : [],
      hooks: {
        drawAxes: [(self) => behind(self, holder.panel)],
        draw: [(self) => inFront(self, holder.panel)],
        setCursor: [(self) => {
          if (timed && self.cursor.event && self.cursor.left >= 0) options.seek?.(self.posToVal(self.cursor.left, "x"));
        }],
      },
    }, rows(panel, holder.ghosts), host);
    draggable(chart, holder);
    return chart;
  }

  const look = ({ panel, ghosts, options }) => JSON.stringify([
    panel.title, panel.x_label, panel.y_label, panel.curves.map((one) => [one.name, one.colour]), ghosts.map((one) => one.name), options.language,
  ]);

  /** Draw what a figure is to show; a chart stays as long as it has the same curves. */
  function paint(holder) {
    const { panel, options, figure } = holder;
    holder.due = false;
    holder.ghosts = options.ghosts?.(panel) ?? [];
    if (holder.look === look(holder)) {
      holder.chart.setData(rows(panel, holder.ghosts));
      return;
    }
    holder.look = look(holder);
    holder.chart?.destroy();
    const [caption, host] = figure.children;
    caption.textContent = options.phrase(panel.title);
    host.setAttribute("role", "img");
    host.setAttribute("aria-label", `${options.phrase(panel.title)}: ${options.phrase(panel.y_label)}`);
    holder.chart = make(host, holder, options);
  }

  // what is out of sight is drawn when it comes into sight: the hand does not wait for it
  const sight = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const holder = figures.get(target);
      if (!holder) continue;
      holder.seen = isIntersecting;
      if (holder.seen && holder.due) paint(holder);
    }
  }, { rootMargin: "80px" });
  const figures = new WeakMap();

  /** Show panels in an element. */
  function draw(element, panels, options) {
    const charts = hosts.get(element) ?? [], before = charts.length;
    for (const old of charts.splice(panels.length)) {
      sight.unobserve(old.figure);
      old.chart.destroy();
      old.figure.remove();
    }
    while (charts.length < panels.length) { // all of them before any is drawn: they share the width
      const figure = document.createElement("figure"), holder = { figure, seen: true };
      figure.append(document.createElement("figcaption"), document.createElement("div"));
      element.append(figure);
      charts.push(holder);
      figures.set(figure, holder);
      sight.observe(figure);
    }
    panels.forEach((panel, place) => {
      const holder = Object.assign(charts[place], { panel, options });
      if (holder.seen || !holder.chart) paint(holder);
      else holder.due = true;
    });
    if (charts.length !== before) charts.forEach(size);
    hosts.set(element, charts);
  }

  function everyChart(act) {
    for (const charts of hosts.values()) for (const holder of charts) act(holder);
  }
  function size({ chart, figure }) {
    const width = figure.clientWidth;
    if (width && width !== chart.width) chart.setSize({ width, height: HEIGHT });
  }
  const fit = () => everyChart(size);
  new ResizeObserver(fit).observe(document.getElementById("view"));
  return { draw, fit, redraw: () => everyChart(({ chart }) => chart.redraw(false, true)) };
})();
