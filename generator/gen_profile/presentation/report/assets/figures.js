// Draws the page's figures with Plotly: one plot per panel, one legend per figure, panels that zoom together.
"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("data").textContent).figures;
  const coarse = matchMedia("(pointer: coarse)").matches; // a finger must be able to scroll the page
  const axis = { showline: true, ticks: "outside", automargin: true, exponentformat: "power" };
  const dark = matchMedia("screen and (prefers-color-scheme: dark)");
  const LIGHT = { ink: "#17212b", paper: "#fff", grid: "#e6eaee", line: "#c3cbd2", limit: "#b3261e" };
  const DARK = { ink: "#e3e8ed", paper: "#14191e", grid: "#2b343c", line: "#4a5661", limit: "#ff8a80" };
  let shade = dark.matches ? DARK : LIGHT;

  /** Put another shade's colours for those of light paper, wherever a trace or a shape names them. */
  const shaded = (part) =>
    JSON.parse(JSON.stringify(part), (_, value) => {
      const name = Object.keys(LIGHT).find((key) => LIGHT[key] === value);
      return name ? shade[name] : value;
    });
  const MARGIN = { l: 56, r: 12, t: 28, b: 40 }; // the buttons stand above the curves
  const config = {
    displaylogo: false,
    responsive: true,
    displayModeBar: coarse ? true : "hover",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]], // none that sends data
    toImageButtonOptions: { format: "svg" },
  };

  function layoutOf(panel) {
    const { xaxis, yaxis, ...rest } = panel.layout;
    const lined = { ...axis, gridcolor: shade.grid, zerolinecolor: shade.line, linecolor: shade.line, tickcolor: shade.line };
    return {
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: shade.ink },
      margin: MARGIN,
      showlegend: false,
      hovermode: "x unified",
      dragmode: coarse ? false : "zoom",
      hoverlabel: { namelength: 40, bgcolor: shade.paper },
      paper_bgcolor: shade.paper,
      plot_bgcolor: shade.paper,
      ...shaded(rest),
      xaxis: { ...lined, ...xaxis, title: { ...xaxis.title, standoff: 6 } },
      yaxis: { ...lined, ...yaxis, title: { ...yaxis.title, standoff: 6 } },
    };
  }

  /** Let the zoom of one panel's horizontal axis move the others that show the same quantity. */
  function link(plots) {
    let busy = false;
    for (const plot of plots) {
      plot.on("plotly_relayout", async (change) => {
        const moved = Object.keys(change).some((key) => key.startsWith("xaxis."));
        if (busy || !moved) return;
        busy = true;
        const { range, autorange, title } = plot._fullLayout.xaxis;
        const same = plots.filter((other) => other !== plot && other._fullLayout.xaxis.title.text === title.text);
        const to = autorange ? { "xaxis.autorange": true } : { "xaxis.range": [...range], "xaxis.autorange": false };
        await Promise.all(same.map((other) => Plotly.relayout(other, to)));
        busy = false;
      });
    }
  }

  function sample(entry) {
    const line = { solid: "", dash: "6 3", dot: "2 2", points: "0 11" }[entry.dash]; // points: caps of nothing
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("width", 26);
    svg.setAttribute("height", 8);
    const path = svg.appendChild(document.createElementNS(svg.namespaceURI, "path"));
    path.setAttribute("d", "M2 4H26");
    path.setAttribute("stroke", entry.colour);
    path.setAttribute("stroke-width", entry.fill ? 8 : entry.dash === "points" ? 5 : 2.5);
    path.setAttribute("stroke-opacity", entry.fill || 1);
    path.setAttribute("stroke-linecap", entry.dash === "points" ? "round" : "butt");
    path.setAttribute("stroke-dasharray", line);
    return svg;
  }

  /** A button per curve, which shows or hides it in all panels. */
  function legend(host, entries, figure, plots) {
    if (entries.length < 2) return;
    for (const entry of entries) {
      const button = host.appendChild(document.createElement("button"));
      button.type = "button";
      button.append(sample(entry), entry.name);
      button.setAttribute("aria-pressed", entry.shown);
      button.addEventListener("click", () => {
        const shown = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", shown);
        figure.panels.forEach((panel, index) => {
          const curves = panel.data.flatMap((trace, place) => (trace.meta === entry.name ? [place] : []));
          if (curves.length) Plotly.restyle(plots[index], { visible: shown }, curves);
        });
      });
    }
  }

  async function draw() {
    const hosts = document.querySelectorAll("figure.curves");
    for (const [index, figure] of figures.entries()) {
      const plots = [...hosts[index].querySelectorAll(".plot")];
      for (const [place, panel] of figure.panels.entries()) {
        await Plotly.newPlot(plots[place], shaded(panel.data), layoutOf(panel), config);
        await new Promise((done) => setTimeout(done)); // let the reader scroll meanwhile
      }
      link(plots);
      legend(hosts[index].querySelector(".legend"), figure.legend, figure, plots);
    }
    document.documentElement.dataset.drawn = "true";
  }

  /** Draw in another shade; what a reader zoomed or hid stays. */
  function reshade(to) {
    if (to === shade) return;
    shade = to;
    const hosts = document.querySelectorAll("figure.curves");
    for (const [index, figure] of figures.entries()) {
      const plots = hosts[index].querySelectorAll(".plot");
      for (const [place, panel] of figure.panels.entries()) {
        const plot = plots[place];
        if (!plot.layout) continue;
        const { font, paper_bgcolor, plot_bgcolor, hoverlabel, shapes, xaxis, yaxis } = layoutOf(panel);
        const change = { font, paper_bgcolor, plot_bgcolor, hoverlabel, shapes };
        for (const [name, lines] of Object.entries({ xaxis, yaxis })) {
          for (const key of ["gridcolor", "zerolinecolor", "linecolor", "tickcolor"]) change[`${name}.${key}`] = lines[key];
        }
        Plotly.relayout(plot, change);
        shaded(panel.data).forEach((trace, curve) => {
          if (trace.line?.color) Plotly.restyle(plot, { "line.color": trace.line.color }, [curve]);
        });
      }
    }
  }
  dark.addEventListener("change", () => reshade(dark.matches ? DARK : LIGHT));

  // A browser lays out for paper only after it has asked the page to get ready: sizes are those of page.css.
  const PAPER = { width: (90 * 96) / 25.4, height: (54 * 96) / 25.4, margin: 6 };
  const resize = (size) => document.querySelectorAll(".js-plotly-plot").forEach((plot) => Plotly.relayout(plot, size));
  let folded = [];
  addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("details:not([open])")];
    for (const part of folded) part.open = true; // paper cannot be unfolded
    reshade(LIGHT);
    resize({ width: PAPER.width, height: PAPER.height, "margin.t": PAPER.margin, autosize: false });
  });
  addEventListener("afterprint", () => {
    for (const part of folded) part.open = false;
    reshade(dark.matches ? DARK : LIGHT);
    resize({ width: null, height: null, "margin.t": MARGIN.t, autosize: true });
  });
  draw();
})();
