// Charts: Vega specifications embedded in the page, which fills in their rows. Vega loads no resources and evaluates no code.

const MARKS = { actions: false, ast: true, defaultStyle: false, mode: "vega", renderer: "svg" };

const SHARE = "share_title";

const THEME = {
  axis: { labelColor: "var(--ink)", titleColor: "var(--ink)", gridColor: "var(--line)", domainColor: "var(--soft)", tickColor: "var(--soft)" },
};

// A specification with the colours of the page: variables of style, which follow the theme and the printer.
function themed(chart, solvers) {
  const colours = { white: "var(--paper)", black: "var(--ink)", "#cccccc": "var(--line)" };
  for (const solver of solvers) colours[solver.colour] ??= `var(${solver.variable})`;
  const own = (value) => colours[value] ?? value;
  const isColour = (key) => ["fill", "stroke", "value", "range"].includes(key);
  const specification = JSON.parse(JSON.stringify(chart), (key, value) =>
    (!isColour(key) ? value : Array.isArray(value) ? value.map(own) : typeof value === "string" ? own(value) : value));
  const { config } = specification;
  for (const [part, colour] of Object.entries(THEME)) config[part] = { ...config[part], ...colour };
  return specification;
}

// Makes a signal the title of the axis of shares.
function nameShares(chart, title, value) {
  chart.signals = [...(chart.signals ?? []), { name: SHARE, value }];
  for (const axis of chart.axes ?? []) if (axis.title === title) axis.title = { signal: SHARE };
}

// The charts of one kind, one for each group of rows; they are redrawn when the rows change.
class Figure {
  // With `across`, a group is drawn only if its rows have at least two values of that name.
  constructor(run, name, id, across = "") {
    this.run = run;
    this.name = name;
    this.home = place(id);
    this.across = across;
    this.plots = [];
    this.groups = [];
    this.drawn = Promise.resolve();
    const csvButton = element("button", { type: "button", onclick: () => save(`${name}.csv`, csv(this.rows())) }, "Save as CSV");
    this.tools = element("div", { class: "tools" }, csvButton);
  }

  // Groups: {label, rows, axis}; `axis` is the title of the axis of shares.
  show(groups) {
    this.groups = groups;
    this.drawn = this.drawn.then(() => this.redraw()).catch((error) => console.error(error));
    return this.drawn;
  }

  rows() {
    const single = this.groups.length === 1 && !this.groups[0].label;
    return this.groups.flatMap(({ label, rows }) => rows.map((row) => (single ? row : { family: label, ...row })));
  }

  async redraw() {
    const groups = this.groups;
    while (this.plots.length > groups.length) this.plots.pop().view?.finalize();
    while (this.plots.length < groups.length) this.plots.push(this.plot());
    const plots = element("div", { class: "plots" }, this.plots.map((plot) => plot.home));
    this.home.replaceChildren(plots, ...(groups.some(({ rows }) => rows.length) ? [this.tools] : []));
    for (const [k, group] of groups.entries()) await this.draw(this.plots[k], group);
  }

  plot() {
    const [title, drawing] = [element("h4"), element("div", { class: "drawing" })];
    const plot = { home: element("div", { class: "plot" }, title, drawing), title, drawing, view: null };
    const fit = () => {
      const width = drawing.clientWidth;
      if (plot.view && width && width !== plot.view.width()) plot.view.width(width).runAsync();
    };
    new ResizeObserver(fit).observe(drawing);
    return plot;
  }

  async draw(plot, { label, rows, axis }) {
    plot.title.textContent = label;
    plot.title.hidden = !label;
    if (!rows.length || (this.across && rows.every((row) => row[this.across] === rows[0][this.across]))) {
      plot.view?.finalize();
      plot.view = null;
      plot.drawing.replaceChildren(element("p", { class: "note" }, "This selection has too few values for a chart."));
      return;
    }
    const width = plot.drawing.clientWidth || 480;
    if (plot.view) {
      if (axis) plot.view.signal(SHARE, axis);
      await plot.view.data(this.run.rows, structuredClone(rows)).width(width).runAsync();
      return;
    }
    const chart = themed(this.run.charts[this.name], this.run.solvers);
    chart.data.find((data) => data.name === this.run.rows).values = structuredClone(rows);
    chart.width = width;
    if (axis) nameShares(chart, this.run.share, axis);
    const tooltip = (handler, event, item, value) => {
      const texts = value && typeof value === "object" ? Object.entries(value).map((pair) => pair.join(": ")) : [value ?? ""];
      plot.drawing.title = texts.join("\n");
    };
    plot.drawing.replaceChildren();
    plot.view = (await vegaEmbed(plot.drawing, chart, { ...MARKS, tooltip })).view;
    const drawn = plot.drawing.querySelector("svg");
    drawn?.setAttribute("role", "img");
    drawn?.setAttribute("aria-label", `${this.name} ${label}`.trim());
  }
}
